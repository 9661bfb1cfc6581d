"""The bounds by which motions are watched: nothing moves farther."""

import numpy as np
import pytest

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.reference import checks as reference
from rrtik_ompl.kernels.tables.motion_bounds import bounds_table
from rrtik_tests.random_cases import ARMS, Case, joint_values

ROUNDING = 1e-7  # [m] of the numbers of the arm, which are float32


def rows_of(array, width):
    return array.reshape(-1, width)


def group_centres(arm, frames):
    """Centres of all balls of each group, in the world, each of shape (m, balls, 3)."""
    balls, clusters = (
        rows_of(arm.balls[0].balls, 4),
        rows_of(arm.balls[0].clusters, layout.CLUSTER_INTS),
    )
    for frame, first, end in rows_of(arm.balls[0].groups, layout.GROUP_INTS):
        span = slice(clusters[first][layout.CLUSTER_FIRST], clusters[end - 1][layout.CLUSTER_END])
        pose = frames[:, frame]
        yield np.einsum("mij,bj->mbi", pose[:, :, :3], balls[span, :3]) + pose[:, None, :, 3], pose


@pytest.mark.parametrize("name", ARMS)
def test_no_ball_moves_farther_than_the_bound_of_its_group(name):
    for seed in range(3):
        case = Case(name, seed, most_balls=4)
        arm, chain = case.world._arm, case.robot.chain
        table = bounds_table(chain, arm.balls[0], arm.strokes, arm.margin)
        bounds = table.rows.reshape(2 + len(chain.parent), -1)
        V, W = joint_values(case.robot, case.sample(60)), joint_values(case.robot, case.sample(60))
        share = np.random.default_rng(seed).choice([1e-3, 0.1, 1.0], (60, 1))
        W = V + share * (W - V)
        travel = np.abs(W - V) @ bounds[2:]
        before, after = (list(group_centres(arm, reference.frames(arm.arm, values))) for values in (V, W))
        for group, ((a, _), (b, _)) in enumerate(zip(before, after, strict=True)):
            assert (np.linalg.norm(b - a, axis=-1).max(axis=1) <= travel[:, group] + ROUNDING).all()
        pairs = rows_of(arm.balls[0].pair_groups, layout.PAIR_GROUP_INTS)
        for number, (one, other, *_) in enumerate(pairs, start=len(before)):
            seen = [_from(at[one][1], at[other][0]) for at in (before, after)]
            moved = np.linalg.norm(seen[1] - seen[0], axis=-1).max(axis=1)
            assert (moved <= travel[:, number] + ROUNDING).all() or _branched(chain, arm, one, other)


def _from(frames, points):
    """Points as frames see them, shape (m, n, 3)."""
    return np.einsum("mji,mbj->mbi", frames[:, :, :3], points - frames[:, None, :, 3])


def _branched(chain, arm, one, other):
    """Whether neither group is behind the other: seen from the one, the other moves by what moves both."""
    frames = rows_of(arm.balls[0].groups, layout.GROUP_INTS)[[one, other], layout.GROUP_FRAME] - 1
    lines = []
    for joint in frames.tolist():
        line = [joint]
        while chain.parent[line[-1]] >= 0:
            line.append(int(chain.parent[line[-1]]))
        lines.append(line)
    return frames[0] not in lines[1] or frames[0] == frames[1]

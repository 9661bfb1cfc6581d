"""The tables that kernels read: every number points into them, and an arm's are kept for a new scene."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables import memory
from rrtik_ompl.kernels.tables import robot_tables as tables
from rrtik_tests.random_cases import Case, joint_values

pytestmark = pytest.mark.kernels


def test_a_new_scene_keeps_the_tables_of_the_arm():
    case = Case("titan4", 2)
    again = [Body(b.name, b.joint, pin.SE3(b.placement), b.geometry, b.kind) for b in case.bodies]
    fewer = [p for p in case.pairs if all(case.bodies[k].name != "box" for k in p)]
    covers = {"outer": case.outer, "inner": case.inner}
    world = FastWorld(case.robot.chain, again, fewer, **covers, like=[case.world.arm])
    assert world._arm is case.world._arm
    V = joint_values(case.robot, case.sample(500))
    np.testing.assert_array_equal(world.classify(V), FastWorld(case.robot.chain, again, fewer, **covers).classify(V))
    assert FastWorld(case.robot.chain, again, fewer[:-3], **covers, like=[case.world.arm])._arm is not None


def test_every_number_in_the_tables_points_into_them():
    case = Case("panda", 4)
    for balls in case.world._arm.balls:
        clusters, count = balls.clusters.reshape(-1, 4), len(balls.balls) // 4
        assert clusters[0, 2] == 0
        assert clusters[-1, 3] == count
        assert (clusters[1:, 2] == clusters[:-1, 3]).all()
        assert len(clusters) == balls.cluster_count
        assert balls.groups.reshape(-1, 3)[-1, 2] == len(clusters)
        assert balls.pairs.max() < balls.body_count
        assert balls.pair_groups.reshape(-1, 4)[-1, 3] == balls.pair_count
    for rows in case.world._primitives:
        numbers = rows.heads.reshape(-1, 4)
        assert numbers[:, 1].max() < rows.standing_count
        assert numbers[:, 3].max() <= len(rows.planes) // 4
        assert rows.padded_count % WIDTH == 0


def test_balls_around_balls_contain_them():
    rng = np.random.default_rng(0)
    sets = [
        np.column_stack([rng.normal(size=(count, 3)), rng.uniform(0.1, 1.0, count)]) for count in (1, 2, 3, 8, 50, 9)
    ]
    assert not tables.enclosing_balls([sets[0][:0]]).any()
    for spheres, ball in zip(sets, tables.enclosing_balls(sets), strict=True):
        np.testing.assert_array_equal(ball, tables.enclosing_balls([spheres])[0])
        depth = np.linalg.norm(spheres[:, :3] - ball[:3], axis=1) + spheres[:, 3]
        assert depth.max() <= ball[3]
        assert ball[3] < 1.2 * 0.5 * (np.ptp(spheres[:, :3], axis=0).max() + 2.0 * spheres[:, 3].max()) * np.sqrt(3)


@pytest.mark.parametrize("words", [8, 2 * memory.COPIED_WORDS])
def test_what_was_in_memory_before_is_not_in_a_planned_table(words, monkeypatch):
    def used(size):
        return np.full(size, 7.0)

    monkeypatch.setattr(memory.np, "empty", used)
    made = memory.PlannedTable(memory.TablePlan({0: words}, {1: 3}))
    assert not made[0].any()
    assert made.header[1] == 3
    assert made.intact()

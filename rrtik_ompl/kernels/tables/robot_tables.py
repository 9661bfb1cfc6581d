"""The arm as flat tables for the kernels: joints, and balls grouped by joint, body and neighbourhood.

Places of fields: :mod:`rrtik_ompl.kernels.layout`. A table owns the float32 and int32 arrays whose addresses it
holds. Every joint frame is turned so that its axis is z; the balls and the frames of the next joints are turned along.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels.layout import (
    ALIGNED_TURN,
    BALL_FLOATS,
    BODY_END,
    BODY_FIRST,
    BODY_FRAME,
    BODY_INTS,
    CLUSTER_BODY,
    CLUSTER_END,
    CLUSTER_FIRST,
    CLUSTER_FRAME,
    CLUSTER_INTS,
    FIRST_TURN,
    GROUP_END,
    GROUP_FIRST,
    GROUP_FRAME,
    GROUP_INTS,
    ORIGIN,
    PAIR_GROUP_END,
    PAIR_GROUP_FIRST,
    PAIR_GROUP_INTS,
    PAIR_GROUP_ONE,
    PAIR_GROUP_OTHER,
    PAIR_INTS,
    PAIR_LOOKED_UP,
    PAIR_ONE,
    PAIR_OTHER,
    POSE_NUMBERS,
    ROTATION,
    SLIDE,
    TURN,
    ArmTable,
    BallTable,
)
from rrtik_ompl.kernels.tables.memory import packed, whole_records
from rrtik_ompl.model.robot import Chain

Spheres: TypeAlias = NDArray[np.float64]  # shape (n, 4): centre and radius [m]

CLUSTER_SIZE = 8  # balls in the smallest neighbourhood, at most
KEPT_SETS = 4096  # sets of balls whose neighbourhoods and enclosing balls are kept
UNBOUNDED_RADIUS = 1e6  # [m] radius of the ball that stands for a body without end

PARALLEL = 1e-6  # sine of the angle between two axes below which they count as parallel
ALIGNED = 1e-12  # of a placement's rotation: by how much its axis may be off

SMALLEST_MARGIN = 2e-5  # [m]
MARGIN_PER_LEVER = 1e-6  # a joint's rotation in float32 errs by less than this angle [rad]
MARGIN_PER_METRE = 5e-6  # relative error of a coordinate in float32, with room for all that is added up


@dataclass(frozen=True, slots=True, eq=False)
class MovingBody:
    """What the kernels know of a body: the frame that carries it and its balls in that (turned) frame."""

    frame: int
    outer: Spheres
    inner: Spheres


def arm_table(chain: Chain) -> ArmTable:
    """The joints of a tree."""
    turns = axis_turns(chain)
    parents = chain.parent.tolist()
    placements = np.empty((len(parents), POSE_NUMBERS))
    phases = np.zeros(len(parents))
    kinds = [
        SLIDE if slides else TURN if parent >= 0 else FIRST_TURN
        for slides, parent in zip(chain.prismatic, parents, strict=True)
    ]

    for row, parent in enumerate(parents):
        back = turns[parent].T if parent >= 0 else np.eye(3)
        rotation = back @ chain.placement[row][:3, :3] @ turns[row]
        if kinds[row] == TURN and abs(rotation[0, 2]) < ALIGNED:
            kinds[row] = ALIGNED_TURN
            phases[row] = np.arctan2(-rotation[0, 1], rotation[0, 0])
            cosine = rotation[2, 2]
            sine = -rotation[1, 2]
            rotation = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])

        placements[row, ROTATION : ROTATION + 9] = rotation.ravel()
        placements[row, ORIGIN : ORIGIN + 3] = back @ chain.placement[row][:3, 3]

    return packed(
        ArmTable,
        joint_count=len(parents),
        parents=chain.parent.astype(np.int32) + np.int32(1),
        joint_kinds=np.array(kinds, dtype=np.int32),
        placements=placements.astype(np.float32),
        phases=phases,
    )


@lru_cache(maxsize=64)
def axis_turns(chain: Chain) -> NDArray[np.float64]:
    """For each joint a rotation that takes z to the joint's axis, shape (n, 3, 3).

    Its x is square to the axis of the first joint behind it, too, so that the placement of that one turns about x and z
    alone, as in the tables of Denavit and Hartenberg [33].
    """
    turns = np.empty((len(chain.parent), 3, 3))
    parents = chain.parent.tolist()
    for row, axis in enumerate(chain.axis):
        behind = parents.index(row) if row in parents else None
        square = np.zeros(3)
        if behind is not None:
            square = np.cross(axis, chain.placement[behind][:3, :3] @ chain.axis[behind])
        if np.linalg.norm(square) < PARALLEL:
            square = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
        x = square / np.linalg.norm(square)
        turns[row] = np.column_stack([x, np.cross(axis, x), axis])

    return frozen(turns)


def moving_body(chain: Chain, body: Body, outer: Spheres, inner: Spheres, margin: float) -> MovingBody:
    """A body's balls in the turned frame of its joint, the outer ones grown and the inner ones shrunk by ``margin``.

    Both are grown by the body's padding. A body without outer cover is given its bounding ball.
    """
    turn = axis_turns(chain)[body.joint - 1].T
    cover = usable_cover(body.geometry, outer)
    grown, shrunk = (_moved(body.placement, spheres, turn) for spheres in (cover, inner))
    grown[:, 3] += body.padding + margin
    shrunk[:, 3] += body.padding - margin

    return MovingBody(body.joint, grown, shrunk[shrunk[:, 3] > 0.0])


def usable_cover(geometry: Any, outer: Spheres) -> Spheres:
    """The outer spheres of a body, or its bounding ball if there are none or they have no end."""
    spheres = np.asarray(outer, dtype=np.float64).reshape(-1, 4)
    return spheres if len(spheres) and np.abs(spheres).max() < UNBOUNDED_RADIUS else bounding_ball(geometry)


def _moved(placement: Any, spheres: Spheres, turn: Matrix) -> Spheres:
    moved = np.array(spheres, dtype=np.float64).reshape(-1, 4)
    moved[:, :3] = (moved[:, :3] @ placement.rotation.T + placement.translation) @ turn.T
    return moved


def bounding_ball(geometry: Any) -> Spheres:
    """A ball that contains a coal geometry, shape (1, 4); a huge one if the geometry has no end."""
    radius = float(geometry.aabb_radius)
    if not (0.0 <= radius < UNBOUNDED_RADIUS and np.abs(geometry.aabb_center).max() < UNBOUNDED_RADIUS):
        return np.array([[0.0, 0.0, 0.0, UNBOUNDED_RADIUS]])
    return np.array([[*geometry.aabb_center, radius]])


def rounding_margin(chain: Chain, reaches: Sequence[tuple[int, float]], strokes: Vector) -> float:
    """How far float32 may misplace a ball [m], with room to spare.

    Each joint turns all that it carries by a rotation that errs by less than ``MARGIN_PER_LEVER``, so it contributes
    that angle times the farthest point that it carries; coordinates err in proportion to their size.

    Args:
        chain: The tree.
        reaches: For each moving body its joint number and the distance of its farthest point from the joint's frame.
        strokes: Largest value of each sliding joint [m], shape (n,).
    """
    count = len(chain.parent)
    levers = np.zeros(count)
    extent = 0.0

    for joint, reach in reaches:
        levers[joint - 1] = max(levers[joint - 1], reach)
    for row in range(count - 1, -1, -1):  # children come after their parents, so they are done first
        parent = chain.parent[row]
        reach = levers[row] + float(np.linalg.norm(chain.placement[row][:3, 3]))
        reach += strokes[row] if chain.prismatic[row] else 0.0
        extent = max(extent, reach)
        if parent >= 0:
            levers[parent] = max(levers[parent], reach)

    return max(SMALLEST_MARGIN, MARGIN_PER_LEVER * float(levers.sum()), MARGIN_PER_METRE * extent)


def ball_table(
    bodies: Sequence[MovingBody],
    pairs: Sequence[tuple[int, int]],
    *,
    inner: bool,
    kept: float,
    looked_up: Collection[tuple[int, int]] = (),
) -> BallTable:
    """Balls of the moving bodies in three levels, and the pairs of bodies (numbers in ``bodies``) to test.

    Args:
        bodies: The moving bodies.
        pairs: Pairs of them that must not touch.
        inner: Whether to take the inner balls; bodies without balls take no part.
        kept: How far the bodies of a pair must stay apart [m].
        looked_up: Those of the pairs whose balls need not be looked at.
    """
    shapes = [body.inner if inner else body.outer for body in bodies]
    frames = sorted({b.frame for b, balls in zip(bodies, shapes, strict=True) if len(balls)}, reverse=True)
    groups: list[dict[int, int]] = []
    clusters: list[dict[int, int]] = []
    balls: list[Spheres] = []
    count = 0  # of balls
    spans = [{BODY_FRAME: 0, BODY_FIRST: 0, BODY_END: 0} for _ in bodies]

    for frame in frames:
        start = len(clusters)
        for number, body in enumerate(bodies):
            if body.frame == frame and len(shapes[number]):
                first_cluster = len(clusters)
                for part in neighbourhoods(shapes[number]):
                    span = {CLUSTER_FIRST: count, CLUSTER_END: count + len(part)}
                    clusters.append({CLUSTER_BODY: number, CLUSTER_FRAME: frame} | span)
                    balls.append(part)
                    count += len(part)

                spans[number] = {BODY_FRAME: frame, BODY_FIRST: first_cluster, BODY_END: len(clusters)}

        groups.append({GROUP_FRAME: frame, GROUP_FIRST: start, GROUP_END: len(clusters)})

    stacked = np.concatenate([np.zeros((0, BALL_FLOATS)), *balls])
    group_of = {frame: k for k, frame in enumerate(frames)}
    present = [(i, j) for i, j in pairs if len(shapes[i]) and len(shapes[j])]
    present.sort(key=lambda p: sorted(group_of[bodies[k].frame] for k in p))
    pair_groups = _pair_groups([(group_of[bodies[i].frame], group_of[bodies[j].frame]) for i, j in present])
    runs = [(clusters[g[GROUP_FIRST]][CLUSTER_FIRST], clusters[g[GROUP_END] - 1][CLUSTER_END]) for g in groups]
    sets = [*shapes, *(stacked[first:end] for first, end in runs), *balls]
    body_balls, group_balls, cluster_balls = np.split(
        enclosing_balls(sets).astype(np.float32), [len(bodies), len(bodies) + len(groups)]
    )

    return packed(
        BallTable,
        group_count=len(groups),
        groups=whole_records(GROUP_INTS, groups),
        group_balls=group_balls,
        clusters=whole_records(CLUSTER_INTS, clusters),
        cluster_balls=cluster_balls,
        balls=stacked.astype(np.float32),
        bodies=whole_records(BODY_INTS, spans),
        body_balls=body_balls,
        pair_group_count=len(pair_groups),
        pair_groups=whole_records(PAIR_GROUP_INTS, pair_groups),
        pairs=whole_records(
            PAIR_INTS, [{PAIR_ONE: i, PAIR_OTHER: j, PAIR_LOOKED_UP: int((i, j) in looked_up)} for i, j in present]
        ),
        cluster_count=len(clusters),
        body_count=len(bodies),
        pair_count=len(present),
        self_margin=np.array([kept], dtype=np.float32),
    )


def _pair_groups(groups: Sequence[tuple[int, int]]) -> list[dict[int, int]]:
    """Runs of pairs between the same two groups."""
    runs: list[dict[int, int]] = []
    for k, (one, other) in enumerate(groups):
        if runs and {one, other} == {runs[-1][PAIR_GROUP_ONE], runs[-1][PAIR_GROUP_OTHER]}:
            runs[-1][PAIR_GROUP_END] = k + 1
        else:
            span = {PAIR_GROUP_FIRST: k, PAIR_GROUP_END: k + 1}
            runs.append({PAIR_GROUP_ONE: one, PAIR_GROUP_OTHER: other} | span)

    return runs


def neighbourhoods(spheres: Spheres) -> tuple[Spheres, ...]:
    """Split balls in halves across their widest spread until no part has more than ``CLUSTER_SIZE``; large first.

    What was split before is kept: a link has the same balls wherever the arm works and whatever it holds.
    """
    return _neighbourhoods(spheres.tobytes())


@lru_cache(maxsize=KEPT_SETS)
def _neighbourhoods(balls: bytes) -> tuple[Spheres, ...]:
    return tuple(frozen(part) for part in _halved(np.frombuffer(balls).reshape(-1, BALL_FLOATS)))


def _halved(spheres: Spheres) -> list[Spheres]:
    if len(spheres) <= CLUSTER_SIZE:
        return [spheres[np.argsort(-spheres[:, 3])]]
    axis = int(np.argmax(np.ptp(spheres[:, :3], axis=0)))
    order = np.argsort(spheres[:, axis], kind="stable")
    middle = len(spheres) // 2
    return _halved(spheres[order[:middle]]) + _halved(spheres[order[middle:]])


_known_balls: dict[bytes, NDArray[np.float64]] = {}


def enclosing_balls(sets: Sequence[Spheres]) -> Spheres:
    """A small ball around each of several sets of balls, shape (sets, 4): steps towards the farthest one [43].

    The best ball of forty steps is kept; all sets take them together. No balls have the ball 0 around them. What was
    found before is kept, as :func:`neighbourhoods` does.
    """
    keys = [spheres.tobytes() for spheres in sets]
    found = {key: ball for key in keys if (ball := _known_balls.get(key)) is not None}  # others may forget meanwhile
    new = {key: spheres for key, spheres in zip(keys, sets, strict=True) if key not in found}
    found[b""] = np.zeros(BALL_FLOATS)
    found |= {key: spheres[0] for key, spheres in new.items() if len(spheres) == 1}

    # Sets of like size share an array, in which the smaller ones are filled up by their first ball.
    alike: dict[int, list[bytes]] = {}
    for key, spheres in new.items():
        if len(spheres) > 1:
            alike.setdefault(len(spheres).bit_length(), []).append(key)
    for some in alike.values():
        found |= zip(some, _balls_around([new[key] for key in some]), strict=True)

    if len(_known_balls) > KEPT_SETS:
        _known_balls.clear()
    _known_balls.update({key: found[key] for key in new})
    return np.array([found[key] for key in keys]).reshape(-1, BALL_FLOATS)


def _balls_around(sets: Sequence[Spheres]) -> Spheres:
    """As :func:`enclosing_balls`, for sets of two balls or more."""
    most = max(map(len, sets))
    spheres = np.stack([np.concatenate([each, np.repeat(each[:1], most - len(each), axis=0)]) for each in sets])
    centres = spheres[:, :, :3]
    radii = spheres[:, :, 3]
    every = np.arange(len(sets))
    centre = 0.5 * ((centres - radii[:, :, None]).min(axis=1) + (centres + radii[:, :, None]).max(axis=1))
    best = centre
    radius = np.full(len(sets), np.inf)

    for step in range(1, 41):
        away = centres - centre[:, None]
        depths = np.sqrt(np.add.reduce(away * away, axis=2)) + radii
        farthest = np.argmax(depths, axis=1)
        depth = depths[every, farthest]
        better = depth < radius
        best = np.where(better[:, None], centre, best)
        radius = np.where(better, depth, radius)
        centre = centre + (centres[every, farthest] - centre) / (step + 3)

    slack = MARGIN_PER_LEVER * (radius + np.abs(best).max(axis=1))
    return np.column_stack([best, radius + slack])

"""Collision checks and distances: the kernels' answers in plain numpy, ball by ball, some thousand times slower."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.tables.cloud_layout import LEAF, CloudTable

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
CHUNK = 64  # configurations at a time, to bound memory
FIRST_PART = 4  # configurations of a motion that are checked first; then twice as many each time


def frames(arm: layout.ArmTable, values: Matrix) -> NDArray[np.float64]:
    """Joint frames as rotation and origin, world first, shape (m, joints + 1, 3, 4)."""
    fixed = arm.placements.astype(np.float64).reshape(-1, layout.POSE_NUMBERS)
    turns = fixed[:, layout.ROTATION : layout.ROTATION + 9]
    origins = fixed[:, layout.ORIGIN : layout.ORIGIN + 3]
    found = np.zeros((len(values), len(fixed) + 1, 3, 4))
    found[:, 0, :, :3] = np.eye(3)

    for joint, (parent, kind) in enumerate(zip(arm.parents, arm.joint_kinds, strict=True)):
        above = found[:, parent]
        rotation = above[:, :, :3] @ turns[joint].reshape(3, 3)
        origin = above[:, :, 3] + above[:, :, :3] @ origins[joint]
        value = values[:, joint, None] + arm.phases[joint]
        sliding = kind == layout.SLIDE
        x = rotation[:, :, 0]
        y = rotation[:, :, 1]
        z = rotation[:, :, 2]
        sine = np.sin(value)
        cosine = np.cos(value)
        turned = (x, y) if sliding else (x * cosine + y * sine, y * cosine - x * sine)
        found[:, joint + 1] = np.stack([*turned, z, origin + (z * value if sliding else 0.0)], axis=2)

    return found


class PrimitiveView:
    """One primitive of a table, as numpy reads it.

    Attributes:
        kind: Of the layout.
        standing: Number of the standing body that it belongs to.
    """

    def __init__(self, primitives: layout.PrimitiveTable, number: int) -> None:
        shapes = primitives.shapes.reshape(-1, layout.SHAPE_FLOATS)
        head = heads(primitives)[number]
        self._shape: Vector = shapes[number].astype(np.float64)
        self.kind = int(head[layout.KIND])
        self.standing = int(head[layout.STANDING_BODY])
        self._planes = primitives.planes.reshape(-1, layout.PLANE_FLOATS)
        self._span = slice(head[layout.FIRST_PLANE], head[layout.END_PLANE])
        self._clouds = primitives.clouds
        self._cloud = int(head[layout.FIRST_PLANE])

    def number(self, place: int) -> float:
        """One of its numbers."""
        return float(self._shape[place])

    def vector(self, place: int) -> Vector:
        """Three of its numbers."""
        return self._shape[place : place + 3]

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Largest signed distance of points, shape (..., 3), from the planes of a convex one. Shape (...)."""
        planes = self._planes[self._span].astype(np.float64)
        normals = planes[:, layout.PLANE_NORMAL : layout.PLANE_NORMAL + 3]
        return np.asarray((points @ normals.T - planes[:, layout.PLANE_OFFSET]).max(axis=-1))

    def half_space_gap(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signed distance of points, shape (..., 3), from a half-space. Shape (...)."""
        normal = self.vector(layout.HALF_SPACE_NORMAL)
        offset = self.number(layout.HALF_SPACE_OFFSET)
        return np.asarray(points @ normal - offset)

    def beyond_faces(self, away: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far points, shape (..., 3) and seen from its centre, lie beyond each pair of a box's faces."""
        axes = self._shape[layout.BOX_AXES : layout.BOX_AXES + 9].reshape(3, 3)
        return np.asarray(np.abs(away @ axes.T) - self.vector(layout.BOX_HALF_SIZES))

    def to_capsule(self, away: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of points, shape (..., 3) and seen from a capsule's first end, from its axis. Shape (...)."""
        axis = self.vector(layout.CAPSULE_AXIS)
        share = np.clip((away @ axis) * self.number(layout.CAPSULE_INVERSE_SQUARE), 0.0, 1.0)
        return np.asarray(np.linalg.norm(away - share[..., None] * axis, axis=-1))

    def beyond_ends(self, away: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How far points, seen from its centre, lie beyond a cylinder's ends and beyond its side."""
        axis = self.vector(layout.CYLINDER_AXIS)
        along = away @ axis
        across = np.linalg.norm(away - along[..., None] * axis, axis=-1)
        beyond = np.abs(along) - self.number(layout.CYLINDER_HALF_LENGTH)
        return beyond, across - self.number(layout.CYLINDER_RADIUS)

    def to_points(self, away: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of points, shape (..., 3) and seen from a cloud's origin, from its nearest point or cube."""
        axes = self._shape[layout.CLOUD_AXES : layout.CLOUD_AXES + 9].reshape(3, 3)
        cloud = self._clouds[self._cloud]
        own = away @ axes.T
        tree = search_tree(cloud)
        distances = np.asarray(tree.query(own)[0])
        if cloud.half == 0.0:
            return distances

        # The nearest cube's centre is at most a cube's diagonal farther away than the nearest centre.
        rows = own.reshape(-1, layout.AXES)
        near = tree.query_ball_point(rows, distances.ravel() + 2.0 * np.sqrt(3.0) * cloud.half)
        gaps = [_to_cubes(tree.data[them] - row, cloud.half) for row, them in zip(rows, near, strict=True)]
        return np.array(gaps).reshape(distances.shape)


def _to_cubes(centres: Matrix, half: float) -> float:
    """Distance of the origin from the nearest of some cubes."""
    return float(np.linalg.norm(np.maximum(np.abs(centres) - half, 0.0), axis=1).min())


@lru_cache(maxsize=8)
def search_tree(cloud: CloudTable) -> Any:
    """SciPy's tree of a cloud's points."""
    from scipy.spatial import cKDTree  # loads slower than most plans take, and few scenes have a cloud

    blocks = cloud.blocks.reshape(-1, layout.AXES, LEAF)
    return cKDTree(blocks.transpose(0, 2, 1).reshape(-1, layout.AXES).astype(np.float64))


def heads(primitives: layout.PrimitiveTable) -> NDArray[np.int32]:
    """Heads of all primitives, shape (k, ``HEAD_INTS``)."""
    return primitives.heads.reshape(-1, layout.HEAD_INTS)


def refuse_kind(kind: int) -> NoReturn:
    """Raise the error of a primitive of a kind that has no formula.

    Raises:
        InputError: Always.
    """
    raise InputError(f"collision check: a primitive is of unknown kind {kind}; have 0 to {layout.KINDS.stop - 1}")


def meets_primitive(
    primitives: layout.PrimitiveTable, number: int, points: NDArray[np.float64], radii: NDArray[np.float64]
) -> Mask:
    """Which balls, centres of shape (..., 3), meet a primitive. Shape (...).

    Raises:
        InputError: If it is of an unknown kind.
    """
    own = PrimitiveView(primitives, number)
    if own.kind == layout.HALF_SPACE:
        return np.asarray(own.half_space_gap(points) < radii)
    if own.kind == layout.CONVEX:
        return np.asarray(own.heights(points) < own.number(layout.CONVEX_SHARE) * radii)

    away = points - own.vector(layout.SHAPE_CENTRE)
    if own.kind == layout.BOX:
        return np.asarray(np.linalg.norm(np.maximum(own.beyond_faces(away), 0.0), axis=-1) < radii)
    if own.kind == layout.BALL:
        return np.asarray(np.linalg.norm(away, axis=-1) < radii + own.number(layout.BALL_RADIUS))
    if own.kind == layout.CAPSULE:
        return np.asarray(own.to_capsule(away) < radii + own.number(layout.CAPSULE_RADIUS))
    if own.kind == layout.CLOUD:
        return np.asarray(own.to_points(away) < radii + own.number(layout.CLOUD_RADIUS))
    if own.kind == layout.CYLINDER:
        ends, side = own.beyond_ends(away)
        return np.asarray(np.hypot(np.maximum(ends, 0.0), np.maximum(side, 0.0)) < radii)

    refuse_kind(own.kind)


def primitive_gap(primitives: layout.PrimitiveTable, number: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance of points, shape (..., 3), from a primitive, negative inside. Shape (...).

    Raises:
        InputError: If it is of an unknown kind.
    """
    own = PrimitiveView(primitives, number)
    if own.kind == layout.HALF_SPACE:
        return own.half_space_gap(points)
    if own.kind == layout.CONVEX:
        height = own.heights(points)
        return np.asarray(height if own.number(layout.CONVEX_SHARE) else np.where(height < 0.0, height, np.inf))

    away = points - own.vector(layout.SHAPE_CENTRE)
    if own.kind == layout.BALL:
        return np.asarray(np.linalg.norm(away, axis=-1) - own.number(layout.BALL_RADIUS))
    if own.kind == layout.BOX:
        return _outside(own.beyond_faces(away))
    if own.kind == layout.CAPSULE:
        return np.asarray(own.to_capsule(away) - own.number(layout.CAPSULE_RADIUS))
    if own.kind == layout.CLOUD:
        return np.asarray(own.to_points(away) - own.number(layout.CLOUD_RADIUS))
    if own.kind == layout.CYLINDER:
        return _outside(np.stack(own.beyond_ends(away), axis=-1))

    refuse_kind(own.kind)


def _outside(beyond: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance from a set that is given by how far a point lies beyond each of its orthogonal faces."""
    inside = np.minimum(beyond.max(axis=-1), 0.0)
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + inside)


@lru_cache(maxsize=4096)
def spread(count: int) -> NDArray[np.int64]:
    """Numbers from 0 to a count, shape (count + 1,), of which any first ones are spread over all."""
    numbers = np.arange(count + 1)
    return numbers[np.argsort(numbers * GOLDEN % 1.0)]


class ReferenceChecks:
    """The three-valued checks on the tables of a world."""

    def __init__(
        self,
        arm: layout.ArmTable,
        balls: tuple[layout.BallTable, layout.BallTable],
        primitives: tuple[layout.PrimitiveTable, layout.PrimitiveTable],
    ) -> None:
        self._arm = arm
        self._balls = balls
        self._primitives = primitives

    def classify(self, values: Matrix, *, resolve: bool) -> NDArray[np.int8]:
        """See :meth:`rrtik_ompl.kernels.FastWorld.classify`."""
        answers = np.zeros(len(values), dtype=np.int8)
        for start in range(0, len(values), CHUNK):
            part = slice(start, start + CHUNK)
            poses = frames(self._arm, values[part])
            answers[part] = self._in_collision(poses, 0).any(axis=1)
            open_ = np.flatnonzero(answers[part])
            if resolve and len(open_):
                answers[start + open_] += self._in_collision(poses[open_], 1).any(axis=1)

        return answers

    def classify_edges(
        self, starts: Matrix, ends: Matrix, steps: NDArray[np.int32], *, resolve: bool
    ) -> NDArray[np.int8]:
        """See :meth:`rrtik_ompl.kernels.FastWorld.classify_edges`."""
        answers = np.zeros(len(starts), dtype=np.int8)
        last = layout.COLLIDING if resolve else layout.UNDECIDED  # an answer that nothing changes any more
        open_ = np.arange(len(starts))
        first = 0
        part = FIRST_PART
        while len(open_):
            # A part of each motion, spread over it, so that contacts are found early.
            orders = [spread(int(count))[first : first + part] for count in steps[open_]]
            owners = np.repeat(open_, [len(order) for order in orders])
            shares = (np.concatenate(orders) / steps[owners])[:, None]
            rows = (1.0 - shares) * starts[owners] + shares * ends[owners]
            np.maximum.at(answers, owners, self.classify(rows, resolve=resolve))

            first += part
            part *= 2
            open_ = open_[(answers[open_] < last) & (first <= steps[open_])]
        return answers

    def marks(self, values: Matrix) -> Mask:
        """Flags of the pairs that the outer balls cannot prove free, shape (m, flags)."""
        return np.asarray(self._in_collision(frames(self._arm, values), 0))

    def _in_collision(self, poses: NDArray[np.float64], level: int) -> NDArray[np.bool_]:
        """Which bodies meet, shape (m, moving * standing + pairs of moving bodies)."""
        table = self._balls[level]
        primitives = self._primitives[level]
        body_count = table.body_count
        standing = primitives.standing_count
        pairs = table.pairs.reshape(-1, layout.PAIR_INTS)
        found = np.zeros((len(poses), body_count * standing + len(pairs)), dtype=bool)
        points, radii = placed_balls(poses, table)
        checked = primitives.checked.reshape(body_count, standing)

        for number, stands in enumerate(heads(primitives)[:, layout.STANDING_BODY]):
            for body in np.flatnonzero(checked[:, stands]):
                found[:, body * standing + stands] |= meets_primitive(
                    primitives, number, points[body], radii[body]
                ).any(axis=1)

        for k, (i, j) in enumerate(zip(pairs[:, layout.PAIR_ONE], pairs[:, layout.PAIR_OTHER], strict=True)):
            gaps = np.linalg.norm(points[i][:, :, None] - points[j][:, None], axis=3)
            reaches = radii[i][:, None] + radii[j] + table.self_margin[0]
            found[:, body_count * standing + k] = (gaps < reaches).any(axis=(1, 2))

        return found


def measure(
    arm: layout.ArmTable, balls: layout.BallTable, primitives: layout.PrimitiveTable, values: Matrix
) -> tuple[Vector, NDArray[np.int32]]:
    """See :func:`rrtik_ompl.kernels.checks.distance_kernels.measure`; +inf where there is nothing to measure."""
    distances = np.full(len(values), np.inf)
    pairs = np.full(len(values), -1, dtype=np.int32)
    for start in range(0, len(values), CHUNK):
        part = slice(start, start + CHUNK)
        gaps, numbers = _all_gaps(frames(arm, values[part]), balls, primitives)
        if len(numbers):
            nearest = gaps.argmin(axis=1)
            distances[part] = gaps[np.arange(len(gaps)), nearest]
            pairs[part] = np.where(np.isfinite(distances[part]), numbers[nearest], -1)

    return distances, pairs


def _all_gaps(
    poses: NDArray[np.float64], balls: layout.BallTable, primitives: layout.PrimitiveTable
) -> tuple[Matrix, NDArray[np.int32]]:
    """Distance of every pair of a body and a row or of two bodies, shape (m, k), and the numbers of the pairs."""
    body_count = balls.body_count
    standing = primitives.standing_count
    checked = primitives.checked.reshape(body_count, standing)
    points, radii = placed_balls(poses, balls)
    gaps: list[Vector] = []
    numbers: list[int] = []

    for number, stands in enumerate(heads(primitives)[:, layout.STANDING_BODY]):
        for body in np.flatnonzero(checked[:, stands]):
            if len(radii[body]):
                gaps.append((primitive_gap(primitives, number, points[body]) - radii[body]).min(axis=1))
                numbers.append(int(body) * standing + int(stands))

    pairs = balls.pairs.reshape(-1, layout.PAIR_INTS)
    for k, (i, j) in enumerate(zip(pairs[:, layout.PAIR_ONE], pairs[:, layout.PAIR_OTHER], strict=True)):
        apart = np.linalg.norm(points[i][:, :, None] - points[j][:, None], axis=3)
        reaches = radii[i][:, None] + radii[j] + balls.self_margin[0]
        gaps.append((apart - reaches).min(axis=(1, 2)))
        numbers.append(body_count * standing + k)

    return np.reshape(gaps, (-1, len(poses))).T, np.array(numbers, dtype=np.int32)


def placed_balls(
    poses: NDArray[np.float64], table: layout.BallTable
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Centres in the world, shape (m, n, 3), and radii, shape (n,), of each body's balls."""
    balls = table.balls.astype(np.float64).reshape(-1, layout.BALL_FLOATS)
    clusters = table.clusters.reshape(-1, layout.CLUSTER_INTS)
    centres = balls[:, layout.CENTRE : layout.CENTRE + 3]
    points = []
    radii = []

    for body in table.bodies.reshape(-1, layout.BODY_INTS):
        first = body[layout.BODY_FIRST]
        end = body[layout.BODY_END]
        span = slice(0, 0)
        if end > first:
            span = slice(clusters[first, layout.CLUSTER_FIRST], clusters[end - 1, layout.CLUSTER_END])
        pose = poses[:, body[layout.BODY_FRAME]]
        points.append(centres[span] @ pose[:, :, :3].transpose(0, 2, 1) + pose[:, None, :, 3])
        radii.append(balls[span, layout.RADIUS])

    return points, radii

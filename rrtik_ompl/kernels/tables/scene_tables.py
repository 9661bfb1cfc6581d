"""What stands still as primitives: solids whose distance to a point has a short formula.

Simple solids are one primitive, convex solids one primitive of planes, all else a primitive for each ball of its cover.
There are two sets of them: the outer ones contain the bodies, the inner ones are contained in them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.shape_table import Core, core_of
from rrtik_ompl.geometry.collision.solids import of_each, once_per_geometry, outer_planes, outward_planes
from rrtik_ompl.kernels.layout import (
    BALL,
    BALL_RADIUS,
    BOX,
    BOX_AXES,
    BOX_HALF_SIZES,
    CAPSULE,
    CAPSULE_AXIS,
    CAPSULE_INVERSE_SQUARE,
    CAPSULE_RADIUS,
    CLOUD,
    CLOUD_AXES,
    CLOUD_RADIUS,
    CONVEX,
    CONVEX_SHARE,
    CYLINDER,
    CYLINDER_AXIS,
    CYLINDER_HALF_LENGTH,
    CYLINDER_RADIUS,
    HALF_SPACE,
    HALF_SPACE_NORMAL,
    HALF_SPACE_OFFSET,
    PLANE_NORMAL,
    PLANE_OFFSET,
    SHAPE_CENTRE,
    SHAPE_FLOATS,
)
from rrtik_ompl.kernels.tables.cloud_tables import cloud_table
from rrtik_ompl.kernels.tables.memory import record
from rrtik_ompl.kernels.tables.primitive_tables import UNBOUNDED_COORDINATE, Detail, Grow, Primitives, joined
from rrtik_ompl.kernels.tables.robot_tables import Spheres, usable_cover

UNBOUNDED_LENGTH = 1e12  # [m] what is larger or farther away counts as being everywhere
SLACK_PER_METRE = 1e-6  # rounding of a primitive's numbers and of the arithmetic on them, relative to the coordinates
PLANE_SLACK = 1e-5  # [m] for planes that stand for a few others with almost the same normal


def needs_covers(body: Body) -> tuple[bool, bool]:
    """Whether a body needs outer and inner spheres: what stands still and has a formula can do without."""
    kind = None if body.joint > 0 else primitive_kind(body.geometry)
    return kind is None, kind in (None, CONVEX)


def outer_primitives(
    bodies: Sequence[Body], covers: Sequence[Spheres], inflation: Sequence[float] | None = None
) -> Primitives:
    """Primitives whose union contains standing bodies: the formula of each that has one, the balls of its cover else.

    They contain every point that is no farther from its body than its margin, padding and ``inflation`` [m].
    """
    beside = _kept(bodies) + (0.0 if inflation is None else np.asarray(inflation))
    places = _byprimitive_kind(bodies)
    rest = [(k, usable_cover(bodies[k].geometry, covers[k])) for k in places.pop(None, ())]
    made = joined([*_exact(bodies, places, 1.0, beside), _balls(bodies, rest, 1.0, beside)])
    endless = ~fits(made)
    if not endless.any():
        return made

    made.kinds[endless] = BALL
    made.numbers[endless] = 0.0
    made.numbers[endless, BALL_RADIUS] = UNBOUNDED_LENGTH
    made.lows[endless] = -UNBOUNDED_LENGTH
    made.highs[endless] = UNBOUNDED_LENGTH

    return replace(made, details=tuple(None if e else d for e, d in zip(endless, made.details, strict=True)))


def inner_primitives(bodies: Sequence[Body], inner: Sequence[Spheres]) -> Primitives:
    """Primitives that lie within the margins around standing bodies, or inside these."""
    margins = _kept(bodies)
    places = _byprimitive_kind(bodies)
    rounded = [k for kind in ROUNDED for k in places.get(kind, ())]
    beside = np.where(np.isin(np.arange(len(bodies)), rounded), margins, 0.0)
    rest = [(k, np.asarray(inner[k]).reshape(-1, 4)) for k in (*places.pop(None, ()), *places.get(CONVEX, ()))]
    made = joined([*_exact(bodies, places, -1.0, beside), _balls(bodies, rest, -1.0, margins)])

    return made.only(fits(made))


def _kept(bodies: Sequence[Body]) -> Vector:
    """How far around standing bodies what moves must not be, beside its own padding [m]."""
    return np.array([body.margin + body.padding for body in bodies])


def fits(primitives: Primitives) -> Mask:
    """The primitives whose numbers the kernels can square, shape (n,)."""
    fits: Mask = np.abs(primitives.numbers).max(axis=1, initial=0.0) < UNBOUNDED_LENGTH
    for k, detail in enumerate(primitives.details):
        if isinstance(detail, np.ndarray):
            fits[k] &= bool(np.abs(detail).max() < UNBOUNDED_LENGTH)
    return fits


def _byprimitive_kind(bodies: Sequence[Body]) -> dict[int | None, list[int]]:
    """Places of the bodies by their kinds of primitive, None for those without a formula."""
    found: dict[int | None, list[int]] = {}
    kinds = of_each((body.geometry for body in bodies), primitive_kind)
    for k, kind in enumerate(kinds):
        found.setdefault(kind, []).append(k)
    return found


@once_per_geometry
def primitive_kind(solid: Any) -> int | None:
    """The kind of primitive, of the layout's, that a coal geometry is; None if it is none."""
    if isinstance(solid, CloudSolid):
        return CLOUD
    if isinstance(solid, coal.ShapeBase) and solid.getSweptSphereRadius() != 0.0:
        return None
    if isinstance(solid, coal.Halfspace):
        return HALF_SPACE
    if isinstance(solid, coal.ConvexBase):
        return None if outward_planes(solid) is None else CONVEX

    core = core_of(solid)
    if core is None:
        return None
    if core.half_sides is not None:
        return BOX
    if len(core.corners) == 1:
        return BALL
    return CAPSULE if core.disc is None else CYLINDER


def _exact(
    bodies: Sequence[Body], places: Mapping[int | None, Sequence[int]], grow: float, beside: Vector
) -> list[Primitives]:
    """Bodies by the formulas of their kinds, a little larger (grow = 1) or smaller (-1), and by ``beside`` [m] larger.

    Args:
        bodies: All bodies.
        places: Those to take, by their kinds.
        grow: See above.
        beside: Of each body, shape (n,).
    """
    made = []
    for kind, chosen in places.items():
        own = np.array(chosen, dtype=np.int64)
        if kind in _BUILDERS:
            made += [_BUILDERS[kind](bodies[k], k, grow, float(beside[k])) for k in chosen]
        elif kind is not None:
            poses = np.array([bodies[k].placement.homogeneous for k in chosen])
            cores = [cast(Core, core) for core in of_each((bodies[k].geometry for k in chosen), core_of)]
            made.append(MAKERS[kind](own, poses, cores, grow, beside[own]))

    return made


def _boxes(
    own: NDArray[np.int64], poses: NDArray[np.float64], cores: Sequence[Core], grow: Grow, beside: Vector
) -> Primitives:
    centres = poses[:, :3, 3]
    turns = poses[:, :3, :3]
    halves = np.array([core.half_sides for core in cores])
    halves = halves + (grow * _slack(centres, np.linalg.norm(halves, axis=1)) + beside)[:, None]
    spreads = np.einsum("nij,nj->ni", np.abs(turns), halves)
    axes = turns.transpose(0, 2, 1).reshape(-1, 9)
    numbers = {SHAPE_CENTRE: centres, BOX_AXES: axes, BOX_HALF_SIZES: halves}

    return _bounded(BOX, own, numbers, centres, spreads, halves.min(axis=1))


def _capsules(
    own: NDArray[np.int64], poses: NDArray[np.float64], cores: Sequence[Core], grow: Grow, beside: Vector
) -> Primitives:
    centres = poses[:, :3, 3]
    z = poses[:, :3, 2]
    lengths, radii = (np.array([getattr(core, name) for core in cores]) for name in ("half_length", "radius"))
    radii = radii + grow * _slack(centres, radii + lengths) + beside
    axes = 2.0 * lengths[:, None] * z
    squares = np.einsum("ni,ni->n", axes, axes)
    shares = np.where(lengths > 1e-9, 1.0 / np.where(lengths > 1e-9, squares, 1.0), 0.0)
    spreads = lengths[:, None] * np.abs(z) + radii[:, None]
    numbers = {SHAPE_CENTRE: centres - 0.5 * axes, CAPSULE_AXIS: axes, CAPSULE_INVERSE_SQUARE: shares[:, None]}

    return _bounded(CAPSULE, own, numbers | {CAPSULE_RADIUS: radii[:, None]}, centres, spreads, radii)


def _cylinders(
    own: NDArray[np.int64], poses: NDArray[np.float64], cores: Sequence[Core], grow: Grow, beside: Vector
) -> Primitives:
    centres = poses[:, :3, 3]
    z = poses[:, :3, 2]
    lengths, radii = (np.array([getattr(core, name) for core in cores]) for name in ("half_length", "disc"))
    radii = radii + grow * _slack(centres, radii + lengths) + beside
    lengths = lengths + grow * _slack(centres, radii + lengths) + beside
    across = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    spreads = lengths[:, None] * np.abs(z) + radii[:, None] * across
    numbers = {SHAPE_CENTRE: centres, CYLINDER_AXIS: z, CYLINDER_HALF_LENGTH: lengths[:, None]}
    thickness = np.minimum(radii, lengths)

    return _bounded(CYLINDER, own, numbers | {CYLINDER_RADIUS: radii[:, None]}, centres, spreads, thickness)


def _spheres(
    own: NDArray[np.int64], poses: NDArray[np.float64], cores: Sequence[Core], grow: Grow, beside: Vector
) -> Primitives:
    return _round(own, poses[:, :3, 3], np.array([core.radius for core in cores]), grow, beside)


ROUNDED = (BALL, CAPSULE, HALF_SPACE, CLOUD)  # keep their kind when they grow
MAKERS = {BALL: _spheres, CAPSULE: _capsules, BOX: _boxes, CYLINDER: _cylinders}


def _round(own: NDArray[np.int64], centres: Matrix, radii: Vector, grow: Grow, beside: Vector) -> Primitives:
    """Balls that stand for bodies ``own``."""
    radii = radii + grow * _slack(centres, radii) + beside
    numbers = {SHAPE_CENTRE: centres, BALL_RADIUS: radii[:, None]}
    return _bounded(BALL, own, numbers, centres, np.repeat(radii[:, None], 3, axis=1), radii)


def _bounded(
    kind: int,
    own: NDArray[np.int64],
    numbers: Mapping[int, Matrix],
    centres: Matrix,
    spreads: Matrix,
    thickness: Vector,
) -> Primitives:
    """Primitives from runs of their numbers by the places of these; those of which nothing is left drop out."""
    rows = np.zeros((len(own), SHAPE_FLOATS))
    for place, run in numbers.items():
        rows[:, place : place + run.shape[1]] = run
    reaches = spreads + _slack(centres, spreads.max(axis=1, initial=0.0))[:, None]
    kinds = np.full(len(own), kind, dtype=np.int64)
    made = Primitives(own, kinds, rows, centres - reaches, centres + reaches, (None,) * len(own))
    return made if (thickness >= 0.0).all() else made.only(thickness >= 0.0)


def _slack(centres: Matrix, sizes: Vector) -> Vector:
    """Of primitives [m], shape (n,)."""
    return np.asarray(SLACK_PER_METRE * (1.0 + np.abs(centres).max(axis=1, initial=0.0) + sizes))


def _balls(bodies: Sequence[Body], covers: Sequence[tuple[int, Spheres]], grow: float, beside: Vector) -> Primitives:
    """Balls of covers, each with the place of its body."""
    own = np.repeat(np.array([k for k, _ in covers], dtype=np.int64), [len(spheres) for _, spheres in covers])
    placed = [np.zeros((0, 3))]
    for k, spheres in covers:
        pose = bodies[k].placement
        placed.append(spheres[:, :3] @ np.array(pose.rotation).T + np.array(pose.translation))

    radii = np.concatenate([np.zeros(0), *(spheres[:, 3] for _, spheres in covers)])
    return _round(own, np.concatenate(placed), radii, grow, beside[own])


def _half_space(body: Body, place: int, grow: float, inflation: float) -> Primitives:
    normal = np.array(body.placement.rotation) @ np.array(body.geometry.n)
    offset = float(body.geometry.d) + float(normal @ body.placement.translation)
    offset += grow * SLACK_PER_METRE * (1.0 + abs(offset)) + inflation
    everywhere = np.full(3, UNBOUNDED_COORDINATE)
    numbers = record(SHAPE_FLOATS, {HALF_SPACE_NORMAL: normal, HALF_SPACE_OFFSET: offset})

    return _single(HALF_SPACE, place, numbers, -everywhere, everywhere, None)


@once_per_geometry
def _corners(solid: coal.ConvexBase) -> Matrix:
    return np.array(solid.points()).reshape(-1, 3)


def _convex(body: Body, place: int, grow: float, inflation: float) -> Primitives:
    """A convex solid by its planes; a ball meets the inner primitive if its centre lies behind all of them."""
    planes = cast(Matrix, outward_planes(body.geometry))
    rotation = np.array(body.placement.rotation)
    origin = np.array(body.placement.translation)
    corners = _corners(body.geometry) @ rotation.T + origin
    low = corners.min(axis=0)
    high = corners.max(axis=0)
    inflation += float(_slack(0.5 * (low + high)[None], (high - low).max(keepdims=True))[0])
    kept = outer_planes(body.geometry) if grow > 0.0 else planes
    world = np.empty_like(kept)
    normals = world[:, PLANE_NORMAL : PLANE_NORMAL + 3]
    normals[:] = kept[:, :3] @ rotation.T
    world[:, PLANE_OFFSET] = kept[:, 3] + normals @ origin + (inflation if grow > 0.0 else -inflation - PLANE_SLACK)
    numbers = record(SHAPE_FLOATS, {CONVEX_SHARE: 1.0 if grow > 0.0 else 0.0})

    return _single(CONVEX, place, numbers, low - inflation, high + inflation, world)


def _cloud(body: Body, place: int, grow: float, inflation: float) -> Primitives:
    """A cloud of points or cubes by the table of its tree; nothing is left of it if nothing is left of one of them."""
    solid = cast(CloudSolid, body.geometry)
    low, high = solid.cloud.bounds
    rotation = body.placement.rotation
    origin = body.placement.translation
    centre = rotation @ (0.5 * (low + high)) + origin
    spread = np.abs(rotation) @ (0.5 * (high - low))
    slack = 3.0 * float(_slack(centre[None], np.abs(origin - centre).max(keepdims=True) + spread.max())[0])
    radius = solid.cloud.radius + grow * slack + inflation
    reach = spread + grow * slack + inflation + slack
    numbers = record(SHAPE_FLOATS, {SHAPE_CENTRE: origin, CLOUD_AXES: rotation.T.ravel(), CLOUD_RADIUS: radius})
    made = _single(CLOUD, place, numbers, centre - reach, centre + reach, cloud_table(solid.cloud))

    return made.only(np.array([radius + solid.cloud.half > 0.0]))


_BUILDERS = {HALF_SPACE: _half_space, CONVEX: _convex, CLOUD: _cloud}


def _single(kind: int, place: int, numbers: Vector, low: Vector, high: Vector, detail: Detail) -> Primitives:
    """One primitive, of the body at a place."""
    places = np.array([place], dtype=np.int64)
    kinds = np.array([kind], dtype=np.int64)
    return Primitives(places, kinds, numbers[None], low[None], high[None], (detail,))

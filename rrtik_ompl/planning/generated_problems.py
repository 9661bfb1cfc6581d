"""Generated problems for any arm: a goal posture, obstacles of a family around it, and a start far from it.

A problem is kept if it is worth planning: the straight motion collides, moving each joint once is not free in any
order, and a planner finds a path within a number of iterations. (A limit of time would make the problem depend on the
machine.) These planners are those whose class has the trait ``proof_iterations``.

Each family has a builder of obstacles. A builder works in a frame at the tip: x points along the forearm, z is as near
as possible to the axis of the first joint. All sizes are shares of the arm's reach, so that one builder serves arms of
any size. An arm that is thick, or whose wrist is offset to one side, is given more room beside its forearm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector, whole_number
from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, Shape, Sphere
from rrtik_ompl.model.world_settings import MOTION_RESOLUTION
from rrtik_ompl.ompl_bridge.planner_traits import planners_with
from rrtik_ompl.planning.moves.staircase import staircase_orders
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

POSTURES = 512  # random postures drawn at a time
DRAWS = 300  # scenes tried before a seed is given up
SPACE_PER_DRAW = 0.01  # growth of the spacing with every scene
STARTS = 2  # starts tried in each scene
MIN_DISTANCE, MAX_DISTANCE = 0.4, 0.85  # distance of the tip from the base at a goal, in reaches
MIN_HEIGHT = -0.25  # height of the tip above the base at a goal, in reaches
AWAY = 0.3  # the tip's least distance between start and goal, in reaches
OUTWARD = 0.3  # least cosine of the angle between the forearm and the direction away from the base
PATIENCE = 60.0  # [s] never reached, as iterations end the search

Solids: TypeAlias = list[tuple[Shape, Any]]  # shapes and their poses in the frame of the place, in shares of the reach
Builder: TypeAlias = Callable[[np.random.Generator, float], Solids]  # takes a random stream and the spacing, 1 or more

THICKNESS = 0.03  # thickness of boards and plates
BARS = 0.02  # half the thickness of a frame's bars
CLUTTER = 25  # number of solids
FREE_AROUND = 0.09  # room that pipes leave on both sides of the forearm


def generated_problem(robot: Robot, family: str, seed: int, *, motion_resolution: float = MOTION_RESOLUTION) -> Problem:
    """Return a problem that has a solution and is not trivial; the same arguments give the same problem.

    Args:
        robot: Any arm.
        family: One of FAMILIES: panel, pipes, frame, slot_along, slot_across, clutter.
        seed: Number of the problem in its family, at least 0.
        motion_resolution: Motion resolution of its world [m].

    Raises:
        UnknownNameError: If there is no such family.
        InputError: If the seed is negative, or nothing solvable turned up for this arm and seed.
    """
    require(robot, Robot, "robot of a generated problem", "use load_robot(name or file)")
    if family not in FAMILIES:
        raise UnknownNameError("family of generated problems", str(family), FAMILIES)
    whole_number(seed, "seed")

    # The random stream depends on family and seed alone.
    rng = np.random.default_rng([list(FAMILIES).index(family), int(seed)])
    empty_world = World(robot)
    reach = _reach(robot)
    goals = _goals(empty_world, reach, rng)

    for number in range(DRAWS):
        # Draw a goal posture and a scene around it; each further scene has a little more room.
        goal, place = next(goals)
        scene = Scene(obstacles(family, rng, place, reach, 1.0 + SPACE_PER_DRAW * number))
        world = World(robot, scene, motion_resolution=motion_resolution)

        # Keep the first start for which the problem is solvable but not trivial.
        for start in _starts(world, goal, reach, rng):
            problem = Problem(world, start, goal, name=f"{robot.name}/{family}/{seed}")
            if _solvable(problem):
                return problem

    raise InputError(f"{family} {seed}: none of {DRAWS} scenes for robot '{robot.name}' is solvable; take another seed")


def _reach(robot: Robot) -> float:
    """Return the greatest distance of the tip from the base among many random postures [m]."""
    tips = robot.fk_batch(_postures(robot, 4 * POSTURES, np.random.default_rng(0)))[:, :3, 3]
    return float(np.linalg.norm(tips - _base(robot), axis=1).max())


def _base(robot: Robot) -> Vector:
    """Return the position of the first joint [m], shape (3,)."""
    place: Vector = robot.joint_frames(np.zeros(robot.dof))[0, 1, :3, 3]
    return place


def _postures(robot: Robot, count: int, rng: np.random.Generator) -> Matrix:
    """Draw random configurations within the limits, and within half a turn of zero, shape (count, dof)."""
    lower, upper = robot.finite_range()
    turning = ~robot.prismatic & (lower < np.pi) & (upper > -np.pi)
    lower = np.where(turning, np.maximum(lower, -np.pi), lower)
    upper = np.where(turning, np.minimum(upper, np.pi), upper)
    return np.asarray(rng.uniform(lower, upper, (count, robot.dof)))


def _goals(empty_world: World, reach: float, rng: np.random.Generator) -> Iterator[tuple[Vector, Any]]:
    """Yield free postures whose forearm points outwards, each with the frame of the tip; never ends.

    Yields:
        A configuration, shape (dof,), and the ``pinocchio.SE3`` frame in which the obstacles are built.
    """
    robot = empty_world.robot
    base = _base(robot)
    while True:
        rows = _postures(robot, POSTURES, rng)
        rows = rows[empty_world.valid_batch(rows)]

        # The forearm reaches from a joint in the middle of the chain to the tip.
        frames = robot.joint_frames(rows)
        tips = robot.fk_batch(rows)[:, :3, 3]
        elbow = frames[:, (len(robot.chain.parent) + 1) // 2, :3, 3]
        outwards = tips - base

        for row, tip, joint, outward, axis in zip(rows, tips, elbow, outwards, frames[:, 1, :3, 2], strict=True):
            forearm = tip - joint
            distance = float(np.linalg.norm(outward))
            length = np.linalg.norm(forearm)
            # Keep postures with the tip at a suitable place and the forearm pointing away from the base.
            is_in_range = MIN_DISTANCE * reach < distance < MAX_DISTANCE * reach and outward[2] > MIN_HEIGHT * reach
            if is_in_range and length > 1e-3 * reach and forearm @ outward > OUTWARD * distance * length:
                yield row, pin.SE3(_axes(forearm, axis), tip)


def _axes(forward: Vector, upward: Vector) -> Matrix:
    """Return the axes of a frame as columns, shape (3, 3): x forward, z as near as possible to ``upward``.

    If ``upward`` is almost parallel to ``forward``, the coordinate axis farthest from ``forward`` takes its place.
    """
    x = forward / np.linalg.norm(forward)
    if np.linalg.norm(np.cross(upward, x)) < 0.1:
        upward = np.eye(3)[int(np.abs(x).argmin())]
    y = np.cross(upward, x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _starts(world: World, goal: Vector, reach: float, rng: np.random.Generator) -> list[Vector]:
    """Draw free configurations far from the goal from which no simple motion leads to it.

    Args:
        world: Robot and scene.
        goal: Shape (dof,).
        reach: Reach of the arm [m].
        rng: Draws the configurations.

    Returns:
        At most `STARTS` configurations whose straight motion and single-joint moves to the goal all collide; none if
        the goal is not free.
    """
    if not world.valid(goal) or not world.certify(goal[None])[0]:
        return []
    rows = _postures(world.robot, POSTURES, rng)
    tips = world.robot.fk_batch(rows)[:, :3, 3]
    target = world.robot.fk(goal).translation

    rows = rows[np.linalg.norm(tips - target, axis=1) > AWAY * reach]
    rows = rows[world.valid_batch(rows) & world.certify(rows)]
    rows = rows[~world.motion_valid_batch(rows, np.repeat(goal[None], len(rows), axis=0))]
    return [row for row in rows[:STARTS] if not staircase_orders(row, goal, world.motion_valid_batch)]


def _solvable(problem: Problem) -> bool:
    """Check whether one of the planners of `_proofs` finds a path."""
    return any(
        plan(
            problem,
            name,
            seconds=PATIENCE,
            seed=0,
            restarts=0,
            parameters={"max_iterations": max_iterations},
            proof="off",
            shorten=False,
        ).found
        for name, max_iterations in _proofs()
    )


@cache
def _proofs() -> tuple[tuple[str, int], ...]:
    """Return the planners that prove problems solvable, with their numbers of iterations, largest number first.

    Raises:
        InputError: If no package offers one.
    """
    found = planners_with(lambda traits: traits.proof_iterations)
    if not found:
        raise InputError("generated problems: no installed planner has proof_iterations; install rrtik-ompl whole")
    stated = ((name, traits.proof_iterations) for name, traits in found.items())
    return tuple(sorted(stated, key=lambda each: each[1], reverse=True))


def _board(low: tuple[float, float, float], high: tuple[float, float, float]) -> tuple[Shape, Any]:
    """Return a box between two opposite corners, and its pose."""
    corners = np.array([low, high])
    return Box(corners[1] - corners[0]), pin.SE3(np.eye(3), corners.mean(axis=0))


def panel(rng: np.random.Generator, spacing: float) -> Solids:
    """Build a board behind the tip with a shelf below it, a wall on one side, and knobs, like a subsea panel."""
    gap = rng.uniform(0.04, 0.08)
    width = rng.uniform(0.3, 0.5)
    up = rng.uniform(0.2, 0.4)
    side = rng.choice([-1.0, 1.0])
    floor = -spacing * rng.uniform(0.1, 0.18)
    depth = rng.uniform(0.2, 0.35)
    wall = sorted(side * (spacing * rng.uniform(0.1, 0.18) + np.array([0.0, THICKNESS])))

    solids = [
        _board((gap, -width, floor), (gap + THICKNESS, width, up)),
        _board((-depth, -width, floor - THICKNESS), (gap + THICKNESS, width, floor)),
        _board((-depth, wall[0], floor), (gap, wall[1], up)),
    ]

    for _ in range(rng.integers(2, 5)):
        y = -side * rng.uniform(0.12, width)
        z = rng.uniform(floor, up)
        length = rng.uniform(0.04, 0.12)
        turned = pin.SE3(pin.utils.rotate("y", np.pi / 2), np.array([gap - 0.5 * length, y, z]))
        solids.append((Cylinder(rng.uniform(0.01, 0.03), length), turned))
    return solids


def pipes(rng: np.random.Generator, spacing: float) -> Solids:
    """Build vertical and horizontal pipes on both sides of the forearm."""
    solids: Solids = []
    for number in range(rng.integers(6, 11)):
        x = rng.uniform(-0.4, 0.15)
        aside = rng.choice([-1.0, 1.0]) * rng.uniform(spacing * FREE_AROUND, 0.4 + spacing * FREE_AROUND)
        along = float(rng.uniform(-0.3, 0.3))
        upright = number % 2 == 0
        rotation = np.eye(3) if upright else pin.utils.rotate("x", np.pi / 2)
        centre = np.array([x, aside, along] if upright else [x, along, aside])
        solids.append((Capsule(rng.uniform(0.012, 0.03), rng.uniform(0.5, 1.2)), pin.SE3(rotation, centre)))
    return solids


def frame(rng: np.random.Generator, spacing: float) -> Solids:
    """Build two windows of bars one behind the other, joined by four rails; the forearm passes through the first."""
    half = spacing * rng.uniform(0.12, 0.2, 2)
    front = -rng.uniform(0.08, 0.2)
    back = rng.uniform(0.1, 0.2)
    y, z = half + BARS
    solids: Solids = []

    for x in (front, back):
        for sign in (-1.0, 1.0):
            solids.append(_beam((x, sign * y, 0.0), (BARS, BARS, z + BARS)))
            solids.append(_beam((x, 0.0, sign * z), (BARS, y + BARS, BARS)))

    middle = 0.5 * (front + back)
    length = 0.5 * (back - front)
    solids += [_beam((middle, a * y, b * z), (length, BARS, BARS)) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    return solids


def _beam(centre: tuple[float, float, float], half: tuple[float, float, float]) -> tuple[Shape, Any]:
    return Box(2.0 * np.array(half)), pin.SE3(np.eye(3), np.array(centre))


def _slot(rng: np.random.Generator, spacing: float, roll: float) -> Solids:
    """Build two plates with the forearm between them, rotated by ``roll`` [rad] about the forearm."""
    gap = spacing * rng.uniform(0.065, 0.09)
    front = -rng.uniform(0.15, 0.3)
    back = rng.uniform(0.05, 0.1)
    half = rng.uniform(0.2, 0.35)
    turned = pin.SE3(pin.utils.rotate("x", roll), np.zeros(3))

    plates = [
        _board((front, gap, -half), (back, gap + THICKNESS, half)),
        _board((front, -gap - THICKNESS, -half), (back, -gap, half)),
    ]
    return [(shape, turned * pose) for shape, pose in plates]


def slot_along(rng: np.random.Generator, spacing: float) -> Solids:
    """Build a narrow slot parallel to the axis of the first joint: the other joints can move in it one at a time."""
    return _slot(rng, spacing, 0.0)


def slot_across(rng: np.random.Generator, spacing: float) -> Solids:
    """Build a narrow slot oblique to the joint axes: to stay in it, several joints must move alternately."""
    return _slot(rng, spacing, rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.1))


def clutter(rng: np.random.Generator, spacing: float) -> Solids:
    """Build boxes, cylinders and spheres of many sizes, some near the tip and some far."""
    solids: Solids = []
    for _ in range(CLUTTER):
        kind = rng.integers(3)
        size = rng.uniform(0.03, 0.12, 3)
        shape: Shape = (Box(size), Cylinder(0.5 * size[0], 2.0 * size[1]), Sphere(0.6 * size[0]))[kind]

        direction = rng.normal(size=3)
        centre = direction / np.linalg.norm(direction) * rng.uniform(spacing * 0.1, 0.9)
        solids.append((shape, pin.SE3(pin.exp3(rng.normal(size=3)), centre)))
    return solids


FAMILIES: Mapping[str, Builder] = MappingProxyType(
    {
        "panel": panel,
        "pipes": pipes,
        "frame": frame,
        "slot_along": slot_along,
        "slot_across": slot_across,
        "clutter": clutter,
    }
)


def obstacles(
    family: str, rng: np.random.Generator, place: pin.SE3, reach: float, spacing: float = 1.0
) -> tuple[Obstacle, ...]:
    """Build the obstacles of a family around a place.

    Args:
        family: One of FAMILIES.
        rng: Random stream of all sizes.
        place: Frame at the tip, a ``pinocchio.SE3``; see the head of this module.
        reach: Reach of the arm [m].
        spacing: Factor of the free space beside the forearm.
    """
    found = []
    for number, (shape, pose) in enumerate(FAMILIES[family](rng, spacing), start=1):
        there = place * pin.SE3(pose.rotation, reach * pose.translation)
        found.append(Obstacle(f"{family}{number}", _scaled(shape, reach), there))
    return tuple(found)


def _scaled(shape: Shape, factor: float) -> Shape:
    """Return a shape with all its measures, which are lengths, multiplied by a factor."""
    return type(shape)(**{measure.name: factor * getattr(shape, measure.name) for measure in shape.measures})

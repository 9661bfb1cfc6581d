"""Generated problems with path constraints: an arm among random solids, a start and a goal that keep the constraint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.constraints.residuals import projected_rows
from rrtik_ompl.constraints.walls import separation
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.problem import Problem

KINDS = ("upright", "plane", "line", "orientation")
DRAWN = 40  # configurations at a time, until one can be used
NEAR_BASE = 0.3  # [m] from the base's axis, where no solid is put
MOST_SCENES = 40  # that are drawn for one problem


@dataclass(frozen=True)
class Generated:
    """A problem, and how many scenes were drawn until it was one; None after `MOST_SCENES`."""

    problem: Problem | None
    scenes: int


def generated(name: str, kind: str, seed: int, *, joined_ends: bool = True) -> Generated:
    """A problem of a robot: 5 to 20 solids, and a constraint of a kind, in which start and goal are free.

    With ``joined_ends`` the goal is one that the constraint is not proven to keep apart from the start.
    """
    robot, rng = rrtik.load_robot(name), np.random.default_rng([seed, *name.encode(), *kind.encode()])
    for scenes in range(1, MOST_SCENES + 1):
        world = rrtik.World(robot, _scene(robot, rng))
        start = _start(robot, world, kind, rng)
        if start is None:
            continue
        regions = [_region(robot, kind, start)]
        held = held_regions(robot, world.scene, regions, start)
        low, high = _span(robot)
        rows, there = projected_rows(robot, held, rng.uniform(low, high, (DRAWN, robot.dof)))
        rows = rows[there & held.held(rows)]
        rows = rows[world.valid_batch(rows)]
        rows = rows[world.certify(rows)]
        joined = [q for q in rows if not separation(held, start, q[None])] if joined_ends else list(rows)
        if joined:
            problem = Problem(world, start, joined[0], constraints=regions, name=f"{name} {kind} {seed}")
            return Generated(problem, scenes)
    return Generated(None, MOST_SCENES)


def _scene(robot: Robot, rng: np.random.Generator) -> rrtik.Scene:
    """5 to 20 boxes, balls and cylinders around an arm."""
    reach = 0.9 * float(np.linalg.norm(robot.chain.placement[:, :3, 3], axis=1).sum())
    solids: list[rrtik.Obstacle] = []
    while len(solids) < rng.integers(5, 21):
        place = rng.uniform([-reach, -reach, 0.0], [reach, reach, reach])
        if np.linalg.norm(place[:2]) < NEAR_BASE:
            continue
        size = rng.uniform(0.04, 0.2, 3)
        shape = (rrtik.Box(size), rrtik.Sphere(0.5 * size[0]), rrtik.Cylinder(0.4 * size[0], size[1]))[len(solids) % 3]
        solids.append(rrtik.Obstacle(f"solid {len(solids)}", shape, pin.SE3(pin.exp3(rng.normal(size=3)), place)))
    return rrtik.Scene(tuple(solids))


def _span(robot: Robot) -> tuple[Vector, Vector]:
    """Limits of the joints, none wider than a whole turn."""
    low, high = robot.finite_range()
    return np.maximum(low, -np.pi), np.minimum(high, np.pi)


def _start(robot: Robot, world: rrtik.World, kind: str, rng: np.random.Generator) -> Vector | None:
    """A free configuration; for "upright" one whose tool points down."""
    rows = rng.uniform(*_span(robot), (DRAWN, robot.dof))
    if kind == "upright":
        down = pin.SE3(pin.exp3(np.array([np.pi, 0.0, 0.0])), np.zeros(3))
        region = rrtik.constraints.upright(robot, tolerance_deg=1.0).started_at(down)
        rows, there = projected_rows(robot, held_regions(robot, world.scene, [region], None), rows)
        rows = rows[there]
    rows = rows[world.valid_batch(rows)]
    rows = rows[world.certify(rows)]
    return rows[0] if len(rows) else None


def _region(robot: Robot, kind: str, start: Vector) -> TaskRegion:
    """A constraint that the start keeps."""
    tip = robot.fk(start)
    if kind == "upright":
        return rrtik.constraints.upright(robot, tolerance_deg=5.0)
    if kind == "plane":
        return rrtik.constraints.on_plane(tip.translation, [0.0, 0.0, 1.0])
    if kind == "line":
        return rrtik.constraints.on_line(tip.translation, [0.0, 1.0, 0.0])
    return rrtik.constraints.orientation_of(tip, 3.0)

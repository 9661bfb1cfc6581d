"""Data with which a page plans by itself: kernels as WebAssembly, and a memory image of the world's tables."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from inspect import getmodule
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose, pose_row
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.shape_table import core_of
from rrtik_ompl.ik.kernel_tables import call_table, limb_of
from rrtik_ompl.ik.numeric.descent import PATIENCE, STEPS
from rrtik_ompl.kernels import FastWorld, layout
from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.record import Record, holds_table
from rrtik_ompl.kernels.search import connect_layout, shortcut_layout, tree_layout
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.rules import CrdtRules
from rrtik_ompl.kernels.search.crdt.search import CrdtSearch
from rrtik_ompl.kernels.search.motions import motion_layout
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.shortcut import ShortcutSearch
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables.primitive_tables import UNBOUNDED_COORDINATE
from rrtik_ompl.kernels.tables.scene_tables import SLACK_PER_METRE as PRIMITIVE_SLACK
from rrtik_ompl.kernels.tables.scene_tables import primitive_kind
from rrtik_ompl.kernels.tables.scratch import probe_table
from rrtik_ompl.kernels.tables.solid_tables import SLACK_PER_METRE as SOLID_SLACK
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.kernels.wasm.image import MemoryImage
from rrtik_ompl.kernels.wasm.page_kernels import page_kernels
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, Shape, Sphere
from rrtik_ompl.problem_files.problem import problem_data
from rrtik_ompl.viewer.drawing.framing import obstacle_corners
from rrtik_ompl.viewer.drawing.robot_picture import node_name
from rrtik_ompl.viewer.page_fixed import packed, standing_parts
from rrtik_ompl.viewer.story import dragged_tips, tip_entry
from rrtik_ompl.world.clearances import Clearances, clearances_between, search_form
from rrtik_ompl.world.problem import Problem, densely_checked
from rrtik_ompl.world.world import World

SAMPLES = 60_000  # samples of a search
TRIES = 2000  # attempted shortcuts
SPARES = {"box": 4, "sphere": 2, "cylinder": 2, "capsule": 2}  # obstacles that a user can add
FAR_AWAY = 1e3  # [m] below the arm
LARGE_SHARE = 0.5  # of all that is shown: larger obstacles are locked, and so are those that touch the base
NEAR_SHARE = 0.025  # so near to the base, an obstacle counts as touching it
PATH_RESULTS = ("length", "transitions", "waypoints")  # fields of a path file that the page fills in

BASE = 1 << 20  # address of the image; the stack of the kernels lies below
VERTICES = 1 << 14  # capacity of each tree
PATH_ROWS = 2048
LAYOUTS: dict[str, ModuleType] = {
    "table": layout,
    "motion": motion_layout,
    "tree": tree_layout,
    "connect": connect_layout,
    "shortcut": shortcut_layout,
    "crdt": crdt_layout,
    "ik": ik_layout,
}
# Tables of the checks and of inverse kinematics, listed separately because the names of their fields repeat.
TABLES: dict[str, type[Record]] = {
    "world": layout.WorldTable,
    "balls": layout.BallTable,
    "primitives": layout.PrimitiveTable,
    "solids": layout.SolidTable,
    "call": ik_layout.CallTable,
}


def page_planner(
    problem: Problem, goal: Vector, side: float, *, whole: float = np.inf, one_joint: bool = False
) -> dict[str, Any] | None:
    """Return the data with which a page plans from the start of a problem to joint values, as values of JSON.

    Obstacles that move are at their places of time 0.

    Args:
        problem: What the page shows.
        goal: End of the path, shape (dof,).
        side: Initial side of the obstacles that a user may add [m].
        whole: Diagonal of the box around all that is shown [m]: obstacles that are large beside it are locked at first.
        one_joint: Whether the page moves one joint at a time at first.

    Returns:
        None if the page cannot plan: there are no kernels, path constraints apply, a moving obstacle is no simple
        shape, or joint ranges exceed what kernels check.
    """
    if problem.constraints:
        return None

    # Written before spare obstacles are added, which belong to no file.
    document = _document(problem)
    scene, courses = _standing_still(problem.world.scene)
    problem, spare = _with_spares(problem, scene, side)

    clearances = clearances_between(problem.world, np.stack([problem.start, goal]), None) or Clearances(0.0, 0.0)
    world = search_form(densely_checked(problem).world, clearances)

    module = page_kernels()
    motions = world.motions
    if module is None or motions is None:
        return None

    try:
        image, places = page_tables(problem, world, motions)
        tips = _tips(problem, image)
    except InputError:  # joint ranges exceed what the margins of the kernels cover
        return None

    locked = _locked(problem.world, whole)
    obstacles = _obstacles(problem.world, motions.fast, clearances.searched_clearance, spare, locked)
    fixed = standing_parts(problem.world)
    if fixed is None or not {course["name"] for course in courses} <= {obstacle["name"] for obstacle in obstacles}:
        return None

    still = JointPath.of(problem.robot, problem.start[None])
    lower, upper = problem.robot.finite_range()
    return {
        "module": packed(module),
        "image": packed(image.bytes()),
        "base": BASE,
        "end": image.end,
        "places": places,
        "tips": tips,
        "names": layout_numbers(),
        "width": WIDTH,
        "dof": problem.robot.dof,
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "samples": SAMPLES,
        "tries": TRIES,
        "far": UNBOUNDED_COORDINATE,
        "slack": {"primitive": PRIMITIVE_SLACK, "solid": SOLID_SLACK},
        "clearance": clearances.proven_clearance,
        "planner": "BiCRDT" if one_joint else "RRTConnect",
        "start": problem.start.tolist(),
        "goal": goal.tolist(),
        "obstacles": obstacles,
        "courses": courses,
        "fixed": fixed,
        "moving": [_names(problem.world, members) for members in motions.fast.moving],
        "standing": [_names(problem.world, (number,)) for number in motions.fast.standing],
        "path": {key: value for key, value in still.document().items() if key not in PATH_RESULTS},
        "problem": document,
    }


def _document(problem: Problem) -> dict[str, Any] | None:
    """Return the contents of the problem's file, relative to the present folder; None if there is no such form."""
    try:
        return problem_data(problem, Path.cwd())
    except InputError:
        return None


def _standing_still(scene: Scene) -> tuple[Scene, list[dict[str, Any]]]:
    """Return the scene at time 0 with obstacles at rest, and a description of their original motions."""
    scene = scene.at(0.0)
    courses = [_course(obstacle) for obstacle in scene.obstacles if obstacle.motion is not None]
    return replace(scene, obstacles=tuple(replace(obstacle, motion=None) for obstacle in scene.obstacles)), courses


def _course(obstacle: Obstacle) -> dict[str, Any]:
    if isinstance(obstacle.motion, TimedPoses):
        poses = [pose_row(station).tolist() for station in obstacle.motion.poses]
        return {"name": obstacle.name, "times": obstacle.motion.times.tolist(), "poses": poses}
    velocity = np.zeros(3) if obstacle.motion is None else obstacle.motion.velocity
    return {"name": obstacle.name, "velocity": velocity.tolist()}


def _with_spares(problem: Problem, scene: Scene, side: float) -> tuple[Problem, set[str]]:
    """Return the problem with additional simple shapes far away, which the page can use, and their names."""
    taken = {obstacle.name for obstacle in scene.obstacles} | {held.name for held in scene.attached}
    shapes = {
        "box": Box([side] * 3),
        "sphere": Sphere(0.5 * side),
        "cylinder": Cylinder(0.5 * side, side),
        "capsule": Capsule(0.3 * side, side),
    }

    far = pose([0.0, 0.0, -FAR_AWAY])
    spares = []
    for key, count in SPARES.items():
        names = [name for name in (f"{key} {k}" for k in range(1, count + len(taken) + 1)) if name not in taken]
        spares += [Obstacle(name, shapes[key], far) for name in names[:count]]

    return problem.with_world(problem.world.with_scene(scene.with_(*spares))), {spare.name for spare in spares}


def _tips(problem: Problem, image: MemoryImage) -> list[dict[str, Any]]:
    """Return the tips that can be dragged, with the addresses of their inverse kinematics, added to the image."""
    robot = problem.robot
    tips = []
    for name in dragged_tips(problem.robot, problem.goal):
        places = add_limb(image, robot if name == robot.tip else replace(robot, tip=name, closed_form=None))
        tips += [tip_entry(robot, name) | places] if places else []
    return tips


def _locked(world: World, whole: float) -> set[str]:
    """Return the obstacles that do not follow the pointer at first: floors, walls, and what the base stands on."""
    locked = set()
    for obstacle in world.scene.obstacles:
        corners = obstacle_corners(obstacle) if obstacle.shape.bounded else np.zeros((1, 3))
        if float(np.linalg.norm(np.ptp(corners, axis=0))) > LARGE_SHARE * whole:
            locked.add(obstacle.name)

    standing = [k for k, body in enumerate(world.bodies) if body.joint == 0]
    base = [k for k in standing if world.bodies[k].kind != "obstacle"]
    others = [k for k in standing if world.bodies[k].kind == "obstacle" and world.bodies[k].name not in locked]
    pairs = [(k, other) for k in base for other in others]
    frames = world.robot.joint_frames(np.zeros((1, world.robot.dof)))[0]
    near = NEAR_SHARE * whole if np.isfinite(whole) else 0.0
    contacts = measured(world.bodies, pairs, frames, near_only=False)
    return locked | {contact.second for contact in contacts if contact.distance < near}


def _obstacles(world: World, fast: FastWorld, kept: float, spare: set[str], locked: set[str]) -> list[dict[str, Any]]:
    """Return the movable obstacles, which are simple shapes, in packed form and with their clearance [m]."""
    found = []
    shapes = {obstacle.name: obstacle.shape for obstacle in world.scene.obstacles}

    for place, number in enumerate(fast.standing):
        body = world.bodies[number]
        numbers = _packed_shape(body)
        shape = shapes.get(body.name)
        if numbers is not None and shape is not None and shape.key in SPARES:
            placed = body.placement.homogeneous
            found.append(
                {
                    "name": body.name,
                    "node": node_name(body.name),
                    "place": place,
                    "spare": body.name in spare,
                    "locked": body.name in locked,
                    "margin": body.margin + kept,
                    "pose": placed.ravel().tolist(),
                    "shape": shape.key,
                    "sizes": _sizes(shape),
                    **numbers,
                }
            )

    return found


def _packed_shape(body: Body) -> dict[str, Any] | None:
    """Return the numbers by which the kernels represent a body; None if a page cannot move it."""
    core = None if body.kind != "obstacle" else core_of(body.geometry)
    if core is None or len(convex_solids(body.geometry).around) != 1:
        return None

    kind = primitive_kind(body.geometry)
    half = core.half_sides
    if kind is None or kind >= layout.CENTRED_KINDS:
        return None

    return {
        "kind": kind,
        "half": [] if half is None else half.tolist(),
        "length": core.half_length,
        "disc": core.disc or 0.0,
        "radius": core.radius,
        "corners": core.corners.tolist(),
    }


def _sizes(shape: Shape) -> list[float]:
    """Return the sizes of a shape in the order of a problem file [m]."""
    return [float(size) for measure in shape.measures for size in np.ravel(getattr(shape, measure.name))]


def _names(world: World, numbers: Iterable[int]) -> str:
    return ", ".join(dict.fromkeys(world.bodies[number].name for number in numbers))


# --- the image of its memory -----------------------------------------------------------------------------------------


def layout_numbers() -> dict[str, dict[str, int]]:
    """Return the integer constants of the table layouts, and the offsets of fields, by layout or table."""
    listed = {getmodule(table) for table in TABLES.values()}

    def places(table: type[Record]) -> dict[str, int]:
        return {name.upper(): place for name, place in table.places.items()}

    def numbers(module: ModuleType) -> dict[str, int]:
        named = {name: value for name, value in vars(module).items() if name.isupper() and type(value) is int}
        for table in vars(module).values():
            if holds_table(table) and getmodule(table) is module and module not in listed:
                named |= places(table)
        return named

    by_layout = {name: numbers(module) for name, module in LAYOUTS.items()}
    return by_layout | {name: places(table) for name, table in TABLES.items()}


def page_tables(problem: Problem, world: World, motions: FastMotions) -> tuple[MemoryImage, dict[str, int]]:
    """Return the memory image, and the address of each table in it.

    Args:
        problem: Its start is the first start of the searches.
        world: World in which they search.
        motions: Motion table of that world.

    Raises:
        InputError: If joints go farther than the kernels cover.
    """
    image = MemoryImage(BASE)
    world_table = motions.fast.table
    primitives = (world_table.outer_primitives, world_table.inner_primitives)

    places = {
        "world": image.add(world_table),
        "motions": image.add(motions.table),
        "probe": image.add(probe_table(primitives)),
        "pathRows": PATH_ROWS,
    }

    places["search"] = _add_connect(image, problem, motions)
    shortcuts = ShortcutSearch(motions, np.zeros((PATH_ROWS, problem.robot.dof)) + problem.start, asking=False)
    places["shortcuts"] = image.add(shortcuts.table)
    places["crdt"] = _add_crdt(image, problem, world, motions)

    return image, places


def add_limb(image: MemoryImage, robot: Robot) -> dict[str, int] | None:
    """Add the tables of a tip's inverse kinematics; return their addresses, None if a joint depends on several."""
    limb = limb_of(robot)
    return None if limb is None else {"limb": image.add(limb), "ik": image.add(call_table(limb, STEPS, PATIENCE))}


def _add_connect(image: MemoryImage, problem: Problem, motions: FastMotions) -> int:
    """Add RRT-Connect with its trees, ends and path; return its address."""
    search = ConnectSearch(motions, *problem.robot.finite_range(), vertices=VERTICES)
    search.table.put(path=np.zeros((PATH_ROWS, motions.dof)))
    return image.add(search.table)


def _add_crdt(image: MemoryImage, problem: Problem, world: World, motions: FastMotions) -> int:
    """Add the search that moves one joint at a time, with its trees; return its address."""
    same = np.ones(motions.dof)
    none = np.zeros(motions.dof)
    rules = CrdtRules(*problem.robot.finite_range(), same, none, same)

    root = problem.start[None]
    table, _ = CrdtSearch(world, rules, 1, None, root, root, vertices=VERTICES).tables
    return image.add(table)

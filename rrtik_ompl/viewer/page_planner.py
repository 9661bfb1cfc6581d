"""What a page needs to plan by itself: kernels as WebAssembly, the world's tables as an image, and their places."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.shape_table import core_of
from rrtik_ompl.collision.solids import SameObject
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast import FastWorld
from rrtik_ompl.fast.ik import ik_layout
from rrtik_ompl.fast.search import connect_layout, shortcut_layout, tree_layout
from rrtik_ompl.fast.search.connect import ConnectSearch
from rrtik_ompl.fast.search.motions import motion_layout
from rrtik_ompl.fast.search.motions.motion_table import FastMotions
from rrtik_ompl.fast.search.shortcut import ShortcutSearch
from rrtik_ompl.fast.simd.processor import WIDTH
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.primitive_tables import UNBOUNDED_COORDINATE
from rrtik_ompl.fast.tables.scene_tables import SLACK_PER_METRE as PRIMITIVE_SLACK
from rrtik_ompl.fast.tables.scene_tables import primitive_kind
from rrtik_ompl.fast.tables.scratch import probe_table
from rrtik_ompl.fast.tables.solid_tables import SLACK_PER_METRE as SOLID_SLACK
from rrtik_ompl.fast.tables.solid_tables import convex_solids
from rrtik_ompl.fast.wasm.image import MemoryImage
from rrtik_ompl.fast.wasm.page_kernels import page_kernels
from rrtik_ompl.ik.numeric.descent import PATIENCE, STEPS
from rrtik_ompl.ik.numeric.kernel_call import call_table
from rrtik_ompl.ik.serial_chain import limb_of
from rrtik_ompl.path import JointPath
from rrtik_ompl.poses import pose
from rrtik_ompl.problem import Problem, densely_checked
from rrtik_ompl.problem_files.problem import problem_data
from rrtik_ompl.scene import Obstacle
from rrtik_ompl.shapes import Box
from rrtik_ompl.viewer.drawing.robot_picture import node_name
from rrtik_ompl.world import World
from rrtik_ompl.world.kept_clearance import Room, leaving_room, room_between

BASE = 1 << 20  # where the image begins; the stack of the kernels lies below
VERTICES = 1 << 14  # of each tree
PATH_ROWS = 2048
SAMPLES = 60_000  # of a search
TRIES = 2000  # of shortcuts
SPARE_BOXES = 4
FAR_AWAY = 1e3  # [m] below the arm
PATH_RESULTS = ("length", "transitions", "waypoints")  # of a path's file; the page adds its own
LAYOUTS: dict[str, ModuleType] = {
    "table": layout,
    "motion": motion_layout,
    "tree": tree_layout,
    "connect": connect_layout,
    "shortcut": shortcut_layout,
    "ik": ik_layout,
}


def page_planner(problem: Problem, goal: Vector, side: float) -> dict[str, Any] | None:
    """What the page of a problem reads to plan from its start to joint values, as values of JSON.

    None where it cannot plan: there are no kernels, tasks constrain the path, obstacles move by themselves, or joints
    go farther than kernels check.

    Args:
        problem: What the page shows.
        goal: Where its path ends, shape (dof,).
        side: Of the boxes that a person may add [m].
    """
    if problem.constraints or any(obstacle.motion is not None for obstacle in problem.world.scene.obstacles):
        return None
    document = _document(problem)
    problem, spare = _with_spare_boxes(problem, side)
    room = room_between(problem.world, np.stack([problem.start, goal]), None) or Room(0.0, 0.0)
    world = leaving_room(densely_checked(problem).world, room)
    module, motions, limb = page_kernels(), world.motions, limb_of(problem.robot)
    if module is None or motions is None:
        return None
    lower, upper = problem.robot.finite_range()
    try:
        search = ConnectSearch(motions, lower, upper, vertices=VERTICES)
        shortcuts = ShortcutSearch(motions, np.zeros((PATH_ROWS, problem.robot.dof)) + problem.start, asking=False)
    except InputError:  # beyond what the margins of the kernels cover
        return None
    still, image = JointPath.of(problem.robot, problem.start[None]), MemoryImage(BASE)
    places = _add_searches(image, motions, search, shortcuts)
    if limb is not None:
        places |= {"limb": image.add(limb), "ik": image.add(call_table(limb, STEPS, PATIENCE))}
    places["probe"] = image.add(probe_table(motions.fast.tables[layout.OUTER_PRIMITIVES : layout.INNER_PRIMITIVES + 1]))
    return {
        "module": _packed(module),
        "image": _packed(image.bytes()),
        "base": BASE,
        "end": image.end,
        "places": places,
        "names": {name: _numbers_of(module) for name, module in LAYOUTS.items()},
        "width": WIDTH,
        "dof": problem.robot.dof,
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "samples": SAMPLES,
        "tries": TRIES,
        "far": UNBOUNDED_COORDINATE,
        "slack": {"primitive": PRIMITIVE_SLACK, "solid": SOLID_SLACK},
        "clearance": room.kept,
        "start": problem.start.tolist(),
        "goal": goal.tolist(),
        "obstacles": _obstacles(problem.world, motions.fast, room.searched, spare),
        "moving": [_names(problem.world, members) for members in motions.fast.moving],
        "standing": [_names(problem.world, (number,)) for number in motions.fast.standing],
        "path": {key: value for key, value in still.document().items() if key not in PATH_RESULTS},
        "problem": document,
    }


def _document(problem: Problem) -> dict[str, Any] | None:
    """What the problem's file holds, seen from the present folder; None where the format has no words for it."""
    try:
        return problem_data(problem, Path.cwd())
    except InputError:
        return None


def _with_spare_boxes(problem: Problem, side: float) -> tuple[Problem, set[str]]:
    """The problem with boxes far away, of which the page can take some, and their names."""
    scene = problem.world.scene
    taken = {obstacle.name for obstacle in scene.obstacles} | {held.name for held in scene.attached}
    names = [name for name in (f"box {k}" for k in range(1, SPARE_BOXES + len(taken) + 1)) if name not in taken]
    boxes = [Obstacle(name, Box([side] * 3), pose([0.0, 0.0, -FAR_AWAY])) for name in names[:SPARE_BOXES]]
    return problem.with_world(problem.world.with_scene(scene.with_(*boxes))), set(names[:SPARE_BOXES])


def _names(world: World, numbers: Iterable[int]) -> str:
    return ", ".join(dict.fromkeys(world.bodies[number].name for number in numbers))


def _add_searches(
    image: MemoryImage, motions: FastMotions, search: ConnectSearch, shortcuts: ShortcutSearch
) -> dict[str, int]:
    """Add the tables of a world and of the searches in it; where the page finds them."""
    fast = motions.fast
    for each in fast.tables:
        image.add(each)
    image.add(fast.table, links=dict(enumerate(fast.tables)))
    image.add(motions.table, links={motion_layout.WORLD: fast.table})
    alias = {tree_layout.VALUES: tree_layout.ROWS} if motions.identity else {}
    for tree in search.trees:
        image.add(tree, same=alias)
    starts, goals, _ = search.rows
    path: Matrix = np.zeros((PATH_ROWS, motions.dof))
    for rows in (starts, goals, path):
        image.add(rows)
    links: dict[int, Any] = {connect_layout.MOTIONS: motions.table, connect_layout.PATH: path}
    links |= {connect_layout.START_TREE + side: tree for side, tree in enumerate(search.trees)}
    links |= {connect_layout.START_ROWS: starts, connect_layout.GOAL_ROWS: goals}
    values = {connect_layout.ROW_VALUES: connect_layout.ROW} if motions.identity else {}
    image.add(search.table, links=links, same=values)
    image.add(shortcuts.table, links={shortcut_layout.MOTIONS: motions.table})
    return {
        "world": image.place(fast.table),
        "motions": image.place(motions.table),
        "search": image.place(search.table),
        "shortcuts": image.place(shortcuts.table),
        "pathRows": PATH_ROWS,
    }


def _numbers_of(module: ModuleType) -> dict[str, int]:
    """The whole numbers that a layout names."""
    return {name: value for name, value in vars(module).items() if name.isupper() and type(value) is int}


def _obstacles(world: World, fast: FastWorld, kept: float, spare: set[str]) -> list[dict[str, Any]]:
    """The obstacles of simple shapes, which a page can move: how they are packed, and what is kept from each [m]."""
    found = []
    for place, number in enumerate(fast.standing):
        body = world.bodies[number]
        packed = _packed_shape(body)
        if packed is not None:
            placed = body.placement.homogeneous
            found.append(
                {
                    "name": body.name,
                    "node": node_name(body.name),
                    "place": place,
                    "spare": body.name in spare,
                    "margin": body.margin + kept,
                    "pose": placed.ravel().tolist(),
                    **packed,
                }
            )
    return found


def _packed_shape(body: Body) -> dict[str, Any] | None:
    """The numbers of a body by which the kernels know it; None if a page cannot move it."""
    core = None if body.kind != "obstacle" else core_of(body.geometry)
    if core is None or len(convex_solids(body.geometry).around) != 1:
        return None
    kind, half = primitive_kind(SameObject(body.geometry)), core.half_sides
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


def _packed(data: bytes) -> str:
    """Bytes as text that a page unpacks."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode("ascii")

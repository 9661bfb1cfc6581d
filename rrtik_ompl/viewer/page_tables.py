"""The tables that a page plans with, as an image of its memory: a world, searches in it, inverse kinematics."""

from __future__ import annotations

from inspect import getmodule
from types import ModuleType

import numpy as np

from rrtik_ompl.ik.numeric.descent import PATIENCE, STEPS
from rrtik_ompl.ik.numeric.kernel_call import call_table
from rrtik_ompl.ik.serial_chain import limb_of
from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.record import holds_table
from rrtik_ompl.kernels.search import connect_layout, shortcut_layout, tree_layout
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.crdt import layout as crdt_layout
from rrtik_ompl.kernels.search.crdt.rules import CrdtRules
from rrtik_ompl.kernels.search.crdt.search import CrdtSearch
from rrtik_ompl.kernels.search.motions import motion_layout
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.shortcut import ShortcutSearch
from rrtik_ompl.kernels.tables.scratch import probe_table
from rrtik_ompl.kernels.wasm.image import MemoryImage
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

BASE = 1 << 20  # where the image begins; the stack of the kernels lies below
VERTICES = 1 << 14  # of each tree
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


def layout_numbers() -> dict[str, dict[str, int]]:
    """The whole numbers that the layouts of these tables name, and the places of their fields, by layout."""

    def numbers(module: ModuleType) -> dict[str, int]:
        named = {name: value for name, value in vars(module).items() if name.isupper() and type(value) is int}
        own = [each for each in vars(module).values() if holds_table(each) and getmodule(each) is module]
        return named | {name.upper(): place for record in own for name, place in record.places.items()}

    return {name: numbers(module) for name, module in LAYOUTS.items()}


def page_tables(problem: Problem, world: World, motions: FastMotions) -> tuple[MemoryImage, dict[str, int]]:
    """The image, and where in it the page finds each table.

    Args:
        problem: Its start is where searches begin at first.
        world: In which they search.
        motions: The motion table of that world.

    Raises:
        InputError: If joints go farther than the kernels cover.
    """
    image = MemoryImage(BASE)
    fast = motions.fast
    for each in fast.tables:
        image.add(each)

    places = {
        "world": image.add(fast.table, links=dict(enumerate(fast.tables))),
        "motions": image.add(motions.table, links={motions.table.places["world"]: fast.table}),
        "probe": image.add(probe_table(fast.tables[layout.OUTER_PRIMITIVES : layout.INNER_PRIMITIVES + 1])),
        "pathRows": PATH_ROWS,
    }

    places["search"] = _add_connect(image, problem, motions)
    shortcuts = ShortcutSearch(motions, np.zeros((PATH_ROWS, problem.robot.dof)) + problem.start, asking=False)
    places["shortcuts"] = image.add(shortcuts.table)
    places["crdt"] = _add_crdt(image, problem, world, motions)

    return image, places


def add_limb(image: MemoryImage, robot: Robot) -> dict[str, int] | None:
    """Add what inverse kinematics of a tip needs: where the page finds it. None where a joint hangs on several."""
    limb = limb_of(robot)
    return None if limb is None else {"limb": image.add(limb), "ik": image.add(call_table(limb, STEPS, PATIENCE))}


def _add_connect(image: MemoryImage, problem: Problem, motions: FastMotions) -> int:
    """RRT-Connect, with its trees, its ends and the path that it finds."""
    search = ConnectSearch(motions, *problem.robot.finite_range(), vertices=VERTICES)
    search.table.put(path=np.zeros((PATH_ROWS, motions.dof)))
    return image.add(search.table)


def _add_crdt(image: MemoryImage, problem: Problem, world: World, motions: FastMotions) -> int:
    """The search that moves one joint at a time, with its trees."""
    same = np.ones(motions.dof)
    none = np.zeros(motions.dof)
    rules = CrdtRules(*problem.robot.finite_range(), same, none, same)

    root = problem.start[None]
    table, _ = CrdtSearch(world, rules, 1, None, root, root, vertices=VERTICES).tables
    return image.add(table)

"""Each setting of a world, and of each thing in it, by each way of making the world anew: kept, or refused in one line.

The settings are the fields of `WorldSettings`; the ways are those that `bench.truth.matrix_cells` finds in the library.
"""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable, Iterator
from dataclasses import Field, dataclass, fields, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from bench.shared.parts import Parts
from bench.truth.matrix_cells import found_ways
from rrtik_bench.report.page import Report
from rrtik_ompl import AttachedObject, Obstacle, Problem, Robot, Scene, World
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.variants import padded, weighted
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.world_settings import WorldSettings
from rrtik_ompl.replanning import ConstantVelocity
from rrtik_ompl.tasks.setting import Setting
from rrtik_ompl.tasks.stages import Attach, Detach

START, GOAL = np.zeros(3), np.array([0.3, 0.1, 0.0])
LINK = "link2"
POSTURES = 200
KEPT, REFUSED, WRONG = "kept", "refused", "wrong"


@cache
def _robot() -> Robot:
    return rrtik.load_robot("planar3")


def _scene(**ball: Any) -> Scene:
    """A ball and a box beside the arm, and something in its hand."""
    things = [
        Obstacle("ball", rrtik.Sphere(0.2), rrtik.pose([1.4, 1.6, 0.0]), **ball),
        Obstacle("box", rrtik.Box([0.2, 0.2, 0.2]), rrtik.pose([-1.5, 1.2, 0.0])),
    ]
    return Scene(tuple(things), (AttachedObject("rod", "tip", rrtik.Sphere(0.05), rrtik.pose([0.1, 0.0, 0.0])),))


def _held(**rod: Any) -> Scene:
    scene = _scene()
    return replace(scene, attached=(replace(scene.attached[0], **rod),))


def _region() -> TaskRegion:
    bounds = np.tile([-1e3, 1e3], (6, 1))
    bounds[1] = [-0.2, 1e3]
    bounds[3:] = [-np.pi, np.pi]
    return TaskRegion(pin.SE3.Identity(), bounds)


@dataclass(frozen=True)
class Set:
    """A setting: a world that has it, and what another world says about it."""

    world: Callable[[], World]
    read: Callable[[World], Any]


def _of_world(name: str, value: Any) -> Set:
    return Set(lambda: World(_robot(), _scene(), **{name: value}), lambda world: getattr(world.settings, name))


# Values that change answers here; every other setting is tried with one that differs from its default.
VALUES = {"motion_resolution": 0.02, "self_margin": 0.004, "clearance": 0.3, "inflation": 0.1}


def _value(setting: Field[Any]) -> Any:
    """A value of a setting that is a length, a truth or one of some names, other than its default."""
    if setting.name in VALUES:
        return VALUES[setting.name]
    kind = get_type_hints(WorldSettings)[setting.name]
    known = [True, False] if kind is bool else get_args(kind) if get_origin(kind) is Literal else [0.01, 0.02]
    return next(value for value in known if value != setting.default)


ELSEWHERE = ("robot", "scene", "constraints")  # their rows are below
SETTINGS: dict[str, Set] = {
    **{each.name: _of_world(each.name, _value(each)) for each in fields(WorldSettings) if each.name not in ELSEWHERE},
    "constraints": Set(
        lambda: World(_robot(), _scene(), constraints=[_region()]),
        lambda world: [each.bounds.tolist() for each in world.settings.constraints],
    ),
    "robot: padding of a link": Set(
        lambda: World(padded(_robot(), {LINK: 0.1}), _scene()), lambda world: dict(world.robot.padding)
    ),
    "robot: joint weights": Set(
        lambda: World(weighted(_robot(), {"joint2": 3.0}), _scene()),
        lambda world: dict(world.robot.joint_weights),
    ),
    "scene: margin of an obstacle": Set(
        lambda: World(_robot(), _scene(margin=0.3)), lambda world: world.scene.obstacle("ball").margin
    ),
    "scene: motion of an obstacle": Set(
        lambda: World(_robot(), _scene(motion=ConstantVelocity([0.1, 0.0, 0.0]))),
        lambda world: getattr(world.scene.obstacle("ball").motion, "velocity", np.zeros(0)).tolist(),
    ),
    "scene: allowed collisions": Set(
        lambda: World(_robot(), replace(_scene(), allowed_collisions=((LINK, "box"),))),
        lambda world: world.scene.allowed_collisions,
    ),
    "scene: padding of what is held": Set(
        lambda: World(_robot(), _held(padding=0.1)), lambda world: world.scene.attached[0].padding
    ),
    "scene: margin of what is held": Set(
        lambda: World(_robot(), _held(margin=0.1)), lambda world: world.scene.attached[0].margin
    ),
    "scene: what is held may touch": Set(
        lambda: World(_robot(), _held(allow=(LINK,))), lambda world: world.scene.attached[0].allow
    ),
}


@dataclass(frozen=True)
class Remade:
    """A way of making a world anew; what it is asked to change, and whether the answers stay those of the world."""

    make: Callable[[World], World]
    changes: str = ""
    same: bool = True


def _carried(world: World) -> World:
    """The ball is taken and set down where it was."""
    scene = world.scene
    there = scene.obstacle("ball").pose
    order = [each.name for each in scene.obstacles]
    after = scene.attaching("ball", "tip", pose=[9.0, 9.0, 9.0]).detaching("ball", there)
    return world.with_scene(replace(after, obstacles=tuple(sorted(after.obstacles, key=lambda o: order.index(o.name)))))


def _stages(world: World) -> World:
    """The box is taken and set down by stages of a task."""
    setting = Setting.of(world)
    for stage in (Attach("box", "tip"), Detach("box")):
        setting = setting.after(stage, START)
    return setting.world


def _by_problem_file(world: World) -> World:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "p.yaml"
        Problem(world, START, GOAL).save(file)
        return rrtik.load_problem(file).world


def _by_task_file(world: World) -> World:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "t.yaml"
        rrtik.Task([rrtik.MoveTo(GOAL)], world, START).save(file)
        return rrtik.Task.load(file).world


def _by_plan_file(world: World) -> World:
    plan = rrtik.Task([rrtik.MoveTo(rrtik.JointGoal(GOAL))]).plan(world, START, seed=1)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "p.json"
        plan.save(file)
        return rrtik.TaskPlan.load(file).worlds[0]


def _by_roadmap_file(world: World) -> World:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "map.npz"
        rrtik.Roadmap(world, vertices=4).save(file)
        return rrtik.Roadmap.load(file, world).world


def _problem(remade: Callable[[Problem], Problem]) -> Callable[[World], World]:
    return lambda world: remade(Problem(world, START, GOAL)).world


WAYS: dict[str, Remade] = {
    "World.with_accuracy": Remade(lambda world: world.with_accuracy("conservative"), "accuracy", same=False),
    "World.with_clearance": Remade(lambda world: world.with_clearance(0.02), "clearance", same=False),
    "World.with_resolution": Remade(lambda world: world.with_resolution(0.05), "motion_resolution", same=False),
    "World.with_scene": Remade(lambda world: world.with_scene(world.scene)),
    "World.of": Remade(lambda world: World.of(world.settings)),
    "World.proving": Remade(lambda world: world.proving(0.03), "proving", same=False),
    "World.moved": Remade(lambda world: world.moved("ball", world.scene.obstacle("ball").pose)),
    "World.with_obstacle": Remade(lambda world: world.with_obstacle(world.scene.obstacle("ball"))),
    "World.unheld": Remade(lambda world: world.unheld, "constraints", same=False),
    "pickle": Remade(lambda world: pickle.loads(pickle.dumps(world))),
    "copy": Remade(copy.copy),
    "deepcopy": Remade(copy.deepcopy),
    "attach and detach": Remade(_carried, "scene: motion of an obstacle"),
    "stages of a task": Remade(_stages),
    "Problem": Remade(_problem(lambda problem: problem)),
    "Problem again": Remade(lambda world: Problem(Problem(world, START, GOAL).world, START, GOAL).world),
    "Problem.with_accuracy": Remade(_problem(lambda problem: problem.with_accuracy("exact")), "accuracy", same=False),
    "Problem.with_resolution": Remade(
        _problem(lambda problem: problem.with_resolution(0.05)), "motion_resolution", same=False
    ),
    "Problem.with_world": Remade(_problem(lambda problem: problem.with_world(problem.world))),
    "Problem.load": Remade(_by_problem_file),
    "Task.load": Remade(_by_task_file),
    "TaskPlan.load": Remade(_by_plan_file),
    "Roadmap.load": Remade(_by_roadmap_file),
}

NOT_OF_WORLDS = {
    "ReplanRun.load": "holds a record of what was done, and no world",
    "Scenario.load": "holds a problem, read as one",
    "Roadmap.moved_to": "has the world that it is given",
}


def without_row() -> Iterator[str]:
    """A line for each setting, and each way of making a world anew, that has no row here."""
    for each in fields(WorldSettings):
        if not any(name == each.name or name.startswith(f"{each.name}: ") for name in SETTINGS):
            yield f"WorldSettings.{each.name} has no row in SETTINGS of bench/truth/settings.py; add one"
    for name in dict.fromkeys(found_ways()):
        if "." in name and name not in {*WAYS, *NOT_OF_WORLDS}:
            yield f"{name} has no row in WAYS of bench/truth/settings.py; add one"


def cell(setting: str, way: str) -> str:
    """What becomes of a setting by a way: "kept", "refused: why", or "wrong: what"."""
    world, remade = SETTINGS[setting].world(), WAYS[way]
    read = SETTINGS[setting].read
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            other = remade.make(world)
        except InputError as error:
            return f"{REFUSED if str(error) and chr(10) not in str(error) else WRONG}: {error}"
    if remade.changes != setting and read(other) != read(world):
        return f"{WRONG}: {read(other)} in place of {read(world)}"
    if remade.same and not _alike(world, other):
        return f"{WRONG}: other answers"
    return KEPT


def _alike(world: World, other: World) -> bool:
    """Whether two worlds take the same postures and motions; a stated motion of an obstacle does not matter at 0 s."""
    low, high = world.robot.finite_range()
    A, B = np.random.default_rng(3).uniform(low, high, (2, POSTURES, world.robot.dof))
    B = A + 0.05 * (B - A)
    answers = ((w.valid_batch(A), w.motion_valid_batch(A, B), w.motions_proven(A, B)) for w in (world, other))
    return all(np.array_equal(a, b) for a, b in zip(*answers, strict=True))


def row(setting: str) -> list[str]:
    """The cells of a setting, one for each way."""
    return [cell(setting, way) for way in WAYS]


def section(parts: Parts, size: float) -> Report:
    """The settings matrix; it has one size."""
    del size
    report = Report("Settings", "")
    rows = dict(zip(SETTINGS, parts(row, [(name,) for name in SETTINGS]), strict=True))
    cells = [each for found in rows.values() for each in found]
    wrong = sum(each.startswith(WRONG) for each in cells)
    refused = sum(each.startswith(REFUSED) for each in cells)
    measured = f"{wrong} wrong, {len(cells) - wrong - refused} kept, {refused} refused, of {len(cells)} cells"
    report.bar("settings of a world, by each way of making it anew", "0 wrong", measured, wrong == 0)
    missing = list(without_row())
    report.bar("settings and ways without a row", "0", str(len(missing)), not missing)
    table = [[name, *(each.split(":")[0] for each in found)] for name, found in rows.items()]
    said = [
        f"- {name}, {way}: {each}"
        for name, found in rows.items()
        for way, each in zip(WAYS, found, strict=True)
        if each != KEPT
    ]
    report.table("Settings of worlds", ["setting", *WAYS], table, text="\n".join([*said, *missing]))
    return report

"""Each kind of shape by each way to an answer about free and blocked, against a fresh `World`.

A way is whatever the library offers to be asked where a robot is free: forms of a world, what is made from one, what
comes back from a file. `found_ways` finds their names in the library; each has to have a row in `WAYS`.

An answer is right if it is that of the fresh world. It is on the safe side if it refuses what the fresh world takes,
by a way that takes only what it can prove. It is wrong if it differs otherwise: if it says free, or proven, where a
fresh world that is asked densely does not.

A further way that is not found here, such as the kernels of a page, is one more row of `WAYS`: a function of a `Case`
that gives `Judged`.
"""

from __future__ import annotations

import ast
import copy
import inspect
import json
import pickle
import shutil
import subprocess
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
import rrtik_planners
from bench.truth.shape_kinds import kinds
from rrtik_ompl import AttachedObject, Obstacle, Problem, Roadmap, Robot, Scene, World
from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.kinds import KINDS, found
from rrtik_ompl.geometry.collision.certificate import Certificate
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.shapes import HeightField, Mesh, PointCloud, Shape
from rrtik_ompl.ompl_bridge.motion_checker import SpaceChecker, WorldChecker
from rrtik_ompl.replanning import TimedPoses
from rrtik_ompl.replanning.in_time.foreseen import ForeseenWorlds
from rrtik_ompl.viewer.page_planner import page_planner
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.proven_edges import ProvenEdges
from rrtik_ompl.world.proven_motions import ProvenMotions
from rrtik_ompl.world.weighted_motions import WeightedMotions

ROOM = 0.03  # [m]: a clearance that forms of worlds are asked to keep
PROOF_STEP = 2e-3  # [m] in which a motion that was called proven is looked at
NEARLY = 1e-9  # [m] by which distances of two equal worlds may differ; coal's depend on what it computed before
ROUNDED = 1e-6  # [m] likewise of worlds whose poses differ in the last bit: coal's distance of a cylinder moves by 5e-7
LEAST_FREE = 0.2  # of the postures of a case
TRIES = 10
SLOTS = 4  # of time in which a moving obstacle is looked at
SAMPLES = 80  # of a roadmap
QUERIES = 4  # of a roadmap
PAGE_SCRIPT = Path(__file__).with_name("page_kernels.js")
LOOKS = 20  # of a query at whether it is time to stop


@dataclass(frozen=True)
class Judged:
    """What came out of a way: answers that are right, that are refused or on the safe side, and that are wrong."""

    right: int = 0
    refused: int = 0
    wrong: int = 0
    fault: str = ""

    def __add__(self, other: Judged) -> Judged:
        counts = self.right + other.right, self.refused + other.refused, self.wrong + other.wrong
        return Judged(*counts, self.fault or other.fault)


@dataclass(frozen=True, eq=False)
class Case:
    """A robot, a solid at two places, configurations and motions.

    Attributes:
        kind: Of the shape.
        robot: The arm.
        before: The scene in which worlds begin that then change.
        after: The scene that is asked about.
        Q: Configurations, shape (m, dof).
        A, B: Where motions begin and end, shape (k, dof).
    """

    kind: str
    robot: Robot
    before: Scene
    after: Scene
    Q: Matrix
    A: Matrix
    B: Matrix

    @property
    def name(self) -> str:
        """Of the obstacle that is elsewhere in the other scene."""
        return self.after.obstacles[0].name

    def fresh(self, **settings: Any) -> World:
        """A world made anew of what is asked about."""
        return World(self.robot, self.after, **settings)

    def at_first(self, **settings: Any) -> World:
        """A world of the scene before, which has been asked something."""
        world = World(self.robot, self.before, **settings)
        world.valid_batch(self.Q[:4])
        world.motions_proven(self.A[:2], self.B[:2])
        return world

    @cached_property
    def truth(self) -> World:
        """A fresh world, to be compared with."""
        return self.fresh()

    @cached_property
    def roomy(self) -> World:
        """A fresh world whose obstacles have a larger margin."""
        wider = tuple(replace(o, margin=o.margin + ROOM) for o in self.after.obstacles)
        return World(self.robot, replace(self.after, obstacles=wider))


Way = Callable[[Case], Judged]


def draw(kind: str, held: bool, robot: Robot, rng: np.random.Generator, postures: int, motions: int) -> Case:
    """A case of a kind of shape, which stands in the robot's reach or is held by its tip."""
    tips = robot.fk_batch(rng.uniform(*robot.finite_range(), (64, robot.dof)))[:, :3, 3]
    reach = float(np.linalg.norm(tips, axis=1).max())
    shape = kinds()[kind](rng, (0.25 if held else 0.5) * reach)
    low, high = robot.finite_range()
    Q = rng.uniform(low, high, (postures, robot.dof))
    thing = Obstacle("thing", shape, margin=float(rng.choice([0.0, 0.01])))
    tools = []
    if held:
        links = list(dict.fromkeys(robot.link_of(item) for item in robot.collision.geometryObjects))
        pose = rrtik.pose(rng.uniform(-0.1, 0.1, 3) * reach)
        tools = [AttachedObject("tool", links[-1], shape, pose, tuple(links[-4:-1]))]
        thing = Obstacle("post", rrtik.Box([0.1 * reach, 0.1 * reach, reach]))
    before, after = (_with_room(robot, thing, tools, tips, Q, rng) for _ in range(2))
    A = rng.uniform(low, high, (motions, robot.dof))
    B = np.clip(A + rng.normal(0.0, 0.15, A.shape), low, high)
    return Case(f"held {kind}" if held else kind, robot, before, after, Q, A, B)


def _with_room(
    robot: Robot, thing: Obstacle, tools: Sequence[AttachedObject], tips: Matrix, Q: Matrix, rng: np.random.Generator
) -> Scene:
    """A scene in which some postures are free; the thing is drawn farther away from one try to the next."""
    for attempt in range(TRIES):
        place = _place(rng, tips)
        place.translation *= 1.0 + 0.2 * attempt
        scene = Scene((replace(thing, pose=place),), tuple(tools))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if World(robot, scene).valid_batch(Q).mean() > LEAST_FREE:
                break
    return scene


def _place(rng: np.random.Generator, tips: Matrix) -> pin.SE3:
    """Where a tip may come, turned about the vertical and a little otherwise."""
    turn = pin.exp3(np.array([*rng.normal(0.0, 0.3, 2), rng.uniform(-np.pi, np.pi)]))
    return pin.SE3(turn, tips[rng.integers(len(tips))] * rng.uniform(0.6, 1.0))


def movable(kind: str) -> bool:
    """Whether a link can hold a shape of a kind."""
    return bool(kinds()[kind](np.random.default_rng(0), 0.1).movable)


def judged(way: str, case: Case) -> Judged:
    """One cell of the matrix. An InputError is a refusal; anything else that is raised is wrong."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return WAYS[way](case)
        except InputError as error:
            one_line = "\n" not in str(error)
            return Judged(refused=1) if one_line else Judged(wrong=1, fault=f"{error!r}")


def alike(world: Any, truth: World, case: Case) -> Judged:
    """Answers that have to be those of a fresh world; what is proven in one must not touch in the other."""
    wanted = truth.valid_batch(case.Q), truth.motion_valid_batch(case.A, case.B)
    got = world.valid_batch(case.Q), world.motion_valid_batch(case.A, case.B)
    found = Judged()
    for what, given, right in zip(("valid", "motion_valid"), got, wanted, strict=True):
        differ = given != right
        found += Judged(int((~differ).sum()), 0, int(differ.sum()), f"{what}: other answers" if differ.any() else "")
    single = bool(world.valid(case.Q[0])) == bool(got[0][0])
    found += Judged(int(single), 0, int(not single), "" if single else "valid: another answer than valid_batch")
    if isinstance(world, World):
        distances = _distances(world, case)
        for other, allowed in ((World.of(world.settings), NEARLY), (truth, ROUNDED)):
            apart = [abs(a - b) for a, b in zip(distances, _distances(other, case), strict=True)]
            far = sum(gap > allowed for gap in apart if not np.isnan(gap))
            found += Judged(len(apart) - far, 0, far, f"clearance: off by {max(apart):.3g} m" if far else "")
        found += _proofs(world.motions_proven(case.A, case.B), truth.unheld, case)
    return found


@lru_cache(maxsize=4)  # one world is compared with those of many ways
def _distances(world: World, case: Case) -> list[float]:
    """Clearances of a world at some configurations [m]."""
    return [world.clearance(q) for q in case.Q[:2]]  # of meshes, which takes long


def careful(world: Any, truth: World, case: Case) -> Judged:
    """Answers that may refuse what a fresh world takes, and never the other way round."""
    free, given = truth.valid_batch(case.Q), world.valid_batch(case.Q)
    found = _sided(given, free, "valid")
    if hasattr(world, "motions_proven"):
        found += _proofs(world.motions_proven(case.A, case.B), truth, case)
    return found + careful_motions(world, truth, case)


def careful_motions(world: Any, truth: World, case: Case) -> Judged:
    """Likewise of motions alone."""
    given = world.motion_valid_batch(case.A, case.B)
    return _sided(given, truth.motion_valid_batch(case.A, case.B), "motion_valid")


def _sided(given: Mask, free: Mask, what: str) -> Judged:
    rash = given & ~free
    counts = int((given == free).sum()), int((~given & free).sum()), int(rash.sum())
    return Judged(*counts, f"{what}: free where it is not" if rash.any() else "")


def _proofs(proven: Mask, truth: World, case: Case) -> Judged:
    """Proven motions are free in small steps in a fresh world; how many are not proven, though free, is counted."""
    free = truth.motion_valid_batch(case.A, case.B)
    free[proven] = truth.with_resolution(PROOF_STEP).motion_valid_batch(case.A[proven], case.B[proven])
    return _sided(proven, free, "motions_proven")


# Ways that are forms of a world


def _by_coal(case: Case) -> Judged:
    """The fresh world itself, by coal alone."""
    world = case.truth
    inside = case.robot.within_limits(case.Q)
    free = inside & Certificate(world.robot, world.bodies, world.pairs).free(case.Q)
    given = world.valid_batch(case.Q)
    wrong = given != free
    return Judged(int((~wrong).sum()), 0, int(wrong.sum()), "valid: not what coal says" if wrong.any() else "")


def _with_accuracy(case: Case) -> Judged:
    world = case.fresh().with_accuracy("conservative")
    back = world.with_accuracy("exact")
    return careful(world, case.truth, case) + alike(back, case.truth, case)


def _with_clearance(case: Case) -> Judged:
    world = case.fresh().with_clearance(5.0 * ROOM).with_clearance(ROOM)
    given = world.valid_batch(case.Q), world.motion_valid_batch(case.A, case.B)
    wanted = case.roomy.valid_batch(case.Q), case.roomy.motion_valid_batch(case.A, case.B)
    differ = sum(int((a != b).sum()) for a, b in zip(given, wanted, strict=True))
    found = Judged(len(case.Q) + len(case.A) - differ, 0, differ, "clearance: other answers" if differ else "")
    return found + alike(world.with_clearance(0.0), case.truth, case)


def _with_resolution(case: Case) -> Judged:
    world, truth = case.fresh().with_resolution(0.05), case.fresh(motion_resolution=0.05)
    return alike(world, truth, case) + alike(world.with_resolution(0.01), case.truth, case)


def _with_scene(case: Case) -> Judged:
    return alike(case.at_first().with_scene(case.after), case.truth, case)


def _of(case: Case) -> Judged:
    settings = case.at_first(self_margin=0.01).settings
    return alike(World.of(replace(settings, scene=case.after, self_margin=0.0)), case.truth, case)


def _proving(case: Case) -> Judged:
    world = case.fresh().proving()
    found = careful_motions(world, case.truth, case)
    return found + _proofs(world.motion_valid_batch(case.A, case.B), case.truth, case)


def _moved(case: Case) -> Judged:
    there = case.after.obstacles[0].pose
    moved = case.at_first().moved(case.name, there)
    found = alike(moved, case.truth, case)
    back = moved.moved(case.name, rrtik.pose([9.0, 9.0, 9.0])).moved(case.name, there)
    return found + alike(back, case.truth, case)


def _exchanged(case: Case) -> Judged:
    return alike(case.at_first().with_obstacle(case.after.obstacles[0]), case.truth, case)


def _region(case: Case) -> TaskRegion:
    """All places of the tip on one side of the middle."""
    tips = case.robot.fk_batch(case.Q)[:, :3, 3]
    bounds = np.tile([-1e3, 1e3], (6, 1))
    bounds[0, 0] = float(np.median(tips[:, 0]))
    bounds[3:] = [-np.pi, np.pi]
    return TaskRegion(pin.SE3.Identity(), bounds)


def _constraints(case: Case) -> Judged:
    region = _region(case)
    world = case.fresh(constraints=[region])
    edge = region.bounds[0, 0]
    held = case.robot.fk_batch(case.Q)[:, 0, 3] >= edge
    clear = np.abs(case.robot.fk_batch(case.Q)[:, 0, 3] - edge) > 1e-3
    given, wanted = world.valid_batch(case.Q), case.truth.valid_batch(case.Q) & held
    differ = (given != wanted) & clear
    found = Judged(int((~differ).sum()), 0, int(differ.sum()), "constraints: other answers" if differ.any() else "")
    found += careful_motions(world, case.truth, case)
    return found + _proofs(world.motions_proven(case.A, case.B), case.truth, case)


def _unheld(case: Case) -> Judged:
    return alike(case.fresh(constraints=[_region(case)]).unheld, case.truth, case)


def _moved_with_constraints(case: Case) -> Judged:
    region = _region(case)
    moved = case.at_first(constraints=[region]).moved(case.name, case.after.obstacles[0].pose)
    return alike(moved, case.fresh(constraints=[region]), case)


def _pickled(case: Case) -> Judged:
    moved = case.at_first().moved(case.name, case.after.obstacles[0].pose)
    return alike(pickle.loads(pickle.dumps(moved)), case.truth, case)


def _copied(case: Case) -> Judged:
    moved = case.at_first().moved(case.name, case.after.obstacles[0].pose)
    return alike(copy.copy(moved), case.truth, case) + alike(copy.deepcopy(moved), case.truth, case)


def _another_thread(case: Case) -> Judged:
    moved = case.at_first().moved(case.name, case.after.obstacles[0].pose)
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(alike, moved, case.truth, case).result()


# Ways that are made from a world


def _moving_world(case: Case) -> Judged:
    at_rest = MovingWorld(case.fresh())
    found = careful(at_rest, case.truth, case)
    moved = MovingWorld(case.at_first(), copies=2)
    moved.move(case.after, case.after)
    found += careful(moved, case.truth, case)
    moved.move(case.after, case.after, inflation={o.name: ROOM for o in case.after.obstacles})
    found += careful(moved, case.roomy, case)
    return found + careful(MovingWorld(case.fresh(clearance=ROOM)), case.roomy, case)


def _foreseen_worlds(case: Case) -> Judged:
    """The obstacle goes from its first place to the other one; in each slot what is free is free at all its times.

    From when it reaches the base nothing is asked: the search ends before that.
    """
    thing = case.before.obstacles[0]
    last = case.after.obstacles[0].pose
    turn = last.rotation if thing.shape.bounded else thing.pose.rotation  # what has no end may not turn
    motion = TimedPoses([0.0, 1.0], [thing.pose, pin.SE3(turn, last.translation)])
    scene = replace(case.before, obstacles=(replace(thing, motion=motion),))
    slot = 1.0 / SLOTS
    worlds = ForeseenWorlds(World(case.robot, scene), slot, 0.0)
    reached, _ = worlds.base_reached((SLOTS + 1) * slot)
    found = Judged()
    for number in range(SLOTS + 1):  # in the last one the obstacle is at rest
        begin, end = number * slot, (number + 1) * slot
        free = np.array([worlds.free(number, a, b) for a, b in zip(case.A, case.B, strict=True)])
        for time in (begin, 0.6 * begin + 0.4 * end):
            truth = World(case.robot, scene.at(time))
            blocked = bool(truth.checks.solids.always_colliding)
            late = blocked and time < reached - 1e-6
            found += Judged(int(not late), 0, int(late), "base_reached: too late" if late else "")
            if not blocked and end <= reached:
                found += _proofs(free, truth, case)
    return found


def _weighted_motions(case: Case) -> Judged:
    weights: Vector = np.exp2(np.arange(case.robot.dof) % 3).astype(np.float64)  # powers of two: nothing is rounded
    world = WeightedMotions(case.fresh(), weights)
    scaled = replace_rows(case, weights)
    given = world.valid_batch(scaled.Q), world.motion_valid_batch(scaled.A, scaled.B)
    wanted = case.truth.valid_batch(case.Q), case.truth.motion_valid_batch(case.A, case.B)
    differ = sum(int((a != b).sum()) for a, b in zip(given, wanted, strict=True))
    return Judged(len(case.Q) + len(case.A) - differ, 0, differ, "weighted: other answers" if differ else "")


def replace_rows(case: Case, weights: Vector) -> Case:
    """The case in coordinates multiplied by weights, shape (dof,)."""
    return replace(case, Q=case.Q * weights, A=case.A * weights, B=case.B * weights)


def _proven_motions(case: Case) -> Judged:
    if case.truth.fast is None:
        raise InputError("proven motions: the world has no kernels")
    given = ProvenMotions(case.fresh(), 0.0).motion_valid_batch(case.A, case.B)
    return _proofs(given, case.truth, case)


def _proven_edges(case: Case) -> Judged:
    given = ProvenEdges(case.fresh()).motion_valid_batch(case.A, case.B)
    return _proofs(given, case.truth, case)


def _world_checker(case: Case) -> Judged:
    return alike(WorldChecker(case.fresh()), case.truth, case)


def _space_checker(case: Case) -> Judged:
    """Of OMPL's space, which takes the beginning of a motion to be free."""
    checker = SpaceChecker(rrtik.ompl.space_information(case.fresh()))
    given = checker.valid_batch(case.Q)
    free = case.truth.valid_batch(case.Q)
    found = _sided(given, free, "valid")
    begins = case.truth.valid_batch(case.A)
    motions = checker.motion_valid_batch(case.A, case.B) & begins
    return found + _sided(motions, case.truth.motion_valid_batch(case.A, case.B), "motion_valid")


def _problem(remade: Callable[[Problem], Problem]) -> Way:
    def way(case: Case) -> Judged:
        return alike(remade(_posed(case)).world, case.truth, case)

    return way


def _posed(case: Case) -> Problem:
    """A problem between two free configurations.

    Raises:
        InputError: If all are blocked.
    """
    world = case.fresh()
    free = case.Q[world.valid_batch(case.Q) & world.certify(case.Q)]
    if len(free) == 0:
        raise InputError("no configuration is free")
    return Problem(world, free[0], free[-1])


def _problem_with_world(case: Case) -> Judged:
    problem = _posed(case)
    other = problem.with_world(problem.world.with_scene(case.before))
    return alike(other.with_world(other.world.with_scene(case.after)).world, case.truth, case)


def _roadmap(case: Case) -> Judged:
    before = Roadmap(case.at_first(), vertices=SAMPLES, seed=1)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "map.npz"
        before.save(file)
        loaded = rrtik.Roadmap.load(file, case.fresh(), moved=True)
    return _routes(before.moved_to(case.fresh()), case) + _routes(loaded, case)


def _routes(roadmap: Roadmap, case: Case) -> Judged:
    """Routes through a roadmap: their motions are free in a fresh world."""
    free = case.truth.valid_batch(case.A) & case.truth.valid_batch(case.B)
    found = Judged()
    for a, b in zip(case.A[free][:QUERIES], case.B[free][:QUERIES], strict=True):
        rows = roadmap.route(a[None], b[None], _after(LOOKS))
        if rows is not None:
            valid = case.truth.motion_valid_batch(rows[:-1], rows[1:])
            fault = "" if valid.all() else "route: motions that are not free"
            found += Judged(int(valid.sum()), 0, int((~valid).sum()), fault)
    return found


def _after(looks: int) -> Callable[[], bool]:
    """It is time to stop from so many looks on."""
    left = iter(range(looks))
    return lambda: next(left, None) is None


# Ways by files


def _with_files(shape: Shape, folder: Path) -> Shape:
    """The shape as it is read from a file, if files have its kind."""
    if isinstance(shape, Mesh):
        solid = "solid a\n" + "".join(map(_facet, shape.vertices[shape.triangles])) + "endsolid a\n"
        (folder / "a.stl").write_text(solid)
        return rrtik.Mesh.load(folder / "a.stl")
    if isinstance(shape, PointCloud):
        return shape.save(folder / "a.npy")
    if isinstance(shape, HeightField):
        np.save(folder / "h.npy", shape.heights)
        return rrtik.HeightField.load(folder / "h.npy", shape.cell, floor=shape.floor)
    return shape


def _facet(corners: Matrix) -> str:
    points = "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist())
    return f"facet normal 0 0 0\nouter loop\n{points}endloop\nendfacet\n"


def _load_problem(case: Case) -> Judged:
    with TemporaryDirectory() as text:
        folder = Path(text)
        problem = _posed(case)
        scene = problem.world.scene
        things = tuple(replace(o, shape=_with_files(o.shape, folder)) for o in scene.obstacles)
        held = tuple(replace(a, shape=_with_files(a.shape, folder)) for a in scene.attached)
        world = World(case.robot, replace(scene, obstacles=things, attached=held))
        written = Problem(world, problem.start, problem.goal)
        written.save(folder / "p.yaml")
        return alike(rrtik.load_problem(folder / "p.yaml").world, world, case)


def _page(case: Case) -> Judged:
    """The kernels of a 3-D page, run by node: as the page is made, and with the obstacle dragged there."""
    node = shutil.which("node")
    if node is None:
        return Judged(refused=1)
    there = case.after.obstacles[0].pose
    found = _in_page(node, case, case.after, None)
    return found + _in_page(node, case, case.before, there.homogeneous.ravel().tolist())


def _in_page(node: str, case: Case, scene: Scene, place: list[float] | None) -> Judged:
    """What a page of a scene calls free once its obstacle is at a place."""
    world = World(case.robot, scene)
    free = case.Q[world.valid_batch(case.Q)]
    if not len(free):
        return Judged(refused=1)
    plan = page_planner(Problem(world, free[0], free[0]), free[0], 0.1)
    if plan is None or (place is not None and (not plan["obstacles"] or plan["obstacles"][0]["name"] != case.name)):
        return Judged(refused=1)  # such a page does not plan, or cannot drag the obstacle
    given = json.dumps({"plan": plan, "place": place, "Q": case.Q.tolist()})
    command = [node, str(PAGE_SCRIPT), str(files("rrtik_ompl.viewer").joinpath("assets"))]
    done = subprocess.run(command, input=given, capture_output=True, text=True)
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if "Error" in line]
        return Judged(wrong=1, fault=f"page: {said[0] if said else done.returncode}")
    return _sided(np.array(json.loads(done.stdout), dtype=bool), case.truth.valid_batch(case.Q), "page")


WAYS: dict[str, Way] = {
    "fresh, by coal": _by_coal,
    "World.with_accuracy": _with_accuracy,
    "World.with_clearance": _with_clearance,
    "World.with_resolution": _with_resolution,
    "World.with_scene": _with_scene,
    "World.of": _of,
    "World.proving": _proving,
    "World.moved": _moved,
    "World.with_obstacle": _exchanged,
    "World.unheld": _unheld,
    "World(constraints=)": _constraints,
    "moved with constraints": _moved_with_constraints,
    "pickle": _pickled,
    "copy": _copied,
    "another thread": _another_thread,
    "MovingWorld": _moving_world,
    "ForeseenWorlds": _foreseen_worlds,
    "WeightedMotions": _weighted_motions,
    "ProvenMotions": _proven_motions,
    "ProvenEdges": _proven_edges,
    "WorldChecker": _world_checker,
    "SpaceChecker": _space_checker,
    "Problem.with_accuracy": _problem(lambda problem: problem.with_accuracy("exact")),
    "Problem.with_resolution": _problem(lambda problem: problem.with_resolution(0.01)),
    "Problem.with_world": _problem_with_world,
    "Roadmap.moved_to": _roadmap,
    "Problem.load": _load_problem,
    "Roadmap.load": _roadmap,
    "page": _page,
}

ASKED = {"motion_valid_batch", "motions_proven", "valid_batch", "steps_free"}  # by these a way is known
NO_WAYS = {
    "MotionQueries": "a protocol, and what those share who keep to it",
    "Task.load": "its world is made as that of a problem is; tests/tasks compares them",
    "TaskPlan.load": "likewise, of each motion",
    "ReplanRun.load": "it holds a record of what was done, and no world",
    "Scenario.load": "it holds a problem, read as one",
}


def found_ways() -> Iterator[str]:
    """Names of ways in the library: forms of values that hold a world, classes that say what is free, files."""
    for kind in (World, Problem, Roadmap):
        for name, member in inspect.getmembers(kind):
            if not name.startswith("_") and _makes(member) in (kind.__name__, "Kind"):
                yield f"{kind.__name__}.{name}"
    for package in (rrtik, rrtik_planners):
        yield from _classes(Path(str(package.__file__)).parent)
    for name, row in KINDS.items():
        if not {"world", "worlds", "problem"}.isdisjoint(dir(found(row.value))):
            yield f"{name}.load"


def _makes(member: Any) -> str:
    """The name of what a method, property or function says that it returns."""
    function = member.fget if isinstance(member, property) else member
    said = getattr(function, "__annotations__", {}).get("return", "")
    return said if isinstance(said, str) else getattr(said, "__name__", "")


def _classes(folder: Path) -> Iterator[str]:
    for file in sorted(folder.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if any(f"def {name}" in text for name in ASKED):
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.ClassDef) and node.name != "World":
                    methods = {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
                    if methods & ASKED:
                        yield node.name


def without_row() -> list[str]:
    """A line for each way of the library that has no row."""
    known = {*WAYS, *NO_WAYS}
    lines = "has no row in WAYS of bench/truth/matrix_cells.py; add one that compares it with a fresh World"
    return [f"{name} {lines}" for name in dict.fromkeys(found_ways()) if name not in known]

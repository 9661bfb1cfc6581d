"""The measurements: plans on generated scenes with thin obstacles, shortened paths, planted obstacles, and times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any
from unittest.mock import patch

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import rrtik_ompl as rrtik
from bench.proofs.judge import deepest_cut
from bench.shared.problems import goal_joints
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ShorteningMethod
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import Body, link_bodies
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Cylinder
from rrtik_ompl.ompl_bridge.attempt import Attempt, attempt
from rrtik_ompl.planning.generated_problems import generated_problem
from rrtik_ompl.planning.shortening import METHODS, Task, Wishes
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker
from rrtik_ompl.world.problem import Problem, densely_checked
from rrtik_ompl.world.world import World

PLATE, NEEDLE = 1e-4, 2e-4  # [m] thickness, radius
PLANNERS = ("fastrrtconnect", "bicrdt", "RRTConnect")
SECONDS = 10.0  # for a plan: enough on a busy machine
FEWEST = 2.0  # [s] for fewest-moves
BRIEF = 1e-6  # share of a motion
TURNS = 5
THIN = 6  # obstacles added to a generated scene


@dataclass(frozen=True)
class Judged:
    """A path: whether it is proven, what it keeps, how deep it cuts [m], and its length; before: without proofs."""

    found: bool
    proven: bool = False
    clearance: float = 0.0
    cut: float = 0.0
    length: float = 0.0
    before: float = 0.0
    cut_before: float = 0.0


@dataclass(frozen=True)
class Timed:
    """Processor times of a benchmark problem [s].

    Attributes:
        proven: Whether the paths of both calls are.
        default: `plan(problem)`.
        rest: Of `plan()` by the named planner, less the planner and OMPL around it.
        proof: `World.prove` of the named planner's path.
        sampled: The second check of that path in steps.
    """

    proven: bool
    default: float
    rest: float
    proof: float
    sampled: float


def thin_problem(arm: str, family: str, seed: int) -> Problem | None:
    """A generated problem with thin plates and needles around the straight way; None if they block an end."""
    try:
        problem = generated_problem(rrtik.load_robot(arm), family, seed)
    except InputError:
        return None
    rng, robot = np.random.default_rng([7, seed]), problem.robot
    ends = np.array([problem.start, goal_joints(problem)])
    tips = robot.fk_batch(ends[0] + rng.uniform(0.1, 0.9, (THIN, 1)) * (ends[1] - ends[0]))[:, :3, 3]
    spread = 0.1 * float(np.linalg.norm(tips.max(axis=0) - tips.min(axis=0)) + 0.1)
    scene, added = problem.world.scene, list(problem.world.scene.obstacles)
    for k, tip in enumerate(tips):
        turn = pin.exp3(rng.uniform(-np.pi, np.pi, 3))
        shape = Box([PLATE, 0.1, 0.1]) if k % 2 else Cylinder(NEEDLE, 0.2)
        thin = Obstacle(f"thin{k}", shape, pin.SE3(turn, tip + rng.normal(0.0, spread, 3)))
        world = World(robot, Scene((*added, thin), scene.attached, scene.allowed_collisions))
        added += [thin] if world.valid_batch(ends).all() and world.certify(ends).all() else []
    world = World(robot, Scene(tuple(added), scene.attached, scene.allowed_collisions))
    return Problem(world, *ends)


def planned(arm: str, family: str, seed: int) -> Judged:
    """The path of one planner, by turns, in a generated scene with thin obstacles."""
    problem = thin_problem(arm, family, seed)
    if problem is None:
        return Judged(found=False)
    found = rrtik.plan(problem, PLANNERS[seed % len(PLANNERS)], seed=seed, seconds=SECONDS, shorten=False)
    if found.path is None or found.path.proof is None:
        return Judged(found=False)
    cut = deepest_cut(problem.world, found.path)
    return Judged(True, bool(found.proven), found.path.proof.clearance, cut, found.path.length)


def shortened(arm: str, family: str, seed: int) -> list[Judged]:
    """A path in a generated scene with thin obstacles, shortened by every method."""
    problem = thin_problem(arm, family, seed)
    if problem is None:
        return [Judged(found=False)] * len(METHODS)
    return [Judged(found=False) if both is None else _judged(problem, *both) for both in by_every_method(problem, seed)]


def _judged(problem: Problem, short: JointPath, old: JointPath) -> Judged:
    proof = short.proof
    return Judged(
        found=True,
        proven=proof is not None and proof.proven,
        clearance=0.0 if proof is None else proof.clearance,
        cut=deepest_cut(problem.world, short),
        length=short.length,
        before=old.length,
        cut_before=deepest_cut(problem.world, old),
    )


def by_every_method(problem: Problem, seed: int) -> Iterator[tuple[JointPath, JointPath] | None]:
    """A path as each method shortens it, and as that was done before there were proofs; None where there is no path.

    Methods for single-joint moves take a path of BiCRDT, the others one of RRT-Connect.
    """
    paths = {
        single: rrtik.plan(
            problem, "bicrdt" if single else "fastrrtconnect", seed=seed, seconds=SECONDS, shorten=False
        ).path
        for single in (False, True)
    }
    for method in METHODS:
        raw = paths[METHODS[method].keeps_moves]
        yield None if raw is None or len(raw.waypoints) < 3 else _before_and_after(problem, raw, method, seed)


def _before_and_after(
    problem: Problem, raw: JointPath, method: ShorteningMethod, seed: int
) -> tuple[JointPath, JointPath]:
    """A path shortened, and as it was before there were proofs: densely checked, no clearance."""
    seconds = FEWEST if METHODS[method].moves_only else None
    short = rrtik.shorten(raw, problem, method=method, seed=seed, seconds=seconds)
    dense = densely_checked(problem)
    budget = Budget(seed, np.inf if seconds is None else seconds)
    task = Task(dense.world, Wishes(budget, clearance=0.0))
    return short, raw.with_waypoints(METHODS[method].run(raw.waypoints, task, dense))


def planted(arm: str, seed: int) -> tuple[int, int, int]:
    """Thin obstacles that a motion touches and discrete checks step over: planted so, found by proofs, both ways."""
    robot, rng = rrtik.load_robot(arm), np.random.default_rng([11, seed])
    bare, low, high = World(robot), *(np.clip(end, -3.0, 3.0) for end in (robot.lower, robot.upper))
    bodies = [body for body in link_bodies(robot) if body.joint > 0]
    tried = found = back = 0
    for _ in range(200):
        a = rng.uniform(low, high)
        b = np.clip(a + rng.normal(0.0, 0.5, robot.dof), low, high)
        thin = _thin_at(robot, bodies, a, b, rng)
        if thin is None or not bare.motion_proven(a, b):
            continue
        world = World(robot, Scene((thin,)))
        if not world.motion_valid(a, b) or _free_when_fine(world, a, b):
            continue  # seen by the discrete check, or not touched at all
        tried += 1
        found += not world.motion_proven(a, b)
        back += not world.motion_proven(b, a)
        if tried == 20:
            break
    return tried, found, back


def _free_when_fine(world: World, a: Vector, b: Vector) -> bool:
    shares = np.linspace(0.0, 1.0, 20_001)[:, None]
    return bool(world.valid_batch((1.0 - shares) * a + shares * b).all())


def _thin_at(robot: Robot, bodies: list[Body], a: Vector, b: Vector, rng: np.random.Generator) -> Obstacle | None:
    """A needle or a plate that a corner of a link brushes across, between two looks of a check in steps."""
    body = bodies[int(rng.integers(len(bodies)))]
    corners = _corners(body.geometry)
    if corners is None:
        return None
    count = max(World(robot).steps(a, b), 1)
    share = (rng.integers(count) + 0.5) / count  # halfway between two looks
    before, now, after = (_points(robot, body, corners, a + (share + h) * (b - a)) for h in (-BRIEF, 0.0, BRIEF))
    ways, away = after - before, rng.normal(size=3)
    for _ in range(TURNS):  # until the farthest corner moves across the way to it
        corner = int((now @ away).argmax())
        way = ways[corner] / max(float(np.linalg.norm(ways[corner])), 1e-12)
        away = away - (away @ way) * way
        away /= np.linalg.norm(away)
    corner = int((now @ away).argmax())
    turn = np.column_stack([way, away, np.cross(way, away)])
    depth = rng.uniform(2e-5, 3e-4)
    if rng.random() < 0.5:
        return Obstacle("needle", Cylinder(NEEDLE, 0.2), pin.SE3(turn, now[corner] + (NEEDLE - depth) * away))
    return Obstacle("plate", Box([PLATE, 0.02, 0.1]), pin.SE3(turn, now[corner] + (0.01 - depth) * away))


def _points(robot: Robot, body: Body, corners: Matrix, q: Vector) -> Matrix:
    frame = pin.SE3(robot.joint_frames(q[None])[0, body.joint]) * body.placement
    return np.asarray(corners @ frame.rotation.T + frame.translation)


def _corners(geometry: coal.CollisionGeometry) -> NDArray[np.float64] | None:
    """Points of a geometry's surface, among them its farthest in every direction; None for round ones."""
    if isinstance(geometry, coal.BVHModelBase):
        return np.array(geometry.vertices())
    if isinstance(geometry, coal.ConvexBase):
        return np.array(geometry.points()).reshape(-1, 3)
    if isinstance(geometry, coal.Box):
        return np.array(np.meshgrid(*((-h, h) for h in geometry.halfSide))).reshape(3, -1).T
    return None


def benchmark_problem(file: str, urdf: str) -> Timed:
    """One MotionBenchMaker problem: the default call, then the named planner, with proofs and warm kernels."""
    problem = load_motion_bench_maker(Path(file), robot=_robot(urdf))
    problem.world.prove(np.array([problem.start, problem.start]))  # packs the table, as the first call of a user does
    spent = 0.0

    def timed(*arguments: Any, **options: Any) -> Attempt:
        nonlocal spent
        begin = process_time()
        try:
            return attempt(*arguments, **options)
        finally:
            spent += process_time() - begin

    begin = process_time()
    default = rrtik.plan(problem, seed=1)
    whole = process_time() - begin

    with patch("rrtik_ompl.planning.attempts.attempt", timed):
        begin = process_time()
        found = rrtik.plan(problem, "fastrrtconnect", seed=1, shorten=False)
        rest = process_time() - begin - spent
    first = rrtik.plan(problem, "fastrrtconnect", seed=1, proof="off", shorten=False).path
    assert first is not None
    assert found.path is not None
    proof = _seconds(problem.world, first.waypoints, 5)
    begin = process_time()
    for a, b in pairwise(first.waypoints):
        problem.world.certify(_dense(problem.world, a, b))
    sampled = process_time() - begin
    return Timed(bool(default.proven and found.proven), whole, rest, proof, sampled)


_robots: dict[str, Robot] = {}


def _robot(urdf: str) -> Robot:
    if urdf not in _robots:
        _robots[urdf] = rrtik.load_robot(Path(urdf))
    return _robots[urdf]


def _seconds(world: World, rows: Matrix, repeats: int) -> float:
    world.prove(rows)
    begin = process_time()
    for _ in range(repeats):
        world.prove(rows)
    return (process_time() - begin) / repeats


def _dense(world: World, a: Vector, b: Vector) -> Matrix:
    count = max(world.steps(a, b, 0.5 * world.motion_resolution), 1)
    shares = np.linspace(0.0, 1.0, count + 1)[:, None]
    rows: Matrix = (1.0 - shares) * a + shares * b
    return rows


def batch_ratio(file: str, urdf: str) -> tuple[float, float, float]:
    """Free motions of 1 rad: processor time of discrete checks and of proofs [s each], and the share proven."""
    problem = load_motion_bench_maker(Path(file), robot=_robot(urdf))
    world, rng = problem.world, np.random.default_rng(0)
    low, high = problem.robot.finite_range()
    A = rng.uniform(low, high, (20_000, problem.robot.dof))
    A = A[world.valid_batch(A)][:3000]
    ways = rng.normal(size=A.shape)
    B = np.clip(A + ways / np.linalg.norm(ways, axis=1, keepdims=True), low, high)
    free = world.motion_valid_batch(A, B)
    A, B = A[free], B[free]
    world.motions_proven(A, B)
    begin = process_time()
    world.motion_valid_batch(A, B)
    middle = process_time()
    proven = world.motions_proven(A, B)
    return (middle - begin) / len(A), (process_time() - middle) / len(A), float(proven.mean())

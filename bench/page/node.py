"""What the page's kernels answer in node, beside what the library answers in this process."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.kernels.layout import FREE
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.crdt.rules import CrdtRules
from rrtik_ompl.kernels.search.crdt.search import CrdtSearch
from rrtik_ompl.kernels.search.motions.motion_table import step_counts
from rrtik_ompl.planning.generated_problems import generated_problem
from rrtik_ompl.viewer.page_planner import SAMPLES, VERTICES, page_planner
from rrtik_ompl.world.clearances import Clearances, clearances_between, search_form
from rrtik_ompl.world.problem import densely_checked

SCRIPT = Path(__file__).with_name("in_node.js")
ROUNDING = 1e-12  # [rad or m]
POSES, SHARE_MOTIONS = 20, 10  # of each obstacle; configurations to one motion
ROBOTS = (
    "panda", "ur3", "ur5", "ur5_limited", "ur10", "xarm7", "kinova", "titan4", "puma560", "z1", "so101", "baxter_left",
)  # fmt: skip
SIDE = 0.1  # [m]


def generated(robot: str, family: str, seed: int) -> rrtik.Problem:
    """A problem made from a seed."""
    return generated_problem(rrtik.load_robot(robot), family, seed)


PROBLEMS: dict[str, Callable[[], rrtik.Problem]] = {
    "titan4_sdu": partial(rrtik.load_problem, "titan4_sdu"),
    "titan4_prisms": partial(rrtik.load_problem, "titan4_prisms"),
    "planar3_a": partial(rrtik.load_problem, "planar3_a"),
    "panda pipes 1": partial(generated, "panda", "pipes", 1),
    "ur5 clutter 0": partial(generated, "ur5", "clutter", 0),
    "ur5_limited pipes 0": partial(generated, "ur5_limited", "pipes", 0),
    "ur3_limited clutter 0": partial(generated, "ur3_limited", "clutter", 0),
    "xarm7 pipes 0": partial(generated, "xarm7", "pipes", 0),
}


def goal_of(problem: rrtik.Problem) -> Vector:
    """The joint values of a problem's goal."""
    assert isinstance(problem.goal, rrtik.JointGoal)
    return problem.goal.q


def in_node(plan: dict[str, Any], **work: Any) -> dict[str, Any]:
    """What the page's kernels answer."""
    if shutil.which("node") is None:
        raise SystemExit("node is not on PATH: the page's kernels cannot be run")
    assets = files("rrtik_ompl.viewer").joinpath("assets")
    given = json.dumps({"plan": plan, "seeds": [], "moves": [], **work})
    done = subprocess.run(["node", SCRIPT, str(assets)], input=given, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@dataclass(frozen=True)
class Searches:
    """Of how many searches of a problem the path is Python's to the bit, but for rounding, or another one."""

    seeds: int
    equal: int
    rounded: int
    other: int
    milliseconds: float


def searched(problem: rrtik.Problem, *, one_joint: bool, seeds: int, found: dict[str, Any]) -> Searches:
    """Compare the searches in node with those here, which answer every question with no, as the page does."""
    clearances = clearances_between(problem.world, np.stack([problem.start, goal_of(problem)]), None) or Clearances(
        0.0, 0.0
    )
    world = search_form(densely_checked(problem).world, clearances)
    equal, rounded, other = 0, 0, 0
    solve = _one_joint(problem, world) if one_joint else _connect(problem, world)
    for seed, path in zip(range(1, seeds + 1), found["paths"], strict=True):
        wanted = solve(seed)
        if path is None or wanted is None:
            equal, other = equal + (path is wanted), other + (path is not wanted)
        elif np.shape(path) != wanted.shape or np.abs(np.array(path) - wanted).max() > ROUNDING:
            other += 1
        else:
            same = bool((np.array(path) == wanted).all())
            equal, rounded = equal + same, rounded + (not same)
    return Searches(seeds, equal, rounded, other, float(np.median(found["milliseconds"])))


def _refused(A: Matrix, B: Matrix) -> Mask:
    return np.zeros(len(A), dtype=bool)


def _connect(problem: rrtik.Problem, world: rrtik.World) -> Callable[[int], Matrix | None]:
    assert world.motions is not None
    search = ConnectSearch(world.motions, *problem.robot.finite_range(), vertices=VERTICES, patience=0)
    ends = problem.start[None], goal_of(problem)[None]
    return lambda seed: search.solve(*ends, seed, ask=_refused, max_iterations=SAMPLES)


def _one_joint(problem: rrtik.Problem, world: rrtik.World) -> Callable[[int], Matrix | None]:
    refusing: Any = SimpleNamespace(motions=world.motions, robot=problem.robot, motion_valid_batch=_refused)
    same, none = np.ones(problem.robot.dof), np.zeros(problem.robot.dof)
    rules = CrdtRules(*problem.robot.finite_range(), same, none, same)

    def solve(seed: int) -> Matrix | None:
        search = CrdtSearch(refusing, rules, seed, SAMPLES, problem.start[None], goal_of(problem)[None])
        if not search.advance(lambda: False):
            return None
        one, two = search.meeting()
        return np.vstack([one, two[-2::-1]])

    return solve


@dataclass(frozen=True)
class Answers:
    """How many configurations and motions were asked about, how many answers differ, and of these say "free"."""

    configurations: int
    motions: int
    free: int
    differ: int
    rash: int


def answers_of(robot: rrtik.Robot, configurations: int, rng: np.random.Generator) -> Answers:
    """Ask node and this process alike: one obstacle of each kind that can be dragged, moved and made another size."""
    reach = float(np.linalg.norm(robot.fk(np.zeros(robot.dof)).translation)) + 0.3
    start, far = _free(robot, rng), rrtik.pose([0.0, 0.0, -50.0])
    shapes = {"box": [0.2] * 3, "sphere": [0.1], "cylinder": [0.1, 0.3], "capsule": [0.05, 0.3]}
    scene = rrtik.Scene(tuple(rrtik.Obstacle(name, _shape(name, sizes), far) for name, sizes in shapes.items()))
    problem = rrtik.Problem(rrtik.World(robot, scene), start, start)
    plan = page_planner(problem, start, SIDE)
    assert plan is not None
    clearances = clearances_between(problem.world, np.stack([start, start]), None) or Clearances(0.0, 0.0)
    each = configurations // (POSES * len(shapes))
    moves, wanted, wanted_motions = [], [], []
    for _, (k, (name, sizes)) in _rounds(shapes):
        placed = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(0.0, 0.4 * reach, 3))
        larger = (np.array(sizes) * rng.uniform(0.5, 2.0, len(sizes))).tolist()
        obstacle = rrtik.Obstacle(name, _shape(name, larger), placed)
        scene = rrtik.Scene(tuple(obstacle if one.name == name else one for one in scene.obstacles))
        world = search_form(densely_checked(problem.with_world(rrtik.World(robot, scene))).world, clearances)
        Q = rng.uniform(*robot.finite_range(), (each, robot.dof))
        A = Q[: each // SHARE_MOTIONS]
        B = np.clip(A + rng.normal(0.0, 0.2, A.shape), *robot.finite_range())
        values, steps = robot.joint_values, step_counts(A, B, world.weights, world.motion_resolution)
        fast = world.fast  # None where what never moves collides with the obstacle: no answer is "free"
        wanted.append(np.zeros(len(Q), bool) if fast is None else fast.classify(values(Q)) == FREE)
        some = np.zeros(len(A), bool) if fast is None else fast.classify_edges(values(A), values(B), steps) == FREE
        wanted_motions.append(some)
        pairs = np.stack([A, B], axis=1).tolist()
        moves.append({"obstacle": k, "pose": placed.homogeneous.ravel().tolist(), "sizes": larger, "Q": Q.tolist()})
        moves[-1]["motions"] = pairs
    found = in_node(plan, moves=moves)
    got, got_motions = ("".join(found[key]) for key in ("free", "motions"))
    free, motions = np.concatenate(wanted), np.concatenate(wanted_motions)
    said = np.array(list(got + got_motions)) == "1"
    wrong = said != np.concatenate([free, motions])
    return Answers(len(free), len(motions), int(free.sum()), int(wrong.sum()), int((wrong & said).sum()))


def _rounds(shapes: dict[str, list[float]]) -> Iterator[tuple[int, tuple[int, tuple[str, list[float]]]]]:
    for pose in range(POSES):
        for item in enumerate(shapes.items()):
            yield pose, item


def _shape(name: str, sizes: list[float]) -> Any:
    kind = {"box": rrtik.Box, "sphere": rrtik.Sphere, "cylinder": rrtik.Cylinder, "capsule": rrtik.Capsule}[name]
    return kind(sizes) if name == "box" else kind(*sizes)


def _free(robot: rrtik.Robot, rng: np.random.Generator) -> Vector:
    world = rrtik.World(robot)
    for _ in range(10_000):
        q = rng.uniform(*robot.finite_range())
        if world.valid(q):
            return q
    raise SystemExit(f"{robot.name}: no free configuration found")

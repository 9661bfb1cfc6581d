"""What the speed rows work on: problems, and configurations near obstacles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from ompl import geometric as og

from bench.shared.motion_bench_maker import problem_of, scene_files
from rrtik_ompl import Obstacle, Problem, Scene, World, list_problems, load_problem, load_robot
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.copies import changed
from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.ompl_bridge.attempt import attempt

BISECTIONS = 12
NEAR = 0.1  # [rad] from contact
REACHES = {"panda": 0.8, "ur5": 0.8, "kinova": 0.8, "titan4": 1.7}  # [m], of arms among boxes
BOXES = 30
SHIPPED = "titan4"
MOTIONS, ATTEMPTS = 300, 20


@dataclass(frozen=True)
class Options:
    """What the person asked for.

    Attributes:
        folder: Holds the unpacked MotionBenchMaker sets, or None.
        problems: At most so many problems of each of its families.
        peer_problems: As many to see what OMPL costs.
        seed: Of everything that is drawn by lot.
        quick: Whether a fraction of the work is enough.
        limit: Time limit of one solve [s].
    """

    folder: Path | None
    problems: int
    peer_problems: int
    seed: int
    quick: bool
    limit: float = 1.0


def clutter(count: int, reach: float, rng: np.random.Generator) -> Scene:
    """Boxes around the arm; none stands so near to the first axis that the arm could not but touch it."""
    azimuth = rng.uniform(-np.pi, np.pi, count)
    radius, height = reach * rng.uniform(0.45, 1.0, count), reach * rng.uniform(-0.2, 0.7, count)
    centres = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height])
    boxes = (Box(rng.uniform(0.05, 0.15, 3) * reach) for _ in range(count))
    poses = (pin.SE3(np.eye(3), centre) for centre in centres)
    parts = enumerate(zip(boxes, poses, strict=True))
    return Scene(tuple(Obstacle(f"box{k}", box, pose) for k, (box, pose) in parts))


def panda_files(options: Options, count: int) -> list[Path]:
    """Scene files of the Panda's set, the first ``count`` of each family; none without a folder."""
    return [] if options.folder is None else [Path(file) for file in scene_files(options.folder, "panda", count)]


def family(file: Path) -> str:
    """Name of the family of a scene file, such as ``cage``."""
    return file.parent.name.removesuffix("_panda")


def exact_problem(file: Path) -> Problem:
    """A problem of the set on the meshes of the arm."""
    problem = problem_of(str(file), balls=False)
    assert problem is not None
    return problem


def sphere_problem(file: Path) -> Problem | None:
    """A problem with the 59 spheres and obstacles that VAMP uses; None if an end is in collision, as one of 700 is."""
    return problem_of(str(file), balls=True)


def shipped_problems() -> list[Problem]:
    """All shipped problems of TITAN-4."""
    shipped = [load_problem(name) for name in list_problems() if name.startswith(SHIPPED)]
    return [problem for problem in shipped if not problem.constraints]  # which one planner alone keeps


def arms_among_boxes(options: Options) -> Iterator[tuple[str, World]]:
    """Worlds of several arms among random boxes."""
    for name, reach in list(REACHES.items())[: 1 if options.quick else None]:
        rng = np.random.default_rng(options.seed)
        yield f"{name}, {BOXES} boxes", World(load_robot(name), clutter(BOXES, reach, rng))


def uniform(world: World, count: int, rng: np.random.Generator) -> Matrix:
    """Random configurations inside the limits, shape (count, dof)."""
    lower, upper = world.robot.finite_range()
    return np.asarray(rng.uniform(lower, upper, (count, world.robot.dof)))


def without_itself(world: World) -> World:
    """The same world, the arm not checked against itself."""
    return World(replace(world.robot, self_collision=False), world.scene)


def near_contact(world: World, exact: World, count: int, rng: np.random.Generator) -> Matrix:
    """Configurations within ``NEAR``, in every joint, of what is contact to ``exact``, shape (count, dof).

    Between a free and a colliding random configuration the contact is found by bisection; a contact at which the world
    itself is not free otherwise is not used if there are others.
    """
    Q = uniform(exact, 4 * count, rng)
    free = exact.valid_batch(Q)
    pairs = min(int(free.sum()), int((~free).sum()))
    clear, touching = Q[free][:pairs], Q[~free][:pairs]
    for _ in range(BISECTIONS if pairs else 0):
        middle = 0.5 * (clear + touching)
        valid = exact.valid_batch(middle)[:, None]
        clear, touching = np.where(valid, middle, clear), np.where(valid, touching, middle)
    usable = world.valid_batch(clear)
    clear = clear[usable] if usable.any() else Q
    rows = np.resize(clear, (count, world.robot.dof))
    return np.asarray(world.robot.clamp(rows + rng.uniform(-NEAR, NEAR, rows.shape)))


def asked_configurations(problem: Problem, count: int, rng: np.random.Generator) -> Matrix:
    """Configurations on the motions that OMPL's RRT-Connect asks about, shape (count, dof).

    It is started again with other random numbers until it has asked about ``MOTIONS``.
    """
    listener = _Listener(problem.world)
    listened = changed(problem, world=listener)
    goals = goal_configurations(problem, np.random.default_rng(0)).rows
    for seed in range(ATTEMPTS):
        attempt(listened, og.RRTConnect, goals, Budget(seed, seconds=1.0), parameters={"range": 1.0})
        if len(listener.motions) >= MOTIONS:
            break
    A, B = np.array(listener.motions).transpose(1, 0, 2)
    lengths = np.linalg.norm(B - A, axis=1)
    chosen = rng.choice(len(A), count, p=lengths / lengths.sum())
    return np.asarray(A[chosen] + rng.uniform(0.0, 1.0, (count, 1)) * (B - A)[chosen])


class _Listener:
    """Answers as a world does and keeps the motions that it is asked about."""

    def __init__(self, world: World) -> None:
        self.robot, self.valid, self._world = world.robot, world.valid, world
        self.motions: list[tuple[Vector, Vector]] = []

    def motion_valid(self, a: Vector, b: Vector) -> bool:
        self.motions.append((a, b))
        return self._world.motion_valid(a, b)

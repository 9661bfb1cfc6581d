"""How good the balls of every robot are: their number, how far they reach, what they cost and what they leave open.

    python bench/speed/cover_quality.py [ROBOT ...] [--mbm FOLDER] [--out bench/reports/cover_quality.md]

A configuration is undecided if the balls prove it neither free nor colliding; an exact check then decides. Scenes are
random boxes and cylinders within the arm's reach. "Near" are configurations on straight segments between random
collision-free configurations at which the arm meets an obstacle grown by 0.1 m on all sides. "Cost" is the time of the
kernels per configuration on segments that are free. ``--mbm`` adds the Panda problems of MotionBenchMaker (the unpacked
set: ``panda.urdf``, ``problems/``), exact solids, with segments between start, goal and random free configurations.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from bench.shared.pages import add_out
from bench.shared.problems import goal_joints
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report
from rrtik_ompl import Obstacle, Scene, World, load_robot
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.covers.spheres import inner_spheres, outer_cover, protrusion_bound
from rrtik_ompl.kernels import FREE, UNDECIDED, FastWorld, needs_covers
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.shapes import Box, Cylinder
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

ROBOTS = ("titan4", "panda", "ur5", "puma560", "kinova", "so101", "so100", "xarm7", "z1", "baxter_left", "ur3")
NEAR = 0.1  # [m]
SCENES, OBSTACLES, SEGMENTS, PER_SEGMENT = 4, 8, 150, 24
SHORTEST, LONGEST = 0.3, 2.0  # [rad] of a segment, longest joint
HEADS = (
    *("robot", "outer balls", "inner balls", "worst protrusion mm", "first time s", "undecided uniform %", "near %"),
    *("of which free %", "ns free", "ns near"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Balls:
    """The balls of a robot's bodies or of a scene's, by geometry, and the seconds that they took."""

    outer: dict[int, np.ndarray]
    inner: dict[int, np.ndarray]
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class Shares:
    """Counts and times of one scene."""

    uniform: int
    uniform_undecided: int
    near: int
    near_undecided: int
    near_undecided_free: int
    free_ns: float
    near_ns: float


def balls_of(bodies: Iterable[Body]) -> Balls:
    """Covers of the bodies that need them, made anew."""
    outer, inner = {}, {}
    begin = time.process_time()
    for body in bodies:
        needed = needs_covers(body)
        key = id(body.geometry)
        if needed[0] and key not in outer:
            outer[key] = outer_cover(body.geometry)
        if needed[1] and key not in inner:
            inner[key] = inner_spheres(body.geometry)
    return Balls(outer, inner, time.process_time() - begin)


def fast_world(world: World, known: Balls, *, pairs: Iterable[tuple[int, int]] | None = None) -> FastWorld:
    rest = balls_of(b for b in world.bodies if id(b.geometry) not in known.outer)
    none = np.empty((0, 4))
    outer = [{**known.outer, **rest.outer}.get(id(b.geometry), none) for b in world.bodies]
    inner = [{**known.inner, **rest.inner}.get(id(b.geometry), none) for b in world.bodies]
    chosen = list(world.pairs if pairs is None else pairs)
    return FastWorld(world.robot.chain, world.bodies, chosen, outer=outer, inner=inner)


def clutter(reach: float, rng: np.random.Generator, grow: float = 0.0) -> Scene:
    """Boxes and cylinders around the arm, the same for the same generator state, ``grow`` larger on all sides."""
    found = []
    for k in range(OBSTACLES):
        turn, radius, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.4, 1.0), rng.uniform(-0.1, 0.8)
        centre = reach * np.array([radius * np.cos(turn), radius * np.sin(turn), height])
        sizes = rng.uniform(0.08, 0.4, 3) * reach
        pose = pin.SE3(pin.Quaternion(*rng.normal(size=4)).normalized().matrix(), centre)
        box = Box(sizes + 2 * grow) if k % 2 else Cylinder(0.5 * sizes[0] + grow, sizes[1] + 2 * grow)
        found.append(Obstacle(f"solid{k}", box, pose))
    return Scene(tuple(found))


def grown(scene: Scene, by: float) -> Scene:
    """Boxes, balls and cylinders of a scene made larger; what else there is stays."""
    found = []
    for item in scene.obstacles:
        shape = item.shape
        if isinstance(shape, Box):
            shape = Box(np.asarray(shape.size) + 2 * by)
        elif isinstance(shape, Cylinder):
            shape = Cylinder(shape.radius + by, shape.length + 2 * by)
        found.append(Obstacle(item.name, shape, item.pose))
    return Scene(tuple(found))


def reach_of(robot: Robot) -> float:
    """Farthest point of the arm from its base [m], roughly: the farthest joint that 200 configurations show."""
    frames = robot.joint_frames(uniform(robot, 200, np.random.default_rng(0)))
    return float(np.linalg.norm(frames[:, 1:, :3, 3] - frames[:, 1:2, :3, 3], axis=2).max()) + 0.05


def uniform(robot: Robot, count: int, rng: np.random.Generator) -> np.ndarray:
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return rng.uniform(low, high, (count, robot.dof))


def values(robot: Robot, Q: np.ndarray) -> np.ndarray:
    return Q @ robot.chain.gain.T + robot.chain.offset


def segments(world: World, ends: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Straight pieces between free configurations: starts and ends, shape (SEGMENTS, dof)."""
    first, second = (ends[rng.integers(len(ends), size=SEGMENTS)] for _ in range(2))
    length = np.maximum(np.abs(second - first).max(axis=1), 1e-9)
    share = np.minimum(rng.uniform(SHORTEST, LONGEST, SEGMENTS) / length, 1.0)
    return first, first + share[:, None] * (second - first)


def measured(world: World, known: Balls, wide: Scene, rng: np.random.Generator, ends: np.ndarray | None) -> Shares:
    robot, fast = world.robot, fast_world(world, known)
    Q = uniform(robot, 3000, rng)
    judged = fast.classify(values(robot, Q))
    free = Q[judged == FREE]
    free = free if ends is None else np.concatenate([free[: 2 * len(ends)], *[ends] * 3])
    A, B = segments(world, free, rng)
    shares = np.linspace(0.0, 1.0, PER_SEGMENT)[:, None, None]
    on_segments = ((1.0 - shares) * A + shares * B).reshape(-1, robot.dof)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        larger = World(robot, wide)
    meeting = [p for p in larger.pairs if any(larger.bodies[k].kind == "obstacle" for k in p)]
    near = on_segments[fast_world(larger, known, pairs=meeting).classify(values(robot, on_segments)) != FREE]
    found = fast.classify(values(robot, near)) if len(near) else np.empty(0)
    open_rows = near[found == UNDECIDED]
    some = open_rows[rng.permutation(len(open_rows))[:300]]
    open_free = round(world.valid_batch(some).mean() * len(open_rows)) if len(some) else 0
    return Shares(
        len(Q), int((judged == UNDECIDED).sum()), len(near), len(open_rows), open_free, *times(fast, robot, A, B, near)
    )


def times(fast: FastWorld, robot: Robot, A: np.ndarray, B: np.ndarray, near: np.ndarray) -> tuple[float, float]:
    """Nanoseconds per configuration on free segments, and of configurations near obstacles."""
    starts, ends = values(robot, A), values(robot, B)
    steps = np.full(len(A), 127)
    free = fast.classify_edges(starts, ends, steps) == FREE
    rows = values(robot, near)
    on_edges, alone = [], []
    for _ in range(7):
        begin = time.process_time()
        fast.classify_edges(starts[free], ends[free], steps[free])
        on_edges.append(time.process_time() - begin)
        begin = time.process_time()
        fast.classify(rows)
        alone.append(time.process_time() - begin)
    return 1e9 * min(on_edges) / max(128 * int(free.sum()), 1), 1e9 * min(alone) / max(len(rows), 1)


def row(name: str, robot: Robot, known: Balls, found: list[Shares]) -> list[str]:
    covered = [b.geometry for b in World(robot).bodies if id(b.geometry) in known.outer]
    worst = max(protrusion_bound(geometry, known.outer[id(geometry)]) for geometry in covered)
    counts = [sum(len(c) for c in balls.values()) for balls in (known.outer, known.inner)]
    total = {k: sum(getattr(s, k) for s in found) for k in Shares.__dataclass_fields__}
    uniform_share = 100 * total["uniform_undecided"] / total["uniform"]
    near_share = 100 * total["near_undecided"] / max(total["near"], 1)
    free_share = 100 * total["near_undecided_free"] / max(total["near"], 1)
    times_ns = [np.median([s.free_ns for s in found]), np.median([s.near_ns for s in found])]
    figures = (1e3 * worst, known.seconds, uniform_share, near_share, free_share)
    return [name, *map(str, counts), *(f"{value:.1f}" for value in figures), *(f"{value:.0f}" for value in times_ns)]


def random_scenes(name: str) -> list[str]:
    robot = load_robot(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        known = balls_of(World(robot).bodies)
    found: list[Shares] = []
    reach, seed = reach_of(robot), 0
    while len(found) < SCENES and seed < 40:
        seed += 1
        scene = clutter(reach, np.random.default_rng(seed))
        world = World(robot, scene)
        if world.valid_batch(uniform(robot, 200, np.random.default_rng(seed))).mean() > 0.15:
            found.append(measured(world, known, grown(scene, NEAR), np.random.default_rng(seed), None))
    return row(name, robot, known, found)


def benchmark_problems(folder: Path, each: int) -> list[str]:
    found: list[Shares] = []
    known: Balls | None = None
    robot: Robot | None = None
    for family in sorted((folder / "problems").iterdir()):
        for file in sorted(family.glob("scene*.yaml"))[:each]:
            try:
                problem = load_motion_bench_maker(file, robot=robot or folder / "panda.urdf")
            except Exception as error:
                print(file.name, error)
                continue
            world, robot = problem.world, problem.world.robot
            known = known or balls_of(World(robot).bodies)
            ends = np.stack([problem.start, goal_joints(problem)])
            wide = grown(world.scene, NEAR)
            found.append(measured(world, known, wide, np.random.default_rng(0), ends))
    assert robot is not None
    assert known is not None
    return row("panda, MotionBenchMaker", robot, known, found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="*", default=ROBOTS)
    parser.add_argument("--mbm", type=Path, help="the unpacked set of MotionBenchMaker's Panda problems")
    parser.add_argument("--each", type=int, default=3, help="problems of every family")
    add_out(parser, "cover_quality.md")
    options = parser.parse_args()
    rows = []
    for name in options.robots:
        rows.append(random_scenes(name))
        print(*rows[-1], sep=" | ", flush=True)
    if options.mbm is not None:
        rows.append(benchmark_problems(options.mbm, options.each))
    report = Report(
        "Balls around and inside the links",
        "python bench/speed/cover_quality.py",
        intro=f"{SCENES} random scenes of {OBSTACLES} solids for each robot. "
        f"{versions('pin', 'coal', 'numpy', 'numba')}. Process CPU time. "
        "The documentation of the script says what the columns mean.",
    )
    report.table("", HEADS, rows)
    report.finish(options.out)


if __name__ == "__main__":
    main()

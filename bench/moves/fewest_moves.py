"""The fewest-moves planner against proven optima, and the double axis cut beside it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Annotated

import numpy as np
import pinocchio as pin
from typer import Option

import rrtik_ompl as rrtik
from bench.moves.oracles import grid_route, least_moves
from bench.shared.problems import goal_joints
from bench.shared.run import Run
from rrtik_bench.crdt.runs import histogram, joints_of, share, sound
from rrtik_bench.report.page import Report
from rrtik_ompl.model.transitions import lower_bound, transitions
from rrtik_ompl.world.problem import Problem
from rrtik_planners import FewestMoves

WITH_ROOM = "planar3_a, 10 mm out"
LIMITS = {"titan4_sdu": 2.0}  # [s] for a run
LIMIT = 5.0  # [s] for a run of the other problems, as plan() has it
GRIDS = {"env_e": 0.25, **{name: float(np.radians(6.0)) for name in ("planar3_a", WITH_ROOM, "planar3_b", "planar3_c")}}
NAMES = ("titan4_sdu", "titan4_prisms", "planar3_a", WITH_ROOM, "planar3_b", "planar3_c", "env_e")
WANTED = {"titan4_sdu": (6, 0.99), "planar3_b": (4, 0.95)}
PUBLISHED = {"titan4_sdu": "7", "titan4_prisms": "3 (share not given)"}
CASE_A = (
    "As shipped, the case has no route of 3 moves, and this is proven here: such a route moves joint 2 or joint 3 "
    "aside, joint 1 across, and the same joint back, so it has one free value. Its whole range is covered by "
    "intervals, for each of which a collision is found that is deeper than any value in the interval can avoid. The "
    "5-degree grid search that proposed 3 stepped over the squares' corners, which the folded arm cuts 6 mm deep. "
    "With both squares 10 mm farther out the optimum of 3 is real."
)
BOUND = (
    "c is the number of joints that differ. All routes of c moves pass the corners of the box between start and goal, "
    "and all of those are looked at; if none is free, the bound is c + 1, or 3 for c = 1, because a joint alone cannot "
    "go round anything. Routes of that many moves have one free value; where it can be refuted for its whole range, "
    "the bound rises by one more. A bound that is met proves the optimum. The grid is the plain oracle: the fewest "
    "moves on a regular grid (6 deg; 0.25 in environment E), with exact checks."
)


@dataclass(frozen=True)
class FewestMovesRun:
    """One plan, and the double axis cut of a BiCRDT path of the same seed."""

    route: np.ndarray | None
    seconds: float
    gap: int
    sound: bool
    cut_moves: int
    cut_length: float
    cut_seconds: float

    @property
    def moves(self) -> int:
        """Transitions; a large number if there is no path."""
        return 99 if self.route is None else transitions(self.route)

    @property
    def travel(self) -> float:
        """Of all joints [rad or m]."""
        return np.inf if self.route is None else float(np.abs(np.diff(self.route, axis=0)).sum())


def one_run(problem: Problem, seed: int) -> FewestMovesRun:
    """Plan twice."""
    plan = rrtik.plan(problem, FewestMoves, seconds=LIMITS.get(problem.name, LIMIT), seed=seed, shorten=False)
    begin = perf_counter()
    raw = rrtik.plan(problem, "bicrdt", seconds=60.0, seed=seed, shorten=False)
    if raw.path is None:
        raise SystemExit(f"{problem.name}, seed {seed}: {raw.reason}")
    cut = rrtik.shorten(raw.path, problem, method="axis")
    cut_seconds = perf_counter() - begin
    route = None if plan.path is None else plan.path.waypoints
    whole = route is not None and sound(problem, route)
    gap = int(plan.statistics.get("gap", 99))
    return FewestMovesRun(route, plan.seconds, gap, whole, cut.transitions, cut.length, cut_seconds)


@dataclass(frozen=True)
class Measured:
    """All runs of one problem, and what is proven about it."""

    name: str
    problem: Problem
    runs: list[FewestMovesRun]
    bound: int
    proof_seconds: float
    grid: str

    @property
    def optimum(self) -> int:
        """The fewest moves found."""
        return min(run.moves for run in self.runs)

    def at(self, moves: int) -> float:
        """Share of runs with at most so many moves that also ended within their time by the clock."""
        return share(self.runs, lambda run: run.moves <= moves and run.seconds <= self.limit)

    @property
    def limit(self) -> float:
        """Time of a run [s]."""
        return LIMITS.get(self.name, LIMIT)

    @property
    def late(self) -> str:
        """The runs that took longer than their time."""
        late = [f"seed {seed}: {run.seconds:.2f} s" for seed, run in enumerate(self.runs) if run.seconds > self.limit]
        return ", ".join(late) or "none"


def case_a_with_room(problem: Problem, outwards: float = 0.01) -> Problem:
    """Case A with its squares moved away from axis 1 (see CASE_A)."""
    world = problem.world
    moved = []
    for square in world.scene.obstacles:
        shift = outwards * np.sign(square.pose.translation)
        moved.append(replace(square, pose=pin.SE3(square.pose.rotation, square.pose.translation + shift)))
    roomy = world.with_scene(replace(world.scene, obstacles=tuple(moved)))
    return rrtik.Problem(roomy, problem.start, problem.goal, name=WITH_ROOM)


def measured(name: str, count: int) -> Measured:
    """Plan one problem so often; the bound is found apart from the planner."""
    problem = case_a_with_room(rrtik.load_problem("planar3_a")) if name == WITH_ROOM else rrtik.load_problem(name)
    begin = perf_counter()
    bound = least_moves(problem)
    seconds = perf_counter() - begin
    grid = "too many joints"
    if name in GRIDS:
        route = grid_route(problem, GRIDS[name])
        grid = "none" if route is None else str(transitions(route))
    return Measured(name, problem, [one_run(problem, seed) for seed in range(count)], bound, seconds, grid)


def bars(report: Report, results: dict[str, Measured]) -> None:
    """What is wanted: sound routes, and how often they have the fewest moves."""
    runs = [run for m in results.values() for run in m.runs]
    whole = share(runs, lambda run: run.sound)
    text = f"{100 * whole:.1f} % of {len(runs)} paths"
    report.bar("one joint per edge, valid at half resolution, ends exact", "100 %", text, whole == 1.0)
    for name, m in results.items():
        goal, least = WANTED.get(name, (m.bound, 1.0))
        wanted = f"{goal} moves in >= {100 * least:.0f} %"
        got = f"{100 * m.at(goal):.0f} % (bound {m.bound})"
        report.bar(f"{name}: moves within {LIMITS.get(name, LIMIT):g} s", wanted, got, m.at(goal) >= least)
    for name, m in results.items():
        report.bar(
            f"{name}: bound met, so the optimum is proven", "gap 0", f"gap {m.optimum - m.bound}", m.optimum == m.bound
        )
    sdu = results["titan4_sdu"]
    unused = share(sdu.runs, lambda run: run.route is not None and 6 not in joints_of(run.route))
    report.bar("titan4_sdu: theta6 unused", "always", f"{100 * unused:.0f} %", unused == 1.0)
    late = ". ".join(f"{name}: {m.late}" for name, m in results.items() if m.late != "none") or "none"
    report.note("Runs that took longer than their time (they count as missed)", late)


def tables(report: Report, results: dict[str, Measured]) -> None:
    """What was found, and what is proven."""
    rows, proofs = [], []
    for name, m in results.items():
        seconds = np.array([run.seconds for run in m.runs])
        families = Counter("-".join(map(str, joints_of(run.route))) for run in m.runs if run.route is not None)
        cut = np.array([(run.cut_moves, run.cut_length, run.cut_seconds) for run in m.runs])
        rows.append(
            [
                name,
                str(len(m.runs)),
                histogram([run.moves for run in m.runs]),
                histogram([run.gap for run in m.runs]),
                f"{np.mean([run.travel for run in m.runs]):.2f} (least {min(run.travel for run in m.runs):.2f})",
                f"{np.median(seconds):.2f} / {seconds.max():.2f}",
                histogram(cut[:, 0].astype(int).tolist()),
                PUBLISHED.get(name, ""),
                f"{cut[:, 1].mean():.2f}",
                f"{np.median(cut[:, 2]):.2f}",
                ", ".join(f"{joints}: {times}" for joints, times in families.most_common(3)),
            ]
        )
        c = lower_bound(m.problem.start, goal_joints(m.problem))
        proofs.append([name, str(c), str(m.bound), f"{m.proof_seconds:.2f}", m.grid, str(m.optimum)])
    head = ["problem", "runs", "moves", "gap to the bound as reported", "travel [rad or m]", "time, median / most [s]"]
    head += ["double axis cut: moves", "published", "its travel", "its time [s]", "joints in order (most frequent)"]
    report.table("Fewest-moves planner, the double axis cut of a BiCRDT path beside it", head, rows)
    head = ["problem", "c", "proven bound", "time of the proof [s]", "grid oracle", "best found"]
    report.table("Lower bounds", head, proofs)
    report.note("How the bounds are proven", BOUND)


def main(run: Run, *, runs: Annotated[int, Option(help="Of each problem.")] = 100) -> Report:
    """Measure."""
    report = run.report("Fewest moves, measured")
    rrtik.plan(rrtik.load_problem("titan4_sdu"), FewestMoves, seed=0, shorten=False)  # compiles, if need be
    results = {name: measured(name, runs) for name in NAMES}
    bars(report, results)
    tables(report, results)
    report.note("Case A", CASE_A)
    return report

"""Fewest moves beside an exact search in the plane: arms of 2 and 3 links among discs and rectangles."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from time import process_time
from unittest.mock import patch

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import rrtik_ompl as rrtik
from bench.shared.parts import Parts
from bench.shared.problems import goal_joints
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_bench.shortening.plane_arms import PlaneArm, PlaneGrid
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.model.transitions import lower_bound, single_joint, transitions
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_planners import FewestMoves
from rrtik_robots.planar import planar

VALUES = {2: 521, 3: 65}  # of a joint on the oracle's grid
RADIUS = 1e-4  # of the links [m]
ROOM = 0.01  # of start and goal [m]
LIMIT = 30.0  # [s] of the processor for a plan
STARTS = 8  # tried among the same obstacles
ONE_JOINT = 0.25  # share of the cases whose goal differs in one joint from the start
NONE = 99  # moves, where there is no path
HOW = (
    "Each case is an arm of 2 or 3 links among 3 to 6 discs and rectangles, drawn at random. The oracle is a grid of "
    f"{VALUES[2]} values a joint for 2 joints and {VALUES[3]} for 3, the values of start and goal among them. Along "
    "each line of the grid the angles at which something begins or ceases to collide are the roots of quadratic "
    "equations, so its motions are exact, without steps. The goal is drawn from what the grid reaches, each number of "
    "moves as likely as any other; a quarter of the goals differ from the start in one joint. Start and goal keep "
    "10 mm. The paths of the planner are judged by the same geometry. The oracle is exact for paths that keep to the "
    "values of its grid; a path with fewer moves, free by the same geometry, shows that the fewest need others. So the "
    "oracle is asked again with the values of the planner's path added to its grid (refined): it then knows the paths "
    "of both, and its count is what the planner has to have."
)


@dataclass(frozen=True)
class Case:
    """An arm among obstacles, the problem of it, the values of the oracle's grid, and how many moves it needs."""

    arm: PlaneArm
    problem: Problem
    values: list[NDArray[np.float64]]
    moves: int

    def refined(self, route: NDArray[np.float64]) -> int:
        """How many moves the oracle needs with the values of a route, shape (k, n), on its grid too."""
        values = [np.union1d(own, more) for own, more in zip(self.values, route.T, strict=True)]
        grid = PlaneGrid(self.arm, values)
        return int(grid.moves_from(self.problem.start)[grid.index(goal_joints(self.problem))])


@dataclass(frozen=True)
class Outcome:
    """A plan of a case, and what the exact geometry says of it."""

    case: int
    links: int
    differing: int
    oracle: int
    refined: int
    moves: int
    bound: int
    free: bool
    seconds: float

    @property
    def line(self) -> list[str]:
        """A row of a table."""
        path = "none" if self.moves == NONE else str(self.moves)
        seconds = f"{self.seconds:.2f}"
        return [
            str(x)
            for x in (self.case, self.links, self.differing, self.oracle, self.refined, path, self.bound, seconds)
        ]


def drawn_arm(rng: np.random.Generator, links: int) -> PlaneArm:
    """An arm of about 2 m among obstacles that leave its base free."""
    lengths = rng.uniform(0.5, 1.0, links) * 2.0 / links
    solids = rng.integers(3, 7)
    boxes = int(rng.integers(0, solids + 1))
    discs, polygons = [], []
    for k in range(solids):
        away, turn = rng.uniform(0.45, 1.1) * lengths.sum(), rng.uniform(-np.pi, np.pi)
        centre = away * np.array([np.cos(turn), np.sin(turn)])
        size = rng.uniform(0.05, 0.3, 2)
        if k >= boxes:
            discs.append([*centre, size[0]])
        else:
            corners = 0.5 * size * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
            angle = rng.uniform(-np.pi, np.pi)
            spin = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            polygons.append(centre + corners @ spin.T)
    return PlaneArm(lengths, RADIUS, np.array(discs).reshape(-1, 3), np.array(polygons).reshape(-1, 4, 2))


def world_of(arm: PlaneArm) -> World:
    """The same arm and obstacles as a world of solids."""
    solids = [
        Obstacle(f"disc{k}", Sphere(float(r)), pin.SE3(np.eye(3), np.array([x, y, 0.0])))
        for k, (x, y, r) in enumerate(arm.discs)
    ]
    for k, corners in enumerate(arm.polygons):
        along, up = corners[0] - corners[1], corners[0] - corners[3]
        size = np.array([np.linalg.norm(along), np.linalg.norm(up), 1.0])
        turned = pin.utils.rotate("z", float(np.arctan2(along[1], along[0])))
        solids.append(Obstacle(f"box{k}", Box(size), pin.SE3(turned, np.array([*corners.mean(axis=0), 0.0]))))
    return World(planar(lengths=arm.lengths.tolist()), Scene(tuple(solids)))


def drawn_case(number: int) -> Case:
    """Case of a number; the same number gives the same case."""
    rng = np.random.default_rng([7, number])
    links = 2 + number % 2
    values = [np.linspace(-np.pi, np.pi, VALUES[links] + 2)[1:-1]] * links
    while True:
        arm = drawn_arm(rng, links)
        grid = PlaneGrid(arm, values)
        roomy = grid.room >= ROOM
        for place in rng.permutation(np.argwhere(roomy))[:STARTS]:
            start = np.array([v[k] for v, k in zip(values, place, strict=True)])
            moves = grid.moves_from(start)
            wanted = (moves > 0) & roomy
            if rng.random() < ONE_JOINT:
                wanted &= sum(np.indices(moves.shape)[j] != k for j, k in enumerate(place)) == 1
            levels = np.unique(moves[wanted])
            if len(levels) > 0 and levels[-1] > links:
                most = int(rng.choice(levels))
                spots = np.argwhere(wanted & (moves == most))
                goal = np.array([v[k] for v, k in zip(values, spots[rng.integers(len(spots))], strict=True)])
                return Case(arm, Problem(world_of(arm), start, goal), values, most)


def outcome(number: int) -> Outcome:
    """Plan one case."""
    case = drawn_case(number)
    goal = goal_joints(case.problem)
    begin = process_time()
    with patch("time.perf_counter", process_time):  # so that a busy machine does not decide
        plan = rrtik.plan(case.problem, FewestMoves, seconds=LIMIT, seed=number, shorten=False)
    seconds = process_time() - begin
    route = None if plan.path is None else plan.path.waypoints
    return Outcome(
        case=number,
        links=len(goal),
        differing=lower_bound(case.problem.start, goal),
        oracle=case.moves,
        refined=case.moves if route is None else case.refined(route),
        moves=NONE if route is None else transitions(route),
        bound=int(plan.statistics.get("lower_bound", 0)),
        free=route is None or (single_joint(route) and case.arm.free(route)),
        seconds=seconds,
    )


def fill(report: Report, found: list[Outcome]) -> None:
    """What was found."""
    worse = [one for one in found if one.moves > min(one.oracle, one.refined)]
    equal = 1.0 - sum(one.moves > one.oracle for one in found) / len(found)
    text = f"{100 * equal:.1f} % of {len(found)}"
    report.bar("no more moves than the oracle", ">= 99 %", text, equal >= 0.99)
    same = sum(one.moves == one.refined for one in found) / len(found)
    text = f"{100 * same:.1f} % of {len(found)}"
    report.bar("as many moves as the refined oracle", ">= 99 %", text, same >= 0.99)
    high = [one for one in found if one.bound > one.refined]
    report.bar("lower bounds above the refined oracle's moves", "0", str(len(high)), not high)
    hit = [one for one in found if not one.free]
    report.bar("paths that collide by exact geometry", "0", str(len(hit)), not hit)
    rows = []
    for links in (2, 3):
        own = [one for one in found if one.links == links]
        more = Counter(one.moves - one.oracle for one in own)
        gaps = Counter(one.moves - one.bound for one in own if one.moves != NONE)
        seconds = np.array([one.seconds for one in own])
        rows.append(
            [
                str(links),
                str(len(own)),
                str(more[0]),
                str(sum(count for extra, count in more.items() if extra < 0)),
                str(sum(count for extra, count in more.items() if extra > 0)),
                ", ".join(f"{gap}: {count}" for gap, count in sorted(gaps.items())),
                f"{np.median(seconds):.2f} / {seconds.max():.2f}",
            ]
        )
    head = [
        "links",
        "cases",
        "as many moves",
        "fewer",
        "more or none",
        "gap to the bound: cases",
        "processor time, median / most [s]",
    ]
    report.table("Moves of the planner beside those of the oracle", head, rows)
    head = ["case", "links", "joints that differ", "oracle", "refined", "planner", "bound", "processor time [s]"]
    report.table("Cases in which the planner has more moves", head, [one.line for one in worse])
    report.note("How", HOW)


def main(run: Run, parts: Parts, *, cases: int = 200, first: int = 0) -> Report:
    """Run all cases."""
    found = parts(outcome, [(number,) for number in range(first, first + cases)])
    report = run.report("Fewest moves beside an exact oracle")
    fill(report, found)
    return report

"""The loop around DRRT-Con [1, ch. 5.2, figure 5.12]: planner, generator of motions, local reshaper.

[1] draws the loop and says what each part is for, without an algorithm: the reshaper scales the time of the motion or
edits the path a little, and where that exceeds its limits the planner is called again. Here time is scaled by the way
that is left to the first hit, and an edit is a bump: points along the path are shifted, the most in the middle of
what is hit, the robot's and the goal's not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rrtik_bench.contact_check import check_contacts
from rrtik_bench.drrt_con import FASTEST, REPAIR_SECONDS
from rrtik_bench.report.rows import Bar, Row, all_of, judged
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.replanning.drrt_con import points_along, without_points_between
from rrtik_ompl.replanning.feed import feed_of
from rrtik_ompl.replanning.loop import Loop
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.world.motion_queries import MotionQueries

SOURCE = "[1, ch. 5.2, figure 5.12]"
BUMPS, SHARES = 16, (0.25, 0.5, 1.0)  # directions that are tried, each by so much of the largest shift
ROOM = 2.0  # a bump begins and ends so many largest shifts before and behind what is hit
LOOP = "limits of the reshaper, scenes and speeds chosen here: [1] draws the loop"


@dataclass(frozen=True, slots=True)
class Reshaper:
    """What may be done to a motion without the planner.

    Attributes:
        brake: Ticks of full steps before a hit within which the motion is slowed, in proportion; 0: never slowed.
        patience: Ticks in a row that it may be slowed.
        shift: How far a point of the path may be moved [unit of the space]; 0: never.
    """

    brake: float = 0.0
    patience: int = 0
    shift: float = 0.0


class ReshapedLoop(Loop):
    """A run in which a reshaper comes before the planner.

    Attributes:
        acts: What has changed the motion in each tick: "", "slowed", "bent" or "planned".
    """

    def __init__(self, scenario: Scenario, settings: ReplanSettings, reshaper: Reshaper) -> None:
        super().__init__(scenario.problem, feed_of(scenario.problem.world.scene), settings, scenario.goal_feed)
        self._reshaper, self._edge = reshaper, settings.edge_length(scenario.problem.robot)
        self._pace, self._slowed = 1.0, 0
        self.acts: list[str] = []

    def tick(self, number: int) -> bool:
        """See :meth:`rrtik_ompl.replanning.loop.Loop.tick`."""
        self.acts.append("")
        return super().tick(number)

    def _check(self) -> bool:
        """Whether to go on along the path: it is free, or hit so far ahead that to slow down is enough for now."""
        free, self._pace = super()._check(), 1.0
        path, most = self._planner.path, self._reshaper.brake * self._settings.step
        if free or path is None or not most:
            self._slowed = self._slowed if not free else 0
            return free
        points, hits = hit_edges(path, 0.5 * self._edge, self._world)
        left = route_length(points[: hits[0] + 1]) if len(hits) else 0.0
        if self._slowed >= self._reshaper.patience or left < self._settings.step:
            return False
        self._pace, self._slowed = min(1.0, left / most), self._slowed + 1
        self.acts[-1] = "slowed"
        return True

    def _repair(self) -> bool:
        """Bend the path; where that is not enough call the planner."""
        path = self._planner.path
        bent = None if path is None or not self._reshaper.shift else self._bent(path)
        if bent is not None:
            self._planner.path, before = bent, path
            if self._planner.check_path(self._world):
                self.acts[-1] = "bent"
                return True
            self._planner.path = before
            self._planner.check_path(self._world)
        self.acts[-1] = "planned"
        return super()._repair()

    def _bent(self, path: Matrix) -> Matrix | None:
        return bent(path, 0.5 * self._edge, self._reshaper.shift, self._world, self._rng)

    def _next_on_path(self) -> tuple[Vector, int]:
        """A step along the path, shorter by the pace."""
        settings, change = self._settings, self._max_change
        self._settings = replace(settings, step=settings.step * self._pace)
        self._max_change = change * self._pace
        place = super()._next_on_path()
        self._settings, self._max_change = settings, change
        return place


def hit_edges(path: Matrix, step: float, motions: MotionQueries) -> tuple[Matrix, NDArray[np.int64]]:
    """Points along a path, shape (k, n), and the numbers of those from which the way to the next one is not free."""
    points = points_along(path, step)
    blocked = ~motions.motion_valid_batch(points[:-1], points[1:])
    return points, np.flatnonzero(blocked).astype(np.int64)


def bent(path: Matrix, step: float, shift: float, motions: MotionQueries, rng: np.random.Generator) -> Matrix | None:
    """The path with the least of some bumps that make it free, or None.

    Args:
        path: Shape (k, n).
        step: Between the points that are shifted [unit of the space].
        shift: The largest that is tried.
        motions: Checks motions.
        rng: Directions.
    """
    points, hits = hit_edges(path, step, motions)
    if len(hits) == 0 or not motions.valid_batch(points[[0, -1]]).all():
        return None
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    low, high = along[hits[0]] - ROOM * shift, along[hits[-1] + 1] + ROOM * shift
    low, high = max(low, 0.0), min(high, along[-1])
    shares = (along - low) / max(high - low, 1e-12)
    bump = np.where((shares > 0.0) & (shares < 1.0), np.sin(np.pi * shares) ** 2, 0.0)  # to the bit 0 at both ends
    directions = rng.normal(size=(BUMPS, points.shape[1]))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for share in SHARES:
        rows = points + share * shift * bump[None, :, None] * directions[:, None]
        starts, ends = (part.reshape(-1, points.shape[1]) for part in (rows[:, :-1], rows[:, 1:]))
        free = motions.motion_valid_batch(starts, ends).reshape(BUMPS, -1).all(axis=1)
        if free.any():
            return without_points_between(rows[int(free.argmax())])
    return None


@dataclass(frozen=True, slots=True, eq=False)
class Reshaped:
    """A run of the loop: its record, what has changed the motion in each tick, and whether coal finds no contact."""

    run: ReplanRun
    acts: tuple[str, ...]
    untouched: bool

    @property
    def calls(self) -> int:
        """How often the planner was called."""
        return self.acts.count("planned")


@cache
def reshaped(name: str, reshaper: Reshaper, seed: int, speed_bound: float) -> Reshaped:
    """One run of a scenario by a reshaper."""
    scenario = Scenario.load(name)
    settings = replace(scenario.settings, seed=seed, repair_budget=REPAIR_SECONDS, speed_bound=speed_bound)
    loop = ReshapedLoop(scenario, settings, reshaper)
    run = loop.run_ticks()
    problem = scenario.problem
    untouched = not check_contacts(problem.robot, run, problem.world.scene).contacts
    return Reshaped(run, tuple(loop.acts), untouched)


BRAKE, PATIENCE = 6.0, 20  # ticks
NONE = Reshaper()
WAYS: dict[str, Callable[[float], Reshaper]] = {
    "time scaled": lambda shift: Reshaper(BRAKE, PATIENCE),
    "path edited": lambda shift: Reshaper(shift=shift),
    "both": lambda shift: Reshaper(BRAKE, PATIENCE, shift),
}
SCENES = {
    "replan_triangles": ("six triangles", FASTEST, 2.0),
    "replan_ur5": ("UR5, 20 obstacles", 0.2, 0.4),
}  # what it is, no obstacle is faster [m/s], largest shift [unit of the space]


def loop(quick: bool) -> list[Row]:
    """Calls of the planner with and without a reshaper before it; arrival and contacts of all runs."""
    count, rows = 5 if quick else 20, []
    for name, (what, bound, shift) in SCENES.items():
        alone = [reshaped(name, NONE, seed, bound) for seed in range(count)]
        runs, calls = list(alone), _mean(alone)
        for way, make in WAYS.items():
            each = [reshaped(name, make(shift), seed, bound) for seed in range(count)]
            runs += each
            ratio, longer, chance = _mean(each) / calls, _ticks(each) / _ticks(alone), _chance(each, alone) / calls
            rows.append(
                judged(
                    f"{what}, {way}: calls of the planner, beside those without reshaper",
                    "fewer, in words",
                    f"{_mean(each):.1f} beside {calls:.1f}: {ratio:.2f}",
                    ratio,
                    Bar((0.0, 1e4), held=(0.0, 1.0 + chance)),
                    f"{_acts(each)}; {longer:.2f} of the ticks; bar: 1 and two standard errors; {LOOP}",
                )
            )
        arrived, clean = sum(each.run.found for each in runs), sum(each.untouched for each in runs)
        rows += [
            judged(f"{what}: arrival", "implied", f"{arrived} of {len(runs)}", arrived / len(runs), all_of(), LOOP),
            judged(f"{what}: runs without contact, in continuous time", "implied", f"{clean} of {len(runs)}",
                   clean / len(runs), all_of(), f"speed_bound {bound:g} m/s; bar chosen here"),
        ]  # fmt: skip
    return rows


def _mean(runs: list[Reshaped]) -> float:
    return float(np.mean([run.calls for run in runs]))


def _chance(runs: list[Reshaped], others: list[Reshaped]) -> float:
    """Two standard errors of the difference of the means of calls."""
    return 2.0 * float(np.sqrt(sum(np.var([run.calls for run in each], ddof=1) / len(each) for each in (runs, others))))


def _ticks(runs: list[Reshaped]) -> float:
    return float(np.mean([len(run.run.ticks) for run in runs]))


def _acts(runs: list[Reshaped]) -> str:
    slowed, edits = (np.mean([run.acts.count(act) for run in runs]) for act in ("slowed", "bent"))
    return f"{slowed:.1f} ticks slowed, {edits:.1f} edits a run"


TABLES = (
    Table(
        "drrt-con-loop",
        "The loop: planner, generator, reshaper",
        SOURCE,
        loop,
        120,
        28,
        bars="fewer calls from the source, in words; arrival, contact and chance ours",
    ),
)

"""Configuration and time [1, ch. 5.2]: planned where the course of what moves is known, beside DRRT-Con.

[1] writes down the space, in which a path never goes back in time, for scenes that are fully predictable, and plans
without it. What is measured here is a step beyond it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.contact_check import check_contacts
from rrtik_bench.drrt_con import FASTEST, REPAIR_SECONDS
from rrtik_bench.moving_scenes import moving_problem
from rrtik_bench.report.rows import Bar, Row, all_of, judged
from rrtik_bench.tables import Table
from rrtik_ompl.replanning.in_time import plan_in_time
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan_with
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.world.problem import Problem

SOURCE = "[1, ch. 5.2], configuration and time"
SCENES = {
    "replan_pockets": "two pockets",
    "replan_triangles": "six triangles",
    "replan_planar_arm": "planar arm, goal covered for a while",
    "replan_ur5": "UR5, 20 obstacles at up to 0.2 m/s",
}
BOUNDS = {"replan_pockets": 1.0, "replan_triangles": FASTEST, "replan_planar_arm": 3.6, "replan_ur5": 0.2}  # [m/s]
RATE, SECONDS = 10.0, 600.0  # slots a second; so long by the clock that it never decides
FAST_SPEED, FAST_COUNT, FAST_SECONDS = 0.5, 20, 12.0  # [m/s], obstacles, [s]
FAST_STEP, FAST_RATE, FAST_MARGIN = 0.05, 50.0, 0.02
FAST = f"UR5, {FAST_COUNT} obstacles at {FAST_SPEED:g} m/s"
OURS = "bar chosen here; the same speeds and margins"


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """A problem by the plan in time and by DRRT-Con: the runs, None if nothing was found, and who touched nothing."""

    planned: ReplanRun | None
    replanned: ReplanRun
    planned_clean: bool
    replanned_clean: bool

    @property
    def both(self) -> bool:
        """Whether both arrive."""
        return self.planned is not None and self.replanned.found


def _beside(problem: Problem, planned: ReplanRun | None, replanned: ReplanRun) -> Beside:
    clean = [
        run is not None and not check_contacts(problem.robot, run, problem.world.scene).contacts
        for run in (planned, replanned)
    ]
    return Beside(planned, replanned, *clean)


@cache
def shipped(name: str, seed: int) -> Beside:
    """A shipped scenario by both."""
    scenario = Scenario.load(name)
    problem, settings = scenario.problem, scenario.settings
    plan = plan_in_time(
        problem, rate=RATE, horizon=settings.seconds, speed=settings.step * settings.rate, margin=settings.margin,
        limits=settings.limits, seconds=SECONDS, seed=seed,
    )  # fmt: skip
    run = scenario.run(seed=seed, repair_budget=REPAIR_SECONDS, speed_bound=BOUNDS[name])
    return _beside(problem, plan.motion, run)


@cache
def fast(seed: int) -> Beside:
    """A generated scene of fast obstacles by both."""
    problem = moving_problem(rrtik.load_robot("ur5"), FAST_COUNT, FAST_SPEED, seed, seconds=FAST_SECONDS)
    settings = ReplanSettings(
        step=FAST_STEP, rate=FAST_RATE, margin=FAST_MARGIN, speed_bound=FAST_SPEED, seconds=FAST_SECONDS, seed=seed,
        repair_budget=REPAIR_SECONDS,
    )  # fmt: skip
    plan = plan_in_time(
        problem, rate=2.0 * RATE, horizon=FAST_SECONDS, speed=FAST_STEP * FAST_RATE, margin=FAST_MARGIN,
        seconds=SECONDS, seed=seed,
    )  # fmt: skip
    return _beside(problem, plan.motion, replan_with(settings, problem))


def in_time(quick: bool) -> list[Row]:
    """Arrivals, contacts and times of both, in shipped scenes and among obstacles that are fast."""
    count, rows = 2 if quick else 10, []
    for name, what in SCENES.items():
        rows += _rows(what, [shipped(name, seed) for seed in range(count)])
    fast_ones = [fast(seed) for seed in range(2 if quick else 15)]
    rows += _rows(FAST, fast_ones)
    arrived = sum(each.replanned.found and each.replanned_clean for each in fast_ones)
    planned = sum(each.planned is not None and each.planned_clean for each in fast_ones)
    rows.append(judged(f"{FAST}: arrived without contact, DRRT-Con's share of the plans' in time", "not in the print",
                       f"{arrived} beside {planned}", arrived / max(planned, 1), Bar((0.0, 1e4), held=(0.0, 1.0)),
                       "bar chosen here: who knows the course is no worse"))  # fmt: skip
    return rows


def _rows(what: str, each: list[Beside]) -> list[Row]:
    count = len(each)
    found, clean = (sum(flags) for flags in zip(*((b.planned is not None, b.planned_clean) for b in each), strict=True))
    pairs = [(b.planned.ticks[-1].time, b.replanned.ticks[-1].time) for b in each if b.both and b.planned is not None]
    first, second = np.mean(pairs, axis=0) if pairs else (np.nan, np.nan)
    proven = all(b.planned is None or len(set(b.planned.moves)) == 1 for b in each)
    return [
        judged(f"{what}: planned in time, proven", "not in the print", f"{found} of {count}, "
               f"{'every move' if proven else 'not every move'} proven", found / count if proven else 0.0,
               Bar((0.0, 1.0), held=(1.0, 1.0), differs=(0.9, 1.0)), "bar chosen here; whether there is a way is not "
               "known where obstacles are fast"),
        judged(f"{what}: without contact, in continuous time", "not in the print", f"{clean} of {found}",
               clean / max(found, 1), all_of(), "judged by coal alone, ten times in a slot"),
        judged(f"{what}: time of arrival beside DRRT-Con's", "not in the print", f"{first:.2f} s beside {second:.2f} s",
               first / second, Bar((0.0, 1e3), held=(0.0, 1.1)), f"where both arrive, {len(pairs)}; {OURS}"),
    ]  # fmt: skip


TABLES = (
    Table(
        "in-time",
        "Planned in configuration and time",
        SOURCE,
        in_time,
        180,
        25,
        bars="ours; the source writes the space down and plans without it",
    ),
)

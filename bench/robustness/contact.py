"""Verdicts of worlds at the very contact, judged by another instrument.

Random worlds of twelve robots hold every kind of obstacle. A free and a colliding configuration are brought together by
halving, with the world's own `valid_batch`, until no point of the arm moves more than 10 nm from one to the other; then
the judge measures how far the bodies are apart. What is done stands beside the page until that is written.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from typer import Option

from bench.robustness.contact_judge import Judge, Nearest
from bench.robustness.contact_worlds import ROBOTS, contact_world
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl import World
from rrtik_ompl.base.arrays import Matrix

ALLOWED = 2e-6  # [m]
WIDTH = 1e-8  # [m] between the free and the colliding side
DRAWN = 2000


@dataclass
class Found:
    """What was found in a world.

    Attributes:
        contacts: Number of them; each has a free and a colliding side.
        free: Share of the drawn configurations that are free.
        too_deep: Free configurations whose bodies overlap by more than is allowed.
        too_far: Colliding ones whose bodies are farther apart than is allowed.
        deepest, farthest: Amounts [m] of all contacts, 0 or more.
        kinds: Contacts by the kind of the pair.
        wrong: Lines about what was wrong: at most three.
    """

    contacts: int = 0
    free: float = 0.0
    too_deep: int = 0
    too_far: int = 0
    deepest: float = 0.0
    farthest: float = 0.0
    kinds: dict[str, int] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)


def contacts(robot: str, seed: int, count: int) -> Found:
    """Judge some contacts of a random world."""
    rng = np.random.default_rng([ROBOTS.index(robot), seed])
    world = contact_world(rng, robot)
    rows = rng.uniform(*world.robot.finite_range(), (DRAWN, world.robot.dof))
    free = world.valid_batch(rows)
    found = Found(free=round(float(free.mean()), 4))
    if free.all() or not free.any():
        return found
    ends = (rows[mask][rng.integers(0, mask.sum(), count)] for mask in (free, ~free))
    judge = Judge(world)
    for q in met(world, *ends):
        _count(found, judge.nearest(q), q.tolist())
    return found


def met(world: World, free: Matrix, colliding: Matrix) -> Matrix:
    """Free configurations next to contact, between pairs of free and colliding ones; shapes (m, dof)."""
    while True:
        wide = np.abs(free - colliding) @ world.weights > WIDTH
        middle = 0.5 * (free + colliding)
        if not wide.any():
            return free
        good = np.zeros(len(free), dtype=bool)
        good[wide] = world.valid_batch(middle[wide])
        free = np.where((wide & good)[:, None], middle, free)
        colliding = np.where((wide & ~good)[:, None], middle, colliding)


def _count(found: Found, nearest: Nearest, q: list[float]) -> None:
    found.contacts += 1
    kind = " / ".join(sorted(nearest.kinds))
    found.kinds[kind] = found.kinds.get(kind, 0) + 1
    found.deepest = max(found.deepest, -float(nearest.gap))
    found.farthest = max(found.farthest, float(nearest.gap))
    deep, far = bool(nearest.gap < -ALLOWED - WIDTH), bool(nearest.gap > ALLOWED + WIDTH)
    found.too_deep += deep
    found.too_far += far
    if (deep or far) and len(found.wrong) < 3:
        found.wrong.append(f"{nearest.pair}: {1e6 * nearest.gap:.2f} um at {q}")


def main(
    run: Run,
    parts: Parts,
    *,
    configurations: Annotated[int, Option(help="In all; 2,000,000 are wanted.")] = 60_000,
    wanted: Annotated[int, Option("--contacts", help="Of a world, with a configuration on either side.")] = 200,
) -> Report:
    """Judge."""
    worlds = max(1, round(configurations / (2 * wanted * len(ROBOTS))))
    found = parts(contacts, [(robot, seed, wanted) for seed in range(worlds) for robot in ROBOTS])
    report = run.report("Verdicts at contact, judged by another instrument")
    write(report, {robot: found[k :: len(ROBOTS)] for k, robot in enumerate(ROBOTS)})
    return report


def write(report: Report, found: dict[str, Sequence[Found]]) -> None:
    """The page of what was found in the worlds of each robot."""
    report.intro = (
        "Each contact counts twice, with the free and the colliding configuration on its sides, which lie within "
        f"{1e9 * WIDTH:g} nm. Wrong is a free one whose bodies overlap by more than {1e6 * ALLOWED:g} um, or a "
        "colliding one whose bodies are farther apart than that, with margins counted in. The judge has Pinocchio's "
        "poses, plain arithmetic for balls, clouds and half-spaces, and coal's distances for the rest; links are the "
        "triangles of their files. An overlap is stated by how far bodies have to be moved apart."
    )
    rows = []
    for robot, worlds in found.items():
        count = 2 * sum(each.contacts for each in worlds)
        rows.append([
            robot, f"{len(worlds)}", f"{count:,}", f"{sum(each.too_deep for each in worlds)}",
            f"{sum(each.too_far for each in worlds)}", f"{1e6 * max(each.deepest for each in worlds):.2f}",
            f"{1e6 * max(each.farthest for each in worlds):.2f}",
        ])  # fmt: skip
    every = [each for worlds in found.values() for each in worlds]
    total = 2 * sum(each.contacts for each in every)
    wrong = sum(each.too_deep + each.too_far for each in every)
    robots = sum(any(each.contacts for each in worlds) for worlds in found.values())
    report.bar(
        "wrong beyond 2 um at contact, of 2,000,000 configurations, 12 robots, all obstacle kinds", "0",
        f"{wrong} of {total:,}, {robots} robots", wrong == 0,
    )  # fmt: skip
    heads = ["robot", "worlds", "configurations", "free, overlapping by more", "colliding, farther apart"]
    report.table("Robots", [*heads, "deepest overlap [um]", "farthest apart [um]"], rows)
    kinds: Counter[str] = Counter()
    for each in every:
        kinds.update(each.kinds)
    report.table(
        "Contacts by the kinds of the pair", ["pair", "contacts"], [[k, f"{n:,}"] for k, n in kinds.most_common()]
    )
    lines = [f"- {robot}: `{line[:300]}`" for robot, worlds in found.items() for each in worlds for line in each.wrong][
        :40
    ]
    report.note("What was wrong", "\n".join(lines) or "Nothing.")

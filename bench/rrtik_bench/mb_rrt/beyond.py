"""What [3] names and does not measure: obstacles under both rules, and links that slide.

One node at a time, as the text has it: an edge that crosses a disc is rejected, and the pass goes on from the best node
of the same index that has a free one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_bench.report.rows import Bar, Row, all_of, judged
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.mb_rrt.links import Links, directions, sunflower
from rrtik_ompl.ik.mb_rrt.published import Draw, projected, square, square_then_goal, surface

SOURCE = "[3, section 2.1 and future work]"
RING = 35.0 * np.array([[np.cos(a), np.sin(a)] for a in 2.0 * np.pi * np.arange(7) / 7.0])  # centres of discs [cm]
RADIUS = 10.0  # [cm]
SAMPLINGS: dict[str, Draw] = {
    "Uniforme": square,
    "Uniforme*": square_then_goal,
    "projected": projected,
    "Superficie": surface,
}
GOALS, TOLERANCE, PASSES, TRIES = 60, 1.0, 400, 8
SLIDE = 4.0  # [cm] that a link of 10 cm is longer or shorter at most


@dataclass(frozen=True, slots=True)
class Rules:
    """How a pass is made.

    Attributes:
        draw: Samples.
        one_link_away: Rule B, or else A.
        discs: Centres of discs of `RADIUS` that no edge may cross, shape (k, 2).
        slide: Each link may be longer and shorter by so much.
    """

    draw: Draw
    one_link_away: bool
    discs: Matrix
    slide: float = 0.0


def passes_to(links: Links, goal: Vector, rules: Rules, rng: np.random.Generator, limit: int = PASSES) -> int:
    """Passes until an end is within `TOLERANCE` of the goal; 0 if none is."""
    levels: list[list[Vector]] = [[np.zeros(2)], *([] for _ in range(links.count))]
    for done in range(1, limit + 1):
        for index in range(1, links.count + 1):
            node = _node(links, goal, rules, np.array(levels[index - 1]), index, rng)
            if node is None:
                break
            levels[index].append(node)
            if index == links.count and np.linalg.norm(node - goal) < TOLERANCE:
                return done
    return 0


def _node(
    links: Links, goal: Vector, rules: Rules, parents: Matrix, index: int, rng: np.random.Generator
) -> Vector | None:
    """The next node of an index, or None if no edge is free."""
    sample = rules.draw(links, goal, index, 1, rng)[0]
    low, high = (float(links.lengths[index - 1]) + sign * rules.slide for sign in (-1.0, 1.0))
    away = np.linalg.norm(sample - parents, axis=1)
    score = np.maximum(np.maximum(low - away, away - high), 0.0) if rules.one_link_away else away
    for k in np.argsort(score, kind="stable")[:TRIES]:
        towards = (sample - parents[k]) / away[k] if away[k] > 0.0 else directions(1, 2, rng)[0]
        node: Vector = parents[k] + float(np.clip(away[k], low, high)) * towards
        if not crosses(parents[k], node, rules.discs):
            return node
    return None


def crosses(a: Vector, b: Vector, discs: Matrix) -> bool:
    """Whether the edge from a to b meets a disc."""
    if len(discs) == 0:
        return False
    edge = b - a
    share = np.clip((discs - a) @ edge / float(edge @ edge), 0.0, 1.0)
    return bool((np.linalg.norm(a + share[:, None] * edge - discs, axis=1) < RADIUS).any())


def _goals(links: Links, count: int) -> Matrix:
    cloud = sunflower(links, GOALS)
    free = cloud[(np.linalg.norm(cloud[:, None] - RING, axis=2) > RADIUS).all(axis=1)]
    kept: Matrix = free[:: max(1, len(free) // count)][:count]
    return kept


def obstacles(quick: bool) -> list[Row]:
    """Both rules with every sampling among a ring of seven discs, 10 links."""
    links, rows = Links([10.0] * 10), []
    goals = _goals(links, 5 if quick else 50)
    limit = PASSES // 4 if quick else PASSES
    for name, draw in SAMPLINGS.items():
        hits = {}
        for rule in (False, True):
            rng = np.random.default_rng([9, rule])
            hits[rule] = np.array([passes_to(links, goal, Rules(draw, rule, RING), rng, limit) for goal in goals])
        shares = {rule: float((hit > 0).mean()) for rule, hit in hits.items()}
        means = {rule: f"{hit[hit > 0].mean():.0f}" if hit.any() else "none" for rule, hit in hits.items()}
        text = f"A {shares[False]:.0%} in {means[False]}, B {shares[True]:.0%} in {means[True]} passes"
        rows.append(
            judged(
                f"{name}: goals solved, B less A",
                "B is better in every scenario",
                text,
                shares[True] - shares[False],
                Bar((-1.0, 1.0), held=(0.0, 1.0), refuted=(-1.0, -0.2), differs=(-0.2, 0.0)),
                f"{len(goals)} goals, at most {limit} passes, tolerance {TOLERANCE:g} cm; obstacles are "
                "future work in print",
            )
        )
        if name == "Superficie":
            rows.append(
                judged(
                    "MB-RRT among obstacles: goals solved",
                    "future work",
                    f"{shares[True]:.0%}",
                    shares[True],
                    Bar((0.0, 1.0), held=(0.9, 1.0)),
                    "surface samples and rule B",
                )
            )
    return rows


def sliding(quick: bool) -> list[Row]:
    """Links that slide: the edge takes the length that its sample asks for, within the joint's range."""
    rows = []
    for count in (3, 10):
        links, none = Links([10.0] * count), np.empty((0, 2))
        goals, means = sunflower(links, 8 if quick else 35), {}
        for slide in (0.0, SLIDE):
            rng = np.random.default_rng(10)
            hits = np.array([passes_to(links, goal, Rules(surface, True, none, slide), rng) for goal in goals])
            means[slide] = float(hits.mean())
            share = float((hits > 0).mean())
            what = "turning joints alone" if slide == 0.0 else f"each link slides by {SLIDE:g} cm"
            rows.append(
                judged(
                    f"{count} links, {what}: goals solved",
                    "joints may slide; none measured",
                    f"{share:.0%}, mean {hits.mean():.1f} passes",
                    share,
                    all_of(),
                    f"{len(goals)} goals, {TOLERANCE:g} cm",
                )
            )
        ratio = means[SLIDE] / means[0.0]
        rows.append(
            judged(
                f"{count} links: passes with sliding over without",
                "not measured",
                f"{ratio:.2f}",
                ratio,
                Bar((0.0, 1e3), held=(0.0, 1.0)),
                "a longer or shorter edge meets its circle sooner",
            )
        )
    return rows


TABLES = (
    Table(
        "mb-rrt-obstacles",
        "Rules A and B among obstacles",
        SOURCE,
        obstacles,
        30,
        1,
        bars="the source says that B is better in every scenario; shares ours",
    ),
    Table(
        "mb-rrt-sliding",
        "Links that slide",
        SOURCE,
        sliding,
        10,
        1,
        bars="ours; the source names sliding joints as future work",
    ),
)

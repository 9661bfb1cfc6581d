"""Tables 6 to 11 of [3], and the searches that are measured beside them. Lengths in cm."""

from __future__ import annotations

from dataclasses import dataclass
from multiprocessing import Pool

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.ik.mb_rrt.links import Links, sunflower
from rrtik_ompl.ik.mb_rrt.published import TreeSearch, first_hit, grow, grow_in_joint_space, one_link, surface

C_SPACE = "c-space"
NAMES = {
    C_SPACE: "RRT C-space",
    "uniform-a": "Uniforme A",
    "uniform-b": "Uniforme B",
    "uniform-a-star": "Uniforme A*",
    "uniform-b-star": "Uniforme B*",
    "surface-a": "Superficie A",
    "surface-b": "Superficie B",
}
# T_C [%], mu, rho, rho_10000 as printed; tables 6 and 7 are rows of 8 and 9 but for the entries named below them
PUBLISHED = {
    3: {
        C_SPACE: (28.5714, 5074.6154, 0.64941, 0.66067),
        "uniform-a": (14.2857, 2681.2577, 0.66690, 0.66791),
        "uniform-b": (34.2857, 3742.0833, 0.66007, 0.65968),
        "uniform-a-star": (5.7142, 74.5346, 0.66692, 0.66791),
        "uniform-b-star": (100.0, 245.6286, 0.64211, 0.66027),
        "surface-a": (34.2857, 5.4286, 0.195240, 0.203200),
        "surface-b": (100.0, 6.7844, 0.139750, 0.078041),
    },
    10: {
        C_SPACE: (21.0, 3309.0476, 0.54964, 0.55211),
        "uniform-a": (53.0, 2813.2075, 0.58094, 0.57329),
        "uniform-b": (45.0, 2546.4119, 0.57982, 0.56532),
        "uniform-a-star": (38.0, 1671.5263, 0.57409, 0.57756),
        "uniform-b-star": (71.0, 1333.0282, 0.56263, 0.56213),
        "surface-a": (57.0, 7.1053, 0.22309, 0.217820),
        "surface-b": (100.0, 6.6812, 0.24629, 0.083249),
    },
}
PRECISION = {  # tolerance [cm]: T_C, mu, rho, rho_10000
    3: {0.3: (100, 6.7844, 0.139750, 0.078041), 0.01: (100, 31.0286, 0.104440, 0.078041),
        0.001: (100, 95.7429, 0.083567, 0.078041)},
    10: {1.0: (100, 6.68, 0.24629, 0.083249), 0.01: (100, 34.33, 0.18359, 0.083249),
         0.001: (100, 95.22, 0.14158, 0.083249)},
}  # fmt: skip
GOALS = {3: 35, 10: 100}
TOLERANCE = {3: 0.3, 10: 1.0}  # [cm], 1 % of the reach
LONG = {3: 35, 10: 8}  # goals with which the runs go on to the limit
GOALS_PER_TREE = 5  # of variants whose tree grows without knowing the goal: the same law at a fifth of the time
KNOW_NO_GOAL = (C_SPACE, "uniform-a", "uniform-b")
PROCESSES = 2


@dataclass(frozen=True)
class Measured:
    """One row: T_C [%], passes of the goals solved, rho at the margin of 1 % of the reach and strictly, at the end.

    ``rho_all`` is that after all passes.
    """

    converged: float
    hits: tuple[int, ...]
    rho: tuple[float, float]
    rho_all: tuple[float, float]

    @property
    def mean(self) -> float:
        """Passes, over the goals solved; NaN where none was."""
        return float(np.mean(self.hits)) if self.hits else float("nan")


def arm(count: int) -> Links:
    """The arm of the tables: links of 10 cm."""
    return Links([10.0] * count)


def one_run(
    links: Links, name: str, goal: np.ndarray, tolerance: float, rng: np.random.Generator, stop: bool
) -> TreeSearch:
    """One search of a variant, ended at its first success if ``stop``."""
    if name == C_SPACE:
        return grow_in_joint_space(links, goal, tolerance=tolerance, rng=rng, stop=stop)
    return grow(links, goal, name, tolerance=tolerance, rng=rng, stop=stop)


def measure(count: int, name: str, seed: int, thinned: int = 1) -> dict[float, Measured]:
    """Of one variant, by tolerance: that of the tables, and for three joints 0.2 cm; every so manieth goal alone."""
    links, goals, tolerance = arm(count), sunflower(arm(count), GOALS[count])[::thinned], TOLERANCE[count]
    rng = np.random.default_rng([seed, count, list(NAMES).index(name)])
    whole, short = [], []
    if name in KNOW_NO_GOAL:
        for few in (goals[k :: -(-len(goals) // GOALS_PER_TREE)] for k in range(-(-len(goals) // GOALS_PER_TREE))):
            tree = one_run(links, name, few[0], tolerance, rng, False)
            whole += [aimed_at(tree, goal, tolerance) for goal in few]
    else:
        long = set(np.linspace(0, len(goals) - 1, min(LONG[count], len(goals))).astype(int).tolist())
        whole = [one_run(links, name, goals[k], tolerance, rng, False) for k in long]
        short = [one_run(links, name, goals[k], tolerance, rng, True) for k in range(len(goals)) if k not in long]
    rho_all = _rho(whole)
    tolerances = (tolerance, 0.2) if count == 3 else (tolerance,)
    return {tol: _row([*whole, *short], tol, rho_all) for tol in tolerances}


def aimed_at(tree: TreeSearch, goal: np.ndarray, tolerance: float) -> TreeSearch:
    """A tree that knows no goal, judged by another one."""
    misses = np.linalg.norm(tree.nodes[-1] - goal, axis=1)
    return TreeSearch(tree.links, goal, tree.nodes, tree.parents, misses, first_hit(misses, tolerance))


def _row(runs: list[TreeSearch], tolerance: float, rho_all: tuple[float, float]) -> Measured:
    hits = [first_hit(run.misses, tolerance) for run in runs]
    solved = [hit for hit in hits if hit]
    stopped = [run.until(hit) if hit else run for run, hit in zip(runs, hits, strict=True)]
    return Measured(100.0 * len(solved) / len(runs), tuple(solved), _rho(stopped), rho_all)


def _rho(runs: list[TreeSearch]) -> tuple[float, float]:
    """Mean share of nodes outside their region, at a margin of 1 % of the reach and strictly."""
    loose, strict = (float(np.mean([run.rho(margin) for run in runs])) for margin in (0.01, 0.0))
    return loose, strict


def all_variants(count: int, seed: int = 0, thinned: int = 1) -> dict[str, dict[float, Measured]]:
    """Every variant with ``count`` joints by name, in two processes."""
    jobs = [(count, name, seed, thinned) for name in reversed(NAMES)]
    with Pool(PROCESSES) as pool:
        measured = dict(zip(reversed(NAMES), pool.starmap(measure, jobs, chunksize=1), strict=True))
    return {name: measured[name] for name in NAMES}


def precise(count: int, tolerance: float, repeats: int, rng: np.random.Generator) -> tuple[NDArray[np.int64], float]:
    """MB-RRT at a tolerance [cm]: passes of each run, shape (repeats, goals), 0 where it failed; and the mean rho."""
    links, goals = arm(count), sunflower(arm(count), GOALS[count])
    runs = [[grow(links, goal, tolerance=tolerance, rng=rng) for goal in goals] for _ in range(repeats)]
    hits = np.array([[run.solved_in for run in row] for row in runs])
    return hits, float(np.mean([run.rho() for row in runs for run in row]))


def laws(rng: np.random.Generator) -> tuple[float, float]:
    """KS distance from the arcsine law, and the share of index-1 nodes outside: 4 x 10 cm, goal (20, 30)."""
    links, goal, count = Links([10.0] * 4), np.array([20.0, 30.0]), 100_000
    samples = surface(links, goal, 1, count, rng)
    nodes = one_link(np.zeros((count, 2)), samples, 10.0, rng)
    far = float(np.linalg.norm(goal))
    angle = np.arctan2(nodes[:, 1], nodes[:, 0]) - np.arctan2(goal[1], goal[0])
    law = 0.5 + np.arcsin(np.clip(far * np.sin(np.sort(angle)) / links.max_span[1], -1.0, 1.0)) / np.pi
    ks = float(np.abs(law - (np.arange(count) + 0.5) / count).max())
    return ks, float((np.linalg.norm(nodes - goal, axis=1) > links.max_span[1]).mean())

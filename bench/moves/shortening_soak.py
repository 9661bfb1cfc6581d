"""Shorten many random paths and put each through the dense check that shares nothing with the shortening.

Usage: ``python bench/moves/shortening_soak.py [--paths 10000] [--jobs 1] [--out bench/reports/shortening_soak.md]``. An
interrupted run goes on where it was. Exit code 0 if none is rejected, else 1.

A path leads through random free configurations of a scene, in turns of a plane arm, the TITAN-4, a UR5 and generated
scenes; every method shortens in turns. The check asks ``World.certify`` at twice the density of the planner's checks,
as the second check of every plan does. Beyond what is promised, it then looks at four times the density.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import cache

import numpy as np

from bench.shared.parts import Parts, add_options
from rrtik_bench.report.machine import processes
from rrtik_bench.report.page import Report
from rrtik_ompl import load_problem, load_robot, one_joint_moves, shorten
from rrtik_ompl.base.choices import ShorteningMethod
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.planning.generated_problems import FAMILIES, generated_problem
from rrtik_ompl.planning.shortening import METHODS
from rrtik_ompl.world.path import JointPath
from rrtik_ompl.world.problem import Problem

SHIPPED = ("planar3_boxes", "titan4_sdu", "titan4_prisms")
ARMS = ("titan4", "ur5")
DENSER = 4.0  # than the motion resolution: more than is promised
WAYPOINTS = 6
PART = 150  # paths that are done together, each part with a seed of its own
POOL, TRIES = 400, 50  # configurations drawn for a path, and tried for a waypoint
SECONDS = {"fewest-moves": 0.2}  # of methods that otherwise take long


@cache
def problems() -> list[Problem]:
    """Shipped ones and one generated of each family and arm."""
    generated = [generated_problem(load_robot(arm), family, 0) for arm in ARMS for family in FAMILIES]
    return [*(load_problem(name) for name in SHIPPED), *generated]


def random_paths(problem: Problem, rng: np.random.Generator) -> Iterator[JointPath]:
    """Free paths through random configurations, without end."""
    world = problem.world
    lower, upper = world.robot.finite_range()
    while True:
        drawn = rng.uniform(lower, upper, (POOL, world.robot.dof))
        here, route = problem.start, [problem.start]
        rows = drawn[world.valid_batch(drawn)]
        while len(rows) and len(route) < WAYPOINTS:
            ahead, rows = np.split(rows, [TRIES])
            near = here + rng.uniform(0.1, 0.6, (len(ahead), 1)) * (ahead - here)
            free = np.flatnonzero(world.motion_valid_batch(np.repeat(here[None], len(near), axis=0), near))
            if len(free):
                here = near[free[0]]
                route.append(here)
        path = JointPath.of(world.robot, np.array(route))
        if len(route) > 2 and not path.violations(world):
            yield path


def shortened(path: JointPath, problem: Problem, method: ShorteningMethod, seed: int) -> JointPath:
    """By one method; one that takes single-joint moves alone is given such."""
    if METHODS[method].moves_only:
        path = one_joint_moves(path, problem)
    return shorten(path, problem, method=method, seconds=SECONDS.get(method), seed=seed)


def soak(part: int, paths: int) -> dict[str, list[float]]:
    """By method: paths, rejected, rejected at four times the density, not converted, sum of the ratios of length."""
    rng = np.random.default_rng(part)
    streams = [(problem, random_paths(problem, rng)) for problem in problems()]
    counts = {method: np.zeros(5) for method in METHODS}
    for number in range(part * PART, part * PART + paths):
        problem, stream = streams[number % len(streams)]
        method = list(METHODS)[number // len(streams) % len(METHODS)]
        path = next(stream)
        try:
            found = shortened(path, problem, method, number)
        except InputError:  # a random path may come closer to something than single-joint moves can follow
            counts[method][3] += 1
            continue
        same = (found.waypoints[[0, -1]] == path.waypoints[[0, -1]]).all()
        rejected = not same or bool(found.violations(problem.world))
        grazing = bool(found.violations(problem.world, resolution=problem.world.motion_resolution / DENSER))
        counts[method] += (1, rejected, grazing, 0, found.length / path.length)
    return {method: count.tolist() for method, count in counts.items()}


def all_parts(paths: int, measure: Parts) -> dict[str, np.ndarray]:
    """The sums of all parts, see :func:`soak`."""
    parts = [(number, min(PART, paths - number * PART)) for number in range(-(-paths // PART))]
    found = measure(soak, parts)
    return {method: np.sum([counts[method] for counts in found], axis=0) for method in METHODS}


def page(counts: dict[str, np.ndarray], jobs: int) -> Report:
    """The report."""
    report = Report("Soak test of shortening", "python bench/moves/shortening_soak.py", processes(jobs))
    total = np.sum(list(counts.values()), axis=0)
    text = f"{total[1]:.0f} of {total[0]:.0f}"
    report.bar("shortened paths rejected by the dense check, or with other ends", "none", text, total[1] == 0)
    rows = [[m, *(f"{n:.0f}" for n in c[:4]), f"{c[4] / max(c[0], 1):.3f}"] for m, c in counts.items()]
    head = ["method", "paths", "rejected", "rejected at four times the density", "not convertible", "length, of before"]
    report.table("Methods", head, rows)
    how = " ".join(__doc__.split("else 1.")[1].replace("``", "`").split())
    report.note(
        "What was done", f"{total[0] + total[3]:.0f} random paths; seeds 0, 1, ..., one for {PART} paths. {how}"
    )
    return report


def main() -> int:
    """Shorten, check, write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--paths", type=int, default=10_000)
    add_options(parser, "shortening_soak.md")
    options = parser.parse_args()
    with Parts(options.out, options.jobs) as measure:
        report = page(all_parts(options.paths, measure), options.jobs)
        return report.finish(options.out)


if __name__ == "__main__":
    raise SystemExit(main())

"""Plain OMPL in worlds of ours: is an "exact" path free, do all planners end, and does anybody's planner live?"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from ompl import geometric as og
from ompl import util as ou

from bench.shared.judge import Contacts
from bench.shared.parts import Parts
from bench.truth import own_planners
from rrtik_bench.report.page import Report
from rrtik_ompl import JointPath, PoseGoal, Problem, load_problem, load_robot
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.description import catalog
from rrtik_ompl.model.transitions import subdivided
from rrtik_ompl.ompl import simple_setup
from rrtik_ompl.ompl_bridge import GoalSampler, StateIO
from rrtik_ompl.ompl_bridge.planner_traits import ompl_planners
from rrtik_ompl.world.world import World

PROBLEMS = ("planar3_boxes", "planar3_a", "titan4_sdu", "ur10_bin", "panda_shelf", "kinova_table")
SEEDS = 12  # of each planner on each problem
SECONDS = 1.0
DEEP = 1e-6  # [m] of overlap that counts; coal's own answers depend on the order of its arguments below 2 um
LOOKS = 1000  # at a path, by coal
LATE = 1.0  # [s] after the time given
STRICT = {"GLIBC_TUNABLES": "glibc.malloc.tcache_count=0", "MALLOC_PERTURB_": "165"}  # misuse of memory shows at once
EACH = 30  # solves of a planner of somebody's in one process
OWN = """
import sys
from bench.truth.ompl_exact import own_planner
own_planner(*sys.argv[1:3], int(sys.argv[3]))
"""


def section(parts: Parts, size: float) -> Report:
    """False "exact", planners that do not end, planners that end the process."""
    report = Report("Plain OMPL", "")
    _exact(report, parts, max(1, round(SEEDS * size)))
    _several_goals(report, parts)
    _own(report, parts)
    return report


def ways() -> list[tuple[str, bool]]:
    """Every planner: ours with and without ``world=``, and OMPL's."""
    return [(name, given) for name in catalog.list_planners() for given in (False, True)] + [
        (name, False) for name in sorted(ompl_planners())
    ]


def solved(problem: Problem, name: str, given: bool, seed: int, seconds: float = SECONDS) -> tuple[str, Matrix | None]:
    """OMPL's status, and the path of a planner in a SimpleSetup if it is said to be exact, shape (k, n)."""
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    ou.RNG.setSeed(seed + 1)
    setup = simple_setup(problem, seed=seed)
    si = setup.getSpaceInformation()
    if name in ompl_planners():
        planner = ompl_planners()[name](si)
    else:
        planner = catalog.find_planner(name)(si, seed=seed, **({"world": problem.world} if given else {}))
    setup.setPlanner(planner)
    status = str(setup.solve(seconds))
    found = setup.getProblemDefinition().getSolutionPath() if setup.haveExactSolutionPath() else None
    return status, None if found is None else StateIO(si).rows(found)


def faults(problem: Problem, rows: Matrix, *, looks: int = LOOKS) -> Iterator[str]:
    """What is wrong with an exact path; coal looks at so many of its configurations at most."""
    if not (np.array_equal(rows[0], problem.start) and problem.reached(rows[-1])):
        yield "it does not lead from the start to the goal"
    for violation in JointPath.of(problem.robot, rows).violations(problem.world)[:1]:
        yield violation.reason
    depth = deepest(problem.world, rows, looks)
    if depth > DEEP:
        yield f"pinocchio and coal: an overlap of {1e3 * depth:.4f} mm"


def deepest(world: World, rows: Matrix, looks: int) -> float:
    """The deepest overlap along a path [m], by pinocchio and coal alone.

    In steps of half the motion resolution, evenly fewer if these are more than ``looks``.
    """
    contacts = Contacts(world)
    counts = [world.steps(a, b, world.motion_resolution / 2.0) for a, b in pairwise(rows)]
    dense = subdivided(rows, np.array(counts))[0]
    return max((depth for row in dense[:: -(-len(dense) // looks)] for depth in contacts.depths(row)), default=0.0)


def exact_runs(problem_name: str, name: str, given: bool, seeds: int) -> tuple[dict[str, int], list[str]]:
    """Statuses of a planner on a problem, and what was wrong with paths that are said to be exact."""
    problem, counts, wrong = load_problem(problem_name), Counter[str](), list[str]()
    for seed in range(seeds):
        status, rows = solved(problem, name, given, seed)
        counts[status] += 1
        found = () if rows is None else faults(problem, rows)
        wrong += [f"{problem_name}, {name}{' with world' * given}, seed {seed}: {fault}" for fault in found]
    return dict(counts), wrong


def _exact(report: Report, parts: Parts, seeds: int) -> None:
    every = ways()
    found = parts(exact_runs, [(problem, *way, seeds) for way in every for problem in PROBLEMS])
    wrong = [each for _, some in found for each in some]
    runs = sum(sum(counts.values()) for counts, _ in found)
    exact = sum(counts.get("Exact solution", 0) for counts, _ in found)
    measured = f"{len(wrong)} of {exact:,} exact paths, {runs:,} runs"
    report.bar('plain OMPL: "exact" paths that are refused', "0", measured, not wrong)
    rows = []
    for k, (name, given) in enumerate(every):
        own = found[k * len(PROBLEMS) : (k + 1) * len(PROBLEMS)]
        shares = [f"{counts.get('Exact solution', 0)}/{seeds}" for counts, _ in own]
        rows.append([name, "yes" if given else "no", *shares, str(sum(len(some) for _, some in own))])
    text = (
        f"`simple_setup(problem)`, {SECONDS:g} s each, before any simplification: runs with an exact path, and how "
        "many of these paths `violations()` or pinocchio and coal refuse. "
        + " ".join(f"{each}." for each in wrong[:10])
    )
    report.table('"Exact" in plain OMPL', ("planner", "world=", *PROBLEMS, "refused"), rows, text=text.strip())


def several_goals(name: str, most: int) -> tuple[str, float, list[str]]:
    """Status, seconds and faults of an OMPL planner on `ur5_table` with a pose of the tip; 0 for the sampler itself."""
    code = f"from bench.truth.ompl_exact import print_several_goals; print_several_goals({name!r}, {most})"
    begun = time.perf_counter()
    try:
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30.0, check=False)
    except subprocess.TimeoutExpired:
        return "killed", time.perf_counter() - begun, ["it did not end"]
    if run.returncode:
        return "died", time.perf_counter() - begun, [f"exit code {run.returncode}"]
    status, seconds, *wrong = run.stdout.splitlines()
    return status, float(seconds), wrong


def print_several_goals(name: str, most: int) -> None:
    """For a process of its own: the rows of :func:`several_goals`."""
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    problem = load_problem("ur5_table")
    setup = simple_setup(problem)
    si = setup.getSpaceInformation()
    if not isinstance(problem.goal, PoseGoal):
        raise SystemExit("ur5_table has no pose as its goal")
    if most:
        setup.setGoal(GoalSampler(problem, si).states(most))
    setup.setPlanner(getattr(og, name)(si))
    begun = time.perf_counter()
    status = setup.solve(2.0)
    print(status, time.perf_counter() - begun, sep="\n")
    exact = setup.haveExactSolutionPath()
    for fault in faults(problem, StateIO(si).rows(setup.getSolutionPath())) if exact else ():
        print(fault)


def _several_goals(report: Report, parts: Parts) -> None:
    asked = [(name, most) for name in sorted(ompl_planners()) for most in (0, 1, 4)]
    found = parts(several_goals, asked)
    bad = [name for (name, _), (_, took, wrong) in zip(asked, found, strict=True) if wrong or took > 2.0 + LATE]
    in_time = f"{len(asked) - len(bad)} of {len(asked)}"
    report.bar("planners of OMPL with several goals end in time", "all", in_time, not bad)
    rows = [
        [name, "GoalSampler" if most == 0 else f"states({most})", status, f"{took:.2f}", "; ".join(wrong)]
        for (name, most), (status, took, wrong) in zip(asked, found, strict=True)
    ]
    report.table("Several goals: 2 s on `ur5_table`", ("planner", "goal", "status", "seconds", "wrong"), rows)


def own_planner(name: str, way: str, count: int) -> None:
    """For a process of its own: let a planner of somebody's solve a problem a number of times."""
    from rrtik_ompl import plan

    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    problem = Problem(World(load_robot("planar3")), [0.0, 0.0, 0.0], [1.0, 0.5, 0.0])
    planner = getattr(own_planners, name)
    for seed in range(count):
        if way == "plan":
            assert plan(problem, planner, seed=seed, shorten=False).found
        else:
            setup = simple_setup(problem)
            setup.setPlanner(planner(setup.getSpaceInformation()))
            assert str(setup.solve(1.0)) == "Exact solution"
            assert not list(faults(problem, StateIO(setup.getSpaceInformation()).rows(setup.getSolutionPath())))
    print("a path each time")


def own_planner_in_a_process(name: str, way: str, count: int) -> str:
    """What became of :func:`own_planner` where misuse of memory shows."""
    paths = os.pathsep.join(path for path in sys.path if path)
    env = {**os.environ, **STRICT, "PYTHONPATH": paths}
    command = [sys.executable, "-c", OWN, name, way, str(count)]
    run = subprocess.run(command, env=env, capture_output=True, text=True, timeout=120.0, check=False)
    return run.stdout.strip() if run.returncode == 0 else f"exit code {run.returncode}: {run.stderr[-200:]}"


def _own(report: Report, parts: Parts) -> None:
    asked = [(planner.__name__, way, EACH) for planner in own_planners.PLANNERS for way in ("plan", "simple_setup")]
    found = parts(own_planner_in_a_process, asked)
    good = sum(each == "a path each time" for each in found)
    what = "planners derived from ompl.base.Planner give their path"
    report.bar(what, "all", f"{good} of {len(asked)}", good == len(asked))
    rows = [[name, way, each] for (name, way, _), each in zip(asked, found, strict=True)]
    text = f"{EACH} solves in one process each, in a memory that overwrites what is freed."
    report.table("A researcher's own planner", ("planner", "by", "outcome"), rows, text=text)

"""What [3] leaves open, measured: arcs, limits, obstacles, one-axis joints, poses, and time."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from bench.ik.planar_solvers import ccd, fabrik
from rrtik_bench.report.page import Report
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.ik.mb_rrt.arc import arc_chains, grow_on_arcs
from rrtik_ompl.ik.mb_rrt.axes import Axes, axes_of
from rrtik_ompl.ik.mb_rrt.axis_rule_b import grow_by_rule_b
from rrtik_ompl.ik.mb_rrt.c_space import grow_in_joint_space
from rrtik_ompl.ik.mb_rrt.closing import grow_and_close
from rrtik_ompl.ik.mb_rrt.growth import grow
from rrtik_ompl.ik.mb_rrt.link_worlds import LinkWorlds
from rrtik_ompl.ik.mb_rrt.links import Links, directions, sunflower
from rrtik_ompl.ik.mb_rrt.search import polished
from rrtik_ompl.ik.mb_rrt.workspace_tree import WorkspaceTree
from rrtik_ompl.ik.numeric.descent import descend
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.shapes import Cylinder
from rrtik_planners import MBRRT, BiCRDT
from rrtik_robots.planar import planar

MOST = 1000  # passes
TIGHT = 1e-3  # [cm]
RINGS = (
    "The rings in which a joint is useful, and branches through them:\n\n"
    "![published tree](mb_rrt_tree.png) ![arcs](mb_rrt_arcs.png)"
)
GROWTH = (
    "Mean passes, sweeps or steps of those solved / CPU ms a goal / solved %. Links of 10 cm, the same 100 goals "
    "(fewer for the slow ones); arcs, FABRIK and CCD work on all goals as one batch, the others goal by goal. LM: one "
    "random start, no restarts. FABRIK, CCD: at most 1000 sweeps (200 above 20 joints). C-space: 1 % of the reach, "
    "2,000 iterations."
)


def arcs(report: Report, rng: np.random.Generator, goals: int = 200) -> tuple[float, int]:
    """Chains of 2 to 100 links: the worst error in reaches and the nodes outside."""
    rows: list[list[str]] = []
    worst, outside = 0.0, 0
    for dimension, name in ((2, "plane"), (3, "space")):
        for count in (2, 3, 10, 30, 100):
            for kind in ("equal", "unequal"):
                errors, beyond = [], 0
                for _ in range(goals):
                    lengths = np.full(count, 10.0) if kind == "equal" else rng.uniform(0.5, 20.0, count)
                    links = Links(lengths, dimension)
                    goal = rng.uniform(links.folded[0], links.reach) * directions(1, dimension, rng)[0]
                    run = grow_on_arcs(links, goal, rng=rng)
                    errors.append(run.misses[0] / links.reach)
                    beyond += run.outside(1e-12)
                share = 100.0 * np.mean(np.array(errors) < 1e-9)
                cells = [str(count), name, kind, str(goals), f"{share:g} %", f"{max(errors):.1e}", str(beyond)]
                rows.append(cells)
                worst, outside = max(worst, *errors), outside + beyond
    heads = ("links", "space", "lengths", "goals", "solved in 1 pass", "worst error / reach", "nodes outside")
    report.table("Arcs of intersection", heads, rows, text=RINGS)
    return worst, outside


def passes_of(tree: WorkspaceTree, done: Callable[[np.ndarray], bool]) -> int:
    """Passes until the tree's new branches will do, one at a time; 0 if they never do."""
    while tree.passes < MOST:
        if done(tree.grow()):
            return tree.passes
    return 0


def limits(report: Report, rng: np.random.Generator) -> dict[int, tuple[float, float]]:
    """Share solved and mean passes by the limit [deg]."""
    rows, found = [], {}
    for bound in (90, 60, 45):
        robot = planar(lengths=[0.1] * 10, limits_deg=[(-180, 180)] + [(-bound, bound)] * 9)
        axes, passes, errors = axes_of(robot, False), [], [0.0]
        for q in rng.uniform(robot.lower, robot.upper, (100, 10)):
            goal = robot.fk(q).translation
            tree = WorkspaceTree(axes, goal, np.zeros(10), rng)
            passes.append(passes_of(tree, lambda rows: len(rows) > 0))
            if passes[-1]:
                errors.append(100 * float(np.linalg.norm(robot.fk(tree.nodes(10)[-1]).translation - goal)))
        solved = [p for p in passes if p]
        found[bound] = len(solved) / len(passes), float(np.mean(solved))
        share, mean = found[bound]
        cells = [f"{100 * share:g} %", f"{mean:.2f}", str(max(solved)), f"{max(errors):.1e}"]
        rows.append([f"+-{bound}", str(len(passes)), *cells])
    title = "Joint limits: 10 links, first joint free, goals of random postures, one pass at a time"
    report.table(title, ("limits", "goals", "solved", "mean passes", "most", "worst error [cm]"), rows, level=3)
    return found


def ring_of_discs() -> tuple[rrtik.World, np.ndarray]:
    """10 links of 10 cm, 7 discs of radius 10 cm with centres 35 cm from the base, and goals clear of the discs."""
    angle = 2.0 * np.pi * np.arange(7) / 7
    centres = 0.35 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(7)])
    discs = [rrtik.Obstacle(f"disc{k}", Cylinder(0.1, 1.0), pin.SE3(np.eye(3), c)) for k, c in enumerate(centres)]
    goals = np.column_stack([sunflower(Links([0.1] * 10), 70), np.zeros(70)])
    clear = (np.linalg.norm(goals[:, None] - centres, axis=2) > 0.101).all(axis=1)
    return rrtik.World(rrtik.load_robot("planar10"), rrtik.Scene(tuple(discs))), goals[clear]


def obstacles(report: Report, rng: np.random.Generator) -> tuple[float, float]:
    """Share solved and mean passes."""
    world, goals = ring_of_discs()
    axes = axes_of(world.robot, False)
    check, passes, bad, begin = LinkWorlds(world, axes).free, [], 0, time.perf_counter()
    for goal in goals:
        tree = WorkspaceTree(axes, goal, np.zeros(10), rng, check)
        passes.append(passes_of(tree, lambda rows: len(rows) > 0))
        bad += int((~world.certify(tree.nodes(10)[-1:])).sum())
    took = 1e3 * (time.perf_counter() - begin) / len(goals)
    solved = [p for p in passes if p]
    share = len(solved) / len(passes)
    line = (
        f"{len(goals)} goals, {100 * share:g} % solved exactly, mean {np.mean(solved):.2f} passes, most {max(solved)}, "
        f"{took:.0f} ms a goal; {bad} rejected by the World's certificate. An independent prototype "
        "took 1.7 passes on arcs, 95 by rule B."
    )
    report.note("Obstacles: 10 links of 10 cm, 7 discs of radius 10 cm in a ring of 35 cm", line, level=3)
    return share, float(np.mean(solved))


def one_axis_arm(count: int) -> rrtik.Robot:
    rows = [DhRow(a=0.1, alpha=(-1.0) ** k * np.pi / 2, limits=(-np.pi, np.pi)) for k in range(count)]
    return robot_from_dh(f"zigzag{count}", rows, convention="standard")


def _can_be_polished(robot: rrtik.Robot, axes: Axes, goal: rrtik.PositionGoal, rows: np.ndarray) -> bool:
    return len(polished(robot, axes, goal, rows)) > 0


def one_axis(report: Report, rng: np.random.Generator) -> dict[int, tuple[float, int]]:
    """Share solved and most passes by the number of joints."""
    rows, found = [], {}
    for count in (4, 7, 10):
        robot = one_axis_arm(count)
        plain: list[int] = []
        axes, passes, raw = axes_of(robot, False), [], []
        for q in rng.uniform(-np.pi, np.pi, (60, count)):
            goal = rrtik.PositionGoal(robot.fk(q).translation, tolerance=1e-4)
            tree = WorkspaceTree(axes, goal.position, np.zeros(count), rng)
            passes.append(passes_of(tree, partial(_can_be_polished, robot, axes, goal)))
            raw.append(100 * goal.distance(robot, tree.nodes(count)[:1])[0])
            if len(plain) < 30:
                tol = 0.01 * axes.reach[0]
                plain.append(grow_by_rule_b(axes, goal.position, tolerance=tol, passes=600, rng=rng).solved_in)
        solved = [p for p in passes if p]
        found[count] = len(solved) / len(passes), max(solved)
        cells = [f"{100 * found[count][0]:g} %", f"{np.mean(solved):.2f}", str(max(solved))]
        cells.append(f"median {np.median(raw):.2f}, least {min(raw):.2f}")
        cells.append(f"{100 * np.mean(np.array(plain) > 0):.0f} %, {np.mean([p for p in plain if p]):.0f}")
        rows.append([str(count), str(len(passes)), *cells])
    heads = (
        *("joints", "goals", "arcs and polish, 0.01 cm: solved", "mean passes", "most"),
        *("first miss without polish [cm]", "rule B, 1 % of the reach, 600 passes: solved, mean passes"),
    )
    report.table("Joints with one axis: a = 10 cm, alpha = +-90 degrees in turn", heads, rows, level=3)
    return found


def clocked(work: Callable[[], object], repeats: int = 3) -> float:
    """Least seconds of CPU time."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def beside(report: Report, rng: np.random.Generator) -> None:
    """3 to 100 joints: passes or sweeps and time; arcs, FABRIK and CCD take 100 goals as one batch."""
    rows = []
    for count in (3, 6, 10, 20, 50, 100):
        links = Links([10.0] * count)
        goals, start = sunflower(links, 100), rng.uniform(-np.pi, np.pi, (100, count))
        cells = [f"1 / {10 * clocked(partial(arc_chains, links, goals, rng)):.3f} / 100"]
        cells += _one_by_one(links, goals, rng)
        for solver in (fabrik, ccd):
            begin = time.process_time()
            nodes, sweeps = solver(links.lengths, goals, start, TIGHT, 200 if count > 20 else 1000)
            took = time.process_time() - begin
            solved = np.linalg.norm(nodes[:, -1] - goals, axis=1) < TIGHT
            cells.append(f"{sweeps[solved].mean():.1f} / {10 * took:.3f} / {100 * solved.mean():.0f}")
        cells.append(_lm(count, goals[:: 5 if count < 50 else 20], start))
        rows.append([str(count), *cells])
    heads = ("joints", "arcs", "MB-RRT", "closing two links", "C-space (1 %, 2,000)", "FABRIK", "CCD", "LM")
    report.table("Growth from 3 to 100 joints, 0.001 cm", heads, rows, text=GROWTH)


def _one_by_one(links: Links, goals: np.ndarray, rng: np.random.Generator) -> list[str]:
    """Cells of the trees, which take one goal at a time."""
    cells = []
    ways: tuple[tuple[Any, Callable[[np.ndarray], int]], ...] = (
        (goals[::5], lambda g: grow(links, g, tolerance=TIGHT, rng=rng, passes=3000).solved_in),
        (goals[::5] if links.count <= 20 else (), lambda g: _closed(links, g, rng)),
        (goals[::10], lambda g: grow_in_joint_space(
            links, g, tolerance=0.01 * links.reach, rng=rng, passes=2000).solved_in),
    )  # fmt: skip
    for few, work in ways:
        begin = time.process_time()
        hits = np.array([work(goal) for goal in few])
        if len(hits) == 0:
            cells.append("not run")
            continue
        took = 1e3 * (time.process_time() - begin) / len(few)
        mean = f"{hits[hits > 0].mean():.1f}" if (hits > 0).any() else "-"
        cells.append(f"{mean} / {took:.2f} / {100 * (hits > 0).mean():.0f}")
    return cells


def against_fabrik(rng: np.random.Generator) -> tuple[list[str], bool]:
    """10 joints, 0.001 cm, the same 100 goals: CPU ms a goal as one batch and one by one; whether arcs are faster."""
    links = Links([10.0] * 10)
    goals, start = sunflower(links, 100), rng.uniform(-np.pi, np.pi, (100, 10))
    times = {
        "one batch": (
            clocked(lambda: arc_chains(links, goals, rng)),
            clocked(lambda: fabrik(links.lengths, goals, start, TIGHT)),
        ),
        "one by one": (
            clocked(lambda: [arc_chains(links, goal[None], rng) for goal in goals]),
            clocked(lambda: [fabrik(links.lengths, goals[k : k + 1], start[k : k + 1], TIGHT) for k in range(100)]),
        ),
    }
    lines = [f"{name}: {10 * arc:.4f} beside {10 * other:.4f} ms" for name, (arc, other) in times.items()]
    return lines, all(arc < other for arc, other in times.values())


def _closed(links: Links, goal: np.ndarray, rng: np.random.Generator) -> int:
    found, passes = grow_and_close(links, goal, rng=rng, passes=1000)
    return 0 if found is None else passes


def _lm(count: int, goals: np.ndarray, start: np.ndarray) -> str:
    """Levenberg-Marquardt from one random start each, no restart."""
    robot, steps, solved, begin = planar(lengths=[0.1] * count), [], 0, time.process_time()
    for goal, q in zip(goals, start, strict=False):
        target = rrtik.PositionGoal(np.append(goal / 100.0, 0.0), tolerance=1e-5)
        end, taken = descend(robot, target, q[None])
        steps.append(taken)
        solved += int(target.satisfied(robot, end)[0])
    took = 1e3 * (time.process_time() - begin) / len(steps)
    return f"{np.mean(steps):.1f} / {took:.1f} / {100 * solved / len(steps):.0f}"


def arms(report: Report, count: int = 100) -> None:
    """Poses and positions of real arms within 0.1 mm and 0.1 mrad, by the tree and by random starts."""
    rows = []
    for name in ("planar10", "ur5", "panda", "puma560", "titan4"):
        robot = rrtik.load_robot(name)
        for kind in ("position", "pose"):
            cells, worst = [], 0.0
            for method in ("mb-rrt", "numeric"):
                took, found = [], 0
                for k, q in enumerate(np.random.default_rng(1).uniform(*robot.finite_range(), (count, robot.dof))):
                    tip = robot.fk(q)
                    goal = rrtik.PositionGoal(tip.translation, 1e-4) if kind == "position" else rrtik.PoseGoal(
                        tip, 1e-4, 1e-4)  # fmt: skip
                    result = solve_ik(robot, goal, method=method, seed=k, seconds=5.0)
                    took.append(1e3 * result.seconds)
                    found += result.found
                    if method == "mb-rrt" and result.found:
                        worst = max(worst, float(result.residuals.max()))
                cells.append(f"{found} of {count}, {np.median(took):.1f}, {np.percentile(took, 95):.1f}")
            rows.append([name, kind, *cells, f"{worst:.1e}"])
    heads = ("arm", "goal", "mb-rrt: found, median and p95 ms", "numeric", "worst residual of mb-rrt [m, rad]")
    text = "100 reachable goals each, 0.1 mm and 0.1 mrad."
    report.table("Real arms through `solve_ik`", heads, rows, text=text)


def plans(report: Report, seeds: int = 10) -> None:
    """MBRRT beside BiCRDT, which gets its goal configurations from `goal_configurations`."""
    rows = []
    for name in ("planar6_c_pose", "puma_pose", "puma_position"):
        problem, cells = rrtik.load_problem(name), []
        for planner in (MBRRT, BiCRDT):
            found = [rrtik.plan(problem, planner, seed=seed, seconds=5.0) for seed in range(seeds)]
            took = np.median([each.seconds for each in found])
            cells.append(f"{sum(each.found for each in found)} of {seeds}, {took:.3f}")
        rows.append([name, *cells])
    text = "To goals of the tip, 5 s, 10 seeds, goal configurations included."
    report.table("The planner", ("problem", "MBRRT: found, median s", "BiCRDT"), rows, text=text)

"""Scenes in MoveIt's words are read whole or refused, and path constraints keep their tolerances on whole motions."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from bench.constraints.problems import KINDS, generated
from bench.shared.parts import Parts
from bench.shared.problems import goal_joints
from bench.truth.moveit_pairs import CASES, Case, configurations
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.constraints.residuals import projected_rows
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.world.problem import Problem

DRAWN, ALONG = 2000, 40  # random configurations of a pair of files; parts of each motion
UNCERTAIN = 1e-6  # [m] of a contact
ROBOTS = ("ur5_limited", "panda", "titan4", "puma560")
PROBLEMS = 100  # of a robot and a kind, at full size
TIGHTER = {"upright": 0.02, "plane": 0.01, "line": 0.01, "orientation": 0.1}  # times the usual tolerance
ROUNDING = 2e-9  # [m; rad] of the judge


@dataclass(frozen=True)
class Read:
    """Of a pair of files: what came of it, how many answers were compared, and what was wrong."""

    outcome: str
    compared: int
    wrong: list[str]


def pair(name: str, drawn: int) -> Read:
    """Read a pair, compare so many configurations, a path and the problem as it is written and read again with coal."""
    case = CASES[name]
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = case.write(Path(folder))
        try:
            problem = rrtik.load_problem(file, robot=file.with_name("gantry.urdf"))
        except RrtikError as error:
            right = bool(case.refused) and re.search(case.refused, str(error)) is not None
            return Read("refused", 1, [] if right else [f"refused: {error}"])
        if case.refused:
            return Read("read", 1, ["read, though it has to be refused"])
        wrong, compared = answers(case, problem, drawn)
        try:
            problem.save(file.with_name("written.yaml"))
        except RrtikError:  # a map made in memory has no file
            return Read("read; cannot be written", compared, wrong)
        again, more = answers(case, rrtik.load_problem(file.with_name("written.yaml")), drawn)
        return Read("read", compared + more, wrong + again)


def answers(case: Case, problem: Problem, drawn: int) -> tuple[list[str], int]:
    """What is wrong with a problem that was read from a pair, and how many answers were looked at."""
    wrong = []
    rows = configurations(case, drawn, 0)
    within = problem.robot.within_limits(rows)
    distances = np.array([case.distance(q) - case.room for q in rows])
    sure = within & (np.abs(distances) > UNCERTAIN)
    free = problem.world.valid_batch(rows[sure])
    held = getattr(problem.world, "constraints", None)
    kept = np.ones(sure.sum(), dtype=bool) if held is None else held.held(rows[sure])
    different = (free != ((distances[sure] > 0.0) & kept)).sum()
    if different:
        wrong.append(f"{different} of {sure.sum()} configurations")
    plan = rrtik.plan(problem, seed=1, seconds=10.0)
    if plan.path is None:
        return [*wrong, f"no path: {plan.reason}"], int(sure.sum())
    dense = between(plan.path.waypoints, ALONG)
    touching = sum(case.distance(q) < case.room - UNCERTAIN for q in dense)
    if touching:
        wrong.append(f"{touching} of {len(dense)} places of the path touch")
    if not case.goal(case.tip(dense[-1])):
        wrong.append(f"the path ends at {case.tip(dense[-1]).round(4).tolist()}")
    if not all(case.kept(case.tip(q)) for q in dense):
        wrong.append("the path leaves what it has to keep")
    if not plan.proven:
        wrong.append("the path is not proven")
    return wrong, int(sure.sum()) + len(dense)


def between(rows: Matrix, parts: int) -> Matrix:
    """Configurations along the motions between waypoints, these included."""
    shares = np.linspace(0.0, 1.0, parts + 1)[:, None]
    dense = [rows[:1], *((1.0 - shares[1:]) * a + shares[1:] * b for a, b in pairwise(rows))]
    joined: Matrix = np.vstack(dense)
    return joined


@dataclass(frozen=True)
class Held:
    """Of paths under constraints: how many, of how many motions, and how far they left what was stated [m; deg]."""

    problems: int
    found: int
    proven: int
    motions: int
    metres: float
    degrees: float


def tolerances(name: str, kind: str, first: int, count: int, share: float) -> Held:
    """Plan generated problems whose tolerance is a share of the usual one, and look at every motion densely."""
    problems = found = proven = motions = 0
    metres = degrees = -1.0
    for seed in range(first, first + count):
        drawn = generated(name, kind, seed).problem
        if drawn is None:
            continue
        region = tighter(drawn.constraints[0], share)
        world = rrtik.World(drawn.robot, drawn.world.scene)
        goals, there = projected_rows(
            drawn.robot, held_regions(drawn.robot, world.scene, [region], drawn.start), goal_joints(drawn)[None]
        )
        if not there[0] or not world.certify(goals)[0]:
            continue
        problem = rrtik.Problem(world, drawn.start, goals[0], constraints=[region])
        problems += 1
        plan = rrtik.plan(problem, seed=seed, seconds=2.0)
        if plan.path is None:
            continue
        found, proven = found + 1, proven + bool(plan.proven)
        rows = plan.path.waypoints
        motions += len(rows) - 1
        away, angle = beyond(problem, region, between(rows, ALONG))
        metres, degrees = max(metres, away), max(degrees, float(np.degrees(angle)))
    return Held(problems, found, proven, motions, metres, degrees)


def tighter(region: TaskRegion, share: float) -> TaskRegion:
    """The same region with smaller tolerances."""
    return TaskRegion(
        region.T_world_w,
        region.bounds,
        region.T_w_tip,
        share * region.position_tolerance,
        share * region.orientation_tolerance,
    )


def beyond(problem: Problem, region: TaskRegion, dense: Matrix) -> tuple[float, float]:
    """By how much the tip leaves a region, at worst [m; rad], below 0 inside; by Pinocchio and formulas alone."""
    robot = problem.robot
    model, data = robot.model, robot.model.createData()
    frame = model.getFrameId(robot.tip)
    low, high = region.bounds.T
    metres = angle = 0.0
    for q in robot.pinocchio_configuration(dense):
        pin.forwardKinematics(model, data, q)
        D = region.T_world_w.inverse() * pin.updateFramePlacement(model, data, frame) * region.T_w_tip.inverse()
        away = D.translation - np.clip(D.translation, low[:3], high[:3])
        metres = max(metres, float(np.linalg.norm(away)))
        angle = max(angle, turned_away(D.rotation, low[3:], high[3:]))
    return metres - region.position_tolerance, angle - region.orientation_tolerance


def turned_away(R: Matrix, low: Matrix, high: Matrix) -> float:
    """Angle from what a region of one of the drawn kinds says of the orientation [rad]."""
    wide = high - low > 6.0
    if wide.all():
        return 0.0
    if wide.any():  # the yaw is free: of the z axis alone
        return float(np.arctan2(np.linalg.norm(R[:2, 2]), R[2, 2]))
    return float(np.linalg.norm(pin.log3(R)))


def section(parts: Parts, size: float) -> Report:
    """MoveIt's scenes and requests, and tolerances of path constraints."""
    report = Report("Scenes and constraints", "", "")
    read = dict(zip(CASES, parts(pair, [(name, max(50, round(DRAWN * size))) for name in CASES]), strict=True))
    wrong = [f"{name}: {fault}" for name, each in read.items() for fault in each.wrong]
    compared = sum(each.compared for each in read.values())
    report.bar(
        "scenes and requests in MoveIt's words, beside coal on what they say",
        "right, or refused by name",
        f"{len(read) - len({line.split(':')[0] for line in wrong})} of {len(read)} ({compared} answers)",
        not wrong,
    )
    lines = [[name, each.outcome, str(each.compared), "; ".join(each.wrong) or "-"] for name, each in read.items()]
    report.table("MoveIt's scenes and requests", ["pair", "outcome", "answers compared", "wrong"], lines)
    return _with_tolerances(report, parts, size)


def _with_tolerances(report: Report, parts: Parts, size: float) -> Report:
    """The same report with what paths under constraints keep."""
    count = max(1, round(PROBLEMS * size))
    cases = [(name, kind, 0, count, share) for name in ROBOTS for kind in KINDS for share in (1.0, TIGHTER[kind])]
    found: list[Held] = parts(tolerances, cases)
    rows = []
    for (name, kind, _, _, share), held in zip(cases, found, strict=True):
        left = [f"{1e6 * held.metres:.3g}", f"{held.degrees:.3g}"] if held.found else ["-", "-"]
        counts = [held.problems, held.found, held.proven, held.motions]
        rows.append([name, kind, f"{share:g}", *map(str, counts), *left])
    worst = max(held.metres for held in found), max(held.degrees for held in found)
    lost = sum(held.found - held.proven for held in found)
    report.bar(
        "tolerances of path constraints on whole motions, by Pinocchio at 40 places of each",
        "0 beyond what is stated",
        f"nearest to the rim {1e6 * worst[0]:.3g} um and {worst[1]:.3g} degrees",
        worst[0] <= ROUNDING and np.radians(worst[1]) <= ROUNDING,
    )
    report.bar("paths under constraints that are proven", "all", f"{lost} are not", lost == 0)
    heads = ["arm", "constraint", "share of the usual tolerance", "problems", "found", "proven", "motions"]
    text = "How far motions went beyond their tolerance; below 0: how much was left."
    report.table("Tolerances along motions", [*heads, "[um]", "[deg]"], rows, text=text)
    return report

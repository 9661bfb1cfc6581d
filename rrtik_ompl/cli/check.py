"""The command `rrtik check`: check a problem, and optionally a path, a motion, a run or a task plan for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeGuard

import typer

from rrtik_ompl.base.errors import InputError, in_file
from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.task import plan_lines
from rrtik_ompl.cli.terminal import ProblemName, command, plural, progress, say, suggest

if TYPE_CHECKING:
    from rrtik_ompl.model.certificate import Certificate
    from rrtik_ompl.model.path import JointPath
    from rrtik_ompl.model.robot import Robot
    from rrtik_ompl.motion.trajectory import Trajectory
    from rrtik_ompl.world.problem import Problem

SLACK = 1e-6  # relative excess of a joint's velocity limit that is attributed to rounding
HEAD = 4096  # bytes at the beginning of a record that contain its kind
MOST_LINES = 20  # largest number of lines about the violations of a run

PathFile = Annotated[
    Path | None, typer.Argument(help="A path: .json, .csv or .txt; or a timed motion: .json, .csv, .yaml.")
]


def check(
    problem: ProblemName,
    path: PathFile = None,
    certificate: Annotated[
        Path | None, typer.Option(help="Verify this certificate of the path, and nothing else.")
    ] = None,
) -> int:
    """Check a problem, and a path, a motion or a run for it.

    Motions are proven free for their whole length; where that cannot be done they are checked densely. A timed motion
    is checked along the curve between its points, and its speeds are compared with the robot's. The file of a path may
    contain a certificate. A record is judged against the scene at each time, between the ticks too. Exit code 1 if the
    path is not valid, if its certificate does not hold, or if something touches in the record.

    In the place of a problem there may be the plan of a task (.json): each motion is checked in its own world, on the
    contacts that it stands on and no longer.
    """
    from rrtik_ompl.files.kinds import kind_of

    if kind_of(problem) == "TaskPlan":
        if path is not None:
            raise typer.BadParameter("the plan of a task holds its paths; leave the path out.")
        return _check_task_plan(problem) if certificate is None else _check_task_certificate(problem, certificate)
    if certificate is not None and path is None:
        raise typer.BadParameter("'--certificate' needs the path that the certificate is for.")

    from rrtik_ompl import JointPath, load_problem
    from rrtik_ompl.model.certificate import Certificate
    from rrtik_ompl.motion.trajectory import Trajectory
    from rrtik_ompl.motion.trajectory.load import load_motion_or_path

    question = load_problem(problem)
    world = question.world

    if path is not None and certificate is not None:
        return _say_certified(question, JointPath.load(path, world.robot), Certificate.load(certificate), certificate)
    if _is_record(path):
        return _check_run(question, path)

    # Loaded first, so that an invalid file is refused before anything is printed.
    route = None if path is None else load_motion_or_path(path, world.robot)
    kept = " beyond the margins" if any(obstacle.margin for obstacle in world.scene.obstacles) else ""
    _say_ends(question, kept)

    if path is None or route is None:
        suggest(command("plan", problem), command("show", problem))
        return FOUND

    faults = _faults_of_motion(question, route) if isinstance(route, Trajectory) else _faults_of_path(question, route)
    if faults:
        say(*(f"{path}: {fault}" for fault in faults))
        suggest(f"look at it: {command('show', problem, path)}")
        return NOT_FOUND

    see = f"see it: {command('show', problem, path)}"
    if isinstance(route, Trajectory):
        say(f"{path}: valid, {_how_proven(question, route)}; {len(route.times)} points, {route.duration:.3f} s")
        suggest(see)
        return FOUND

    say(*(f"{path}: {line}" for line in _path_lines(question, route, kept)))
    code = _check_beside(question, route, path)
    suggest(see, f"time it: {command('time', problem, path)}")
    return code


# --- a problem, a path, a motion -------------------------------------------------------------------------------------


def _say_ends(problem: Problem, kept: str) -> None:
    """Print the clearance of start and goal; ``kept`` is appended to it."""
    goal = problem.goal.q
    ends = {"start": problem.start} | ({} if goal is None else {"goal": goal})
    for end, q in ends.items():
        if not problem.world.valid(q):
            say(f"{problem.name}: {end} is covered at first: {problem.world.explain(q)}")
            continue
        say(f"{problem.name}: {end} is free, clearance {_millimetres(problem.world.clearance(q))}{kept}")


def _millimetres(distance: float) -> str:
    return "unlimited" if distance == float("inf") else f"{1e3 * distance:.1f} mm"


def _faults_of_path(problem: Problem, route: JointPath) -> list[str]:
    """Return one line for each motion of a path that is not free, and for ends that differ from the problem's."""
    lines = [f"motion {v.edge + 1}: {v.reason}" for v in route.violations(problem.world)]
    return lines + _wrong_ends(problem, route)


def _faults_of_motion(problem: Problem, motion: Trajectory) -> list[str]:
    """Return the faults of a timed motion, including one line for each joint that is too fast."""
    return [*motion.faults(problem.world), *_too_fast(problem.robot, motion), *_wrong_ends(problem, motion.path())]


def _wrong_ends(problem: Problem, path: JointPath) -> list[str]:
    """Return one line for each end of a path that differs from the problem's."""
    wrong = {
        "the path does not begin at the start of the problem": abs(path.start - problem.start).max() > 1e-6,
        "the path does not end at the goal of the problem": not problem.reached(path.end),
    }
    return [text for text, found in wrong.items() if found]


def _too_fast(robot: Robot, motion: Trajectory) -> list[str]:
    """Return one line for each joint that exceeds its velocity limit."""
    most = motion.peaks().velocity
    units = ["m/s" if slides else "rad/s" for slides in robot.prismatic]
    rows = zip(robot.joint_names, most.tolist(), robot.velocity.tolist(), units, strict=True)

    return [
        f"'{name}' goes at {rate:.4g} {unit}, its limit is {limit:.4g} {unit}"
        for name, rate, limit, unit in rows
        if rate > limit * (1.0 + SLACK)
    ]


def _how_proven(problem: Problem, motion: Trajectory) -> str:
    """Return, in a few words, how much of a timed motion without faults is proven free."""
    from rrtik_ompl.world.route_check import as_it_stands

    proof = motion.prove(problem.world)
    still = as_it_stands(problem.world.scene)
    if proof.proven:
        return f"proven free at every time{still}"

    proven = f"{proof.motions - len(proof.unproven)} of {proof.motions} pieces proven free"
    return f"{proven}, the others checked in steps{still}"


def _path_lines(problem: Problem, route: JointPath, kept: str) -> list[str]:
    """Return the lines about a path without faults; ``kept`` is appended to its clearance."""
    from rrtik_ompl.world.clearance_curve import clearance_along
    from rrtik_ompl.world.route_check import how_checked

    world = problem.world
    lines = []
    if any(body.kind == "obstacle" for body in world.bodies):
        lines.append(f"{clearance_along(world.checks, route.waypoints)}{kept}")

    size = f"{len(route.waypoints)} waypoints, {route.transitions} moves, length {route.length:.2f} {route.unit}"
    return [*lines, f"valid, {how_checked(world.checks, route.waypoints)}; {size}"]


# --- a certificate ---------------------------------------------------------------------------------------------------


def _check_beside(problem: Problem, route: JointPath, file: Path) -> int:
    """Check the certificate in a path's file, if there is one; print the result and return the exit code."""
    from rrtik_ompl.model.certificate import certificate_beside

    found = certificate_beside(file)
    return FOUND if found is None else _say_certified(problem, route, found, file)


def _say_certified(problem: Problem, path: JointPath, certificate: Certificate, file: Path) -> int:
    """Check whether a certificate proves that a path solves a problem; print the result and return the exit code."""
    from rrtik_ompl.world.certificate_check import certificate_fault
    from rrtik_ompl.world.route_check import as_it_stands

    faults = [certificate_fault(certificate, problem.world, path.waypoints), *_wrong_ends(problem, path)]
    if any(faults):
        say(f"{file}: does not hold: {next(filter(None, faults))}")
        return NOT_FOUND

    kept = f", {1e3 * certificate.clearance:g} mm kept from obstacles" if certificate.clearance else ""
    moves = len(certificate.motions)
    still = as_it_stands(problem.world.scene)
    proven = f"{moves} motion{'s' * (moves != 1)} proven free{kept}, {certificate.entries} entries{still}"
    say(f"{file}: holds: {proven}")
    return FOUND


# --- the record of a run ---------------------------------------------------------------------------------------------


def _is_record(file: Path | None) -> TypeGuard[Path]:
    """Check whether a file is the record of a run."""
    from rrtik_ompl.replanning.record import KIND

    if file is None or file.suffix.lower() != ".json" or not file.is_file():
        return False
    with file.open("rb") as opened:
        return f'"{KIND}"'.encode() in opened.read(HEAD)


def _check_run(problem: Problem, file: Path) -> int:
    """Judge a record: print whether bodies touch in it, and return the exit code."""
    from rrtik_ompl.replanning.record import ReplanRun

    run = ReplanRun.load(file)
    with progress(f"{file}: judging {len(run.ticks)} ticks"):
        try:
            found = run.violations(problem)
        except InputError as error:
            raise in_file(file, error) from None

    moves, proven = run.moves
    if not found:
        say(f"{file}: {len(run.ticks)} ticks, nothing touches; {proven} of {moves} moves proven")
        return FOUND

    lines: Sequence[str] = [str(violation) for violation in found[:MOST_LINES]]
    more = [f"and {len(found) - MOST_LINES} more"] if len(found) > MOST_LINES else []
    touching = len({each.tick for each in found if each.touches})
    counted = f"{touching} of {len(run.ticks)} ticks touch something; {proven} of {moves} moves are called proven"
    say(*(f"{file}: {line}" for line in (*lines, *more, counted)))
    return NOT_FOUND


# --- the plan of a task ----------------------------------------------------------------------------------------------


def _check_task_plan(name: str) -> int:
    """Print for each motion of a saved plan how it is known to be free, and its contacts; return the exit code."""
    from rrtik_ompl.tasks import TaskPlan
    from rrtik_ompl.tasks.setting import world_of_motion

    plan = TaskPlan.load(name)
    faults = plan.faults()
    paths = tuple(
        path.proved(world_of_motion(path, world, stage))
        for path, world, stage in zip(plan.paths, plan.worlds, plan.stages, strict=True)
    )

    wrong = frozenset(number for number, motion in enumerate(faults) if motion)
    say(*plan_lines(name, replace(plan, paths=paths, notes=()), wrong))
    for number, world in enumerate(plan.worlds):
        for_a_while = plan.contacts[number] if plan.contacts else ()
        parting = {each.touching for each in for_a_while}
        throughout = [each for each in dict.fromkeys(world.scene.contacts) if each not in parting]
        say(*(f"  motion {number + 1} stands on a contact: {each}" for each in (*for_a_while, *throughout)))
    say(*(f"not valid: {fault.reason}" for motion in faults for fault in motion))
    return NOT_FOUND if wrong else FOUND


def _check_task_certificate(name: str, file: Path) -> int:
    """Check the certificate of a saved plan; print the result and return the exit code."""
    from rrtik_ompl.model.certificate import TaskCertificate
    from rrtik_ompl.tasks import TaskPlan

    certificate = TaskCertificate.load(file)
    fault = TaskPlan.load(name).verify(certificate)
    entries = sum(part.entries for part in certificate.parts)
    proven = f"holds: {plural(len(certificate.parts), 'part')} proven free, {entries} entries"
    say(f"{file}: does not hold: {fault}" if fault else f"{file}: {proven}")
    return NOT_FOUND if fault else FOUND

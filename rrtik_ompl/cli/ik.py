"""The command `rrtik ik`: inverse kinematics of a pose, of a problem's goal, of many poses, or of a trajectory."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.terminal import PAGE_FORMATS, Seed, note, plural, progress, say, suggest
from rrtik_ompl.files.text import check_target, comma_numbers

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from rrtik_ompl.base.arrays import Matrix, Vector
    from rrtik_ompl.ik.solve import IkResult
    from rrtik_ompl.ik.trajectory import IkTrajectory
    from rrtik_ompl.model.goal import Goal, PositionGoal, TipGoal
    from rrtik_ompl.model.robot import Robot
    from rrtik_ompl.world.problem import Problem
    from rrtik_ompl.world.world import World

MAX_ROWS = 40  # largest number of rows in a table; CSV and JSON contain all

Triple = tuple[float, float, float]


class Setting(NamedTuple):
    """Robot, world and defaults of the command.

    Attributes:
        robot: The arm.
        world: Its surroundings; None without a scene or problem.
        goal: Goal of the problem; None without a problem.
        near: Configuration near which solutions are preferred, shape (dof,); None if it is not given.
    """

    robot: Robot
    world: World | None
    goal: Goal | None
    near: Vector | None


class Output(NamedTuple):
    """The form in which results are printed."""

    as_json: bool
    as_csv: bool
    html: Path | None


def inverse_kinematics(
    robot: Annotated[
        str | None,
        typer.Argument(help="A name (see: rrtik list robots), a URDF, an MJCF or a DH table; left out if --problem."),
    ] = None,
    position: Annotated[
        Triple | None, typer.Option(metavar="X Y Z", help="Position of the tip in the world [m].")
    ] = None,
    quat_xyzw: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(metavar="X Y Z W", help="Orientation; any if left out."),
    ] = None,
    rpy_deg: Annotated[
        Triple | None, typer.Option(metavar="R P Y", help="Roll, pitch and yaw about fixed axes [deg].")
    ] = None,
    problem: Annotated[
        str | None, typer.Option(help="Take robot, scene, start (as --near) and, without --position, goal from it.")
    ] = None,
    scene: Annotated[
        Path | None, typer.Option(help="Obstacles: a YAML file with a scene; answers are free of collision.")
    ] = None,
    near: Annotated[str | None, typer.Option(help="A named posture of the robot; answers near it come first.")] = None,
    near_deg: Annotated[
        str | None, typer.Option(metavar="Q1,Q2,..", help="The same in joint values, with commas [deg; m if sliding].")
    ] = None,
    everything: Annotated[
        bool,
        typer.Option("--all", help="All solutions, not just one; those that differ by full turns are listed once."),
    ] = False,
    method: Annotated[str, typer.Option(help="auto, or see: rrtik list ik.")] = "auto",
    position_tolerance: Annotated[
        float | None, typer.Option(help="Tolerance of the position [m]; 0.001 if left out.")
    ] = None,
    orientation_tolerance_deg: Annotated[
        float | None, typer.Option(help="Tolerance of the orientation [deg]; 0.57 if left out.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Wall time for a numeric method [s]; per pose with --poses.")
    ] = None,
    seed: Seed = 0,
    poses: Annotated[Path | None, typer.Option(help="Many poses or points: .csv, .json or .yaml.")] = None,
    trajectory: Annotated[
        bool, typer.Option("--trajectory", help="Follow --poses from one to the next without jumps.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, in radians and metres.")] = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV, in degrees and millimetres.")] = False,
    html: Annotated[Path | None, typer.Option(help="Write a 3-D page with the solutions as ghosts.")] = None,
) -> int:
    """Find joint values for a pose or a point of the tip. Exit code 1 if there are none."""
    if as_json and as_csv:
        raise InputError("give one of --json and --csv, not both")
    if trajectory and poses is None:
        raise InputError("--trajectory follows the rows of a file: give --poses FILE too")
    if poses is not None and (position or quat_xyzw or rpy_deg or everything):
        raise InputError("--poses brings its own poses, one answer each: leave out --position, orientation and --all")

    check_target(html, PAGE_FORMATS)
    given = _setting(robot, problem, scene, near, near_deg)
    output = Output(as_json, as_csv, html)

    tolerances = _tolerances(position_tolerance, orientation_tolerance_deg)
    common: dict[str, Any] = {"method": method, "near": given.near, "world": given.world, "seed": seed}
    common |= {} if seconds is None else {"seconds": seconds}

    if poses is not None:
        return _many(given, poses, trajectory, tolerances, common, output)

    goal = _goal(given, position, quat_xyzw, rpy_deg, tolerances)
    return _one(given, goal, everything, common, output)


def _setting(
    robot: str | None, problem: str | None, scene: Path | None, near: str | None, near_deg: str | None
) -> Setting:
    """Load robot, world, goal and preferred configuration from a robot or a problem, after a check of the options."""
    from rrtik_ompl import World, load_problem, load_robot, load_scene

    if (robot is None) == (problem is None):
        raise InputError("give a robot, or --problem NAME, which brings its own: one of the two")

    if problem is not None:
        if scene is not None:
            raise InputError("--problem brings its own scene: leave out --scene")
        question = load_problem(problem)
        given = Setting(question.robot, question.world, question.goal, question.start)
    else:
        arm = load_robot(str(robot))
        given = Setting(arm, None if scene is None else World(arm, load_scene(scene)), None, None)

    return given._replace(near=_posture(given, near, near_deg))


def _tolerances(metres: float | None, degrees: float | None) -> dict[str, float]:
    """Return the given tolerances by the parameter names of `PoseGoal`, in metres and radians."""
    from rrtik_ompl.base.arrays import positive

    for option, value in (("--position-tolerance", metres), ("--orientation-tolerance-deg", degrees)):
        if value is not None:
            positive(value, option)

    found = {} if metres is None else {"position_tolerance": metres}
    return found if degrees is None else {**found, "orientation_tolerance": math.radians(degrees)}


def _posture(given: Setting, near: str | None, near_deg: str | None) -> Vector | None:
    if near is not None and near_deg is not None:
        raise InputError("give one of --near and --near-deg, not both")
    if near is not None:
        return given.robot.posture(near)
    if near_deg is None:
        return given.near
    return given.robot.configuration_deg(comma_numbers(near_deg, "--near-deg"), "--near-deg")


def _goal(
    given: Setting,
    position: Triple | None,
    quat_xyzw: tuple[float, float, float, float] | None,
    rpy_deg: Triple | None,
    tolerances: dict[str, float],
) -> TipGoal:
    """Return the goal described by the options, or that of the problem; for joint values it is the tip's pose there."""
    import numpy as np

    from rrtik_ompl import PoseGoal
    from rrtik_ompl.base.poses import placed, pose_from_rpy
    from rrtik_ompl.model.goal import TipGoal

    if quat_xyzw and rpy_deg:
        raise InputError("give one of --quat-xyzw and --rpy-deg, not both")

    if position is None:
        if quat_xyzw or rpy_deg or given.goal is None:
            raise InputError("where to? give --position X Y Z, --problem NAME with a goal, or --poses FILE")
        if given.goal.q is not None:
            return PoseGoal(given.robot.fk(given.goal.q), **tolerances)
        if not isinstance(given.goal, TipGoal):
            raise InputError("the goal of --problem is of several tips: rrtik plan finds configurations for them")
        if tolerances:
            raise InputError("the goal of --problem has tolerances of its own: leave both tolerances out")
        return given.goal

    if quat_xyzw:
        return PoseGoal(placed(position, "--position, --quat-xyzw", quat_xyzw=quat_xyzw), **tolerances)
    if rpy_deg:
        return PoseGoal(pose_from_rpy(position, np.radians(rpy_deg), "--position, --rpy-deg"), **tolerances)
    return _point(position, tolerances)


def _point(position: ArrayLike, tolerances: dict[str, float]) -> PositionGoal:
    """Return a goal for the position of the tip, without orientation."""
    from rrtik_ompl import PositionGoal

    _refuse_orientation(tolerances, "give --quat-xyzw or --rpy-deg, or leave it out")
    return PositionGoal(position, tolerances.get("position_tolerance", 1e-3))


def _refuse_orientation(tolerances: dict[str, float], remedy: str) -> None:
    """Raise an error if a tolerance of orientation is given for a goal without orientation."""
    if "orientation_tolerance" in tolerances:
        raise InputError(f"--orientation-tolerance-deg is of an orientation, and a point has none: {remedy}")


def _one(given: Setting, goal: TipGoal, everything: bool, common: dict[str, Any], output: Output) -> int:
    """Solve inverse kinematics of one goal, and print the solutions in the chosen form; return the exit code."""
    from rrtik_ompl import solve_ik
    from rrtik_ompl.cli import ik_report

    robot = given.robot
    world = given.world

    with progress(f"inverse kinematics of {robot.name}"):
        result, turns = ik_report.fold_full_turns(robot, solve_ik(robot, goal, all=everything, **common), given.near)
    names = ik_report.branch_names(robot, goal, result.solutions)

    if output.as_json:
        print(json.dumps(ik_report.document(robot, result, names, turns)))
    elif output.as_csv:
        reasons = [""] * len(result.solutions)
        notes = ik_report.solution_notes(names, turns)
        print(ik_report.rows_csv(robot, result.solutions, result.residuals, reasons, notes), end="")
    elif result.found:
        checked = world if world is not None and world.scene.obstacles else None
        clearances = [] if checked is None else [checked.clearance(q) for q in result.solutions]
        more = f" and {sum(turns)} more by full turns of joints" if any(turns) else ""
        count = f"{plural(len(result.solutions), 'solution')}{more}, {_milliseconds(result)}"
        off = ik_report.off_words(result.residuals)
        say(f"{ik_report.robot_words(robot)}, {result.method}: {count}, {off}")
        say(ik_report.solutions_table(robot, result, names, turns, clearances, MAX_ROWS))
        say(*_more(len(result.solutions)))

    if not result.found and not output.as_json:
        note(f"{robot.name}, {result.method}: no solution, {result.reason}: {result.detail}")
    if result.found:
        _draw(given, goal, result.solutions, output)
    return FOUND if result.found else NOT_FOUND


# --- many poses ------------------------------------------------------------------------------------------------------


def _many(
    given: Setting,
    file: Path,
    trajectory: bool,
    tolerances: dict[str, float],
    common: dict[str, Any],
    output: Output,
) -> int:
    """Solve inverse kinematics of all poses in a file, and print the results; return the exit code."""
    import numpy as np

    from rrtik_ompl.cli import ik_report
    from rrtik_ompl.problem_files.poses import load_poses

    robot = given.robot
    rows = load_poses(file)
    if rows.ndim == 2:
        _refuse_orientation(tolerances, "leave it out")

    with progress(f"inverse kinematics of {plural(len(rows), 'pose')}"):
        solve = _followed if trajectory else _each
        q, residuals, reasons, details, notes, line = solve(robot, rows, tolerances, common)

    found = sum(not reason for reason in reasons)
    why = next((f"; no. {k + 1}: {detail}" for k, detail in enumerate(details) if detail), "")

    if output.as_json:
        more = {"jumps": [k for k, note in enumerate(notes) if "jump" in note]} if trajectory else {}
        print(json.dumps({**ik_report.rows_document(robot, q, residuals, reasons, details), **more}))
    elif output.as_csv:
        print(ik_report.rows_csv(robot, q, residuals, reasons, notes), end="")
    else:
        shown = slice(MAX_ROWS)
        off = f", {ik_report.off_words(residuals)}" if found else ""
        say(f"{ik_report.robot_words(robot)}: {found} of {plural(len(rows), 'pose')} solved{line}{off}{why}")
        say(ik_report.rows_table(robot, q[shown], reasons[shown], notes[shown]))
        say(*_more(len(rows)))

    good = q[~np.isnan(q[:, 0])]
    if len(good):
        _draw(given, None, good, output, moving=trajectory)
    return FOUND if found == len(rows) else NOT_FOUND


class Solved(NamedTuple):
    """Inverse kinematics of m poses.

    Attributes:
        q: Joint values, shape (m, dof), rows of NaN without a solution.
        residuals: Errors of position [m] and orientation [rad], shape (m, 2).
        reasons: Why there is no solution, "" if there is one.
        details: Further explanations of these reasons.
        notes: Notes for each pose of a trajectory, such as a jump.
        line: A remark on the whole trajectory.
    """

    q: Matrix
    residuals: Matrix
    reasons: list[str]
    details: list[str]
    notes: list[str]
    line: str = ""


def _each(robot: Robot, rows: NDArray[np.float64], tolerances: dict[str, float], common: dict[str, Any]) -> Solved:
    """Solve each pose by itself: as one batch, or one after the other if points or tolerances are given."""
    import numpy as np

    from rrtik_ompl import PoseGoal, solve_ik, solve_ik_many

    if rows.ndim == 3 and not tolerances:
        batch = solve_ik_many(robot, rows, **common)
        return Solved(batch.q, batch.residuals, list(batch.reasons), list(batch.details), [""] * len(rows))

    q = np.full((len(rows), robot.dof), np.nan)
    residuals = np.full((len(rows), 2), np.nan)
    reasons = []
    details = []

    for k, row in enumerate(rows):
        goal = _point(row, tolerances) if rows.ndim == 2 else PoseGoal(row, **tolerances)
        result = solve_ik(robot, goal, **{**common, "seed": common["seed"] + k})
        reasons.append(result.reason)
        details.append(result.detail)
        if result.found:
            q[k] = result.solutions[0]
            residuals[k] = result.residuals[0]

    return Solved(q, residuals, reasons, details, [""] * len(rows))


def _followed(robot: Robot, rows: NDArray[np.float64], tolerances: dict[str, float], common: dict[str, Any]) -> Solved:
    """Solve the poses as a trajectory, with notes on jumps and collisions; only the first failure has details."""
    from rrtik_ompl.ik import solve_trajectory

    options: dict[str, Any] = dict(tolerances)
    done = solve_trajectory(robot, rows, **common, **options)

    notes = [""] * len(rows)
    details = [""] * len(rows)
    for text, where in (("jump", done.jumps), ("collision on the way", done.blocked)):
        for k in where:
            notes[k] = f"{notes[k]}, {text}" if notes[k] else text

    line = f", {plural(len(done.jumps), 'jump')}, {done.method}, {_milliseconds(done)}"
    if done.detail:  # the detail begins with the number of the point, counted from 0
        first = next(k for k, reason in enumerate(done.reasons) if reason)
        details[first] = done.detail.partition(": ")[2]

    return Solved(done.q, done.residuals, list(done.reasons), details, notes, line)


# --- what both show --------------------------------------------------------------------------------------------------


def _milliseconds(result: IkResult | IkTrajectory) -> str:
    """The time that a result took."""
    return f"{1e3 * result.seconds:.3g} ms"


def _more(rows: int) -> list[str]:
    return [] if rows <= MAX_ROWS else [f"... {rows - MAX_ROWS} more: see --csv or --json"]


def _draw(given: Setting, goal: TipGoal | None, q: Matrix, output: Output, *, moving: bool = False) -> None:
    """Write the page: solutions, of which one is a goal to drag, or the arm moving through a trajectory."""
    if output.html is None:
        if not output.as_json and not output.as_csv:
            suggest("see it: --html ik.html", *(["every solution: --all"] if len(q) == 1 else []))
        return

    from rrtik_ompl import Scene
    from rrtik_ompl.viewer import view
    from rrtik_ompl.viewer.subject import Shown

    shown = Shown(given.robot, Scene() if given.world is None else given.world.scene, goal, q[0])
    name = given.robot.name
    question = None if moving and len(q) > 1 else _question(given, q)

    with progress("drawing"):
        if question is not None and len(q) == 1:
            view(question, html=output.html, title=f"{name}: drag the goal, the joints follow")
        elif moving and len(q) > 1:
            view(shown, q, html=output.html, title=f"{name}: trajectory of {plural(len(q), 'point')}")
        else:
            view(question or shown, ghosts=q, html=output.html, title=f"{name}: {plural(len(q), 'solution')}")

    if not output.as_json and not output.as_csv:
        say(f"wrote {output.html}")
        suggest(f"open {output.html}")


def _question(given: Setting, q: Matrix) -> Problem | None:
    """Return a problem from the given configuration to the first free solution, or None if there is none.

    With a problem the page can plan. If the given configuration is in collision, the problem starts at its goal.
    """
    import numpy as np

    from rrtik_ompl import Problem, World

    if not given.robot.collision.geometryObjects:
        return None

    world = World(given.robot) if given.world is None else given.world
    start = given.robot.clamp(np.zeros(given.robot.dof)) if given.near is None else given.near

    free = world.valid_batch(np.vstack([start, q]))
    if not free[1:].any():
        return None

    goal = q[np.argmax(free[1:])]
    return Problem(world, start if free[0] else goal, goal, name=given.robot.name)

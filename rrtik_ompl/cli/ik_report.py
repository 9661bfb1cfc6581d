"""Results of inverse kinematics as text and tables (degrees, millimetres), as CSV, and as JSON."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, frozen
from rrtik_ompl.base.units import DEGREES, shown_unit
from rrtik_ompl.cli.table import Table, short_names
from rrtik_ompl.ik.analytic.branches import tip_fault
from rrtik_ompl.ik.analytic.closed_form import form_of, has_closed_form, solutions
from rrtik_ompl.ik.method_interface import IkResult, different_rows, mid_range_configuration
from rrtik_ompl.model.goal import Target, joint_difference
from rrtik_ompl.model.robot import Robot

if TYPE_CHECKING:
    from rrtik_ompl.model.goal import TipGoal


SAME = 1e-5  # [rad or m]; a double root is accurate to the square root of the rounding error
MILLIMETRES = 1e3


def branch_names(robot: Robot, goal: TipGoal, Q: Matrix) -> list[str]:
    """Return the name of each configuration's branch in the closed form, such as ``front near up``; "" if unknown.

    Args:
        robot: The arm.
        goal: The goal that the configurations solve.
        Q: Configurations, shape (k, dof).
    """
    targets = _targets(robot, goal)
    if targets is None or len(Q) == 0:
        return [""] * len(Q)

    form = form_of(robot)
    found = solutions(robot, np.repeat(targets, len(Q), axis=0), near=Q, check=False)
    off = np.abs(joint_difference(robot, found.branches, Q[:, None])).max(axis=2)
    nearest = np.argmin(np.where(found.real, off, np.inf), axis=1)

    names = []
    for k, branch in enumerate(nearest):
        families = [name for bit, name in enumerate(form.families) if int(found.singular[k]) >> bit & 1]
        known = found.real[k, branch] and off[k, branch] < SAME
        singular = f"singular: {', '.join(families)}" if families else ""
        names.append(", ".join(part for part in (form.branches[branch] if known else "", singular) if part))
    return names


def fold_full_turns(robot: Robot, result: IkResult, near: Vector | None) -> tuple[IkResult, list[int]]:
    """Merge solutions that differ only by full turns of joints, at which the arm is in the same place.

    Args:
        robot: The arm.
        result: Result of inverse kinematics.
        near: Joints are turned as near to this configuration, shape (dof,), as the limits allow; None for the middle of
            their ranges.

    Returns:
        The result, nearest first, and for each of its solutions the number of further ones within the limits by full
        turns, found or not. Joints without limits are not counted.
    """
    posture = mid_range_configuration(robot) if near is None else near
    whole = robot.chain.whole_turns()
    counted = whole & ~robot.continuous
    turned = result.solutions - TAU * np.round((result.solutions - posture) / TAU)
    Q = np.where(counted & (robot.lower <= turned) & (turned <= robot.upper), turned, result.solutions)

    # Angles are compared by cosine and sine, which are equal after full turns.
    looks = np.hstack([np.where(whole, np.cos(Q), Q), np.where(whole, np.sin(Q), 0.0)])
    kept = different_rows(looks, np.linalg.norm(Q - posture, axis=1).argsort(kind="stable"))
    q = Q[kept][:, counted]

    lower = robot.lower[counted]
    upper = robot.upper[counted]
    fitting = 1.0 + np.floor((upper - q) / TAU) + np.floor((q - lower) / TAU)

    folded = replace(result, solutions=frozen(Q[kept]), residuals=frozen(result.residuals[kept]))
    return folded, [int(number) - 1 for number in fitting.prod(axis=1)]


def _targets(robot: Robot, goal: TipGoal) -> NDArray[np.float64] | None:
    """Return a goal's target for the robot's closed form: a pose, (1, 4, 4), or a point, (1, 3); None without one."""
    if not has_closed_form(robot) or tip_fault(robot, form_of(robot)):
        return None
    if not isinstance(goal, Target):
        return None
    if goal.oriented:
        pose: NDArray[np.float64] = goal.pose.homogeneous
        return pose[None]
    return goal.point[None] if form_of(robot).kind == "position" else None


def joint_heads(robot: Robot, names: Sequence[str]) -> list[str]:
    """Return names of the joints with their units for display."""
    return [f"{name} [{shown_unit(slides)[1]}]" for name, slides in zip(names, robot.prismatic, strict=True)]


def robot_words(robot: Robot) -> str:
    """Return the name of a robot, with what the names of its joints have in common, which the heads leave out."""
    title, names = short_names(robot.joint_names)
    return robot.name if tuple(names) == robot.joint_names else f"{robot.name} (joints {title})"


def off_words(residuals: Matrix) -> str:
    """Return the largest errors of position and orientation in words; rows of NaN are left out."""
    position, orientation = np.nanmax(residuals, axis=0).tolist()
    return f"off by at most {round(MILLIMETRES * position, 4):g} mm and {round(DEGREES * orientation, 4):g} deg"


def solutions_table(
    robot: Robot,
    result: IkResult,
    names: Sequence[str],
    turns: Sequence[int],
    clearances: Sequence[float],
    most: int,
) -> Table:
    """Return a table with one row per solution, nearest first: branch, joints, full turns, clearance.

    Columns without content are left out; there are at most ``most`` rows.
    """
    named = any(names)
    turned = any(turns)
    cleared = len(clearances) > 0
    _, joints = short_names(robot.joint_names)

    heads = ["no.", *(["branch"] if named else []), *joint_heads(robot, joints)]
    heads += ["by full turns"] * turned + ["clearance [mm]"] * cleared

    table = Table(*heads, right={*range(len(heads))} - ({1} if named else set()))
    for k, q in enumerate(result.solutions[:most]):
        cells = [str(k + 1), *([names[k]] if named else []), *_joint_cells(robot, q)]
        cells += [f"+{turns[k]}"] if turned else []
        table.add_row(*cells, *([f"{MILLIMETRES * clearances[k]:.1f}"] if cleared else []))
    return table


def rows_table(robot: Robot, q: Matrix, reasons: Sequence[str], notes: Sequence[str]) -> Table:
    """Return a table with one row per pose: joints, or the reason why there is no solution, and notes."""
    noted = any(notes)
    _, joints = short_names(robot.joint_names)
    heads = ["no.", *joint_heads(robot, joints), "no solution", *(["note"] if noted else [])]
    table = Table(*heads, right=range(robot.dof + 1))

    for k, row in enumerate(q):
        cells = [""] * robot.dof if reasons[k] else _joint_cells(robot, row)
        table.add_row(str(k + 1), *cells, reasons[k], *([notes[k]] if noted else []))
    return table


def rows_csv(robot: Robot, q: Matrix, residuals: Matrix, reasons: Sequence[str], notes: Sequence[str]) -> str:
    """Return the same as CSV; joints in degrees (metres if prismatic), residuals in millimetres and degrees."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["number", *joint_heads(robot, robot.joint_names), "off [mm]", "off [deg]", "no solution", "note"])

    scale = np.where(robot.prismatic, 1.0, DEGREES)
    for k, (row, residual) in enumerate(zip(q * scale, residuals * [MILLIMETRES, DEGREES], strict=True)):
        found = not reasons[k]
        cells = [f"{value:.9g}" if found else "" for value in (*row, *residual)]
        writer.writerow([k + 1, *cells, reasons[k], notes[k]])

    return text.getvalue()


def solution_notes(names: Sequence[str], turns: Sequence[int]) -> list[str]:
    """Return the branch of each solution, and how many more there are by full turns."""
    more = [f"{number} more by full turns" if number else "" for number in turns]
    return [", ".join(filter(None, parts)) for parts in zip(names, more, strict=True)]


def document(robot: Robot, result: IkResult, names: Sequence[str], turns: Sequence[int]) -> dict[str, Any]:
    """Return one result as plain values: rad, m, s; ``by_full_turns`` counts further solutions by full turns."""
    return {
        "robot": robot.name,
        "method": result.method,
        "found": result.found,
        "reason": result.reason,
        "detail": result.detail,
        "joint_names": list(robot.joint_names),
        "solutions": result.solutions.tolist(),
        "branches": list(names),
        "by_full_turns": list(turns),
        "residuals": result.residuals.tolist(),
        "iterations": result.iterations,
        "seconds": result.seconds,
    }


def rows_document(
    robot: Robot, q: Matrix, residuals: Matrix, reasons: Sequence[str], details: Sequence[str]
) -> dict[str, Any]:
    """Return the results for many poses as plain values: rad and m; null where there is none."""
    return {
        "robot": robot.name,
        "joint_names": list(robot.joint_names),
        "found": [not reason for reason in reasons],
        "reasons": list(reasons),
        "details": list(details),
        "solutions": [None if reason else row.tolist() for row, reason in zip(q, reasons, strict=True)],
        "residuals": [None if reason else row.tolist() for row, reason in zip(residuals, reasons, strict=True)],
    }


def _joint_cells(robot: Robot, q: NDArray[np.float64]) -> list[str]:
    return [
        f"{round(float(value), 4) + 0.0:.4f}" if slides else f"{round(DEGREES * float(value), 2) + 0.0:.2f}"
        for value, slides in zip(q, robot.prismatic, strict=True)
    ]

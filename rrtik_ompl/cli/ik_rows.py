"""Inverse kinematics of many poses for the command `rrtik ik`, as one batch, one by one or as a trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli.terminal import plural

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from rrtik_ompl.base.arrays import Matrix
    from rrtik_ompl.ik.solve import IkResult
    from rrtik_ompl.ik.trajectory import IkTrajectory
    from rrtik_ompl.model.goal import PositionGoal
    from rrtik_ompl.model.robot import Robot


class Solved(NamedTuple):
    """Inverse kinematics of many poses: joint values, errors, reasons and details row by row.

    Of a trajectory also a note for each row, such as a jump, and a line about the whole.
    """

    q: Matrix
    residuals: Matrix
    reasons: list[str]
    details: list[str]
    notes: list[str]
    line: str = ""


def each(robot: Robot, rows: NDArray[np.float64], tolerances: dict[str, float], common: dict[str, Any]) -> Solved:
    """Joint values, residuals, reasons and details: poses as one batch unless tolerances are given, else singly."""
    import numpy as np

    from rrtik_ompl import PoseGoal, solve_ik, solve_ik_batch

    if rows.ndim == 3 and not tolerances:
        batch = solve_ik_batch(robot, rows, **common)
        return Solved(batch.q, batch.residuals, list(batch.reasons), list(batch.details), [""] * len(rows))

    q = np.full((len(rows), robot.dof), np.nan)
    residuals = np.full((len(rows), 2), np.nan)
    reasons = []
    details = []

    for k, row in enumerate(rows):
        goal = point(row, tolerances) if rows.ndim == 2 else PoseGoal(row, **tolerances)
        result = solve_ik(robot, goal, **{**common, "seed": common["seed"] + k})
        reasons.append(result.reason)
        details.append(result.detail)
        if result.found:
            q[k] = result.solutions[0]
            residuals[k] = result.residuals[0]

    return Solved(q, residuals, reasons, details, [""] * len(rows))


def followed(robot: Robot, rows: NDArray[np.float64], tolerances: dict[str, float], common: dict[str, Any]) -> Solved:
    """The same, details of the first point without a solution alone, with a note for each: a jump, a collision."""
    from rrtik_ompl import solve_ik_trajectory

    options: dict[str, Any] = dict(tolerances)
    done = solve_ik_trajectory(robot, rows, **common, **options)

    notes = [""] * len(rows)
    details = [""] * len(rows)
    for text, where in (("jump", done.jumps), ("collision on the way", done.blocked)):
        for k in where:
            notes[k] = f"{notes[k]}, {text}" if notes[k] else text

    line = f", {plural(len(done.jumps), 'jump')}, {done.method}, {milliseconds(done)}"
    if done.detail:  # which names its point, counted from 0
        first = next(k for k, reason in enumerate(done.reasons) if reason)
        details[first] = done.detail.partition(": ")[2]

    return Solved(done.q, done.residuals, list(done.reasons), details, notes, line)


def point(position: ArrayLike, tolerances: dict[str, float]) -> PositionGoal:
    """A goal of the tip's position alone, which has no tolerance of orientation."""
    from rrtik_ompl import PositionGoal

    refuse_orientation(tolerances, "give --quaternion or --rpy-deg, or leave it out")
    return PositionGoal(position, tolerances.get("position_tolerance", 1e-3))


def refuse_orientation(tolerances: dict[str, float], remedy: str) -> None:
    """Refuse a tolerance of orientation where there is none."""
    if "orientation_tolerance" in tolerances:
        raise InputError(f"--tolerance-deg is of an orientation, and a point has none: {remedy}")


def milliseconds(result: IkResult | IkTrajectory) -> str:
    """The time that a result took."""
    return f"{1e3 * result.seconds:.3g} ms"

"""Plans and paths in words and tables for a person: degrees, millimetres, one row per move."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from rrtik_ompl.goal import JointGoal
from rrtik_ompl.path import SECOND_CHECK, JointPath
from rrtik_ompl.planning import Plan
from rrtik_ompl.problem import Problem
from rrtik_ompl.transitions import lower_bound


def moves_table(path: JointPath) -> Table:
    """One row per single-joint move: joint, from, to, change; degrees, or metres for a prismatic joint."""
    sliding = dict(zip(path.joint_names, path.prismatic, strict=True))
    table = Table("move", "joint", "from", "to", "change", "unit", box=box.SIMPLE_HEAD, pad_edge=False)
    for column in (0, 2, 3, 4):
        table.columns[column].justify = "right"
    for number, move in enumerate(path.moves(), start=1):
        factor, unit, digits = (1.0, "m", 4) if sliding[move.joint] else (180.0 / np.pi, "deg", 2)
        start, end = factor * move.start, factor * move.end
        values = (f"{start:.{digits}f}", f"{end:.{digits}f}", f"{end - start:+.{digits}f}")
        table.add_row(str(number), move.joint, *values, unit)
    return table


def waypoints_table(path: JointPath) -> Table:
    """One row per waypoint, one column per joint; degrees, or metres for a prismatic joint."""
    units = ["m" if sliding else "deg" for sliding in path.prismatic]
    heads = [f"{name} [{unit}]" for name, unit in zip(path.joint_names, units, strict=True)]
    table = Table("waypoint", *heads, box=box.SIMPLE_HEAD, pad_edge=False)
    for column in table.columns:
        column.justify = "right"
    scale = np.where(path.prismatic, 1.0, 180.0 / np.pi)
    for number, row in enumerate(path.waypoints * scale, start=1):
        table.add_row(
            str(number),
            *(f"{value:.4f}" if m else f"{value:.2f}" for value, m in zip(row, path.prismatic, strict=False)),
        )
    return table


def fewest_moves(problem: Problem) -> int | None:
    """The lower bound c of the number of moves of any path of the problem; None if the goal is no configuration."""
    return lower_bound(problem.start, problem.goal.q) if isinstance(problem.goal, JointGoal) else None


def summary(problem: Problem, plan: Plan, path: JointPath | None, shorten_seconds: float) -> list[str]:
    """A few lines that say what was found, how good it is, and how long it took."""
    lines = [f"problem {problem.name}, robot {problem.world.robot.name}, planner {plan.planner}, seed {plan.seed}"]
    if plan.path is None or path is None:
        return [*lines, f"not found: {plan.reason}"]
    bound = fewest_moves(problem)
    if path.one_joint_at_a_time:
        least = "" if bound is None else f" (no path can have fewer than {bound})"
        raw = plan.path
        same = (raw.transitions, raw.length) == (path.transitions, path.length)
        before = "" if same else f"; {raw.transitions} moves and {raw.length:.2f} {raw.unit} before shortening"
        lines.append(f"{path.transitions} moves{least}, length {path.length:.2f} {path.unit}{before}")
    else:
        size = f"{len(path.waypoints)} waypoints, length {path.length:.2f} {path.unit}"
        lines.append(f"{size}, several joints move at once")
    step = problem.world.motion_resolution / SECOND_CHECK
    lines.append(
        f"planning {plan.seconds:.3f} s, shortening {shorten_seconds:.3f} s; checked again every {step:g} m: valid"
    )
    return lines


def document(problem: Problem, plan: Plan, path: JointPath | None, shorten_seconds: float) -> dict[str, Any]:
    """The same for machines: plain values that json can write; rad, m, s."""
    found: dict[str, Any] = {
        "problem": problem.name,
        "robot": problem.world.robot.name,
        "planner": plan.planner,
        "seed": plan.seed,
        "found": plan.found,
        "reason": plan.reason,
        "seconds": {"plan": plan.seconds, "shorten": shorten_seconds},
        "statistics": dict(plan.statistics),
    }
    if path is None:
        return found
    found |= {
        "length": path.length,
        "transitions": path.transitions,
        "lower_bound": fewest_moves(problem),
        "joint_names": list(path.joint_names),
        "waypoints": path.waypoints.tolist(),
    }
    if path.one_joint_at_a_time:
        found["moves"] = [{"joint": m.joint, "from": m.start, "to": m.end} for m in path.moves()]
    return found

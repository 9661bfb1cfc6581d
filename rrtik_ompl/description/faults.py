"""Report what is wrong in a robot's description, or not read, although the robot can be loaded: warn or refuse."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches

import numpy as np

from rrtik_ompl.base.errors import DescriptionWarning, InputError, few, printable
from rrtik_ompl.model.robot import Robot

MOST_NAMED = 3  # most faults in one line
MOST_UNREAD = 8  # most things that are not read in one line


def tell(faults: Sequence[str], strict: bool) -> None:
    """Warn of faults in one line, or raise an error.

    Args:
        faults: The faults, each with its file, and its line if that is known.
        strict: Whether any fault is an error.

    Raises:
        InputError: If there are any, and ``strict``.
    """
    if not faults:
        return

    more = len(faults) - MOST_NAMED
    line = "; ".join(faults[:MOST_NAMED]) + (f"; and {more} more" if more > 0 else "")

    if strict:
        raise InputError(f"{line}; correct this, or load without strict")
    warnings.warn(DescriptionWarning(printable(line)), stacklevel=3)


def not_read(where: str, things: Sequence[str]) -> list[str]:
    """Return the fault that things in a file are not read; an empty list if there are no such things."""
    return [f"{where}: not read: {few(things, MOST_UNREAD)}"] if things else []


def postures_outside(robot: Robot, told: Mapping[str, Mapping[str, float]]) -> Iterator[tuple[str, str]]:
    """Yield the postures that a file puts outside the limits, even if only by full turns: name, and what is wrong.

    Args:
        robot: The robot, whose postures are turned into its limits if a full turn does that.
        told: Values of joints [rad or m] by posture, as in the file.
    """
    for name in sorted(robot.postures.keys() & told.keys()):
        fault = robot.limit_fault(np.array([told[name][joint] for joint in robot.joint_names]))
        if fault:
            turned = "" if robot.limit_fault(robot.postures[name]) else "; it is taken a full turn away"
            yield name, f"{fault}{turned}"


def nearest_name(name: str, known: Iterable[str]) -> str:
    """Return a question about the nearest of the known names, "; did you mean 'elbow'?", or ""."""
    near = get_close_matches(name, list(known), n=1)
    return f"; did you mean '{near[0]}'?" if near else ""

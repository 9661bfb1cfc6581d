"""Numbers of links or joints, given by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from rrtik_ompl.base.arrays import bounded_array
from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.model.robot import Robot


def by_name(
    robot: Robot,
    option: str,
    kind: str,
    names: Iterable[str],
    given: Mapping[str, float],
    checked: Callable[[float, str], float],
) -> dict[str, float]:
    """The numbers of an option, checked.

    Args:
        robot: The robot.
        option: What they are for, for messages.
        kind: What has the names: "link" or "joint".
        names: All there are.
        given: By name.
        checked: Takes a number and what it is; returns it, or says why not.

    Raises:
        UnknownNameError: If there is no such name.
        InputError: If a value is no number, or as ``checked`` says.
    """
    known = tuple(names)
    found = {}
    for name, value in given.items():
        if name not in known:
            raise UnknownNameError(f"{kind} of robot '{robot.name}'", name, known, where=option)
        what = f"{option} of robot '{robot.name}': {name}"
        found[name] = checked(float(bounded_array(value, (), what)), what)
    return found

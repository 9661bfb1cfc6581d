"""Joints that open and close a gripper. They are held still while the arm moves; a task changes where they are held."""

from __future__ import annotations

from dataclasses import dataclass

from rrtik_ompl.base.arrays import finite_number
from rrtik_ompl.base.errors import InputError, UnknownNameError

STATES = ("open", "closed")


@dataclass(frozen=True, slots=True)
class GripperJoints:
    """The joints of a gripper, and how far its fingers are apart.

    What it returns is what `rrtik_ompl.load_robot` takes as ``locked``.

    Attributes:
        joints: Their names; what mimics them follows.
        opened, closed: Their values [rad or m] where the gripper is open and closed.
        width: How much farther the fingers are apart where it is open than where it is closed [m], in proportion in
            between; 0 if that is not known.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> hand = rrtik.load_robot("panda").gripper
        >>> hand.close_on(0.05)
        {'panda_finger_joint1': 0.025}
        >>> holding = rrtik.load_robot("panda", locked=hand.close_on(0.05))
    """

    joints: tuple[str, ...]
    opened: tuple[float, ...]
    closed: tuple[float, ...]
    width: float

    def posture(self, state: str) -> dict[str, float]:
        """Values of the joints by name where the gripper is "open" or "closed" ("close" is the same).

        Raises:
            UnknownNameError: If the state is another one.
        """
        if state not in (*STATES, "close"):
            raise UnknownNameError("state of a gripper", state, STATES)
        return dict(zip(self.joints, self.opened if state == "open" else self.closed, strict=True))

    def close_on(self, width: float) -> dict[str, float]:
        """Values of the joints by name where the fingers are a width [m] apart.

        Raises:
            InputError: If the gripper does not open so far.
        """
        wanted = finite_number(width, "width of a gripper")
        if self.width == 0.0:
            raise InputError("width of a gripper: how far this one opens is not known; use its states open and closed")
        if not 0.0 <= wanted <= self.width:
            raise InputError(f"width of a gripper: it opens from 0 to {self.width:g} m, got {wanted:g}")

        share = wanted / self.width
        values = (shut + share * (wide - shut) for shut, wide in zip(self.closed, self.opened, strict=True))
        return dict(zip(self.joints, values, strict=True))

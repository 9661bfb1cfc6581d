"""What inverse kinematics found, and if nothing, why."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.choices import IkMethod
from rrtik_ompl.copies import as_value

SAME_POSTURE = 1e-3  # [rad] or [m]; solutions of a numeric method this near are one


@dataclass(frozen=True, slots=True, eq=False)
class IkResult:
    """What inverse kinematics found.

    Attributes:
        solutions: Configurations at the goal, inside the limits, free if a world was given, nearest first; shape
            (k, dof). At most one unless all were asked for.
        residuals: Distance [m] and angle [rad] of each from the goal by forward kinematics, shape (k, 2); of several
            tips those of the tip that is farthest away.
        reason: "" or why there is none: ``unreachable``, ``limits``, ``collision``, ``time`` (or the method gave up,
            or tried a part of a region alone).
        detail: The same in a line: by how much, which joint, what touches.
        iterations: Steps of a numeric method.
        method: The method that answered.
        seconds: Time taken.
    """

    solutions: Matrix
    residuals: Matrix
    reason: str
    detail: str
    iterations: int
    method: IkMethod
    seconds: float

    __reduce__ = as_value

    @property
    def found(self) -> bool:
        """Whether there is a solution."""
        return len(self.solutions) > 0

    def nearest(self) -> IkResult:
        """The same with the nearest solution alone."""
        return replace(self, solutions=self.solutions[:1], residuals=self.residuals[:1])


def different_rows(rows: Matrix, order: NDArray[np.intp]) -> NDArray[np.intp]:
    """Numbers of the rows, taken in that order, without those that repeat an earlier one to `SAME_POSTURE`."""
    kept: list[int] = []
    for k in order.tolist():
        if not kept or np.abs(rows[k] - rows[kept]).max(axis=1).min() > SAME_POSTURE:
            kept.append(k)
    return np.array(kept, dtype=np.intp)

"""The closed form that a robot can bring: a function from poses to branches, and names of branches and singularities.

A robot's folder makes one `AnalyticSolver` and hands it to `Robot` as ``closed_form``;
`rrtik_ompl.ik.analytic.closed_form` places it in the world, applies the joint limits and checks the answers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.kernels.ik.branch_layout import DOUBLE_ROOT, REACH_TOLERANCE

Limits = tuple[Vector, Vector]  # lowest and highest joint values, shape (dof,) each


@dataclass(frozen=True, slots=True, eq=False)
class Branches:
    """All solutions for m poses, b branches each.

    Attributes:
        q: Joint values, angles in (-pi, pi], shape (m, b, dof). A branch that is not real holds its configuration that
            comes nearest to the pose, so that its residual says how far the pose is out of reach.
        real: Whether each branch reaches the pose, regardless of joint limits, shape (m, b).
        singular: Bit k is set if the pose belongs to family k of `AnalyticSolver.families`, and so has a whole curve of
            solutions, of which ``q`` holds representatives; shape (m,).
    """

    q: NDArray[np.float64]
    real: NDArray[np.bool_]
    singular: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class AnalyticSolver:
    """The inverse kinematics of one arm in formulas.

    Attributes:
        frame: The frame that the targets refer to.
        kind: ``"pose"``; or ``"position"`` if the orientation of the targets is ignored.
        branches: A label for each branch.
        families: Names of the kinds of singular poses.
        free: Indices of the joints that determine where on a family's curve a configuration lies (see ``solve``).
        solve: Function from T_base_frame, shape (m, 4, 4), ``near``, shape (m, dof) or None, the slack, and the joint
            limits or None, to `Branches`. The representatives of a singular pose are the members of its curve nearest
            to the values that the free joints have in ``near`` (0 if None), and to these values plus half a turn. If
            limits are given, a representative outside them is replaced by the nearest member inside that its branch
            has, so a pose has a branch inside the limits whenever it has a solution there. A pose that is nearer to a
            singular one than the slack [m, sine] is solved as if it were singular, with an error of about that slack.
        nearness: Function from Q, shape (m, dof), to a value for each named singular case, shape (m,): 0 at the
            singularity, in [0, 1] or metres.
        kernel: Name of the function of `rrtik_ompl.kernels.ik.branch_kernels` that gives the same for poses that are
            not singular; "" if there is none.
        numbers: The parameters of the arm that this function takes.
    """

    frame: str
    kind: str
    branches: tuple[str, ...]
    families: tuple[str, ...]
    free: tuple[int, ...]
    solve: Callable[[NDArray[np.float64], Matrix | None, float, Limits | None], Branches]
    nearness: Callable[[Matrix], Mapping[str, Vector]]
    kernel: str = ""
    numbers: tuple[float, ...] = ()

    def __call__(
        self,
        poses: NDArray[np.float64],
        near: Matrix | None = None,
        slack: float = 0.0,
        limits: Limits | None = None,
    ) -> Branches:
        """Return all branches for T_base_frame, shape (m, 4, 4); see ``solve``."""
        return self.solve(poses, near, slack, limits)


def wrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles [rad] moved by full turns into (-pi, pi]."""
    turned: NDArray[np.float64] = angle - TAU * np.ceil(angle / TAU - 0.5)
    return turned


def two_links(
    first: float, second: float, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], Mask]:
    """Solve for the two ways in which two links in a plane reach a point, by the law of cosines.

    Args:
        first: Length of the link at the origin [m].
        second: Length of the other link [m].
        x: x coordinate of the point [m], any shape.
        y: y coordinate of the point [m], same shape.

    Returns:
        Angle of the first link, and angle of the second link relative to it [rad], both with a leading axis of 2 for
        the two ways, positive relative angle first; and whether the point is in reach. For a point out of reach the
        links point at it, stretched or folded.
    """
    cosine = (x * x + y * y - (first * first + second * second)) / (2.0 * first * second)
    real = np.abs(cosine) <= 1.0 + REACH_TOLERANCE
    np.clip(cosine, -1.0, 1.0, out=cosine)
    square = (1.0 - cosine) * (1.0 + cosine)
    # If the links are nearly stretched or folded, rounding must not split the double root into two postures.
    square[square < DOUBLE_ROOT] = 0.0
    sine = np.sqrt(square)

    along = first + second * cosine
    across = second * sine
    ax = along * x
    ay = along * y
    cx = across * x
    cy = across * y

    turn = np.arctan2(sine, cosine)
    return np.stack([np.arctan2(ay - cx, ax + cy), np.arctan2(ay + cx, ax - cy)]), np.stack([turn, -turn]), real

"""Steps by the Jacobian down the metric of IKURT: Levenberg-Marquardt for many configurations at once, inside bounds.

Source: [22], as in :mod:`rrtik_ompl.ik.reference_descent`: the damping is half the squared residual
plus a small constant. Joints that a step would push through a bound are held and the step is solved for again, so that
goals on a limit are reached.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.ikurt.metric import TipMetric, reach
from rrtik_ompl.ik.residual import shortened
from rrtik_ompl.model.robot import poses_and_jacobians

ITERATIONS = 24
DAMPING = 1e-6  # the constant part, in units of the squared residual
LARGEST_STEP = 0.5  # [rad] or [m] of any joint in one iteration
ACCURACY = 1e-9  # of the reach; less where the goal wants that
SHARE = 0.1  # of the distance within which the goal counts as reached
STALE = 4  # iterations in which the distance has to fall to FALLS of what it was, or the row is given up
FALLS = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class Descent:
    """Where some configurations have led to: the best of each row, shape (m, n), and its distance, shape (m,)."""

    q: Matrix
    distance: Vector


def descend(metric: TipMetric, Q: Matrix, lower: Vector, upper: Vector, *, iterations: int = ITERATIONS) -> Descent:
    """Walk from each row of Q, shape (m, n), towards the goal, inside bounds of shape (n,)."""
    length = reach(metric.robot) * metric.unit
    enough = min(ACCURACY * length, SHARE * metric.radius)
    best = Q.copy()
    best_distance = np.full(len(Q), np.inf)
    history = np.full((STALE, len(Q)), np.inf)
    rows = np.arange(len(Q))
    q = Q

    for step in range(iterations):
        metric.evaluations += len(rows)
        tips, J = poses_and_jacobians(metric.robot, q)
        e, distance = metric.pull(tips)

        better = distance < best_distance[rows]
        best[rows[better]] = q[better]
        best_distance[rows[better]] = distance[better]

        going = (distance > enough) & (best_distance[rows] < FALLS * history[step % STALE, rows])
        history[step % STALE, rows] = best_distance[rows]
        if not going.any():
            break

        rows = rows[going]
        q = q[going]
        J = J[going]
        e = e[going] / length
        q = _stepped(q, J * (metric.scale / length)[:, None], e, lower, upper)

    return Descent(best, best_distance)


def _stepped(q: Matrix, J: NDArray[np.float64], e: Matrix, lower: Vector, upper: Vector) -> Matrix:
    """One step of each row inside the bounds; joints that would leave them are held."""
    dq = bounded_step(J, e)
    pinned = ((q <= lower) & (dq < 0.0)) | ((q >= upper) & (dq > 0.0))
    again = pinned.any(axis=1)
    if again.any():
        dq[again] = bounded_step(J[again] * ~pinned[again][:, None], e[again])
    stepped: Matrix = np.clip(q + dq, lower, upper)
    return stepped


def bounded_step(J: NDArray[np.float64], e: Matrix) -> Matrix:
    """Solve (J^T J + (e^T e / 2 + DAMPING) I) dq = J^T e for every row; shapes (m, k, n), (m, k) -> (m, n)."""
    damping: Vector = 0.5 * np.einsum("mi,mi->m", e, e) + DAMPING
    normal = np.einsum("mki,mkj->mij", J, J) + damping[:, None, None] * np.eye(J.shape[2])
    step = np.linalg.solve(normal, np.einsum("mki,mk->mi", J, e)[..., None])[..., 0]
    return shortened(step, LARGEST_STEP)

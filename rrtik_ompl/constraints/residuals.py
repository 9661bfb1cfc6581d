"""Projection of configurations into task-space regions: residuals, their derivatives and the iteration, in numpy.

:mod:`rrtik_ompl.kernels.search.constrained.projection_kernels` is the same algorithm in kernels.

Sources: damped Gauss-Newton steps on the residuals of all regions at once [17, 22].
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.poses import cross_products
from rrtik_ompl.constraints.held_region import HeldRegion, Turning
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.model.goal_kind import into_range, roll_pitch_yaw
from rrtik_ompl.model.robot import PER_RADIAN, Robot, reach_of

# The damping of a Gauss-Newton step is DAMPING plus SHARE times the squared norm of the residual.
DAMPING = 1e-9
SHARE = 0.5
LARGEST_STEP = 0.5  # [rad] or [m] largest change of any joint in one step
STEPS = 60  # default number of steps of a projection
SMALL = 1e-12  # [rad] angles below this count as 0, for their axis is not determined
STEEPEST = 1e-3  # lower bound of the cosine of the pitch in divisions


def projected_rows(robot: Robot, constraints: HeldRegions, rows: Matrix, steps: int = STEPS) -> tuple[Matrix, Mask]:
    """Move configurations into all regions, inside the joint limits, by damped Gauss-Newton steps.

    Args:
        robot: The arm.
        constraints: The regions.
        rows: Configurations, shape (m, dof).
        steps: Largest number of steps.

    Returns:
        The configurations after the last step, shape (m, dof), and which are in all regions, shape (m,).
    """
    Q = np.array(rows, dtype=np.float64)
    there = np.zeros(len(rows), dtype=bool)

    for number in range(steps + 1):
        parts = [residual(robot, region, Q) for region in constraints.regions]
        error = np.concatenate([part[0] for part in parts], axis=1)
        J = np.concatenate([part[1] for part in parts], axis=1)
        square = np.vecdot(error, error)
        there = square == 0.0
        if there.all() or number == steps:
            break

        # A damped Gauss-Newton step, shortened to LARGEST_STEP and kept within the limits.
        pull = np.einsum("mkn,mk->mn", J, error)
        damped = np.swapaxes(J, 1, 2) @ J + (DAMPING + SHARE * square)[:, None, None] * np.eye(robot.dof)
        change = np.linalg.solve(damped, pull[..., None])[..., 0]
        change *= LARGEST_STEP / np.maximum(np.abs(change).max(axis=1, keepdims=True), LARGEST_STEP)
        Q = np.where(there[:, None], Q, robot.clamp(Q + change))

    return Q, there


def residual(robot: Robot, region: HeldRegion, Q: Matrix) -> tuple[Matrix, NDArray[np.float64]]:
    """Compute the residual that moves a frame into a region, a little beyond its boundary, and its Jacobian.

    Args:
        robot: The arm.
        region: The region.
        Q: Configurations, shape (m, dof).

    Returns:
        Residual without unit, shape (m, 6): three numbers for the position, three for the orientation, 0 where the
            region is kept. Jacobian, shape (m, 6, dof).
    """
    D = region.displacements(Q)
    measures = region.measures(Q)
    moves = measures > region.accepted
    J = twists(robot, region, Q)

    away = D[:, :3, 3] - np.clip(D[:, :3, 3], *region.region.bounds[:3].T)
    share = 1.0 - region.aimed[0] / np.where(moves[:, 0], measures[:, 0], 1.0)
    shifted = (moves[:, :1] & (away != 0.0)) / reach_of(robot)
    turn, felt, counted = _turn(region, D[:, :3, :3], measures[:, 1], J[:, 3:])

    weights = np.hstack([shifted, counted * moves[:, 1:] * PER_RADIAN])
    error = np.hstack([-away * share[:, None], turn]) * weights
    return error, np.concatenate([J[:, :3], felt], axis=1) * weights[:, :, None]


def twists(robot: Robot, region: HeldRegion, Q: Matrix) -> NDArray[np.float64]:
    """Compute the geometric Jacobians of the displacement in the region's axes, shape (m, 6, dof)."""
    poses, J = robot.fk_jacobian_batch(Q, region.link)
    origin = (region.T_world_w @ region.displacements(Q))[:, :3, 3]
    lever = np.repeat(origin - poses[:, :3, 3], robot.dof, axis=0)
    turned = cross_products(np.swapaxes(J[:, 3:], 1, 2).reshape(-1, 3), lever)
    J[:, :3] += np.swapaxes(turned.reshape(len(Q), robot.dof, 3), 1, 2)
    R = region.T_w_world[:3, :3]
    return np.concatenate([R @ J[:, :3], R @ J[:, 3:]], axis=1)


def _turn(
    region: HeldRegion, R: NDArray[np.float64], measure: Vector, J: NDArray[np.float64]
) -> tuple[Matrix, NDArray[np.float64], Matrix]:
    """Compute the rotation into the region and the derivative that belongs to it.

    Args:
        region: The region.
        R: Orientations of frame d in w, shape (m, 3, 3).
        measure: Measures of the orientation, shape (m,).
        J: Angular Jacobians in the region's axes, shape (m, 3, dof).

    Returns:
        Rotation vector, or changes of roll, pitch and yaw for RANGES [rad], shape (m, 3); its Jacobian, shape (m, 3,
        dof); 1 for each component that counts and 0 for others, shape (m, 3).
    """
    aimed = region.aimed[1]
    ones = np.ones((len(R), 3))
    if region.turning == Turning.FREE:
        return 0.0 * ones, J, 0.0 * ones

    if region.turning == Turning.RANGES:
        angles = roll_pitch_yaw(R)
        away = angles - into_range(angles, *region.region.bounds[3:].T)
        away -= TAU * np.round(away / TAU)
        away[np.abs(away) < SMALL] = 0.0
        share = 1.0 - aimed / np.where(measure > 0.0, measure, 1.0)
        return -away * share[:, None], rates(R) @ J, (away != 0.0).astype(np.float64)

    if region.turning == Turning.AXIS:
        z = R[:, :, 2]
        axis = cross_products(z, np.tile(region.direction, (len(z), 1)))
        cosine = z @ region.direction
        J = J - z[:, :, None] * np.einsum("mi,mik->mk", z, J)[:, None]
    else:
        axis = 0.5 * np.column_stack([R[:, 1, 2] - R[:, 2, 1], R[:, 2, 0] - R[:, 0, 2], R[:, 0, 1] - R[:, 1, 0]])
        cosine = 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)

    # If the angle is 0 or a half turn, the axis is not determined and replaced by any other one.
    sine = np.linalg.norm(axis, axis=1)
    known = sine >= SMALL
    axis = np.where(known[:, None], axis / np.where(known, sine, 1.0)[:, None], R[:, :, 0])
    return axis * (np.arctan2(sine, cosine) - aimed)[:, None], J, ones


def rates(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the matrices that map angular velocities to rates of roll, pitch and yaw, shape (m, 3, 3)."""
    a = R[:, 0, 0]
    b = R[:, 1, 0]
    level = np.maximum(np.hypot(a, b), STEEPEST)
    a = a / level
    b = b / level
    sine = -R[:, 2, 0]
    zero = np.zeros(len(R))

    roll = np.stack([a / level, b / level, zero])
    yaw = np.stack([sine * roll[0], sine * roll[1], zero + 1.0])
    return np.moveaxis(np.stack([roll, np.stack([-b, a, zero]), yaw]), 2, 0)


DRAWN = 64  # number of random configurations that are projected into the regions


def contradiction(robot: Robot, constraints: HeldRegions) -> str:
    """Search for path constraints that no configuration keeps and return a line about them; "" if there are none.

    Random configurations are projected into each region alone, then into each pair of regions. A failure of all of them
    suggests that a region is out of reach or that the pair contradicts itself, but is no proof.
    """
    rows = np.random.default_rng(0).uniform(*robot.finite_range(), (DRAWN, robot.dof))
    each_alone = [HeldRegions((region,)) for region in constraints.regions]

    for one in each_alone:
        if not projected_rows(robot, one, rows)[1].any():
            return f"no configuration was found that keeps {one.regions[0].label}: is its region in reach?"

    for one, other in combinations(each_alone, 2):
        both = HeldRegions((*one.regions, *other.regions))
        moved, there = projected_rows(robot, both, rows)
        if there.any():
            continue

        # Report by how much the second region is missed at least where the first one is kept.
        near, _ = projected_rows(robot, one, moved)
        left = [other.regions[0].outside(q) for q in near[one.held(near)]]
        if left:
            metres, angle = min(left, key=lambda each: each[0] + each[1])
            amounts = [(1e3 * metres, "mm"), (np.degrees(angle), "degrees")]
            away = " and ".join(f"{amount:.3g} {unit}" for amount, unit in amounts if amount > 0.0)
            first, second = (each.regions[0].label for each in (one, other))
            return (
                f"no configuration was found that keeps both {first} and {second}: where the first is kept, the other "
                f"is missed by {away} at least; do they contradict each other?"
            )

    return ""

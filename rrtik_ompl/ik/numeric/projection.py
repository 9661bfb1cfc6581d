"""Projection onto task-space regions: each step moves towards the pose of the region that is nearest to the tip now.

Directions that the region leaves free do not constrain the joints, so arms with fewer joints than a pose needs fit too.

Sources: [23] for steps that leave free directions out; damping after [22], as in
`rrtik_ompl.kernels.reference.descent`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.poses import rpy_matrices
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse
from rrtik_ompl.ik.residual import SHARE, shortened, twist_between
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import PER_RADIAN, Robot, jacobians, poses, reach_of

ITERATIONS = 60
PATIENCE = 10  # iterations in which the squared residual has to fall to the share STALLED, or a row is given up
STALLED = 0.5
DAMPING = 1e-6  # constant part of the damping, in units of the squared residual (1 is the reach)
LARGEST_STEP = 0.5  # largest step of any joint in one iteration [rad or m]
STARTS = 32  # starts in one round
MAX_ROUNDS = 16  # largest number of rounds, but at least one for each region


def project(robot: Robot, region: TaskRegion, starts: Matrix, *, places: Matrix | None = None) -> Matrix:
    """Move configurations onto a region, each from its own start, inside the joint limits.

    Args:
        robot: The arm.
        region: The region for the tip.
        starts: Configurations to start from, shape (m, dof).
        places: Position within the region that each row has to reach [m], shape (m, 3), where angles stay as free as
            the region leaves them; rows of NaN, or None, where any position of the region will do.

    Returns:
        The last configuration of each start, in the region or not, shape (m, dof).
    """
    Q = robot.clamp(starts)
    going = np.arange(len(starts))  # rows that have neither arrived nor been given up
    places = np.full((len(Q), 3), np.nan) if places is None else places
    scale = np.repeat([1.0 / reach_of(robot), PER_RADIAN], 3)[:, None]
    error_at_last_check = np.full(len(Q), np.inf)  # squared residuals

    for step in range(ITERATIONS):
        # The nearest pose of the region, or the one at the wanted place, and the twist that leads there.
        tips = poses(robot, Q[going])
        aims = region.nearest(tips)
        slides = np.isnan(places[going, 0])
        aims[:, :3] = np.where(slides[:, None], aims[:, :3], places[going])
        ends = region.poses(aims)
        twist = twist_between(tips, ends[:, :3, :3], ends[:, :3, 3])
        squared_error = ((twist * scale[:, 0]) ** 2).sum(axis=1)

        # Drop rows that have arrived or stalled.
        goes_on = ~_arrived(region, twist)
        if step % PATIENCE == 0:
            goes_on &= squared_error <= STALLED * error_at_last_check[going]
            error_at_last_check[going] = squared_error
        going = going[goes_on]
        aims = aims[goes_on]
        twist = twist[goes_on]
        squared_error = squared_error[goes_on]
        if len(going) == 0:
            break

        # A damped step along the directions that the region holds.
        held_directions = _projectors_onto_held(region, aims, scale, slides[goes_on])
        J = held_directions @ (jacobians(robot, Q[going]) * scale)
        Q[going] = robot.clamp(Q[going] + _step(J, held_directions @ (twist[:, :, None] * scale), squared_error))

    return Q


def projected(robot: Robot, region: TaskRegion, starts: Matrix, rng: np.random.Generator) -> Matrix:
    """Move configurations onto a region as `project`, every second row to a random place in it.

    Without these places all rows would end on the boundary of the region, where they enter it.

    Returns:
        The last configuration of each start, in the region or not, shape (m, dof).
    """
    places = region.drawn(len(starts), rng)[:, :3]
    places[::2] = np.nan
    return project(robot, region, starts, places=places)


def projection(request: IkRequest) -> IkResponse:
    """Solve a request by projecting random configurations onto the parts of the goal, one part in each round."""
    robot = request.robot
    rng = request.rng
    regions = [part.region() for part in request.goal.parts]
    found = np.zeros((0, robot.dof))
    nearest = request.near
    least_distance = np.inf
    timed_out = False

    for number in range(max(MAX_ROUNDS, len(regions))):
        region = regions[number % len(regions)]
        starts = rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
        starts[0] = request.near
        rows = projected(robot, region, starts, rng)
        distance = region.distance(robot, rows)
        if distance.min() < least_distance:
            nearest = rows[distance.argmin()]
            least_distance = distance.min()

        found = np.vstack([found, rows[region.satisfied(robot, rows)]])
        if request.accept(found).any() and not request.all:
            break
        timed_out = request.budget.over()
        if timed_out:
            break

    return IkResponse(found, nearest, number + 1, timed_out)


def _arrived(region: TaskRegion, twist: Matrix) -> Mask:
    """Check which twists, shape (m, 6), are within a hundredth of the region's tolerances; shape (m,)."""
    position = np.linalg.norm(twist[:, :3], axis=1)
    angle = np.linalg.norm(twist[:, 3:], axis=1)
    arrived: Mask = (position <= SHARE * region.position_tolerance) & (angle <= SHARE * region.orientation_tolerance)
    return arrived


def _projectors_onto_held(region: TaskRegion, aims: Matrix, scale: Matrix, slides: Mask) -> NDArray[np.float64]:
    """Return projectors of scaled twists of the tip onto the directions that the region holds, shape (m, 6, 6).

    A coordinate is free if it lies strictly inside its range or may turn fully; its twist is removed by the projector.

    Args:
        region: The region.
        aims: Coordinates of the wanted poses in the region, shape (m, 6) [m, rad].
        scale: Scale of each coordinate of a twist, shape (6, 1).
        slides: Whether the position of each row may be free, shape (m,).
    """
    low, high = region.bounds.T
    is_free = ((low < aims) & (aims < high)) | (high - low >= TAU) & region.free
    is_free[:, :3] &= slides[:, None]

    R = region.T_world_w.rotation
    tips = region.poses(aims)[:, :3, 3]
    levers = tips - (region.T_world_w.translation + aims[:, :3] @ R.T)
    # The axes of pitch and roll are turned by the angles that are applied after them.
    pitched = rpy_matrices(aims[:, 3:] * [0, 0, 1])[:, :, 1]
    rolled = rpy_matrices(aims[:, 3:] * [0, 1, 1])[:, :, 0]
    axes = np.stack([rolled, pitched, np.tile([0.0, 0.0, 1.0], (len(aims), 1))], axis=2)

    free_twists = np.zeros((len(aims), 6, 6))
    free_twists[:, :3, :3] = R
    free_twists[:, 3:, 3:] = R @ axes
    free_twists[:, :3, 3:] = np.cross(free_twists[:, 3:, 3:], levers[:, :, None], axis=1)
    free_twists = free_twists * scale * is_free[:, None, :]

    held: NDArray[np.float64] = np.eye(6) - free_twists @ np.linalg.pinv(free_twists)
    return held


def _step(J: NDArray[np.float64], e: NDArray[np.float64], square: Vector) -> Matrix:
    """Return the damped steps J^T (J J^T + (|e|^2 / 2 + DAMPING) I)^-1 e, shortened to `LARGEST_STEP`; shape (m, n).

    Args:
        J: Jacobians, shape (m, 6, n).
        e: Residuals, shape (m, 6, 1).
        square: Squared norms of the residuals, shape (m,).
    """
    damped = J @ np.swapaxes(J, 1, 2) + (0.5 * square + DAMPING)[:, None, None] * np.eye(6)
    return shortened((np.swapaxes(J, 1, 2) @ np.linalg.solve(damped, e))[..., 0], LARGEST_STEP)

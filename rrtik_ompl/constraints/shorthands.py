"""Constructors of common path constraints: task-space regions [17] of a frame of the arm, held along a whole path."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, dimensions, finite_array, not_negative, number_rows, positive
from rrtik_ompl.base.choices import FrameAxis
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.poses import PoseLike, rigid, turned_z, unit_vector
from rrtik_ompl.constraints.held_region import ANYWHERE
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot

LARGEST_TILT_DEG = 80.0
TURN_TOLERANCE = 1e-2  # [rad] largest tolerance of ranges of angles ...
RIM_SHARE = 0.5  # ... which is also at most this share of the smallest range


def upright(
    robot: Robot,
    axis: FrameAxis = "z",
    *,
    tolerance_deg: float = 5.0,
    frame: str | None = None,
    allowance_deg: float = 0.0,
) -> TaskRegion:
    """Keep an axis of a frame within an angle of the direction in the world that it has at the start of the path.

    Rotations about the axis and the position are free. A cup that starts upside down has to stay so.

    Args:
        robot: The arm.
        axis: "x", "y" or "z" of the frame.
        tolerance_deg: Largest angle [deg], at most 80.
        frame: A link or an attached object; the robot's tip if None.
        allowance_deg: How far motions may exceed the tolerance between the waypoints of a path [deg].

    Raises:
        InputError: If there is no such axis, or the tolerance is out of range.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> robot = rrtik.load_robot("ur5")
        >>> start, goal = [0.0, -1.5, 1.5, -1.57, -1.57, 0.0], [1.0, -1.5, 1.5, -1.57, -1.57, 0.0]
        >>> problem = rrtik.Problem(rrtik.World(robot), start, goal, constraints=[rrtik.constraints.upright(robot)])
        >>> rrtik.plan(problem, seed=1).found
        True
    """
    require(robot, Robot, "robot of a path constraint", "use load_robot(name)")
    require(axis, str, "upright: axis")
    if axis not in ("x", "y", "z"):
        raise InputError(f"upright: axis must be x, y or z, got {axis!r}")

    tolerance = _tilt(tolerance_deg, "upright: tolerance_deg")
    T_frame_w = pin.SE3(turned_z(np.eye(3)["xyz".index(axis)]), np.zeros(3))
    bounds = _anywhere()
    bounds[3:5] = 0.0

    return TaskRegion(
        T_frame_w,
        bounds,
        T_frame_w.inverse(),
        orientation_tolerance=tolerance,
        frame=frame,
        from_start=True,
        orientation_allowance=np.radians(not_negative(allowance_deg, "upright: allowance_deg")),
    )


def on_plane(
    point: ArrayLike,
    normal: ArrayLike,
    *,
    tolerance: float = 1e-3,
    frame: str | None = None,
    allowance: float = 0.0,
) -> TaskRegion:
    """Keep the origin of a frame on a plane of the world, with free orientation.

    Args:
        point: A point of the plane [m], shape (3,).
        normal: Unit normal, shape (3,).
        tolerance: Largest distance from the plane [m].
        frame: A link or an attached object; the robot's tip if None.
        allowance: How far motions may exceed the tolerance between the waypoints of a path [m].

    Raises:
        InputError: If the normal is not of length 1, or the tolerance is not positive.

    Example:
        >>> table = rrtik.constraints.on_plane([0, 0, 0.3], [0, 0, 1], tolerance=0.002)
    """
    bounds = _anywhere()
    bounds[2] = 0.0
    placed = _placed(point, normal, "on_plane", "normal")
    return TaskRegion(placed, bounds, position_tolerance=tolerance, frame=frame, position_allowance=allowance)


def on_line(
    point: ArrayLike,
    direction: ArrayLike,
    *,
    tolerance: float = 1e-3,
    frame: str | None = None,
    allowance: float = 0.0,
) -> TaskRegion:
    """Keep the origin of a frame on a straight line of the world, with free orientation.

    Args:
        point: A point of the line [m], shape (3,).
        direction: Unit vector, shape (3,).
        tolerance: Largest distance from the line [m].
        frame: A link or an attached object; the robot's tip if None.
        allowance: How far motions may exceed the tolerance between the waypoints of a path [m].

    Raises:
        InputError: If the direction is not of length 1, or the tolerance is not positive.

    Example:
        >>> rail = rrtik.constraints.on_line([0.5, 0, 0.3], [0, 1, 0])
    """
    bounds = _anywhere()
    bounds[:2] = 0.0  # x and y: the line is the z axis of the region
    placed = _placed(point, direction, "on_line", "direction")
    return TaskRegion(placed, bounds, position_tolerance=tolerance, frame=frame, position_allowance=allowance)


def orientation_of(
    pose: PoseLike, tolerances_deg: ArrayLike = 1.0, *, frame: str | None = None, allowance_deg: float = 0.0
) -> TaskRegion:
    """Keep the orientation of a frame, with free position.

    Args:
        pose: ``pinocchio.SE3`` or a matrix of shape (4, 4) whose orientation is kept.
        tolerances_deg: Largest angle from it [deg]; or three, of roll, pitch and yaw about its axes, shape (3,). A 0
            among three is kept to 0.57 degrees, or to half of the smallest other one if that is less.
        frame: A link or an attached object; the robot's tip if None.
        allowance_deg: How far motions may exceed the tolerance between the waypoints of a path [deg].

    Raises:
        InputError: If ``pose`` is not a pose, or a tolerance is negative or too large.

    Example:
        >>> robot = rrtik.load_robot("ur5")
        >>> level = rrtik.constraints.orientation_of(robot.fk([0.0, -1.5, 1.5, -1.57, -1.57, 0.0]), 2.0)
    """
    number_rows(tolerances_deg, "orientation_of: tolerances_deg")
    bounds = _anywhere()
    bounds[3:] = 0.0
    placed = rigid(pose, "orientation_of: pose")
    allowance = np.radians(not_negative(allowance_deg, "orientation_of: allowance_deg"))

    if dimensions(tolerances_deg) == 0:
        tolerance = _tilt(tolerances_deg, "orientation_of: tolerances_deg")
        return TaskRegion(placed, bounds, orientation_tolerance=tolerance, frame=frame, orientation_allowance=allowance)

    angles = finite_array(tolerances_deg, (3,), "orientation_of: tolerances_deg")
    if (angles < 0.0).any():
        raise InputError(f"orientation_of: tolerances_deg must not be negative, got {angles.tolist()}")

    turns = np.radians(np.minimum(angles, 180.0))
    bounded = turns[(turns > 0.0) & (turns < np.pi)]
    # The region's own tolerance is taken from inside the given angles, so that these are not exceeded.
    rim = min(TURN_TOLERANCE, RIM_SHARE * bounded.min(initial=np.pi))
    turns = np.where((turns > 0.0) & (turns < np.pi), turns - rim, turns)
    bounds[3:] = turns[:, None] * [-1.0, 1.0]
    return TaskRegion(placed, bounds, orientation_tolerance=rim, frame=frame, orientation_allowance=allowance)


def inside(
    pose: PoseLike, sides: ArrayLike, *, tolerance: float = 1e-3, frame: str | None = None, allowance: float = 0.0
) -> TaskRegion:
    """Keep the origin of a frame inside a box of the world, with free orientation.

    Args:
        pose: Pose of the box's centre, ``pinocchio.SE3`` or a matrix of shape (4, 4).
        sides: Full side lengths [m], shape (3,).
        tolerance: Largest distance from the box [m].
        frame: A link or an attached object; the robot's tip if None.
        allowance: How far motions may exceed the tolerance between the waypoints of a path [m].

    Raises:
        InputError: If ``pose`` is not a pose, a side is negative, or the tolerance is not positive.

    Example:
        >>> fence = rrtik.constraints.inside(rrtik.pose([0.4, 0, 0.4]), [0.4, 0.8, 0.6])
    """
    lengths = finite_array(sides, (3,), "inside: sides")
    if (lengths < 0.0).any():
        raise InputError(f"inside: sides must not be negative, got {lengths.tolist()}")

    bounds = _anywhere()
    bounds[:3] = 0.5 * lengths[:, None] * [-1.0, 1.0]
    return TaskRegion(
        rigid(pose, "inside: pose"), bounds, position_tolerance=tolerance, frame=frame, position_allowance=allowance
    )


def _anywhere() -> Matrix:
    """Return bounds of a region that constrains nothing, shape (6, 2) [m; rad]."""
    return np.outer([ANYWHERE] * 3 + [np.pi] * 3, [-1.0, 1.0])


def _tilt(degrees: ArrayLike, what: str) -> float:
    """Validate an angle [deg] of at most ``LARGEST_TILT_DEG`` and convert it to radians."""
    tilt = positive(degrees, what)
    if tilt > LARGEST_TILT_DEG:
        raise InputError(f"{what} must be {LARGEST_TILT_DEG:g} or less, got {tilt:g}")
    return float(np.radians(tilt))


def _placed(point: ArrayLike, direction: ArrayLike, caller: str, what: str) -> pin.SE3:
    """Return a frame whose origin is a point and whose z axis is a direction."""
    R = turned_z(unit_vector(direction, f"{caller}: {what}"))
    return pin.SE3(R, finite_array(point, (3,), f"{caller}: point"))

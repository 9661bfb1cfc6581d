"""Conversion of constraints in MoveIt's messages to goals and regions.

A region is never larger than its message says.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.held_region import ANYWHERE
from rrtik_ompl.model.goal import Goal, PoseGoal, PositionGoal
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.problem_files.moveit_messages import Constraints, OrientationConstraint, PositionConstraint
from rrtik_ompl.problem_files.moveit_scene import Frames

FREE = np.pi - 2e-3  # [rad] from this tolerance on an axis is free, so that 3.14 is enough
LARGEST = np.radians(80.0)  # [rad] greatest tolerance of an axis that is not free
# [m] A box becomes smaller by this rim, which is the tolerance of its region. The rim is at most half the least half
# side.
RIM = 1e-3


def tip_goal(wanted: Constraints, frames: Frames) -> Goal:
    """Return the goal of one link: a position, and an orientation if there is one.

    Raises:
        InputError: If there is not exactly one position, a frame is unknown, or the constraints are not supported.
    """
    if len(wanted.position_constraints) != 1 or len(wanted.orientation_constraints) > 1 or wanted.joint_constraints:
        raise InputError("goal: give joint_constraints, or one position and at most one orientation constraint")

    place = wanted.position_constraints[0]
    turn = next(iter(wanted.orientation_constraints), None)
    if turn is not None and turn.link_name != place.link_name:
        raise InputError(f"goal: constraints on two links, '{place.link_name}' and '{turn.link_name}'; give one link")

    solid, _ = place.volume()
    ranges, angle = (None, 0.0) if turn is None else _angles(turn)

    # Simple goals need no region.
    if solid.type == "sphere" and not any(place.offset):
        centre = _placed(place, frames).translation
        radius = solid.dimensions[0]
        if turn is None or ranges is None:
            return PositionGoal(centre, radius)
        if not ranges.any():
            return PoseGoal(pin.SE3(_oriented(turn, frames), centre), radius, angle)

    return _goal_region(place, turn, frames)


def held_regions_of(wanted: Constraints, frames: Frames) -> list[TaskRegion]:
    """Return the regions of path constraints, one for each position and each orientation constraint.

    Raises:
        InputError: If a frame is unknown or moves with the arm, or the constraints are not supported.
    """
    headers = [each.header for each in wanted.position_constraints]
    for header in [*headers, *(each.header for each in wanted.orientation_constraints)]:
        if frames.moves(header.frame_id):
            raise InputError(
                f"path_constraints: frame '{header.frame_id}' moves with the arm; give them in a frame that stands"
            )

    regions = []
    # Positions, with free orientation.
    for place in wanted.position_constraints:
        bounds, tolerance = _sides(place)
        offset = pin.SE3(np.eye(3), -np.array(place.offset))
        region = TaskRegion(_placed(place, frames), _bounds(bounds, None), offset, tolerance, frame=place.link_name)
        regions.append(region)

    # Orientations, with free position.
    for turn in wanted.orientation_constraints:
        ranges, angle = _angles(turn, ranged=True)
        if ranges is None:
            continue
        anywhere = np.outer([ANYWHERE] * 3, [-1.0, 1.0])
        T_world_w = pin.SE3(_oriented(turn, frames), np.zeros(3))
        bounds = _bounds(anywhere, ranges)
        regions.append(TaskRegion(T_world_w, bounds, orientation_tolerance=angle, frame=turn.link_name))

    return regions


def _goal_region(place: PositionConstraint, turn: OrientationConstraint | None, frames: Frames) -> TaskRegion:
    """Return a goal that needs a region: a box, a point off the link's origin, or a free axis.

    Args:
        place: Position constraint of the link.
        turn: Orientation constraint of the same link, or None.
        frames: Frames that the constraints refer to.
    """
    box = _placed(place, frames)
    bounds, tolerance = _sides(place)
    offset = -np.array(place.offset)
    ranges, angle = (None, 1e-2) if turn is None else _angles(turn)

    if turn is None or ranges is None:
        return TaskRegion(box, _bounds(bounds, None), pin.SE3(np.eye(3), offset), tolerance, angle or 1e-2)

    if offset.any():
        raise InputError("goal: a target_point_offset together with an orientation is not read; give the link's origin")
    R = _oriented(turn, frames)

    if not bounds.any():  # a sphere has no axes, so those of the orientation are used
        T_world_w = pin.SE3(R, box.translation)
        return TaskRegion(T_world_w, _bounds(bounds, ranges), pin.SE3.Identity(), tolerance, angle)

    if ranges.any():
        raise InputError("goal: a box together with an axis that is free is not read; give a sphere, or no free axis")

    T_w_tip = pin.SE3(box.rotation.T @ R, np.zeros(3))
    return TaskRegion(box, _bounds(bounds, ranges), T_w_tip, tolerance, angle)


def _placed(place: PositionConstraint, frames: Frames) -> pin.SE3:
    """Return the pose of the volume of a position constraint in the world."""
    return frames.pose(place.header.frame_id) * place.volume()[1]


def _oriented(turn: OrientationConstraint, frames: Frames) -> Matrix:
    """Return the wanted orientation in the world, shape (3, 3)."""
    rotation: Matrix = frames.pose(turn.header.frame_id).rotation @ turn.build_rotation()
    return rotation


def _sides(place: PositionConstraint) -> tuple[Matrix, float]:
    """Return bounds of a position in the frame of its volume, shape (3, 2) [m], and its tolerance [m]."""
    solid, _ = place.volume()
    if solid.type == "sphere":
        return np.zeros((3, 2)), solid.dimensions[0]
    half = 0.5 * np.array(solid.dimensions)
    rim = min(RIM, 0.5 * float(half.min()))
    return (half - rim)[:, None] * [-1.0, 1.0], rim


def _bounds(place: Matrix, angles: Matrix | None) -> Matrix:
    """Return bounds of a region, shape (6, 2), from those of position and angles; all angles are free if None."""
    free = np.outer([np.pi] * 3, [-1.0, 1.0])
    return np.vstack([place, free if angles is None else angles])


def _angles(turn: OrientationConstraint, *, ranged: bool = False) -> tuple[Matrix | None, float]:
    """Return ranges of roll, pitch and yaw, and the tolerance of the orientation.

    One axis whose tolerance is pi or more is free: the frame may turn about it. With ``ranged``, if the tolerance of x
    or z is larger than both others, the frame may turn about that axis by the difference.

    Returns:
        Ranges, shape (3, 2) [rad], or None if all angles are free; and the angle within which the frame must be near
        one of the orientations in the ranges [rad].
    """
    tolerances = np.array(turn.tolerances)
    free = tolerances >= FREE
    if free.all():
        return None, 0.0
    if free.sum() == 2:
        raise InputError("orientation_constraints: two axes that are free are not read; leave one free, or all")

    ranges = np.zeros((3, 2))
    widest = int(np.argmax(tolerances))
    others = float(np.delete(tolerances, widest).min())

    # The length of a rotation vector can exceed the tilt of the frame by a factor of up to pi / 2.
    least = others if turn.parameterization == 0 else others / (0.5 * np.pi)
    least = min(least, LARGEST)

    if free.any():
        ranges[widest] = -np.pi, np.pi
    elif ranged and widest != 1 and turn.parameterization == 0 and tolerances[widest] > 2.0 * least:
        ranges[widest] = (tolerances[widest] - least) * np.array([-1.0, 1.0])
    else:
        # The angle of the rotation bounds its components in both parameterizations.
        least = min(others, LARGEST)

    return ranges, least

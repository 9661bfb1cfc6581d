"""Parameterise paths by time: from a path and limits compute a trajectory that keeps the limits everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, bounded_array, not_negative
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.kernels.threads import in_threads
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot, require_joints
from rrtik_ompl.motion.trajectory.blending import blended, fault_finder, joined, stops_at_corners
from rrtik_ompl.motion.trajectory.corners import Polyline, vertices
from rrtik_ompl.motion.trajectory.cubics import Peaks, State
from rrtik_ompl.motion.trajectory.dynamics import DynamicLimits
from rrtik_ompl.motion.trajectory.limits import RateLimits, limits_of
from rrtik_ompl.motion.trajectory.motion import Trajectory
from rrtik_ompl.motion.trajectory.report import MotionReport
from rrtik_ompl.world.clearances import check_route_clearance
from rrtik_ompl.world.world import World

__all__ = [
    "MotionReport",
    "Peaks",
    "RateLimits",
    "State",
    "Trajectory",
    "time_parameterize",
    "time_parameterize_many",
]


def time_parameterize(
    path: JointPath,
    limits: RateLimits | Robot,
    *,
    blend: float = 0.0,
    world: World | None = None,
    clearance: float | None = None,
    tip_speed: float | None = None,
    tip_acceleration: float | None = None,
    torque: ArrayLike | bool | None = None,
    payload: float = 0.0,
) -> Trajectory:
    """Compute a trajectory along a path: as fast as the limits allow, from rest to rest.

    Without ``blend`` the motion stays on the path to 1e-9 and stops at every corner; between two corners it has the
    shortest time under velocity, acceleration and jerk limits [21]. So the single-joint moves of a path are made one
    after the other, and what was checked of the path holds for the motion.

    With ``blend`` corners are rounded and passed without a stop, as fast as the limits allow [19]. The motion then
    leaves the path by at most 0.22 of ``blend``. Its acceleration never jumps, even without jerk limits. Where it
    leaves the path, it is proven free if the path can be proven, and checked in steps otherwise;
    :meth:`Trajectory.prove` proves the whole motion anew. Waypoints nearer to each other than 0.02 of ``blend`` are
    merged, so that many of them become one smooth curve, and no piece of such a curve is shorter than 1 ms. A corner
    that cannot be rounded is a stop; if rounding does not make the motion faster, no corner is rounded.

    Args:
        path: A valid path. Waypoints that coincide or lie on a line do not count as corners.
        limits: The limits, or a robot whose limits are taken (see :meth:`RateLimits.of` for limits that it does not
            have).
        blend: Largest distance of a corner from the beginning of its rounding [rad or m]; 0 keeps to the path.
        world: The world that a blended motion must not collide with; required for a blend.
        clearance: Distance that a blended motion keeps from every obstacle in addition to its margin [m], if the path
            keeps it. None: 1 mm, or what the ends of the path have.
        tip_speed: Largest speed of the tip's origin [m/s]. Limits of the tip and of torques need a robot: pass it as
            ``limits``, or a world.
        tip_acceleration: Largest acceleration of the tip's origin [m/s^2].
        torque: Largest torques, one number or one per joint [N m; N for sliding joints], by rigid-body dynamics; True
            for the efforts of the robot's description.
        payload: Mass at the tip's origin that the torques have to carry too [kg].

    Returns:
        A motion whose largest velocity, acceleration and jerk are within the limits everywhere (to 1e-9 of them), not
        at samples: see :meth:`Trajectory.peaks`. Limits of the tip and of torques are kept at the knots, and to 0.1 %
        between them.

    Raises:
        InputError: If the path has one waypoint, does not move, has another number of joints than the limits, or moves
            other joints than the robot (of the limits or the world), or these in another order; if the blend is
            negative or comes without a world, the clearance is negative or more than an end of the path can keep, or
            the arm cannot be held still within the torques.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> path = rrtik.plan(problem).path
        >>> stops = rrtik.time_parameterize(path, rrtik.RateLimits(1.0, 2.0, 20.0))
        >>> smooth = rrtik.time_parameterize(path, rrtik.RateLimits(1.0, 2.0, 20.0), blend=0.05, world=problem.world)
        >>> smooth.duration < stops.duration
        True
    """
    require(path, JointPath, "path to time", "a plan has one if plan.found")
    require(world, World | None, "world", "use World(robot, scene)")
    bounds = limits_of(limits) if isinstance(limits, Robot) else limits
    require(bounds, RateLimits, "limits of a path to time", "use RateLimits.of(robot)")
    bounds = bounds.for_joints(path.waypoints.shape[1])

    arms = [limits] if isinstance(limits, Robot) else []
    if world is not None:
        arms.append(world.robot)
    for each in arms:
        require_joints(each, path.joint_names, "path")

    line = Polyline.of(_corners(path))
    reach = float(bounded_array(blend, (), "blend"))
    if reach < 0.0:
        raise InputError(f"blend must be 0 or greater, got {reach:g}")
    if clearance is not None:
        not_negative(clearance, "clearance")

    arm = arms[0] if arms else None
    wanted = (tip_speed, tip_acceleration, torque, not_negative(payload, "payload") or None)
    more = None
    if any(option is not None for option in wanted):
        more = DynamicLimits.of(
            arm, tip_speed=tip_speed, tip_acceleration=tip_acceleration, torque=torque, payload=payload
        )

    if reach > 0.0:
        if world is None:
            raise InputError(
                "a path with rounded corners leaves the checked one: pass world=problem.world, to check it"
            )
        check_route_clearance(world, clearance, path)

    stopping = stops_at_corners(line, bounds, more)
    if world is not None and reach > 0.0 and len(line.vertices) > 2:
        faults = fault_finder(path, world, clearance)
        slowest = sum(run.duration for run in stopping)
        rounded = blended(path, line, bounds, reach, slowest, faults, more)
        if rounded is not None:
            return rounded
    return joined(stopping, path, bounds)


def time_parameterize_many(
    paths: Iterable[JointPath],
    limits: RateLimits | Robot,
    *,
    blend: float = 0.0,
    world: World | Sequence[World] | None = None,
    clearance: float | None = None,
    tip_speed: float | None = None,
    tip_acceleration: float | None = None,
    torque: ArrayLike | bool | None = None,
    payload: float = 0.0,
    threads: int | None = None,
) -> list[Trajectory]:
    """Compute the trajectories along many paths, each as :func:`time_parameterize` computes it, to the bit.

    Kernels of several threads run side by side; what is computed in Python takes turns.

    Args:
        paths: The paths.
        limits: As there, for all of them.
        blend: As there.
        world: As there, for all of them, or one for each path.
        clearance: As there.
        tip_speed: As there.
        tip_acceleration: As there.
        torque: As there.
        payload: As there.
        threads: Number of paths at a time; None for the number of cores.

    Returns:
        One trajectory for each path, in their order.

    Raises:
        InputError: As there, with the number of the path; if there is not one world for each path.

    Example:
        >>> world = rrtik.load_problem("planar3_boxes").world
        >>> plans = rrtik.plan_many(world, np.zeros(3), [[0.3, 0.0, 0.2], [0.0, 0.2, 0.1]])
        >>> motions = rrtik.time_parameterize_many([plan.path for plan in plans], rrtik.RateLimits(1.0, 2.0, 20.0))
        >>> [round(motion.duration, 2) for motion in motions]
        [0.88, 0.74]
    """
    listed_paths = listed(paths, "paths to time")
    worlds = [world] * len(listed_paths) if isinstance(world, World | None) else listed(world, "worlds of paths")
    if len(worlds) != len(listed_paths):
        raise InputError(f"worlds of paths: expected one for each of {len(listed_paths)}, or one, got {len(worlds)}")

    def timed(number: int) -> Trajectory:
        try:
            return time_parameterize(
                listed_paths[number], limits, blend=blend, world=worlds[number], clearance=clearance,
                tip_speed=tip_speed, tip_acceleration=tip_acceleration, torque=torque, payload=payload,
            )  # fmt: skip
        except InputError as error:
            raise InputError(f"paths[{number}]: {error}") from None

    return in_threads(timed, range(len(listed_paths)), threads)


def _corners(path: JointPath) -> Matrix:
    """Return the vertices of a path, shape (k, n), k at least 2; raise an error if there is no motion to time."""
    if len(path.waypoints) < 2:
        raise InputError("path to time: it has one waypoint; a motion needs two or more")
    corners = vertices(path.waypoints)
    if len(corners) < 2:
        raise InputError("path to time: all its waypoints are the same; there is no motion to time")
    return corners

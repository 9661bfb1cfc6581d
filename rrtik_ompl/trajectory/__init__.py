"""Time parameterisation: a path and limits in, a trajectory out that keeps the limits everywhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector, finite_array
from rrtik_ompl.errors import InputError, require
from rrtik_ompl.path import JointPath
from rrtik_ompl.robot import Robot
from rrtik_ompl.trajectory.corners import Curve, rounding, runs, vertices
from rrtik_ompl.trajectory.curve import along_curve
from rrtik_ompl.trajectory.limits import RateLimits
from rrtik_ompl.trajectory.line import along_line
from rrtik_ompl.trajectory.load import load_trajectory
from rrtik_ompl.trajectory.motion import Peaks, State, Trajectory
from rrtik_ompl.trajectory.pieces import joined
from rrtik_ompl.world import World
from rrtik_ompl.world.kept_clearance import check_route_clearance, provable_clearances

__all__ = ["Peaks", "RateLimits", "State", "Trajectory", "load_trajectory", "time_parameterize"]

MAX_SLOWINGS = 10  # one is enough except for rounding errors in motions of very short phases
MAX_ROUNDINGS = 4  # attempts with smaller and smaller rounded corners, before none is rounded


def time_parameterize(
    path: JointPath,
    limits: RateLimits | Robot,
    *,
    blend: float = 0.0,
    world: World | None = None,
    clearance: float | None = None,
) -> Trajectory:
    """Give a path its times: as fast as the limits allow, beginning and ending at rest.

    Without ``blend`` the motion stays on the path to 1e-9 and stops at every corner; between two corners it has the
    shortest time under velocity, acceleration and jerk limits (by ruckig). So the single-joint moves of a path are made
    one after the other, and what was checked of the path holds for the motion.

    With ``blend`` corners are rounded and passed without a stop (by toppra). The motion then leaves the path by at most
    0.22 of ``blend``, obeys velocity and acceleration limits but no jerk limit where it passes rounded corners, and is
    itself proven free in the world, if the path is (:meth:`Trajectory.prove`), or else checked in steps; a corner that
    cannot be rounded is a stop, and where rounding makes nothing faster none is rounded.

    Args:
        path: A valid path. Waypoints that coincide or lie on a line are no corners.
        limits: Or a robot, whose limits are taken (see :meth:`RateLimits.of` for those that it does not have).
        blend: Largest distance of a corner from the beginning of its rounding [rad or m]; 0 keeps to the path.
        world: For a blend: what the rounded corners must not touch.
        clearance: What a blended motion keeps from every obstacle on top of its margin [m], if the path keeps it. None:
            1 mm, or what the ends of the path have.

    Returns:
        A motion whose largest velocity, acceleration and (where it stops at the corners) jerk are within the limits
        everywhere (to 1e-9 of them), not at samples: see :meth:`Trajectory.peaks`.

    Raises:
        InputError: If the path has one waypoint, does not move, or has another number of joints than the limits; if the
            blend is negative or comes without a world, or an end of the path cannot keep the clearance.
    """
    require(path, JointPath, "path to time", "a plan has one if plan.found")
    bounds = RateLimits.of(limits) if isinstance(limits, Robot) else limits
    require(bounds, RateLimits, "limits of a path to time", "use RateLimits.of(robot)")
    bounds = bounds.for_joints(path.waypoints.shape[1])
    corners = _corners(path)
    reach = float(finite_array(blend, (), "blend"))
    if reach < 0.0:
        raise InputError(f"blend must be 0 or greater, got {reach:g}")
    stopping = _timed(path, corners, np.zeros(len(corners) - 2), bounds)
    if reach == 0.0:
        return stopping
    if world is None:
        raise InputError("a path with rounded corners leaves the checked one: pass world=problem.world, to check it")
    require(world, World, "world of a path with rounded corners")
    check_route_clearance(world, clearance, path.waypoints)
    free = _free_test(path, world, clearance)
    rounded = rounding(corners, reach, world)
    for _ in range(MAX_ROUNDINGS):
        found = _timed(path, corners, rounded, bounds)
        if found.duration >= stopping.duration:
            return stopping
        if free(found):
            return found
        rounded *= 0.5
    return stopping


def _free_test(path: JointPath, world: World, clearance: float | None) -> Callable[[Trajectory], bool]:
    """What a motion has to pass: a proof of as much as the path itself is proven to keep, or a check in steps."""
    kept = next(provable_clearances(world, path.waypoints, clearance), None)
    if kept is None:
        return lambda motion: not motion.faults(world)
    return lambda motion: motion.prove(world, clearance=kept).proven


def _corners(path: JointPath) -> Matrix:
    """The vertices of a path that can be timed, shape (k, n), k at least 2."""
    if len(path.waypoints) < 2:
        raise InputError("path to time: it has one waypoint; a motion needs two or more")
    corners = vertices(path.waypoints)
    if len(corners) < 2:
        raise InputError("path to time: all its waypoints are the same; there is no motion to time")
    return corners


def _timed(path: JointPath, corners: Matrix, rounded: Vector, limits: RateLimits) -> Trajectory:
    """The motion along the runs, slowed where rounding errors or the grid let it exceed a limit."""
    parts = [
        along_curve(run, limits) if isinstance(run, Curve) else along_line(run[0], run[1], limits)
        for run in runs(corners, rounded)
    ]
    found = joined(parts, path)
    for _ in range(MAX_SLOWINGS):
        peaks = found.peaks()
        factor = limits.slowing(peaks.velocity, peaks.acceleration, None if rounded.any() else peaks.jerk)
        if factor == 1.0:
            break
        found = found.slowed(factor)
    return found

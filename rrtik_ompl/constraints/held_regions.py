"""Several regions held at once: checks of configurations and motions, and messages about violations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.constraints.held_region import HeldRegion, Turning, frame_place, held_region
from rrtik_ompl.model.goal import Goal
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene

HALVINGS = 7  # largest number of times that a motion is halved to show that it keeps a region
ROUNDING = 1e-9  # tolerance of measures
INSET = np.array([5e-4, np.radians(0.2)])  # [m; rad] largest inset of configurations in a region ...
INSET_SHARE = 0.45  # ... which is also at most this share of its tolerance
SMALLEST_STEP = 2e-4  # [rad or m] length of a motion that is not divided any further


class HeldRegions:
    """The path constraints of a problem.

    A configuration is held if its frames are in all regions, within their tolerances. A straight motion is held if all
    its configurations are; between its ends they may exceed the tolerances by the allowances of a region, which are 0
    by default. This is proven by the bound of :meth:`HeldRegion.deviations` on parts of the motion, not checked at
    samples.

    Attributes:
        regions: One or more prepared regions.
    """

    def __init__(self, regions: Iterable[HeldRegion]) -> None:
        self.regions = tuple(regions)

    def of_robot(self, robot: Robot) -> HeldRegions:
        """Return the same regions for the same arm with its joints scaled (another ``gain`` of its chain)."""
        return HeldRegions(replace(region, robot=robot) for region in self.regions)

    def held(self, Q: Matrix) -> Mask:
        """Return which configurations, shape (m, dof), are in all regions, shape (m,)."""
        mask = np.ones(len(Q), dtype=bool)
        for region in self.regions:
            mask &= (region.measures(Q) <= region.limits() + ROUNDING).all(axis=1)
        return mask

    def motions_held(self, A: Matrix, B: Matrix) -> Mask:
        """Return which straight motions A[k] -> B[k], shapes (m, dof), keep all regions, shape (m,)."""
        mask = np.ones(len(A), dtype=bool)
        for region in self.regions:
            both = region.measures(np.concatenate([A[mask], B[mask]])).reshape(2, -1, 2)
            mask[mask] = _keeps(region, A[mask], B[mask], both)
        return mask

    def route_held(self, rows: Matrix) -> Mask:
        """Return which motions between waypoints, shape (k, dof), keep all regions, shape (k - 1,)."""
        mask = np.ones(max(len(rows) - 1, 0), dtype=bool)
        for region in self.regions:
            measures = region.measures(rows)
            ends = np.stack([measures[:-1], measures[1:]])
            mask[mask] = _keeps(region, rows[:-1][mask], rows[1:][mask], ends[:, mask])
        return mask

    def explain(self, q: Vector) -> str:
        """Return a line that says by how much a configuration, shape (dof,), is outside a region; "" if it is held."""
        for region in self.regions:
            kept = region.measures(q[None])[0] <= region.limits() + ROUNDING
            if not kept.all():
                metres, angle = region.outside(q)
                amounts = [f"{1e3 * metres:.3g} mm"] * (not kept[0])
                amounts += [f"{np.degrees(angle):.3g} degrees"] * (not kept[1])
                return f"{region.label} (frame '{region.frame}'): {' and '.join(amounts)} outside"
        return ""

    def why(self, a: Vector, b: Vector) -> str:
        """Return a line that says why the motion from a to b, shapes (dof,), is not held."""
        between = ", ".join(f"'{region.frame}'" for region in self.regions)
        return self.explain(a) or self.explain(b) or f"it leaves the region of {between} in between"


def held_regions(robot: Robot, scene: Scene, regions: Iterable[TaskRegion], start: Vector | None) -> HeldRegions:
    """Prepare path constraints for a robot in a scene.

    Args:
        robot: The arm.
        scene: The scene, whose attached objects may carry a frame.
        regions: The regions to hold.
        start: Configuration at which regions ``from_start`` are placed, shape (dof,); None if none is.

    Raises:
        InputError: If one is not a region, names no existing frame, cannot be held, or is ``from_start`` without one.
    """
    prepared = []
    for number, region in enumerate(regions, 1):
        label = f"path constraint {number}"
        if not isinstance(region, TaskRegion):
            raise InputError(
                f"{label} must be a TaskRegion, got {type(region).__name__}; use upright, on_plane, on_line, "
                "orientation_of or inside"
            )
        prepared.append(_placed(robot, scene, region, label, start))
    return HeldRegions(prepared)


def _placed(robot: Robot, scene: Scene, region: TaskRegion, label: str, start: Vector | None) -> HeldRegion:
    """Prepare one region, placed in the world and with its inset.

    Args:
        robot: The arm.
        scene: The scene, whose attached objects may carry the frame.
        region: The region.
        label: Name of the region in messages.
        start: Configuration at which a region ``from_start`` is placed, shape (dof,).
    """
    if region.from_start:
        if start is None:
            raise InputError(
                f"{label} begins where a path does (from_start), and a world has no path; give it to a Problem, or "
                "place it with region.started_at(pose of its frame)"
            )
        _, joint, T_joint_frame = frame_place(robot, scene, region.frame, label)
        region = region.started_at(pin.SE3(robot.joint_frames(start)[0, joint]) * T_joint_frame)

    held = held_region(robot, scene, region, label)
    tolerance = region.orientation_tolerance
    # Beyond a right angle the sine, which measures the angle, decreases again.
    if held.turning != Turning.FREE and tolerance > 0.5 * np.pi:
        raise InputError(
            f"{label}: orientation_tolerance is {np.degrees(tolerance):g} degrees, and more than 90 cannot be held; "
            "take less, or leave the angles free"
        )

    if held.turning == Turning.RANGES and held.passage <= 0.0:
        raise InputError(
            f"{label}: roll or yaw may be anywhere but in a part of a turn that is no larger than twice the tolerance; "
            "leave the angle free, or take a narrower range"
        )

    inset = np.minimum(INSET, INSET_SHARE * held.tolerances)
    held = replace(held, inset=np.maximum(inset - held.allowances, 0.0))
    _refuse_too_narrow(held)
    return held


def _refuse_too_narrow(region: HeldRegion) -> None:
    """Refuse tolerances that even the smallest motions of all joints together would exceed."""
    # The needed tolerance is the bound for a motion of SMALLEST_STEP with all joints moving alike.
    dof = region.robot.dof
    step = np.full((1, dof), SMALLEST_STEP / np.sqrt(dof))
    needed = region.deviations(np.zeros((1, dof)), step)[0] / INSET_SHARE
    narrow = needed > region.limits(between=True)
    least = [f"{needed[0]:.1e} m"] * bool(narrow[0])
    least += [f"{np.degrees(region.angle_of(needed[1])):.1e} degrees"] * bool(narrow[1])

    if least:
        raise InputError(
            f"{region.label}: a tolerance so small cannot be kept along whole motions of robot "
            f"'{region.robot.name}'; {' and '.join(least)} is the least that can, or allow more between waypoints "
            f"(allowance)"
        )


def _keeps(region: HeldRegion, A: Matrix, B: Matrix, ends: NDArray[np.float64]) -> Mask:
    """Check which motions keep a region.

    A motion is kept if its ends are within the tolerances and the bound on its measures does not exceed the limits.
    Motions for which the bound is too large are halved repeatedly, which divides the bound's second-order term by four
    each time. They are given up when a node is outside or after ``HALVINGS``.

    Args:
        region: The region.
        A: Start configurations, shape (m, dof).
        B: End configurations, shape (m, dof).
        ends: Measures of both ends, shape (2, m, 2).

    Returns:
        Which motions are kept, shape (m,).
    """
    deviations = region.deviations(A, B)
    most = region.limits(between=True) + ROUNDING
    stored: Mask = np.logical_and.reduce(ends <= region.limits() + ROUNDING, axis=(0, 2))
    near: Mask = np.logical_and.reduce(_highest(ends[0], ends[1], deviations) <= most, axis=1)
    least_parts = region.least_parts(A, B)
    kept = stored & near & (least_parts < 1.0)
    open_ = np.flatnonzero(stored & ~kept)

    for level in range(1, HALVINGS + 1):
        if len(open_) == 0:
            break

        parts = 2**level
        rows = _nodes(A[open_], B[open_], parts)
        measures = region.measures(rows.reshape(-1, A.shape[1])).reshape(len(open_), parts + 1, 2)
        highest = _highest(measures[:, :-1], measures[:, 1:], deviations[open_, None] / parts**2)
        # A motion is kept if all its parts are, and is given up if a node is outside.
        done = (highest <= most).all(axis=(1, 2)) & (least_parts[open_] < parts)
        kept[open_[done]] = True
        open_ = open_[~done & (measures <= most).all(axis=(1, 2))]

    return kept


def _highest(
    first: NDArray[np.float64], last: NDArray[np.float64], deviation: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return upper bounds of the measures on motions, the maximum of a parabola above those at both ends.

    The bound is the maximum of ``first + t (last - first) + 4 t (1 - t) deviation`` for t in [0, 1].

    Args:
        first: Measures at the start of each motion.
        last: Measures at its end.
        deviation: Bounds of :meth:`HeldRegion.deviations`; the shapes of all three broadcast.
    """
    way = last - first
    inner = np.abs(way) < 4.0 * deviation
    divisor = np.where(inner, 16.0 * deviation, 1.0)
    bent = 0.5 * (first + last) + deviation + way * way / divisor
    highest: NDArray[np.float64] = np.where(inner, bent, np.maximum(first, last))
    return highest


def _nodes(A: Matrix, B: Matrix, parts: int) -> Matrix:
    """Divide motions A[k] -> B[k], shapes (m, dof), into equal parts: ends of shape (m, parts + 1, dof)."""
    shares = np.linspace(0.0, 1.0, parts + 1)[:, None]
    return (1.0 - shares) * A[:, None] + shares * B[:, None]


def goal_regions(robot: Robot, scene: Scene, goal: Goal) -> tuple[HeldRegion, ...]:
    """Return the regions of all tips of a goal that concerns several.

    Raises:
        UnknownNameError: If a tip is no link of the robot.
        InputError: If the ranges of angles of a region cannot be held.
    """
    regions = []
    for frame, part in zip(goal.frames, goal.parts, strict=True):
        if not robot.model.existFrame(frame):
            raise UnknownNameError(f"tip of robot '{robot.name}'", frame, robot.link_names)
        regions.append(held_region(robot, scene, replace(part.region(), frame=frame), f"the goal of '{frame}'"))
    return tuple(regions)

"""Effective workspace of the TITAN 4 on its vehicle: in reach with a margin, seen by a camera and clear of the vehicle.

Source: [1, ch. 3]. The published figures with numbers are lost, so poses and sizes of cameras and vehicle are
**chosen** here; all of them can be set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, finite_array, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import wrapped
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.ik.reach import Slice
from rrtik_ompl.model.robot import Robot

PITCHES_DEG = tuple(range(-90, 91, 15))  # of the gripper in the arm plane, with a straight wrist
CELL = 0.025  # [m]
GRID = ((-1.4, 2.2), (-2.1, 2.2), (-1.7, 2.0))  # x, y, z in the base frame [m]
FAR_VEHICLE = frozen([[98.0, 98.0, 98.0], [99.0, 99.0, 99.0]])  # a vehicle so far away that it has no effect
JOINTS_OF_POINTS = ("forearm", "wrist", "yaw_housing")  # links whose origins are elbow, wrist pitch and wrist yaw axis


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera on a pan-tilt unit. It sees a point that lies inside its picture for some pan and tilt.

    Attributes:
        position: Position in the arm's base frame [m], shape (3,).
        target: Point that it looks at in its middle position [m], shape (3,).
        diagonal_deg: Field of view over the diagonal [deg].
        aspect: Width over height of the picture.
        pan_deg: Largest pan to either side about the vertical [deg].
        tilt_deg: Largest tilt up and down [deg].
        nearest: Least distance at which the picture is sharp [m].
        farthest: Largest distance at which the water is clear enough [m].
    """

    position: Vector
    target: Vector
    diagonal_deg: float = 78.0
    aspect: float = 4.0 / 3.0
    pan_deg: float = 15.0
    tilt_deg: float = 15.0
    nearest: float = 0.3
    farthest: float = 5.0

    def __post_init__(self) -> None:
        for name in ("position", "target"):
            object.__setattr__(self, name, frozen(finite_array(getattr(self, name), (3,), f"camera: {name}")))
        if np.linalg.norm((self.target - self.position)[:2]) < 1e-9:
            raise InputError("camera: it looks straight up or down, where pan has no meaning; move its target aside")

    def sees(self, points: ArrayLike) -> Mask:
        """Check which points, shape (m, 3) in the base frame [m], it can bring into its picture; shape (m,)."""
        half = np.tan(np.radians(self.diagonal_deg) / 2.0) / np.hypot(self.aspect, 1.0)
        middle = self.target - self.position
        to_points = np.asarray(points, dtype=np.float64) - self.position

        distance = np.linalg.norm(to_points, axis=1)
        heading = np.arctan2(to_points[:, 1], to_points[:, 0]) - np.arctan2(middle[1], middle[0])
        pan = np.abs(wrapped(heading))
        tilt = np.abs(_elevation(to_points) - _elevation(middle[None]))

        wide = np.arctan(half * self.aspect)
        high = np.arctan(half)
        aimed = (pan <= wide + np.radians(self.pan_deg)) & (tilt <= high + np.radians(self.tilt_deg))
        seen: Mask = aimed & (distance >= self.nearest) & (distance <= self.farthest)
        return seen


CAMERAS = (
    Camera(np.array([0.1, 0.9, 0.6]), np.array([1.2, 0.0, 0.0])),
    Camera(np.array([0.1, -0.4, 0.6]), np.array([1.2, 0.0, 0.0])),
)


MEANINGS = {1.0: "in reach", 3.0: "and seen, clear of the vehicle, away from limits"}  # of values in slices
ALL_SEEING = Camera(np.array([-50.0, 0.0, 0.0]), np.zeros(3), diagonal_deg=170.0, farthest=1e3)


@dataclass(frozen=True, slots=True, eq=False)
class EffectiveWorkspace:
    """The operating space of an arm on its vehicle.

    Attributes:
        robot: A TITAN 4; use ``parameters={"limits": "envelope"}`` for statements about reach.
        cameras: Cameras, one of which has to see the grip point.
        vehicle: Low and high corner of the vehicle's box in the base frame [m], shape (2, 3). Elbow, wrist and grip
            point must be outside. The default is 3 m long and 2 m high, behind and above the base.
        margin: Distance that every joint keeps from its limits [rad].
    """

    robot: Robot
    cameras: Sequence[Camera] = CAMERAS
    vehicle: Matrix = field(default_factory=lambda: frozen([[-2.9, -0.35, 0.35], [0.1, 1.35, 2.35]]))
    margin: float = float(np.radians(5.0))

    def contains(self, poses: ArrayLike) -> Mask:
        """Check which poses T_world_tip, shape (m, 4, 4), belong to the workspace; shape (m,).

        Raises:
            InputError: If a target is no pose.
        """
        targets = finite_array(poses, (None, 4, 4), "poses")
        found = solutions(self.robot, targets, check=False)
        q = found.branches

        room = np.minimum(q - self.robot.lower, self.robot.upper - q).min(axis=2) >= self.margin
        fits = np.array(found.valid & room)
        fits[fits] = self._clear(q[fits])
        seen = np.array([camera.sees(self._in_base(targets[:, :3, 3])) for camera in self.cameras]).any(axis=0)
        return np.asarray(fits.any(axis=1) & seen, dtype=np.bool_)

    def side_view(self, x: ArrayLike, z: ArrayLike) -> NDArray[np.bool_]:
        """Return the upright slice through the azimuth axis and straight ahead, on a grid in the base frame.

        Args:
            x: Coordinates of the grid along x [m].
            z: Coordinates of the grid along z [m].

        Returns:
            Whether each point belongs to the workspace, shape (len(z), len(x)).
        """
        across, up = np.meshgrid(np.asarray(x, dtype=np.float64), np.asarray(z, dtype=np.float64))
        return self._slice(np.stack([across, np.zeros_like(across), up], axis=-1))

    def top_view(self, x: ArrayLike, y: ArrayLike, height: float = 0.0) -> NDArray[np.bool_]:
        """Return the horizontal slice at a height above the shoulder axis, on a grid in the base frame.

        Args:
            x: Coordinates of the grid along x [m].
            y: Coordinates of the grid along y [m].
            height: Height of the slice [m].

        Returns:
            Whether each point belongs to the workspace, shape (len(y), len(x)).
        """
        along, across = np.meshgrid(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        return self._slice(np.stack([along, across, np.full_like(along, height)], axis=-1))

    def _slice(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Check at which points, shape (..., 3), the gripper can be used straight ahead at one of ``PITCHES_DEG``."""
        flat = points.reshape(-1, 3)
        heading = np.arctan2(flat[:, 1], flat[:, 0])[:, None]
        pitch = np.radians(PITCHES_DEG)[None]
        poses = gripper_poses(flat[:, None], heading, pitch).reshape(-1, 4, 4)
        inside = self.contains(self._base() @ poses).reshape(*points.shape[:-1], len(PITCHES_DEG))
        return np.asarray(inside.any(axis=-1), dtype=np.bool_)

    def _clear(self, Q: Matrix) -> Mask:
        """Check which configurations, shape (m, 6), keep elbow, wrist and grip point out of the vehicle's box."""
        if len(Q) == 0:
            return np.zeros(0, dtype=bool)
        points = [self._in_base(self.robot.fk_batch(Q, frame)[:, :3, 3]) for frame in (*JOINTS_OF_POINTS, "grip_point")]
        stacked = np.array(points)
        inside = ((stacked > self.vehicle[0]) & (stacked < self.vehicle[1])).all(axis=2)
        return np.asarray(~inside.any(axis=0), dtype=np.bool_)

    def _base(self) -> NDArray[np.float64]:
        """Return T_world_base, shape (4, 4)."""
        base: NDArray[np.float64] = self.robot.fk_batch(np.zeros(self.robot.dof), self.robot.link_names[0])[0]
        return base

    def _in_base(self, points: Matrix) -> Matrix:
        base = self._base()
        moved: Matrix = (points - base[:3, 3]) @ base[:3, :3]
        return moved


def effective_slices(space: EffectiveWorkspace | None = None, *, cell: float = CELL) -> list[Slice]:
    """Return side and top view: 1 where the gripper reaches, 3 where it can be used (seen, clear, away from limits).

    Args:
        space: The workspace of a robot with its cameras and vehicle; the defaults with the envelope limits if None.
        cell: Distance between points of the grid [m].
    """
    used = EffectiveWorkspace(load_robot("titan4", parameters={"limits": "envelope"})) if space is None else space
    reach = replace(used, cameras=[ALL_SEEING], vehicle=FAR_VEHICLE, margin=0.0)
    x, y, z = (np.arange(low, high, cell) for low, high in GRID)
    views = (
        ("side, straight ahead", "z [m]", z, 2, reach.side_view(x, z), used.side_view(x, z)),
        ("top, height of the shoulder", "y [m]", y, 1, reach.top_view(x, y), used.top_view(x, y)),
    )
    low, high = used.vehicle
    return [
        Slice(
            title=f"{title}: {effective.sum() * cell**2:.2f} m² of {reachable.sum() * cell**2:.2f} m²",
            across="x [m]",
            up=up,
            x=x,
            y=other,
            values=np.where(effective, 3.0, np.where(reachable, 1.0, 0.0)),
            boxes=((float(low[0]), float(low[k]), float(high[0]), float(high[k])),),
            points=tuple((float(camera.position[0]), float(camera.position[k])) for camera in used.cameras),
            meanings=MEANINGS,
        )
        for title, up, other, k, reachable, effective in views
    ]


def gripper_poses(points: ArrayLike, heading: ArrayLike, pitch: ArrayLike) -> NDArray[np.float64]:
    """Return poses of the grip point whose approach axis has a heading and a pitch, without roll; shapes broadcast.

    Args:
        points: Positions of the grip point [m], shape (..., 3).
        heading: Angle of the approach axis about the vertical, 0 along x [rad], shape (...).
        pitch: Angle of the approach axis above the horizontal [rad], shape (...).

    Returns:
        Poses, shape (..., 4, 4).
    """
    c, s, cp, sp = (f(np.asarray(a, dtype=np.float64)) for a in (heading, pitch) for f in (np.cos, np.sin))
    shape = np.broadcast_shapes(np.shape(points)[:-1], np.shape(c), np.shape(cp))
    poses = np.zeros((*shape, 4, 4))

    # u
    poses[..., 0, 0] = -c * sp
    poses[..., 1, 0] = -s * sp
    poses[..., 2, 0] = cp + 0.0 * c

    # v, horizontal
    poses[..., 0, 1] = s
    poses[..., 1, 1] = -c

    # w, the approach axis
    poses[..., 0, 2] = c * cp
    poses[..., 1, 2] = s * cp
    poses[..., 2, 2] = sp + 0.0 * c

    poses[..., :3, 3] = points
    poses[..., 3, 3] = 1.0
    return poses


def _elevation(directions: NDArray[np.float64]) -> Vector:
    angle: Vector = np.arctan2(directions[:, 2], np.hypot(directions[:, 0], directions[:, 1]))
    return angle

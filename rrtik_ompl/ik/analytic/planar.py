"""Closed form for any planar arm of two links, which reach a point, or three links, which reach a pose, in two ways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver, Branches, two_links, wrapped
from rrtik_ompl.model.robot import Robot

BRANCHES = ("left", "right")
IN_PLANE = 1e-9  # [m] or sine of an angle: how well an arm or a target must lie in the plane


@dataclass(frozen=True, slots=True, eq=False)
class PlanarArm:
    """Two or three links in a plane.

    Attributes:
        to_plane: T_plane_base, shape (4, 4); the plane's origin is the first joint, its z axis the axis of all joints.
        links: Vectors from joint to joint and to the tip, in the plane, with all joints at zero [m], shape (dof, 2).
        tip: T_plane_tip with all joints at zero.
    """

    to_plane: NDArray[np.float64]
    links: Matrix
    tip: NDArray[np.float64]

    def solve(self, poses: NDArray[np.float64], *_: object) -> Branches:
        """Return both branches for T_base_tip, shape (m, 4, 4).

        Other arguments of :attr:`AnalyticSolver.solve` have no effect, since no pose is treated as singular.
        """
        targets = self.to_plane @ poses
        point = targets[:, :2, 3]
        real = np.abs(targets[:, 2, 3] - self.tip[2, 3]) <= IN_PLANE

        heading = np.zeros(len(poses))
        if len(self.links) == 3:
            turn = targets[:, :3, :3] @ self.tip[:3, :3].T
            real &= np.linalg.norm(turn[:, :2, 2], axis=1) <= IN_PLANE
            heading = np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1])
            point = point - _turned(self.links[2], heading)

        lengths = np.linalg.norm(self.links, axis=1)
        angles = np.arctan2(self.links[:, 1], self.links[:, 0])
        first, second, reached = two_links(float(lengths[0]), float(lengths[1]), *point.T)
        joints = [first - angles[0], second - angles[1] + angles[0]]
        if len(self.links) == 3:
            joints.append(heading - joints[0] - joints[1])
        q = wrapped(np.stack(joints)).transpose(2, 1, 0)

        return Branches(q, np.repeat((real & reached)[:, None], 2, axis=1), np.zeros(len(poses), dtype=np.uint8))

    def nearness(self, Q: Matrix) -> dict[str, Vector]:
        """Return ``elbow``, the sine of the angle between the first two links, for Q, shape (m, dof); shape (m,)."""
        angles = np.arctan2(self.links[:, 1], self.links[:, 0])
        return {"elbow": np.abs(np.sin(Q[:, 1] + angles[1] - angles[0]))}


@kept_with
def planar_form(robot: Robot) -> AnalyticSolver | None:
    """Return the closed form of a robot that is a chain of two or three joints with parallel axes; else None."""
    chain = robot.chain
    plain = np.array_equal(chain.gain, np.eye(robot.dof)) and not chain.offset.any() and not robot.prismatic.any()
    if robot.dof not in (2, 3) or not plain or (chain.parent != np.arange(-1, robot.dof - 1)).any():
        return None

    zero = np.zeros(robot.dof)
    T_base_world = np.linalg.inv(robot.fk_batch(zero, robot.link_names[0])[0])
    frames = T_base_world @ robot.joint_frames(zero)[0, 1:]
    axes = np.einsum("kij,kj->ki", frames[:, :3, :3], chain.axis)
    if np.abs(axes - axes[0]).max() > IN_PLANE:
        return None

    to_plane = np.asarray(np.linalg.inv(_plane(frames[0, :3, 3], axes[0])), dtype=np.float64)
    places = to_plane @ np.concatenate([frames, T_base_world @ robot.fk_batch(zero)])
    links = np.diff(places[:, :2, 3], axis=0)
    if (np.linalg.norm(links[:2], axis=1) < IN_PLANE).any():
        return None

    arm = PlanarArm(to_plane, links, places[-1])
    kind = "position" if robot.dof == 2 else "pose"
    return AnalyticSolver(robot.tip, kind, BRANCHES, (), (), arm.solve, arm.nearness)


def _plane(origin: Vector, axis: Vector) -> NDArray[np.float64]:
    """Return T_base_plane, shape (4, 4), with its origin at the first joint and z along the joint's axis."""
    across = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    x = across / np.linalg.norm(across)
    plane = np.eye(4)
    plane[:3, :3] = np.column_stack([x, np.cross(axis, x), axis])
    plane[:3, 3] = origin
    return plane


def _turned(link: Vector, angle: Vector) -> Matrix:
    cosine = np.cos(angle)
    sine = np.sin(angle)
    return np.column_stack([link[0] * cosine - link[1] * sine, link[0] * sine + link[1] * cosine])

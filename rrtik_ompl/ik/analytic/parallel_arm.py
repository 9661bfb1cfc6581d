"""Closed form for any arm of six turning joints of which 2, 3, 4 have parallel axes, and 5, 6 axes that meet.

The arms of Universal Robots, the Z1 and the TITAN 4 are of this family. Its numbers are taken from the description of
the robot; names do not matter. Source: [73], which solves such arms by circles and cones that meet.

An axis is a unit vector h, all in the posture where the joints are at zero, and R(h, q) the rotation about it. P is
where axes 5 and 6 meet: from the base to P

    p = R(h1, q1) (p12 + R(h2, q2) (p23 + R(h2, q3) (p34 + R(h2, q4) p45)))

The distance of P from the base along h2 gives q1 (two ways); the angle between h2 and axis 6 gives q5 (two ways); the
rotation that is left gives q2 + q3 + q4 and q6; what is left of p is a triangle in a plane (two ways).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver, Branches, Limits, wrapped
from rrtik_ompl.ik.tip_columns import frame_columns
from rrtik_ompl.kernels.ik.branch_layout import DOUBLE_ROOT, REACH_TOLERANCE, SINGULAR
from rrtik_ompl.model.robot import Robot

Numbers = NDArray[np.float64]

JOINTS = 6
IN_FAMILY = 1e-9  # [m] or sine of an angle: how well axes must be parallel or meet
LEAST_ANGLE = 0.1  # sine of the angle between axes that meet, at least
LEAST_LINK = 1e-6  # [m] length of a link of the triangle, at least
SAMPLES = 36  # members on half a curve of solutions that are tried where the one that is wanted does not fit
STEPS = np.pi * (np.arange(1, SAMPLES + 1) // 2 * np.tile([1.0, -1.0], SAMPLES // 2)) / SAMPLES  # nearest first [rad]

BRANCHES = tuple("".join(signs) for signs in product("+-", repeat=3))  # the way of the shoulder, the wrist, the elbow
FAMILIES = ("wrist", "shoulder")
FREE = (5, 0)  # the joint that is free in each family


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """What m poses ask of an arm of this family.

    Attributes:
        turns: Rotations of the tip from its orientation at zero, shape (m, 3, 3).
        places: From axis 1 to P [m], shape (m, 3).
        least: How near a pose is to a singular one that counts as singular [m, sine].
    """

    turns: Numbers
    places: Matrix
    least: float

    def rows(self, which: NDArray[np.intp]) -> Targets:
        """Return the targets with these indices."""
        return Targets(self.turns[which], self.places[which], self.least)


@dataclass(frozen=True, slots=True, eq=False)
class ParallelArm:
    """An arm of this family; vectors with all joints at zero, in the frame of the base.

    Attributes:
        axes: Unit vectors h1 .. h6, shape (6, 3). Axes 2, 3, 4 are the same here; ``signs`` says which way they point.
        signs: 1 for a joint that turns about its axis, -1 for one that turns the other way round, shape (6,).
        p01: From the base to axis 1 [m], shape (3,); likewise ``p12`` and so on, from axis to axis and, last, to P.
        turn: Orientation of the tip, shape (3, 3).
        lever: From P to the tip [m], shape (3,).
    """

    axes: Matrix
    signs: Vector
    p01: Vector
    p12: Vector
    p23: Vector
    p34: Vector
    p45: Vector
    turn: Matrix
    lever: Vector

    @property
    def numbers(self) -> tuple[float, ...]:
        """The arm as its kernel takes it, see `rrtik_ompl.kernels.ik.branch_layout`."""
        parts = (self.axes, self.signs, self.p01, self.p12, self.p23, self.p34, self.p45, self.turn, self.lever)
        return tuple(np.concatenate([np.ravel(part) for part in parts]).tolist())

    def in_world(self, robot: Robot) -> ParallelArm:
        """Return the same arm with vectors in the world, where the robot's base stands."""
        base = robot.model.frames[robot.model.getFrameId(robot.link_names[0])].placement
        R = base.rotation
        return replace(
            self,
            axes=self.axes @ R.T,
            p01=base.act(self.p01),
            p12=R @ self.p12,
            p23=R @ self.p23,
            p34=R @ self.p34,
            p45=R @ self.p45,
            turn=R @ self.turn,
            lever=R @ self.lever,
        )

    def solve(
        self, poses: Numbers, near: Matrix | None = None, slack: float = 0.0, limits: Limits | None = None
    ) -> Branches:
        """Return all eight branches for T_base_tip, shape (m, 4, 4); see `AnalyticSolver`."""
        turns = poses[:, :3, :3] @ self.turn.T
        target = Targets(turns, poses[:, :3, 3] - self.p01 - turns @ self.lever, max(SINGULAR, slack))
        q, real, on_axis, normal = self._branches(target)
        any_roll = normal.any(axis=(0, 1))

        for joint, which in ((0, on_axis), (5, any_roll & ~on_axis)):
            (rows,) = which.nonzero()
            wanted = np.zeros(len(rows)) if near is None else near[rows, joint]
            if len(rows):
                members = q[..., rows], real[..., rows]
                self._take_members(target.rows(rows), joint, wanted, limits, *members)
                q[..., rows], real[..., rows] = members

        count = len(poses)
        singular = (any_roll * np.uint8(1) + on_axis * np.uint8(2)).astype(np.uint8)
        return Branches(q.reshape(JOINTS, 8, count).transpose(2, 1, 0), real.reshape(8, count).T, singular)

    def nearness(self, Q: Matrix) -> dict[str, Vector]:
        """Return how near postures are to the singular cases, for Q, shape (m, 6); shape (m,) each.

        They are ``elbow`` and ``wrist``, sines of an angle, and ``shoulder``, the distance [m] from the plane in which
        joint 1 does not move P along h2.
        """
        q = Q * self.signs
        h1, h2, _, _, h5, h6 = self.axes
        forearm = _turned(h2, q[:, 2], self.p34)
        wrist = _turned(h2, q[:, 3], self.p45)
        place = self.p12 + _turned(h2, q[:, 1], self.p23 + forearm + _turned(h2, q[:, 2], wrist))
        lengths = np.linalg.norm(self.p23) * np.linalg.norm(self.p34)
        return {
            "elbow": np.linalg.norm(np.cross(self.p23, forearm), axis=1) / lengths,
            "wrist": np.linalg.norm(np.cross(_turned(h5, q[:, 4], h6), h2), axis=1),
            "shoulder": np.abs(np.cross(h1, place) @ h2),
        }

    def _branches(
        self, target: Targets, first: Matrix | None = None, last: Vector | None = None
    ) -> tuple[Numbers, Mask, Mask, Mask]:
        """Compute the branches of m poses.

        Args:
            target: The poses.
            first: Values of joint 1 that are taken in place of its two, shape (2, m), or None.
            last: Values of joint 6 that are taken where they are free, shape (m,), or None.

        Returns:
            Joint values [rad], shape (6, 2, 2, 2, m); whether they reach the poses, shape (2, 2, 2, m); whether P is on
            axis 1, where joint 1 is free, shape (m,); and whether axis 6 is along h2, where joint 6 is free, shape
            (2, 2, m).
        """
        h1, h2, _, _, h5, h6 = self.axes
        signs = np.array([1.0, -1.0])
        R = target.turns
        places = target.places
        shape = (2, 2, 2, len(places))
        across = np.cross(h5, h6)
        aside = h2 @ (self.p12 + self.p45)

        q1, real1 = _onto(h2, -h1, places, aside, signs[:, None])
        on_axis = np.linalg.norm(np.cross(h1, places), axis=1) < target.least
        on_axis &= np.abs((places @ h1) * (h1 @ h2) - aside) < target.least  # some arms of this family cannot get there
        real1 |= on_axis
        if first is not None:
            q1 = first
        v, g, x = (_turned(-h1, q1, each) for each in (places, R @ h6, R @ across))

        q5, real5 = _onto(h2, h5, h6, (g @ h2)[:, None], signs[:, None])
        axis6 = _turned(h5, q5, h6)
        middle, size = _between(axis6, g[:, None], h2)
        normal = (np.sqrt(size) < target.least) & real1[:, None] & real5
        if last is not None:
            free, _ = _between(_turned(h5, q5, _turned(h6, last, across)), x[:, None], h2)
            middle = np.where(normal, free, middle)
        q6, _ = _between(across, _turned(-h5, q5, _turned(-h2, middle, x[:, None])), h6)

        d = v[:, None] - self.p12 - _turned(h2, middle, self.p45)
        d -= (d @ h2)[..., None] * h2
        half = 0.5 * ((d * d).sum(axis=-1) - self.p23 @ self.p23 - self.p34 @ self.p34)
        q3, real3 = _onto(self.p23, h2, self.p34, half[:, :, None], signs[:, None])
        q2, _ = _between(self.p23 + _turned(h2, q3, self.p34), d[:, :, None], h2)

        joints = (
            q1[:, None, None],
            q2,
            q3,
            middle[:, :, None] - q2 - q3,
            q5[:, :, None],
            q6[:, :, None],
        )
        q = np.stack([np.broadcast_to(each * sign, shape) for each, sign in zip(joints, self.signs, strict=True)])
        return wrapped(q), real1[:, None, None] & real5[:, :, None] & real3, on_axis, normal

    def _take_members(
        self, target: Targets, joint: int, wanted: Vector, limits: Limits | None, q: Numbers, real: Mask
    ) -> None:
        """Replace the branches of singular poses by members of their curves, in place.

        Those nearest to the wanted value of the free joint, and to that plus half a turn, stand in two branches. If the
        very one does not fit, the nearest of `SAMPLES` that does is taken.

        Args:
            target: The poses.
            joint: Number of the free joint, 0 or 5.
            wanted: Values near which members are wanted [rad], shape (m,).
            limits: Joint limits, or None.
            q: Branches [rad], shape (6, 2, 2, 2, m).
            real: Whether they reach the poses, shape (2, 2, 2, m).
        """
        for side in range(2):
            aims = wanted + side * np.pi
            fits = self._take_side(target, (joint, side), aims[:, None], limits, q, real)
            (rest,) = (~fits).nonzero()
            if len(rest):
                members = q[..., rest], real[..., rest]
                self._take_side(target.rows(rest), (joint, side), aims[rest, None] + STEPS, limits, *members)
                q[..., rest], real[..., rest] = members

    def _take_side(
        self,
        target: Targets,
        which: tuple[int, int],
        aims: Matrix,
        limits: Limits | None,
        q: Numbers,
        real: Mask,
    ) -> Mask:
        """Replace branches of one side as `_take_members`: by the first of some values that fits, or else the first.

        Args:
            target: The poses.
            which: Number of the free joint, and which of its two branches are replaced, 0 or 1.
            aims: Values of the free joint, shape (m, k).
            limits: See `_take_members`; and so are ``q`` and ``real``.
            q: Branches.
            real: Whether they reach the poses.

        Returns:
            Whether all branches of the side fit, shape (m,).
        """
        joint, side = which
        count, tries = aims.shape
        values = self.signs[joint] * aims.ravel()
        given = {"first": np.stack([values, values])} if joint == 0 else {"last": values}
        found, reached, _, normal = self._branches(target.rows(np.arange(count).repeat(tries)), **given)
        fits = reached if limits is None else reached & _inside(found, *limits)

        found = found.reshape(*found.shape[:-1], count, tries)
        reached, fits = (each.reshape(2, 2, 2, count, tries) for each in (reached, fits))
        best = np.argmax(fits, axis=-1)[..., None]
        chosen = np.take_along_axis(found, best[None], axis=-1)[..., 0]
        arrives, good = (np.take_along_axis(each, best, axis=-1)[..., 0] for each in (reached, fits))
        if joint == 0:
            q[:, side] = chosen[:, side]
            real[side] = arrives[side]
            return np.asarray(good[side].all(axis=(0, 1)))

        # Of each way of joint 1 that leaves joint 6 free, both ways of the wrist are members of the one curve.
        free = normal.reshape(2, 2, count, tries)[:, 0, :, 0]
        q[:, :, side] = np.where(free[:, None], chosen[:, :, 0], q[:, :, side])
        real[:, side] = np.where(free[:, None], arrives[:, 0], real[:, side])
        return np.asarray((good[:, 0] | ~free[:, None]).all(axis=(0, 1)))


@kept_with
def parallel_arm(robot: Robot, frame: str) -> ParallelArm | None:
    """Return the numbers of a robot whose joints carry a frame; None if it is no arm of this family."""
    model = robot.model
    base, end = (model.frames[model.getFrameId(name)] for name in (robot.link_names[0], frame))
    chain = frame_columns(robot, int(end.parentJoint), end.placement.homogeneous)
    plain = len(chain.gain) == robot.dof == JOINTS and np.array_equal(np.abs(chain.gain), np.eye(JOINTS))
    if not plain or chain.prismatic.any():
        return None

    pose = base.placement.inverse().homogeneous
    axes = np.zeros((JOINTS, 3))
    origins = np.zeros((JOINTS, 3))
    for k in range(JOINTS):
        pose = pose @ chain.fixed[k]
        axes[k] = chain.gain[k, k] * pose[:3, 2]
        origins[k] = pose[:3, 3]
        pose = pose @ _about_z(chain.offset[k])
    pose = pose @ chain.fixed[JOINTS]

    h1, h2, h5, h6 = axes[[0, 1, 4, 5]]
    signs = np.ones(JOINTS)
    signs[1:4] = np.sign(axes[1:4] @ h2)
    across = np.cross(h5, h6)
    gap = (origins[5] - origins[4]) @ across
    parallel = np.abs(np.cross(h2, axes[2:4])).max() <= IN_FAMILY
    if not parallel or abs(gap) > IN_FAMILY or min(map(np.linalg.norm, (across, np.cross(h1, h2)))) < LEAST_ANGLE:
        return None

    axes[1:4] = h2
    along = np.linalg.lstsq(np.array([h5, -h6]).T, origins[5] - origins[4], rcond=None)[0]
    meeting = origins[4] + along[0] * h5
    origins[2:4] -= np.outer((origins[2:4] - origins[1]) @ h2, h2)
    p12, p23, p34 = np.diff(origins[:4], axis=0)
    if min(map(np.linalg.norm, (p23, p34, np.cross(h5, h2)))) < LEAST_LINK:
        return None
    return ParallelArm(
        axes, signs, origins[0], p12, p23, p34, meeting - origins[3], pose[:3, :3], pose[:3, 3] - meeting
    )


@kept_with
def parallel_form(robot: Robot) -> AnalyticSolver | None:
    """Return the closed form of a robot of this family; None for others."""
    arm = parallel_arm(robot, robot.tip)
    if arm is None:
        return None
    return AnalyticSolver(
        robot.tip, "pose", BRANCHES, FAMILIES, FREE, arm.solve, arm.nearness, kernel="parallel_arm", numbers=arm.numbers
    )


def _about_z(angle: float) -> Matrix:
    """Return the turn about z by an angle [rad], shape (4, 4)."""
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn


def _inside(q: Numbers, lower: Vector, upper: Vector) -> Mask:
    """Check which configurations, shape (6, ...), are inside the limits up to full turns; shape (...)."""
    low, high = (each.reshape(JOINTS, *[1] * (q.ndim - 1)) for each in (lower, upper))
    inside: Mask = np.asarray((np.mod(q - low, TAU) <= high - low).all(axis=0))
    return inside


def _turned(axis: Vector, angle: Numbers, vector: Numbers) -> Numbers:
    """Return vectors, shape (..., 3), turned about an axis by angles [rad], shape (...)."""
    cosine = np.cos(angle)[..., None]
    sine = np.sin(angle)[..., None]
    along = (vector @ axis)[..., None]
    return vector * cosine + (vector @ _crossed(axis)) * sine + axis * (along * (1.0 - cosine))


def _crossed(axis: Vector) -> Matrix:
    """Return the matrix M with v @ M = axis x v, shape (3, 3)."""
    x, y, z = axis.tolist()
    return np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])


def _onto(h: Vector, axis: Vector, vector: Numbers, goal: Numbers | float, sign: Numbers) -> tuple[Numbers, Mask]:
    """Return the turns of vectors about an axis after which h . vector = goal, one or the other by its sign [rad].

    Where there is none, it is the turn that comes nearest. Also returns whether there is one.
    """
    level = (h @ axis) * (vector @ axis)
    a = vector @ h - level
    b = vector @ (_crossed(axis) @ h)
    c = goal - level
    square = a * a + b * b
    rest = square - c * c
    real = rest >= -REACH_TOLERANCE * square
    rest = np.where(rest < DOUBLE_ROOT * square, 0.0, rest)  # less is rounding, which must not split a double root
    return np.arctan2(b, a) - sign * np.arctan2(np.sqrt(rest), c), np.broadcast_to(real, np.shape(real * sign)).copy()


def _between(start: Numbers, end: Numbers, axis: Vector) -> tuple[Numbers, Numbers]:
    """Return the turns about an axis that bring vectors to others [rad], and how long their parts across it are."""
    x = (start * end).sum(axis=-1) - (start @ axis) * (end @ axis)
    y = ((start @ _crossed(axis)) * end).sum(axis=-1)
    return np.arctan2(y, x), np.hypot(x, y)

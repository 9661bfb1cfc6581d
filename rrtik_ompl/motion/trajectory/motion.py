"""A timed motion: knots in time, a cubic between each two, and what follows from that: values, peaks, faults."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import MOST_ROWS, Mask, Matrix, Vector, finite_array, frozen, not_negative, positive
from rrtik_ompl.base.copies import as_value, changed, in_notebook
from rrtik_ompl.base.errors import InputError, at_most, require
from rrtik_ompl.base.units import joint_units
from rrtik_ompl.files.text import write_text
from rrtik_ompl.model.judgement import Played
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.robot import require_joints
from rrtik_ompl.motion.trajectory.checks import faults_of, proof_of_motion
from rrtik_ompl.motion.trajectory.cubics import (
    Cubics,
    Peaks,
    State,
    hermite_accelerations,
    places,
)
from rrtik_ompl.motion.trajectory.played import played_motion
from rrtik_ompl.motion.trajectory.text import dumps, write_mcap, written_ending
from rrtik_ompl.world.world import World

END_ERROR = 1e-6  # [s] before the end; a tick there is the end, for no drive takes two points at once
FIT_TOLERANCE = 1e-8  # [rad] or [m]; between a knot and the end of the cubic that leads to it


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Joint positions over time: between two knots every joint follows a cubic.

    Attributes:
        times: Of the knots [s], shape (m,), increasing from 0.
        positions: Shape (m, n), rad (m for sliding joints).
        velocities: Shape (m, n).
        accelerations: Shape (m, n): at the beginning of each piece, in the last row at the end of the last one.
        joint_names: Names of the n joints.
        prismatic: Which joints slide, shape (n,).
        robot_name: Name of the robot it is for, or "".
        set_points: Numbers of the knots that a file had at a control rate, see :func:`load_trajectory`; None if the
            motion is known between its knots too.
    """

    times: Vector
    positions: Matrix
    velocities: Matrix
    accelerations: Matrix
    joint_names: tuple[str, ...]
    prismatic: Mask
    robot_name: str = ""
    set_points: NDArray[np.int64] | None = None

    __reduce__ = as_value
    _repr_html_ = in_notebook

    def __init__(
        self,
        times: ArrayLike,
        positions: ArrayLike,
        velocities: ArrayLike,
        accelerations: ArrayLike | None = None,
        *,
        joint_names: Iterable[str] | None = None,
        prismatic: ArrayLike | None = None,
        robot_name: str = "",
    ) -> None:
        """Take knots; without accelerations the cubics are those through positions and velocities (Hermite's).

        Raises:
            InputError: If the shapes differ, a number is not finite, the times do not increase from 0, or the
                accelerations lead elsewhere than to the next knot.
        """
        # the names and units of a path obey the same rules, so a path checks them
        path = JointPath(positions, joint_names, prismatic, robot_name)
        rows = path.waypoints

        clock = finite_array(times, (len(rows),), "trajectory times")
        if len(clock) < 2 or clock[0] != 0.0 or not (clock[1:] > clock[:-1]).all():
            raise InputError("trajectory times: expected two or more, beginning with 0, each greater than the last")

        rates = finite_array(velocities, rows.shape, "trajectory velocities")
        if accelerations is None:
            bends = hermite_accelerations(clock, rows, rates)
        else:
            bends = finite_array(accelerations, rows.shape, "trajectory accelerations")
            end_errors = np.abs(Cubics(clock, rows, rates, bends).ends - rows[1:])
            if end_errors.max() > FIT_TOLERANCE * max(1.0, np.abs(rates).max()):
                point = int(end_errors.max(axis=1).argmax()) + 2
                raise InputError(
                    f"trajectory: point {point} is {end_errors.max():.2g} away from where the point "
                    "before it leads; leave the accelerations out to have positions and velocities decide"
                )

        values = {"times": clock, "positions": rows, "velocities": rates, "accelerations": bends}
        for name, value in values.items():
            object.__setattr__(self, name, frozen(value))
        for name in ("joint_names", "prismatic", "robot_name"):
            object.__setattr__(self, name, getattr(path, name))
        object.__setattr__(self, "set_points", None)

    def __repr__(self) -> str:
        return f"Trajectory({len(self.joint_names)} joints, {len(self.times)} knots, {self.duration:.3g} s)"

    @property
    def cubics(self) -> Cubics:
        """The motion as numbers alone, for what computes with it."""
        return Cubics(self.times, self.positions, self.velocities, self.accelerations)

    @property
    def duration(self) -> float:
        """Time from the first to the last knot [s]."""
        return float(self.times[-1])

    def __call__(self, t: ArrayLike) -> State:
        """Positions, velocities and accelerations at a time [s], or at many: shape (n,), or (k, n) for t of shape (k,).

        Before its beginning and after its end the arm does not move.

        Raises:
            InputError: If a time is not finite.
        """
        many = getattr(t, "ndim", int(np.iterable(t))) > 0
        wanted = finite_array(t, (None,) if many else (), "time of a trajectory")
        states = self.cubics.states(np.atleast_1d(wanted))
        return states if many else State(*(rows[0] for rows in states))

    @property
    def jerks(self) -> Matrix:
        """Jerk of each piece [rad/s^3 or m/s^3], shape (m - 1, n)."""
        return self.cubics.jerks

    def peaks(self) -> Peaks:
        """The largest velocity, acceleration and jerk of each joint: exact, not sampled, for every piece is a cubic.

        With ``set_points``: at these, the jerk by their differences.
        """
        cubics = self.cubics
        return cubics.peaks() if self.set_points is None else cubics.at_knots(self.set_points).set_point_peaks()

    def slowed(self, factor: float) -> Trajectory:
        """The same motion, ``factor`` times as long.

        Raises:
            InputError: If the factor is not from 1e-6 to 1e6.
        """
        k = positive(factor, "factor of a trajectory")
        if not 1e-6 <= k <= 1e6:
            raise InputError(f"factor of a trajectory: expected 1e-6 to 1e6, got {k:g}")

        rates = (self.velocities / k, self.accelerations / k**2)
        slow = Trajectory(
            self.times * k, self.positions, *rates,
            joint_names=self.joint_names, prismatic=self.prismatic, robot_name=self.robot_name,
        )  # fmt: skip
        return slow if self.set_points is None else slow.at_set_points(self.set_points)

    def at_set_points(self, knots: NDArray[np.int64]) -> Trajectory:
        """The same motion, known at these knots alone: limits are judged there."""
        return changed(self, set_points=frozen(places(knots, len(self.times), "set points"), np.int64))

    def path(self) -> JointPath:
        """The knots as waypoints of a path."""
        return JointPath(self.positions, self.joint_names, self.prismatic, self.robot_name)

    def faults(self, world: World) -> tuple[str, ...]:
        """Check the motion itself, not the path it was made from, densely and independently of planners.

        Each piece is checked in steps in which no point of the arm moves more than half of the world's motion
        resolution, by :meth:`World.certify`; where motions have to be proven (:meth:`World.proving`), it is proven too.

        Returns:
            A line for the first fault of every piece that has one: time, and the pair or limit; empty if it is valid.

        Raises:
            InputError: If it moves other joints than the world's robot, or these in another order.
        """
        require(world, World, "world of a trajectory's check")
        require_joints(world.robot, self.joint_names, "trajectory")
        return tuple(f"after {moment:.3f} s: {reason}" for moment, reason in faults_of(self.cubics, world))

    def prove(self, world: World, *, clearance: float | None = None) -> Proof:
        """Prove the motion itself free, at every time, not the path it was made from.

        Each piece is cut into parts so short that no point of the arm leaves the straight motion between the ends of a
        part by more than 0.1 mm, which an acceleration bounds; the straight motions are proven with that to spare.
        Where it is nearer to something, parts that leave it by less are tried, down to 0.01 um.

        Args:
            world: The world.
            clearance: To be kept from every obstacle on top of its margin [m]; what the world keeps if None.

        Returns:
            The proof; its motions are the pieces between two knots.

        Raises:
            InputError: If it moves other joints than the world's robot, or these in another order, or the clearance is
                negative.
        """
        require(world, World, "world of a trajectory's proof")
        require_joints(world.robot, self.joint_names, "trajectory")
        kept_clearance = None if clearance is None else not_negative(clearance, "clearance")
        return proof_of_motion(self.cubics, world, kept_clearance)

    def played(self, world: World | None) -> Played:
        """The motion as a picture plays it, and what is said of it there: by :meth:`prove` and :meth:`faults`.

        Args:
            world: In which it is judged; None where there is none.

        Raises:
            InputError: If it moves other joints than the world's robot, or these in another order.
        """
        require(world, World | None, "world of a trajectory to play")
        if world is not None:
            require_joints(world.robot, self.joint_names, "trajectory")
        return played_motion(self.cubics, world)

    def jumps(self) -> Matrix:
        """How much the acceleration jumps at each knot, shape (m, n): from rest at the first, to rest at the last."""
        a = self.accelerations
        before = np.vstack([np.zeros_like(a[:1]), self.cubics.last_accelerations])
        after = np.vstack([a[:-1], np.zeros_like(a[:1])])
        jump_sizes: Matrix = np.abs(after - before)
        return jump_sizes

    def sampled(self, rate: float) -> tuple[Vector, State]:
        """Times at a control rate [1/s] from 0 to the end, shape (k,), and the states then; the end is the last one.

        Raises:
            InputError: If the rate is no number greater than 0.
        """
        step = 1.0 / positive(rate, "control rate of a trajectory")
        at_most(self.duration / step, MOST_ROWS, "times of a trajectory at that rate")
        clock = np.append(np.arange(0.0, self.duration - min(END_ERROR, 1e-3 * step), step), self.duration)
        return clock, self(clock)

    def save(self, file: str | os.PathLike[str], *, rate: float | None = None, accelerations: bool = True) -> None:
        """Write the motion to a file.

        A .json or .csv file (``time,<joint>...``) gives back the same motion by :func:`load_trajectory`. A .yaml or
        .ros.json file is the message JointTrajectory of ROS 2 and nothing else. A .mcap file has joint states for
        Foxglove (it needs the package mcap). Each is written whole or not at all.

        Args:
            file: See above.
            rate: Points at a control rate [1/s]; None for one point a knot.
            accelerations: Whether points have accelerations: controllers of ROS then follow quintics, else cubics.
                Files of .csv and .mcap always have them.

        Raises:
            InputError: If the ending is another one or the file cannot be written.
        """
        require(accelerations, bool, "accelerations of a file")
        ending = written_ending(file)
        if rate is None:
            at = slice(None) if self.set_points is None else self.set_points
            clock = self.times[at]
            state = State(self.positions[at], self.velocities[at], self.accelerations[at])
        else:
            clock, state = self.sampled(rate)

        columns = [(column + 0.0).tolist() for column in (clock, *state)]  # + 0.0: no file has a -0.0
        if ending == ".mcap":
            write_mcap(file, self.robot_name, self.joint_names, columns)
            return
        if not accelerations and ending != ".csv":
            columns.pop()
        write_text(file, dumps(self.robot_name, self.joint_names, joint_units(self.prismatic), columns, ending))

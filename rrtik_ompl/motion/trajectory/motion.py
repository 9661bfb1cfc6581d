"""Define the timed motion: knots in time with a cubic between each two, and its values, peaks and faults."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import MOST_ROWS, Mask, Matrix, Rows, Vector, finite_array, frozen, not_negative, positive
from rrtik_ompl.base.copies import as_value, changed, in_notebook, in_one_line, in_print, restored
from rrtik_ompl.base.errors import InputError, PathWarning, at_most, require
from rrtik_ompl.base.units import joint_units
from rrtik_ompl.files.kinds import read
from rrtik_ompl.files.text import write_text
from rrtik_ompl.model.certificate import Route
from rrtik_ompl.model.gripper import (
    Events,
    GripperEvent,
    checked_events,
    slowed_events,
    states_at,
    targets_at,
)
from rrtik_ompl.model.judgement import Played
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.robot import Robot, require_joints
from rrtik_ompl.motion.trajectory.checks import faults_of, proof_of_motion
from rrtik_ompl.motion.trajectory.cubics import (
    Cubics,
    Peaks,
    State,
    hermite_accelerations,
    places,
)
from rrtik_ompl.motion.trajectory.gripper_text import write_ros_commands
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.motion.trajectory.played import played_motion
from rrtik_ompl.motion.trajectory.receiver import faults_as_received
from rrtik_ompl.motion.trajectory.report import MotionReport, report_of
from rrtik_ompl.motion.trajectory.splines import Splines
from rrtik_ompl.motion.trajectory.text import ROS_JSON, dumps, write_mcap, written_ending
from rrtik_ompl.world.world import World

# [s] A tick this close to the end is replaced by the end, as no drive accepts two points at once.
END_ERROR = 1e-6
FIT_TOLERANCE = 1e-8  # [rad] or [m] largest distance between a knot and the end of the cubic that leads to it


@dataclass(frozen=True, slots=True, eq=False)
class Samples(Rows):
    """A motion at a control rate, used like the array of its positions, see :meth:`Trajectory.sample`.

    Attributes:
        times: Times [s], shape (k,), from 0 to the end of the motion.
        positions: Joint positions, shape (k, n) [rad; m for sliding joints].
        velocities: Joint velocities, shape (k, n) [rad/s or m/s].
        accelerations: Joint accelerations, shape (k, n) [rad/s^2 or m/s^2]; at a jump, the value just after it.
    """

    times: Vector
    positions: Matrix
    velocities: Matrix
    accelerations: Matrix

    __reduce__ = as_value
    __repr__ = in_one_line

    @property
    def _rows(self) -> Matrix:
        return self.positions


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Joint positions over time: between two knots every joint follows a cubic.

    ``trajectory(t)`` is its state at a time, ``trajectory.sample(rate=500)`` its positions at a control rate.

    Attributes:
        times: Times of the knots [s], shape (m,), increasing from 0.
        positions: Joint positions at the knots, shape (m, n) [rad; m for sliding joints].
        velocities: Joint velocities at the knots, shape (m, n) [rad/s or m/s].
        accelerations: Accelerations at the beginning of each piece and, in the last row, at the end of the last piece,
            shape (m, n) [rad/s^2 or m/s^2].
        joint_names: Names of the n joints.
        prismatic: Mask of the joints that slide, shape (n,).
        robot_name: Name of the robot that the motion is for, or "".
        set_points: Indices of the knots that are set points of a file at a control rate, see :meth:`load`;
            None if the motion is known between its knots too.
        gripper: Commands to a gripper, in the order of their times; the first, at 0, says where it is at the beginning.

    Example:
        >>> path = rrtik.JointPath.of(rrtik.load_robot("planar3"), [[0.0, 0.0, 0.0], [0.5, 0.2, 0.0]])
        >>> motion = rrtik.time_parameterize(path, rrtik.RateLimits(1.0, 4.0, 40.0))
        >>> motion(motion.duration).positions.round(6)
        array([0.5, 0.2, 0. ])
        >>> len(motion.sample(rate=100.0)) > 50
        True
    """

    times: Vector
    positions: Matrix
    velocities: Matrix
    accelerations: Matrix
    joint_names: tuple[str, ...]
    prismatic: Mask
    robot_name: str = ""
    set_points: NDArray[np.int64] | None = None
    gripper: Events = ()

    __reduce__ = as_value
    _repr_html_ = in_notebook
    _repr_png_ = in_print

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
        gripper: Iterable[GripperEvent] = (),
    ) -> None:
        """Make a motion from knots; without accelerations its cubics are those through positions and velocities.

        Raises:
            InputError: If the shapes differ, a number is not finite, the times do not increase from 0, the
                accelerations lead elsewhere than to the next knot, or the commands to the gripper do not fit it.
        """
        # Names and units obey the same rules as those of a path, so a path checks them.
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
        object.__setattr__(self, "gripper", checked_events(gripper, float(clock[-1])))

    def __repr__(self) -> str:
        return f"Trajectory({len(self.joint_names)} joints, {len(self.times)} knots, {self.duration:.3g} s)"

    @property
    def cubics(self) -> Cubics:
        """Return the motion as numbers alone, for computations."""
        return Cubics(self.times, self.positions, self.velocities, self.accelerations)

    @property
    def duration(self) -> float:
        """Return the time from the first to the last knot [s]."""
        return float(self.times[-1])

    def __call__(self, t: ArrayLike) -> State:
        """Return positions, velocities and accelerations at a time [s], shape (n,), or at k times, shape (k, n) each.

        Before its beginning and after its end the arm stands still.

        Raises:
            InputError: If a time is not finite.
        """
        many = getattr(t, "ndim", int(np.iterable(t))) > 0
        wanted = finite_array(t, (None,) if many else (), "time of a trajectory")
        states = self.cubics.states(np.atleast_1d(wanted))
        return states if many else State(*(rows[0] for rows in states))

    def gripper_positions(self, t: ArrayLike, *, commanded: bool = False) -> Matrix:
        """Return the positions of the gripper's joints at times [s], (k,) -> (k, g) [rad or m].

        Args:
            t: The times.
            commanded: Whether to return where the joints have been told to go, in place of where they are.

        Raises:
            InputError: If the motion has no commands to a gripper, or a time is not finite.

        Example:
            >>> from rrtik_ompl.model.gripper import GripperEvent
            >>> events = [GripperEvent(0.0, ["jaw"], [1.0]), GripperEvent(1.0, ["jaw"], [0.0], seconds=0.5)]
            >>> motion = rrtik.Trajectory([0.0, 2.0], [[0.0], [0.0]], [[0.0], [0.0]], gripper=events)
            >>> motion.gripper_positions([0.5, 1.25, 2.0]).ravel(), motion.gripper_positions([1.25], commanded=True)
            (array([1. , 0.5, 0. ]), array([[0.]]))
        """
        require(commanded, bool, "commanded")
        if not self.gripper:
            raise InputError("trajectory: it has no commands to a gripper; those of a task's robot with one have")
        return targets_at(self.gripper, t) if commanded else states_at(self.gripper, t)[0]

    @property
    def jerks(self) -> Matrix:
        """Return the jerk of each piece [rad/s^3 or m/s^3], shape (m - 1, n)."""
        return self.cubics.jerks

    def peaks(self) -> Peaks:
        """Return the largest velocity, acceleration and jerk of each joint: exact, as every piece is a cubic.

        With ``set_points`` only these knots count, and the jerk is computed from differences of acceleration.
        """
        cubics = self.cubics
        return cubics.peaks() if self.set_points is None else cubics.at_knots(self.set_points).set_point_peaks()

    def report(self, limits: RateLimits) -> MotionReport:
        """Report how the motion uses limits: peaks as shares of them, sign changes and jumps of its acceleration.

        Args:
            limits: Of its joints.

        Raises:
            InputError: If the limits are for another number of joints.

        Example:
            >>> limits = rrtik.RateLimits(1.0, 2.0, 10.0)
            >>> rrtik.time_parameterize(rrtik.JointPath([[0.0], [1.0]]), limits).report(limits).kept
            True
        """
        return report_of(self, limits)

    def slowed(self, factor: float) -> Trajectory:
        """Return the same motion, ``factor`` times as long.

        Raises:
            InputError: If the factor is not from 1e-6 to 1e6.
        """
        k = positive(factor, "factor of a trajectory")
        if not 1e-6 <= k <= 1e6:
            raise InputError(f"factor of a trajectory: expected 1e-6 to 1e6, got {k:g}")

        slowed = self.cubics.slowed(k)
        slow = Trajectory(
            slowed.times, slowed.positions, slowed.velocities, slowed.accelerations,
            joint_names=self.joint_names, prismatic=self.prismatic, robot_name=self.robot_name,
            gripper=slowed_events(self.gripper, k),
        )  # fmt: skip
        return slow if self.set_points is None else slow.at_set_points(self.set_points)

    def at_set_points(self, knots: NDArray[np.int64]) -> Trajectory:
        """Return the same motion, marked as known only at the knots with these indices: limits are judged there."""
        return changed(self, set_points=frozen(places(knots, len(self.times), "set points"), np.int64))

    def path(self) -> JointPath:
        """Return the knots as the waypoints of a path."""
        return JointPath(self.positions, self.joint_names, self.prismatic, self.robot_name)

    def faults(self, world: World) -> tuple[str, ...]:
        """Check the motion itself, not the path it was made from, densely and independently of planners.

        Each piece is checked in steps in which no point of the arm moves more than half of the world's motion
        resolution, by :meth:`World.certify`; if the world requires proofs of motions (:meth:`World.proving`), it is
        proven too.

        Returns:
            A line for the first fault of each piece that has one: the time, and the pair or limit. Empty if the motion
            is valid.

        Raises:
            InputError: If the motion moves other joints than the world's robot, or the same in another order.
        """
        require(world, World, "world of a trajectory's check")
        require_joints(world.robot, self.joint_names, "trajectory")
        return tuple(f"after {moment:.3f} s: {reason}" for moment, reason in faults_of(self.cubics, world))

    def prove(self, world: World, *, clearance: float | None = None) -> Proof:
        """Prove that the motion itself is free at every time, not only the path it was made from.

        Each piece is cut into parts so short that no point of the arm deviates by more than 0.3 mm from the straight
        motion between the ends of the part, as a bound on the acceleration shows. The straight motions are then proven
        free with that distance to spare. Where obstacles are too near for this, shorter parts with smaller deviations
        are tried, down to 0.01 um.

        Args:
            world: The world.
            clearance: Distance to keep from every obstacle in addition to its margin [m]; None for what the world
                requires.

        Returns:
            The proof; its motions are the pieces between two knots.

        Raises:
            InputError: If the motion moves other joints than the world's robot, or the same in another order, or the
                clearance is negative.
        """
        require(world, World, "world of a trajectory's proof")
        require_joints(world.robot, self.joint_names, "trajectory")
        kept_clearance = None if clearance is None else not_negative(clearance, "clearance")
        return proof_of_motion(self.cubics, world, kept_clearance)

    @property
    def route(self) -> Route:
        """The motion as a certificate has it, for :meth:`World.certificate` and :meth:`World.verify`."""
        return Splines.of(self.cubics).route

    def played(self, world: World | None) -> Played:
        """Return the motion as a picture plays it, with the verdict of :meth:`prove` and :meth:`faults`.

        Args:
            world: The world in which the motion is judged; None if there is none.

        Raises:
            InputError: If the motion moves other joints than the world's robot, or the same in another order.
        """
        require(world, World | None, "world of a trajectory to play")
        if world is not None:
            require_joints(world.robot, self.joint_names, "trajectory")
        return played_motion(self.cubics, world)

    def jumps(self) -> Matrix:
        """Return the jump of each joint's acceleration at each knot, shape (m, n) [rad/s^2 or m/s^2].

        Before the first knot and after the last one the arm is at rest.
        """
        a = self.accelerations
        before = np.vstack([np.zeros_like(a[:1]), self.cubics.last_accelerations])
        after = np.vstack([a[:-1], np.zeros_like(a[:1])])
        jump_sizes: Matrix = np.abs(after - before)
        return jump_sizes

    def sample(self, rate: float) -> Samples:
        """Return the motion at a control rate, from its beginning to its end.

        Args:
            rate: The control rate [1/s].

        Returns:
            The times, the last of which is the end of the motion, and positions, velocities and accelerations then;
            used like the array of positions, shape (k, n).

        Raises:
            InputError: If the rate is no number greater than 0.

        Example:
            >>> motion = rrtik.Trajectory([0.0, 1.0], [[0.0], [0.5]], [[0.0], [0.0]])
            >>> samples = motion.sample(rate=100)
            >>> len(samples), samples[-1], samples.velocities.max()
            (101, array([0.5]), 0.75)
        """
        step = 1.0 / positive(rate, "control rate of a trajectory")
        at_most(self.duration / step, MOST_ROWS, "times of a trajectory at that rate")
        clock = np.append(np.arange(0.0, self.duration - min(END_ERROR, 1e-3 * step), step), self.duration)
        return Samples(*(frozen(column) for column in (clock, *self(clock))))

    if not TYPE_CHECKING:  # so that a type checker does not take a trajectory for an array

        def __array__(self, dtype=None, copy=None) -> NoReturn:
            raise InputError("a trajectory is an array only at a rate: write np.asarray(trajectory.sample(rate=500))")

    def save(
        self,
        file: str | os.PathLike[str],
        *,
        rate: float | None = None,
        accelerations: bool = True,
        limits: RateLimits | None = None,
        world: World | None = None,
        gripper: str | os.PathLike[str] | None = None,
    ) -> None:
        """Write the motion to a file.

        A .json or .csv file (``time,<joint>...``) can be read back as the same motion by :meth:`load`. A
        .yaml or .ros.json file holds a JointTrajectory message of ROS 2 and nothing else. A .mcap file holds joint
        states for Foxglove (it needs the package mcap). Each file is written whole or not at all.

        Commands to a gripper are in all of them but in the message: a .csv file has columns ``gripper <joint>`` of
        where the joints have been told to go, and no more of the commands.

        Args:
            file: Name of the file; its ending decides on the format.
            rate: Control rate at which points are written [1/s]; None for one point per knot.
            accelerations: Whether points have accelerations: controllers of ROS then follow quintics, otherwise cubics.
                Files of .csv and .mcap always have them.
            limits: If given, a `PathWarning` says which of them the motion exceeds as ROS's controller plays a .yaml or
                .ros.json file. Between the points of a control rate it does not go as the motion goes; between knots
                without accelerations it does, exactly.
            world: If given, a warning likewise says if the motion is not proven free as it is played.
            gripper: For a message: a .yaml or .json file for the commands to the gripper, as goals of ROS's actions
                GripperCommand and ParallelGripperCommand with their times. Without it a warning says that the message
                has none.

        Raises:
            InputError: If the ending is unknown, the world is of other joints, there are no commands to write, or a
                file cannot be written.
        """
        require(accelerations, bool, "accelerations of a file")
        require(limits, RateLimits | None, "limits of a file")
        require(world, World | None, "world of a file")
        if world is not None:
            require_joints(world.robot, self.joint_names, "trajectory")
        ending = written_ending(file)
        message = ending in (".yaml", ROS_JSON)
        if gripper is not None and not (message and self.gripper):
            why = f"a {ending} file has the commands itself" if self.gripper else "this motion has no commands to one"
            raise InputError(f"file for a gripper: {why}; leave gripper= out")
        if rate is None:
            at = slice(None) if self.set_points is None else self.set_points
            clock = self.times[at]
            state = State(self.positions[at], self.velocities[at], self.accelerations[at])
        else:
            found = self.sample(rate)
            clock = found.times
            state = State(found.positions, found.velocities, found.accelerations)

        # Adding 0.0 turns -0.0 into 0.0.
        columns = [(column + 0.0).tolist() for column in (clock, *state)]
        if ending == ".mcap":
            write_mcap(file, self.robot_name, self.joint_names, columns, self.gripper)
            return
        if not accelerations and ending != ".csv":
            columns.pop()
        if message:
            played = Splines.through(clock, state.positions, state.velocities, state[2] if accelerations else None)
            for fault in faults_as_received(played, self.joint_names, limits, world):
                remedy = "write knots: no rate=, and accelerations=False"
                warnings.warn(f"{file}: as a controller of ROS plays it {fault}; {remedy}", PathWarning, stacklevel=2)
            if self.gripper and gripper is None:
                remedy = "write them, too: gripper='gripper.yaml'"
                warnings.warn(f"{file}: a message has no commands to the gripper; {remedy}", PathWarning, stacklevel=2)
        units = joint_units(self.prismatic)
        write_text(file, dumps(self.robot_name, self.joint_names, units, columns, ending, self.gripper))
        if gripper is not None:
            write_ros_commands(gripper, self.gripper)

    @staticmethod
    def load(
        file: str | os.PathLike[str], robot: Robot | None = None, *, gripper: str | os.PathLike[str] | None = None
    ) -> Trajectory:
        """Read a motion written by :meth:`save`, or a JointTrajectory message as JSON or YAML.

        Points at a control rate (even steps of 20 ms or less, as ``save(file, rate=...)`` writes them) keep their
        positions, velocities and accelerations, and limits are judged at these points, as a drive does; they are the
        ``set_points`` of the motion. If accelerations do not lead to the next point (other programs join their points
        by other curves), three cubics lead there instead, so that the acceleration does not jump.

        Args:
            file: A .json, .yaml, .csv or .mcap file.
            robot: If given, the motion must have its joints; columns in another order are sorted by name, with a
                warning.
            gripper: The file of the commands to a gripper that was written beside a message.

        Raises:
            InputError: If a file is missing, malformed, or does not fit the robot; the message names file and line.

        Example:
            >>> motion = rrtik.time_parameterize(rrtik.JointPath([[0.0], [1.0]]), rrtik.RateLimits(1.0, 4.0))
            >>> motion.save("motion.json")
            >>> rrtik.Trajectory.load("motion.json").duration
            1.25
        """
        return read(Trajectory, file, robot, gripper=gripper)


def motion_along(path: JointPath | Trajectory, motion: Cubics, gripper: Iterable[GripperEvent] = ()) -> Trajectory:
    """Return a motion that is known to be sound as one of a path's joints, without validation but of the commands."""
    fields = {
        "times": frozen(motion.times),
        "positions": frozen(motion.positions),
        "velocities": frozen(motion.velocities),
        "accelerations": frozen(motion.accelerations),
        "joint_names": path.joint_names,
        "prismatic": path.prismatic,
        "robot_name": path.robot_name,
        "set_points": None,
        "gripper": checked_events(gripper, motion.duration),
    }
    return restored(Trajectory, fields)

"""Determine where the arm is on its route, what remains of it, when to stop, and when the arm has left it.

A `Follower` tracks the arm along a list of single-joint moves. A `Track` does so along a path of all joints at once,
for an arm under position control. Both have the same interface. Source: [1, ch. 6] (flow chart; comparison of the two).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.transitions import Move
from rrtik_ompl.world.world import World

# [rad or m]; a move is completed this close to its end: the tip of an arm of 2 m is then off by 0.2 mm.
MADE = np.deg2rad(0.005)
TOLERANCE = np.deg2rad(1.0)  # [rad]; a joint that is farther from its planned value is off the route
SLIDING_TOLERANCE = 0.002  # [m]
REACTION_SECONDS = 0.3  # reaction time of the pilot to the advice to stop
AHEAD_SECONDS = 0.5  # how far ahead on its path an arm that moves all joints is searched for
PLACES = 51  # number of points of the path that are compared


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """The place of the arm on its route.

    Attributes:
        move: Number of the current move, from 0; the number of moves when all is done.
        share: Share of the current move that is done, from 0 to 1.
        remaining: Signed distance to the end of the current move [rad or m].
        advice: "move", "stop" (now, because the pilot needs time to react), "done" or "lost".
        fault: If lost: which joint deviates from its planned value, and by how much.
    """

    move: int
    share: float
    remaining: float
    advice: str
    fault: str = ""


@dataclass(frozen=True, eq=False)
class Follower:
    """Track an arm along a path of single-joint moves. The follower is immutable: `update` returns the next one.

    Attributes:
        path: The path; every motion changes one joint.
        rates: Rates of the joints when they are driven, shape (dof,) [rad/s or m/s].
        tolerance: Largest error of a revolute joint [rad].
        current: Number of the current move, from 0.
    """

    path: JointPath
    rates: Vector
    tolerance: float = TOLERANCE
    current: int = 0

    @cached_property
    def moves(self) -> tuple[Move, ...]:
        """The moves of single joints, in order."""
        return self.path.moves()

    @cached_property
    def slack(self) -> Vector:
        """How far each joint may deviate from the route, shape (dof,) [rad or m]."""
        return slack(self.path, self.tolerance)

    @cached_property
    def _corners(self) -> Matrix:
        """The configurations before and after each move, shape (moves + 1, dof)."""
        rows = [np.array(self.path.start)]
        for move in self.moves:
            row = rows[-1].copy()
            row[self.path.joint_names.index(move.joint)] = move.end
            rows.append(row)
        return np.array(rows)

    @property
    def done(self) -> bool:
        """Whether the last move is completed."""
        return self.current == len(self.moves)

    @property
    def target(self) -> Vector:
        """The configuration after the current move, shape (dof,)."""
        return np.array(self._corners[min(self.current + 1, len(self.moves))])

    def joint(self) -> int | None:
        """Return the number of the joint that the current move changes; None when all is done."""
        return None if self.done else self.path.joint_names.index(self.moves[self.current].joint)

    def update(self, q: Vector) -> tuple[Follower, Progress]:
        """Compare an arm at q with the route, and advance over all moves that are completed there.

        The arm is on the route if the joint of the current move is within its range, and all others are at their
        planned values, each up to the tolerance.

        Returns:
            The follower with the move that is current now, and the progress of the arm.
        """
        joint = self.joint()
        if joint is None:
            lost = self._lost(q, self._corners[-1], None)
            return self, lost or Progress(self.current, 1.0, 0.0, "done")

        begin = self._corners[self.current][joint]
        end = self._corners[self.current + 1][joint]
        lost = self._lost(q, self._corners[self.current], joint)
        if lost is not None:
            return self, lost

        remaining = float(end - q[joint])
        # A move shorter than the usual tolerance must not count as completed before it begins.
        if abs(remaining) <= min(MADE, 0.5 * abs(end - begin)):
            return replace(self, current=self.current + 1).update(q)

        is_on_move = min(begin, end) - self.slack[joint] <= q[joint] <= max(begin, end) + self.slack[joint]
        if not is_on_move:
            return self, self._off(joint, float(q[joint]), float(end))

        share = float(np.clip(1.0 - remaining / (end - begin), 0.0, 1.0))
        is_ending = abs(remaining) <= self.rates[joint] * REACTION_SECONDS
        return self, Progress(self.current, share, remaining, "stop" if is_ending else "move")

    def pass_on(self, q: Vector) -> tuple[Follower, str, str]:
        """Treat the current move as completed although its end is not reached.

        Returns:
            The follower with the next move, the name of the joint of this one, and the remaining distance in words.

        Raises:
            InputError: If more than the tolerance of the route remains, or there is no current move.
        """
        joint = self.joint()
        if joint is None:
            raise InputError("all moves are done")
        name = self.path.joint_names[joint]
        remaining = abs(float(self.target[joint] - q[joint]))

        shown, unit = reading(remaining, joint_unit(self.path.prismatic[joint]))
        if remaining > self.slack[joint]:
            raise InputError(f"{name}: {shown:.3g} {unit} are left of the move")
        return replace(self, current=self.current + 1), name, f"{shown:.2g} {unit}"

    def rest(self, q: Vector) -> JointPath:
        """Return the remaining moves from q as they will be made: each changes only its joint, all others stay."""
        return self._from(q, [(move.joint, move.end) for move in self.moves[self.current :]])

    def back(self, q: Vector) -> JointPath:
        """Return the path back to the start: the moves made so far, reversed, each of one joint."""
        moves_made = self.moves[: self.current + 1]  # includes the current move, which has begun
        return self._from(q, [(move.joint, move.start) for move in moves_made[::-1]])

    def _from(self, q: Vector, ends: list[tuple[str, float]]) -> JointPath:
        rows = [np.array(q, dtype=np.float64)]
        for name, end in ends:
            row = rows[-1].copy()
            row[self.path.joint_names.index(name)] = end
            rows.append(row)
        return self.path.with_waypoints(np.array(rows if len(rows) > 1 else [*rows, *rows]))

    def _lost(self, q: Vector, planned: Vector, moving: int | None) -> Progress | None:
        """Return a progress "lost" if a joint other than the moving one deviates from its plan, or None."""
        errors = np.abs(q - planned)
        if moving is not None:
            errors[moving] = 0.0
        off_joints = np.flatnonzero(errors > self.slack)
        if not len(off_joints):
            return None

        first = int(off_joints[0])
        return self._off(first, float(q[first]), float(planned[first]))

    def _off(self, joint: int, value: float, planned: float) -> Progress:
        shown_value, unit = reading(value, joint_unit(self.path.prismatic[joint]))
        shown_planned, _ = reading(planned, joint_unit(self.path.prismatic[joint]))
        fault = f"{self.path.joint_names[joint]} is at {shown_value:.2f} {unit} instead of {shown_planned:.2f}"
        return Progress(self.current, 0.0, 0.0, "lost", fault)


@dataclass(frozen=True, eq=False)
class Track:
    """Track an arm along a path of all joints. The track is immutable: `update` returns the next one.

    Attributes:
        path: The path.
        rates: Rates of the joints when they are driven, shape (dof,) [rad/s or m/s].
        tolerance: Largest error of a revolute joint [rad].
        current: 0 until the end is reached, then 1.
        at: Place of the arm on the path, as time from its start [s].
    """

    path: JointPath
    rates: Vector
    tolerance: float = TOLERANCE
    current: int = 0
    at: float = 0.0

    @property
    def moves(self) -> tuple[Move, ...]:
        """Always empty: there are no moves of single joints."""
        return ()

    @cached_property
    def slack(self) -> Vector:
        """How far each joint may deviate from the path, shape (dof,) [rad or m]."""
        return slack(self.path, self.tolerance)

    @cached_property
    def _times(self) -> Vector:
        """The time at each waypoint [s], shape (k,), if the slowest joint of each piece moves at its rate."""
        times = (np.abs(np.diff(self.path.waypoints, axis=0)) / self.rates).max(axis=1)
        return np.concatenate([[0.0], np.cumsum(times)])

    @property
    def seconds(self) -> float:
        """The duration of the whole path [s]."""
        return float(self._times[-1])

    @property
    def done(self) -> bool:
        """Whether the end is reached."""
        return self.current == 1

    @property
    def target(self) -> Vector:
        """The end of the path, shape (dof,)."""
        return self.path.end

    def joint(self) -> int | None:
        """Return None: there is no current joint."""
        return None

    def update(self, q: Vector) -> tuple[Track, Progress]:
        """Find the place of an arm at q on the next `AHEAD_SECONDS` of the path.

        Returns:
            The track with this place, and the progress of the arm; "lost" if the arm deviates there by more than the
            tolerance.
        """
        places = np.linspace(self.at, min(self.at + AHEAD_SECONDS, self.seconds), PLACES)
        errors = np.abs(np.array([self._place(seconds) for seconds in places]) - q) / self.slack

        nearest = int(errors.max(axis=1).argmin())
        if errors[nearest].max() > 1.0:
            return self, Progress(0, self.share, 0.0, "lost", self._fault(q, int(errors[nearest].argmax())))

        if self.done or np.abs(q - self.path.end).max() <= MADE:
            return replace(self, current=1, at=self.seconds), Progress(1, 1.0, 0.0, "done")

        advanced = replace(self, at=float(places[nearest]))
        return advanced, Progress(0, advanced.share, advanced.seconds - advanced.at, "move")

    def ahead(self, seconds: float) -> Vector:
        """Return the configuration on the path that is a given time ahead of the arm, shape (dof,)."""
        return self._place(min(self.at + seconds, self.seconds))

    def pass_on(self, q: Vector) -> tuple[Track, str, str]:
        """Refuse, because there is no move that could be passed over.

        Raises:
            InputError: Always.
        """
        raise InputError("no move is due")

    def rest(self, q: Vector) -> JointPath:
        """Return the remaining path from q."""
        waypoints_ahead = self.path.waypoints[np.searchsorted(self._times, self.at, side="right") :]
        return self.path.with_waypoints(
            np.vstack([q, waypoints_ahead if len(waypoints_ahead) else self.path.end[None]])
        )

    def back(self, q: Vector) -> JointPath:
        """Return the path from q back to the start."""
        waypoints_behind = self.path.waypoints[: np.searchsorted(self._times, self.at, side="right")]
        return self.path.with_waypoints(np.vstack([q, waypoints_behind[::-1]]))

    def _place(self, seconds: float) -> Vector:
        return np.array([np.interp(seconds, self._times, column) for column in self.path.waypoints.T])

    @property
    def share(self) -> float:
        """The share of the path that is behind the arm, from 0 to 1."""
        return self.at / self.seconds if self.seconds > 0.0 else 1.0

    def _fault(self, q: Vector, joint: int) -> str:
        unit = joint_unit(self.path.prismatic[joint])
        (shown_value, unit_name), (shown_planned, _) = (
            reading(float(row[joint]), unit) for row in (q, self._place(self.at))
        )
        return f"{self.path.joint_names[joint]} is at {shown_value:.2f} {unit_name} instead of {shown_planned:.2f}"


def slack(path: JointPath, tolerance: float = TOLERANCE) -> Vector:
    """Return the largest permitted error of each joint, shape (dof,) [rad or m]."""
    return np.where(path.prismatic, SLIDING_TOLERANCE, tolerance)


def path_fault(world: World, path: JointPath) -> str:
    """Return why a path is no longer free; "" if it is."""
    faults = path.violations(world)
    return faults[0].reason if faults else ""

"""Where the arm is on its route, what remains of it, when to stop, and when the arm is off it.

A `Follower` tracks it along a list of single-joint moves, a `Track` along a path of all joints at once, for an arm
under position control. Both are asked the same. Source: [1, ch. 6] (flow chart; comparison of the two).
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

MADE = np.deg2rad(0.005)  # [rad or m]; a move is made this close to its end: the tip of an arm of 2 m is 0.2 mm off
TOLERANCE = np.deg2rad(1.0)  # [rad]; farther from its value a joint is off the route
SLIDING_TOLERANCE = 0.002  # [m]
REACTION_SECONDS = 0.3  # from the advice to stop until the pilot does
AHEAD_SECONDS = 0.5  # within which an arm that moves all joints is looked for on its path
PLACES = 51  # at which it is looked for


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """Where the arm is on its route.

    Attributes:
        move: Number of the current move, from 0; as many as there are moves when all is done.
        share: Of the current move that is done, 0 to 1.
        remaining: To the current move's end, with its sign [rad or m].
        advice: "move", "stop" (now, for the pilot needs time to react), "done" or "lost".
        fault: If lost: which joint is off its value and by how much.
    """

    move: int
    share: float
    remaining: float
    advice: str
    fault: str = ""


@dataclass(frozen=True, eq=False)
class Follower:
    """Tracks an arm along a path of single-joint moves, as a value: `update` gives the next one.

    Attributes:
        path: The path, of one joint at a time.
        rates: Of the joints when they are driven, shape (dof,) [rad/s or m/s].
        tolerance: Largest error of a joint [rad].
        current: Number of the move that is due, from 0.
    """

    path: JointPath
    rates: Vector
    tolerance: float = TOLERANCE
    current: int = 0

    @cached_property
    def moves(self) -> tuple[Move, ...]:
        """Of single joints, in their order."""
        return self.path.moves()

    @cached_property
    def slack(self) -> Vector:
        """How far each joint may be off the route, shape (dof,) [rad or m]."""
        return slack(self.path, self.tolerance)

    @cached_property
    def _corners(self) -> Matrix:
        """Configurations before and after each move. Shape (moves + 1, dof)."""
        rows = [np.array(self.path.start)]
        for move in self.moves:
            row = rows[-1].copy()
            row[self.path.joint_names.index(move.joint)] = move.end
            rows.append(row)
        return np.array(rows)

    @property
    def done(self) -> bool:
        """Whether the last move is made."""
        return self.current == len(self.moves)

    @property
    def target(self) -> Vector:
        """Configuration after the current move. Shape (dof,)."""
        return np.array(self._corners[min(self.current + 1, len(self.moves))])

    def joint(self) -> int | None:
        """Number of the joint that the current move turns; None when all is done."""
        return None if self.done else self.path.joint_names.index(self.moves[self.current].joint)

    def update(self, q: Vector) -> tuple[Follower, Progress]:
        """The follower with the move that is due for an arm at q, and the arm's progress."""
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
        if abs(remaining) <= min(MADE, 0.5 * abs(end - begin)):  # a short move has to be made, too
            return replace(self, current=self.current + 1).update(q)

        is_on_move = min(begin, end) - self.slack[joint] <= q[joint] <= max(begin, end) + self.slack[joint]
        if not is_on_move:
            return self, self._off(joint, float(q[joint]), float(end))

        share = float(np.clip(1.0 - remaining / (end - begin), 0.0, 1.0))
        is_ending = abs(remaining) <= self.rates[joint] * REACTION_SECONDS
        return self, Progress(self.current, share, remaining, "stop" if is_ending else "move")

    def pass_on(self, q: Vector) -> tuple[Follower, str, str]:
        """Take the current move for made although its end is not reached.

        Returns:
            The follower with the next move, the joint of this one, and what is left of it in words.

        Raises:
            InputError: If more than the tolerance of the route is left, or no move is due.
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
        """The remaining moves from q as they will be made: each for its joint alone, all others stay as they are."""
        return self._from(q, [(move.joint, move.end) for move in self.moves[self.current :]])

    def back(self, q: Vector) -> JointPath:
        """The path back to the beginning: the moves that were made, reversed, each for its joint alone."""
        moves_made = self.moves[: self.current + 1]  # the current one is under way
        return self._from(q, [(move.joint, move.start) for move in moves_made[::-1]])

    def _from(self, q: Vector, ends: list[tuple[str, float]]) -> JointPath:
        rows = [np.array(q, dtype=np.float64)]
        for name, end in ends:
            row = rows[-1].copy()
            row[self.path.joint_names.index(name)] = end
            rows.append(row)
        return self.path.with_waypoints(np.array(rows if len(rows) > 1 else [*rows, *rows]))

    def _lost(self, q: Vector, planned: Vector, moving: int | None) -> Progress | None:
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
    """Tracks an arm along a path, as a value: `update` gives the next one.

    Attributes:
        path: The path.
        rates: Of the joints when they are driven, shape (dof,) [rad/s or m/s].
        tolerance: Largest error of a joint [rad].
        current: 0 until the end is reached, then 1.
        at: Where on the path the arm is, in seconds from its start.
    """

    path: JointPath
    rates: Vector
    tolerance: float = TOLERANCE
    current: int = 0
    at: float = 0.0

    @property
    def moves(self) -> tuple[Move, ...]:
        """None: it has no moves of single joints."""
        return ()

    @cached_property
    def slack(self) -> Vector:
        """How far each joint may be off the path, shape (dof,) [rad or m]."""
        return slack(self.path, self.tolerance)

    @cached_property
    def _times(self) -> Vector:
        """When the arm is at each waypoint if the slowest joint of each piece goes at its rate."""
        times = (np.abs(np.diff(self.path.waypoints, axis=0)) / self.rates).max(axis=1)
        return np.concatenate([[0.0], np.cumsum(times)])

    @property
    def seconds(self) -> float:
        """That the whole path takes."""
        return float(self._times[-1])

    @property
    def done(self) -> bool:
        """Whether the end is reached."""
        return self.current == 1

    @property
    def target(self) -> Vector:
        """Where it ends. Shape (dof,)."""
        return self.path.end

    def joint(self) -> int | None:
        """None: no single joint is due."""
        return None

    def update(self, q: Vector) -> tuple[Track, Progress]:
        """The track with the place that an arm at q has reached, and the arm's progress."""
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
        """The place on the path that is so much ahead of the arm. Shape (dof,)."""
        return self._place(min(self.at + seconds, self.seconds))

    def pass_on(self, q: Vector) -> tuple[Track, str, str]:
        """There is no move that could be passed over.

        Raises:
            InputError: Always.
        """
        raise InputError("no move is due")

    def rest(self, q: Vector) -> JointPath:
        """What remains, from q."""
        waypoints_ahead = self.path.waypoints[np.searchsorted(self._times, self.at, side="right") :]
        return self.path.with_waypoints(
            np.vstack([q, waypoints_ahead if len(waypoints_ahead) else self.path.end[None]])
        )

    def back(self, q: Vector) -> JointPath:
        """The path back to the beginning."""
        waypoints_behind = self.path.waypoints[: np.searchsorted(self._times, self.at, side="right")]
        return self.path.with_waypoints(np.vstack([q, waypoints_behind[::-1]]))

    def _place(self, seconds: float) -> Vector:
        return np.array([np.interp(seconds, self._times, column) for column in self.path.waypoints.T])

    @property
    def share(self) -> float:
        """Of the path that is behind the arm, 0 to 1."""
        return self.at / self.seconds if self.seconds > 0.0 else 1.0

    def _fault(self, q: Vector, joint: int) -> str:
        unit = joint_unit(self.path.prismatic[joint])
        (shown_value, unit_name), (shown_planned, _) = (
            reading(float(row[joint]), unit) for row in (q, self._place(self.at))
        )
        return f"{self.path.joint_names[joint]} is at {shown_value:.2f} {unit_name} instead of {shown_planned:.2f}"


def slack(path: JointPath, tolerance: float = TOLERANCE) -> Vector:
    """Largest error of each joint [rad or m]. Shape (dof,)."""
    return np.where(path.prismatic, SLIDING_TOLERANCE, tolerance)


def path_fault(world: World, path: JointPath) -> str:
    """Why a path is not free any more; "" if it is."""
    faults = path.violations(world)
    return faults[0].reason if faults else ""

"""Following a list of single-joint moves: the next move, what remains of it, when to stop, when the arm is off it.

Source: [1, ch. 6].
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
        return _corners(self.path, self.moves)

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


def slack(path: JointPath, tolerance: float = TOLERANCE) -> Vector:
    """Largest error of each joint [rad or m]. Shape (dof,)."""
    return np.where(path.prismatic, SLIDING_TOLERANCE, tolerance)


def path_fault(world: World, path: JointPath) -> str:
    """Why a path is not free any more; "" if it is."""
    faults = path.violations(world)
    return faults[0].reason if faults else ""


def _corners(path: JointPath, moves: tuple[Move, ...]) -> Matrix:
    """Configurations before and after each move. Shape (moves + 1, dof)."""
    names = list(path.joint_names)
    rows = [np.array(path.start)]
    for move in moves:
        row = rows[-1].copy()
        row[names.index(move.joint)] = move.end
        rows.append(row)
    return np.array(rows)

"""How fast an arm can go: straight stretches from rest to rest within a number of slots of time, and their profile.

Along a stretch the speed grows evenly, stays, and falls evenly, so that speed and acceleration limits are kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory.motion import Trajectory

ROUNDING = 1e-9  # [slots]
SHORTEST_CRUISE = 1e-4  # [slots]
SHORTEST_RAMP = 1e-2  # [slots] where a longer one does not cost the speed limit
NEVER = 1 << 40  # a finite number of slots that is larger than that of any plan


@dataclass(frozen=True, slots=True, eq=False)
class Pace:
    """How fast a robot can go, in slots of time.

    Attributes:
        change: Largest change of each joint in a slot [rad or m], shape (n,).
        rise: Largest growth of that change from a slot to the next [rad or m], shape (n,).
        step: Largest step of the configuration in a slot, joints counted alike [unit of the space]; inf for no bound.
    """

    change: Vector
    rise: Vector
    step: float

    def slots(self, moves: Matrix) -> Vector:
        """Return the least number of slots of straight stretches from rest to rest, as fractions.

        Args:
            moves: From the begin to the end of each stretch, shape (m, n).

        Returns:
            Shape (m,).
        """
        return _slots(*self._needed(moves))

    def whole_slots(self, moves: Matrix) -> NDArray[np.int64]:
        """Return the same number rounded up to whole slots, at most ``NEVER``; shape (m,)."""
        return _whole(self.slots(moves))

    def least_slots(self, moves: Matrix) -> NDArray[np.int64]:
        """Return lower bounds on the whole slots of any motions from rest to rest, straight or not.

        For straight ones :meth:`whole_slots` says more: one joint may need its speed, another one its acceleration.

        Args:
            moves: From the begin to the end of each motion, shape (m, n).

        Returns:
            Shape (m,), at most ``NEVER``.
        """
        distances = np.hstack([np.abs(moves), np.linalg.norm(moves, axis=1)[:, None]])
        fast = distances / np.append(self.change, self.step)
        steep = distances / np.append(self.rise, np.linalg.norm(self.rise))
        return _whole(_slots(fast, steep).max(axis=1))

    def reach(self, move: Vector, slots: int) -> float:
        """Return the largest share of a straight move, shape (n,), that a stretch can make in a number of slots."""
        fast, steep = (float(each[0]) for each in self._needed(move[None]))
        if steep == 0.0:
            return 1.0
        ramp = 0.5 * slots if fast == 0.0 else min(0.5 * slots, steep / fast)
        cruise = slots - ramp
        return min(1.0, cruise * min(1.0 / fast if fast else np.inf, ramp / steep))

    def ramp(self, move: Vector, slots: int) -> float:
        """Return the shortest time of a stretch in which its speed may grow and, at the end, fall [slots].

        Args:
            move: From the begin to the end of the stretch, shape (n,).
            slots: Number of slots of the stretch, not less than it needs.
        """
        fast, steep = (float(each[0]) for each in self._needed(move[None]))
        if steep == 0.0:
            return 0.0
        # A cubic between knots that are nearly one has any acceleration, by rounding alone. So there is no cruise, or,
        # where the speed would be too large then, a longer one: the acceleration grows by its square alone.
        cruise = float(np.sqrt(max(slots**2 - 4.0 * steep, 0.0)))
        if cruise < SHORTEST_CRUISE:
            cruise = 0.0 if 2.0 * fast <= slots else SHORTEST_CRUISE
            return 0.5 * (slots - cruise)
        # As the half of slots - cruise, but without the digits that cancel out for a small move.
        ramp = 2.0 * steep / (slots + cruise)
        return max(ramp, min(SHORTEST_RAMP, slots - fast))

    def shares(self, move: Vector, slots: int) -> Vector:
        """Return the share of a stretch that is done at the begin of each of its slots and at its end, (slots + 1,).

        The arguments are those of :meth:`ramp`.
        """
        ramp = self.ramp(move, slots)
        clock = np.arange(slots + 1.0)
        if ramp == 0.0:
            return clock / slots
        cruise = slots - ramp
        shares = (clock - 0.5 * ramp) / cruise
        begins = clock < ramp
        ends = clock > slots - ramp
        shares[begins] = clock[begins] ** 2 / (2.0 * ramp * cruise)
        shares[ends] = 1.0 - (slots - clock[ends]) ** 2 / (2.0 * ramp * cruise)
        shares[[0, -1]] = 0.0, 1.0
        return shares

    def _needed(self, moves: Matrix) -> tuple[Vector, Vector]:
        """Return the slots that moves take at full speed, and the square slots that their acceleration takes."""
        distances = np.abs(moves)
        fast = np.maximum((distances / self.change).max(axis=1), np.linalg.norm(moves, axis=1) / self.step)
        return fast, (distances / self.rise).max(axis=1)


def _slots(fast: NDArray[np.float64], steep: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the slots of motions from rest to rest: with a cruise at full speed if that is reached."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        cruises = fast > np.sqrt(steep)
        slots: NDArray[np.float64] = np.where(cruises, fast + steep / fast, 2.0 * np.sqrt(steep))
    return slots


def _whole(slots: Vector) -> NDArray[np.int64]:
    return np.minimum(np.ceil(slots - ROUNDING), NEVER).astype(np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Timing:
    """A motion as the places where the arm is at rest; from each to the next one it makes a stretch, or waits.

    Attributes:
        rows: The configurations, shape (m, n).
        slots: The slot at whose begin the arm is there, from 0 on, increasing, shape (m,).
    """

    rows: Matrix
    slots: NDArray[np.int64]

    @property
    def arrival(self) -> int:
        """The slot at whose begin the motion ends."""
        return int(self.slots[-1])

    def each_slot(self, pace: Pace) -> Matrix:
        """Return the configuration at the begin of each slot and at the end, shape (arrival + 1, n)."""
        parts = [self.rows[:1]]
        for k, count in enumerate(np.diff(self.slots).tolist()):
            parts.append(stretch(self.rows[k], self.rows[k + 1], count, pace)[1:])
        return np.vstack(parts)

    def trajectory(self, pace: Pace, slot: float, path: JointPath) -> Trajectory:
        """Return the motion over time, with constant accelerations between knots.

        Args:
            pace: Limits within which the motion was made.
            slot: Length of a slot [s].
            path: Tells the names and units of the joints.
        """
        times = [0.0]
        rows = [self.rows[0]]
        velocities = [np.zeros_like(self.rows[0])]
        accelerations = []

        for k, count in enumerate(np.diff(self.slots).tolist()):
            begin = slot * float(self.slots[k])
            move = self.rows[k + 1] - self.rows[k]
            ramp = slot * pace.ramp(move, count)
            seconds = slot * count
            speed = move / (seconds - ramp)
            growth = speed / ramp if ramp > 0.0 else np.zeros_like(move)

            # The knots where the speed stops growing, begins to fall, and is 0 again.
            if move.any():
                times.append(begin + ramp)
                rows.append(self.rows[k] + 0.5 * ramp * speed)
                velocities.append(speed)
                accelerations.append(growth)
                if seconds - 2.0 * ramp > ROUNDING * seconds:
                    times.append(begin + seconds - ramp)
                    rows.append(self.rows[k + 1] - 0.5 * ramp * speed)
                    velocities.append(speed)
                    accelerations.append(np.zeros_like(move))
            accelerations.append(-growth if move.any() else np.zeros_like(move))
            times.append(slot * float(self.slots[k + 1]))
            rows.append(self.rows[k + 1])
            velocities.append(np.zeros_like(move))

        accelerations.append(accelerations[-1])
        return Trajectory(
            times, rows, velocities, accelerations, joint_names=path.joint_names, prismatic=path.prismatic,
            robot_name=path.robot_name,
        )  # fmt: skip


def stretch(a: Vector, b: Vector, slots: int, pace: Pace) -> Matrix:
    """Return the configurations of a stretch from a to b at the begin of each slot and at its end, (slots + 1, n)."""
    rows: Matrix = a + pace.shares(b - a, slots)[:, None] * (b - a)
    rows[-1] = b
    return rows

"""What the arm does against what it was told, by its readings: another joint, the wrong way, a jump, no motion at all.

On a route `Follower` compares the arm with the route. This one needs none: it knows the set points of the moment.

How a set point and its reading go:

1. the session executes a held command: it tells the supervisor the set point, and gives it to the arm
2. an arm behind a line has a thread, `LineArm`, which sends the set point on and gets a reading for it
3. that thread gives each reading to `Supervisor.read` when it comes. On a fault its next request is a stop, at once,
   and it sends no set point on until the fault is acknowledged: neither page, planner nor camera has a part in that
4. the session looks for the fault in its next step: it ends what is held, and says what has happened

A simulated arm has no thread, and no time but the session's: the session itself gives its readings to the supervisor.
One lock makes each call of the supervisor whole; it holds no other lock meanwhile, and calls nobody.

A thread of a machine that is busy may be late by more than the 0.1 s in which an arm moves by a degree. So a set point
expires at the arm itself, see `Supervisor.room` and `LineArm`.
"""

from __future__ import annotations

import threading

import numpy as np

from rrtik_ompl.base.arrays import Mask, Vector
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.routes.follower import SLIDING_TOLERANCE, TOLERANCE

FASTEST = 1.5  # times its rate, which a joint may move
REACTION_SECONDS = 0.08  # from a reading until an arm that is told to stop then stands
HUNTING_SECONDS = 0.065  # the same for a joint that goes back where it came from, which is free: valves hunt a little
READING_SECONDS = 0.03  # between two readings, at least: shorter times give no speed
LONGEST_GAP = 0.3  # [s] between two readings that is allowed for; a joint may move so long unseen
COAST_SECONDS = 0.4  # a joint that is stopped or reversed may take as long to do it
REST_SECONDS = 1.5  # for as long after a stop the arm is watched
GOING_ON = 3  # changes of its readings after a stop, which an arm that was put elsewhere at rest does not have
FOLLOW_SECONDS = 0.4  # a joint that is driven moves within that time
NOISE = 0.05  # of the slack: a smaller change of a reading is none
ASKED = 0.25  # of the way that a set point is ahead: an arm nearer to it need not move


def slack_of(robot: Robot) -> Vector:
    """How far each joint may be from what it was told, shape (dof,) [rad or m]: a degree, or 2 mm."""
    return np.where(robot.prismatic, SLIDING_TOLERANCE, TOLERANCE)


def amount(value: float, *, prismatic: bool) -> str:
    """A way of a joint in words.

    Example:
        >>> amount(-0.0105, prismatic=False)
        '0.6 deg'
    """
    shown, unit = reading(abs(value), joint_unit(prismatic))
    return f"{shown:.1f} {unit}" if unit == "deg" else f"{shown:.4f} {unit}"


class Supervisor:
    """Watches an arm while it is driven, and until it has come to rest. May be called from several threads.

    All times given are of one clock [s]: that of whoever reads the arm.

    Attributes:
        fault: What the arm has done that it was not told, with joint and amount; "" if nothing. It stays until
            `acknowledge`.
    """

    def __init__(self, robot: Robot, rates: Vector) -> None:
        """Begin at rest.

        Args:
            robot: The arm.
            rates: Of its joints at full speed, shape (dof,) [rad/s or m/s].
        """
        self.fault = ""
        self._lock = threading.Lock()
        self._names = robot.joint_names
        self._prismatic = robot.prismatic
        self._rates = rates
        self._slack = slack_of(robot)
        self._q: Vector | None = None
        self._time = -np.inf
        self._changed = -np.inf
        self._rest_until = -np.inf
        self._active = False

        zeros = np.zeros(robot.dof)
        self._way = zeros.copy()  # of each joint that is driven: 1 up, -1 down; 0 if it has to stand still
        self._aim = zeros.copy()  # where each joint is told to be
        self._ahead = zeros.copy()  # how far at most the set point is ahead of the arm
        self._back = zeros.copy()  # how far a joint has gone against its way
        self._used = 0.0  # share of the slack by which the worst joint is off at the last reading
        self._changes = 0  # of the readings, since the arm should stand
        self._room = self._slack.copy()  # how far a joint may be faster than its rate allows
        self._good_at = zeros.copy()  # when each joint was last where it should be
        self._coasts_until = np.full(robot.dof, -np.inf)
        self._coast_way = zeros.copy()  # in which a joint that coasts was driven
        self._mark = zeros.copy()  # where each joint has moved last
        self._mark_time = zeros.copy()  # and when

    def acknowledge(self) -> None:
        """The fault is known to the pilot: the arm may be driven again."""
        with self._lock:
            self.fault = ""

    def room(self) -> float:
        """Share of the slack that is left at the last reading, 0 to 1; 0 while there is a fault.

        An arm that may move only as long as it takes for that much cannot go farther than the slack unseen.
        """
        with self._lock:
            return 0.0 if self.fault else max(1.0 - self._used, 0.0)

    def told(self, aim: Vector, ahead: Vector, q: Vector, time: float) -> None:
        """The arm was sent to a set point.

        Args:
            aim: Shape (dof,) [rad or m]; where the arm is, for joints that shall stand still.
            ahead: How far the set point of each joint is ahead of the arm at most, shape (dof,).
            q: Where the arm is.
            time: Now [s].
        """
        with self._lock:
            back = self._back.copy()
            if not self._active:
                self._begin(q, time)

            away = aim - q
            way = np.where(np.abs(away) > 0.0, np.sign(away), self._way)
            turned = (way != self._way) & (self._way != 0.0)
            new = way != self._way
            again = (time <= self._rest_until) & (way == self._coast_way)  # what it did before the stop still counts

            self._coasts_until[turned] = time + COAST_SECONDS
            self._coast_way[turned] = self._way[turned]
            self._coasts_until[again] = -np.inf
            self._back[new] = np.where(again, back, 0.0)[new]
            self._good_at[new] = time
            self._mark[new] = q[new]
            self._mark_time[new] = time

            self._way = way
            self._ahead = ahead
            self._aim = np.where(way != 0.0, aim, self._aim)

    def stopped(self, time: float) -> None:
        """The arm was told to stop; what was driven comes to rest."""
        with self._lock:
            if not self._active:
                return

            driven = self._way != 0.0
            self._coasts_until[driven] = time + COAST_SECONDS
            self._coast_way[driven] = self._way[driven]
            self._active = False
            self._rest_until = time + REST_SECONDS
            self._changes = 0
            self._way[:] = 0.0

    def read(self, q: Vector, time: float) -> None:
        """Compare a reading, shape (dof,), with what the arm was told; sets `fault`."""
        with self._lock:
            before = self._q
            self._q = q.copy()
            back_in_time = time < self._time
            self._time = time
            watched = self._active or time <= self._rest_until
            if before is None or back_in_time or not watched:
                self._begin(q, time, active=self._active)
                return

            gap = min(time - self._changed, LONGEST_GAP)
            if (q != before).any():
                self._changed = time
                self._changes += int((time >= self._coasts_until).all())

            found = self._too_fast(q - before, gap)
            if found and not self._active:  # at rest an arm may be put elsewhere
                self._begin(q, time, active=False)
                return

            self.fault = self.fault or found or self._elsewhere(q, q - before, time)
            self._note_motion(q, time)

    def standing(self, time: float) -> tuple[int, float, float] | None:
        """A driven joint that does not move: its number, by how much it has moved, and in what time; None if none."""
        with self._lock:
            if not self._active or self._q is None:
                return None

            patience = np.maximum(FOLLOW_SECONDS, 0.4 * NOISE * self._slack / np.maximum(self._ahead, 1e-9))
            late = (self._way != 0.0) & (time - self._mark_time > patience)
            if not late.any():
                return None

            joint = int(np.flatnonzero(late)[0])
            return joint, float(abs(self._q[joint] - self._mark[joint])), float(time - self._mark_time[joint])

    def _amount(self, joint: int, value: float) -> str:
        return amount(value, prismatic=bool(self._prismatic[joint]))

    def _begin(self, q: Vector, time: float, active: bool = True) -> None:
        """The arm is where it is: from here on it is compared."""
        if self._q is None:
            self._q = q.copy()
        self._aim = np.where(self._way != 0.0, self._aim, q)
        self._back[:] = 0.0
        self._good_at[:] = time
        self._room = self._slack.copy()
        self._used = 0.0
        self._changed = time
        self._active = active
        self._mark = q.copy()
        self._mark_time = np.full(len(q), time)

    def _too_fast(self, change: Vector, gap: float) -> str:
        """Whether a joint has moved farther than its rate allows."""
        if not change.any():
            return ""

        allowed = FASTEST * self._rates * gap
        room = self._room + allowed - np.abs(change)
        self._room = np.minimum(np.maximum(room, 0.0), self._slack)
        if (room >= 0.0).all():
            return ""

        joint = int(room.argmin())
        name = self._names[joint]
        far = self._amount(joint, float(change[joint]))
        if abs(change[joint]) > self._slack[joint] + allowed[joint]:
            return f"{name} jumped by {far} between two readings"
        return f"{name} moves faster than {self._amount(joint, FASTEST * float(self._rates[joint]))}/s"

    def _elsewhere(self, q: Vector, change: Vector, time: float) -> str:
        """Whether a joint would be farther than the slack from where it should be before the arm could stand."""
        coasts = time < self._coasts_until
        stops = coasts & (self._way == 0.0)
        turns = coasts & (self._way != 0.0)
        self._aim = np.where(stops, q, self._aim)
        way = np.where(stops, self._coast_way, self._way)
        self._back = np.where(turns, 0.0, np.maximum(self._back - way * change, 0.0))
        wrong = np.where(way != 0.0, self._back, np.abs(q - self._aim))
        self._good_at[wrong <= NOISE * self._slack] = time

        speed = wrong / np.maximum(time - self._good_at, READING_SECONDS)
        reaction = np.where(way != 0.0, HUNTING_SECONDS, REACTION_SECONDS)
        excess = np.where(wrong > NOISE * self._slack, wrong + reaction * speed, 0.0) / self._slack
        over = np.where(coasts, 0.0, self._way * (q - self._aim)) / self._slack
        self._used = float(max((wrong / self._slack).max(), over.max()))

        joint = int(excess.argmax())
        if excess[joint] > 1.0 and way[joint] != 0.0:
            return f"{self._names[joint]} goes the wrong way, by {self._amount(joint, float(wrong[joint]))}"
        if excess[joint] > 1.0 and (self._active or self._changes >= GOING_ON):
            return self._says(joint, float(wrong[joint]))

        joint = int(over.argmax())
        if over[joint] > 1.0:
            return f"{self._names[joint]} went {self._amount(joint, float(q[joint] - self._aim[joint]))} too far"
        return ""

    def _says(self, joint: int, wrong: float) -> str:
        name = self._names[joint]
        far = self._amount(joint, wrong)
        if not self._active:
            return f"{name} moved on by {far} after the stop"
        driven = [each for each, way in zip(self._names, self._way, strict=True) if way != 0.0]
        told = driven[0] if len(driven) == 1 else "others"
        return f"{name} moved by {far} while {told} was driven" if driven else f"{name} moved by {far} untold"

    def _note_motion(self, q: Vector, time: float) -> None:
        """Where joints that are driven have moved last, or need not move."""
        asked: Mask = self._way * (self._aim - q) >= ASKED * self._ahead
        new = ~asked | (np.abs(q - self._mark) >= NOISE * self._slack)
        self._mark[new] = q[new]
        self._mark_time[new] = time

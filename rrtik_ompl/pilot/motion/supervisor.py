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
MIN_LEAD_SHARE = 0.25  # of the way that a set point is ahead: an arm nearer to it need not move


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
        self._time = -np.inf  # of the last reading
        self._last_change_time = -np.inf  # of a reading that was another one than that before it
        self._watch_until = -np.inf  # after a stop
        self._active = False  # whether it is driven

        zeros = np.zeros(robot.dof)
        self._direction = zeros.copy()  # of each joint that is driven: 1 up, -1 down; 0 if it has to stand still
        self._set_point = zeros.copy()  # where each joint is told to be
        self._max_lead = zeros.copy()  # how far at most the set point is ahead of the arm
        self._wrong_way_travel = zeros.copy()  # how far a joint has gone against its way
        self._slack_used = 0.0  # share of the slack by which the worst joint is off at the last reading
        self._changes_after_stop = 0  # of the readings, since the arm should stand
        self._speed_allowance = self._slack.copy()  # how far a joint may be faster than its rate allows
        self._last_good_time = zeros.copy()  # when each joint was last where it should be
        self._coasts_until = np.full(robot.dof, -np.inf)  # after a stop, or a change of direction
        self._coast_direction = zeros.copy()  # in which a joint that coasts was driven
        self._position_at_last_move = zeros.copy()  # where each joint has moved last
        self._time_of_last_move = zeros.copy()  # and when

    def acknowledge(self) -> None:
        """The fault is known to the pilot: the arm may be driven again."""
        with self._lock:
            self.fault = ""

    def room(self) -> float:
        """Share of the slack that is left at the last reading, 0 to 1; 0 while there is a fault.

        An arm that may move only as long as it takes for that much cannot go farther than the slack unseen.
        """
        with self._lock:
            return 0.0 if self.fault else max(1.0 - self._slack_used, 0.0)

    def told(self, set_point: Vector, max_lead: Vector, q: Vector, time: float) -> None:
        """The arm was sent to a set point.

        Args:
            set_point: Shape (dof,) [rad or m]; where the arm is, for joints that shall stand still.
            max_lead: How far the set point of each joint is ahead of the arm at most, shape (dof,).
            q: Where the arm is.
            time: Now [s].
        """
        with self._lock:
            wrong_way_travel = self._wrong_way_travel.copy()
            if not self._active:
                self._restart(q, time)

            to_go = set_point - q
            direction = np.where(np.abs(to_go) > 0.0, np.sign(to_go), self._direction)
            is_reversed = (direction != self._direction) & (self._direction != 0.0)
            has_new_direction = direction != self._direction
            # A joint that goes on as before a stop: what it did before the stop still counts.
            resumes = (time <= self._watch_until) & (direction == self._coast_direction)

            self._coasts_until[is_reversed] = time + COAST_SECONDS
            self._coast_direction[is_reversed] = self._direction[is_reversed]
            self._coasts_until[resumes] = -np.inf
            self._wrong_way_travel[has_new_direction] = np.where(resumes, wrong_way_travel, 0.0)[has_new_direction]
            self._last_good_time[has_new_direction] = time
            self._position_at_last_move[has_new_direction] = q[has_new_direction]
            self._time_of_last_move[has_new_direction] = time

            self._direction = direction
            self._max_lead = max_lead
            self._set_point = np.where(direction != 0.0, set_point, self._set_point)

    def stopped(self, time: float) -> None:
        """The arm was told to stop; what was driven comes to rest."""
        with self._lock:
            if not self._active:
                return

            driven = self._direction != 0.0
            self._coasts_until[driven] = time + COAST_SECONDS
            self._coast_direction[driven] = self._direction[driven]
            self._active = False
            self._watch_until = time + REST_SECONDS
            self._changes_after_stop = 0
            self._direction[:] = 0.0

    def read(self, q: Vector, time: float) -> None:
        """Compare a reading, shape (dof,), with what the arm was told; sets `fault`."""
        with self._lock:
            last_q = self._q
            self._q = q.copy()
            back_in_time = time < self._time
            self._time = time
            is_watched = self._active or time <= self._watch_until
            if last_q is None or back_in_time or not is_watched:
                self._restart(q, time, active=self._active)
                return

            interval = min(time - self._last_change_time, LONGEST_GAP)
            if (q != last_q).any():
                self._last_change_time = time
                self._changes_after_stop += int((time >= self._coasts_until).all())

            speed_fault = self._too_fast(q - last_q, interval)
            if speed_fault and not self._active:  # at rest an arm may be put elsewhere
                self._restart(q, time, active=False)
                return

            self.fault = self.fault or speed_fault or self._off_course(q, q - last_q, time)
            self._note_motion(q, time)

    def standing(self, time: float) -> tuple[int, float, float] | None:
        """A driven joint that does not move: its number, by how much it has moved, and in what time; None if none."""
        with self._lock:
            if not self._active or self._q is None:
                return None

            patience = np.maximum(FOLLOW_SECONDS, 0.4 * NOISE * self._slack / np.maximum(self._max_lead, 1e-9))
            is_late = (self._direction != 0.0) & (time - self._time_of_last_move > patience)
            if not is_late.any():
                return None

            joint = int(np.flatnonzero(is_late)[0])
            moved = abs(self._q[joint] - self._position_at_last_move[joint])
            return joint, float(moved), float(time - self._time_of_last_move[joint])

    def _amount_in_words(self, joint: int, value: float) -> str:
        return amount(value, prismatic=bool(self._prismatic[joint]))

    def _restart(self, q: Vector, time: float, active: bool = True) -> None:
        """Take the arm's place for right: from here on it is compared."""
        if self._q is None:
            self._q = q.copy()
        self._set_point = np.where(self._direction != 0.0, self._set_point, q)
        self._wrong_way_travel[:] = 0.0
        self._last_good_time[:] = time
        self._speed_allowance = self._slack.copy()
        self._slack_used = 0.0
        self._last_change_time = time
        self._active = active
        self._position_at_last_move = q.copy()
        self._time_of_last_move = np.full(len(q), time)

    def _too_fast(self, change: Vector, interval: float) -> str:
        """What a joint has done that has moved farther than its rate allows, in words; "" if none has."""
        if not change.any():
            return ""

        allowed = FASTEST * self._rates * interval
        allowance = self._speed_allowance + allowed - np.abs(change)
        self._speed_allowance = np.minimum(np.maximum(allowance, 0.0), self._slack)
        if (allowance >= 0.0).all():
            return ""

        joint = int(allowance.argmin())
        name = self._names[joint]
        distance = self._amount_in_words(joint, float(change[joint]))
        if abs(change[joint]) > self._slack[joint] + allowed[joint]:
            return f"{name} jumped by {distance} between two readings"
        return f"{name} moves faster than {self._amount_in_words(joint, FASTEST * float(self._rates[joint]))}/s"

    def _off_course(self, q: Vector, change: Vector, time: float) -> str:
        """What a joint has done that would be off by more than the slack before the arm could stand; "" if none is."""
        is_coasting = time < self._coasts_until
        is_stopping = is_coasting & (self._direction == 0.0)
        is_turning = is_coasting & (self._direction != 0.0)
        self._set_point = np.where(is_stopping, q, self._set_point)
        direction = np.where(is_stopping, self._coast_direction, self._direction)
        self._wrong_way_travel = np.where(is_turning, 0.0, np.maximum(self._wrong_way_travel - direction * change, 0.0))
        deviation = np.where(direction != 0.0, self._wrong_way_travel, np.abs(q - self._set_point))
        self._last_good_time[deviation <= NOISE * self._slack] = time

        speed = deviation / np.maximum(time - self._last_good_time, READING_SECONDS)
        reaction = np.where(direction != 0.0, HUNTING_SECONDS, REACTION_SECONDS)
        excess = np.where(deviation > NOISE * self._slack, deviation + reaction * speed, 0.0) / self._slack
        overshoot = np.where(is_coasting, 0.0, self._direction * (q - self._set_point)) / self._slack
        self._slack_used = float(max((deviation / self._slack).max(), overshoot.max()))

        joint = int(excess.argmax())
        if excess[joint] > 1.0 and direction[joint] != 0.0:
            return (
                f"{self._names[joint]} goes the wrong way, by {self._amount_in_words(joint, float(deviation[joint]))}"
            )
        if excess[joint] > 1.0 and (self._active or self._changes_after_stop >= GOING_ON):
            return self._off_course_in_words(joint, float(deviation[joint]))

        joint = int(overshoot.argmax())
        if overshoot[joint] > 1.0:
            beyond = self._amount_in_words(joint, float(q[joint] - self._set_point[joint]))
            return f"{self._names[joint]} went {beyond} too far"
        return ""

    def _off_course_in_words(self, joint: int, deviation: float) -> str:
        name = self._names[joint]
        distance = self._amount_in_words(joint, deviation)
        if not self._active:
            return f"{name} moved on by {distance} after the stop"
        driven = [self._names[k] for k in np.flatnonzero(self._direction != 0.0)]
        if not driven:
            return f"{name} moved by {distance} untold"
        what_was_driven = driven[0] if len(driven) == 1 else "others"
        return f"{name} moved by {distance} while {what_was_driven} was driven"

    def _note_motion(self, q: Vector, time: float) -> None:
        """Where joints that are driven have moved last, or need not move."""
        must_move: Mask = self._direction * (self._set_point - q) >= MIN_LEAD_SHARE * self._max_lead
        moved = ~must_move | (np.abs(q - self._position_at_last_move) >= NOISE * self._slack)
        self._position_at_last_move[moved] = q[moved]
        self._time_of_last_move[moved] = time

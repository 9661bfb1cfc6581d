"""Compare the readings of the arm with its set points: another joint, the wrong direction, a jump, or no motion at all.

On a route `Follower` compares the arm with the route. The supervisor needs no route: it knows only the present set
points. A set point and its reading take this way:

1. the session executes a held command: it passes the set point to the supervisor, and then to the arm
2. an arm behind a line has a thread, `LineArm`, which sends the set point on and receives a reading for it
3. that thread passes each reading to `Supervisor.read` when it comes. On a fault its next request is a stop, at once,
   and it sends no further set point until the fault is acknowledged: page, planner and camera have no part in that
4. the session checks for a fault in its next step: it ends the held command, and reports what has happened

A simulated arm has no thread, and no time but the session's: the session itself passes its readings to the supervisor.
One lock makes each call of the supervisor atomic. While holding it, the supervisor takes no other lock and calls no
other component, so that it cannot deadlock.

On a busy machine a thread may be late by more than the 0.1 s in which an arm moves by a degree. So a set point also
expires at the arm itself, see `Supervisor.room` and `LineArm`.
"""

from __future__ import annotations

import threading

import numpy as np

from rrtik_ompl.base.arrays import Mask, Vector
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.routes.follower import SLIDING_TOLERANCE, TOLERANCE
from rrtik_ompl.pilot.state import FIRST_SECONDS, LEASH_SECONDS, LEAST_LEASH_SECONDS, leash

FAULTS = {
    "jump": "{joint} jumped by {amount} between two readings",
    "fast": "{joint} moves faster than {amount}/s",
    "reverse": "{joint} goes the wrong way, by {amount}",
    "other": "{joint} moved by {amount} while {driven} driven",
    "untold": "{joint} moved by {amount} untold",
    "runaway": "{joint} moved on by {amount} after the stop",
    "beyond": "{joint} went {amount} too far",
    "dead": "{joint} does not move ({amount} in {seconds:.1f} s)",
}  # what an arm can do against its set points, however it is driven; the last is no fault that is latched

FASTEST = 1.5  # a joint may move at this multiple of its rate
REACTION_SECONDS = 0.08  # time from a reading until an arm that is stopped because of it stands still
# The same for a joint that moves backwards. It may be shorter: the way back is free, and valves oscillate a little.
HUNTING_SECONDS = 0.065
READING_SECONDS = 0.03  # least interval for an estimate of speed: shorter ones are too noisy
LONGEST_GAP = 0.3  # [s]; longest interval between two readings for which motion is allowed for
COAST_SECONDS = 0.4  # a joint that is stopped or reversed may coast for this long
REST_SECONDS = 1.5  # the arm is watched for this long after a stop
# This many changed readings after a stop mean that the arm moves on. An arm that was moved by hand shows fewer.
GOING_ON = 3
FOLLOW_SECONDS = 0.4  # a driven joint must begin to move within this time
NOISE = 0.05  # share of the slack; smaller changes of a reading are noise
# Share of the largest lead of a set point; a joint that is nearer to its set point need not move.
MIN_LEAD_SHARE = 0.25
# Whatever is sent, a joint goes no farther than this, as time at its rate, beyond the reading before the last one that
# has shown it moving: so far does an arm go whose readings stand still from then on, until that is named.
UNCONFIRMED_SECONDS = 0.095
ROUNDING = 1e-9  # [rad or m]


def slack_of(robot: Robot) -> Vector:
    """Return how far each joint may be from its set point, shape (dof,) [rad or m]: a degree, or 2 mm."""
    return np.where(robot.prismatic, SLIDING_TOLERANCE, TOLERANCE)


def amount(value: float, *, prismatic: bool) -> str:
    """Return the distance that a joint has moved, with its unit, in words.

    Example:
        >>> amount(-0.0105, prismatic=False)
        '0.6 deg'
    """
    shown, unit = reading(abs(value), joint_unit(prismatic))
    return f"{shown:.1f} {unit}" if unit == "deg" else f"{shown:.4f} {unit}"


class Supervisor:
    """Watch an arm while it is driven, and until it has come to rest. Its methods may be called from several threads.

    All times are of one clock [s]: that of the component that reads the arm.

    Attributes:
        fault: What the arm did against its set points, with joint and amount; "" if nothing. It stays until
            `acknowledge` is called.
    """

    def __init__(self, robot: Robot, rates: Vector) -> None:
        """Begin with an arm at rest.

        Args:
            robot: The arm.
            rates: Rates of its joints at full speed, shape (dof,) [rad/s or m/s].
        """
        self.fault = ""
        self._lock = threading.Lock()
        self._names = robot.joint_names
        self._prismatic = robot.prismatic
        self._rates = rates
        self._slack = slack_of(robot)
        self._q: Vector | None = None
        self._time = -np.inf  # time of the last reading
        self._last_change_time = -np.inf  # time of the last reading that differed from its predecessor
        self._watch_until = -np.inf  # end of the watch after a stop
        self._active = False  # whether it is driven
        self._told_at = -np.inf  # time of the last set point

        zeros = np.zeros(robot.dof)
        self._direction = zeros.copy()  # direction of each driven joint: 1 up, -1 down; 0 if it must stand still
        self._set_point = zeros.copy()  # where each joint shall be
        self._speed = zeros.copy()  # speed at which each joint shall move
        self._max_lead = zeros.copy()  # largest lead of the set point over the arm
        self._wrong_way_travel = zeros.copy()  # how far each joint has moved against its direction
        self._slack_used = 0.0  # error of the worst joint at the last reading, as a share of its slack
        self._changes_after_stop = 0  # number of changed readings since the arm should stand still
        # Distance by which each joint may still exceed what its rate allows; a leaky bucket of the size of the slack.
        self._speed_allowance = self._slack.copy()
        self._last_good_time = zeros.copy()  # when each joint was last where it should be
        self._coasts_until = np.full(robot.dof, -np.inf)  # end of coasting after a stop or a change of direction
        self._coast_direction = zeros.copy()  # direction in which a coasting joint was driven
        self._confirmed = zeros.copy()  # value of each joint at the last reading that has shown it moving
        self._confirmed_step = zeros.copy()  # how far it had moved since the one before, forwards or backwards
        self._position_at_last_move = zeros.copy()  # value of each joint at its last motion
        self._time_of_last_move = zeros.copy()  # and the time of it

    def acknowledge(self) -> None:
        """Clear the fault, which the pilot has acknowledged: the arm may be driven again."""
        with self._lock:
            self.fault = ""

    def room(self) -> float:
        """Return the share of the slack that is left at the last reading, from 0 to 1; 0 while there is a fault.

        If a set point is valid only for the time in which the arm can use up this share, the arm cannot leave the slack
        unobserved.
        """
        with self._lock:
            return 0.0 if self.fault else max(1.0 - self._slack_used, 0.0)

    def told(self, set_point: Vector, speed: Vector, q: Vector, time: float) -> Vector:
        """Register a set point that shall be sent to the arm, and return the one that may be sent, shape (dof,).

        A joint that changes its direction may coast first, and its error counts from now on. A joint that goes on in
        the direction it had before a stop keeps its error, so that repeated stops cannot hide a motion in the wrong
        direction.

        Args:
            set_point: Shape (dof,) [rad or m]; for joints that shall stand still, their present value.
            speed: Speed at which each joint shall go there, shape (dof,) [rad/s or m/s].
            q: Present configuration, shape (dof,) [rad or m].
            time: Current time [s].
        """
        with self._lock:
            wrong_way_travel = self._wrong_way_travel.copy()
            if not self._active:
                self._restart(q, time)

            set_point = self._within_reach(set_point, speed, q, time)
            to_go = set_point - q
            direction = np.where(np.abs(to_go) > 0.0, np.sign(to_go), self._direction)
            is_reversed = (direction != self._direction) & (self._direction != 0.0)
            has_new_direction = direction != self._direction
            # A joint that goes on in its direction of before a stop keeps the error that it had then.
            resumes = (time <= self._watch_until) & (direction == self._coast_direction)

            self._coasts_until[is_reversed] = time + COAST_SECONDS
            self._coast_direction[is_reversed] = self._direction[is_reversed]
            self._coasts_until[resumes] = -np.inf
            self._wrong_way_travel[has_new_direction] = np.where(resumes, wrong_way_travel, 0.0)[has_new_direction]
            self._last_good_time[has_new_direction] = time
            self._position_at_last_move[has_new_direction] = q[has_new_direction]
            self._time_of_last_move[has_new_direction] = time

            self._direction = direction
            self._speed = speed
            self._max_lead = leash(speed, self._rates)
            self._set_point = np.where(direction != 0.0, set_point, self._set_point)
            return set_point

    def stopped(self, time: float) -> None:
        """Register a stop: the driven joints may coast, and the arm is watched until it has come to rest."""
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
        """Compare a reading, shape (dof,), with the set points; sets `fault`.

        The comparison starts anew at the first reading, when time goes backwards, and while the arm is not watched.
        """
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
            if speed_fault and not self._active:  # an arm at rest may be moved by hand
                self._restart(q, time, active=False)
                return

            self.fault = self.fault or speed_fault or self._off_course(q, q - last_q, time)
            self._note_motion(q, time)

    def standing(self, time: float) -> tuple[int, float, float] | None:
        """Return a driven joint that does not move, if there is one.

        Returns:
            The number of the joint, how far it has moved [rad or m], and within what time [s]; None if every driven
            joint moves or is near its set point.
        """
        with self._lock:
            if not self._active or self._q is None:
                return None

            visible_after = NOISE * self._slack / np.maximum(self._speed, 1e-9)
            patience = np.maximum(FOLLOW_SECONDS, 4.0 * visible_after)
            is_late = (self._direction != 0.0) & (time - self._time_of_last_move > patience)
            if not is_late.any():
                return None

            joint = int(np.flatnonzero(is_late)[0])
            moved = abs(self._q[joint] - self._position_at_last_move[joint])
            return joint, float(moved), float(time - self._time_of_last_move[joint])

    def _within_reach(self, wanted: Vector, speed: Vector, q: Vector, time: float) -> Vector:
        """Return the set point next to a wanted one that may be sent now, shape (dof,).

        It is near enough that an arm which moves while its readings stand still stops by itself within
        `UNCONFIRMED_SECONDS` of motion. It advances no faster than the joint shall move: an arm that is too fast gains
        nothing by it. No joint is sent back for these reasons: readings that come late stand still at times while an
        honest arm is on its way, and one that has overshot would hunt. It is on the straight motion to the wanted one,
        which was checked.
        """
        step = np.abs(self._confirmed_step)
        reach = np.maximum(UNCONFIRMED_SECONDS * self._rates - step, LEAST_LEASH_SECONDS * self._rates)

        advance = speed * float(np.clip(time - self._told_at, 0.0, LEASH_SECONDS))
        self._told_at = time

        sent = self._set_point
        low = np.maximum(q - reach, np.minimum(q, sent) - advance)
        high = np.minimum(q + reach, np.maximum(q, sent) + advance)

        to_go = wanted - q
        room = np.where(to_go > 0.0, np.maximum(high, sent) - q, q - np.minimum(low, sent))
        is_limited = np.abs(to_go) > room + ROUNDING
        share = np.divide(room, np.abs(to_go), out=np.ones_like(q), where=is_limited).min()
        return np.where(share < 1.0, q + share * to_go, wanted)

    def _amount_in_words(self, joint: int, value: float) -> str:
        return amount(value, prismatic=bool(self._prismatic[joint]))

    def _restart(self, q: Vector, time: float, active: bool = True) -> None:
        """Start the comparison anew at a configuration, which is taken as correct."""
        if self._q is None:
            self._q = q.copy()
        self._set_point = np.where(self._direction != 0.0, self._set_point, q)
        self._told_at = time - FIRST_SECONDS
        self._wrong_way_travel[:] = 0.0
        self._last_good_time[:] = time
        self._speed_allowance = self._slack.copy()
        self._slack_used = 0.0
        self._last_change_time = time
        self._active = active
        self._confirmed = q.copy()
        self._confirmed_step[:] = 0.0
        self._position_at_last_move = q.copy()
        self._time_of_last_move = np.full(len(q), time)

    def _too_fast(self, change: Vector, interval: float) -> str:
        """Return, in words, which joint has moved farther than its rate allows; "" if none has.

        Each joint has an allowance of distance, at most its slack. It is refilled at `FASTEST` times the rate and used
        up by motion, so that irregular readings alone are no fault.

        Args:
            change: Difference of the last two readings, shape (dof,) [rad or m].
            interval: Time between them [s].
        """
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
            return FAULTS["jump"].format(joint=name, amount=distance)
        fastest = self._amount_in_words(joint, FASTEST * float(self._rates[joint]))
        return FAULTS["fast"].format(joint=name, amount=fastest)

    def _off_course(self, q: Vector, change: Vector, time: float) -> str:
        """Return, in words, which joint would leave its slack before the arm could be stopped; "" if none would.

        The deviation of a driven joint is its travel against its direction; that of another joint is its distance from
        its set point. Deviation plus speed times reaction time must stay within the slack. Joints that coast are
        treated leniently: after a stop they may go on in their direction, after a reversal they may still go back. A
        driven joint must also not overshoot its set point by more than the slack.

        Args:
            q: The reading, shape (dof,) [rad or m].
            change: Difference from the reading before, shape (dof,).
            time: Time of the reading [s].
        """
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
            wrong_way = self._amount_in_words(joint, float(deviation[joint]))
            return FAULTS["reverse"].format(joint=self._names[joint], amount=wrong_way)
        if excess[joint] > 1.0 and (self._active or self._changes_after_stop >= GOING_ON):
            return self._off_course_in_words(joint, float(deviation[joint]))

        joint = int(overshoot.argmax())
        if overshoot[joint] > 1.0:
            beyond = self._amount_in_words(joint, float(q[joint] - self._set_point[joint]))
            return FAULTS["beyond"].format(joint=self._names[joint], amount=beyond)
        return ""

    def _off_course_in_words(self, joint: int, deviation: float) -> str:
        name = self._names[joint]
        distance = self._amount_in_words(joint, deviation)
        if not self._active:
            return FAULTS["runaway"].format(joint=name, amount=distance)
        driven = [self._names[k] for k in np.flatnonzero(self._direction != 0.0)]
        if not driven:
            return FAULTS["untold"].format(joint=name, amount=distance)
        what_was_driven = f"{driven[0]} was" if len(driven) == 1 else "others were"
        return FAULTS["other"].format(joint=name, amount=distance, driven=what_was_driven)

    def _note_motion(self, q: Vector, time: float) -> None:
        """Store value and time for each joint that has moved, or that need not move since it is near its set point."""
        step = q - self._confirmed
        is_confirmed = np.abs(step) >= NOISE * self._slack
        self._confirmed_step[is_confirmed] = step[is_confirmed]
        self._confirmed[is_confirmed] = q[is_confirmed]

        must_move: Mask = self._direction * (self._set_point - q) >= MIN_LEAD_SHARE * self._max_lead
        moved = ~must_move | (np.abs(q - self._position_at_last_move) >= NOISE * self._slack)
        self._position_at_last_move[moved] = q[moved]
        self._time_of_last_move[moved] = time

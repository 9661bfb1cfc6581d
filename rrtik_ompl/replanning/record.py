"""The record of a run: every tick with configuration, path, poses of obstacles and times; written and read as JSON.

Each shape of the seen scenes is written once, and of each scene only what differs from the scene before it.
"""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import (
    Mask,
    Matrix,
    Vector,
    finite_array,
    finite_number,
    frozen,
    not_negative,
    positive,
    whole_number,
)
from rrtik_ompl.base.choices import RunOutcome, TickEvent, one_of
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import InputError, in_file, listed, require
from rrtik_ompl.base.poses import pose_from_xyzw, pose_row
from rrtik_ompl.files.kinds import read
from rrtik_ompl.files.tables import json_object
from rrtik_ompl.files.text import read_text, write_text
from rrtik_ompl.model.certificate import Certificate, Route
from rrtik_ompl.model.judgement import Contact, Judged, PathContact, Verdict
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.result import required
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Motion, Obstacle, Scene, TimedPoses, Touching
from rrtik_ompl.model.shapes import SHAPES, PointCloud, Shape
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.replanning.faults import ANSWERS, Fault
from rrtik_ompl.replanning.feed import Feed, Snapshot
from rrtik_ompl.replanning.judge import RunViolation, run_violations
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.replanning.unavoidable import Unavoidable
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

KIND = "replan_run"
NOWHERE = np.full(3, np.nan)  # Violations have no known point of contact.
MOST_POINTS = 2_000_000  # number of points in all clouds that a record keeps
MAX_RECORD_BYTES = 512 * 1024 * 1024  # size of a record, enough for half an hour of 20 obstacles at 50 Hz
EVENTS: tuple[TickEvent, ...] = get_args(TickEvent)
OUTCOMES: tuple[RunOutcome, ...] = get_args(RunOutcome)

Json = dict[str, Any]


@dataclass(slots=True, eq=False)
class ReplanRun:
    """The record of a robot that moved to its goal through a scene that changes.

    Attributes:
        problem, robot, joint_names, planner, seed: Names of the problem, robot, joints and planner, and the seed.
        step, rate, margin, speed_bound: As given to :func:`replan` [unit of the space, Hz, m, m/s].
        ticks: The ticks in the order of time.
        clearance: Distance that proven moves keep from obstacles in addition to ``margin`` [m]; None in old records.
        scenes: The scenes that were seen, in the order of time; a scene that states its motions stands for all times.
        scenes_end: Time from which on scenes were not kept, because their point clouds were too large [s]; inf if all
            were kept.
        outcome: One of ``OUTCOMES``; "no scene" means that the feed had nothing new for too long, "too
            fast" that an obstacle was faster than ``speed_bound``.
        reason: Why the robot has not arrived, or "".
        prismatic, continuous: Names of the joints that slide, and of those that turn without limits; both empty in old
            records.
        faults: What was wrong with the feed of scenes, in the order in which it came.

    Example:
        >>> scenario = rrtik.replanning.Scenario.load("replan_walls")
        >>> rrtik.replan(scenario.problem, step=0.05, rate=20.0, seconds=1.0, seed=1).save("run.json")
        >>> rrtik.replanning.ReplanRun.load("run.json").seed
        1
    """

    problem: str
    robot: str
    joint_names: tuple[str, ...]
    planner: str
    seed: int
    step: float
    rate: float
    margin: float
    speed_bound: float | None
    ticks: list[Tick] = field(default_factory=list)
    clearance: float | None = None
    scenes: list[Snapshot] = field(default_factory=list)
    scenes_end: float = float("inf")
    _points: int = field(default=0, repr=False)

    __repr__ = in_one_line
    outcome: RunOutcome = "interrupted"
    reason: str = ""
    prismatic: tuple[str, ...] = ()
    continuous: tuple[str, ...] = ()
    faults: list[Fault] = field(default_factory=list)

    def see(self, seen: Snapshot) -> None:
        """Add a snapshot to ``scenes`` if it is new.

        Nothing is added after a scene that states its motions, or once the clouds of the record are too large. If the
        same scene was seen three times running, the second of the three is replaced.
        """
        scenes = self.scenes
        if seen.time >= self.scenes_end or (scenes and (scenes[0].stated or seen.time <= scenes[-1].time)):
            return
        seen = replace(seen, faults=())  # They stand in ``faults``.
        self._points += _new_points(seen, scenes[-1] if scenes else None)
        if self._points > MOST_POINTS and scenes:
            self.scenes_end = seen.time
        elif len(scenes) > 1 and scenes[-2].scene is scenes[-1].scene is seen.scene and not seen.unseen:
            scenes[-1] = seen  # Nothing has moved, so only the time of the last sighting matters.
        else:
            scenes.append(seen)

    def violations(self, problem: Problem, truth: Scene | Feed | None = None) -> tuple[RunViolation, ...]:
        """Judge the run independently and return the pairs of bodies that were too near.

        The check holds at every time, not only at steps, by coal and a bound on the motion. Within a tick the arm goes
        straight from one configuration to the next. Obstacles move as their scene states, or straight from each pose
        where they were seen to the next; after the last one they stay. Moves that are called proven have to keep
        margins and clearance; all others only must not touch. :class:`MovingWorld` is not used.

        Args:
            problem: The problem that was run: it gives the robot, and the scene if the record has none.
            truth: Where obstacles really were, if that is known: a scene that states their motion, or a function of
                time [s]; what was seen if None.

        Returns:
            For each tick and pair the violation in which most distance is missing, in the order of time.

        Raises:
            InputError: If the run is another robot's, or its scenes were too large to be kept.

        Example:
            >>> scenario = rrtik.replanning.Scenario.load("replan_walls")
            >>> scenario.run(seconds=1.0, seed=1).violations(scenario.problem)
            ()
        """
        if problem.robot.joint_names != self.joint_names:
            named = f"run of robot '{self.robot}' with other joints than '{problem.robot.name}'"
            raise InputError(f"{named}; give the problem that was run")
        if truth is None and self.ticks and self.scenes_end <= self.ticks[-1].time:
            raise InputError(f"run: its clouds were too large to be kept after {self.scenes_end:g} s; give the truth")
        clearance = self.margin + (self.clearance or 0.0)
        return run_violations(self.ticks, self.scenes, problem, clearance=clearance, truth=truth)

    def judged(self, problem: Problem | None) -> Judged:
        """Return the judgement that a replay of the run shows: what its record calls proven, and :meth:`violations`.

        Args:
            problem: The problem that was run; None if it is not known, and then there are no violations.
        """
        made, proven = self.moves
        unproven_ticks = {k for k, tick in enumerate(self.ticks) if tick.proven is False}
        text = f"{proven} of {made} moves proven free when they were made" if made else "no move of it is called proven"

        violations: tuple[RunViolation, ...] = ()
        if problem is not None:
            try:
                violations = self.violations(problem)
                faults = f"{len(violations)} faults, the first: {violations[0]}" if violations else "no fault"
                text += f"; judged anew: {faults}"
            except InputError as error:
                text += f"; not judged anew: {error}"

        unproven_ticks |= {each.tick for each in violations}
        last_drawn = len(self.ticks) - 2  # No move begins at the last tick, so it has nothing to draw.
        drawn = tuple(sorted({min(k, last_drawn) for k in unproven_ticks} if last_drawn >= 0 else ()))
        contacts = tuple(_contact(each) for each in violations)
        return Judged(Verdict(made > 0 and proven == made and not violations, text, drawn), None, contacts)

    def certificate(self, world: World, *, clearance: float = 0.0) -> Certificate | None:
        """Certify the motion at its times among obstacles that move as the scene states; None if it is not proven.

        Between two ticks the arm goes straight at constant speed.

        Args:
            world: The robot and the scene, whose times are those of the ticks.
            clearance: Distance kept from every obstacle on top of its margin [m].

        Raises:
            InputError: If there are fewer than two ticks.

        Example:
            >>> scenario = rrtik.replanning.Scenario.load("replan_planar_arm")
            >>> plan = rrtik.replanning.plan_in_time(scenario.problem, rate=5.0, speed=1.6, seed=1)
            >>> certificate = plan.require().certificate(scenario.problem.world)
            >>> plan.require().verify(certificate, scenario.problem.world)
            ''
        """
        return world.certificate(self._route(world), clearance)

    def verify(self, certificate: Certificate, world: World, *, clearance: float = 0.0) -> str:
        """Verify a certificate of the motion: return its first fault in one line, or "" if it proves the motion free.

        Args:
            certificate: The certificate; nothing in it is trusted.
            world: The robot and the scene.
            clearance: Least distance that the motion has to keep from obstacles on top of their margins [m].
        """
        return world.verify(certificate, self._route(world), clearance=clearance)

    def _route(self, world: World) -> Route:
        """Return the motion from tick to tick, with a waypoint wherever an obstacle changes its way."""
        if len(self.ticks) < 2:
            raise InputError("run: it has fewer than two ticks, and no motion between them")
        motions = [each.motion for each in world.scene.obstacles]
        turns = [each.times for each in motions if isinstance(each, TimedPoses)]
        times = np.unique(np.concatenate([self.times, *turns]))
        times = times[(times >= self.times[0]) & (times <= self.times[-1])]
        columns = [np.interp(times, self.times, column) for column in self.configurations.T]
        rows = np.column_stack(columns)
        rates = np.diff(rows, axis=0) / np.diff(times)[:, None]
        return Route(frozen(rows), frozen(times), frozen(rates[:, None]), moving=True)

    @property
    def found(self) -> bool:
        """Whether the goal was reached."""
        return self.outcome == "arrived"

    @property
    def path(self) -> JointPath | None:
        """The configurations from tick to tick, as far as the robot came; None without a tick.

        The path has no proof: its motions are proven for the time at which they were made, see :attr:`proven`.
        """
        if not self.ticks:
            return None
        sliding, endless = ([name in some for name in self.joint_names] for some in (self.prismatic, self.continuous))
        return JointPath(self.configurations, self.joint_names, sliding, self.robot, endless)

    @property
    def proven(self) -> bool | None:
        """Whether all moves are proven; None if there are none, or unproven ones and no bound of the obstacles' speed.

        Without a bound, moves near obstacles whose motion is not stated cannot be proven.
        """
        made, proven = self.moves
        if made == 0 or (proven < made and self.speed_bound is None):
            return None
        return proven == made

    @property
    def seconds(self) -> float:
        """Wall time of all ticks [s]; the time of the run itself is that of its last tick."""
        return float(self.tick_seconds("all").sum())

    def require(self) -> JointPath:
        """Return the path to the goal, without its times.

        Raises:
            NotFoundError: If the goal was not reached.

        Example:
            >>> scenario = rrtik.replanning.Scenario.load("replan_planar_arm")
            >>> scenario.run(seconds=0.1, seed=1).require()
            Traceback (most recent call last):
            rrtik_ompl.base.errors.NotFoundError: the goal was not reached: out of time: still on its way
        """
        why = ": ".join(filter(None, (self.outcome, self.reason)))
        return required(self.path if self.found else None, "the goal was not reached", why)

    @property
    def times(self) -> Vector:
        """Begin of each tick [s], shape (ticks,)."""
        return np.array([tick.time for tick in self.ticks])

    @property
    def configurations(self) -> Matrix:
        """The robot's configuration at the begin of each tick, shape (ticks, n)."""
        return np.array([tick.q for tick in self.ticks])

    @property
    def length(self) -> float:
        """Length of the motion [rad, metres counted alike]."""
        return route_length(self.configurations) if self.ticks else 0.0

    def count(self, event: TickEvent) -> int:
        """Return the number of ticks with an event."""
        return sum(tick.event == event for tick in self.ticks)

    @property
    def moves(self) -> tuple[int, int]:
        """How many motions from one tick to the next were made, and how many of them are proven."""
        made = [tick.proven for tick in self.ticks if tick.proven is not None]
        return len(made), sum(made)

    def tick_seconds(self, part: str, *events: TickEvent) -> NDArray[np.float64]:
        """Return the wall times of a part of the ticks [s], shape (m,), for the ticks that have this part.

        Args:
            part: A key of :attr:`Tick.seconds`, such as "repair".
            events: Only ticks with one of these events count; all ticks if none is given.
        """
        chosen = [tick for tick in self.ticks if not events or tick.event in events]
        return np.array([tick.seconds[part] for tick in chosen if part in tick.seconds])

    def summary(self) -> str:
        """Return one line on the run: outcome, numbers of repairs, waits and evasions, length, and proven moves."""

        def counted(event: TickEvent, noun: str) -> str:
            number = self.count(event)
            return f"{number} {noun}{'s' * (number != 1)}"

        repairs = self.tick_seconds("repair", "repair")
        longest = f", the longest {1e3 * repairs.max():.1f} ms" if len(repairs) else ""
        reason = f" ({self.reason})" if self.reason else ""
        end = f"{self.problem}: {self.outcome}{reason} after {self.ticks[-1].time:.2f} s"
        moves, proven = self.moves
        proven_moves = f", {proven} of {moves} moves proven" if moves else ""
        lost = sum(tick.unavoidable is not None for tick in self.ticks)
        proven_moves += f", contact could not be ruled out in {lost} tick{'s' * (lost != 1)}, proven" if lost else ""

        events = f"{counted('repair', 'repair')}{longest}, {counted('wait', 'wait')}, {counted('evade', 'evasion')}"
        faults = f", {len(self.faults)} faults of the feed" if self.faults else ""
        return f"{end}: {events}, length {self.length:.2f}{proven_moves}{faults}"

    @property
    def statistics(self) -> dict[str, Any]:
        """The run in numbers.

        "duration" is the time of the last tick [s], "length" that of the motion. For each event there is the number of
        its ticks. "moves" and "moves_proven" are counts; "repair_median" and "repair_p95" are wall times of repairs
        [s], None without any.
        """
        repairs = self.tick_seconds("repair", "repair")
        return {
            "duration": self.ticks[-1].time if self.ticks else 0.0,
            "length": self.length,
            **{event: self.count(event) for event in EVENTS},
            **dict(zip(("moves", "moves_proven"), self.moves, strict=True)),
            "repair_median": float(np.median(repairs)) if len(repairs) else None,
            "repair_p95": float(np.percentile(repairs, 95)) if len(repairs) else None,
        }

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the record as JSON, whole or not at all.

        Raises:
            InputError: If the file cannot be written.
        """
        heads = {name: getattr(self, name) for name in (*_HEADS, *_JOINTS)}
        if self.scenes_end < float("inf"):
            heads["scenes_end"] = self.scenes_end
        ticks = [_tick_data(tick) for tick in self.ticks]
        scenes = scenes_data(self.scenes) if self.scenes else {}
        faults = {"faults": [asdict(fault) for fault in self.faults]} if self.faults else {}
        entries = {**heads, "clearance": self.clearance, **faults, **scenes, "ticks": ticks}
        document = {"version": 1, "kind": KIND, **entries}
        write_text(file, json.dumps(document) + "\n")

    @staticmethod
    def load(file: str | os.PathLike[str]) -> ReplanRun:
        """Read a record written by :meth:`save`.

        Raises:
            InputError: If the file is missing or malformed; the message names it.

        Example:
            >>> scenario = rrtik.replanning.Scenario.load("replan_walls")
            >>> rrtik.replan(scenario.problem, step=0.05, rate=20.0, seconds=1.0, seed=1).save("run.json")
            >>> rrtik.replanning.ReplanRun.load("run.json").seed
            1
        """
        return read(ReplanRun, file)


def joints_of(robot: Robot, chosen: Mask) -> tuple[str, ...]:
    """Return the names of a robot's joints that a mask, shape (n,), chooses."""
    return tuple(name for name, taken in zip(robot.joint_names, chosen, strict=True) if taken)


_JOINTS = ("prismatic", "continuous")  # not in older records
_SIDES = ("lower", "upper")
_HEADS: tuple[str, ...] = ("problem", "robot", "joint_names", "planner", "seed", "step", "rate", "margin")
_HEADS += ("speed_bound", "outcome", "reason")


def _contact(fault: RunViolation) -> PathContact:
    """Return a violation as a contact that a replay draws red during its tick."""
    contact = Contact(fault.first, fault.second, fault.distance, NOWHERE, NOWHERE, fault.required_distance)
    names = frozenset((fault.first, fault.second))
    return PathContact(float(fault.tick), float(fault.tick + 1), contact, names)


def read_run(file: str | os.PathLike[str]) -> ReplanRun:
    """Read a record; see :meth:`ReplanRun.load`.

    Raises:
        InputError: If the file is missing or malformed; the message names it.
    """
    try:
        document = json_object(read_text(file, MAX_RECORD_BYTES), KIND, "ticks")
        heads = _heads(document)
        ticks = [_tick(entry, len(heads["joint_names"])) for entry in document["ticks"]]
        _check_times(ticks)
        return ReplanRun(**heads, ticks=ticks, scenes=scenes_of(document), faults=_faults_of(document))
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file}: not a whole record: {error!r}; write it again with rrtik replan --record") from None
    except InputError as error:
        raise in_file(file, error) from None


def _heads(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the checked entries of a record other than ticks and scenes, as arguments of :class:`ReplanRun`."""
    heads = {name: document[name] for name in _HEADS}

    for name in ("problem", "robot", "planner", "outcome", "reason"):
        require(heads[name], str, name)
    require(heads["joint_names"], list, "joint_names")
    whole_number(heads["seed"], "seed")
    for name in ("step", "rate"):
        positive(heads[name], name)
    not_negative(heads["margin"], "margin")
    if heads["speed_bound"] is not None:
        positive(heads["speed_bound"], "speed_bound")

    outcome = one_of(OUTCOMES, heads["outcome"], "outcome")
    clearance = document.get("clearance")  # Older records do not have this entry.
    heads["clearance"] = None if clearance is None else not_negative(clearance, "clearance")
    if "scenes_end" in document:
        heads["scenes_end"] = finite_number(document["scenes_end"], "scenes_end")
    for name in _JOINTS:
        heads[name] = tuple(listed(document.get(name, ()), f"{name} joints"))
    return {**heads, "outcome": outcome, "joint_names": tuple(heads["joint_names"])}


def _faults_of(document: Mapping[str, Any]) -> list[Fault]:
    """Return what was wrong with the feed of a record; older records do not say it."""
    return [
        Fault(
            finite_number(entry["time"], "time of a fault"),
            one_of(tuple(ANSWERS), str(entry["kind"]), "kind of a fault"),
            str(entry["obstacle"]),
            str(entry["detail"]),
        )
        for entry in listed(document.get("faults", ()), "faults")
    ]


def _check_times(ticks: list[Tick]) -> None:
    """Raise an error unless there is a tick and the times of the ticks increase."""
    if not ticks:
        raise InputError("the record has no tick; run it again")
    for before, after in pairwise(ticks):
        if after.time <= before.time:
            raise InputError(f"ticks: times go backwards: {after.time:g} s comes after {before.time:g} s")


def _tick_data(tick: Tick) -> dict[str, Any]:
    data: dict[str, Any] = {"time": tick.time, "q": tick.q.tolist(), "event": tick.event}
    data |= {"path": None if tick.path is None else tick.path.tolist()}
    data |= {"poses": {name: pose.tolist() for name, pose in tick.poses.items()}, "seconds": dict(tick.seconds)}
    data |= {"checked": tick.checked} | ({"reason": tick.reason} if tick.reason else {})
    data |= {} if tick.proven is None else {"proven": tick.proven}
    data |= {} if tick.safe_seconds is None else {"safe_seconds": tick.safe_seconds}
    return data | ({} if tick.unavoidable is None else {"unavoidable": _unavoidable_data(tick.unavoidable)})


def _unavoidable_data(lost: Unavoidable) -> dict[str, Any]:
    boxes = {"lower": lost.lower.tolist(), "upper": lost.upper.tolist()}
    numbers = {"seconds": lost.seconds.tolist(), "distances": lost.distances.tolist()}
    return {**boxes, "pairs": lost.pairs, **numbers}


def _unavoidable(entry: Mapping[str, Any], joints: int) -> Unavoidable:
    distances = finite_array(entry["distances"], (None,), "distances of a contact that cannot be avoided")
    lower, upper = (finite_array(entry[side], (len(distances), joints), f"{side} corners") for side in _SIDES)
    seconds = finite_array(entry["seconds"], (len(distances),), "seconds of a contact that cannot be avoided")
    pairs = tuple((str(link), str(obstacle)) for link, obstacle in entry["pairs"])
    if len(pairs) != len(distances):
        raise InputError(f"pairs: expected {len(distances)}, one for each box, got {len(pairs)}")
    return Unavoidable(lower, upper, seconds, pairs, distances)


def _tick(entry: Mapping[str, Any], joints: int) -> Tick:
    event = one_of(EVENTS, str(entry["event"]), "event of a tick")
    return Tick(
        finite_number(entry["time"], "time of a tick"),
        finite_array(entry["q"], (joints,), "q of a tick"),
        event,
        None if entry["path"] is None else finite_array(entry["path"], (None, joints), "path of a tick"),
        {name: _pose_row(values, name) for name, values in entry["poses"].items()},
        {part: finite_number(value, f"seconds of '{part}'") for part, value in entry["seconds"].items()},
        whole_number(entry["checked"], "checked"),
        str(entry.get("reason", "")),
        None if entry.get("proven") is None else bool(entry["proven"]),
        None if entry.get("safe_seconds") is None else not_negative(entry["safe_seconds"], "safe_seconds"),
        None if entry.get("unavoidable") is None else _unavoidable(entry["unavoidable"], joints),
    )


def _pose_row(values: ArrayLike, name: str) -> Vector:
    """Check the pose of an obstacle or attached object and return it as written: x, y, z, quaternion; shape (7,)."""
    what = f"pose of '{name}'"
    row = finite_array(values, (7,), what)
    pose_from_xyzw(row[:3], row[3:], what)
    return row


def _new_points(snapshot: Snapshot, before: Snapshot | None) -> int:
    """Return the number of points in the clouds of a scene that are not shapes of the scene before it."""
    known_shapes = set[int]() if before is None else {id(o.shape) for o in before.scene.obstacles}
    clouds = (o.shape for o in snapshot.scene.obstacles if isinstance(o.shape, PointCloud))
    return sum(len(cloud.points) for cloud in clouds if id(cloud) not in known_shapes)


def scenes_data(snapshots: Sequence[Snapshot]) -> Json:
    """Return snapshots for JSON, each only with what differs from the snapshot before it.

    Returns:
        "shapes", a list of all shapes, and "scenes", a list of entries whose obstacles refer to shapes by their number
        in that list.
    """
    # Shapes are told apart by identity, so that large clouds need not be compared.
    shapes: dict[int, Json] = {}
    numbers: dict[int, int] = {}

    def number_of(shape: Shape) -> int:
        if id(shape) not in numbers:
            numbers[id(shape)] = len(numbers)
            shapes[numbers[id(shape)]] = _shape_data(shape)
        return numbers[id(shape)]

    entries = list[Json]()
    previous_rows = dict[str, Json]()
    allowed: list[list[str]] | None = None
    contacts = list[list[Any]]()
    allow_before = list[tuple[str, ...]]()
    for snapshot in snapshots:
        entry: Json = {"time": snapshot.time}
        rows = {o.name: _obstacle_data(o, number_of(o.shape)) for o in snapshot.scene.obstacles}
        entry["obstacles"] = [row for name, row in rows.items() if previous_rows.get(name) != row]
        gone = [name for name in previous_rows if name not in rows]
        entry |= {"gone": gone} if gone else {}
        previous_rows = rows

        pairs = [list(pair) for pair in snapshot.scene.allowed_collisions]
        if pairs != allowed:
            entry["allowed_collisions"] = allowed = pairs
        touching = [[each.first, each.second, each.distance] for each in snapshot.scene.contacts]
        if touching != contacts:
            entry["contacts"] = contacts = touching

        allow = [item.allow for item in snapshot.scene.attached]  # All else of what is held stays.
        if allow != allow_before:
            entry["attached"] = [_held_data(held, number_of(held.shape)) for held in snapshot.scene.attached]
            allow_before = allow
        entry |= {"unseen": dict(snapshot.unseen)} if snapshot.unseen else {}
        entry |= {"stated": True} if snapshot.stated else {}
        entries.append(entry)

    return {"shapes": list(shapes.values()), "scenes": entries}


def scenes_of(document: Mapping[str, Any]) -> list[Snapshot]:
    """Return the snapshots of a record, the inverse of :func:`scenes_data`; an old record has none.

    An entry holds only what differs from the one before it, so obstacles, attached objects, allowed pairs and contacts
    are carried on from entry to entry.

    Raises:
        InputError: If a snapshot is malformed.
    """
    if "scenes" not in document:
        return []
    require(document["scenes"], list, "scenes")
    shapes = [_shape(entry) for entry in document.get("shapes", [])]

    snapshots = list[Snapshot]()
    obstacle_of_name = dict[str, Obstacle]()
    attached: tuple[AttachedObject, ...] = ()
    allowed: list[list[str]] = []
    contacts = list[list[Any]]()

    for entry in document["scenes"]:
        gone = [str(name) for name in listed(entry.get("gone", ()), "gone obstacles of a scene")]
        obstacle_of_name = {name: each for name, each in obstacle_of_name.items() if name not in gone}
        obstacle_of_name |= {o.name: o for o in (_obstacle(row, shapes) for row in entry["obstacles"])}
        allowed = entry.get("allowed_collisions", allowed)
        attached = tuple(_held(row, shapes) for row in entry["attached"]) if "attached" in entry else attached
        contacts = entry.get("contacts", contacts)

        time = finite_number(entry["time"], "time of a scene")
        unseen = {name: finite_number(age, f"unseen of '{name}'") for name, age in entry.get("unseen", {}).items()}
        pairs = tuple((first, second) for first, second in allowed)
        touching = tuple(Touching(*each) for each in contacts)
        scene = Scene(tuple(obstacle_of_name.values()), attached, pairs, touching)

        if snapshots and time <= snapshots[-1].time:
            raise InputError(f"scenes: times go backwards: {time:g} s comes after {snapshots[-1].time:g} s")
        snapshots.append(Snapshot(time, scene, unseen, bool(entry.get("stated", False))))

    return snapshots


@lru_cache
def _arguments(kind: type[Shape]) -> tuple[str, ...]:
    """Return the names of the constructor's arguments of a shape that are also its fields, without "source"."""
    own = {f.name for f in fields(kind)}  # type: ignore[arg-type]
    return tuple(name for name in inspect.signature(kind).parameters if name in own and name != "source")


def _shape_data(shape: Shape) -> Json:
    values = {name: _plain(getattr(shape, name)) for name in _arguments(type(shape))}
    return {"kind": shape.key, **values}


def _plain(value: object) -> object:
    """Return a value as JSON can hold it: arrays as lists, with null for NaN (a missing column of a height map)."""
    if not isinstance(value, np.ndarray):
        return value
    if np.issubdtype(value.dtype, np.integer) or np.isfinite(value).all():
        return value.tolist()
    numbers = value.astype(object)
    numbers[~np.isfinite(value)] = None
    return numbers.tolist()


def _shape(entry: Mapping[str, Any]) -> Shape:
    kind = SHAPES[one_of(tuple(SHAPES), str(entry["kind"]), "kind of a shape")]
    values = {name: entry[name] for name in _arguments(kind)}
    if "heights" in values:
        values |= {"heights": np.array(values["heights"], dtype=np.float64), "invalid": "drop"}
    return kind(**values)


def _obstacle_data(obstacle: Obstacle, shape: int) -> Json:
    data: Json = {"name": obstacle.name, "shape": shape, "pose": pose_row(obstacle.pose).tolist()}
    data |= {"margin": obstacle.margin} if obstacle.margin else {}
    data |= {"color": obstacle.color} if obstacle.color else {}
    if isinstance(obstacle.motion, ConstantVelocity):
        data["velocity"] = obstacle.motion.velocity.tolist()
    elif isinstance(obstacle.motion, TimedPoses):
        data["times"] = obstacle.motion.times.tolist()
        data["poses"] = [pose_row(there).tolist() for there in obstacle.motion.poses]
    return data


def _obstacle(row: Mapping[str, Any], shapes: Sequence[Shape]) -> Obstacle:
    name = row["name"]
    motion: Motion | None = None
    if "velocity" in row:
        motion = ConstantVelocity(row["velocity"])
    elif "times" in row:
        motion = TimedPoses(row["times"], [_pose(there, name) for there in row["poses"]])
    beside = motion, row.get("margin", 0.0), row.get("color")
    return Obstacle(name, _numbered(row, shapes), _pose(row["pose"], name), *beside)


def _held_data(item: AttachedObject, shape: int) -> Json:
    data: Json = {"name": item.name, "link": item.link, "shape": shape, "pose": pose_row(item.pose).tolist()}
    data |= {"color": item.color} if item.color else {}
    return data | {"allow": list(item.allow), "padding": item.padding, "margin": item.margin}


def _held(row: Mapping[str, Any], shapes: Sequence[Shape]) -> AttachedObject:
    name = row["name"]
    place = _pose(row["pose"], name)
    beside = tuple(row["allow"]), row["padding"], row["margin"], row.get("color")
    return AttachedObject(name, row["link"], _numbered(row, shapes), place, *beside)


def _numbered(row: Mapping[str, Any], shapes: Sequence[Shape]) -> Shape:
    number = whole_number(row["shape"], f"shape of '{row['name']}'")
    if number >= len(shapes):
        raise InputError(f"shape of '{row['name']}': there is no shape {number}, only {len(shapes)}")
    return shapes[number]


def _pose(values: ArrayLike, name: str) -> pin.SE3:
    row = _pose_row(values, name)
    return pose_from_xyzw(row[:3], row[3:])

"""The scene over time: from the motions that a scene states, from a function, or from a stream of snapshots.

A snapshot has an age: an obstacle may have gone on since it was seen, as far as its speed allows.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np

from rrtik_ompl.base.arrays import not_negative
from rrtik_ompl.base.errors import InputError, UnknownNameError, called, require
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.replanning.faults import MOST_DROPPED, TIME_RESOLUTION, Fault, fault_of_time

SILENCE_SECONDS = 2.0  # A run ends after so long without a new scene [s].
LATEST = 1e11  # [s]: a clock that counts seconds reaches this in three thousand years


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """A scene and the time at which it was seen; it unpacks as a pair of time and scene.

    Attributes:
        time: Time at which the scene was taken [s].
        scene: The scene that was seen.
        unseen: For each obstacle that was out of view then, how long before ``time`` it was seen last [s].
        stated: Whether the scene states how its obstacles move; then obstacles without a motion are at rest.
        faults: What was wrong with the feed since the snapshot before.
        passed: Snapshots that came since the one before and were followed by this one at once, in the order of time.

    Example:
        >>> from rrtik_ompl.replanning.feed import Snapshot
        >>> time, scene = Snapshot(0.1, rrtik.Scene())
        >>> time
        0.1
    """

    time: float
    scene: Scene
    unseen: Mapping[str, float] = field(default_factory=dict)
    stated: bool = False
    faults: Sequence[Fault] = ()
    passed: Sequence[Snapshot] = ()

    def __iter__(self) -> Iterator[Any]:
        return iter((self.time, self.scene))

    def __getitem__(self, place: int) -> Any:  # noqa: ANN401 - a time or a scene
        return (self.time, self.scene)[place]

    def __len__(self) -> int:
        return 2

    def seen_at(self, name: str) -> float:
        """Return the time at which an obstacle was seen last [s]."""
        return self.time - self.unseen.get(name, 0.0)

    def ages(self, now: float) -> dict[str, float]:
        """Return how long ago each obstacle was seen last [s], by name."""
        return {o.name: max(now - self.seen_at(o.name), 0.0) for o in self.scene.obstacles}


Feed: TypeAlias = Callable[[float], Scene]
SeenFeed: TypeAlias = Callable[[float], Scene | Snapshot]
Source: TypeAlias = Scene | SeenFeed | Iterable[tuple[float, Scene] | Snapshot]
Watch: TypeAlias = Callable[[float], Snapshot]  # returns the last snapshot that is not later than a time


def feed_of(source: Source, patience: float = SILENCE_SECONDS) -> Watch:
    """Return a function from a time [s] to the last snapshot then, from any kind of source.

    Args:
        source: A scene whose obstacles state their motion; a function from a time [s] to the scene at that time, or to
            a :class:`Snapshot` of an earlier one; or pairs of a time and a scene, or snapshots, as a sensor gives.
        patience: How far apart the first two of such pairs may be, and how far out of order any of them [s].

    Raises:
        InputError: If the source is none of these. The function raises it later if times are impossible.
    """
    if isinstance(source, Scene):
        return lambda time: Snapshot(time, source.at(time), stated=True)
    if callable(source):
        called(source, "scene feed", "time [s]")
        return Asked(source, patience)
    if isinstance(source, Iterable) and getattr(source, "ndim", 1) > 0:
        return Stream(source, patience)
    raise InputError(f"scene feed: expected a scene, a function of time or pairs, got {type(source).__name__}")


class Asked:
    """A function of time as a feed; called with a time, it returns the snapshot of the function, or a later one before.

    Args:
        source: Returns the scene at a time, or a snapshot of an earlier one.
        patience: How far out of order snapshots may be [s].
    """

    def __init__(self, source: SeenFeed, patience: float) -> None:
        self._source = source
        self._patience = patience
        self._latest: Snapshot | None = None

    def __call__(self, time: float) -> Snapshot:
        """Return the last snapshot that is known at a time [s].

        Raises:
            InputError: If the function returns neither a scene nor a snapshot, one of a later time, or one of a time
                that is too far back.
        """
        given = self._source(time)
        if isinstance(given, Snapshot):
            seen = _snapshot(given)
        else:
            require(given, Scene, f"scene feed: what it returns at {time:g} s", "return the scene at that time")
            seen = Snapshot(time, given)

        if seen.time > time + TIME_RESOLUTION:
            future = f"at {time:g} s it gives the scene of {seen.time:g} s"
            raise InputError(f"scene feed: {future}; give the last scene that was seen, and its time")
        before = self._latest
        fault = None if before is None else fault_of_time(seen.time, before.time, self._patience)
        if before is not None and fault is not None:  # The same snapshot once more is no fault.
            return replace(before, faults=(Fault(seen.time, fault),) if seen.time < before.time else ())
        self._latest = seen
        return seen


class Stream:
    """A stream of snapshots; called with a time, it returns the last snapshot that is not later.

    Times are counted from the first snapshot and rounded to a microsecond, so any clock in seconds may be used.
    Snapshots that are doubled or out of order are dropped, see :mod:`rrtik_ompl.replanning.faults`.
    """

    def __init__(self, snapshots: Iterable[tuple[float, Scene] | Snapshot], patience: float = SILENCE_SECONDS) -> None:
        self._remaining: Iterator[Snapshot] = map(_snapshot, snapshots)
        self._patience = patience

        first = next(self._remaining, None)
        if first is None:
            raise InputError("scene feed: it holds no snapshot; give at least one pair of a time and a scene")
        if abs(first.time) > LATEST:
            raise InputError(f"scene feed: its times begin at {first.time:.16g}; give seconds, not milliseconds")

        self._first_time = first.time
        self._latest = replace(first, time=0.0)
        self._next: Snapshot | None = None
        self._faults: list[Fault] = []  # of the snapshots that were dropped since the last call
        self._count = 1
        self._has_ended = False

    def __call__(self, time: float) -> Snapshot:
        """Return the last snapshot that is not later than ``time`` [s].

        Raises:
            InputError: If a snapshot is no pair of a time and a scene, if times stand still or go back by more than the
                patience, or if the second one is later than the first by more than the patience.
        """
        new: list[Snapshot] = []
        while True:
            if self._next is None and not self._has_ended:
                self._next = self._read()
                self._has_ended = self._next is None
            if self._next is None or self._next.time > time + TIME_RESOLUTION:
                faults = tuple(self._faults)
                self._faults.clear()
                return replace(self._latest, faults=faults, passed=new[:-1])
            self._latest = self._next
            new.append(self._next)
            self._next = None

    def _read(self) -> Snapshot | None:
        """Read the next snapshot that is not dropped, its time counted from the first; None at the end."""
        for _ in range(MOST_DROPPED):
            snapshot = next(self._remaining, None)
            if snapshot is None:
                return None

            time = round(snapshot.time - self._first_time, 6)
            before = self._latest.time
            fault = fault_of_time(time, before, self._patience, self._first_time)
            if fault is None:
                return self._counted(replace(snapshot, time=time))
            self._faults.append(Fault(time, fault))

        still = f"times stand still: none of {MOST_DROPPED} scenes is later than {self._first_time + before:.16g} s"
        raise InputError(f"scene feed: {still}; give the time at which each scene was taken")

    def _counted(self, snapshot: Snapshot) -> Snapshot:
        """Return a snapshot that is to be used; an error if it is the second one and far too late."""
        delay = snapshot.time - self._latest.time
        if self._count == 1 and delay > self._patience:
            late = f"the second scene comes {delay:.6g} s after the first, feed_patience is {self._patience:g} s"
            raise InputError(f"scene feed: {late}; give times in seconds, not milliseconds, or raise feed_patience")
        self._count += 1
        return snapshot


def _snapshot(item: object) -> Snapshot:
    """Check an item of a stream, a snapshot or a pair of a time and a scene, and return it as a snapshot."""
    pair = (item.time, item.scene) if isinstance(item, Snapshot) else item
    match pair:
        case (float() | int() | np.number() as time, Scene() as scene) if np.isfinite(time):
            return Snapshot(float(time), scene, _unseen(item, scene) if isinstance(item, Snapshot) else {})
    raise InputError(f"scene feed: expected pairs of a time [s] and a scene, got {item!r:.80}")


def _unseen(snapshot: Snapshot, scene: Scene) -> dict[str, float]:
    """Check for how long obstacles of a snapshot were out of view, and return it."""
    where = f"scene feed: unseen of the snapshot of {snapshot.time:g} s"
    require(snapshot.unseen, Mapping, where, "give names and seconds, such as {'post': 0.2}")
    known = {o.name for o in scene.obstacles}
    for name in snapshot.unseen:
        if name not in known:
            raise UnknownNameError("obstacle", name, known, where=where)
    return {name: not_negative(seconds, f"{where}: '{name}'") for name, seconds in snapshot.unseen.items()}


Answer = TypeVar("Answer")

PATIENCE_SECONDS = 30.0  # far more than any camera picture takes, on a busy machine too


class PatientFeed(Generic[Answer]):
    """A function of time that is made and called in a thread of its own, with a time limit; a context manager.

    Args:
        made: Makes the function; making it may already wait for a first camera picture.
        patience: How long an answer may take in wall time [s].
        what: Name of the feed, for messages.
    """

    def __init__(self, made: Callable[[], Callable[[float], Answer]], patience: float, what: str) -> None:
        self._made = made
        self._patience = patience
        self._what = what
        self._times: queue.SimpleQueue[float | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[tuple[Answer | None, BaseException | None]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._answer, daemon=True)

    def __enter__(self) -> PatientFeed[Answer]:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._times.put(None)

    def __call__(self, time: float) -> Answer:
        """Return the function's answer for a time [s]; an exception of the function is raised here.

        Raises:
            InputError: If there is no answer in time; the thread is abandoned then.
        """
        self._times.put(time)
        try:
            answer, error = self._answers.get(timeout=min(self._patience, threading.TIMEOUT_MAX))
        except queue.Empty:
            late = f"no answer for {time:g} s within {self._patience:g} s, and the run was ended"
            raise InputError(f"{self._what}: {late}; is its source still there? feed_patience allows more") from None

        if error is not None:
            raise error
        return answer  # type: ignore[return-value]

    def _answer(self) -> None:
        feed: Callable[[float], Answer] | None = None
        while (time := self._times.get()) is not None:
            try:
                feed = self._made() if feed is None else feed
                self._answers.put((feed(time), None))
            except BaseException as error:
                self._answers.put((None, error))

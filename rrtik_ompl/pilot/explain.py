"""Tell in words what happened in a recorded session: who commanded what, what was answered, and how the arm moved.

Motion is told together with the set points that asked for it, so that an arm that moved by itself can be told from one
that was told to.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError, printable
from rrtik_ompl.base.units import joint_unit, reading
from rrtik_ompl.pilot.record import read_record

TOLD_SECONDS = 1.0  # motion that begins this long after the last set point was not asked for
LEAST = 1e-3  # [rad or m]; less motion is not told
WHO_SHOWED_SECONDS = 0.3  # what a page showed is told if it was older than this

WORDS = {
    "control": "has the control of the arm",
    "halt": "the pilot's page left or handed over; the arm was stopped",
    "stand": "the session stopped the arm by itself",
    "stop": "STOP",
    "reset": "reset the stop",
    "release": "let go",
}
NOBODYS = ("halt", "stand")


def explain(path: str | os.PathLike[str]) -> Iterator[str]:
    """Yield the lines of the story of a record.

    Args:
        path: A record of `rrtik pilot --record`; one that breaks off is told to where it does.

    Raises:
        InputError: If the file is not such a record.
    """
    entries = list(read_record(path))
    if not entries or entries[0]["kind"] != "begin":
        raise InputError(f"{path}: holds no line 'begin'; give a record of rrtik pilot")

    for number, entry in enumerate(entries, start=1):
        try:
            if number == 1:
                story = Story(entry)
                yield story.title()
            yield from story.tell(entry)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{path}:{number}: a line '{str(entry['kind'])[:20]}' that does not fit: {error}"
            ) from None

    yield from story.motion()
    if entries[-1]["kind"] != "end":
        yield f"{story.clock(entries[-1]['time'])}  the record breaks off: the session was killed, or lost its power"


class Story:
    """What has been told so far of a session."""

    def __init__(self, begin: Mapping[str, Any]) -> None:
        """Begin with the first line of the record."""
        self._begin = begin
        self._start = datetime.fromisoformat(begin["date"]) if "date" in begin else None
        self._q: Vector = np.array(begin["q"], dtype=np.float64)
        self._before = self._q.copy()  # configuration when motion was told last
        self._since = 0.0  # time at which the motion began that was not told yet [s]
        self._untold = ""  # how the set points stand to this motion
        self._set_at = -np.inf  # time of the last set point [s]
        count = len(self._q)
        self._names = list(begin.get("joints", [f"joint {k + 1}" for k in range(count)]))
        self._sliding = list(begin.get("sliding", [False] * count))

    def title(self) -> str:
        """Return the first line: what, when and with which devices."""
        begin = self._begin
        parts = [f"session of {begin.get('problem', 'a problem')}"]
        parts += [self._start.strftime("%Y-%m-%d %H:%M:%S UTC")] if self._start else ["no time of day in this record"]
        parts += [f"{key} {begin[key]}" for key in ("version", "arm", "camera") if key in begin]
        return printable(", ".join(parts))

    def clock(self, time: float) -> str:
        """Return the time of day for a time of the session [s], or this time if the record has no date."""
        if self._start is None:
            return f"{time:9.3f} s"
        return (self._start + timedelta(seconds=time)).strftime("%H:%M:%S.%f")[:-3]

    def tell(self, entry: Mapping[str, Any]) -> Iterator[str]:
        """Yield the lines for one entry of the record."""
        time = float(entry["time"])
        kind = entry["kind"]
        if kind == "joints":
            self._moved(np.array(entry["q"], dtype=np.float64), time)
        elif kind == "set":
            self._set_at = time
        elif kind == "command":
            yield from self.motion()
            yield f"{self.clock(time)}  {_command(entry)}"
        elif kind in ("answer", "said"):
            yield from self.motion()
            level = "" if entry["level"] == "news" else f"{entry['level'].upper()}: "
            yield printable(f"{self.clock(time)}    {level}{entry['text']}")
        elif kind == "end":
            yield from self.motion()
            yield f"{self.clock(time)}  the session ended"

    def motion(self) -> Iterator[str]:
        """Yield a line for the motion since the last one, if there was any."""
        change = self._q - self._before
        if (np.abs(change) > LEAST).any():
            shown = [self._amount(int(k), float(change[k])) for k in np.flatnonzero(np.abs(change) > LEAST)]
            yield f"{self.clock(self._since)}    moved: {', '.join(shown)}{self._untold}"
        self._before = self._q.copy()
        self._untold = ""

    def _moved(self, q: Vector, time: float) -> None:
        if np.array_equal(self._q, self._before):
            self._since = time
        if time - self._set_at > TOLD_SECONDS and (np.abs(q - self._q) > LEAST).any() and not self._untold:
            has_any = np.isfinite(self._set_at)
            last = f"the last was {time - self._set_at:.1f} s ago" if has_any else "there was none before"
            self._untold = f" WITHOUT A SET POINT ({last})"
        self._q = q

    def _amount(self, joint: int, change: float) -> str:
        value, unit = reading(change, joint_unit(bool(self._sliding[joint])))
        digits = 1 if unit == "deg" else 4
        return f"{self._names[joint]} {value:+.{digits}f} {unit}"


def _command(entry: Mapping[str, Any]) -> str:
    """Return who commanded what, and how old what the page showed was if that matters."""
    name = str(entry["name"])
    if name in NOBODYS:
        return WORDS[name]

    page = entry.get("page")
    who = f"page {page}" if page else "somebody"
    arguments = {key: value for key, value in dict(entry["arguments"]).items() if key != "press"}
    said = ", ".join(
        f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}" for key, value in arguments.items()
    )
    what = WORDS.get(name, f"'{name}'" + (f" ({said})" if said else ""))

    seen = entry.get("seen")
    is_old = isinstance(seen, float) and seen > WHO_SHOWED_SECONDS
    old = f"; the page showed what was {seen:.2f} s old" if is_old else ""
    return printable(f"{who}: {what}{old}")

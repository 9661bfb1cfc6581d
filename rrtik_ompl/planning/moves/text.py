"""Lists of single-joint moves as text: lines to be read aloud, CSV, and plain values for JSON."""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np

from rrtik_ompl.base.units import reading, wrapped
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.transitions import Move

COLUMNS = ("move", "joint", "from", "to", "change", "unit")


def moves_csv(path: JointPath) -> str:
    """One line per move: number, joint, from, to and change in degrees (metres if it slides), unit.

    Raises:
        InputError: If the path does not move one joint at a time.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)

    for number, move in enumerate(path.moves(), start=1):
        start, unit = reading(move.start, move.unit)
        end, _ = reading(move.end, move.unit)
        table.writerow([number, move.joint, *(f"{value:.10g}" for value in (start, end, end - start)), unit])
    return text.getvalue()


def moves_document(path: JointPath) -> list[dict[str, Any]]:
    """The moves as plain values that json can write: joint, from, to [rad or m] and the unit.

    Raises:
        InputError: If the path does not move one joint at a time.
    """
    return [{"joint": m.joint, "from": m.start, "to": m.end, "unit": m.unit} for m in path.moves()]


def spoken_moves(path: JointPath) -> list[str]:
    """One sentence per move, to be read aloud to a pilot: "joint 2 up 36 degrees to 55".

    A joint with limits goes up and down (to larger and to smaller values), a sliding joint goes out and in. A joint
    without limits turns forward and back, and is told where it stops as an angle from minus 180 to 180 degrees.

    Raises:
        InputError: If the path does not move one joint at a time.
    """
    return [_sentence(move) for move in path.moves()]


def _sentence(move: Move) -> str:
    """A move as a sentence, see `spoken_moves`."""
    end = move.end
    if move.unit == "m":
        words = ("out", "in")
        unit = "millimetres"
        factor = 1e3
    else:
        words = ("up", "down")
        unit = "degrees"
        factor = float(np.rad2deg(1.0))

    if move.continuous:
        words = ("forward", "back")
        end = float(wrapped(end))

    word = words[0] if move.change > 0.0 else words[1]
    distance = _rounded(factor * abs(move.change))
    target = _rounded(factor * end)
    return f"{_said(move.joint)} {word} {distance} {unit} to {target.replace('-', 'minus ')}"


def _rounded(value: float) -> str:
    """Tenths, and thousandths of what is smaller; no zeros that say nothing: "36", "0.5", "0.025"."""
    text = f"{value:.{1 if abs(value) >= 0.1 else 3}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _said(name: str) -> str:
    """The name of a joint with a gap between word and number: "joint2" and "joint_2" as "joint 2"."""
    words = name.replace("_", " ").replace("-", " ")
    head = words.rstrip("0123456789")
    return f"{head.rstrip()} {words[len(head) :]}" if head and head != words else words

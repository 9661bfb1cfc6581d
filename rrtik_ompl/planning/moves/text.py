"""Single-joint moves as text: sentences to be read aloud, CSV, and plain values for JSON."""

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
    """Return the moves as CSV, one line each: number, joint, from, to, change, unit (degrees, metres if sliding).

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
    """Return the moves as plain values for json: joint, from and to [rad or m], and the unit.

    Raises:
        InputError: If the path does not move one joint at a time.
    """
    return [{"joint": m.joint, "from": m.start, "to": m.end, "unit": m.unit} for m in path.moves()]


def spoken_moves(path: JointPath) -> list[str]:
    """Return one sentence per move, to be read aloud to a pilot: "joint 2 up 36 degrees to 55".

    A joint with limits moves up or down (to larger or smaller values), a sliding joint out or in. A joint without
    limits turns forward or back, and its target is an angle from minus 180 to 180 degrees.

    Raises:
        InputError: If the path does not move one joint at a time.
    """
    return [_sentence(move) for move in path.moves()]


def _sentence(move: Move) -> str:
    """Return the sentence for one move, see `spoken_moves`."""
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
    """Return a number as text with one decimal, or three below 0.1, without trailing zeros: "36", "0.5", "0.025"."""
    text = f"{value:.{1 if abs(value) >= 0.1 else 3}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _said(name: str) -> str:
    """Return the name of a joint with a space between word and number: "joint 2" for "joint2" and "joint_2"."""
    words = name.replace("_", " ").replace("-", " ")
    head = words.rstrip("0123456789")
    return f"{head.rstrip()} {words[len(head) :]}" if head and head != words else words

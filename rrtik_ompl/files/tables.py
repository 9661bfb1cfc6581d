"""The text of path files: JSON (complete), CSV with a header of joint names, and OMPL's matrix text."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.text import is_number

FORMATS = (".json", ".csv", ".txt")


def dumps(document: dict[str, Any], ending: str) -> str:
    """Return the text of a path file.

    Args:
        document: ``waypoints``, ``joint_names`` and other data; all of it is stored in JSON.
        ending: ".json", ".csv" or ".txt".
    """
    if ending == ".json":
        return json.dumps(document, indent=None if "certificate" in document else 1) + "\n"
    text = io.StringIO()
    table = csv.writer(text, delimiter="," if ending == ".csv" else " ", lineterminator="\n")
    if ending == ".csv":
        table.writerow(document["joint_names"])
    table.writerows([repr(value) for value in row] for row in document["waypoints"])
    return text.getvalue()


def loads(text: str, ending: str) -> dict[str, Any]:
    """Parse the text of a path file: ``waypoints``, and ``joint_names``, ``units`` and so on if the text has them.

    Raises:
        InputError: If the text is malformed; the message names the line or the key.
    """
    if ending == ".json":
        return json_object(text, "joint_path", "waypoints")
    return _from_table(text, "," if ending == ".csv" else None)


def _from_table(text: str, separator: str | None) -> dict[str, Any]:
    names, rows = table_rows(text, separator)
    if names is not None and names[0] == "time":
        raise InputError("line 1: a column of times; is this a path file?")
    return {"waypoints": rows} if names is None else {"waypoints": rows, "joint_names": names}


def json_object(text: str, kind: str, key: str) -> dict[str, Any]:
    """Parse the JSON object of a file of version 1; names and units of joints are checked if there are any.

    Args:
        text: The text of the file.
        kind: The required value of the key "kind" if that is present, such as "joint_path".
        key: A key that must be present.

    Raises:
        InputError: If the text is something else; the message names the line or the key.
    """
    return checked_object(json_value(text), kind, key)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON, of which each key may stand there once: readers differ in which one they take."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"'{twice}' stands there twice; delete one of them")
    return found


def json_value(text: str) -> object:
    """Parse any JSON.

    Raises:
        InputError: If it is malformed, with the line, or if a key stands there twice.
    """
    try:
        return json.loads(text, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise InputError(f"line {error.lineno}: not JSON: {error.msg}") from None
    except RecursionError:
        raise InputError("lists are nested too deeply; is it a file of rrtik?") from None
    except ValueError:
        raise InputError("holds a number of thousands of digits; is it a file of rrtik?") from None


def checked_object(document: object, kind: str, key: str) -> dict[str, Any]:
    """Validate parsed JSON as an object of version 1 and of a kind that has a key, and return it.

    Raises:
        InputError: If it is something else; the message names the key.
    """
    if not isinstance(document, dict) or key not in document:
        raise InputError(f"expected an object with the key '{key}'; {_asked(kind)}")
    _check_heads(document, kind)
    return document


def _asked(kind: str) -> str:
    return f"is this a {kind.partition('_')[2]} file?"


def _check_heads(document: dict[str, Any], kind: str) -> None:
    """Validate the entries of a file that describe the waypoints: version, kind, units and names."""
    for key, expected in (("version", 1), ("kind", kind)):
        found = document.get(key, expected)
        if found is True or found != expected:  # True equals 1 in Python, but is not valid in a file
            raise InputError(f"{key}: expected {expected!r}, got {found!r}")

    for key in ("units", "joint_names", "continuous"):
        words = document.get(key)
        if words is not None and not (isinstance(words, list) and all(isinstance(word, str) for word in words)):
            kind = "names of joints" if key == "continuous" else "text, one per joint"
            raise InputError(f"{key}: expected a list of {kind}")

    for unit in document.get("units") or ():
        if unit not in ("rad", "m"):
            raise InputError(f"units: expected 'rad' or 'm' for each joint, got {unit!r}; convert the waypoints")


def table_rows(text: str, separator: str | None) -> tuple[list[str] | None, list[list[float]]]:
    """Parse a table of numbers.

    Args:
        text: The table.
        separator: Separator of a table whose first line holds names; None for blanks and no names.

    Returns:
        The names, or None, and the rows.

    Raises:
        InputError: If a line is malformed; the message names it.
    """
    lines = [(k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not lines:
        raise InputError("the file is empty; expected one configuration a line")

    names = None
    if separator is not None:
        try:
            names = [name.strip() for name in next(csv.reader(io.StringIO(lines[0][1])))]
        except csv.Error as error:
            raise InputError(f"line {lines[0][0]}: no names of joints: {error}") from None
        if all(is_number(name) for name in names):
            raise InputError("line 1: expected the names of the joints, found numbers; add a line of names")
        lines = lines[1:]

    rows: list[list[float]] = []
    for number, line in lines:
        cells = line.split(separator)
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            raise InputError(f"line {number}: expected numbers, got {line.strip()[:60]!r}") from None
        if len(rows[-1]) != len(names or rows[0]):
            raise InputError(f"line {number}: expected {len(names or rows[0])} numbers, got {len(cells)}")

    if not rows:
        raise InputError("the file holds joint names only; expected one configuration a line below them")
    return names, rows

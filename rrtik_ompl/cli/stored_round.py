"""Files of measured tables: every row with its number, its bar and the numbers of single runs, to be judged again."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Protocol, TypeVar

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.version import __version__
from rrtik_ompl.files.text import read_bytes, write_bytes

ENDINGS = (".json", ".gz")
FORMAT = "rrtik reproduce 1"
MOST = 2**28  # bytes, unpacked


class Recorded(Protocol):
    """A row that tells what it follows from."""

    def record(self) -> dict[str, object]:
        """Return plain values for JSON."""


Kind = TypeVar("Kind")


def save_round(file: Path, tables: Mapping[str, Sequence[Recorded]], quick: bool) -> None:
    """Write the rows of tables, compressed if the file's name ends with ``.gz``.

    Raises:
        InputError: If the file cannot be written.
    """
    rows = {name: [row.record() for row in rows] for name, rows in tables.items()}
    data = {"format": FORMAT, "version": __version__, "round": "quick" if quick else "full", "tables": rows}
    text = json.dumps(data, allow_nan=False).encode()
    write_bytes(file, gzip.compress(text, mtime=0) if file.suffix.lower() == ".gz" else text)


def load_round(
    file: Path, readers: Mapping[str, Callable[[Mapping[str, Any]], Kind]]
) -> tuple[dict[str, list[Kind]], bool]:
    """Return the rows of every table of a file, judged again, and whether the round was the quick one.

    Args:
        file: Written by `save_round`.
        readers: By table, what makes a row of its record; it raises a ValueError if a verdict does not follow.

    Raises:
        InputError: If the file is none of these, has a table that nobody offers, or a verdict in it does not follow.
    """
    data = _parsed(file)
    rows: dict[str, list[Kind]] = {}

    for name, records in data["tables"].items():
        if name not in readers:
            raise InputError(f"{file}: table '{name}': no installed package offers it; measure the round again")
        try:
            rows[name] = [readers[name](record) for record in records]
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: table '{name}': {error}; measure it again") from None

    return rows, data["round"] == "quick"


def _parsed(file: Path) -> dict[str, Any]:
    packed = read_bytes(file)
    try:
        data = gzip.GzipFile(fileobj=BytesIO(packed)).read(MOST) if packed[:2] == b"\x1f\x8b" else packed
        parsed = json.loads(data)
    except (OSError, EOFError, ValueError):
        parsed = None
    if not isinstance(parsed, dict) or parsed.get("format") != FORMAT or not isinstance(parsed.get("tables"), dict):
        raise InputError(f"{file}: not a file of measured tables; `rrtik reproduce --store FILE` writes one")
    return parsed

"""Points in PLY files (text, little- and big-endian): the element ``vertex`` with its properties x, y and z."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.point_records import AXES, claimed, coordinates, records, text_rows

TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
TYPES |= {"double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
TYPES |= {"float32": "f4", "float64": "f8"}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
END = b"end_header"


def ply_points(data: bytes, what: str) -> NDArray[Any]:
    """Points of a PLY file, shape (n, 3).

    Raises:
        InputError: If it is none, or has no points; one line.
    """
    head, found, _ = data.partition(END)
    if not data.startswith(b"ply") or not found:
        raise InputError(f"{what}: not a PLY file: no header from 'ply' to 'end_header'; export it again")

    begin = data.find(b"\n", len(head)) + 1
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    order = next((line[1] for line in lines if line[0:1] == ["format"] and len(line) > 1), "")
    if order not in ORDERS:
        raise InputError(f"{what}: format '{order}' of a PLY file is unknown; have {', '.join(ORDERS)}")

    fields, claim = _vertex(lines, what)
    names = [line[2] for line in fields]
    count = claimed(claim, what)

    if order == "ascii":
        rows = text_rows(data[begin:], [names.index(axis) for axis in AXES], what, count)
        if len(rows) < count:
            raise InputError(f"{what}: its header claims {count} points, but the file has {len(rows)}; save it again")
        return rows

    kinds = [
        (f"{k} {name}" if name not in AXES else name, ORDERS[order] + TYPES[kind])
        for k, (_, kind, name) in enumerate(fields)
    ]
    return coordinates(records(data, begin, np.dtype(kinds), count, what))


def _vertex(lines: list[list[str]], what: str) -> tuple[list[list[str]], str]:
    """The properties of the element ``vertex``, each "property", type and name, and how many points are claimed."""
    elements = [k for k, line in enumerate(lines) if line[0:1] == ["element"] and len(line) == 3]
    if not elements or lines[elements[0]][1] != "vertex":
        raise InputError(f"{what}: the first element of a PLY file must be 'vertex'; export points alone")

    end = elements[1] if len(elements) > 1 else len(lines)
    fields = [line for line in lines[elements[0] + 1 : end] if line[0:1] == ["property"]]
    if any(len(line) != 3 or line[1] not in TYPES for line in fields):
        raise InputError(f"{what}: a property of 'vertex' is a list or of an unknown type; export points alone")

    names = [line[2] for line in fields]
    if missing := [axis for axis in AXES if names.count(axis) != 1]:
        raise InputError(f"{what}: 'vertex' needs one property '{missing[0]}'; it has {', '.join(names) or 'none'}")
    return fields, lines[elements[0]][2]

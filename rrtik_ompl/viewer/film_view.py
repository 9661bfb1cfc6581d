"""How films and pictures are taken: their size, and the camera, by a name or by views in a file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.kinds import KINDS, kind_of
from rrtik_ompl.files.sections import NOT_NEGATIVE, VECTOR3, VERSION, Listed, Number, Refused, Section, key, parse
from rrtik_ompl.files.strict_yaml import read_yaml
from rrtik_ompl.files.text import file_name

VIEWPOINTS = ("overview", "front", "side", "top")
MOVING = ("orbit", "follow")
FILES = (".yaml", ".yml", ".json")
SIDES = (64, 4096)  # [px]
EVEN = (".mp4", ".webm")  # whose encoders halve the resolution of colours


class ViewEntry(Section):
    """Where the camera is, and what it looks at."""

    eye = key(VECTOR3, "position of the camera [m]")
    target = key(VECTOR3, "point in the middle of the picture [m]")
    fov_deg = key(Number(1.0, 150.0), "angle of view from the upper to the lower edge", default=32.0)
    time = key(NOT_NEGATIVE, "when it is reached [s of the film]; the camera moves from view to view", default=0.0)

    def check_together(self) -> None:
        """Refuse a camera that looks at itself."""
        if np.allclose(self.eye, self.target):
            raise Refused("is the same point as eye; move one of them", "target")


class ViewFile(Section):
    """The views of a camera."""

    version = key(VERSION, default=1)
    views = key(Listed(ViewEntry, 1))


def camera_of(camera: str | os.PathLike[str]) -> str | list[dict[str, Any]]:
    """Return a camera as the page takes it: a name, or the views of a file, in the order of their times.

    Args:
        camera: "overview", "front", "side", "top", "orbit", "follow", or a file of views (YAML or JSON).

    Raises:
        InputError: If it is neither.
    """
    names = (*VIEWPOINTS, *MOVING)
    if camera in names:
        return str(camera)

    file = file_name(camera)
    if file.suffix.lower() not in FILES:
        raise InputError(f"camera '{camera}': use {', '.join(names)}, or a file of views ({', '.join(FILES)})")

    document = read_yaml(file)
    other = kind_of(file)
    if "views" not in document.data and other is not None:
        raise InputError(f"{file}: {KINDS[other].what}, not views of a film; a page writes such a file: Save view")
    views = sorted(parse(document, ViewFile).views, key=lambda each: each.time)
    return [{"eye": each.eye, "target": each.target, "fov": each.fov_deg, "time": each.time} for each in views]


def sides_of(size: str | Sequence[int], ending: str) -> tuple[int, int]:
    """Return width and height [px] of "1920x1080" or (1920, 1080), for a file of an ending.

    Raises:
        InputError: If it is something else, too small or too large, or odd where the ending needs even numbers.
    """
    least, most = SIDES
    try:
        width, height = (int(side) for side in (size.lower().split("x") if isinstance(size, str) else size))
    except (TypeError, ValueError):
        raise InputError(f"size: expected WIDTHxHEIGHT in pixels, such as 1920x1080, got {size!r}") from None
    if not (least <= width <= most and least <= height <= most):
        raise InputError(f"size: {width} x {height} px is out of range ({least} to {most})")
    if ending in EVEN and (width % 2 or height % 2):
        even = f"{width + width % 2}x{height + height % 2}"
        raise InputError(f"size: {width} x {height} px, but {ending} needs even numbers; use {even}")
    return width, height

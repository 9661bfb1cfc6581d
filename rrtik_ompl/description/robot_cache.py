"""The robots that were loaded last: the same call gives the same object until a file of it changes."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Iterable

from rrtik_ompl.model.robot import Robot

CACHE_SIZE = 64

Stamp = tuple[str, int, int]


class RobotCache:
    """The robots loaded last, each with the size and time of the files it came from."""

    def __init__(self) -> None:
        self._robots: OrderedDict[str, tuple[Robot, tuple[Stamp, ...]]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: str) -> Robot | None:
        """The robot kept under ``key``, unless a file of it has changed since."""
        with self._lock:
            found = self._robots.get(key)
            if found is None or _stamps(path for path, _, _ in found[1]) != found[1]:
                return None
            self._robots.move_to_end(key)
            return found[0]

    def put(self, key: str, robot: Robot, files: Iterable[str]) -> Robot:
        """Keep a robot that was made from ``files`` (and from the meshes that it names); returns it."""
        meshes = (solid.meshPath for solid in robot.collision.geometryObjects)
        stamps = _stamps({*files, *meshes, *getattr(robot.looks, "files", ())})
        with self._lock:
            self._robots[key] = (robot, stamps)
            if len(self._robots) > CACHE_SIZE:
                self._robots.popitem(last=False)
        return robot


def _stamps(paths: Iterable[str]) -> tuple[Stamp, ...]:
    found = []
    for path in sorted(paths):
        try:
            state = os.stat(path)
        except (OSError, ValueError):  # a name, or a file that is gone: then the next load says so
            continue
        found.append((path, state.st_mtime_ns, state.st_size))
    return tuple(found)

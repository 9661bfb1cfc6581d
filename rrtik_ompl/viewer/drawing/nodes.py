"""A tree of named nodes; what is set at them is recorded as the commands that meshcat's viewer replays in the page."""

from __future__ import annotations

from typing import Any

import umsgpack
from numpy.typing import NDArray

from rrtik_ompl.viewer.drawing.objects import Geometry, Material, described_object

ROOT = "/meshcat"  # of the viewer's own tree


class Recording:
    """The last command of each kind for each node, in order."""

    def __init__(self) -> None:
        self._commands: dict[tuple[str, str], bytes] = {}

    def set(self, kind: str, path: str, **parts: Any) -> None:
        """Record a command, in place of an earlier one of the same kind for the same node."""
        self._commands.pop((kind, path), None)
        self._commands[kind, path] = umsgpack.packb({"type": kind, "path": path, **parts})

    @property
    def root(self) -> Node:
        """The node above all others."""
        return Node(self, ROOT)

    @property
    def commands(self) -> tuple[bytes, ...]:
        """The recorded commands, packed as the page's ``Viewer.handle_command_bytearray`` takes them."""
        return tuple(self._commands.values())

    @property
    def paths(self) -> tuple[str, ...]:
        """Nodes that hold an object, in the order in which they were set."""
        return tuple(path for kind, path in self._commands if kind == "set_object")


class Node:
    """A place in the tree: ``node["name"]`` is a node below it, whose pose is relative to it."""

    def __init__(self, recording: Recording, path: str) -> None:
        self._recording = recording
        self._path = path

    def __getitem__(self, name: str) -> Node:
        """The node of this name below this one; a name without ``/``."""
        return Node(self._recording, f"{self._path}/{name}")

    def set_object(self, geometry: Geometry, material: Material) -> None:
        """Put a solid here."""
        self._recording.set("set_object", self._path, object=described_object(self._path, geometry, material))

    def set_transform(self, matrix: NDArray[Any]) -> None:
        """Set the pose, or pose and scale, relative to the node above, shape (4, 4)."""
        self._recording.set("set_transform", self._path, matrix=matrix.T.ravel().tolist())

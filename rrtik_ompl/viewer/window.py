"""A meshcat window that lives in this process: it opens no port and keeps the commands that make up the picture."""

from __future__ import annotations

from typing import Any, Protocol

import umsgpack
from meshcat.commands import SetObject


class Command(Protocol):
    """A command of meshcat."""

    def lower(self) -> dict[str, Any]:
        """Its parts by name, as they are packed."""


class RecordingWindow:
    """Takes the place of ``meshcat.visualizer.ViewerWindow``: ``meshcat.Visualizer(window=RecordingWindow())``.

    The stock window starts a server on all network interfaces, keeps every property ever set, and names objects at
    random; this one keeps the last command for each thing, in order, and gives the same bytes for the same picture.
    """

    web_url = ""

    def __init__(self) -> None:
        self._commands: dict[tuple[str, ...], bytes] = {}

    def send(self, command: Command) -> None:
        """Record one meshcat command, replacing an earlier one of the same kind for the same place."""
        if isinstance(command, SetObject):
            _name_after_path(command)
        lowered = command.lower()
        kind, path = lowered["type"], lowered.get("path", "")
        if kind == "delete":
            self._delete(path)
            return
        key = (kind, path, lowered.get("property", ""))
        self._commands.pop(key, None)
        self._commands[key] = umsgpack.packb(lowered)

    @property
    def commands(self) -> tuple[bytes, ...]:
        """The recorded commands, packed as the page's ``Viewer.handle_command_bytearray`` takes them."""
        return tuple(self._commands.values())

    @property
    def paths(self) -> tuple[str, ...]:
        """Places in the scene tree that hold an object, in the order in which they were set."""
        return tuple(path for kind, path, _ in self._commands if kind == "set_object")

    def _delete(self, path: str) -> None:
        inside = path.rstrip("/") + "/"
        for key in [k for k in self._commands if (k[1] + "/").startswith(inside)]:
            del self._commands[key]


def _name_after_path(command: SetObject) -> None:
    """Replace meshcat's random identifiers, so that the same picture gives the same file."""
    path, drawn = command.path.lower(), command.object
    drawn.uuid = f"{path}/object"
    for part in ("geometry", "material"):
        if hasattr(drawn, part):
            getattr(drawn, part).uuid = f"{path}/{part}"

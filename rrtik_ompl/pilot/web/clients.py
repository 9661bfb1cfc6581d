"""Browsers at a session: which of them is the pilot, and what is sent to each. Used by the server's thread only.

There are no queues: a slow client gets only the newest message of each kind, when it is ready for it.
"""

from __future__ import annotations

import json
from collections.abc import Callable

FRAMES = 2  # largest number of pictures sent to a client and not yet acknowledged
STATES = 8  # the same for states, which are small, and whose age matters more
PILOT = "pilot"
WATCHING = "watching"
Message = bytes | str


class Lane:
    """Messages to one client, with a limit on unacknowledged ones; newer messages replace waiting ones."""

    def __init__(self, send: Callable[[Message], None], width: int) -> None:
        """Start empty.

        Args:
            send: Sends a message.
            width: Largest number of unacknowledged messages.
        """
        self._send = send
        self._width = width
        self._waiting: dict[str, Message] = {}
        self.under_way = 0
        self.dropped = 0

    def offer(self, kind: str, message: Message) -> None:
        """Send a message as soon as the client is ready; a waiting one of the same kind is dropped."""
        self.dropped += kind in self._waiting
        self._waiting[kind] = message
        self._go()

    def arrived(self) -> None:
        """Register that the client has acknowledged a message, and send the next one."""
        self.under_way = max(self.under_way - 1, 0)
        self._go()

    def _go(self) -> None:
        while self._waiting and self.under_way < self._width:
            self.under_way += 1
            self._send(self._waiting.pop(next(iter(self._waiting))))


class Client:
    """One open page."""

    def __init__(self, number: int, name: str, send: Callable[[Message], None]) -> None:
        """Register a page.

        Args:
            number: Number of the connection.
            name: Name chosen by the page, which it keeps when it reconnects.
            send: Sends a message to the page.
        """
        self.number = number
        self.name = name
        self.send = send
        self.frames = Lane(send, FRAMES)
        self.states = Lane(send, STATES)
        self.heard: float | None = None  # time stamp of the last state that the page has acknowledged

    def send_json(self, **words: object) -> None:
        """Send a short message at once."""
        self.send(json.dumps(words))


class Clients:
    """All open pages. The first is the pilot; the others watch until the pilot leaves or hands over."""

    def __init__(self, on_left: Callable[[], None]) -> None:
        """Start without pages.

        Args:
            on_left: Called when the pilot has left or handed over.
        """
        self._all: list[Client] = []
        self._on_left = on_left
        self.pilot: Client | None = None
        self._last_pilot = ""
        self._handed_over = False

    def __len__(self) -> int:
        return len(self._all)

    def join(self, client: Client) -> None:
        """Register a page, as the pilot if it is the first, or if it was the last pilot and the role is free."""
        self._all.append(client)

        returns = client.name == self._last_pilot and not self._handed_over
        if self.pilot is None and (len(self._all) == 1 or returns):
            self._make_pilot(client)
        self._send_roles()

    def leave(self, client: Client) -> None:
        """Remove a page."""
        if client not in self._all:
            return
        self._all.remove(client)
        if client is self.pilot:
            self.pilot = None
            self._on_left()
            returned = next((each for each in self._all if each.name == self._last_pilot), None)
            if returned is not None:  # it was loaded again before its old connection ended
                self._make_pilot(returned)
        self._send_roles()

    def take_over(self, client: Client) -> str:
        """Make a watching page the pilot; return why that is refused, "" if it is not."""
        if self.pilot is not None and self.pilot is not client:
            return "another page is the pilot; it has to hand over, or to leave"
        self._make_pilot(client)
        self._send_roles()
        return ""

    def hand_over(self, client: Client) -> None:
        """Give up the role of the pilot, so that another page can take over."""
        if client is self.pilot:
            self.pilot = None
            self._handed_over = True
            self._on_left()
            self._send_roles()

    def heard(self) -> dict[int, float]:
        """Return, by the number of each page, the time stamp of the last state that it has acknowledged."""
        return {client.number: client.heard for client in tuple(self._all) if client.heard is not None}

    def show_state(self, text: str) -> None:
        """Send a state to all pages."""
        for client in self._all:
            client.states.offer("state", text)

    def show_frame(self, kind: str, frame: bytes) -> None:
        """Send a picture to all pages, as soon as they are ready for one."""
        for client in self._all:
            client.frames.offer(kind, frame)

    def _make_pilot(self, client: Client) -> None:
        self.pilot = client
        self._last_pilot = client.name
        self._handed_over = False

    def _send_roles(self) -> None:
        for client in self._all:
            role = PILOT if client is self.pilot else WATCHING
            client.send_json(kind="role", role=role, free=self.pilot is None, pages=len(self._all), you=client.number)

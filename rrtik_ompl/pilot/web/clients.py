"""Browsers at a session: which of them is the pilot, and what is sent to each. For the server's thread alone.

Nothing is queued: of every kind of message a client that is slow gets the newest one, when it is ready for it.
"""

from __future__ import annotations

import json
from collections.abc import Callable

FRAMES = 2  # pictures to a client that it has not acknowledged, at a time
STATES = 8  # the same of states, which are small, and whose age counts
PILOT = "pilot"
WATCHING = "watching"
Message = bytes | str


class Lane:
    """Messages to one client, at most a few unacknowledged; a newer one takes the place of one that waits."""

    def __init__(self, send: Callable[[Message], None], width: int) -> None:
        """Start empty.

        Args:
            send: Sends a message.
            width: Number of messages that may be unacknowledged.
        """
        self._send = send
        self._width = width
        self._waiting: dict[str, Message] = {}
        self.under_way = 0
        self.dropped = 0

    def offer(self, kind: str, message: Message) -> None:
        """Send a message as soon as the client is ready; one of its kind that still waits is dropped."""
        self.dropped += kind in self._waiting
        self._waiting[kind] = message
        self._go()

    def arrived(self) -> None:
        """The client has shown one."""
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
            number: Of the connection.
            name: Chosen by the page; it keeps it when it connects again.
            send: Sends a message to it.
        """
        self.number = number
        self.name = name
        self.send = send
        self.frames = Lane(send, FRAMES)
        self.states = Lane(send, STATES)
        self.heard: float | None = None  # stamp of the last state that it says to have shown

    def send_json(self, **words: object) -> None:
        """Send a short message at once."""
        self.send(json.dumps(words))


class Clients:
    """All open pages. The first is the pilot; the others watch until the pilot has left or handed over."""

    def __init__(self, on_left: Callable[[], None]) -> None:
        """Begin without pages.

        Args:
            on_left: Called when the pilot's page is gone.
        """
        self._all: list[Client] = []
        self._on_left = on_left
        self.pilot: Client | None = None
        self._last_pilot = ""
        self._handed_over = False

    def __len__(self) -> int:
        return len(self._all)

    def join(self, client: Client) -> None:
        """Register a page; restore its role as pilot if it had that before and the role is free."""
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
        self._send_roles()

    def take_over(self, client: Client) -> str:
        """Make a watching page the pilot; returns why that is refused, "" if it is not."""
        if self.pilot is not None and self.pilot is not client:
            return "another page is the pilot; it has to hand over, or to leave"
        self._make_pilot(client)
        self._send_roles()
        return ""

    def hand_over(self, client: Client) -> None:
        """The pilot lets another page take over."""
        if client is self.pilot:
            self.pilot = None
            self._handed_over = True
            self._on_left()
            self._send_roles()

    def heard(self) -> dict[int, float]:
        """By the number of each page, the stamp of the last state that it says to have shown."""
        return {client.number: client.heard for client in tuple(self._all) if client.heard is not None}

    def show_state(self, text: str) -> None:
        """Send a state to all."""
        for client in self._all:
            client.states.offer("state", text)

    def show_frame(self, kind: str, frame: bytes) -> None:
        """Send a picture to all that are ready for one."""
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

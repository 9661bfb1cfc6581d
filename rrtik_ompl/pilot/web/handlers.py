"""What the page's web server answers: the page's files, and a WebSocket for each page; refusals in one line."""

from __future__ import annotations

import asyncio
import itertools
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

import tornado.web
import tornado.websocket
from tornado.httputil import HTTPServerRequest

from rrtik_ompl.pilot.web.clients import Client, Clients, Message

PAGE = Path(__file__).parent / "page"
MAX_NAME_LENGTH = 40
MAX_PAGES = 100  # open at a time
MAX_UNSENT = 100  # messages to a page that it does not take from its line; pictures and states are fewer
NO_TOKEN = "the token is missing or wrong: open the address as rrtik pilot printed it"
WRONG_ORIGIN = "requested under another name, or from another page: open the address as rrtik pilot printed it"
TOO_MANY = "too many pages are open: close some"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
SCRIPTS = ("hold.js", "keys.js", "link.js", "pilot.js", "gamepad.js")
FILES = {"/": ("index.html", "text/html"), "/pilot.css": ("pilot.css", "text/css")}
FILES |= {f"/{name}": (name, "text/javascript") for name in SCRIPTS}


class Served(Protocol):
    """The server, as its handlers use it."""

    title: str
    clients: Clients
    numbers: itertools.count[int]
    open_sockets: set[tornado.websocket.WebSocketHandler]

    def may(self, request: HTTPServerRequest) -> bool:
        """Whether a request names this server, and comes from its own page or from none."""

    def knows_token(self, word: str) -> bool:
        """Whether a word is the token."""

    def receive(self, client: Client, text: str) -> None:
        """Process a message of a page."""


class Guarded(tornado.web.RequestHandler):
    """Refuses requests that do not come from the server's own page."""

    server: Served

    def prepare(self) -> None:
        """Refuse what comes under another name, or from another page."""
        if not self.server.may(self.request):
            raise tornado.web.HTTPError(403, reason=WRONG_ORIGIN)

    def set_default_headers(self) -> None:
        """Let the page load nothing from elsewhere."""
        for name, value in (
            ("Content-Security-Policy", POLICY),
            ("X-Content-Type-Options", "nosniff"),
            ("Referrer-Policy", "no-referrer"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Cross-Origin-Opener-Policy", "same-origin"),
            ("Cache-Control", "no-store"),
        ):
            self.set_header(name, value)

    def write_error(self, status_code: int, **_: Any) -> None:
        """Refuse in one line."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}\n")


class PageHandler(Guarded):
    """Gives out the files of the page."""

    def initialize(self, server: Served, file: tuple[str, str]) -> None:
        """Take the server, and a file and its kind."""
        self.server = server
        self._file = file

    def get(self) -> None:
        """Give out the file."""
        if self._file[0] == "index.html" and not self.server.knows_token(self.get_argument("token", "")):
            raise tornado.web.HTTPError(403, reason=NO_TOKEN)
        self.set_header("Content-Type", f"{self._file[1]}; charset=utf-8")
        self.finish((PAGE / self._file[0]).read_bytes())


class SocketHandler(Guarded, tornado.websocket.WebSocketHandler):
    """The line to a page."""

    def initialize(self, server: Served) -> None:
        """As tornado calls it in place of a constructor."""
        self.server = server
        self._client: Client | None = None
        self._unsent = 0

    def prepare(self) -> None:
        """Refuse who has no token, and who is too much."""
        super().prepare()
        if not self.server.knows_token(self.get_argument("token", "")):
            raise tornado.web.HTTPError(403, reason=NO_TOKEN)

        if len(self.server.clients) >= MAX_PAGES:
            raise tornado.web.HTTPError(503, reason=TOO_MANY)

    def check_origin(self, origin: str) -> bool:
        """Whether the request comes from the page."""
        return self.server.may(self.request)

    def open(self, *_: str, **__: str) -> None:
        """Register the page; the first one is the pilot."""
        self.set_nodelay(True)
        name = self.get_argument("page", "")[:MAX_NAME_LENGTH]
        self._client = Client(next(self.server.numbers), name, self._send)
        self._client.send_json(kind="title", title=self.server.title)
        self.server.open_sockets.add(self)
        self.server.clients.join(self._client)

    def on_message(self, message: Message) -> None:
        """Process a message of the page."""
        if self._client is not None and isinstance(message, str):
            self.server.receive(self._client, message)

    def on_close(self) -> None:
        """Let the page go; if it was the pilot, the arm stops."""
        self.server.open_sockets.discard(self)
        if self._client is not None:
            self.server.clients.leave(self._client)

    def _send(self, message: Message) -> None:
        if self._unsent >= MAX_UNSENT:  # it takes nothing from its line: what waits for it would fill the memory
            self.close()
            return
        with suppress(tornado.websocket.WebSocketClosedError):  # `on_close` follows
            sent = self.write_message(message, binary=isinstance(message, bytes))
            self._unsent += 1
            asyncio.ensure_future(sent).add_done_callback(self._went)

    def _went(self, sent: asyncio.Future[None]) -> None:
        self._unsent -= 1
        if not sent.cancelled():
            sent.exception()  # a page that was closed abruptly is no news

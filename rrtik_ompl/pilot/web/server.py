"""The page's web server: one process, one WebSocket a page, for this machine only unless told otherwise.

It accepts only requests that name its own address (a web site elsewhere that makes its name point here is refused) and
that come from its own page (Host and Origin), and where a token is set only those that give it.

A WebSocket carries to the page: pictures as binary messages (a letter for the kind, the time as 8 bytes little-endian
float [s], a JPEG) and JSON texts of the kinds "state", "role" and "refused"; from the page: JSON texts, either
``{"shown": "frame" | "state"}`` for everything that was shown, or a command ``{"name": .., "seq": .., arguments}``.

No clock but the session's is needed to know how old is what a pilot sees. A state has the time at which it was made,
``stamp``, and a picture of the camera that at which it was taken. The page sends both back with each command, as
``seen`` and ``picture``, and the first with each ``shown``, as ``stamp``; ``heard`` in a state says by the page's
number which stamp has come back last.
"""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import itertools
import json
import logging
import queue
import socket
import ssl
import struct
import threading
import time as clock
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket
from tornado.httputil import HTTPServerRequest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.messages import message_in
from rrtik_ompl.pilot.web.clients import Client, Clients, Message

LOOPBACK = "127.0.0.1"
MAX_MESSAGE_BYTES = 16 * 1024  # largest message of a page
MAX_QUEUED_COMMANDS = 200
MAX_STAMP = 1e12  # [s]
MIN_TOKEN_LENGTH = 16
GOING_AWAY = 1001  # code of a WebSocket that is closed
FAREWELL_SECONDS = 0.1  # time for this message to arrive
# Long enough that a page with a delay of several seconds can still watch, although it cannot drive.
PING_SECONDS = 10.0
PONG_SECONDS = 10.0
REPORT_SECONDS = 0.25
REQUEST_SECONDS = 20.0  # time limit for a whole request, and between two requests on one connection

PAGE = Path(__file__).parent / "page"
MAX_NAME_LENGTH = 40
MAX_PAGES = 100  # open at a time
# Messages that a page may leave unread; pictures and states are limited to fewer.
MAX_UNSENT = 100
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

PASSIVE = socket.AI_PASSIVE  # resolve addresses for listening


class PilotServer:
    """Serve the page from a separate thread; use it as a context manager.

    Attributes:
        commands: Commands of the pilot's page, as pairs of the page's number and the command.
        reported: When its thread reported last, by ``time.monotonic()``.
    """

    def __init__(
        self,
        port: int = 0,
        host: str = LOOPBACK,
        token: str = "",
        title: str = "",
        *,
        certificate: Path | None = None,
        key: Path | None = None,
    ) -> None:
        """Open a port.

        Args:
            port: Port number; 0 chooses a free one.
            host: Address of this machine under which pages may reach it.
            token: Secret that a page has to give; required for any address but this machine's own.
            title: Title of the page.
            certificate: Certificate of this machine (PEM, with its chain); the page is then served by TLS. None for no
                TLS.
            key: Its private key (PEM); None if it is in the file of the certificate.

        Raises:
            InputError: If the port, the address or the certificate cannot be used, or the token is missing or short.
        """
        self.host = host
        self.token = token
        self.title = title

        self._check_token()
        self._tls = tls_context(certificate, key)
        self.reported = clock.monotonic()

        try:
            self._sockets = tornado.netutil.bind_sockets(port, host)
        except (OSError, OverflowError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"port {port} on {host}: cannot be used: {reason}; choose another, or 0 for any") from None
        self.port = int(self._sockets[0].getsockname()[1])
        self.commands: queue.Queue[tuple[int, dict[str, Any]]] = queue.Queue()

        self.clients = Clients(self._pilot_left)
        self.numbers = itertools.count(1)
        self.open_sockets: set[tornado.websocket.WebSocketHandler] = set()

        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def url(self) -> str:
        """The address of the page for a browser, with the token if there is one."""
        return f"{self._scheme}://{self._name}:{self.port}/" + (f"?token={self.token}" if self.token else "")

    def __enter__(self) -> PilotServer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._end)
        self._thread.join(timeout=10.0)

    def heard(self) -> dict[int, float]:
        """Return, by the number of each page, the time stamp of the last state that it has acknowledged."""
        return self.clients.heard()

    def show_state(self, state: dict[str, Any], executed: dict[int, int]) -> None:
        """Send a state to all pages.

        Args:
            state: The state, as plain values.
            executed: For each page, by number, the last of its commands that was executed before this state.
        """
        text = json.dumps({"kind": "state", "answered": executed, **state}, allow_nan=False)
        self._call(lambda: self.clients.show_state(text))

    def show_frame(self, kind: str, time: float, jpeg: bytes) -> None:
        """Send a picture to all pages.

        Args:
            kind: "C" for the camera, "O" for the view from outside.
            time: Time of the picture [s].
            jpeg: The picture.
        """
        frame = kind.encode() + struct.pack("<d", time) + jpeg
        self._call(lambda: self.clients.show_frame(kind, frame))

    def may(self, request: HTTPServerRequest) -> bool:
        """Check whether a request names this server, and comes from its own page or from none."""
        hosts = {f"{name}:{self.port}" for name in (self._name, *(("localhost",) if self.host == LOOPBACK else ()))}
        host = request.headers.get("Host")
        origin = request.headers.get("Origin")
        return host in hosts and (origin is None or origin == f"{self._scheme}://{host}")

    def knows_token(self, word: str) -> bool:
        """Check a word against the token, in a time that does not depend on how much of it is right."""
        return hmac.compare_digest(word.encode(), self.token.encode())

    def receive(self, client: Client, text: str) -> None:
        """Process a message of a page: an acknowledgement, a change of its role, or a command."""
        said = message_in(text)
        if said is None:
            return
        if "shown" in said:
            (client.frames if said["shown"] == "frame" else client.states).arrived()
            stamp = said.get("stamp")
            if isinstance(stamp, int | float) and not isinstance(stamp, bool) and 0.0 <= stamp <= MAX_STAMP:
                client.heard = float(stamp)
        elif said.get("name") == "ping":
            client.send_json(kind="pong")
        elif said.get("name") == "take":
            refused = self.clients.take_over(client)
            if refused:
                client.send_json(kind="refused", text=refused)
        elif said.get("name") == "stop":
            self._stop(client, said)
        elif client is not self.clients.pilot:
            client.send_json(
                kind="refused", text="you are watching: T takes over when the pilot has left or handed over"
            )
        elif said.get("name") == "hand_over":
            self.clients.hand_over(client)
        elif self.commands.qsize() < MAX_QUEUED_COMMANDS:
            self.commands.put((client.number, said))

    def _stop(self, client: Client, said: dict[str, Any]) -> None:
        """Queue a stop, which any page may give, and discard the commands that still wait."""
        with suppress(queue.Empty):
            while True:
                self.commands.get_nowait()
        self.commands.put((client.number, {"name": "stop", "seq": said.get("seq")}))

    def _check_token(self) -> None:
        if all_addresses(self.host):
            raise InputError(f"--host '{self.host}': name the one address under which pages shall reach this machine")
        if self.host != LOOPBACK and len(self.token) < MIN_TOKEN_LENGTH:
            raise InputError(f"--host {self.host} needs --token with a secret of at least {MIN_TOKEN_LENGTH} letters")

    @property
    def _scheme(self) -> str:
        return "http" if self._tls is None else "https"

    @property
    def _name(self) -> str:
        return f"[{self.host}]" if ":" in self.host else self.host

    def _pilot_left(self) -> None:
        self.commands.put((0, {"name": "halt"}))

    def _end(self) -> None:
        for each in self.open_sockets:
            each.close(GOING_AWAY)
        self._loop.call_later(FAREWELL_SECONDS, self._loop.stop)

    def _report(self) -> None:
        self.reported = clock.monotonic()
        self._loop.call_later(REPORT_SECONDS, self._report)

    def _call(self, act: Callable[[], None]) -> None:
        if len(self.clients):
            self._loop.call_soon_threadsafe(act)

    def _run(self) -> None:
        """Run tornado's event loop in the server's thread, until `_end` stops it."""
        asyncio.set_event_loop(self._loop)
        logging.getLogger("tornado").addHandler(logging.NullHandler())  # errors are shown on the page

        handlers: list[Any] = [(path, PageHandler, {"server": self, "file": file}) for path, file in FILES.items()]
        application = tornado.web.Application(
            [*handlers, ("/ws", SocketHandler, {"server": self})],
            log_function=lambda _: None,
            websocket_max_message_size=MAX_MESSAGE_BYTES,
            websocket_ping_interval=PING_SECONDS,
            websocket_ping_timeout=PONG_SECONDS,
        )

        http = tornado.httpserver.HTTPServer(
            application,
            max_body_size=MAX_MESSAGE_BYTES,
            ssl_options=self._tls,
            idle_connection_timeout=REQUEST_SECONDS,
            body_timeout=REQUEST_SECONDS,
        )

        http.add_sockets(self._sockets)
        self._report()
        self._loop.run_forever()

        http.stop()
        self._loop.run_until_complete(http.close_all_connections())
        self._loop.close()


# --- what it answers -------------------------------------------------------------------------------------------------


class Guarded(tornado.web.RequestHandler):
    """Refuses requests that do not come from the server's own page."""

    server: PilotServer

    def prepare(self) -> None:
        """Refuse requests under another host name, or from another page."""
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

    def initialize(self, server: PilotServer, file: tuple[str, str]) -> None:
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
    """The WebSocket of one page."""

    def initialize(self, server: PilotServer) -> None:
        """Store the server; tornado calls this instead of a constructor."""
        self.server = server
        self._client: Client | None = None
        self._unsent = 0

    def prepare(self) -> None:
        """Refuse a page without the token, or if too many pages are open."""
        super().prepare()
        if not self.server.knows_token(self.get_argument("token", "")):
            raise tornado.web.HTTPError(403, reason=NO_TOKEN)

        if len(self.server.clients) >= MAX_PAGES:
            raise tornado.web.HTTPError(503, reason=TOO_MANY)

    def check_origin(self, origin: str) -> bool:
        """Check whether the request comes from the server's own page."""
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
        """Remove the page; if it was the pilot, the arm stops."""
        self.server.open_sockets.discard(self)
        if self._client is not None:
            self.server.clients.leave(self._client)

    def _send(self, message: Message) -> None:
        # The page reads nothing: further messages would fill the memory.
        if self._unsent >= MAX_UNSENT:
            self.close()
            return
        with suppress(tornado.websocket.WebSocketClosedError):  # `on_close` follows
            sent = self.write_message(message, binary=isinstance(message, bytes))
            self._unsent += 1
            asyncio.ensure_future(sent).add_done_callback(self._went)

    def _went(self, sent: asyncio.Future[None]) -> None:
        self._unsent -= 1
        if not sent.cancelled():
            sent.exception()  # an abruptly closed page is no error


# --- what it shows to other machines ---------------------------------------------------------------------------------


def all_addresses(host: str) -> bool:
    """Check whether a host means all addresses, however it is spelt (``0``, ``0x0``, ``::``, ``::ffff:0.0.0.0``)."""
    try:
        found = [ipaddress.ip_address(entry[4][0]) for entry in socket.getaddrinfo(host or None, 0, flags=PASSIVE)]
    except (OSError, UnicodeError, ValueError):
        return not host
    return any((getattr(each, "ipv4_mapped", None) or each).is_unspecified for each in found)


def tls_context(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    """Return the TLS context of a certificate and its private key, both PEM; None without a certificate.

    Raises:
        InputError: If they cannot be used, or the key is encrypted.
    """
    if certificate is None:
        if key is not None:
            raise InputError(f"--key {key} needs the --certificate that it belongs to")
        return None
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        context.load_cert_chain(certificate, key, password=_no_password)
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{certificate}: no certificate with its key (PEM): {reason}") from None
    return context


def _no_password() -> str:
    raise ValueError("the key is encrypted, and nobody asks for its password")

"""Serve one page to this machine only."""

from __future__ import annotations

import json
import socket
import socketserver
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import TypeAlias

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.viewer.page import ASKING_POLICY, POLICY

ADDRESS = "127.0.0.1"
MOST_OPEN = 64  # concurrent connections; a browser opens about six
OPEN_SECONDS = 60.0  # longest duration of a connection, however slowly its bytes arrive
LOOK_SECONDS = 0.5
QUESTIONS = "/opinion"
LONGEST_QUESTION = 1 << 24  # bytes

Taken: TypeAlias = socket.socket | tuple[bytes, socket.socket]  # the tuple is for UDP, which is not used


class PageServer:
    """Serve one HTML text at ``url`` until it is left; use it as a context manager.

    It listens only on 127.0.0.1, and answers only requests that name this address: a web site elsewhere that makes its
    own name point here (DNS rebinding), or that sends requests from its own page, is refused.

    Args:
        text: The page.
        port: Port to listen on; 0 chooses a free one.
        answer: Answers a question of the page (POST): takes the body, and returns a value that can be written as JSON.
            It is called for one question at a time.

    Raises:
        InputError: If the port cannot be used.
    """

    def __init__(self, text: str, port: int = 0, answer: Callable[[bytes], object] | None = None) -> None:
        try:
            self._server = _Server((ADDRESS, port), _Handler)
        except (OSError, OverflowError, TypeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"port {port}: cannot be used: {reason}; choose another one, or 0 for any") from error

        self._server.body = text.encode("utf-8")
        self._server.answer = answer
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)

    @property
    def port(self) -> int:
        """The port that it listens on."""
        return int(self._server.server_address[1])

    @property
    def url(self) -> str:
        """The address of the page for a browser on this machine."""
        return f"http://{ADDRESS}:{self.port}/"

    def __enter__(self) -> PageServer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def wait(self) -> None:
        """Wait until Ctrl-C is pressed, which ends a live view.

        Raises:
            InputError: If the server has ended by itself.
        """
        try:
            while self._thread.is_alive():
                self._thread.join(LOOK_SECONDS)
        except KeyboardInterrupt:
            return
        raise InputError(f"the server of the page on port {self.port} has ended; show it again")


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True
    request_queue_size = MOST_OPEN  # pending connections; further ones retry after a second
    body = b""
    answer: Callable[[bytes], object] | None = None

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self._open: dict[Taken, float] = {}
        self.answering = threading.Lock()
        super().__init__(address, handler)

    def process_request(self, request: Taken, client_address: object) -> None:
        """Answer in a separate thread; close the connection at once if too many are open."""
        if len(self._open) >= MOST_OPEN:
            self.shutdown_request(request)
            return
        self._open[request] = time.monotonic()
        super().process_request(request, client_address)

    def shutdown_request(self, request: Taken) -> None:
        self._open.pop(request, None)
        super().shutdown_request(request)

    def service_actions(self) -> None:
        """Close connections that have been open for too long."""
        oldest = time.monotonic() - OPEN_SECONDS
        for each, begin in list(self._open.items()):
            if begin < oldest:
                with suppress(OSError):
                    assert isinstance(each, socket.socket)
                    each.shutdown(socket.SHUT_RDWR)

    def handle_error(self, request: Taken, client_address: object) -> None:
        """Print nothing: it is no error of this process if a browser disconnects or sends invalid requests."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = 10.0  # [s] a silent connection is dropped

    def do_GET(self) -> None:
        self._answer(send_body=True)

    def do_HEAD(self) -> None:
        self._answer(send_body=False)

    def do_POST(self) -> None:
        """Answer a question of the page, in JSON."""
        length = self.headers.get("Content-Length", "")
        if not self._is_local() or self.headers.get("Origin") is None:
            self.send_error(HTTPStatus.FORBIDDEN)
        elif self.server.answer is None or self.path != QUESTIONS:
            self.send_error(HTTPStatus.NOT_FOUND)
        elif not length.isdecimal() or int(length) > LONGEST_QUESTION:
            self.send_error(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        else:
            asked = self.rfile.read(int(length))
            with self.server.answering:
                answer = json.dumps(self.server.answer(asked))
            self._send("application/json", answer.encode("utf-8"), send_body=True)

    def _answer(self, send_body: bool) -> None:
        if not self._is_local():
            self.send_error(HTTPStatus.FORBIDDEN)
        elif self.path.split("?")[0] != "/":
            self.send_error(HTTPStatus.NOT_FOUND)
        else:
            self._send("text/html; charset=utf-8", self.server.body, send_body)

    def _send(self, kind: str, body: bytes, send_body: bool) -> None:
        policy = POLICY if self.server.answer is None else ASKING_POLICY
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", f"{policy}; frame-ancestors 'none'")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if send_body:
            self.wfile.write(body)

    def _is_local(self) -> bool:
        port = self.server.server_address[1]
        hosts = {f"{ADDRESS}:{port}", f"localhost:{port}"}
        origin = self.headers.get("Origin")
        return self.headers.get("Host") in hosts and (origin is None or origin in {f"http://{h}" for h in hosts})

    def log_message(self, *_: object) -> None:
        """Print nothing, as the whole library does."""

"""The page is served to this machine and to nobody else."""

from __future__ import annotations

import http.client
import re
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator

import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.viewer import serve
from rrtik_ompl.viewer.serve import PageServer
from rrtik_tests.waiting import cut_off, until


@pytest.fixture
def server() -> Iterator[PageServer]:
    with PageServer("<p>hello</p>") as running:
        yield running


def ask(server: PageServer, path: str = "/", **headers: str) -> tuple[int, str, http.client.HTTPMessage]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read().decode()
    connection.close()
    return answer.status, body, answer.headers


def test_the_page_is_served_to_this_machine(server: PageServer) -> None:
    status, body, headers = ask(server)
    assert (status, body) == (200, "<p>hello</p>")
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert ask(server, Host=f"localhost:{server.port}")[0] == 200


def test_a_foreign_name_or_page_is_refused(server: PageServer) -> None:
    assert ask(server, Host="evil.example")[0] == 403
    assert ask(server, Host=f"evil.example:{server.port}")[0] == 403
    assert ask(server, Origin="http://evil.example")[0] == 403
    assert ask(server, path="/etc/passwd")[0] == 404


def test_the_server_listens_on_the_loopback_address_alone(server: PageServer) -> None:
    assert server.url == f"http://127.0.0.1:{server.port}/"
    with pytest.raises((ConnectionError, TimeoutError)):
        socket.create_connection(("127.0.0.2", server.port), timeout=2).close()


def test_a_port_that_is_taken_or_no_port_is_refused(server: PageServer) -> None:
    for port in (server.port, 70000):
        with pytest.raises(InputError, match=f"port {port}"):
            PageServer("", port)


def test_browsers_that_go_in_the_middle_are_no_news(capfd: pytest.CaptureFixture[str]) -> None:
    with PageServer("x" * 5_000_000) as server:
        for _ in range(20):
            line = socket.create_connection(("127.0.0.1", server.port), timeout=5)
            line.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode())
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            line.close()  # with a reset
        assert ask(server)[0] == 200
        until(lambda: not server._server._open)
    assert capfd.readouterr().err == ""


def test_a_request_that_trickles_in_has_one_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve, "OPEN_SECONDS", 0.3)
    with PageServer("page") as server, socket.create_connection(("127.0.0.1", server.port), timeout=5) as line:
        line.settimeout(0.05)
        until(lambda: cut_off(line), 30.0)


def test_more_connections_than_a_browser_has_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve, "MOST_OPEN", 3)
    with PageServer("page") as server:
        silent = [socket.create_connection(("127.0.0.1", server.port), timeout=30) for _ in range(4)]
        assert silent[3].recv(1) == b""
        silent[0].close()
        until(lambda: len(server._server._open) == 2)
        assert ask(server)[0] == 200
        for each in silent:
            each.close()


def test_as_many_as_may_be_open_can_wait_to_be_taken() -> None:
    waiting = PageServer("page")  # which does not take them yet
    lines = [socket.create_connection(("127.0.0.1", waiting.port), timeout=0.5) for _ in range(30)]
    with waiting as server:
        assert ask(server)[0] == 200
        for each in lines:
            each.close()


def test_a_live_view_ends_with_a_line_when_its_server_has_ended(server: PageServer) -> None:
    server._server.shutdown()
    with pytest.raises(InputError, match="has ended; show it again"):
        server.wait()


SERVE_AND_PRESS_CTRL_C = """
import os, signal, threading
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.viewer import view
signal.signal(signal.SIGINT, signal.default_int_handler)
def ready(url):
    print(url)
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
print(view(Scene(), on_ready=ready))
"""


def test_serving_ends_quietly_when_ctrl_c_is_pressed() -> None:
    command = [sys.executable, "-c", SERVE_AND_PRESS_CTRL_C]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\nNone\n", ended.stdout)
    assert ended.stderr == ""

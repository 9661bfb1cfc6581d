"""The page is served to this machine and to nobody else."""

from __future__ import annotations

import http.client
import re
import socket
import subprocess
import sys
from collections.abc import Iterator

import pytest

from rrtik_ompl.errors import InputError
from rrtik_ompl.viewer.serve import PageServer


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


SERVE_AND_PRESS_CTRL_C = """
import os, signal, threading
from rrtik_ompl.scene import Scene
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

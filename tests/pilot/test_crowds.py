"""Too many pages, pages that take nothing, requests that trickle in: none fills the memory or holds the others up."""

import socket

import pytest

from bench.robustness.bad_pages import RawPage
from rrtik_ompl.pilot.run import Loop
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.web.server import PilotServer
from rrtik_tests.page_by_hand import UPGRADE, Page, answer
from rrtik_tests.waiting import cut_off, until


@pytest.fixture
def server(monkeypatch):
    """A server that does not ask whether pages live: those of a test answer only while they say or hear something."""
    monkeypatch.setattr("rrtik_ompl.pilot.web.server.PING_SECONDS", 600.0)
    monkeypatch.setattr("rrtik_ompl.pilot.web.server.PONG_SECONDS", 600.0)
    with PilotServer(title="test") as made:
        yield made


def test_a_page_that_floods_and_reads_nothing_is_closed_and_the_others_are_served(server):
    pilot = Page(server, "one")
    assert pilot.role() == "pilot"
    flooding = RawPage(server.port, "two")
    flooding.line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    until(lambda: len(server.clients) == 2)
    flooding.line.settimeout(0.5)

    def closed():
        return not all(flooding.say(b'{"name": "plan"}') for _ in range(500)) or len(server.clients) == 1

    until(closed, 60.0)  # every message is refused, and nobody takes the refusals
    until(lambda: len(server.clients) == 1, 60.0)
    pilot.say(name="release", seq=1)
    assert server.commands.get(timeout=10)[1]["name"] == "release"


def test_more_pages_than_anybody_opens_are_refused(server, monkeypatch):
    monkeypatch.setattr("rrtik_ompl.pilot.web.server.MAX_PAGES", 2)
    pages = [Page(server, "one"), Page(server, "two")]
    assert [page.role() for page in pages] == ["pilot", "watching"]
    assert answer(server, "/ws", **UPGRADE).status == 503
    assert answer(server).status == 200
    pages[1].leave()
    until(lambda: len(server.clients) == 1)
    assert Page(server, "two").role() == "watching"


def test_a_request_that_trickles_in_has_one_deadline(monkeypatch):
    monkeypatch.setattr("rrtik_ompl.pilot.web.server.REQUEST_SECONDS", 0.5)
    with PilotServer() as server, socket.create_connection(("127.0.0.1", server.port), timeout=30) as line:
        line.sendall(b"GET / HTTP/1.1\r\n")
        line.settimeout(0.1)
        until(lambda: cut_off(line), 60.0)


def test_answers_to_pages_that_have_left_do_not_pile_up(monkeypatch):
    monkeypatch.setattr("rrtik_ompl.pilot.run.MAX_PAGES", 3)
    opened = open_session(SessionOptions("titan4_sdu"))
    with PilotServer() as server:
        loop = Loop(opened.engine, server)
        for client, sequence in [(1, 5), (2, 10**400), (3, True), (4, 0), (5, 2), (6, 7), (7, -1)]:
            server.commands.put((client, {"name": "release", "seq": sequence}))
        loop.run(lambda: server.commands.empty())
    assert loop._answered == {4: 0, 5: 2, 6: 7}

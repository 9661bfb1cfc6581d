"""Who may reach the page, who is the pilot, and that a slow page holds nobody up."""

import gc
import http.client
import socket
import ssl
import struct
import time

import pytest
import tornado.websocket

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.run import Loop
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.web.clients import Client, Clients, Lane
from rrtik_ompl.pilot.web.server import MAX_MESSAGE_BYTES, MAX_QUEUED_COMMANDS, PilotServer, all_addresses
from rrtik_tests import tls
from rrtik_tests.page_by_hand import UPGRADE, Page, answer
from rrtik_tests.pilot_session import alarmed
from rrtik_tests.waiting import until

TOKEN = "a-secret-of-many-letters"


@pytest.fixture(autouse=True)
def _no_pings(monkeypatch):
    """A page of a test answers pings only while it says or hears something, which may take long on a busy machine."""
    monkeypatch.setattr("rrtik_ompl.pilot.web.server.PING_SECONDS", 600.0)
    monkeypatch.setattr("rrtik_ompl.pilot.web.server.PONG_SECONDS", 600.0)


@pytest.fixture
def server():
    with PilotServer(title="test") as made:
        yield made


# --- who may come ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/", "/pilot.js", "/ws"])
def test_a_foreign_host_or_origin_is_refused(server, path):
    more = UPGRADE if path == "/ws" else {}
    assert answer(server, path, **more).status == (101 if path == "/ws" else 200)
    for headers in (
        {"Host": f"evil.example:{server.port}"},
        {"Host": "127.0.0.1:1"},
        {"Origin": "http://evil.example"},
        {"Origin": f"https://127.0.0.1:{server.port}"},
        {"Origin": "null"},
    ):
        assert answer(server, path, **(more | headers)).status == 403, headers


def test_the_page_may_load_nothing_from_elsewhere(server):
    headers = answer(server).headers
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "http" not in policy
    assert headers["X-Content-Type-Options"] == "nosniff"
    for path in ("/", "/pilot.js", "/link.js", "/keys.js", "/pilot.css"):
        text = answer(server, path).read().decode()
        assert "http://" not in text
        assert "https://" not in text
    assert answer(server, "/../server.py").status == 404


def test_without_the_token_there_is_neither_page_nor_socket():
    with PilotServer(token=TOKEN) as server:
        assert server.url.endswith(f"/?token={TOKEN}")
        for path in ("/", "/ws"):
            more = UPGRADE if path == "/ws" else {}
            for query in ("", "?token=", "?token=wrong", f"?token={TOKEN[:-1]}", "?token=%C3%A9"):
                refusal = answer(server, path + query, **more)
                assert refusal.status == 403, query
                assert "the token is missing or wrong" in refusal.read().decode()
            assert answer(server, f"{path}?token={TOKEN}", **more).status in (101, 200)


def test_other_machines_need_a_token_and_an_address():
    with pytest.raises(InputError, match="--token"):
        PilotServer(host="localhost")
    with pytest.raises(InputError, match="at least 16"):
        PilotServer(host="localhost", token="short")
    for anywhere in ("0.0.0.0", "::", ""):
        with pytest.raises(InputError, match="one address"):
            PilotServer(host=anywhere, token=TOKEN)


def test_a_port_in_use_is_said_in_one_line():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port {port} .* cannot be used: .*choose another") as caught:
            PilotServer(port)
    assert "\n" not in str(caught.value)


# --- who is the pilot --------------------------------------------------------------------------------------------


def test_the_first_is_the_pilot_the_others_watch_and_may_not_command(server):
    first = Page(server, "one")
    second = Page(server, "two")
    assert first.role() == "pilot"
    assert second.role() == "watching"
    second.say(name="plan", seq=1)
    assert "watching" in second.hear()["text"]
    second.say(name="take")
    assert "another page is the pilot" in second.hear()["text"]
    first.say(name="stop", seq=1)
    assert server.commands.get(timeout=5)[1] == {"name": "stop", "seq": 1}
    assert server.commands.empty()


def test_a_watcher_takes_over_when_the_pilot_hands_over(server):
    first = Page(server, "one")
    second = Page(server, "two")
    assert second.role() == "watching"
    first.say(name="hand_over")
    assert server.commands.get(timeout=5)[1]["name"] == "halt"  # the arm stands still meanwhile
    assert second.role() == "watching"
    second.say(name="take")
    assert second.role() == "pilot"
    first.say(name="plan")
    first.hear_until(lambda m: m["kind"] == "refused")


def test_a_pilot_that_returns_is_the_pilot_again_and_the_arm_stands_still_meanwhile(server):
    first = Page(server, "one")
    second = Page(server, "two")
    assert (first.role(), second.role()) == ("pilot", "watching")
    first.leave()
    assert server.commands.get(timeout=5)[1]["name"] == "halt"
    assert second.role() == "watching"
    assert Page(server, "one").role() == "pilot"


def test_a_page_that_is_loaded_again_before_its_old_line_has_ended_is_the_pilot_again(server):
    first = Page(server, "one")
    again = Page(server, "one")
    assert (first.role(), again.role()) == ("pilot", "watching")
    first.leave()
    assert server.commands.get(timeout=5)[1]["name"] == "halt"
    assert again.role() == "pilot"


def test_a_pilot_that_returns_too_late_watches(server):
    first = Page(server, "one")
    second = Page(server, "two")
    assert (first.role(), second.role()) == ("pilot", "watching")
    first.leave()
    assert second.role() == "watching"
    second.say(name="take")
    assert second.role() == "pilot"
    assert Page(server, "one").role() == "watching"


def test_everybody_may_stop_the_arm_and_nothing_else(server):
    pilot = Page(server, "one")
    watching = Page(server, "two")
    assert (pilot.role(), watching.role()) == ("pilot", "watching")
    watching.say(name="plan")
    watching.hear_until(lambda m: isinstance(m, dict) and m["kind"] == "refused")
    assert server.commands.empty()
    watching.say(name="stop", seq=1)
    watching.say(name="take")
    watching.hear_until(lambda m: isinstance(m, dict) and m["kind"] == "refused")
    assert server.commands.get()[1]["name"] == "stop"


def test_what_makes_no_sense_is_left_out_and_a_flood_is_cut(server):
    page = Page(server)
    deep = '{"name": "jog", "direction": ' + "[" * 975 + "]" * 975 + "}"  # read, it is too deep to be shown
    for text in ("{", "[1]", '"stop"', "1e999", "\x00", deep, "[" * 16_000):
        page.say_raw(text)
    for _ in range(MAX_QUEUED_COMMANDS + 50):
        page.say(name="plan")
    page.say(name="take")
    page.role()
    page.role()
    assert server.commands.qsize() == MAX_QUEUED_COMMANDS
    for _ in range(2):  # a stop is not cut: it takes the place of all that waits
        page.say(name="stop", seq=7)
    page.say(name="take")
    page.role()
    assert server.commands.qsize() == 1
    assert server.commands.get()[1] == {"name": "stop", "seq": 7}
    page.say_raw("x" * (MAX_MESSAGE_BYTES + 1))
    with pytest.raises((ConnectionError, tornado.websocket.WebSocketClosedError)):
        page.hear()


# --- a slow page -------------------------------------------------------------------------------------------------


def test_at_most_two_are_under_way_and_the_newest_of_each_kind_waits():
    sent = []
    lane = Lane(sent.append, 2)
    for number in range(10):
        lane.offer("C", f"C{number}")
        lane.offer("O", f"O{number}")
    assert sent == ["C0", "O0"]
    lane.arrived()
    lane.arrived()
    assert sent == ["C0", "O0", "C9", "O9"]
    assert lane.dropped == 16
    lane.arrived()
    lane.arrived()
    lane.arrived()
    assert lane.under_way == 0


def test_a_page_that_shows_nothing_holds_nobody_up():
    sent = {1: [], 2: []}
    clients = Clients(lambda: None)
    pages = [Client(number, str(number), sent[number].append) for number in sent]
    for page in pages:
        clients.join(page)
    for number in range(20):
        clients.show_frame("C", b"C%d" % number)
        pages[1].frames.arrived()
    frames = [[m for m in sent[number] if isinstance(m, bytes)] for number in sent]
    assert frames[0] == [b"C0", b"C1"]
    assert len(frames[1]) == 20


# --- with a session ----------------------------------------------------------------------------------------------


def test_a_command_makes_the_round_and_what_is_nonsense_ends_nothing():
    opened = open_session(SessionOptions("titan4_sdu"))
    with PilotServer() as server:
        loop = Loop(opened.engine, server)
        page = Page(server)
        for count, words in enumerate(
            [
                {"name": "turn", "right": float("nan"), "up": 1},
                {"name": "turn", "right": 10**400, "up": 1},
                {"name": "zoom", "factor": "far"},
                {"name": "preset", "view": ["top"]},
                {"name": "play", "share": float("inf")},
                {"name": "select", "joint": 10**400},
                {"name": "select", "time": 1, "verb": 2, "self": 3},
                {"name": ["stop"]},
                {"name": "grasp", "type": {"a": 1}, "level": 1},
                {},
                {"name": "jog", "direction": [[[]]], "press": 1},
                {"name": "select", "joint": 3},
            ]
        ):
            page.say(seq=count, **words)

        rounds = iter(range(40))
        loop.run(lambda: next(rounds, None) is None)
        state = page.hear_until(lambda m: isinstance(m, dict) and m.get("answered") == {"1": 11})
        assert state["selected"] == 3
        assert "selected" in state["message"] or "known again" in state["message"]  # the latter after a pause
        assert len(state["lamps"]) == 6
        assert page.hear_until(lambda m: isinstance(m, bytes))[9:11] == b"\xff\xd8"
    opened.close()


@pytest.mark.parametrize("host", ["0", "0.0", "0x0", "00.0.0.0", "0.0.0.0", "", "::", "0::0", "::0", "::ffff:0.0.0.0"])
def test_no_spelling_of_all_addresses_is_taken(host):
    with pytest.raises(InputError, match="name the one address"):
        PilotServer(0, host, TOKEN)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "127.1"])
def test_one_address_is_no_spelling_of_all(host):
    assert not all_addresses(host)
    assert PilotServer(0, host, TOKEN).port > 0


def test_a_command_that_breaks_stops_the_arm_and_says_so(monkeypatch):
    opened = open_session(SessionOptions("titan4_sdu"))
    monkeypatch.setattr(opened.engine, "execute", lambda *given: 1 / 0)
    arm = opened.engine.session.arm
    arm.move(0, 0.5)
    with PilotServer() as server:
        loop = Loop(opened.engine, server)
        server.commands.put((1, {"name": "jog", "direction": 0.1}))
        loop.run(lambda: server.commands.empty())
    assert arm.moving is None
    assert alarmed(opened.engine.session, "'jog'", "division by zero", "stopped")


def test_what_a_watchdog_says_is_shown():
    opened = open_session(SessionOptions("titan4_sdu"))
    with PilotServer() as server:
        loop = Loop(opened.engine, server)
        loop.fault = lambda: "one: no report for 3 s; the arm was stopped"
        page = Page(server)
        rounds = iter(range(3))
        loop.run(lambda: next(rounds, None) is None)
        page.hear_until(lambda m: isinstance(m, dict) and "no report" in m.get("message", ""))
        before = server.reported
        begin = time.monotonic()
        until(lambda: server.reported > before)
        assert server.reported >= begin


def test_a_page_that_is_closed_abruptly_is_no_news(server, caplog):
    page = Page(server)
    page.role()
    stream = page._socket.protocol.stream.socket
    stream.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    stream.close()  # with a reset
    for number in range(50):
        server.show_frame("C", float(number), b"x" * 100_000)
    until(lambda: len(server.clients) == 0)
    gc.collect()
    assert [record.message for record in caplog.records] == []


def test_the_page_is_served_by_tls_with_ones_own_certificate(tmp_path):
    (tmp_path / "c.pem").write_text(tls.CERTIFICATE)
    (tmp_path / "k.pem").write_text(tls.KEY)
    trusting = ssl.create_default_context(cafile=str(tmp_path / "c.pem"))
    with PilotServer(token=TOKEN, certificate=tmp_path / "c.pem", key=tmp_path / "k.pem") as server:
        assert server.url.startswith("https://127.0.0.1:")
        for origin, status in ((f"https://127.0.0.1:{server.port}", 200), (f"http://127.0.0.1:{server.port}", 403)):
            connection = http.client.HTTPSConnection("127.0.0.1", server.port, timeout=10, context=trusting)
            connection.request("GET", f"/?token={TOKEN}", headers={"Origin": origin})
            assert connection.getresponse().status == status
            connection.close()
        plain = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
        plain.request("GET", f"/?token={TOKEN}")
        with pytest.raises((OSError, http.client.HTTPException)):
            plain.getresponse()


BAD_CERTIFICATES = {
    "no file": (lambda folder: {"certificate": folder / "none.pem"}, "No such file"),
    "no certificate": (lambda folder: {"certificate": folder / "text.pem"}, "no certificate with its key"),
    "no key": (lambda folder: {"certificate": folder / "c.pem"}, "no certificate with its key"),
    "a key alone": (lambda folder: {"key": folder / "k.pem"}, "needs the --certificate"),
}


@pytest.mark.parametrize("case", BAD_CERTIFICATES)
def test_a_certificate_of_no_use_is_refused_in_one_line(tmp_path, case):
    for name, text in (("c.pem", tls.CERTIFICATE), ("k.pem", tls.KEY), ("text.pem", "words")):
        (tmp_path / name).write_text(text)
    given, message = BAD_CERTIFICATES[case]
    with pytest.raises(InputError, match=message) as caught:
        PilotServer(**given(tmp_path))
    assert "\n" not in str(caught.value)

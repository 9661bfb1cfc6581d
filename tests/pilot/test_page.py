"""The page in a browser, driven by keys alone: from the first picture on, and when things go wrong."""

import json

import pytest

from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_ompl.sensing.cameras.pictures import CameraLostError
from rrtik_tests.browser import HEIGHT, WIDTH, Running
from rrtik_tests.pilot_session import drive_at


def choose(browser, color):
    """Press G and L until a lamp of a colour is chosen."""
    for key in ("g", "l", "l", "g", "l", "l"):
        before = browser.ask("window.measured.answers.length")
        browser.press(key)
        browser.wait(f"window.measured.answers.length > {before}")
        if browser.ask("document.querySelector('.lamp[aria-pressed=true]').dataset.color") == color:
            return
    raise AssertionError(f"no {color} lamp")


@pytest.mark.slow
def test_a_grasp_is_chosen_and_its_route_planned_accepted_and_begun_by_keys_alone(browser, tmp_path):
    record = tmp_path / "session.jsonl"
    with Running(SessionOptions("titan4_sdu", record=record)) as running:
        browser.open(running.server.url)
        browser.wait(
            "state && state.lamps.length === 6 && window.measured.frames.C > 2 && window.measured.frames.O > 0"
        )

        assert "You are the pilot" in browser.text("role")
        colors = browser.ask("[...document.querySelectorAll('.lamp')].map(each => each.dataset.color)")
        assert {"green", "amber", "red"} == set(colors)
        assert browser.ask("document.documentElement.scrollHeight") <= HEIGHT
        assert browser.ask("document.documentElement.scrollWidth") <= WIDTH

        choose(browser, "red")
        browser.wait("document.getElementById('reason').textContent.includes('outside its limits')")
        choose(browser, "green")
        browser.press("p")
        browser.wait(
            "state.mode === 'proposed' && document.querySelectorAll('#moves li').length === state.route.moves.length"
        )

        browser.press("n")
        browser.wait("state.message.includes('accept')")
        browser.wait("state.playing > 0")  # the route plays by itself in the outside view
        browser.press("0")
        browser.wait("state.playing === null")

        browser.ask("document.getElementById('scrub').focus()")  # whoever used the mouse still commands by keys
        browser.press("a")
        browser.wait("state.mode === 'following'")
        browser.ask("document.activeElement.blur()")
        browser.wait("document.getElementById('advice').textContent === 'NEXT'")

        due = browser.ask("state.route.moves[0].joint")
        assert browser.text("due").startswith(due.replace("_", " "))
        assert browser.ask("state.joints[state.selected].name") == due
        assert browser.ask("document.querySelector('#moves li').ariaLabel").endswith(
            browser.ask("state.route.moves[0].text")
        )

        make_moves(browser, running, 2)
        browser.press(" ")
        browser.wait("state.mode === 'proposed' && state.stopped")  # "accept" would go on with it
        browser.press("Backspace")
        browser.wait("!state.stopped")

        browser.press("ArrowUp")
        browser.key_down("ArrowRight")
        browser.wait("/driving|refused|end of the range/.test(state.message)")
        browser.key_up("ArrowRight")
        browser.wait("!held && !state.driving")  # else the arm goes on to its set point from where it is put next
        type_a_value(browser, running)

    kinds = [json.loads(line)["kind"] for line in record.read_text().splitlines()]
    assert kinds[0] == "begin"
    assert {"seen", "command", "answer", "joints"} <= set(kinds)
    with Running(SessionOptions("titan4_sdu", replay=record)) as again:
        browser.open(again.server.url)
        browser.wait("state && state.replay && state.route")


def type_a_value(browser, running):
    """By M, a number and Enter, from where the arm is free; letters commanded again after that."""
    session = running.opened.engine.session
    session.arm._q[:] = session.means.problem.start
    browser.press("5")
    browser.wait("state.selected === 4 && document.getElementById('range').textContent.includes('meets')")
    browser.press("m")
    browser.call("Input.insertText", text="-20")
    browser.press("Enter")
    browser.wait("state.message.includes('hold Enter')")
    assert abs(browser.ask("state.joints[4].value") - browser.ask("state.joints[4].desired")) > 1.0
    browser.hold("Enter", "Math.abs(state.joints[4].value + 20) < 0.03")
    browser.press("1")
    browser.wait("state.selected === 0")


def make_moves(browser, running, count):
    """Hold N for one move after the other; the arm is made fast."""
    drive_at(running.opened.engine.session, 3.0)
    for _ in range(count):
        now = browser.ask("state.route.moves.findIndex(m => m.status === 'current')")
        browser.hold("n", f"state.route.moves[{now}].status === 'done' && !state.driving")
        browser.wait(f"state.route.moves[{now} + 1].status === 'current'")


def test_a_second_page_watches_and_a_lost_camera_and_a_lost_server_are_said(browser):
    with Running(SessionOptions("titan4_sdu")) as running:
        browser.open(running.server.url)
        browser.wait("state && state.lamps.length === 6 && role.role === 'pilot'")
        other = "new WebSocket('ws://' + location.host + '/ws?page=other&token=')"
        browser.ask(f"window.other = {other}; other.onmessage = (e) => {{ window.heard = e.data }}; 0")
        browser.wait("role.pages === 2 && document.getElementById('role').textContent.includes('1 watching')")
        assert browser.ask("document.getElementById('hand_over').hidden") is False

        browser.press("h")
        browser.wait("role.role === 'watching' && !document.getElementById('take').hidden")
        browser.wait("document.getElementById('message').textContent.includes('the pilot has left')")
        browser.press("p")
        browser.wait("document.getElementById('message').textContent.includes('you are watching')")
        browser.wait("document.getElementById('plan').disabled")
        browser.press("t")
        browser.wait("role.role === 'pilot'")
        source = running.opened.engine.perception.source
        latest = source.latest
        source.latest = gone
        browser.wait("document.getElementById('camera_banner').textContent.includes('Camera lost: unplugged')")
        browser.wait("document.getElementById('alerts').textContent.includes('Camera lost')")
        browser.wait("document.body.classList.contains('stale')")
        assert "STALE" in browser.text("age")
        assert browser.ask("document.querySelectorAll('.lamp').length") == 6
        source.latest = latest
        browser.wait("document.getElementById('camera_banner').hidden")
        browser.ask("socket.close()")
        browser.wait("document.getElementById('role').textContent.includes('Not connected')")
        browser.wait("role.role === 'pilot' && socket.readyState === 1 && !document.body.classList.contains('stale')")
    browser.wait("document.getElementById('role').textContent.includes('Not connected')")
    browser.wait("document.body.classList.contains('stale')")


def gone():
    raise CameraLostError("unplugged")


NAMELESS = """
[...document.querySelectorAll("button, input, select, canvas, progress, table, section, [role]")].filter((each) =>
  each.offsetParent !== null && each.id !== "alerts" &&
  !(each.getAttribute("aria-label") || each.textContent.trim() || each.labels?.length)).map((each) => each.outerHTML)
"""


def test_everything_has_a_name_and_the_keys_are_listed(browser):
    with Running(SessionOptions("titan4_sdu")) as running:
        browser.open(running.server.url)
        browser.wait("state && state.lamps.length === 6")
        assert browser.ask(NAMELESS) == []
        tree = browser.call("Accessibility.getFullAXTree")["nodes"]
        named = {node["name"]["value"] for node in tree if node.get("name", {}).get("value")}
        assert {"camera picture with the arm, the chosen grasp and distances drawn over it", "messages"} <= named
        assert any(name.startswith("straight level 1: no reach") for name in named)
        assert any(name.startswith("azimuth, limits") for name in named)
        assert any("Shift with the arrow keys" in name for name in named)
        browser.wait("document.querySelector('[role=meter]').getAttribute('aria-valuetext').includes('degrees')")
        browser.press("?")
        browser.wait("document.getElementById('help').open")
        keys = browser.text("key_list")
        for what in ("stop at once", "make the next move", "take over", "turn the outside view"):
            assert what in keys
        before = browser.ask("sequence")
        browser.press("p")
        assert browser.ask("sequence") == before  # under the overlay keys command nothing

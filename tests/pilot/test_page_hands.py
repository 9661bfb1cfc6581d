"""The page under a pilot's hands, in a browser: what is held and let go, a gamepad, who watches, small screens."""

import time

import numpy as np
import pytest

from rrtik_ompl.pilot.devices.arm import DEFAULT_RATE
from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_tests.browser import Running
from rrtik_tests.pilot_hands import PAD
from rrtik_tests.pilot_session import drive_at

CUT_OFF = """
[...document.querySelectorAll("#joints th, #joints td, #depth dd, .hands > *, .buttons button, #stop, header > *")]
  .filter((each) => each.offsetParent)
  .filter((each) => each.scrollWidth > each.clientWidth + 1
    || each.getBoundingClientRect().right > each.closest("section, header").getBoundingClientRect().right)
  .map((each) => each.outerHTML)
"""


@pytest.fixture(scope="module")
def running():
    with Running(SessionOptions("titan4_sdu")) as made:
        yield made


@pytest.fixture(scope="module")
def tab(browser, running):
    browser.open(running.server.url)
    browser.wait("state && role.role === 'pilot'")
    return browser


@pytest.fixture
def page(tab, running):
    session = running.opened.engine.session
    session.arm.stop()
    session.arm._q[:] = session.means.problem.start
    drive_at(session, DEFAULT_RATE)  # a supervisor that has not seen the arm leap there
    tab.call("Page.reload")
    time.sleep(0.3)
    tab.wait("state && state.lamps.length === 6 && role.role === 'pilot' && !state.trouble && picture")
    tab.press("r")
    tab.ask("state.stopped && send('reset')")
    tab.wait("!state.stopped && !state.fault_of_arm")
    return tab


def azimuth(running):
    """Where the azimuth is [deg], by the arm itself."""
    return float(np.degrees(running.opened.engine.session.arm.read()[0]))


def settled(running, seconds=0.5):
    """The same after a while."""
    time.sleep(seconds)
    return azimuth(running)


@pytest.fixture
def releases(running, monkeypatch):
    """Where the azimuth was [deg] whenever the server was told that a key is let go."""
    noted = []
    session = running.opened.engine.session
    command = session.command

    def noting(verb, *arguments, **named):
        if verb == "release":
            noted.append(azimuth(running))
        return command(verb, *arguments, **named)

    monkeypatch.setattr(session, "command", noting)
    return noted


def test_a_joint_moves_while_its_key_is_held_and_a_degree_farther_at_most(page, running, releases):
    page.press("1")
    before = azimuth(running)
    page.hold("ArrowRight", f"state.joints[0].value > {before} + 5")
    page.wait("!state.driving")
    page.wait("sequence === state.answered[me]")
    there = settled(running)
    assert settled(running, 0.2) == there
    assert len(releases) > 0
    assert there - releases[-1] <= 1.0
    page.keep(
        lambda: page.key_down("ArrowRight"),
        lambda: page.ask("window.dispatchEvent(new Event('blur'))"),  # another window is in front
        f"state.joints[0].value > {there} + 1",
    )
    page.wait("!state.driving")
    there = settled(running, 0.2)
    assert settled(running) == there
    page.key_up("ArrowRight")


def test_space_stops_although_the_arrow_is_still_held(page, running):
    page.press("1")
    before = azimuth(running)

    def end():
        """Stop once the arm has moved; a press that lapsed before that is only let go."""
        moved = page.ask(f"state.joints[0].value > {before} + 2")
        return page.press(" ") if moved else page.key_up("ArrowRight")

    page.keep(lambda: page.key_down("ArrowRight"), end, f"state.joints[0].value > {before} + 2")
    page.wait("state.message.startsWith('stopped') && !state.driving")
    there = settled(running, 0.2)
    assert settled(running) == there
    page.key_up("ArrowRight")


def test_what_is_held_to_move_the_arm_is_44_pixels_or_larger_and_moves_the_tool(page, running):
    page.size(1280, 720)
    sizes = page.ask(
        "['minus', 'plus', 'go', 'next', 'servo', 'tool_in', 'tool_out'].map((id) => byId(id).getBoundingClientRect())"
        ".map((box) => Math.min(box.width, box.height))"
    )
    assert min(sizes) >= 44
    session = running.opened.engine.session
    begin = session.robot.fk(session.q)
    page.hold("s", "state.message === 'the tool moves along its axis' && Math.abs(state.joints[1].value - 19) > 0.5")
    page.wait("!state.driving")
    assert begin.actInv(session.robot.fk(session.q)).translation[2] < -0.005  # back


def test_alarms_are_listed_with_the_time_of_day_until_they_are_read(page, running):
    session = running.opened.engine.session
    said = len(session.state.alarms)
    running.server.commands.put((0, {"name": "halt"}))
    page.wait(f"state.alarms.length > {said} && byId('alarms_open').className === 'bad'")
    page.press("q")
    page.wait("!byId('alarms').hidden && byId('alarms_open').className === ''")
    assert page.ask("/^\\d\\d:\\d\\d:\\d\\d  the pilot has left/.test(byId('alarms').firstChild.textContent)")
    page.press("q")
    page.wait("byId('alarms').hidden")


def test_who_watches_may_stop_the_arm_and_the_button_is_large(page):
    page.press("h")  # no other page: nobody to hand over to, the arm stands still
    page.ask("send('hand_over')")
    page.wait("role.role === 'watching'")
    assert page.ask("document.getElementById('stop').disabled") is False
    page.ask("document.getElementById('stop').click()")
    page.wait("state.stopped && !byId('latch').hidden && byId('reset').hidden")
    page.press("t")
    page.wait("role.role === 'pilot'")
    page.wait("!byId('reset').hidden")
    page.press("2")  # the longest name of a joint
    page.wait("state.selected === 1")
    for width, height in ((800, 600), (1280, 720), (3840, 2160)):
        page.size(width, height)
        box = page.ask(
            "(({width, height}) => [width, height])(document.getElementById('stop').getBoundingClientRect())"
        )
        assert min(box) >= 75  # 20 mm at 96 pixels an inch
        assert page.ask("document.documentElement.scrollWidth") <= width
        assert page.ask("document.documentElement.scrollHeight") <= height
        assert page.ask(CUT_OFF) == [], (width, height)


def keep_stick(page, script, end):
    """Press the shoulder button with the stick at rest, and push the stick until something is so."""

    def press():
        page.ask("pad.axes[0] = 0; push(4, false)")
        page.wait("!padBefore[4]")
        page.ask("push(4, true)")
        page.wait("padArmed")
        page.ask("pad.axes[0] = 1; 0")

    page.keep(press, lambda: page.ask(end) if page.ask(script) else None, script)


def test_a_gamepad_drives_while_its_shoulder_button_is_held_and_stops_when_it_is_pulled_out(page, running):
    page.ask(PAD)
    page.wait("!document.getElementById('pad').hidden")
    page.press("1")
    page.wait("state.selected === 0")

    before = azimuth(running)
    page.ask("pad.axes[0] = 1; 0")
    assert settled(running, 0.3) == before  # not without the shoulder button
    page.ask("push(4, true)")
    assert settled(running, 0.3) == before  # nor with the stick pushed before it
    assert "let the stick go" in page.text("message")

    keep_stick(page, f"state.joints[0].value > {before} + 3", "window.pad = null; 0")
    page.wait("!state.driving && document.getElementById('pad').hidden")
    there = settled(running, 0.2)
    assert settled(running, 0.3) == there

    page.ask(PAD + "push(4, true); pad.axes[0] = 1; 0")  # plugged in again with stick and button as they were
    page.wait("!document.getElementById('pad').hidden")
    assert settled(running, 0.5) == there
    page.ask("push(4, false)")
    page.wait("!padBefore[4]")
    page.ask("push(4, true)")
    assert settled(running, 0.3) == there  # pressed anew, but the stick was not let go

    page.ask("push(4, false); pad.axes[0] = 0; 0")
    page.wait("!padBefore[4]")

    wanted = {
        13: "state.selected === 1",
        12: "state.selected === 0",
        14: "state.speed === 0.5",
        15: "state.speed === 1",
        6: "state.choice !== null",
        7: "state.choice.level === 1",
    }
    for button, done in wanted.items():
        page.ask(f"push({button}, true)")
        page.wait(done)
        page.ask(f"push({button}, false)")
        time.sleep(0.1)
    page.ask("delete navigator.getGamepads; 0")

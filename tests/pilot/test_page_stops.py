"""Keys that stop and hold on the page in a browser, whatever is open, focused or late; and the ages that it shows."""

import time

import numpy as np
import pytest

from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_tests.browser import Running
from rrtik_tests.hostile_arm import Proxy

MODIFIERS = {"none": 0, "alt": 1, "ctrl": 2, "shift": 8}


@pytest.fixture(scope="module")
def running():
    with Running(SessionOptions("titan4_sdu")) as made:
        yield made


@pytest.fixture(scope="module")
def page(browser, running):
    browser.open(running.server.url)
    browser.wait("state && state.lamps.length === 6 && role.role === 'pilot' && !state.trouble && picture")
    return browser


def azimuth(running):
    return float(np.degrees(running.opened.engine.session.arm.read()[0]))


def stands(running):
    """The arm does not move any more."""
    time.sleep(0.3)
    before = azimuth(running)
    time.sleep(0.4)
    assert azimuth(running) == before


def driving(page, running):
    """The azimuth moves by its key, which stays down."""
    if page.ask("state.stopped"):
        page.press("Backspace")
        page.wait("!state.stopped && byId('latch').hidden && byId('reset').hidden")
    page.press("1")
    page.wait("state.selected === 0")
    key = "ArrowLeft" if azimuth(running) > 20.0 else "ArrowRight"
    page.keep(
        lambda: page.key_down(key), lambda: None if page.ask("state.driving") else page.key_up(key), "state.driving"
    )
    return key


def click(page, name):
    x, y = page.ask(
        f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])(byId('{name}').getBoundingClientRect())"
    )
    page.drag([x, y], [x, y], steps=1)


@pytest.mark.parametrize("modifier", MODIFIERS)
def test_space_stops_with_any_modifier_whatever_has_the_focus(page, running, modifier):
    key = driving(page, running)
    page.ask("byId('value').focus()" if modifier == "ctrl" else "byId('grip').focus()")
    words = {"key": " ", "code": "Space", "windowsVirtualKeyCode": 32, "modifiers": MODIFIERS[modifier]}
    page.call("Input.dispatchKeyEvent", type="keyDown", **words)
    page.call("Input.dispatchKeyEvent", type="keyUp", **words)
    page.wait("state.stopped && !state.driving && !byId('latch').hidden && !byId('reset').hidden")
    stands(running)
    page.key_up(key)
    page.ask("document.activeElement.blur()")
    assert page.ask("state.gripper.closed") is False  # nor has Space clicked the button


def test_the_key_list_lets_go_and_under_it_space_and_the_stop_button_stop(page, running):
    key = driving(page, running)
    page.press("?")
    page.wait("byId('help').open && !state.driving && held === null")
    stands(running)
    page.key_up(key)
    for stop in (lambda: page.press(" "), lambda: click(page, "stop")):
        page.ask("send('speed', { share: 1 })")
        page.wait("state.message.startsWith('speed')")
        stop()
        page.wait("state.message.startsWith('stopped')")
        assert page.ask("byId('help').open")
    before = page.ask("sequence")
    click(page, "grip")
    page.press("p")
    page.key_down("ArrowRight")
    page.key_up("ArrowRight")
    assert page.ask("sequence") == before
    page.press("Escape")
    page.wait("!byId('help').open")


@pytest.mark.parametrize("button", ["stop", "help_open", "grip"])
def test_after_a_click_the_hold_keys_work_and_enter_does_not_click_again(page, running, button):
    click(page, button)
    page.wait(
        "state.gripper.closed" if button == "grip" else "document.activeElement === document.body || byId('help').open"
    )
    if button == "help_open":
        page.wait("byId('help').open")
        click(page, "help_close")
        page.wait("!byId('help').open")
    page.press("Enter")
    page.wait("sequence === state.answered[me]")
    assert page.ask("state.gripper.closed") == (button == "grip")
    key = driving(page, running)
    page.key_up(key)
    page.wait("!state.driving")
    if button == "grip":
        click(page, "grip")
        page.wait("!state.gripper.closed")


def test_enter_on_a_focused_button_clicks_once_and_all_other_keys_hold(page, running):
    page.ask("byId('grip').focus()")
    words = {"key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13, "text": "\r"}
    page.call("Input.dispatchKeyEvent", type="keyDown", **words)
    for _ in range(4):
        page.call("Input.dispatchKeyEvent", type="keyDown", autoRepeat=True, **words)
    page.call("Input.dispatchKeyEvent", type="keyUp", **words)
    page.wait("state.gripper.closed")
    page.wait("sequence === state.answered[me]")
    assert page.ask("state.gripper.closed")
    page.ask("byId('grip').focus()")
    key = driving(page, running)
    page.key_up(key)
    page.wait("!state.driving")
    page.ask("send('open')")
    page.wait("!state.gripper.closed")


def test_the_ages_that_are_shown_are_true_over_a_slow_line(page, browser, running, monkeypatch):
    page.ask("socket.onclose = null; socket.close(); 0")  # another page is the pilot's next
    proxy = Proxy(running.server.port, 0.7)
    monkeypatch.setattr(running.server, "may", lambda request: True)  # the page comes by the proxy's port
    browser.open(f"http://127.0.0.1:{proxy.port}/")
    browser.wait("state && roundTrip !== null && pictureAge() !== null")
    browser.ask("send('take')")
    browser.wait("role.role === 'pilot'")
    assert 1300.0 <= browser.ask("lineTime()") <= 6000.0
    assert browser.ask("pictureAge()") >= 0.7
    browser.wait("byId('camera_banner').textContent.includes('The picture comes late')")
    before = azimuth(running)
    browser.key_down("ArrowRight")
    time.sleep(0.5)
    browser.key_up("ArrowRight")
    browser.wait("state.message.includes('line too slow for driving')")
    stands(running)
    assert azimuth(running) == before
    proxy.close()

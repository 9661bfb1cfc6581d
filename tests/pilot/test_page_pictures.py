"""Pictures on the page: nothing holds up those that come after, no decoder of a browser and no key that is held."""

import time

import pytest

from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_tests.browser import Running
from rrtik_tests.hostile_arm import Pilot

BAD_DECODER = """
const decode = window.createImageBitmap.bind(window), bad = %s;
let count = 0;
window.createImageBitmap = (...given) => (count += 1) <= 4 ? bad() : decode(...given);
"""
BAD = {
    "hang": "() => new Promise(() => {})",
    "break": "() => Promise.reject(new Error('broken'))",
}


@pytest.mark.slow
@pytest.mark.parametrize("case", BAD)
def test_pictures_come_although_the_first_ones_hang_or_break_in_the_decoder(browser, case):
    with Running(SessionOptions("titan4_sdu")) as running:
        browser.open("about:blank")
        browser.call("Page.enable")
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=BAD_DECODER % BAD[case])
        browser.call("Page.navigate", url=running.server.url)
        browser.wait("state && role.role === 'pilot' && picture !== null && pictureAge() < STALE_S")
        there = running.opened.engine.session.arm.read()
        browser.hold("ArrowRight", "state.driving")
        browser.wait("!state.driving")
        assert (running.opened.engine.session.arm.read() != there).any()


@pytest.mark.parametrize("line", [False, True])
def test_a_key_that_is_held_leaves_a_slow_machine_time_for_pictures(line, monkeypatch):
    with Pilot(line=line) as pilot:
        work = pilot.session.command

        def slowly(*given, **arguments):
            time.sleep(0.08)  # and a key that is held comes each 0.04 s
            return work(*given, **arguments)

        monkeypatch.setattr(pilot.session, "command", slowly)
        shown = set()
        pilot.hold(2.0, until=lambda _: shown.add(pilot._picture))
        assert len(shown) > 5
        assert pilot._state["trouble"] == ""
        there = pilot.arm._q.copy()
        pilot.hold(1.0)
        assert (pilot.arm._q != there).any()

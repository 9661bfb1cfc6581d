"""Pictures on the page: one that hangs or breaks in the browser's decoder holds up none that come after it."""

import pytest

from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_tests.browser import Running

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

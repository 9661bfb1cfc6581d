"""The page says what is out of view, and offers no route past it, while the keys of the joints go on working."""

from pathlib import Path

from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle
from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_tests.browser import Running

DRIFTING = Path(find_vehicle("titan4_sdu")).with_name("titan4_drifting.yaml")
DISABLED = "['plan', 'replan', 'back'].every((id) => byId(id).disabled)"


def test_the_page_names_what_is_out_of_view_and_offers_driving_by_hand_alone(browser):
    with Running(SessionOptions("titan4_sdu", vehicle=DRIFTING)) as running:
        browser.open(running.server.url)
        browser.wait("state && state.lamps.length === 6 && role.role === 'pilot' && !state.trouble && !state.unseen")
        browser.wait("!byId('plan').disabled")
        running.opened.engine.perception.source.camera.places = {}
        browser.wait("state.unseen")
        browser.wait("byId('camera_banner').textContent.includes(\"'valve' has not been in view for\")")
        browser.wait(DISABLED)
        assert browser.ask("state.lamps.every((lamp) => lamp.color !== 'green')")
        assert not browser.ask("byId('plus').disabled")
        browser.press("p")
        browser.wait("state.message.startsWith('refused: \\'valve\\' has not been in view')")

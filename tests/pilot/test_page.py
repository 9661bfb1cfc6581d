"""The page in a browser, driven by keys alone: from the first picture to the grasp, and when things go wrong."""

import asyncio
import base64
import json
import shutil
import subprocess
import threading
import time
import urllib.request
from functools import partial
from pathlib import Path

import pytest
import tornado.websocket

from rrtik_ompl.pilot.run import Loop
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.web.server import PilotServer
from rrtik_ompl.sensing.cameras.pictures import CameraLostError

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
OPTIONS = ("--headless=new", "--no-sandbox", "--hide-scrollbars", "--remote-debugging-port=0", "--disable-gpu")
WIDTH, HEIGHT = 1280, 720


class Browser:
    """A headless Chromium, told what to do through its debugging port."""

    def __init__(self, folder):
        self._process = subprocess.Popen(
            [CHROMIUM, *OPTIONS, f"--user-data-dir={folder}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        port_file = Path(folder) / "DevToolsActivePort"
        waited = self._until(lambda: port_file.exists() and port_file.read_text().strip(), 60.0)
        self._port = int(waited.split()[0])
        self._loop, self._count, self._socket = asyncio.new_event_loop(), 0, None

    @staticmethod
    def _until(look, seconds):
        end = time.monotonic() + seconds
        while not (found := look()):
            assert time.monotonic() < end, "waited in vain"
            time.sleep(0.03)
        return found

    def open(self, url):
        request = urllib.request.Request(f"http://127.0.0.1:{self._port}/json/new?about:blank", method="PUT")
        page = json.loads(urllib.request.urlopen(request).read())["webSocketDebuggerUrl"]
        connect = partial(tornado.websocket.websocket_connect, page, max_message_size=1 << 26)
        self._socket = self._loop.run_until_complete(self._await(connect))
        self.call("Emulation.setDeviceMetricsOverride", width=WIDTH, height=HEIGHT, deviceScaleFactor=1, mobile=False)
        self.call("Page.navigate", url=url)

    @staticmethod
    async def _await(thing):
        return await thing()

    def call(self, method, **parameters):
        self._count += 1
        self._socket.write_message(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._loop.run_until_complete(self._await(self._socket.read_message)))
            if answer.get("id") == self._count:
                assert "error" not in answer, answer
                return answer["result"]

    def ask(self, script):
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait(self, script, seconds=30.0):
        try:
            return self._until(lambda: self.ask(f"document.readyState === 'complete' && ({script})"), seconds)
        except AssertionError:
            raise AssertionError(f"{script}: waited in vain; message: {self.text('message')}") from None

    def text(self, name):
        return self.ask(f"document.getElementById('{name}').textContent")

    def press(self, key):
        code = ord(key.upper()) if len(key) == 1 and key.isalnum() else {" ": 32, "Enter": 13, "Escape": 27}.get(key, 0)
        words = {"key": key, "windowsVirtualKeyCode": code}
        self.call("Input.dispatchKeyEvent", type="keyDown", **words)
        self.call("Input.dispatchKeyEvent", type="keyUp", **words)

    def screenshot(self, file):
        Path(file).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self):
        self._process.terminate()
        self._process.wait(timeout=30)
        self._loop.close()


class Running:
    """A session with its server, in a thread of its own."""

    def __init__(self, wanted):
        self._wanted, self._ended, self._ready = wanted, threading.Event(), threading.Event()
        self.opened = None
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        self.opened = open_session(self._wanted)
        with PilotServer(title="test") as server:
            self.server = server
            self._ready.set()
            Loop(self.opened.engine, server, watch_only=self._wanted.replay is not None).run(self._ended.is_set)
        self.opened.close()

    def __enter__(self):
        self._thread.start()
        assert self._ready.wait(60)
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join(30)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no chromium on PATH: pages cannot be looked at")
    made = Browser(tmp_path_factory.mktemp("chromium"))
    yield made
    made.close()


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
def test_from_start_to_grasp_by_keys_alone(browser, tmp_path):
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
        follow(browser, running)
        tip = browser.ask("state.aim.distance")
        assert tip < 0.03
        browser.press("ArrowUp")
        browser.press("ArrowRight")
        browser.wait("/moving|refused/.test(state.message)")
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
    session.arm._q[:] = session.problem.start
    browser.press("5")
    browser.wait("state.selected === 4 && document.getElementById('range').textContent.includes('meets')")
    browser.press("m")
    browser.call("Input.insertText", text="-20")
    browser.press("Enter")
    browser.wait("Math.abs(state.joints[4].value + 20) < 0.01")
    browser.press("1")
    browser.wait("state.selected === 0")


def follow(browser, running):
    """Press N for every move and wait until the arm, which is made fast, has made it."""
    arm = running.opened.engine.session.arm
    arm._rates[:] = 3.0
    for _ in range(40):
        browser.press("n")
        browser.wait("state.mode !== 'following' || /accepted|move \\d/.test(state.message)")
        before = browser.ask(
            "state.mode === 'following' ? state.route.moves.findIndex(m => m.status === 'current') : -1"
        )
        if before < 0:
            return
        browser.wait(f"state.mode !== 'following' || state.route.moves[{before}].status === 'done'", 20.0)
    raise AssertionError("too many moves")


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
        source = running.opened.engine.perception._source
        latest, source.latest = source.latest, gone
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

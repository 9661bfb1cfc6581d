"""A headless Chromium and a session with its server: what the tests of the pilot's page share."""

import asyncio
import atexit
import base64
import json
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import ClassVar
from unittest.mock import patch

import tornado.websocket

from rrtik_ompl.pilot import run
from rrtik_ompl.pilot.run import Loop
from rrtik_ompl.pilot.setup import open_session
from rrtik_ompl.pilot.web.server import PilotServer
from rrtik_tests.programs import CHROMIUM

OPTIONS = ("--headless=new", "--no-sandbox", "--hide-scrollbars", "--remote-debugging-port=0")
FLAT, DRAWING_3D = ("--disable-gpu",), ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WIDTH, HEIGHT = 1280, 720
PERIOD_SECONDS = 0.08  # most of the work of a session is pictures
SMALL = (480, 300)  # of pages that draw in 3-D, where a processor computes every pixel of every frame


class Wire:
    """A connection to the debugging port of a Chromium, or of one of its pages."""

    def __init__(self, url):
        self._loop, self._count = asyncio.new_event_loop(), 0
        connect = partial(tornado.websocket.websocket_connect, url, max_message_size=1 << 26)
        self._socket = self._loop.run_until_complete(self._await(connect))

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

    def close(self):
        self._socket.close()
        self._loop.run_until_complete(asyncio.sleep(0))
        self._loop.close()


class Chromium:
    """A headless Chromium, which takes a second of processor time to begin and more until its first page is drawn."""

    _running: ClassVar[dict[tuple[str, ...], "Chromium"]] = {}  # by what it draws with

    def __init__(self, graphics):
        folder = tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True)
        self._process = subprocess.Popen(
            [CHROMIUM, *OPTIONS, *graphics, f"--user-data-dir={folder.name}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        atexit.register(self._end, folder)
        port_file = Path(folder.name) / "DevToolsActivePort"
        port, path = until(lambda: _two_words(port_file), 60.0)
        self.address = f"ws://127.0.0.1:{port}"
        self.wire = Wire(f"{self.address}{path}")

    def _end(self, folder):
        self._process.terminate()
        self._process.wait(timeout=30)
        folder.cleanup()

    @classmethod
    def of(cls, graphics):
        """The one of this process, begun anew if it has ended."""
        found = cls._running.get(graphics)
        if found is None or found._process.poll() is not None:
            found = cls._running[graphics] = cls(graphics)
        return found


def _two_words(file):
    """The port and the path that a Chromium writes; None before it has."""
    words = file.read_text().split() if file.exists() else []
    return words if len(words) == 2 else None


def until(look, seconds):
    """What a look finds, as soon as it finds something."""
    end = time.monotonic() + seconds
    while not (found := look()):
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.03)
    return found


class Browser:
    """A browser of its own for a test: windows of this process's Chromium that share no storage with others."""

    def __init__(self, graphics=FLAT):
        self._chromium, self._page, self._window = Chromium.of(graphics), None, None
        made = self._chromium.wire.call("Target.createBrowserContext", disposeOnDetach=True)
        self._context = made["browserContextId"]
        self._size = SMALL if graphics is DRAWING_3D else (WIDTH, HEIGHT)

    def open(self, url):
        """Show a page in a new window; the one before, which would go on drawing, is closed."""
        call, before = self._chromium.wire.call, self._window
        self._window = call("Target.createTarget", url="about:blank", browserContextId=self._context)["targetId"]
        if before is not None:
            self._page.close()
            call("Target.closeTarget", targetId=before)
        self._page = Wire(f"{self._chromium.address}/devtools/page/{self._window}")
        self.size(*self._size)
        self.call("Page.navigate", url=url)

    def call(self, method, **parameters):
        return self._page.call(method, **parameters)

    def ask(self, script):
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait(self, script, seconds=90.0):
        try:
            return until(lambda: self.ask(f"document.readyState === 'complete' && ({script})"), seconds)
        except AssertionError:
            raise AssertionError(f"{script}: waited in vain; message: {self.text('message')}") from None

    def text(self, name):
        return self.ask(f"document.getElementById('{name}').textContent")

    def press(self, key):
        self.key_down(key)
        self.key_up(key)

    def key_down(self, key):
        self.call("Input.dispatchKeyEvent", type="keyDown", **self._words(key))

    def key_up(self, key):
        self.call("Input.dispatchKeyEvent", type="keyUp", **self._words(key))

    def hold(self, key, script, seconds=90.0):
        """Hold a key until something is so, and let it go."""
        self.keep(lambda: self.key_down(key), lambda: self.key_up(key), script, seconds)

    def keep(self, press, release, script, seconds=90.0):
        """Press something until something is so, and release it.

        A machine that pauses renews what is held too late, and the arm rightly stops: pressed again, as a pilot does.
        """
        end, patience = time.monotonic() + seconds, 1.0
        press()
        began = time.monotonic()
        while not self.ask(f"document.readyState === 'complete' && ({script})"):
            now = time.monotonic()
            assert now < end, f"{script}: held in vain; message: {self.text('message')}"
            if self.ask("state.driving"):
                began = now
            elif now - began > patience:
                release()
                press()
                began, patience = time.monotonic(), 1.5 * patience
            time.sleep(0.03)
        release()

    def coarsen_shadows(self):
        """Compute shadows of few pixels, where looks are not tested: there are four million in each frame."""
        self.ask("key.shadow.mapSize.set(64, 64); key.shadow.map?.dispose(); key.shadow.map = null; 0")

    def drag(self, begin, end, steps=8):
        """Press the mouse at one place [pixels], move it to another, let go."""
        places = [[a + (b - a) * k / steps for a, b in zip(begin, end, strict=True)] for k in range(steps + 1)]
        acts = [("mousePressed", begin), *(("mouseMoved", place) for place in places), ("mouseReleased", end)]
        for kind, (x, y) in acts:
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    @staticmethod
    def _words(key):
        code = ord(key.upper()) if len(key) == 1 and key.isalnum() else {" ": 32, "Enter": 13, "Escape": 27}.get(key, 0)
        return {"key": key, "windowsVirtualKeyCode": code}

    def size(self, width, height):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def screenshot(self, file):
        Path(file).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self):
        if self._page is not None:
            self._page.close()
        self._chromium.wire.call("Target.disposeBrowserContext", browserContextId=self._context)


class PatientLoop(Loop):
    """A loop whose clock waits for a machine that pauses: from picture to picture it advances by 0.1 s at most."""

    _now = _real = 0.0
    _latest = 0.1

    @property
    def time(self):
        real = super().time
        self._now = min(self._now + max(real - self._real, 0.0), self._latest)
        self._real = real
        return self._now

    def _step(self):
        self._latest = self.time + 0.1
        super()._step()


class Running:
    """A session with its server, in a thread of its own."""

    def __init__(self, wanted):
        self._wanted, self._ended, self._ready = wanted, threading.Event(), threading.Event()
        self.opened = None
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        self.opened = open_session(self._wanted)
        with patch.object(run, "PERIOD_SECONDS", PERIOD_SECONDS), PilotServer(title="test") as server:
            self.server = server
            self._ready.set()
            PatientLoop(self.opened.engine, server).run(self._ended.is_set)
        self.opened.close()

    def __enter__(self):
        self._thread.start()
        assert self._ready.wait(60)
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join(30)


@contextmanager
def planning_page(text: str, folder: Path, until: str = "document.documentElement.dataset.plans") -> Iterator[Browser]:
    """A page that plans, opened from a file in a folder, as soon as a condition holds: it can plan."""
    file = folder / "page.html"
    file.write_text(text, encoding="utf-8")
    with closing(Browser(DRAWING_3D)) as browser:
        browser.open(file.as_uri())
        browser.wait(until)
        yield browser

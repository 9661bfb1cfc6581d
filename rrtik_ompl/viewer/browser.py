"""Draw pages in a headless browser, which needs no screen: a script in the page posts what it has drawn."""

from __future__ import annotations

import html
import json
import queue
import shutil
import subprocess
import tempfile
from collections.abc import Generator, Mapping
from pathlib import Path

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.viewer.page import ASKING_POLICY, POLICY, asset
from rrtik_ompl.viewer.serve import PageServer

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "microsoft-edge")
OPTIONS = (
    "--headless=new", "--no-sandbox", "--no-first-run", "--hide-scrollbars", "--mute-audio",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
PATIENCE = 120.0  # [s]; longest time without news
LOOK_SECONDS = 0.5  # between two looks whether the browser still runs
END = b"."
FAULT = b"E"
PICTURE_ONLY = (
    "<style>header, aside, footer {{ display: none !important }} body {{ display: block }} "
    "main {{ width: {0}px; height: {1}px }} #labels span {{ font-size: {2}px }}</style>"
)


def posts(text: str, wanted: Mapping[str, object], size: tuple[int, int]) -> Generator[tuple[bytes, bytes], None, None]:
    """Yield what ``film.js`` posts from a page: the letter of each message, and its content.

    The browser draws while the messages are read; it ends with the iterator, also where that is left early.

    Args:
        text: The page.
        wanted: What is drawn, for the script.
        size: Width and height of the picture [px].

    Raises:
        InputError: If there is no browser, or it cannot draw the page.
    """
    browser = next((found for found in map(shutil.which, BROWSERS) if found), None)
    if browser is None:
        raise InputError(f"a film needs a browser to draw it: none of {', '.join(BROWSERS)} is on PATH")

    work = json.dumps(wanted).replace("<", "\\u003c")
    script = f'<script id="film" type="application/json">{work}</script><script>{asset("film.js")}</script>'
    added = PICTURE_ONLY.format(*size, max(12.5, size[1] / 45)) + script
    text = text.replace(html.escape(POLICY), html.escape(ASKING_POLICY), 1).replace("</body>", f"{added}</body>")

    news: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    with PageServer(text, 0, news.put) as server, tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        window = f"--window-size={size[0]},{size[1]}"
        process = subprocess.Popen(
            [browser, *OPTIONS, window, f"--user-data-dir={folder}", server.url],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            while (message := _next(news, process, Path(browser).name)) != END:
                kind = message[:1]
                content = message[1:]
                if kind == FAULT:
                    raise InputError(f"{Path(browser).name} cannot draw this: {content.decode('utf-8', 'replace')}")
                yield kind, content
        finally:
            process.terminate()
            process.wait(timeout=30)


def _next(news: queue.SimpleQueue[bytes], process: subprocess.Popen[bytes], name: str) -> bytes:
    """Wait for the next message of the page."""
    for _ in range(round(PATIENCE / LOOK_SECONDS)):
        try:
            return news.get(timeout=LOOK_SECONDS)
        except queue.Empty:
            if process.poll() is not None:
                break
    raise InputError(f"{name} ended or drew nothing more; is it a browser with WebGL?")

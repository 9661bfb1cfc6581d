"""What a page does in a headless browser: random drags, whose files `rrtik check` gets, and how long a drag takes."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
import threading
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import rrtik_ompl as rrtik
from rrtik_ompl.cli.app import run
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.serve import PageServer

SCRIPT = Path(__file__).with_name("in_page.js")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--headless=new", "--no-sandbox", "--window-size=800,600", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
PATIENCE = 1800.0  # [s]


@dataclass(frozen=True)
class Dragged:
    """Of the drags in a page.

    Attributes:
        drags: How many were made.
        paths: How many gave a path; the others blocked an end, or no path was found.
        refused: What `rrtik check` said of those that it refused.
        waits: From a drag of the goal until the new path is there, ready to be drawn [ms].
        times: Until it has been drawn [ms].
        kernels: Until the kernels of the page were ready [ms].
        loaded: Until the page could plan [ms].
        drawing: Of that the start of the engine that draws and of its renderer [ms].
        size: Of the page [bytes].
    """

    drags: int
    paths: int
    refused: list[str]
    waits: list[float]
    times: list[float]
    kernels: float
    loaded: float
    drawing: float
    size: int


def dragged(problem: rrtik.Problem, drags: int, timed: int, seed: int) -> Dragged:
    """Drag at random in the page of a problem; every path with its problem goes through `rrtik check`."""
    path = rrtik.plan(problem, "fastrrtconnect", seed=seed, shorten=False).path
    text = page(problem, path, asks=True)
    found: dict[str, Any] = {}
    arrived = threading.Event()

    def take(body: bytes) -> None:
        found.update(json.loads(body))
        arrived.set()

    work = json.dumps({"drags": drags, "timed": timed, "seed": seed})
    added = f'<script id="work" type="application/json">{work}</script><script>{SCRIPT.read_text()}</script></body>'
    # The page may ask, which its policy allows, but does not of its own accord.
    text = text.replace('"asks":true', '"asks":false').replace("</body>", added)
    with PageServer(text, 0, take) as server, tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [_browser(), *OPTIONS, f"--user-data-dir={folder}", server.url], stderr=subprocess.DEVNULL
        )
        try:
            if not arrived.wait(PATIENCE):
                raise SystemExit(f"{problem.name}: no answer of the page within {PATIENCE:g} s")
        finally:
            process.terminate()
            process.wait(timeout=30)
    files = [each for each in found["files"] if each is not None]
    refused = [said for each in files if (said := _refused(each)) is not None]
    size = len(page(problem, path).encode())
    seconds = {key: found[key] for key in ("waits", "times", "kernels", "loaded", "drawing")}
    return Dragged(drags, len(files), refused, **seconds, size=size)


def _refused(files: dict[str, str]) -> str | None:
    """What `rrtik check` says if it does not accept a path."""
    with tempfile.TemporaryDirectory() as folder:
        problem, path = Path(folder, "problem.yaml"), Path(folder, "path.json")
        problem.write_text(files["problem"], encoding="utf-8")
        path.write_text(files["path"], encoding="utf-8")
        said = StringIO()
        with redirect_stdout(said):
            code = run(["check", str(problem), str(path)])
        return None if code == 0 else said.getvalue().strip() or f"exit code {code}"


def _browser() -> str:
    found = next((name for name in map(shutil.which, BROWSERS) if name), None)
    if found is None:
        raise SystemExit(f"none of {', '.join(BROWSERS)} is on PATH: the page cannot be opened")
    return found

"""Convert the page to a film: a headless browser draws the pictures, which are saved as GIF, MP4 or PNG."""

from __future__ import annotations

import base64
import html
import json
import os
import shutil
import subprocess
import tempfile
import threading
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.text import check_target
from rrtik_ompl.tasks.played import PlayedTask
from rrtik_ompl.viewer.page import ASKING_POLICY, POLICY, asset, page
from rrtik_ompl.viewer.serve import PageServer
from rrtik_ompl.viewer.subject import Showable, ShownPath, subject_of

FILMS = (".gif", ".mp4", ".png")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "microsoft-edge")
OPTIONS = (
    "--headless=new", "--no-sandbox", "--no-first-run", "--hide-scrollbars", "--mute-audio",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
PATIENCE = 120.0  # [s]; longest time without a new picture
COLORS = 255  # colours of a GIF
HOLD = 0.8  # [s]; how long the last picture is shown
MOST_FRAMES = 600
PICTURE_ONLY = (
    "<style>header, aside, footer, #labels {{ display: none !important }} "
    "body {{ display: block }} main {{ width: {}px; height: {}px }}</style>"
)


def film(
    shown: Showable,
    path: ShownPath | PlayedTask | None,
    file: str | os.PathLike[str],
    *,
    seconds: float = 4.0,
    rate: float = 12.0,
    size: tuple[int, int] = (640, 400),
) -> Path:
    """Write a path as a film, or a configuration as a still picture.

    Args:
        shown: A ``Problem``, ``World``, ``Robot`` or ``Scene``.
        path: What is played, such as the ``played()`` of a plan of a task; may be None for a PNG.
        file: .gif, .mp4 or .png (the first picture).
        seconds: Duration of the whole path.
        rate: Pictures a second.
        size: Width and height [px].

    Returns:
        The file.

    Raises:
        InputError: If a moving picture has no path, a number is out of range, there is no browser, or the file cannot
            be written.
    """
    target = Path(file)
    check_target(target, FILMS)
    still = target.suffix.lower() == ".png"
    if not still and not isinstance(path, PlayedTask) and not subject_of(shown, path).is_path:
        raise InputError(f"{target}: a film needs a path; give one (rrtik plan --out path.json), or ask for a .png")

    count = 1 if still else round(seconds * rate) + 1
    if not (rate > 0.0 and 1 <= count <= MOST_FRAMES and min(size) >= 64 and max(size) <= 4096):
        raise InputError(f"a film of {seconds:g} s, {rate:g} pictures a second, {size[0]} x {size[1]} px: out of range")

    held = 0 if still else round(HOLD * rate)
    pictures = drawn(page(shown, path, still=True), count, size)
    try:
        _write(target, pictures, rate, held)
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {error.strerror or error}") from error

    return target


def drawn(text: str, frames: int, size: tuple[int, int]) -> list[Image.Image]:
    """Return the pictures of a page from the start of its path to the end.

    A script in the page draws them and posts them to a local server, while a headless browser displays the page.

    Args:
        text: The page.
        frames: Number of pictures.
        size: Width and height [px].

    Raises:
        InputError: If there is no browser, or none that draws the page.
    """
    browser = next((found for found in map(shutil.which, BROWSERS) if found), None)
    if browser is None:
        raise InputError(f"a film needs a browser to draw it: none of {', '.join(BROWSERS)} is on PATH")

    work = json.dumps({"frames": frames})
    script = f'<script id="film" type="application/json">{work}</script><script>{asset("film.js")}</script>'
    added = PICTURE_ONLY.format(*size) + script

    pictures: list[Image.Image] = []
    news = threading.Event()
    ended = threading.Event()

    def take(body: bytes) -> None:
        if body == b"end":
            ended.set()
        else:
            pictures.append(Image.open(BytesIO(base64.b64decode(body.split(b",", 1)[1]))).convert("RGB"))
        news.set()

    text = text.replace(html.escape(POLICY), html.escape(ASKING_POLICY), 1).replace("</body>", f"{added}</body>")
    with PageServer(text, 0, take) as server, tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        window = f"--window-size={size[0]},{size[1]}"
        process = subprocess.Popen(
            [browser, *OPTIONS, window, f"--user-data-dir={folder}", server.url],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

        try:
            while not ended.is_set() and news.wait(PATIENCE) and process.poll() is None:
                news.clear()
        finally:
            process.terminate()
            process.wait(timeout=30)

    if len(pictures) < frames:
        raise InputError(f"{Path(browser).name} drew {len(pictures)} of {frames} pictures; is it a browser with WebGL?")
    return pictures


def _write(file: Path, pictures: list[Image.Image], rate: float, held: int) -> None:
    """Write pictures to one file; the last one is shown for the time of ``held`` pictures."""
    kind = file.suffix.lower()
    if kind == ".png":
        pictures[0].save(file, optimize=True)
    elif kind == ".gif":
        chosen = np.hstack([np.asarray(pictures[k * (len(pictures) - 1) // 3]) for k in range(4)])
        palette = Image.fromarray(chosen).quantize(COLORS, dither=Image.Dither.NONE)
        few = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
        times = [round(1e3 / rate)] * (len(few) - 1) + [round(1e3 * max(held, 1) / rate)]
        few[0].save(file, save_all=True, append_images=few[1:], duration=times, loop=0, optimize=True)
    else:
        code = cv2.VideoWriter.fourcc(*"mp4v")
        width, height = (2 * (side // 2) for side in pictures[0].size)
        writer = cv2.VideoWriter(str(file), code, rate, (width, height))
        if not writer.isOpened():
            raise OSError("is the folder there, and yours to write in?")

        for each in pictures + [pictures[-1]] * max(held - 1, 0):
            writer.write(np.asarray(each)[:height, :width, ::-1])
        writer.release()

"""Films and still pictures of a page, drawn by a headless browser: MP4, WebM, GIF and PNG."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rrtik_ompl.base.arrays import finite_number, positive
from rrtik_ompl.base.errors import InputError, called, listed, require
from rrtik_ompl.base.interrupts import tidied_before_the_end
from rrtik_ompl.files.text import FILM_FORMATS, PICTURE_FORMATS, check_target, file_name, write_bytes
from rrtik_ompl.motion.trajectory import Trajectory
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.tasks.played import PlayedTask
from rrtik_ompl.viewer.asked import Asked, AskedPath, AskedTree, Parts, parts_of
from rrtik_ompl.viewer.browser import posts
from rrtik_ompl.viewer.film_file import webm, whole_film
from rrtik_ompl.viewer.film_view import camera_of, sides_of
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.subject import subject_of

BITS_PER_PIXEL = 0.1  # of an encoded film
LEAST_BITS = 2e6  # [bit/s]
SIZE = (1280, 720)  # [px]
GIF_SIZE = (640, 400)  # [px]
RATE = 30.0  # pictures a second
GIF_RATE = 12.0
PATH_SECONDS = 4.0  # duration of the film of a path without times
LONGEST = 48.0  # [s] of what has times of its own; longer motions play faster
HOLD = 0.8  # [s]; how long the last picture is shown
MOST_FRAMES = 36_000
COLORS = 255  # colours of a GIF


def film(
    shown: Asked,
    file: str | os.PathLike[str],
    path: AskedPath | None = None,
    *,
    run: ReplanRun | None = None,
    tree: AskedTree | None = None,
    seconds: float | None = None,
    rate: float | None = None,
    size: str | Sequence[int] | None = None,
    camera: str | os.PathLike[str] = "overview",
    hide: str | Iterable[str] = "",
    on_picture: Callable[[int, int], object] = lambda done, count: None,
) -> Path:
    """Write a film of a plan, a path, a timed motion, a task or a run of replanning.

    A headless browser draws it, by software alone, so that it needs neither a screen nor a graphics card. The file
    appears only when it is complete.

    Args:
        shown: What :func:`rrtik_ompl.view` shows: a ``Plan`` or ``TaskPlan``, or a problem, world or robot with a path.
        file: .mp4 (H.264), .webm (VP9) or .gif.
        path: What is played: a path, a ``Trajectory``, a ``TaskPlan``; None for the path of a plan, and with a run.
        run: A run of :func:`rrtik_ompl.replan` in place of a path.
        tree: As for :func:`rrtik_ompl.view`; it grows in the first half of the film.
        seconds: Duration [s]; None for 4 s of a path, and as many of a tree, or for the time that the motion itself
            takes, at most 48 s.
        rate: Pictures a second; None for 30, of a GIF 12.
        size: Width and height [px], (1920, 1080) or "1920x1080"; None for 1280 x 720, of a GIF 640 x 400.
        camera: "overview", "front", "side", "top"; "orbit" goes once around everything, "follow" stays beside the tip;
            or a file of views, as the page saves it.
        hide: What is left out: names of groups of the page's tree ("ghosts", "trails", "labels", "frames", "grid",
            ...), of single things in it such as obstacles, or "caption".
        on_picture: Called with the number of finished pictures and of all.

    Returns:
        The file.

    Raises:
        InputError: If there is nothing that moves, a value is out of range, there is no browser or no encoder, or the
            file cannot be written.

    Example:
        >>> plan = rrtik.plan(rrtik.load_problem("planar3_boxes"), "bicrdt", seed=1)
        >>> rrtik.film(plan, "plan.gif", size="160x100", seconds=1.0, camera="top").name  # doctest: +SKIP
        'plan.gif'
    """
    target = file_name(file)
    check_target(target, FILM_FORMATS)
    ending = target.suffix.lower()
    gif = ending == ".gif"

    parts = parts_of(shown, path, None, tree)
    length = _seconds(parts, run, target) if seconds is None else positive(seconds, "seconds of a film")
    speed = (GIF_RATE if gif else RATE) if rate is None else positive(rate, "rate of a film")
    width, height = sides_of((GIF_SIZE if gif else SIZE) if size is None else size, ending)
    frames = round(min(length * speed, MOST_FRAMES)) + 1
    if not 2 <= frames <= MOST_FRAMES:
        raise InputError(
            f"a film of {length:g} s, {speed:g} pictures a second: out of range (2 to {MOST_FRAMES} in all)"
        )

    wanted = {
        **_wanted(camera, hide, (width, height)),
        "frames": frames,
        "held": round(HOLD * speed),
        "rate": speed,
        "ending": ending,
        "bits": max(BITS_PER_PIXEL * width * height * speed, LEAST_BITS),
    }
    called(on_picture, "on_picture", "how many are finished", "how many there are")
    with tidied_before_the_end(), closing(posts(_page(parts, run), wanted, (width, height))) as messages:
        counted = _counted(messages, on_picture, frames)
        if ending == ".mp4":
            _write_mp4(target, counted, speed, (width, height))
        elif ending == ".webm":
            write_bytes(target, webm([(kind == b"K", data) for kind, data in counted], speed, (width, height)))
        else:
            write_bytes(target, _gif([data for _, data in counted], speed, wanted["held"]))
    return target


def picture(
    shown: Asked,
    file: str | os.PathLike[str],
    path: AskedPath | None = None,
    *,
    run: ReplanRun | None = None,
    tree: AskedTree | None = None,
    at: float = 0.0,
    size: str | Sequence[int] = SIZE,
    camera: str | os.PathLike[str] = "overview",
    hide: str | Iterable[str] = "",
) -> Path:
    """Write a still picture (.png) of what :func:`film` films; for its arguments see there.

    Args:
        shown: A ``Plan`` or ``TaskPlan``; or a problem, world, robot or scene.
        file: .png.
        path: A path, or None.
        run: A run in place of a path.
        tree: As for :func:`rrtik_ompl.view`.
        at: Which moment is drawn: 0 is the start, 1 the end.
        size: Width and height [px].
        camera: Name of a camera, or a file of views.
        hide: What is left out.

    Returns:
        The file.

    Raises:
        InputError: If a value is out of range, there is no browser, or the file cannot be written.

    Example:
        >>> robot = rrtik.load_robot("panda")
        >>> rrtik.picture(robot, "panda.png", size="640x480", camera="front").name  # doctest: +SKIP
        'panda.png'
    """
    target = file_name(file)
    check_target(target, PICTURE_FORMATS)
    if not 0.0 <= finite_number(at, "moment of a picture") <= 1.0:
        raise InputError(f"moment of a picture: expected 0 (start) to 1 (end), got {at:g}")
    sides = sides_of(size, target.suffix.lower())
    wanted = {**_wanted(camera, hide, sides), "frames": 1, "held": 0, "at": at, "rate": 1.0, "ending": ".png"}

    text = _page(parts_of(shown, path, None, tree), run)
    with tidied_before_the_end(), closing(posts(text, wanted, sides)) as messages:
        write_bytes(target, next(data for _, data in messages))
    return target


def drawn(text: str, frames: int, size: tuple[int, int], **wanted: Any) -> Iterator[Image.Image]:
    """Yield pictures of a page from the start of its path to the end.

    Args:
        text: The page.
        frames: Number of pictures; of a single one ``at`` says the moment.
        size: Width and height [px].
        wanted: ``camera`` and ``hide`` as of :func:`film`.

    Raises:
        InputError: If there is no browser, or none that draws the page.
    """
    work = {**_wanted("overview", (), size), "frames": frames, "held": 0, "at": 0.0, "rate": 1.0, "ending": ".png"}
    with closing(posts(text, {**work, **wanted}, size)) as messages:
        for _, data in messages:
            yield Image.open(BytesIO(data)).convert("RGB")


def _wanted(camera: str | os.PathLike[str], hide: str | Iterable[str], size: tuple[int, int]) -> dict[str, Any]:
    """Return what the page's script must know of a picture."""
    names = hide.split(",") if isinstance(hide, str) else listed(hide, "hide")
    for name in names:
        require(name, str, "each name in hide")
    return {"camera": camera_of(camera), "hide": [name.strip() for name in names if name.strip()], "size": list(size)}


def _page(parts: Parts, run: ReplanRun | None) -> str:
    return page(parts.shown, parts.path, run=run, tree=parts.tree, still=True)


def _seconds(parts: Parts, run: ReplanRun | None, target: Path) -> float:
    """Return the duration of a film [s] if none is given."""
    path = parts.path
    if run is not None:
        return min(max(float(run.times[-1]), 1.0), LONGEST)
    if isinstance(path, PlayedTask):
        return min(len(path.waypoints) / path.rate, LONGEST)
    if isinstance(path, Trajectory):
        return min(path.duration, LONGEST)
    growth = 0.0 if parts.tree is None else PATH_SECONDS
    if subject_of(parts.shown, path).is_path:
        return growth + PATH_SECONDS
    if not growth:
        raise InputError(f"{target}: a film needs a path; give one (rrtik plan --out path.json), or ask for a picture")
    return growth


def _counted(
    messages: Iterator[tuple[bytes, bytes]], on_picture: Callable[[int, int], object], count: int
) -> Iterator[tuple[bytes, bytes]]:
    """Yield messages that have a content, and say how many pictures are finished."""
    done = 0
    for kind, data in messages:
        if kind in (b"P", b"N"):
            done += 1
            on_picture(done, count)
        if kind != b"N":
            yield kind, data


def _write_mp4(target: Path, messages: Iterable[tuple[bytes, bytes]], rate: float, size: tuple[int, int]) -> None:
    """Write pictures that H.264 has encoded to a film, which appears when it is complete."""
    settings = [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1, cv2.VIDEOWRITER_PROP_KEY_INTERVAL, int(np.ceil(rate))]
    code = cv2.VideoWriter.fourcc(*"avc1")
    with whole_film(target) as unfinished:
        writer = cv2.VideoWriter(str(unfinished), cv2.CAP_FFMPEG, code, rate, size, settings)
        if not writer.isOpened():
            raise InputError(f"{target}: cannot be written; is the folder there, and yours to write in?")
        try:
            for _, data in messages:
                writer.write(np.frombuffer(data, np.uint8)[None])
        finally:
            writer.release()


def _gif(pictures: Sequence[bytes], rate: float, held: int) -> bytes:
    """Return a GIF of pictures (PNG), all in the colours of four of them; the last one is shown ``held`` times."""
    chosen = [_pixels(pictures[k * (len(pictures) - 1) // 3]) for k in range(4)]
    palette = Image.fromarray(np.hstack(chosen)).quantize(COLORS, dither=Image.Dither.NONE)
    few = [Image.fromarray(_pixels(each)).quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    times = [round(1e3 / rate)] * (len(few) - 1) + [round(1e3 * max(held, 1) / rate)]
    file = BytesIO()
    few[0].save(file, "GIF", save_all=True, append_images=few[1:], duration=times, loop=0, optimize=True)
    return file.getvalue()


def _pixels(picture: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(BytesIO(picture)).convert("RGB"))

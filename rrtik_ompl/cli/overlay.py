"""The command `rrtik overlay`."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer

from rrtik_ompl.cli.terminal import progress, say
from rrtik_ompl.errors import InputError
from rrtik_ompl.files.text import check_target

ENDINGS = (".mp4", ".avi", ".png", ".jpg")


def overlay(
    source: Annotated[str, typer.Argument(help="A video, an image, a folder of images, or a camera's number.")],
    problem: Annotated[str, typer.Argument(help="Whose arm is drawn, at its start: a shipped problem or a YAML file.")],
    path: Annotated[Path | None, typer.Argument(help="A path that the arm follows: .json, .csv or .txt.")] = None,
    *,
    camera: Annotated[Path, typer.Option(help="Camera file (see: rrtik markers calibrate).")],
    marker_map: Annotated[Path, typer.Option("--map", help="Which marker sits on which object: .yaml.")],
    out: Annotated[Path, typer.Option(help="Film (.mp4, .avi), or the last picture (.png, .jpg).")],
    seconds: Annotated[float, typer.Option(help="That the arm takes for the whole path [s].")] = 10.0,
    ghosts: Annotated[int, typer.Option(help="Configurations ahead on the path, drawn as well, 0 to 20.")] = 1,
    frames: Annotated[
        int, typer.Option(help="So many pictures at most; 0: all; a camera device needs a number.", min=0)
    ] = 0,
) -> int:
    """Draw the arm on its way into a video.

    Where it is, ghosts of where it goes, the trail of its tip, frames of what is seen.
    """
    check_target(out, ENDINGS)
    if source.isdecimal() and not frames:
        raise InputError(f"camera {source} has no last picture; say --frames N")
    from rrtik_ompl import load_path, load_problem
    from rrtik_ompl.overlay.film import ArmInPictures, rate_of, write_film
    from rrtik_ompl.sensing.cameras.camera_file import load_camera
    from rrtik_ompl.sensing.cameras.pictures import pictures_from, write_picture
    from rrtik_ompl.sensing.markers.marker_map_file import load_marker_map
    from rrtik_ompl.sensing.sensor import Sensor

    question = load_problem(problem)
    rows = [question.start] if path is None else load_path(path, question.robot).waypoints
    sensor = Sensor(load_camera(camera), load_marker_map(marker_map))
    arm = ArmInPictures(question.robot, sensor, rows, seconds=seconds, ghosts=ghosts)
    rate, pictures = rate_of(islice(pictures_from(source), frames or None))
    with progress("drawing"):
        drawn = _drawn(arm, pictures, lambda: sensor.why_nothing(source))
        if out.suffix.lower() in ENDINGS[2:]:
            (last,) = deque(drawn, maxlen=1)
            write_picture(last, out)
        else:
            write_film(out, drawn, rate)
    missing = f"; the first {arm.without_base} show no base and stay as they were" if arm.without_base else ""
    say(f"wrote {out}: {arm.count} pictures, {rate:g} a second{missing}")
    return 0


def _drawn(arm: Any, pictures: Iterable[Any], why_nothing: Callable[[], str]) -> Iterator[Any]:
    """All pictures with the arm; an error after the last one if the base was in none of them."""
    for picture in pictures:
        yield arm.draw(picture)
    if arm.without_base == arm.count:
        raise InputError(why_nothing())

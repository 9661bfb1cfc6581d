"""Commands that draw the arm: `rrtik overlay` over pictures, `rrtik play` in a page where things are dragged."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rrtik_ompl.cli.terminal import progress, say
from rrtik_ompl.errors import InputError
from rrtik_ompl.files.text import check_target

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rrtik_ompl.overlay.film import ArmInPictures
    from rrtik_ompl.sensing.cameras.pictures import Picture

ENDINGS = (".mp4", ".avi", ".png", ".jpg")


def play(
    problem: Annotated[str, typer.Argument(help="A shipped problem (see: rrtik list problems) or a YAML file.")],
    path: Annotated[Path | None, typer.Argument(help="A path file: .json, .csv or .txt.")] = None,
    port: Annotated[int, typer.Option(help="Port on 127.0.0.1; 0 takes a free one.", min=0, max=65535)] = 0,
) -> int:
    """Drag start, goal and obstacles in 3-D.

    The page plans at once, and this process proves each path.

    A live page on 127.0.0.1, until Ctrl-C.
    """
    from rrtik_ompl import load_path, load_problem
    from rrtik_ompl.viewer import play as serve

    question = load_problem(problem)
    route = None if path is None else load_path(path, question.world.robot)
    serve(question, route, port=port, on_ready=lambda url: say(f"open {url} in a browser; Ctrl-C ends"))
    return 0


def overlay(
    source: Annotated[str, typer.Argument(help="A video, an image, a folder of images, or a camera's number.")],
    problem: Annotated[str, typer.Argument(help="Whose arm is drawn, at its start: a shipped problem or a YAML file.")],
    path: Annotated[Path | None, typer.Argument(help="A path that the arm follows: .json, .csv or .txt.")] = None,
    *,
    camera: Annotated[Path, typer.Option(help="Camera file (see: rrtik markers calibrate).")],
    marker_map: Annotated[Path, typer.Option("--map", help="Marker map: which marker is on which object: .yaml.")],
    out: Annotated[Path, typer.Option(help="Film (.mp4, .avi), or the last picture (.png, .jpg).")],
    seconds: Annotated[float, typer.Option(help="Duration of the whole path [s].")] = 10.0,
    ghosts: Annotated[int, typer.Option(help="Configurations ahead on the path, drawn as well, 0 to 20.")] = 1,
    frames: Annotated[
        int, typer.Option(help="Number of pictures at most; 0: all; a camera device needs a number.", min=0)
    ] = 0,
) -> int:
    """Draw the moving arm into a video.

    With ghosts of its next configurations, the trail of its tip, and frames of the detected objects.
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

    task = load_problem(problem)
    rows = [task.start] if path is None else load_path(path, task.robot).waypoints
    sensor = Sensor(load_camera(camera), load_marker_map(marker_map))
    arm = ArmInPictures(task.robot, sensor, rows, seconds=seconds, ghosts=ghosts)
    rate, pictures = rate_of(islice(pictures_from(source), frames or None))
    with progress("drawing"):
        drawn = _drawn(arm, pictures, lambda: sensor.why_nothing(source))
        if out.suffix.lower() in ENDINGS[2:]:
            (last,) = deque(drawn, maxlen=1)
            write_picture(last, out)
        else:
            write_film(out, drawn, rate)
    missing = f"; the first {arm.without_base} show no base and are unchanged" if arm.without_base else ""
    say(f"wrote {out}: {arm.count} pictures, {rate:g} a second{missing}")
    return 0


def _drawn(
    arm: ArmInPictures, pictures: Iterable[Picture], why_nothing: Callable[[], str]
) -> Iterator[NDArray[np.uint8]]:
    """All pictures with the arm; an error after the last one if the base was in none of them."""
    for picture in pictures:
        yield arm.draw(picture)
    if arm.without_base == arm.count:
        raise InputError(why_nothing())

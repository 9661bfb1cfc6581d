"""Commands that draw the arm: `rrtik show`, `play` and `checker` in a page or a film, `rrtik overlay` over pictures."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rrtik_ompl.base.errors import InputError, ProblemError
from rrtik_ompl.cli import FOUND
from rrtik_ompl.cli.filming import Camera, FilmFile, Filming, Hide, PictureFile, Rate, Size
from rrtik_ompl.cli.terminal import PAGE_FORMATS, ProblemName, note, plural, progress, say, shown_names, suggest
from rrtik_ompl.files.text import check_target, write_text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rrtik_ompl.model.path import JointPath
    from rrtik_ompl.model.robot import Robot
    from rrtik_ompl.pilot.overlay.film import ArmInPictures
    from rrtik_ompl.sensing.cameras.pictures import Picture

ROBOT_FILES = (".urdf", ".xml", ".xacro")
WITH_PROBLEM = {  # what cannot be shown alone, and what to do, by the kind of the file
    "JointPath": "give its problem too: rrtik show PROBLEM {}",
    "Trajectory": "give its problem too: rrtik show PROBLEM {}",
    "ReplanRun": "give its scenario too: rrtik replan SCENARIO --replay {} --html page.html",
}
ENDINGS = (".mp4", ".avi", ".png", ".jpg")


def show(
    problem: Annotated[
        str,
        typer.Argument(
            help="A shipped problem (rrtik list problems), a YAML file, a robot, or the plan of a task (.json).",
            autocompletion=shown_names,
        ),
    ],
    path: Annotated[
        Path | None, typer.Argument(help="A path file: .json, .csv or .txt. Or a timed motion: it plays in real time.")
    ] = None,
    scene: Annotated[Path | None, typer.Option(help="Obstacles around a robot: a YAML file.")] = None,
    before: Annotated[Path | None, typer.Option(help="Another path file, to compare with.")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a self-contained 3-D page to this file.")] = None,
    film: FilmFile = None,
    picture: PictureFile = None,
    seconds: Annotated[
        float | None,
        typer.Option(help="Duration of the film [s]; if left out 4, or what a timed motion takes, at most 48."),
    ] = None,
    rate: Rate = None,
    size: Size = None,
    camera: Camera = "overview",
    hide: Hide = "",
    port: Annotated[int, typer.Option(help="Port on 127.0.0.1; 0 takes a free one.", min=0, max=65535)] = 0,
    still: Annotated[bool, typer.Option("--still", help="A page that does not plan by itself: smaller.")] = False,
) -> int:
    """Show a problem, and a path for it, in 3-D.

    A live page on 127.0.0.1, or a file. Start, goal and obstacles can be dragged there: the page plans by itself.

    A robot is shown alone, or in a scene; the plan of a task with all its motions, and with what is carried. Where the
    start is in collision, the bodies are red, and the exit code is 1.
    """
    check_target(html, PAGE_FORMATS)
    filming = Filming(film, picture, rate, size, camera, hide)
    filming.check()

    from rrtik_ompl.files.kinds import KINDS, kind_of
    from rrtik_ompl.viewer import view

    kind = kind_of(problem)
    if kind in WITH_PROBLEM:
        raise InputError(f"{problem}: {KINDS[kind].what}; {WITH_PROBLEM[kind].format(problem)}")
    if kind != "TaskPlan" and path is not None and kind_of(path) == "ReplanRun":
        raise InputError(f"{path}: {KINDS['ReplanRun'].what}; {WITH_PROBLEM['ReplanRun'].format(path)}")

    drawn = _of_task if kind == "TaskPlan" else _of_problem
    question, route, earlier, fault, title = drawn(problem, path, scene, before)

    written = filming.write(question, route, seconds=seconds)
    if html is not None:
        view(question, route, html=html, before=earlier, still=still, title=title)
        written.append(html)
    if written:
        say(*(f"wrote {file}" for file in written))
        suggest(*(f"open {file}" for file in written))
        return int(bool(fault))

    def ready(url: str) -> None:
        say(f"open {url} in a browser; Ctrl-C ends")

    view(question, route, before=earlier, port=port, still=still, title=title, on_ready=ready)
    return int(bool(fault))


class Drawn(NamedTuple):
    """What a page or a film shows.

    Attributes:
        question: A problem, a world, or a robot.
        route: What is played; None if nothing moves.
        before: A path to compare with; None without one.
        fault: Why the start is invalid; "" if it is valid.
        title: Heading; None derives it from the name.
    """

    question: Any
    route: Any
    before: JointPath | None
    fault: str
    title: str | None


def _of_problem(name: str, path: Path | None, scene: Path | None, before: Path | None) -> Drawn:
    """Return a problem or a robot, with the path in a file."""
    from rrtik_ompl import JointPath
    from rrtik_ompl.motion.trajectory.load import load_motion_or_path

    question, robot, fault = _subject(name, scene)
    route = None if path is None else load_motion_or_path(path, robot)
    earlier = None if before is None else JointPath.load(before, robot)
    return Drawn(question, route, earlier, fault, fault or None)


def _of_task(name: str, path: Path | None, scene: Path | None, before: Path | None) -> Drawn:
    """Return the plan of a task, as it is played."""
    from rrtik_ompl import TaskPlan

    given = {"PATH": path, "--scene": scene, "--before": before}
    wrong = [option for option, value in given.items() if value is not None]
    if wrong:
        raise InputError(f"{name}: the plan of a task, which holds its paths and scenes: leave {wrong[0]} out")

    plan = TaskPlan.load(name)
    return Drawn(plan.worlds[0], plan.played(), None, "", f"{Path(name).stem}: {plural(len(plan.paths), 'motion')}")


def _subject(name: str, scene: Path | None) -> tuple[Any, Robot, str]:
    """Return what is shown, its robot, and why its start is invalid; "" if it is valid."""
    from rrtik_ompl import Scene, World, list_problems, list_robots, load_problem, load_robot, load_scene
    from rrtik_ompl.problem_files.problem_values import load_unchecked
    from rrtik_ompl.viewer.subject import Shown
    from rrtik_ompl.world.judgement import contacts_along

    if Path(name).suffix.lower() in ROBOT_FILES or (name in list_robots() and name not in list_problems()):
        robot = load_robot(name)
        return World(robot, Scene() if scene is None else load_scene(scene)), robot, ""
    if scene is not None:
        raise InputError(f"--scene is for a robot, and '{name}' is none; a problem file has a scene of its own")
    try:
        question = load_problem(name)
        return question, question.robot, ""
    except ProblemError as error:
        fault = str(error)

    settings, start, goal = load_unchecked(name)
    note(fault)
    touching = contacts_along(World.of(settings).checks, start[None])
    return Shown(settings.robot, settings.scene, goal, start, touching), settings.robot, fault


def play(
    problem: ProblemName,
    path: Annotated[Path | None, typer.Argument(help="A path file: .json, .csv or .txt.")] = None,
    port: Annotated[int, typer.Option(help="Port on 127.0.0.1; 0 takes a free one.", min=0, max=65535)] = 0,
) -> int:
    """Drag start, goal and obstacles in 3-D.

    The page plans at once, and this process proves each path.

    A live page on 127.0.0.1, until Ctrl-C.
    """
    from rrtik_ompl import JointGoal, JointPath, load_problem, plan
    from rrtik_ompl.viewer import play as serve

    question = load_problem(problem)
    if path is not None:
        route = JointPath.load(path, question.world.robot)
    elif question.constraints or isinstance(question.goal, JointGoal):
        route = None  # the page refuses the first, and plans to the second by itself
    else:
        route = plan(question, seed=0).path
    serve(question, route, port=port, on_ready=lambda url: say(f"open {url} in a browser; Ctrl-C ends"))
    return FOUND


def checker(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The page: .html.")] = Path("checker.html"),
) -> int:
    """Write the page that checks certificates of motions.

    One file that needs neither this library nor a network: drop a certificate, a robot (URDF) and a scene on it.
    """
    check_target(out, PAGE_FORMATS)
    from rrtik_ompl.viewer.checker import checker_page

    write_text(out, checker_page())
    say(f"wrote {out}: open it in a browser")
    return FOUND


def overlay(
    source: Annotated[str, typer.Argument(help="A video, an image, a folder of images, or a camera's number.")],
    problem: Annotated[str, typer.Argument(help="Its arm is drawn, at its start: a shipped problem or a YAML file.")],
    path: Annotated[Path | None, typer.Argument(help="A path that the arm follows: .json, .csv or .txt.")] = None,
    *,
    camera_file: Annotated[Path, typer.Option(help="Camera file (see: rrtik markers calibrate).")],
    marker_map: Annotated[Path, typer.Option("--map", help="Marker map: which marker is on which object: .yaml.")],
    out: Annotated[Path, typer.Option(help="Film (.mp4, .avi), or the last picture (.png, .jpg).")],
    seconds: Annotated[float, typer.Option(help="Duration of the whole path [s].")] = 10.0,
    ghosts: Annotated[int, typer.Option(help="Configurations ahead on the path, drawn as well, 0 to 20.")] = 1,
    frames: Annotated[
        int, typer.Option(help="Largest number of pictures; 0: all; a camera device needs a number.", min=0)
    ] = 0,
) -> int:
    """Draw the moving arm into a video.

    With ghosts of its next configurations, the trail of its tip, and frames of the detected objects.
    """
    check_target(out, ENDINGS)
    if source.isdecimal() and not frames:
        raise InputError(f"camera {source} has no last picture; say --frames N")

    from rrtik_ompl import JointPath, load_problem
    from rrtik_ompl.pilot.overlay.film import ArmInPictures, rate_of, write_film
    from rrtik_ompl.sensing.cameras.camera import Camera
    from rrtik_ompl.sensing.cameras.pictures import pictures_from, write_picture
    from rrtik_ompl.sensing.markers.marker_map import MarkerMap
    from rrtik_ompl.sensing.sensor import Sensor

    task = load_problem(problem)
    rows = [task.start] if path is None else JointPath.load(path, task.robot).waypoints
    sensor = Sensor(Camera.load(camera_file), MarkerMap.load(marker_map))
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
    return FOUND


def _drawn(
    arm: ArmInPictures, pictures: Iterable[Picture], why_nothing: Callable[[], str]
) -> Iterator[NDArray[np.uint8]]:
    """Yield all pictures with the arm; raise an error after the last one if the base was in none of them."""
    for picture in pictures:
        yield arm.draw(picture)
    if arm.without_base == arm.count:
        raise InputError(why_nothing())

"""The commands `rrtik markers print | calibrate | sense`."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli import FOUND
from rrtik_ompl.cli.terminal import plural, progress, say
from rrtik_ompl.cli.trust import with_trust
from rrtik_ompl.files.text import check_target
from rrtik_ompl.sensing.cameras.models import Model

if TYPE_CHECKING:
    from rrtik_ompl.sensing.calibration import Board, Calibration
    from rrtik_ompl.sensing.cameras.camera import Camera
    from rrtik_ompl.sensing.rig import Rig
    from rrtik_ompl.sensing.sensor import Sensor, View

markers = typer.Typer(help="Print markers, calibrate cameras, find marked objects.")

Dictionary = Annotated[
    str,
    typer.Option(
        help="Of the markers: 4x4_50 is found farthest away, apriltag_36h11 and aruco_mip_36h12 confused least."
    ),
]
DEFAULT_DICTIONARY = "apriltag_36h11"
BOARD_MARKER = 0.73  # default side of a board's markers, as a share of a chess square
PICTURES, SCENES = (".png", ".jpg"), (".yaml", ".yml")


class Kind(str, Enum):
    """The sheets that can be printed."""

    markers = "markers"
    board = "board"


@markers.command("print")
def print_sheet(
    out: Annotated[Path, typer.Argument(help="Where to: .pdf (true to size) or .png.")],
    kind: Annotated[Kind, typer.Option(help="Single markers, or a ChArUco board for calibration.")] = Kind.markers,
    numbers: Annotated[str, typer.Option(help="Numbers: 0,1,7 or 0-5.")] = "0-3",
    side_mm: Annotated[float, typer.Option(help="Side of a single marker's black square [mm].")] = 80.0,
    square_mm: Annotated[float, typer.Option(help="Side of a board's chess square [mm].")] = 30.0,
    marker_mm: Annotated[
        float | None, typer.Option(help="Side of a board's markers [mm]; 0.73 of a square if left out.")
    ] = None,
    columns: Annotated[int, typer.Option(help="Chess squares of a board across.")] = 6,
    rows: Annotated[int, typer.Option(help="Chess squares of a board down.")] = 8,
    dictionary: Dictionary = DEFAULT_DICTIONARY,
    paper: Annotated[str, typer.Option(help="a4, a3 or letter.")] = "a4",
) -> int:
    """Write sheets of markers, or a calibration board.

    At their true size: print at 100 % and measure the rule on the sheet.
    """
    from rrtik_ompl.sensing.markers import sheets

    if kind is Kind.board:
        square = 1e-3 * square_mm
        inner = BOARD_MARKER * square if marker_mm is None else 1e-3 * marker_mm
        sheets.print_board(
            out, columns=columns, rows=rows, square=square, marker=inner, dictionary=dictionary, paper=paper
        )
        count = 1
    else:
        count = sheets.print_markers(out, _numbers(numbers), side=1e-3 * side_mm, dictionary=dictionary, paper=paper)

    say(f"wrote {out}: {plural(count, 'sheet')}; print at 100 % and measure the rule")
    return FOUND


@markers.command("calibrate")
def calibrate_camera(
    photographs: Annotated[
        list[Path], typer.Argument(help="Folder of photographs of the board, or a video; for a rig one per camera.")
    ],
    out: Annotated[Path, typer.Option(help="The camera file to write; for a rig, the rig's file: .yaml.")],
    columns: Annotated[int, typer.Option(help="Chess squares of the board across.")] = 6,
    rows: Annotated[int, typer.Option(help="Chess squares of the board down.")] = 8,
    square_mm: Annotated[float, typer.Option(help="Side of a chess square as printed [mm].")] = 30.0,
    marker_mm: Annotated[
        float | None, typer.Option(help="Side of a marker as printed [mm]; 0.73 of a square if left out.")
    ] = None,
    dictionary: Dictionary = DEFAULT_DICTIONARY,
    chessboard: Annotated[bool, typer.Option("--chessboard", help="The board has no markers.")] = False,
    model: Annotated[
        Model, typer.Option(help="Of the lens: brown (k1, k2, p1, p2), rational (eight numbers), or fisheye.")
    ] = Model.brown,
) -> int:
    """Calibrate a camera, or cameras that are fixed to each other.

    From photographs of a printed board, with markers or without; writes the camera file. Two folders or more, each with
    one camera's photographs of the same moments in order, make a rig: its file, and one for each camera beside it.
    """
    check_target(out, SCENES)

    from rrtik_ompl.sensing.calibration import calibrate
    from rrtik_ompl.sensing.cameras.pictures import pictures_from
    from rrtik_ompl.sensing.markers.chessboard import Chessboard
    from rrtik_ompl.sensing.markers.detection import charuco_board

    square = 1e-3 * square_mm
    board: Any = Chessboard(columns, rows, square)
    if not chessboard:
        inner = BOARD_MARKER * square if marker_mm is None else 1e-3 * marker_mm
        board = charuco_board(columns, rows, square, inner, dictionary)
    if len(photographs) > 1:
        return _calibrate_rig(photographs, out, board, model)

    with progress("detecting the board"):
        taken = list(pictures_from(photographs[0]))
        names = [picture.name for picture in taken]
        found = calibrate([picture.pixels for picture in taken], board, names, lens=model.value)
    found.save(out)

    _tell(found, names)
    say(f"error {found.error:.3f} px over {sum(not r for r in found.unused)} photographs; wrote {out}")
    return FOUND


def _calibrate_rig(photographs: list[Path], out: Path, board: Board, model: Model) -> int:
    """Calibrate cameras that are fixed to each other, write their files, and print the results."""
    import numpy as np
    from pinocchio.rpy import matrixToRpy

    from rrtik_ompl.sensing.rig_calibration import calibrate_rig
    from rrtik_ompl.sensing.rig_file import pictures_together

    with progress("detecting the board"):
        moments = list(pictures_together([str(each) for each in photographs]))
        pictures = [[each[k].pixels for each in moments] for k in range(len(photographs))]
        found = calibrate_rig(pictures, board, lens=model.value)

    files = found.rig.save(out)
    rig = found.rig
    for k, (each, file) in enumerate(zip(found.cameras, files, strict=True)):
        _tell(each, [f"{photographs[k].name}/{pictures[k].name}" for pictures in moments])
        say(f"camera {k + 1}: error {each.error:.3f} px; wrote {file}")

    for k, (T, count, error) in enumerate(zip(rig.poses[1:], found.moments, found.errors, strict=True), start=2):
        xyz = " ".join(f"{value:.4f}" for value in T.translation)
        rpy = " ".join(f"{value:.3f}" for value in np.degrees(matrixToRpy(T.rotation)))
        say(f"camera {k} in the frame of camera 1: xyz {xyz} m, rpy {rpy} deg, {error:.3f} px over {count} moments")

    turn = np.degrees(rig.rotation_sigma)
    say(f"+- {1e3 * rig.position_sigma:.2f} mm, +- {turn:.3f} deg; wrote {out}")
    return FOUND


def _tell(found: Calibration, names: list[str]) -> None:
    """Print the error of each photograph, or why it was not used, and the intrinsics of the camera."""
    for name, error, unused in zip(names, found.view_errors, found.unused, strict=True):
        say(f"{name}: {unused or f'{error:.3f} px'}")

    values = found.camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    heads = ("fx", "fy", "cx", "cy")
    say(", ".join(f"{n} {v:.2f} +- {s:.2f}" for n, v, s in zip(heads, values, found.sigmas, strict=True)))

    if found.advice:
        say(f"warning: {found.advice}")
    if found.camera.tone is not None:
        say(f"tone {found.camera.tone:.2f} (0: grey values are linear, 1: coded as sRGB)")


@markers.command("sense")
@with_trust
def sense(
    source: Annotated[
        list[str],
        typer.Argument(help="An image, a folder of images, a video, or a camera's number; with --rig one per camera."),
    ],
    marker_map: Annotated[Path, typer.Option("--map", help="Marker map: which marker is on which object: .yaml.")],
    camera_file: Annotated[Path | None, typer.Option(help="Camera file (see: rrtik markers calibrate).")] = None,
    rig: Annotated[
        Path | None,
        typer.Option(help="File of a rig, in place of --camera-file: cameras that take pictures together: .yaml."),
    ] = None,
    frames: Annotated[int, typer.Option(help="Largest number of pictures; 0: all (of a camera device: 1).", min=0)] = 0,
    scene: Annotated[Path | None, typer.Option(help="Write the scene in the frame of the base: .yaml.")] = None,
    task: Annotated[
        Path | None, typer.Option(help="Write a problem with the detected objects: .yaml. Needs --problem and --grasp.")
    ] = None,
    problem: Annotated[str | None, typer.Option(help="Robot, start and further obstacles of --task.")] = None,
    grasp: Annotated[
        str | None, typer.Option(metavar="OBJECT:TYPE:LEVEL", help="Goal of --task; levels from 1.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Write the last picture with the detected objects: .png, .jpg.")
    ] = None,
    sigmas: Annotated[float, typer.Option(help="Margins of obstacles, in standard deviations; 0: none.")] = 3.0,
    smooth: Annotated[
        bool | None,
        typer.Option(
            "--smooth/--no-smooth",
            help="Follow objects over time, as through a film, or take each picture by itself (default for a folder).",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object per picture.")] = False,
) -> int:
    """Print the poses of marked objects, from pictures."""
    check_target(scene, SCENES)
    check_target(task, SCENES)
    check_target(picture, PICTURES)

    goal = _task_goal(task, problem, grasp)
    from rrtik_ompl.sensing.markers.marker_map import MarkerMap
    from rrtik_ompl.sensing.sensor import Sensor

    following = not os.path.isdir(source[0]) if smooth is None else smooth
    eye = _camera_or_rig(source, camera_file, rig)
    sensor = Sensor(eye, MarkerMap.load(marker_map), smooth=following, sigmas=sigmas)

    view = None
    for view in _views(sensor, source, frames):
        print(json.dumps(view.document())) if as_json else say(*view.lines())

    if view is None or not view.seen:
        raise InputError(sensor.why_nothing(source[0]))
    if picture is not None:
        view.save_picture(picture)
    if scene is not None:
        view.scene().save(scene)
    if task is not None:
        from rrtik_ompl import load_problem
        from rrtik_ompl.sensing.scene_from_view import grasp_problem

        grasp_problem(load_problem(str(problem)), view.usable(), *goal).save(task)
    return FOUND


def _task_goal(task: Path | None, problem: str | None, grasp: str | None) -> tuple[str, str, int]:
    """Return object, grasp type and level of a task; empty values if there is no task."""
    if len({task is None, problem is None, grasp is None}) > 1:
        raise InputError("--task FILE, --problem PROBLEM and --grasp OBJECT:TYPE:LEVEL go together; give all or none")
    if grasp is None:
        return "", "", 0

    name, _, rest = grasp.partition(":")
    kind, _, level = rest.partition(":")
    if not (name and kind and level.isdecimal()):
        raise InputError(f"--grasp {grasp}: expected OBJECT:TYPE:LEVEL, for instance valve:aslant:2")
    return name, kind, int(level)


def _camera_or_rig(sources: list[str], camera: Path | None, rig: Path | None) -> Camera | Rig:
    """Load the camera or the rig that took the pictures."""
    from rrtik_ompl.sensing.cameras.camera import Camera
    from rrtik_ompl.sensing.rig import Rig

    if (camera is None) == (rig is None):
        raise InputError("give --camera-file FILE, or --rig FILE for several cameras that take pictures together")

    if rig is not None:
        found = Rig.load(rig)
        if len(sources) != len(found.cameras):
            raise InputError(
                f"--rig {rig} has {len(found.cameras)} cameras and needs as many sources, got {len(sources)}"
            )
        return found

    if len(sources) > 1:
        raise InputError(f"{len(sources)} sources need --rig FILE, which says how their cameras stand to each other")
    return Camera.load(str(camera))


def _views(sensor: Sensor, sources: list[str], frames: int) -> Iterator[View]:
    from rrtik_ompl.sensing.rig_file import pictures_together

    most = frames or (1 if any(source.isdecimal() for source in sources) else None)
    for count, pictures in enumerate(pictures_together(sources)):
        if count == most:
            return
        yield sensor.view(*pictures)


def _numbers(text: str) -> list[int]:
    """Parse a list of numbers and ranges: ``0-3,7`` becomes [0, 1, 2, 3, 7]."""
    found: list[int] = []
    for word in text.split(","):
        first, dash, last = word.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise InputError(f"--numbers {text}: expected numbers like 0,1,7 or ranges like 0-5")
        found.extend(range(int(first), int(last or first) + 1))
        if len(found) > 1000:
            raise InputError(f"--numbers {text}: more than 1000 markers")
    return found

"""The command `rrtik markers map`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli import FOUND
from rrtik_ompl.cli.markers import DEFAULT_DICTIONARY, SCENES, Dictionary
from rrtik_ompl.cli.markers import markers as markers
from rrtik_ompl.cli.terminal import progress, say
from rrtik_ompl.files.text import check_target

if TYPE_CHECKING:
    from rrtik_ompl.base.arrays import Matrix
    from rrtik_ompl.sensing.mapping import MappedMarkers
    from rrtik_ompl.sensing.markers.marker_map import MountedMarker

CameraFile = Annotated[Path, typer.Option(help="Camera file (see: rrtik markers calibrate).")]
NO_SIDE = 0.0  # the side of markers is not given


@markers.command("map")
def map_places(
    photographs: Annotated[Path, typer.Argument(help="Folder of photographs, or a video, of markers at rest.")],
    camera_file: CameraFile,
    out: Annotated[Path, typer.Option(help="The marker map to write: .yaml.")],
    side_mm: Annotated[float, typer.Option(help="Side of the markers' black squares as printed [mm].")] = 80.0,
    sides_mm: Annotated[
        str, typer.Option(metavar="ID:MM,...", help="Sides of markers of other sizes [mm]: 7:50,8:50.")
    ] = "",
    side_sigma_mm: Annotated[
        float, typer.Option(help="Standard deviation of each side [mm]; a ruler's is 0.3.", min=0.0)
    ] = 0.3,
    dictionary: Dictionary = DEFAULT_DICTIONARY,
    reference: Annotated[
        int | None, typer.Option(help="Marker in whose frame all is; the smallest number if left out.")
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option(help="A marker map: write a copy with the found places on --object; dictionary, sides from it."),
    ] = None,
    thing: Annotated[
        str, typer.Option("--object", help="The object that carries the markers; of a new map, its name.")
    ] = "markers",
    known: Annotated[
        str, typer.Option(metavar="A-B:MM,...", help="Ruled distances of middles, to compare with: 0-1:120,0-2:200.")
    ] = "",
    every: Annotated[int, typer.Option(help="Take every n-th picture of a video.", min=1)] = 1,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the camera's poses, one JSON object a picture.")
    ] = False,
) -> int:
    """Find where markers are on an object, from photographs, and write the marker map.

    Several markers are in each photograph, and each marker in several photographs from different sides.
    """
    check_target(out, SCENES)
    sides = {_whole(number, "--sides-mm"): 1e-3 * mm for number, mm in _pairs(sides_mm, "--sides-mm ID:MM")}
    ruled = [(*_two(pair), 1e-3 * mm) for pair, mm in _pairs(known, "--known A-B:MM")]

    from rrtik_ompl.sensing.cameras.camera import Camera
    from rrtik_ompl.sensing.cameras.pictures import pictures_from
    from rrtik_ompl.sensing.mapping import map_markers
    from rrtik_ompl.sensing.markers.marker_map import MarkerMap
    from rrtik_ompl.sensing.markers.marker_map_file import write_into, write_markers

    camera = Camera.load(camera_file)
    mounted: tuple[MountedMarker, ...] = ()
    if into is not None:
        marker_map = MarkerMap.load(into)
        mounted = marker_map.named(thing).markers
        dictionary = marker_map.dictionary
        sides = {marker.number: marker.side for marker in mounted} | sides
        reference = mounted[0].number if reference is None else reference

    with progress("mapping the markers"):
        taken = (picture for k, picture in enumerate(pictures_from(photographs)) if k % every == 0)
        found = map_markers(
            taken,
            camera,
            dictionary,
            side=1e-3 * side_mm,
            sides=sides,
            side_sigma=1e-3 * side_sigma_mm,
            reference=reference,
        )

    if into is None:
        write_markers(out, dictionary, found.markers, thing)
    else:
        write_into(out, into, name=thing, markers=found.on_object(mounted))

    if as_json:
        say(*(json.dumps(picture.document()) for picture in found.pictures))
        return FOUND
    _tell(found, ruled)
    say(f"error {found.error:.3f} px over {len(found.pictures)} pictures; wrote {out}")
    return FOUND


def _tell(found: MappedMarkers, ruled: list[tuple[int, int, float]]) -> None:
    """Print the places of the markers, and how they compare with a rule."""
    import numpy as np
    from pinocchio.rpy import matrixToRpy

    say(*found.unused)
    for marker in found.markers:
        T = marker.T_object_marker
        xyz = " ".join(f"{value:.4f}" for value in T.translation)
        rpy = " ".join(f"{value:.2f}" for value in np.degrees(matrixToRpy(T.rotation)))
        line = f"marker {marker.number}: xyz {xyz} m, rpy {rpy} deg"
        if marker.covariance is not None:
            shift, turn = (np.sqrt(np.linalg.eigvalsh(part)[-1]) for part in _halves(marker.covariance))
            line += f", +- {1e3 * shift:.2f} mm, +- {np.degrees(turn):.3f} deg"
        say(f"{line}, side {1e3 * marker.side:.2f} +- {1e3 * marker.side_sigma:.2f} mm")

    for first, other, truth in ruled:
        length, sigma = found.distance(first, other)
        say(
            f"{first} to {other}: {1e3 * length:.2f} +- {1e3 * sigma:.2f} mm, ruled {1e3 * truth:.2f}: "
            f"{1e3 * (length - truth):+.2f} mm, {100.0 * (length / truth - 1.0):+.2f} %"
        )


def _halves(covariance: Matrix) -> tuple[Matrix, Matrix]:
    return covariance[:3, :3], covariance[3:, 3:]


def _pairs(text: str, option: str) -> list[tuple[str, float]]:
    """Parse what is given for names: ``7:50,8:50``."""
    pairs = []
    for word in filter(None, text.split(",")):
        name, _, number = word.strip().partition(":")
        try:
            value = float(number)
        except ValueError:
            value = NO_SIDE
        if not 0.0 < value < 1e6:
            raise InputError(f"{option}: cannot read '{word.strip()}'; write as in --help, in millimetres")
        pairs.append((name, value))
    return pairs


def _whole(text: str, option: str) -> int:
    if not text.isdecimal():
        raise InputError(f"{option}: '{text}' is no number of a marker")
    return int(text)


def _two(text: str) -> tuple[int, int]:
    first, _, other = text.partition("-")
    return _whole(first, "--known"), _whole(other, "--known")

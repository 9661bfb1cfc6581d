"""The command `rrtik reach`: the reachable space of a tip, as numbers, slices, a file, and bodies in the 3-D page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli import FOUND
from rrtik_ompl.cli.terminal import PAGE_FORMATS, Seed, progress, say
from rrtik_ompl.files.text import check_target

if TYPE_CHECKING:
    from rrtik_ompl.ik.reach import ReachMap
    from rrtik_ompl.model.robot import Robot
    from rrtik_ompl.world.world import World


MAP_FORMATS = (".npz", ".csv")
PLOT_FORMATS = (".png", ".svg")
LABELS = {
    "orientations": "share of 64 directions in which the tip was seen to point",
    "manipulability": "largest manipulability seen",
    "samples": "samples",
}


def reach(
    robot: Annotated[str, typer.Argument(help="A name (see: rrtik list robots), a URDF, an MJCF or a DH table.")],
    measure: Annotated[str, typer.Option(help="orientations, manipulability or samples.")] = "orientations",
    cell: Annotated[float | None, typer.Option(help="Side of a cell [m]; an 18th of the reach if left out.")] = None,
    samples: Annotated[
        int, typer.Option(help="Postures to draw; with neither --scene nor --free, each in 16 turns of joint 1.")
    ] = 200_000,
    axis: Annotated[
        str | None,
        typer.Option(
            help="Axis of the tip's frame whose directions count: x, y or z; if left out z, for planar arms x."
        ),
    ] = None,
    scene: Annotated[Path | None, typer.Option(help="Obstacles: only free postures count. A YAML file.")] = None,
    free: Annotated[bool, typer.Option("--free", help="Leave out postures in which the arm hits itself.")] = False,
    effective: Annotated[
        bool, typer.Option("--effective", help="The robot's effective workspace: cameras, vehicle, margins (titan4).")
    ] = False,
    seed: Seed = 0,
    out: Annotated[Path | None, typer.Option(help="Save the map: .npz, or .csv with a row per cell.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw two slices: .png or .svg.")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a 3-D page with the cells, a quarter cut away.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> int:
    """Map where an arm can bring its tip."""
    for target, endings in ((out, MAP_FORMATS), (plot, PLOT_FORMATS), (html, PAGE_FORMATS)):
        check_target(target, endings)

    if effective:
        if out is not None or html is not None or as_json or scene is not None:
            raise InputError("--effective draws slices: give --plot FILE, and none of --out, --html, --json, --scene")
        return _effective(robot, plot)

    from rrtik_ompl import Scene, World, load_robot, load_scene
    from rrtik_ompl.ik.reach import reach_map

    arm = load_robot(robot)
    surroundings = load_scene(scene) if scene is not None else Scene() if free else None
    world = None if surroundings is None else World(arm, surroundings)

    with progress(f"sampling {samples} postures of {arm.name}"):
        found = reach_map(arm, measure=measure, cell=cell, samples=samples, world=world, axis=axis, seed=seed)

    if out is not None:
        found.save(out)
    _draw(arm if world is None else world, found, plot, html)

    if as_json:
        print(json.dumps(_document(found)))
    else:
        say(*_summary(found), *(f"wrote {file}" for file in (out, plot, html) if file is not None))
    return FOUND


def _effective(robot: str, plot: Path | None) -> int:
    from rrtik_ompl.description.catalog import find_workspace
    from rrtik_ompl.viewer.plots.reach import plot_slices

    with progress(f"effective workspace of {robot}"):
        slices = find_workspace(robot)()

    if plot is not None:
        plot_slices(slices, plot, title=f"{robot}: effective workspace", colors="Blues")
    say(*(f"{robot}, {each.title}" for each in slices), *([] if plot is None else [f"wrote {plot}"]))
    return FOUND


def _draw(shown: Robot | World, found: ReachMap, plot: Path | None, html: Path | None) -> None:
    """Draw slices of the map to a file, and its cells in the 3-D page, as far as these are requested."""
    title = f"{found.robot}: {LABELS[found.measure]}"
    if plot is not None:
        from rrtik_ompl.viewer.plots.reach import plot_slices

        plot_slices(found.slices(), plot, title=title, label=found.measure)

    if html is not None:
        from rrtik_ompl.viewer import view
        from rrtik_ompl.viewer.drawing.marks import reach_marks

        with progress("drawing"):
            view(shown, html=html, marks=reach_marks(found), title=f"{found.robot}: {found.measure} in reach")


def _document(found: ReachMap) -> dict[str, Any]:
    """Return the figures of the map as plain values in SI units."""
    values = found.values[found.reached]
    return {
        "robot": found.robot,
        "measure": found.measure,
        "cell": found.size,
        "cells": int(found.reached.sum()),
        "volume": found.volume,
        "area": found.area,
        "samples": found.samples,
        "mean": float(values.mean()) if len(values) else 0.0,
        "most": float(values.max(initial=0.0)),
        "best": found.best.tolist(),
    }


def _summary(found: ReachMap) -> list[str]:
    """Return two lines about the map, for a person."""
    told = _document(found)
    if told["cells"] == 0:
        return [f"{found.robot}: no posture counted: all of them collide"]

    size = f"{found.area:.3g} m2" if found.flat else f"{found.volume:.3g} m3"
    place = ", ".join(f"{value:.2f}" for value in told["best"])

    return [
        f"{found.robot}: {told['cells']} cells of {1e3 * found.size:.0f} mm reached, {size}, "
        f"by {found.samples} samples",
        f"{LABELS[found.measure]}: mean {told['mean']:.3g}, most {told['most']:.3g} at ({place}) m",
    ]

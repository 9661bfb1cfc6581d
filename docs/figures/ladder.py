"""Draws the ladder of rooms in ARCHITECTURE.md, and the imports between them as the sources have them.

    python docs/figures/ladder.py

The floors are the layers of the contract "ladder" in pyproject.toml; modules and imports are counted.
Writes ``ladder.svg`` beside this file.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import grimp
import matplotlib
from importlinter import api
from matplotlib import pyplot as plt
from matplotlib.patches import Arc, FancyBboxPatch

FOLDER = Path(__file__).resolve().parent
LIBRARY = "rrtik_ompl"

ROOM_COLOUR = "#dceaf5"
ARC_COLOUR = "#0072b2"
ROUNDED = "round,pad=0,rounding_size=0.08"
STYLE = {"svg.hashsalt": "rrtik", "svg.fonttype": "none", "font.family": "sans-serif", "font.size": 9}


def floors() -> list[list[str]]:
    """The rooms of each floor, from below."""
    contracts = api.read_configuration(str(FOLDER.parents[1] / "pyproject.toml"))["contracts_options"]
    layers = next(contract["layers"] for contract in contracts if contract["id"] == "ladder")
    return [[name.strip() for name in layer.split("|")] for layer in reversed(layers)]


def room_of(module: str) -> str:
    """The room of a module, "" for what lies in none."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[1] != "__main__" else ""


def counts() -> tuple[Counter[str], Counter[tuple[str, str]]]:
    """How many modules each room has, and how many imports lead from each room to each other."""
    graph = grimp.build_graph(LIBRARY, exclude_type_checking_imports=True, cache_dir=None)
    modules: Counter[str] = Counter()
    arrows: Counter[tuple[str, str]] = Counter()
    for module in graph.modules:
        room = room_of(module)
        modules[room] += 1
        for target in graph.find_modules_directly_imported_by(module):
            arrows[room, room_of(target)] += 1
    return modules, arrows


def draw(ladder: list[list[str]], modules: Counter[str], arrows: Counter[tuple[str, str]]) -> None:
    """Write the picture: a row of boxes for each floor, arcs for the imports from floor to floor."""
    matplotlib.use("Agg")
    matplotlib.rcParams.update(STYLE)

    wide, high, left = 1.65, 0.62, 4.4
    floor_of = {name: number for number, floor in enumerate(ladder) for name in floor}
    figure, axes = plt.subplots(figsize=(9.0, 0.5 * len(ladder) + 0.6))

    for number, floor in enumerate(ladder):
        axes.text(left - 0.18, number, str(number + 1), ha="right", va="center", color="0.45")
        for place, name in enumerate(floor):
            x = left + place * wide
            corner, width = (x, number - 0.5 * high), wide - 0.15
            axes.add_patch(
                FancyBboxPatch(corner, width, high, boxstyle=ROUNDED, facecolor=ROOM_COLOUR, edgecolor="0.55", lw=0.8)
            )
            label = f"{name}/\n{modules[name]} modules"
            axes.text(x + 0.5 * width, number, label, ha="center", va="center", linespacing=1.15)

    between: Counter[tuple[int, int]] = Counter()
    for (room, other), count in arrows.items():
        if room in floor_of and other in floor_of:
            between[floor_of[room], floor_of[other]] += count

    for (upper, lower), count in sorted(between.items()):
        if upper > lower:
            span = upper - lower
            centre = (left - 0.42, 0.5 * (upper + lower))
            width = 0.02 * count**0.5
            axes.add_patch(
                Arc(centre, 0.42 * span, span, theta1=90, theta2=270, color=ARC_COLOUR, lw=0.3 + 4.0 * width, alpha=0.5)
            )

    widest = max(map(len, ladder))
    axes.set_xlim(-0.1, left + widest * wide + 0.1)
    axes.set_ylim(-0.75, len(ladder) - 0.25)
    axes.set_title("Floors of rrtik_ompl; an arc: imports from a floor below", fontsize=9, color="0.35")
    axes.axis("off")
    figure.tight_layout()
    figure.savefig(FOLDER / "ladder.svg", metadata={"Date": None})


def main() -> None:
    """Count and draw."""
    modules, arrows = counts()
    draw(floors(), modules, arrows)
    rooms = {name for floor in floors() for name in floor}
    pairs = [pair for pair in arrows if pair[0] != pair[1] and set(pair) <= rooms]
    print(f"{len(rooms)} rooms, {len(floors())} floors, {len(pairs)} arrows between rooms")


if __name__ == "__main__":
    main()

"""Draws the ladder of rooms in ARCHITECTURE.md, and the imports between them as the sources have them.

    python docs/figures/ladder.py

The floors are the table of ARCHITECTURE.md between its two marks; modules and imports are counted.
Writes ``ladder.svg`` beside this file.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parents[1]
LIBRARY = ROOT / "rrtik_ompl"
sys.path.insert(0, str(ROOT / "bench"))

from house_imports import floors, imports  # noqa: E402

ROOM_COLOUR, MODULE_COLOUR, ARC_COLOUR = "#dceaf5", "#f4f4f0", "#0072b2"
ROUNDED = "round,pad=0,rounding_size=0.08"


def room_of(module: str) -> str:
    """The module or room in the root that a dotted name below rrtik_ompl belongs to."""
    return module.split(".")[0]


def modules() -> Iterator[tuple[str, Path]]:
    """Every file of the library with the module or room that it belongs to; not the library's own ``__init__``."""
    for file in sorted(LIBRARY.rglob("*.py")):
        parts = file.relative_to(LIBRARY).with_suffix("").parts
        if parts[0] not in ("__init__", "__main__"):
            yield parts[0], file


def arrows(ladder: list[list[str]]) -> Counter[tuple[str, str]]:
    """How many files of a room import each other room."""
    known = {name for floor in ladder for name in floor}
    counted: Counter[tuple[str, str]] = Counter()
    for room, file in modules():
        if room not in known:
            continue
        inside = {name.removeprefix("rrtik_ompl.") for name in imports(file) if name.startswith("rrtik_ompl.")}
        counted.update((room, other) for other in {room_of(name) for name in inside} & known - {room})
    return counted


def draw(ladder: list[list[str]], files: Counter[str], counted: Counter[tuple[str, str]]) -> None:
    """Write the picture: a row of boxes for each floor, arcs for the imports from floor to floor."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams.update(
        {"svg.hashsalt": "rrtik", "svg.fonttype": "none", "font.family": "sans-serif", "font.size": 9}
    )
    from matplotlib import pyplot as plt
    from matplotlib.patches import Arc, FancyBboxPatch

    wide, high, left = 1.65, 0.62, 2.6
    floor_of = {name: number for number, floor in enumerate(ladder) for name in floor}
    figure, axes = plt.subplots(figsize=(11.0, 0.62 * len(ladder) + 0.6))
    for number, floor in enumerate(ladder):
        axes.text(left - 0.18, number, str(number + 1), ha="right", va="center", color="0.45")
        for place, name in enumerate(floor):
            x = left + place * wide
            colour = ROOM_COLOUR if files[name] > 1 else MODULE_COLOUR
            box = (x, number - 0.5 * high), wide - 0.15, high
            axes.add_patch(FancyBboxPatch(*box, boxstyle=ROUNDED, facecolor=colour, edgecolor="0.55", lw=0.8))
            label = f"{name}/\n{files[name]} files" if files[name] > 1 else name
            axes.text(x + 0.5 * (wide - 0.15), number, label, ha="center", va="center", linespacing=1.15)
    between: Counter[tuple[int, int]] = Counter()
    for (room, other), count in counted.items():
        between[floor_of[room], floor_of[other]] += count
    for (upper, lower), count in sorted(between.items()):
        if upper > lower:
            span = upper - lower
            place, size = (left - 0.42, 0.5 * (upper + lower)), (0.34 * span, float(span))
            style = {"color": ARC_COLOUR, "lw": 0.3 + 0.035 * count, "alpha": 0.55}
            axes.add_patch(Arc(place, *size, theta1=90, theta2=270, **style))
    widest = max(map(len, ladder))
    axes.set_xlim(-0.1, left + widest * wide + 0.1)
    axes.set_ylim(-0.75, len(ladder) - 0.25)
    axes.set_title("Floors of rrtik_ompl; an arc: files that import from a floor below", fontsize=9, color="0.35")
    axes.axis("off")
    figure.tight_layout()
    figure.savefig(FOLDER / "ladder.svg", metadata={"Date": None})


def main() -> None:
    """Count and draw."""
    ladder = floors()
    files = Counter(room for room, _ in modules())
    draw(ladder, files, arrows(ladder))


if __name__ == "__main__":
    main()

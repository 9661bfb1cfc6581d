"""Picture of TITAN-4's effective operating space: side and top slice on a 25 mm grid.

    python bench/titan4_workspace.py [--out bench/reports/titan4_workspace.png]

Light: in reach with the gripper straight ahead in the arm plane at some pitch. Dark: that, and seen by a camera, clear
of the vehicle's box, and 5 degrees away from every joint limit. Limits: the envelope set.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np

from rrtik_ompl import load_robot
from rrtik_robots.titan4.workspace import Camera, EffectiveWorkspace

GRID = 0.025  # m
X, Y, Z = np.arange(-1.4, 2.2, GRID), np.arange(-2.1, 2.2, GRID), np.arange(-1.7, 2.0, GRID)
ALL_SEEING = Camera(np.array([-50.0, 0.0, 0.0]), np.zeros(3), diagonal_deg=170.0, farthest=1e3)
FAR_AWAY = np.array([[98.0, 98.0, 98.0], [99.0, 99.0, 99.0]])


def draw(out: Path) -> None:
    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.patches import Rectangle

    space = EffectiveWorkspace(load_robot("titan4", limits="envelope"))
    reach = replace(space, cameras=[ALL_SEEING], vehicle=FAR_AWAY, margin=0.0)
    figure, (side, top) = pyplot.subplots(1, 2, figsize=(13, 6), layout="constrained")
    low, high = space.vehicle
    views = (
        (side, reach.side_view(X, Z), space.side_view(X, Z), Z, 2),
        (top, reach.top_view(X, Y), space.top_view(X, Y), Y, 1),
    )
    for axes, reachable, effective, other, k in views:
        extent = (X[0] - GRID / 2, X[-1] + GRID / 2, other[0] - GRID / 2, other[-1] + GRID / 2)
        shade = np.where(effective, 0.75, np.where(reachable, 0.25, 0.0))
        axes.imshow(shade, origin="lower", extent=extent, cmap="Blues", vmin=0.0, vmax=1.0)
        axes.add_patch(
            Rectangle((low[0], low[k]), high[0] - low[0], high[k] - low[k], fill=False, hatch="//", ec="0.4")
        )
        for camera in space.cameras:
            axes.plot(camera.position[0], camera.position[k], "^", color="tab:orange", ms=9)
        axes.plot(0.0, 0.0, "ko", ms=5)
        axes.set(xlabel="x [m]", ylabel=("y [m]", "z [m]")[k - 1], xlim=extent[:2], ylim=extent[2:])
        share = effective.sum() * GRID**2
        axes.set_title(f"{('top, height of the shoulder', 'side, straight ahead')[k - 1]}: {share:.2f} m2 effective")
    figure.savefig(out, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "reports" / "titan4_workspace.png")
    draw(parser.parse_args().out)


if __name__ == "__main__":
    main()

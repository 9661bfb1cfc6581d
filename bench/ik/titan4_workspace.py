"""Picture of TITAN-4's effective operating space: side and top slice on a 25 mm grid.

    python bench/ik/titan4_workspace.py [--out bench/reports/titan4_workspace.png]

Light: in reach with the gripper straight ahead in the arm plane at some pitch. Dark: that, and seen by a camera, clear
of the vehicle's box, and 5 degrees away from every joint limit. Limits: the envelope set. ``rrtik reach titan4
--effective --plot FILE`` draws the same.
"""

from __future__ import annotations

import argparse

from bench.shared.pages import add_out
from rrtik_ompl.viewer.plots.reach import plot_slices
from rrtik_robots.titan4.workspace import effective_slices


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_out(parser, "titan4_workspace.png")
    plot_slices(effective_slices(), parser.parse_args().out, title="titan4: effective workspace", colors="Blues")


if __name__ == "__main__":
    main()

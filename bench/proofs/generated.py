"""Plans on many generated scenes, many planted obstacles, and what near pairs of links cost; see report.py.

Usage: ``python -m bench.proofs.generated [--scenes 32] [--planted 15] [--mbm FOLDER] [--every 25] [--out FILE]``

FOLDER holds mbm_ur5 (MotionBenchMaker problems with their URDF); without it the near pairs are left out. An interrupted
run goes on where it was.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.proofs.near_pairs import Shares, near_pairs
from bench.proofs.report import ARMS, plans, thin
from bench.shared.parts import Parts, add_options
from rrtik_bench.report.machine import processes, processor
from rrtik_bench.report.page import Report

NEAR = (
    "Pairs of links of MotionBenchMaker's UR5 with force sensor and gripper that one or two joints move, as far as its "
    "SRDF and the scene do not allow them to touch. A pair that is proven apart in all of 20,000 random configurations "
    "could be proven once per robot and left out afterwards."
)


def near(report: Report, folder: Path, every: int) -> None:
    """What pairs of links cost that few joints move."""
    files = sorted(str(file) for file in (folder / "mbm_ur5" / "problems").rglob("scene*.yaml"))[::every]
    found: Shares = near_pairs(files, str(folder / "mbm_ur5" / "ur5.urdf"))
    rows = [[" and ".join(pair.names), ", ".join(pair.joints), f"{100 * pair.apart:.2f} %"] for pair in found.pairs]
    report.table("Near pairs of links", ["pair", "joints", "configurations proven apart"], rows, text=NEAR)
    report.note(
        "What leaving them out would gain",
        f"Proofs of {len(files)} paths take {found.milliseconds:.2f} ms of processor time. Without the pairs that are "
        f"always apart it is {100 * found.without_never:.1f} % of that, without all pairs of the table "
        f"{100 * found.without_few:.1f} %. The first is what proofs kept per robot would give.",
    )


def main() -> None:
    """Run everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=32, help="of each arm and family")
    parser.add_argument("--planted", type=int, default=15, help="rounds of planted obstacles of each arm")
    parser.add_argument("--mbm", type=Path, help="folder with mbm_ur5")
    parser.add_argument("--every", type=int, default=25, help="every so many-th of its problems")
    add_options(parser, "proofs_generated.md")
    options = parser.parse_args()
    where = f"{processes(options.jobs)}, {processor()}"
    report = Report("Proofs on many generated scenes", "python -m bench.proofs.generated", where)
    with Parts(options.out, options.jobs) as measure:
        plans(report, measure, options.scenes, list(ARMS))
        thin(report, measure, options.planted, list(ARMS))
        if options.mbm is not None:
            near(report, options.mbm, options.every)
        report.finish(options.out)


if __name__ == "__main__":
    main()

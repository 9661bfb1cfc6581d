"""All tables and figures with numbers, and what is not among them."""

from __future__ import annotations

from dataclasses import replace

from rrtik_bench import (
    drrt_con,
    drrt_con_scenes,
    ikurt,
    ikurt_limits,
    in_time,
    reshaping,
    titan4,
    titan4_screws,
    titan4_tracking,
)
from rrtik_bench.crdt import passages
from rrtik_bench.crdt import tables as crdt
from rrtik_bench.errata import tables as errata
from rrtik_bench.figures import crdt as crdt_figures
from rrtik_bench.figures import genetic as genetic_figures
from rrtik_bench.figures import ikurt as ikurt_figures
from rrtik_bench.figures import mb_rrt as mb_rrt_figures
from rrtik_bench.figures import replanning as replanning_figures
from rrtik_bench.figures import reshaping as reshaping_figures
from rrtik_bench.figures import sensing as sensing_figures
from rrtik_bench.figures import titan4 as titan4_figures
from rrtik_bench.genetic import coding
from rrtik_bench.genetic import tables as genetic
from rrtik_bench.mb_rrt import beyond as mb_rrt_beyond
from rrtik_bench.mb_rrt import tables as mb_rrt
from rrtik_bench.sensing import camera_tables, detections, sequences
from rrtik_bench.sensing import tables as sensing
from rrtik_bench.shortening import tables as shortening
from rrtik_bench.tables import Collection

PAGES = (
    *(
        titan4,
        titan4_screws,
        titan4_tracking,
        mb_rrt,
        mb_rrt_beyond,
        genetic,
        coding,
        crdt,
        passages,
        ikurt,
        ikurt_limits,
    ),
    *(drrt_con, drrt_con_scenes, reshaping, in_time, shortening),
    *(sensing, camera_tables, sequences, detections, errata),
)
DRAWN = (
    *(titan4_figures, mb_rrt_figures, genetic_figures, crdt_figures, ikurt_figures),
    *(replanning_figures, reshaping_figures, sensing_figures),
)
FIGURES = {name: figures for page in DRAWN for name, figures in page.FIGURES.items()}
COLLECTION = Collection(
    tables=tuple(replace(table, figures=FIGURES.get(table.name, ())) for page in PAGES for table in page.TABLES),
    also={"genetic": "ga-reb", "mbrrt": "mb-rrt", "replanning": "drrt-con", "markers": "sensing"},
    not_here=(
        "[3]: goal-biased trees and Bertram's planner; [1, ch. 5.2]: ERRT, MP-RRT; named without a definition",
        "DRRT [8], beside DRRT-Con: the planner drrt of rrtik replan",
        "[1, ch. 4]: the figures of the orientation tests, which are lost",
    ),
)

"""All tables and figures with numbers, and what is not among them."""

from __future__ import annotations

from rrtik_bench import drrt_con, ikurt, titan4
from rrtik_bench.crdt import tables as crdt
from rrtik_bench.errata import tables as errata
from rrtik_bench.genetic import tables as genetic
from rrtik_bench.mb_rrt import tables as mb_rrt
from rrtik_bench.sensing import camera_tables
from rrtik_bench.sensing import tables as sensing
from rrtik_bench.shortening import tables as shortening
from rrtik_bench.tables import Collection

PAGES = (titan4, mb_rrt, genetic, crdt, ikurt, drrt_con, shortening, sensing, camera_tables, errata)
COLLECTION = Collection(
    tables=tuple(table for page in PAGES for table in page.TABLES),
    also={"genetic": "ga-reb", "mbrrt": "mb-rrt", "replanning": "drrt-con", "markers": "sensing"},
    not_here=("[1, ch. 4]: the sequences with 125, 400 and 500 mm, of which only a plot was published",),
)

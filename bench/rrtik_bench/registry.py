"""All tables and figures with numbers, by name, and what is not among them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from rrtik_bench import drrt_con, ikurt, titan4
from rrtik_bench.crdt import tables as crdt
from rrtik_bench.genetic import tables as genetic
from rrtik_bench.mb_rrt import tables as mb_rrt
from rrtik_bench.report.rows import Table
from rrtik_bench.sensing import camera_tables
from rrtik_bench.sensing import tables as sensing
from rrtik_bench.shortening import tables as shortening
from rrtik_ompl.errors import UnknownNameError

PAGES = (titan4, mb_rrt, genetic, crdt, ikurt, drrt_con, shortening, sensing, camera_tables)
TABLES: Mapping[str, Table] = MappingProxyType({table.name: table for page in PAGES for table in page.TABLES})
NOT_HERE = ("Marker sensing, section 6: the sequences with 125, 400 and 500 mm, of which only a plot was published",)


def chosen(names: Iterable[str]) -> list[Table]:
    """The tables of these names, in the order of the registry; ``mb-rrt`` stands for all whose name begins so.

    Raises:
        UnknownNameError: If a name fits none.
    """
    wanted: set[str] = set()
    for name in names:
        fits = [known for known in TABLES if known == name or known.startswith(f"{name}-")]
        if not fits:
            raise UnknownNameError("table", name, TABLES)
        wanted.update(fits)
    return [table for name, table in TABLES.items() if name in wanted]

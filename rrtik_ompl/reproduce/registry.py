"""All tables and figures with numbers, by name, and what is not among them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from rrtik_ompl.errors import UnknownNameError
from rrtik_ompl.reproduce import (
    crdt,
    drrt_con,
    ga_reb,
    ikurt,
    mb_rrt,
    postprocessing,
    sensing,
    sensing_camera,
    titan4,
)
from rrtik_ompl.reproduce.rows import Table

PAGES = (titan4, mb_rrt, ga_reb, crdt, ikurt, drrt_con, postprocessing, sensing, sensing_camera)
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

"""Everything that is made of a campaign's records: logs, database, tables, pictures, the page."""

from __future__ import annotations

from pathlib import Path

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark import ompl_log, page, plots, records, tables
from rrtik_ompl.benchmark.statistics import Result, results
from rrtik_ompl.files.text import write_text

VIEWS = 12


def write_report(file: Path, *, views: int = VIEWS) -> tuple[list[Result], list[Path]]:
    """Write all reports beside a file of records.

    Args:
        file: The records.
        views: 3-D views at most; drawing one takes a second or so.

    Returns:
        The results, and what was written for a person: page, tables, database.

    Raises:
        InputError: If the records cannot be read, or there are none, or a file cannot be written.
    """
    folder = file.parent
    head, found = read_campaign(file)

    total = sum(result.total for result in found)
    ompl_log.write_database(ompl_log.write_logs(found, head, folder / "logs"), folder / ompl_log.DATABASE, total)

    write_text(folder / "summary.md", tables.markdown(found, head))
    write_text(folder / "summary.csv", tables.csv_text(found))

    pictures = plots.draw_all(found, folder)
    chosen = page.shortest_runs(records.read_records(file), views)
    shown = page.draw_views(chosen, head, folder / "views")
    write_text(folder / "index.html", page.html(found, head, pictures, shown))

    return found, [folder / name for name in ("index.html", "summary.md", "summary.csv", ompl_log.DATABASE)]


def read_campaign(file: Path) -> tuple[records.Record, list[Result]]:
    """The head of a file of records, and what was measured, in the order in which the suite names it.

    Raises:
        InputError: If the records cannot be read, or there are none.
    """
    head = records.read_head(file)
    found = results(records.read_records(file))
    if not found:
        raise InputError(f"{file}: holds no runs yet")
    return head, _in_order(file, found, head)


def _in_order(file: Path, found: list[Result], head: records.Record) -> list[Result]:
    """As the suite names them: records come in the order in which runs were finished."""
    suite = head["suite"]
    labels = list(dict.fromkeys(s["name"] if s["axis"] else s["group"] for s in suite["sources"]))
    planners = [entrant["label"] for entrant in suite["entrants"]]
    names = {source["name"] for source in suite["sources"]}

    for result in found:
        strange = next((run["problem"] for run in result.runs if run["problem"] not in names), None)
        if strange is not None or result.label not in labels or result.planner not in planners:
            which = f"'{result.planner}' on '{strange or result.label}'"
            raise InputError(f"{file}: holds runs of {which}, of which its first line says nothing; delete their lines")

    return sorted(found, key=lambda result: (labels.index(result.label), planners.index(result.planner)))

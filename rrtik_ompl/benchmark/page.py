"""One page about a campaign that needs no other file: tables, pictures, links to 3-D views beside it."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.benchmark.run import SOLVED
from rrtik_ompl.benchmark.sources import build, from_plain
from rrtik_ompl.benchmark.statistics import Result
from rrtik_ompl.benchmark.tables import OVERVIEW, conditions, failures, overview, remark
from rrtik_ompl.files.text import make_folder
from rrtik_ompl.model.path import JointPath

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1d2733; max-width: 82rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums }
th, td { padding: .25rem .7rem; text-align: left; border-bottom: 1px solid #e3e9ef }
th { position: sticky; top: 0; background: #fff } .wide { overflow-x: auto } img { max-width: 100% }
"""
TITLES = {
    "solved": "Solved over time",
    "box_total_seconds": "Total time",
    "box_length": "Final length",
    "box_transitions": "Final transitions",
    "scaling": "Scaling",
}


def shortest_runs(records: Iterable[Mapping[str, Any]], most: int) -> list[dict[str, Any]]:
    """Of each group the valid run with the shortest path, of the first ``most`` groups."""
    best: dict[str, dict[str, Any]] = {}
    for record in records:
        if record["status"] != SOLVED or (record["group"] not in best and len(best) >= most):
            continue
        rival = best.get(record["group"])
        if rival is None or (record["length"], record["run"]) < (rival["length"], rival["run"]):
            best[record["group"]] = dict(record)

    return list(best.values())


def draw_views(chosen: Iterable[Mapping[str, Any]], head: Mapping[str, Any], folder: Path) -> dict[str, Path]:
    """A 3-D page for each run, by what the link to it says; a problem that cannot be drawn here is left out.

    Raises:
        InputError: If a file cannot be written.
    """
    from rrtik_ompl.viewer import view

    sources = {source["name"]: source for source in head["suite"]["sources"]}
    found = {}

    for record in chosen:
        try:
            problem = build(from_plain(sources[record["problem"]]))
        except RrtikError:
            continue

        make_folder(folder)
        file = folder / f"{record['problem'].replace('/', '_')}.html"
        view(problem, JointPath.of(problem.world.robot, record["waypoints"]), html=file)
        found[f"{record['problem']} by {record['planner']}, run {record['run']}, length {record['length']:.2f}"] = file

    return found


def html(
    results: Sequence[Result], head: Mapping[str, Any], pictures: Iterable[Path], views: Mapping[str, Path]
) -> str:
    """The page.

    Args:
        results: Of the campaign.
        head: Of its records.
        pictures: Files of pictures; SVG are put into the page.
        views: 3-D pages in a folder beside the page, by what their links say.
    """
    title = escape(head["suite"]["title"])
    said = escape(conditions(results, head)).replace("`", "")
    table = _table(OVERVIEW, overview(results))
    parts = [f"<h1>{title}</h1>", f"<p>{said}</p>", table, f"<p>{escape(remark(results, head))}</p>"]

    broken = failures(results)
    if broken:
        parts += ["<h2>Runs that broke</h2>", _table(("problem", "planner", "runs", "why"), broken)]

    if views:
        links = ((escape(f"{file.parent.name}/{file.name}"), escape(text)) for text, file in views.items())
        items = "".join(f'<li><a href="{link}">{text}</a></li>' for link, text in links)
        parts += ["<h2>3-D views of the shortest paths</h2>", f"<ul>{items}</ul>"]

    for file in pictures:
        if file.suffix == ".svg":
            name = escape(TITLES.get(file.stem, file.stem))
            data = base64.b64encode(file.read_bytes()).decode()
            parts += [f"<h2>{name}</h2>", f'<img alt="{name}" src="data:image/svg+xml;base64,{data}">']

    head_part = f'<meta charset="utf-8"><title>{title}</title><style>{STYLE}</style>'
    body = "\n".join(parts)
    return f'<!doctype html>\n<html lang="en"><head>{head_part}</head><body>\n{body}\n</body></html>\n'


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    first = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = ("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><tr>{first}</tr>{"".join(body)}</table></div>'

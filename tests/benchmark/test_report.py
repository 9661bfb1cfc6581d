"""Tables, pages and the README's results say what the records say."""

import csv
import re
import sqlite3
from contextlib import closing

import numpy as np
import pytest

from rrtik_ompl.benchmark.records import NAME, RecordFile, key_of, read_head, read_records
from rrtik_ompl.benchmark.report import write_report
from rrtik_ompl.benchmark.statistics import QUANTITIES, results, spread
from rrtik_ompl.benchmark.tables import remark
from rrtik_tests.campaigns import TOTAL

pytestmark = pytest.mark.slow


def test_records_of_an_earlier_version_are_still_reported(campaign, tmp_path):
    later = ("edges", "free_motions")
    with RecordFile(tmp_path / NAME, read_head(campaign / NAME)) as out:
        for record in read_records(campaign / NAME):
            out.append({**record, "counts": {k: v for k, v in record["counts"].items() if k not in later}})
    _, files = write_report(tmp_path / NAME, views=0)
    assert all(file.stat().st_size for file in files)
    with closing(sqlite3.connect(tmp_path / "benchmark.db")) as base:
        told = base.execute("SELECT COUNT(graph_motions), COUNT(valid_segment_fraction), COUNT(*) FROM runs").fetchone()
    assert told == (0, 0, TOTAL)


def test_tables_say_what_the_records_say(campaign):
    lengths = [r["length"] for r in read_records(campaign / NAME) if key_of(r)[:2] == ("planar3_a", "bicrdt")]
    with (campaign / "summary.csv").open() as file:
        rows = {(row["problem"], row["planner"], row["quantity"]): row for row in csv.DictReader(file)}
    row = rows["planar3_a", "bicrdt", "length"]
    assert (row["solved"], row["valid"], row["total"]) == ("3", "3", "3")
    assert float(row["median"]) == np.median(lengths)
    page = (campaign / "summary.md").read_text()
    assert "seed 7" in page
    assert "| planar3_a | bicrdt | 3 / 3 / 3 |" in page
    assert {f"## {name}" for name, _ in QUANTITIES.values() if name != "vertices"} <= {
        line.split(" [")[0] for line in page.splitlines()
    }


def test_the_page_needs_no_other_file_but_the_views_that_it_links_to(campaign):
    page = (campaign / "index.html").read_text()
    assert set(re.findall(r'src="([^:]+):', page)) == {"data"}
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) == 1
    assert (campaign / links[0]).stat().st_size > 10_000
    for name in ("solved", "scaling", "box_length"):
        assert (campaign / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert "<svg" in (campaign / f"{name}.svg").read_text()


def test_the_results_of_the_readme_are_written_from_campaigns(campaign, tmp_path):
    from bench.planning import results_page

    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{results_page.BEGIN}\nold\n{results_page.END}\nafter\n")
    for _ in range(2):  # a second time it takes the place of the first
        results_page.main([campaign], readme)
    text = readme.read_text()
    assert text.startswith("before\n<!--")
    assert text.endswith("-->\nafter\n")
    assert "old" not in text
    assert text.count("| bicrdt | 3 / 3 / 3 |") == 1
    assert text.count("Written by `rrtik bench two --runs 3 --jobs 2`") == 1
    assert re.search(r"^\| planar/joints \| 4 \|$", text, re.M)


def test_paths_that_came_after_the_time_limit_are_counted(campaign):
    done, head = results(read_records(campaign / NAME)), read_head(campaign / NAME)
    assert "after the limit" not in remark(done, head)
    slowest = max(value for result in done for value in result.values("plan_seconds"))
    head["suite"]["seconds"] = 0.999 * slowest
    assert "1 path(s) came after the limit" in remark(done, head)


def test_a_spread_is_numpys():
    values = [3.0, 1.0, 2.0, 10.0]
    done = spread(values)
    assert (done.mean, done.median, done.least, done.most) == (4.0, 2.5, 1.0, 10.0)
    assert done.p95 == np.quantile(values, 0.95)
    assert spread([]) is None

"""Every number of the paper's results is in the data of its section, or said to be none of ours."""

import re

import pytest
import yaml

from rrtik_bench.errata.tables import statistics
from rrtik_tests.paper_numbers import numbers, told, without_data
from rrtik_tests.places import ROOT

PAPER = ROOT / "docs" / "science" / "paper.md"
SOURCES = ROOT / "docs" / "science" / "paper.yaml"
WITHOUT_RESULTS = ("Three works", "Abstract", "1. Method", "5. New results", "7. How to repeat it")


def computed():
    """Numbers of errata that need no run, quotients of arrivals, and the sum of all verdicts."""
    errata = [f"{row.published} {row.measured} {row.reading}" for row in statistics(True)]
    stored = (ROOT / "bench" / "reports" / "reproduce_full.md").read_text(encoding="utf-8")
    arrivals = re.findall(r"time of arrival .*\| ([\d.]+) s beside ([\d.]+) s \|", stored)
    quotients = [f"{float(ours) / float(theirs):.2f}" for ours, theirs in arrivals]
    total = sum(int(number) for number in re.findall(r"\d+", re.search(r"In all: (.*)\.\n", stored)[1]))
    return " ".join([*errata, *quotients, str(total)])


def missing(page):
    return without_data(page, SOURCES, ROOT, computed())


def test_every_number_of_the_paper_has_its_data():
    rest = missing(PAPER.read_text(encoding="utf-8"))
    assert not rest, "\n".join(
        f"paper.md, line {each.line}: {each.text} is in no report of '{each.heading}'" for each in rest
    )


def test_every_section_with_results_is_tied_to_reports():
    text = PAPER.read_text(encoding="utf-8")
    headings = {line.lstrip("# ") for line in text.splitlines() if line.startswith("#")}
    tied = set(yaml.safe_load(SOURCES.read_text(encoding="utf-8")))
    assert tied <= headings
    assert all(heading.startswith(WITHOUT_RESULTS) for heading in headings - tied)
    assert len(list(told(text))) > 250


def test_nothing_is_given_that_the_data_have_or_the_paper_does_not():
    text = PAPER.read_text(encoding="utf-8")
    for heading, section in yaml.safe_load(SOURCES.read_text(encoding="utf-8")).items():
        there = {each.text for each in told(text) if each.heading == heading}
        assert set(section.get("given", [])) <= there, heading


def test_a_digit_that_is_wrong_is_found_with_its_line():
    lines = PAPER.read_text(encoding="utf-8").splitlines()
    tied = yaml.safe_load(SOURCES.read_text(encoding="utf-8"))
    tried = seen = 0
    for number in list(told("\n".join(lines)))[::4]:
        line, digits = lines[number.line - 1], number.text.replace(",", "").replace(".", "")
        if number.heading not in tied or len(digits) < 3 or "e" in digits or line.count(number.text) != 1:
            continue
        wrong = f"{number.text[:-1]}{(int(number.text[-1]) + 3) % 10}"
        changed = [*lines[: number.line - 1], line.replace(number.text, wrong), *lines[number.line :]]
        found = missing("\n".join(changed))
        assert {each.line for each in found} <= {number.line}
        tried, seen = tried + 1, seen + bool(found)
    assert tried > 10
    assert seen > 0.6 * tried  # the others stand elsewhere in the same reports


@pytest.mark.parametrize(
    ("text", "there"),
    [
        ("as in [1, ch. 6.3] and table 6.2, 0.385 of 1,000 runs [12]", ["0.385", "1,000"]),
        ("`in-time` takes 3 s; see [x](../a_12.md), theta5 = 90", ["3", "90"]),
        ("to 2e-15, by 12 %, 1/8.3 (section 3).", ["2e-15", "12", "1", "8.3"]),
        ("### 5.3 Contacts", []),
    ],
)
def test_names_addresses_citations_and_places_are_no_numbers(text, there):
    assert numbers(text) == there

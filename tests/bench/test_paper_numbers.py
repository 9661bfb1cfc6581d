"""Every number of the paper's results is in the data of its section, or said to be none of ours."""

import pytest
import yaml

from rrtik_bench.errata.tables import statistics
from rrtik_tests.paper_numbers import numbers, told, without_data
from rrtik_tests.places import ROOT

PAPER = ROOT / "docs" / "science" / "paper.md"
SOURCES = ROOT / "docs" / "science" / "paper.yaml"
WITHOUT_RESULTS = ("Three works", "Abstract", "1. Method", "5. New results", "7. How to repeat it")


def computed():
    """Numbers of errata that need no run."""
    return " ".join(f"{row.published} {row.measured} {row.reading}" for row in statistics(True))


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


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("none of 278 proven plans", "none of 178 proven plans"),
        ("874 arrive, and 39 touch", "874 arrive, and 38 touch"),
        ("757 falsified", "758 falsified"),
        ("| 117 | 113 | 20.2 |", "| 117 | 113 | 12.8 |"),
        ("in the mean; 6 at best", "in the mean; 6.13 at best"),
        ("t = 30.7, 2.6", "t = 39.9, 2.6"),
        ("86,148 ticks", "86,149 ticks"),
        ("200 planar cases", "201 planar cases"),
    ],
)
def test_a_number_that_the_data_do_not_have_is_found_with_its_line(right, wrong):
    lines = PAPER.read_text(encoding="utf-8").splitlines()
    ((k, line),) = [(k, line) for k, line in enumerate(lines) if right in line] or [(0, "")]
    assert line, right
    lines[k] = line.replace(right, wrong)
    found = missing("\n".join(lines))
    assert {each.line for each in found} == {k + 1}


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

"""The four numbers of the README are those of the reports that it names."""

import re

import pytest

from rrtik_tests.places import ROOT

SEARCH = r"plan\(\) finds a verified path within 1 s; median of the search \|[^|]*\|.*?; ([\d.]+) ms"
NUMBERS = {
    "a search": (r"^\| ([\d.]+) ms \| search for a path of a Panda", "speed.md", SEARCH),
    "beside roboplan": (
        r"^\| ([\d.]+) times \| faster than roboplan",
        "speed.md",
        r"against roboplan.*?\| ([\d.]+) x,",
    ),
    "proven paths": (r"^\| (\d+) of 350 \| of those paths proven", "proofs.md", r"^\| panda \| (\d+) of 350 \|"),
    "a proof": (r"median ([\d.]+) ms each", "proofs.md", r"^\| panda \| 350 of 350 \| ([\d.]+) /"),
    "a check in steps": (r"checked in steps: ([\d.]+) ms", "proofs.md", r"^\| panda \|(?:[^|]*\|){3} ([\d.]+) /"),
    "a pose": (
        r"^\| ([\d.]+) us \| a pose of the Panda in a batch",
        "ik_comparison.md",
        r"panda.*?\| ([\d.]+) us a pose",
    ),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_of_the_readme_is_that_of_its_report(name: str) -> None:
    said, report, measured = NUMBERS[name]
    shown = re.search(said, (ROOT / "README.md").read_text(), re.MULTILINE)
    found = re.search(measured, (ROOT / "bench" / "reports" / report).read_text(), re.MULTILINE)
    assert shown is not None
    assert found is not None
    digits = len(shown[1].partition(".")[2])
    assert abs(float(shown[1]) - float(found[1])) <= 0.5 * 10.0**-digits + 1e-9

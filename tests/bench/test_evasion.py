"""What the paper says of runs among obstacles as fast as the robot is what the page says."""

import re

from rrtik_tests.places import ROOT


def test_the_paper_has_the_numbers_of_the_page():
    page = (ROOT / "bench/reports/evasion.md").read_text(encoding="utf-8")
    paper = " ".join((ROOT / "docs/science/paper.md").read_text(encoding="utf-8").split())

    unproven, runs = re.search(r"did not begin with its proof \| 0 of 3,000 \| (\d+) of (\d+)", page).groups()
    touched, safe = re.search(r"called safe \| 0 \| (\d+) of (\d+)", page).groups()
    cells = re.search(rf"^\| {runs} \| (\d+) \| \d+ \| (\d+) \| (\d+) \| (\d+) \|", page, re.MULTILINE).groups()
    arrived, contact, lost, undecided = cells
    assert (
        f"in {int(runs):,} runs among six triangles as fast as the robot {int(arrived):,} arrive, and {contact} touch "
        f"something, {unproven} of them in a tick that did not begin with the proof; {lost} runs have such a proof, in "
        f"{undecided} a tick is left undecided; {touched} of {int(safe):,} ticks that are called safe have contact"
    ) in paper

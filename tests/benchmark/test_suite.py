"""Suite files: the shipped ones, how they are found, and one line for every mistake."""

import re
from importlib.metadata import EntryPoint

import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark.suite import load_suite
from rrtik_ompl.cli.app import run
from rrtik_ompl.description import catalog
from rrtik_planners.suites import FOLDER
from rrtik_tests.campaigns import SUITE


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("planners: [bicrdt,", "planners: [bicrtd,", r":4: planners\[0\]: no planner 'bicrtd'; .*bicrdt"),
        ("planners: [bicrdt,", "planners: [EST,", r"OMPL's wheel lacks EST\s*$"),
        ("range: 0.3", "rnage: 0.3", r":4: planners\[2\].parameters.rnage: no parameter .*'rnage'; .*range"),
        ("runs: 3", "rums: 3", r":5: rums: unknown key 'rums'; did you mean 'runs'"),
        ("runs: 3", "runs: 0", r":5: runs: must be 1 or more"),
        ("seconds: 5.0", "seconds: soon", r":6: seconds: must be a number"),
        ("planar3_a", "planar3_z", r":3: problems\[0\]: no problem 'planar3_z'"),
        ("planar3_a", "scenes/x.yaml", r":3: problems\[0\]: no such problem file"),
        ("{joints:", "{joint:", r":3: problems\[1\]: a problem needs one of the keys generated"),
        ("{joints: {counts: [4]}}", "{generated: {robot: ur5, family: cave}}", r"no family .*'cave'; have clutter"),
        ("{joints: {counts: [4]}}", "planar3_a", r"'planar3_a' stands there 2 times"),
        (", label: short steps", "", r"'RRTConnect' stands there 2 times"),
        ("shorten: sequential", "shorten: axle", r":8: shorten: no shortening method 'axle'"),
        ("problems: [planar3_a, {joints: {counts: [4]}}]", "problems: []", r"give a folder of them with --problems"),
    ],
)  # fmt: skip
def test_a_typo_in_a_suite_is_one_line_that_names_its_place(tmp_path, capsys, old, new, words):
    file = tmp_path / "s.yaml"
    assert old in SUITE
    file.write_text(SUITE.replace(old, new))
    assert run(["bench", str(file), "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert re.search(words, message), message
    assert message.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_parameter_of_the_wrong_kind_is_told_and_the_other_planners_run(tmp_path, capsys):
    file = tmp_path / "s.yaml"
    file.write_text(SUITE.replace("range: 0.3", "range: soon").replace("runs: 3", "runs: 1"))
    assert run(["bench", str(file), "--out", str(tmp_path / "out"), "--views", "0"]) == 1
    said = capsys.readouterr().out
    assert "planar3_a, short steps: 1 x error: planner RRTConnect: parameter range cannot be 'soon'" in said
    assert "this round: 4 solved, 2 error" in said


@pytest.mark.parametrize("name", sorted(file.stem for file in FOLDER.glob("*.yaml")))
def test_shipped_suites_name_what_there_is(name):
    file = FOLDER / f"{name}.yaml"
    if name == "mbm_panda":
        with pytest.raises(InputError, match="--problems FOLDER"):
            load_suite(file)
        return
    campaign = load_suite(file)
    assert f"# {campaign.total:,} runs" in file.read_text()  # its head says what a person lets himself in for


def test_suites_are_found_by_name_and_unknown_ones_listed(monkeypatch, capsys):
    offers = {"suites": {"ours": EntryPoint("ours", "rrtik_planners.suites:FOLDER", "rrtik_ompl.suites")}}
    usual = catalog.offers_of
    monkeypatch.setattr(catalog, "offers_of", lambda group: offers.get(group) or usual(group))
    assert run(["list", "suites"]) == 0
    assert "scaling\n" in capsys.readouterr().out
    assert load_suite("quick").name == "quick"
    assert run(["bench", "quik"]) == 2
    assert "did you mean 'quick'" in capsys.readouterr().err

"""A corrupt or foreign record is named, and nothing is lost."""

import json

import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark.records import NAME, read_head
from rrtik_ompl.benchmark.report import write_report
from rrtik_ompl.cli.app import run

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("{half", "not a record of a run"),
        ("[1]", "found list"),
        ('{"problem": "p"}', "group is missing"),
        ("\udcff", "codec can't decode"),
        ({"axis": None}, "axis cannot be None"),
        ({"status": "great"}, "status 'great' is none of"),
        ({"plan_seconds": "soon"}, "plan_seconds cannot be 'soon'"),
        ({"counts": {"iterations": []}}, "count iterations cannot be []"),
        ({"waypoints": 3}, "waypoints cannot be 3"),
    ],
)
def test_a_corrupt_record_is_named_by_its_line_and_nothing_is_lost(campaign, suite, tmp_path, capsys, line, words):
    lines = (campaign / NAME).read_text().splitlines()
    lines[4] = line if isinstance(line, str) else json.dumps({**json.loads(lines[4]), **line})
    text = "\n".join([*lines, ""])
    (tmp_path / NAME).write_text(text, errors="surrogateescape")
    assert run(["bench", str(suite), "--out", str(tmp_path), "--resume"]) == 2
    message = capsys.readouterr().err
    assert f"{NAME}:5: " in message
    assert words in message
    assert message.count("\n") == 1
    assert (tmp_path / NAME).read_text(errors="surrogateescape") == text


def test_a_solved_run_without_its_path_and_a_head_without_its_machine_are_told(campaign, tmp_path):
    head, *lines = (campaign / NAME).read_text().splitlines()
    lines[0] = json.dumps({key: value for key, value in json.loads(lines[0]).items() if key != "waypoints"})
    (tmp_path / NAME).write_text("\n".join([head, *lines, ""]))
    with pytest.raises(InputError, match=f"{NAME}:2: .*waypoints"):
        write_report(tmp_path / NAME)
    (tmp_path / NAME).write_text(json.dumps({**json.loads(head), "machine": {"ompl": "2"}}) + "\n")
    with pytest.raises(InputError, match=f"{NAME}:1: machine.*rrtik-ompl.*pin"):
        write_report(tmp_path / NAME)


@pytest.mark.parametrize("other", [{"problem": "planar3_z"}, {"group": "planar3_z"}, {"planner": "nobody"}])
def test_a_run_that_the_suite_does_not_name_is_told(campaign, tmp_path, other):
    head, *lines = (campaign / NAME).read_text().splitlines()
    lines[0] = json.dumps({**json.loads(lines[0]), **other})
    (tmp_path / NAME).write_text("\n".join([head, *lines, ""]))
    with pytest.raises(InputError, match=r"nobody|planar3_z"):
        write_report(tmp_path / NAME)


def test_a_file_that_is_no_campaign_is_refused(suite, tmp_path, capsys):
    (tmp_path / NAME).write_text('{"a": 1}\n{"b": 2}\n')
    with pytest.raises(InputError, match="not the head of a campaign"):
        read_head(tmp_path / NAME)
    assert run(["bench", str(suite), "--out", str(tmp_path), "--resume"]) == 2
    assert capsys.readouterr().err.count("\n") == 1

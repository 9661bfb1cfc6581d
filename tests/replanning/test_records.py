"""Records of runs: written whole, read back as the same run, refused when they cannot be."""

from __future__ import annotations

import json

import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan
from rrtik_tests.moving_plane import OPTIONS, crossing


def test_a_record_reads_back_as_the_same_run(tmp_path):
    run = replan(crossing(), record=tmp_path / "run.json", **OPTIONS)
    again = ReplanRun.load(tmp_path / "run.json")
    assert (again.configurations == run.configurations).all()
    assert again.statistics == run.statistics
    assert again.ticks[3].poses["lift"] == pytest.approx(run.ticks[3].poses["lift"])


def test_a_record_of_a_long_run_is_read_too(tmp_path):
    file = tmp_path / "run.json"
    replan(crossing(), record=file, **{**OPTIONS, "seconds": 0.5})
    with file.open("a") as record:
        record.write(" " * (65 * 2**20))
    assert len(ReplanRun.load(file).ticks) == 6


def test_the_record_is_kept_when_the_run_is_interrupted(tmp_path):
    scene = crossing().world.scene

    def feed(time):
        if time > 1.0:
            raise KeyboardInterrupt
        return scene.at(time)

    with pytest.raises(KeyboardInterrupt):
        replan(crossing(), feed, record=tmp_path / "run.json", **OPTIONS)
    kept = ReplanRun.load(tmp_path / "run.json")
    assert kept.outcome == "interrupted"
    assert len(kept.ticks) == 11


def test_a_run_interrupted_before_its_first_tick_leaves_no_record(tmp_path):
    scene, looks = crossing().world.scene, iter(range(9))

    def feed(_):
        if next(looks) == 2:
            raise KeyboardInterrupt
        return scene

    with pytest.raises(KeyboardInterrupt):
        replan(crossing(), feed, record=tmp_path / "run.json", **OPTIONS)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_record_is_refused(tmp_path):
    (tmp_path / "run.json").write_text('{"kind": "replan_run", "version": 1, "ticks": [{"time": 0}]}')
    with pytest.raises(InputError, match="not a whole record"):
        ReplanRun.load(tmp_path / "run.json")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda record: record.update(ticks=[]), "no tick"),
        (lambda record: record.update(outcome="flew"), "no outcome 'flew'"),
        (lambda record: record["ticks"][1].update(event="jump"), "no event of a tick 'jump'"),
        (lambda record: record["ticks"][2].update(time=0.0), "times go backwards"),
        (lambda record: record["ticks"][2].update(time="x"), "time of a tick: expected numbers, got 'x'"),
        (lambda record: record["ticks"][1]["poses"].update(lift=[0.0] * 7), "'lift': quat_xyzw must have length 1"),
        (lambda record: record["ticks"][1]["seconds"].update(look="x"), "seconds of 'look': expected numbers"),
        (lambda record: record["ticks"][1].update(checked=0.5), "checked must be a whole number"),
        (lambda record: record.update(rate=0), "rate: must be greater than 0"),
        (lambda record: record.update(problem=7), "problem must be of type str"),
    ],
)
def test_a_record_that_cannot_be_is_refused_with_its_name(tmp_path, change, words):
    file = tmp_path / "run.json"
    replan(crossing(), record=file, **{**OPTIONS, "seconds": 0.5})
    record = json.loads(file.read_text())
    change(record)
    file.write_text(json.dumps(record))
    with pytest.raises(InputError, match=f"run.json: .*{words}"):
        ReplanRun.load(file)

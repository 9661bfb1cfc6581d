"""What the commands say comes next, where a person reads it."""

import sys

import pytest

from rrtik_ompl.cli.app import run


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["plan", "planar3_boxes"],
            "next: see it move: rrtik plan planar3_boxes --html plan.html\n      keep it",
        ),
        (["plan", "planar3_boxes", "--out", "{}/a path.json"], "time it: rrtik time planar3_boxes '{}/a path.json'"),
        (["plan", "planar3_boxes", "--html", "{}/a.html"], "next: open {}/a.html\n      keep it"),
        (["check", "planar3_boxes"], "next: rrtik plan planar3_boxes\n      rrtik show planar3_boxes"),
        (["show", "planar3_boxes", "--html", "{}/b.html"], "next: open {}/b.html"),
        (["straight", "titan4_sdu", "--by", "0", "0", "0.02"], "next: see it: --html line.html"),
        (["ik", "planar3", "--position", "1.5", "1", "0"], "next: see it: --html ik.html\n      every solution: --all"),
    ],
)
def test_the_next_steps_stand_in_the_last_lines(tmp_path, capsys, monkeypatch, words, said):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert run([word.format(tmp_path) for word in words]) == 0
    last = "\n".join(capsys.readouterr().out.rstrip().splitlines()[-2:])
    assert said.format(tmp_path, tmp_path) in last


def test_a_pipe_and_a_machine_are_told_nothing(tmp_path, capsys, monkeypatch):
    assert run(["check", "planar3_boxes"]) == 0
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert run(["plan", "planar3_boxes", "--json"]) == 0
    assert "next:" not in capsys.readouterr().out

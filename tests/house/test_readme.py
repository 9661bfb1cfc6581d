"""What the README shows, works."""

import json
import re
from pathlib import Path

import pytest

from rrtik_ompl.benchmark import load_suite
from rrtik_ompl.cli import run
from rrtik_ompl.ik.face import solve_ik
from rrtik_ompl.path import load_path
from rrtik_ompl.problem_file import load_problem
from rrtik_tests.places import ROOT

README = (ROOT / "README.md").read_text()


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def test_there_are_two_commands_to_set_up_and_the_second_runs_the_tests():
    commands = [line for block in blocks("") for line in block.splitlines() if "pip install" in line]
    assert [command.rpartition("&& ")[2].split()[0] for command in commands] == [".venv/bin/rrtik", ".venv/bin/python"]
    assert "-m pytest" in commands[1]


def test_the_main_job_writes_what_it_says(tmp_path, monkeypatch):
    (job,) = re.findall(r"\.venv/bin/rrtik (.*)", README)
    monkeypatch.chdir(tmp_path)
    assert run(job.split()) == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["titan4_sdu.html", "titan4_sdu.json"]


def test_the_python_example_runs_from_top_to_bottom(tmp_path, monkeypatch):
    (example,) = blocks("python")
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(example, "README.md", "exec"), names)
    assert names["plan"].found, names["plan"].reason
    assert load_path("path.json").transitions == names["path"].transitions
    assert load_problem("reach.yaml").world.scene.names == ("post",)
    assert Path("view.html").stat().st_size > 100_000


def test_the_problem_file_loads_and_its_other_goals_can_be_reached(tmp_path):
    text, goal = (block for block in blocks("yaml") if "\nplanners:" not in block)
    file = tmp_path / "task.yaml"
    file.write_text(text)
    assert load_problem(file).world.scene.names == ("panel", "seabed")
    file.write_text(text[: text.index("goal:")] + goal)
    problem = load_problem(file)
    for member in problem.goal.members:
        assert solve_ik(problem.robot, member, near=problem.start, world=problem.world).found


def test_the_command_for_the_schema_prints_json(capsys):
    (command,) = re.findall(r'python -c "(import json.*)"', README)
    exec(command, {})
    assert json.loads(capsys.readouterr().out)["$schema"].startswith("https://json-schema.org")


def test_the_suite_of_benchmarks_loads(tmp_path):
    (text,) = (block for block in blocks("yaml") if "\nplanners:" in block)
    file = tmp_path / "three.yaml"
    file.write_text(text)
    suite = load_suite(file)
    assert len(suite.sources) == 14
    assert [entrant.label for entrant in suite.entrants] == ["bicrdt", "RRTConnect", "short steps"]


@pytest.mark.parametrize(
    "verb",
    [
        "plan",
        "check",
        "show",
        "list",
        "convert",
        "moves",
        "time",
        "replan",
        "ik",
        "reach",
        "reproduce",
        "bench",
        "overlay",
        "pilot",
    ],
)
def test_every_option_that_the_readme_names_is_there(verb, capsys):
    usage, *_ = re.findall(rf"^rrtik {verb} [^\n]*(?:\n  [^\n]*)*", README, re.MULTILINE)
    assert run([verb, "--help"]) == 0
    text = capsys.readouterr().out
    assert [option for option in re.findall(r"--[a-z]+", usage) if option not in text] == []

"""Planners in anybody's files."""

from __future__ import annotations

import sys

import pytest

from rrtik_ompl.base.errors import InputError, PlannerError, UnknownNameError
from rrtik_ompl.benchmark import load_suite
from rrtik_ompl.ompl_bridge.planner_names import find_planner
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.problem import load_problem

CODE = """
from rrtik_ompl.ompl_bridge import SafePlanner
class Mine(SafePlanner):
    def __init__(self, si, *, world=None, seed=None, width=1.0):
        super().__init__(si, "Mine", world=world, seed=seed)
number = 7
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(CODE)
    return path


def test_a_class_in_a_file_is_a_planner_and_the_same_one_each_time(file):
    assert find_planner(f"{file}:Mine") is find_planner(f"{file}:Mine")
    assert find_planner(f"{file}:Mine").default_options() == {"width": 1.0}


@pytest.mark.parametrize(
    ("name", "message"),
    [("absent.py:Mine", "there is no file absent.py"), ("{file}:number", "number is not a class derived from")],
)
def test_what_is_no_planner_gets_one_line(file, name, message):
    with pytest.raises(InputError, match=message):
        find_planner(name.format(file=file))


def test_a_wrong_class_lists_those_of_the_file(file):
    with pytest.raises(UnknownNameError, match="Mine"):
        find_planner(f"{file}:Mien")


@pytest.mark.parametrize(("text", "said"), [("1 / 0", "ZeroDivisionError"), ("raise SystemExit(7)", "SystemExit: 7")])
def test_a_file_that_cannot_be_run_gets_one_line(tmp_path, text, said):
    (tmp_path / "broken.py").write_text(text)
    with pytest.raises(InputError, match=f"cannot be run: {said}"):
        find_planner(f"{tmp_path / 'broken.py'}:Mine")


def test_two_files_of_one_name_are_two_planners(file, tmp_path):
    other = tmp_path / "other" / file.name
    other.parent.mkdir()
    other.write_text(CODE.replace("width=1.0", "width=3.0"))
    first, second = find_planner(f"{file}:Mine"), find_planner(f"{other}:Mine")
    assert second.default_options() == {"width": 3.0}
    for planner in (first, second):  # each is found again by the name that it says it has, as pickle does
        assert sys.modules[planner.__module__].Mine is planner
    with pytest.raises(UnknownNameError, match="Mine"):
        find_planner(f"{file}:Mien")


BROKEN = """
from ompl import base as ob
class Solve(ob.Planner):
    def __init__(self, si):
        super().__init__(si, "Solve")
    def solve(self, ptc):
        return {}["key"]
class Exit(Solve):
    def solve(self, ptc):
        raise SystemExit(3)
class Nothing(Solve):
    def solve(self, ptc):
        pass
class Setup(Solve):
    def setup(self):
        raise ValueError("no")
class Made(Solve):
    def __init__(self, si):
        super().__init__(si)
        raise OSError("no")
"""


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Solve", r"planner Solve broke: KeyError: 'key' \(broken.py, line 7\)"),
        ("Exit", r"planner Exit broke: SystemExit: 3 \(broken.py, line 10\)"),
        ("Nothing", r"planner Nothing broke: TypeError: its solve\(\) must return .*PlannerStatus, got NoneType"),
        ("Setup", r"planner Setup broke: ValueError: no \(broken.py, line 16\)"),
        ("Made", r"planner Made broke: OSError: no \(broken.py, line 20\)"),
    ],
)
def test_what_leaves_the_code_of_anybodys_planner_is_one_line(tmp_path, name, said):
    (tmp_path / "broken.py").write_text(BROKEN)
    problem = load_problem("titan4_prisms")
    with pytest.raises(PlannerError, match=said):
        plan(problem, f"{tmp_path / 'broken.py'}:{name}", seed=1)


def test_a_suite_finds_the_file_beside_itself_and_calls_it_by_its_class(file):
    suite = file.with_name("suite.yaml")
    suite.write_text(
        "version: 1\nproblems: [titan4_prisms]\nruns: 1\nseconds: 1\nmemory_mb: 1000\nseed: 1\n"
        "planners: [{name: 'mine.py:Mine', parameters: {width: 2.0}}]\n"
    )
    (entrant,) = load_suite(suite).entrants
    assert (entrant.label, entrant.name) == ("Mine", f"{file}:Mine")


def test_a_problem_file_runs_no_code(file, tmp_path):
    saved = tmp_path / "problem.yaml"
    load_problem("titan4_prisms").save(saved)
    text = saved.read_text()
    lines = [line for line in text.splitlines() if not line.startswith("planner:")]
    saved.write_text("\n".join([*lines, f"planner: '{file}:Mine'", ""]))
    with pytest.raises(InputError, match="runs no code"):
        load_problem(saved)

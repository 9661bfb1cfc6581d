"""`python -m bench` makes each report by its name."""

import inspect
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Annotated

import pytest
from typer import Argument, Option

from bench.runner import BENCH, command, command_line, listing, named, run
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_tests.places import ROOT

OURS = ("bench", "rrtik_bench", "rrtik_ompl", "rrtik_planners", "rrtik_robots")


def files_of_the_repository() -> set[Path]:
    return {file for folder in (BENCH / "reports", BENCH / "data", ROOT / "docs") for file in folder.rglob("*")}


def test_the_names_are_listed_with_a_line_each():
    done = subprocess.run([sys.executable, "-m", "bench"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == list(listing())
    assert [line.split()[0] for line in listing()] == list(named())


@pytest.mark.parametrize("name", named())
def test_every_report_says_in_a_sentence_what_it_measures(name):
    first, *rest = named()[name].text.splitlines()
    assert first.endswith((".", "?"))
    assert not rest or rest[0] == ""


def test_the_page_of_measurements_has_every_name():
    rows = re.findall(r"^\| `(\w+)` \|", (BENCH / "README.md").read_text(), re.MULTILINE)
    assert rows == list(named())


def test_no_stored_page_is_left_without_a_name():
    text = (BENCH / "README.md").read_text()
    pages = [file.name for file in (BENCH / "reports").glob("*.md")]
    assert [page for page in pages if f"](reports/{page})" not in text] == []


@pytest.mark.parametrize("name", named())
def test_the_options_of_a_report_are_the_parameters_of_its_function(name):
    try:
        made = command(name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] in OURS:
            raise
        pytest.skip(f"{error.name} is not installed")
    options = inspect.signature(made).parameters
    own = inspect.signature(import_module(named()[name].module).main).parameters
    given = {"out": "run" in own or "out" in own, "jobs": "parts" in own}
    assert set(options) == set(own) - {"run", "parts"} | {option for option, is_there in given.items() if is_there}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["trut"], "no report 'trut'; did you mean 'truth'\\? have .*"),
        (["behaviour", "stor", "file.json"], "no verb 'stor'; did you mean 'store'\\? have compare, store"),
        (["contract_cases", "--case", "1"], "No such option: --case .*--cases.*"),
        (["contract_cases", "--cases", "many"], "Invalid value for '--cases'.*integer.*"),
        (["contract_cases", "--jobs", "0"], "Invalid value for '--jobs'.*1.*"),
        (["contract_cases", "--out", "{out}", "1"], ".*unexpected extra argument.*1.*"),
        (["roadmaps"], "Missing argument '(?i:folder)'.*"),
        (["roadmaps", "no_such_folder"], "Invalid value for '(?i:folder)'.* does not exist.*"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(words, said, tmp_path, capsys):
    assert run([word.replace("{out}", str(tmp_path / "page.md")) for word in words]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(rf"bench: {said}\n", errors)
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_section_leaves_nothing_behind(tmp_path, capsys):
    assert run(["proofs", "--arms", "pnada", "--out", str(tmp_path / "page.md")]) == 2
    assert "did you mean 'panda'?" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("contract_cases", ["--cases", "1"]),
        ("proofs_exact", ["--plane", "1", "--certificates", "1", "--postures", "10", "--poses", "1"]),
        ("holder", ["--scenes", "1"]),
    ],
)
def test_a_report_of_the_smallest_size_writes_its_page_and_nothing_else(name, words, tmp_path, capsys):
    before = files_of_the_repository()
    page = tmp_path / "page.md"
    assert run([name, *words, "--out", str(page)]) in (0, 1)
    assert list(tmp_path.iterdir()) == [page]
    assert files_of_the_repository() == before
    text = page.read_text()
    assert f"Written by `python -m bench {name} {' '.join(words)}" in text
    assert capsys.readouterr().out == text + "\n"


def test_a_page_says_all_sizes_and_the_names_of_places():
    def main(
        run: Run,
        folder: Annotated[Path, Argument(help="Of problems.")],
        *,
        python: str = sys.executable,
        count: Annotated[int, Option("--problems", help="Of each.")] = 3,
        share: float = 0.5,
        quick: bool = False,
        arms: Annotated[list[str] | None, Option(help="This arm.")] = None,
    ) -> Report:
        return run.report("")

    options = [each for each in inspect.signature(main).parameters.values() if each.name != "run"]
    given = {
        "folder": Path("sets"),
        "python": "a/python",
        "count": 3,
        "share": 0.5,
        "quick": True,
        "arms": ["ur5", "z1"],
    }
    said = "python -m bench toy FOLDER --python PYTHON --problems 3 --share 0.5 --quick --arms ur5 --arms z1"
    assert command_line("toy", options, given) == said
    assert command_line("toy", options, given | {"quick": False, "arms": None}) == said.partition(" --quick")[0]

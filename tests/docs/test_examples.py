"""Scripts and notebooks of examples/ and the code of the tutorials run as they stand, in an empty folder."""

import ast
import json
import runpy

import pytest

from rrtik_tests.pages import EXAMPLES, NOTEBOOKS, blocks_of
from rrtik_tests.places import ROOT

LONGEST = 40  # lines
# Those that follow need a robot; tests/viewer/test_viser_example.py runs that of viser, where it may be a stand-in.
ALONE = [file for file in EXAMPLES if not file.stem.startswith(("follow_", "viser_"))]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))


@pytest.mark.kernels
@pytest.mark.parametrize("file", ALONE, ids=lambda file: file.stem)
def test_an_example_is_short_and_runs(file, tmp_path, monkeypatch, capsys, quiet_ompl):
    assert len(file.read_text().splitlines()) <= LONGEST
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(file), run_name="__main__")
    assert capsys.readouterr().out.strip()


@pytest.mark.kernels
@pytest.mark.parametrize("file", TUTORIALS, ids=lambda file: file.stem)
def test_the_code_of_a_tutorial_runs_from_top_to_bottom(file, tmp_path, monkeypatch, quiet_ompl):
    monkeypatch.chdir(tmp_path)
    blocks = blocks_of(file.read_text())
    assert blocks
    names = {}
    for block in blocks:
        exec(compile(block, file.name, "exec"), names)


def test_there_are_fifteen_examples():
    assert len(ALONE) >= 15


def shown_by(cell, names):
    """Run a cell; what a notebook shows of the value of its last expression, or None."""
    body = ast.parse(cell).body
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    value = None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    return value if not hasattr(value, "_repr_html_") else value._repr_html_() or repr(value)


@pytest.mark.kernels
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_runs_and_shows_a_page(file, tmp_path, monkeypatch, quiet_ompl):
    monkeypatch.chdir(tmp_path)
    cells = [cell for cell in json.loads(file.read_text())["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] for cell in cells)  # pages are large, and made anew
    names = {}
    shown = [shown_by("".join(cell["source"]), names) for cell in cells]
    assert any("<iframe" in str(each) for each in shown)


def test_there_are_three_notebooks():
    assert len(NOTEBOOKS) >= 3

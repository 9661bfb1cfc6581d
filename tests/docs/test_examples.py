"""Scripts of examples/ and the code of the tutorials run as they stand, in an empty folder."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LONGEST = 40  # lines
EXAMPLES = sorted(file for file in (ROOT / "examples").glob("*.py") if not file.stem.startswith("follow_"))
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
CODE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.mark.kernels
@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_is_short_and_runs(file, tmp_path, monkeypatch, capsys, quiet_ompl):
    assert len(file.read_text().splitlines()) <= LONGEST
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(file), run_name="__main__")
    assert capsys.readouterr().out.strip()


@pytest.mark.kernels
@pytest.mark.parametrize("file", TUTORIALS, ids=lambda file: file.stem)
def test_the_code_of_a_tutorial_runs_from_top_to_bottom(file, tmp_path, monkeypatch, quiet_ompl):
    monkeypatch.chdir(tmp_path)
    blocks = CODE.findall(file.read_text())
    assert blocks
    names = {}
    for block in blocks:
        exec(compile(block, file.name, "exec"), names)


def test_there_are_fifteen_examples():
    assert len(EXAMPLES) >= 15

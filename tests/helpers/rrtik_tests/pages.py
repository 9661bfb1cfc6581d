"""The Python code that the project shows: in Markdown pages, examples and notebooks."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

from rrtik_tests.places import ROOT

MARKDOWN = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))

# Pages whose blocks do not build upon each other.
APART = {"CONTRIBUTING.md", "own_ompl_code.md"}


def _blocks(text: str, language: str) -> Iterator[re.Match[str]]:
    return re.finditer(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def blocks_of(text: str, language: str = "python") -> list[str]:
    """Return the blocks of code of a Markdown page."""
    return [block[1] for block in _blocks(text, language)]


def cells_of(notebook: Path) -> list[str]:
    """Return the code cells of a notebook."""
    cells = json.loads(notebook.read_text())["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def modules_of(file: Path) -> list[str]:
    """Return the code of a page as modules, each line at the number that it has in the page.

    The blocks of a page are one module in their order, those of ``APART`` one each. In a notebook, the lines are
    counted over its code cells.
    """
    text = file.read_text()
    if file.suffix == ".py":
        return [text]
    if file.suffix == ".ipynb":
        return ["\n".join(cells_of(file)) + "\n"]

    modules: list[str] = []
    for block in _blocks(text, "python"):
        above = text.count("\n", 0, block.start(1))
        if modules and file.name not in APART:
            modules[-1] += "\n" * (above - modules[-1].count("\n")) + block[1]
        else:
            modules.append("\n" * above + block[1])
    return modules

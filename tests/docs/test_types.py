"""What the project shows of Python passes type checkers against the types that it ships."""

import json
import re
import subprocess
import sys

import pytest

from rrtik_tests.pages import EXAMPLES, MARKDOWN, NOTEBOOKS, modules_of
from rrtik_tests.places import ROOT

PAGES = [*MARKDOWN, *EXAMPLES, *NOTEBOOKS]

# Packages without types, or with types that are wrong: what is theirs is Any.
UNTYPED = ["ompl", "pinocchio"]
ANYTHING = "from typing import Any\n\ndef __getattr__(name: str) -> Any: ...\n"

# Pages name packages that need not be installed, and derive from classes without types.
MYPY = ["--strict", "--ignore-missing-imports", "--allow-subclassing-any"]

# The last line of a cell is an expression, which a notebook shows.
PYRIGHT = {
    "typeCheckingMode": "standard",
    "reportMissingImports": "none",
    "reportUnusedExpression": "none",
    "exclude": ["typings"],
}


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """A folder of modules, and the page of each."""
    folder = tmp_path_factory.mktemp("pages")
    pages = {}
    for page in PAGES:
        name = re.sub(r"\W", "_", page.relative_to(ROOT).as_posix())
        for number, module in enumerate(modules_of(page)):
            file = folder / f"{name}_{number}.py"
            file.write_text(module)
            pages[file.name] = page.relative_to(ROOT).as_posix()
    for package in UNTYPED:
        stub = folder / "typings" / f"{package}.pyi"
        stub.parent.mkdir(exist_ok=True)
        stub.write_text(ANYTHING)
    return folder, pages


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_it_passes_mypy_strict(shown):
    folder, pages = shown
    command = [sys.executable, "-m", "mypy", *MYPY, f"--cache-dir={ROOT / '.mypy_cache' / 'pages'}"]
    run = subprocess.run([*command, "--output=json", "."], cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode in (0, 1), run.stdout + run.stderr
    found = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
    wrong = [
        f"{pages.get(each['file'], each['file'])}:{each['line']}: {each['message']} [{each['code']}]" for each in found
    ]
    assert wrong == [], "\n" + "\n".join(wrong)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_it_passes_pyright(shown):
    folder, pages = shown
    (folder / "pyrightconfig.json").write_text(json.dumps(PYRIGHT))
    command = [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode in (0, 1), run.stdout + run.stderr
    answer = json.loads(run.stdout)
    assert answer["summary"]["filesAnalyzed"] == len(pages)
    wrong = []
    for each in answer["generalDiagnostics"]:
        page = pages.get(each["file"].rpartition("/")[2], each["file"])
        wrong.append(f"{page}:{each['range']['start']['line'] + 1}: {each['message']} [{each.get('rule')}]")
    assert wrong == [], "\n" + "\n".join(wrong)

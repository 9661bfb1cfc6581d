"""What a newcomer types: Python and commands of tutorials as they stand, in an environment that has the package.

    python -m venv fresh && fresh/bin/pip install .
    python -m bench newcomer fresh/bin/python

Prints one row a block: how long it took and the first line of what went wrong. Each page is typed in a folder of its
own, all of its Python in one interpreter, as a person has one open. Exit code 1 if something went wrong.
"""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

TUTORIALS = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
BLOCK = re.compile(r"^```python\n(.*?)^```|^((?:    rrtik [^\n]*\n)+)", re.MULTILINE | re.DOTALL)
FIRST_THREE = ("first_plan", "own_robot", "lines_and_constraints")
MARK = "typed in "
READER = f"""
import sys, time
space = {{"__name__": "__main__"}}
for text in iter(lambda: sys.stdin.readline(), ""):
    begin = time.perf_counter()
    try:
        exec(compile(eval(text), "<typed>", "exec"), space)
        said = ""
    except BaseException as error:
        said = f"{{type(error).__name__}}: {{error}}"
    print(f"\\n{MARK}{{time.perf_counter() - begin:.1f}} s{{said and ': '}}{{said}}", flush=True)
"""


def typed(page: str, python: Path) -> list[tuple[str, str]]:
    """The first line of each block of a page, and how it went."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        interpreter = subprocess.Popen(
            [python, "-c", READER], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert interpreter.stdin is not None
        assert interpreter.stdout is not None
        for found in BLOCK.finditer((TUTORIALS / f"{page}.md").read_text(encoding="utf-8")):
            if found[1] is not None:
                interpreter.stdin.write(f"{found[1]!r}\n")
                interpreter.stdin.flush()
                line = next((line for line in interpreter.stdout if line.startswith(MARK)), "no answer")
                rows.append((found[1].splitlines()[0], line.removeprefix(MARK).strip()))
            else:
                rows += [(command, commanded(command, python, folder)) for command in found[2].splitlines()]
        interpreter.stdin.close()
        interpreter.wait()
    return rows


def commanded(command: str, python: Path, folder: str) -> str:
    """How a command of the shell went."""
    begin = time.perf_counter()
    path = f"{python.absolute().parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        command.strip(), shell=True, cwd=folder, env=os.environ | {"PATH": path}, capture_output=True, text=True
    )
    failed = "" if done.returncode == 0 else f": exit code {done.returncode}: {done.stderr.strip()[:200]}"
    return f"{time.perf_counter() - begin:.1f} s{failed}"


def main(
    python: Annotated[Path, Argument(help="Of the environment.")],
    tutorials: Annotated[list[str] | None, Option(help="This one; may be repeated. Without: the first three.")] = None,
) -> int:
    """Type the pages; exit code 1 if something went wrong."""
    wrong = 0
    for page in tutorials or FIRST_THREE:
        print(f"| {page} | |\n|---|---|")
        for what, how in typed(page, python):
            wrong += ":" in how
            print(f"| `{what.strip()[:70]}` | {how} |", flush=True)
        print()
    return int(wrong > 0)

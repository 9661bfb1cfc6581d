"""Makes a report by its name; ``python -m bench`` lists the names, ``python -m bench NAME --help`` tells the options.

A report is a module of this package that has a function ``main``. Its name is that of its file, or that of its folder
if the file is called ``report.py``, and its page is ``bench/reports/NAME.md``. The parameters of ``main`` are its
options, and the module's docstring is its help. Two parameters come from here:

- ``run``, the `Run`: the report has ``--out``, and ``main`` gives back the `Report` that is written there;
- ``parts``, the `Parts` of a long measurement: the report has ``--jobs``, and what is done is kept till the page is
  written.

A ``main`` without ``run`` is a tool that writes no page. Exit code 0 if all acceptance rows are held, 1 if not, 2 for
bad input.
"""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from shlex import join
from typing import Annotated, Any, get_args

import typer
from typer.models import ArgumentInfo, OptionInfo

from bench.shared.parts import Parts
from bench.shared.run import REPORTS, Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.errors import RrtikError

BENCH = Path(__file__).resolve().parent
UsageError: Any = typer.BadParameter.__bases__[0]  # click's, which typer carries under a private name
BAD_INPUT = 2
GIVEN = ("run", "parts")  # the parameters of a report that are no options

Out = Annotated[Path, typer.Option(help="The page.")]
Jobs = Annotated[int, typer.Option(help="Processes; more than one make wall times longer.", min=1)]


@dataclass(frozen=True)
class Named:
    """A report or a tool that is not loaded yet: its module and that module's docstring."""

    module: str
    text: str


def run(arguments: list[str]) -> int:
    """Do what the words after ``python -m bench`` say; the exit code."""
    try:
        if not arguments:
            print("\n".join(listing()))
            return 0
        if arguments[0] == "--help":
            print(__doc__)
            return 0
        name = one_of(named(), arguments[0], "report")
        app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
        app.command(help=named()[name].text)(command(name))
        return int(app(args=arguments[1:], prog_name=f"python -m bench {name}", standalone_mode=False) or 0)
    except RrtikError as error:
        message = str(error)
    except UsageError as error:
        message = error.format_message()
    print(f"bench: {message}", file=sys.stderr)
    return BAD_INPUT


@cache
def named() -> dict[str, Named]:
    """All reports and tools by their names, in order."""
    found: dict[str, Named] = {}
    for file in sorted(BENCH.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "\ndef main(" not in text:
            continue
        place = file.relative_to(BENCH.parent).with_suffix("")
        name = place.parent.name if place.name == "report" else place.name
        assert name not in found, f"{name}: two reports have this name"
        found[name] = Named(".".join(place.parts), ast.get_docstring(ast.parse(text)) or "")
    return dict(sorted(found.items()))


def listing() -> Iterator[str]:
    """A line for each name."""
    width = max(map(len, named()))
    for name, each in named().items():
        yield f"{name:{width}}  {each.text.partition(chr(10))[0]}"


def command(name: str) -> Callable[..., int | None]:
    """A report as typer takes it: a function of its options, ``--out`` and ``--jobs`` among them; a tool as it is."""
    main: Callable[..., Any] = import_module(named()[name].module).main
    parameters = inspect.signature(main, eval_str=True).parameters
    if "run" not in parameters:
        return main
    options = [each.replace(kind=each.KEYWORD_ONLY) for key, each in parameters.items() if key not in GIVEN]

    def made(*, out: Out = REPORTS / f"{name}.md", jobs: Jobs = 1, **given: Any) -> int:
        run = Run(command_line(name, options, given), out, jobs)
        with Parts(out, jobs) if "parts" in parameters else nullcontext() as parts:
            report: Report = main(run, parts, **given) if parts else main(run, **given)
            return report.finish(out)

    further = inspect.signature(made, eval_str=True).parameters
    shown = [*options, further["out"], *([further["jobs"]] if "parts" in parameters else [])]
    made.__signature__ = inspect.Signature(shown)  # type: ignore[attr-defined]
    made.__annotations__ = {each.name: each.annotation for each in shown}
    return made


def command_line(name: str, options: list[inspect.Parameter], given: dict[str, Any]) -> str:
    """What a page says that it was made by: all sizes, and places by the names of their options."""
    words = ["python", "-m", "bench", name]
    for option in options:
        value = given[option.name]
        if value is None or value is False:
            continue
        flag = _flag(option)
        if value is True:
            words += flag
            continue
        for each in value if isinstance(value, list | tuple) else [value]:
            words += [*flag, _shown(each, option.name.upper())]
    return join(words)


def _flag(option: inspect.Parameter) -> list[str]:
    """The word before an option's value; none if it is an argument."""
    if option.default is option.empty:
        return []
    for each in get_args(option.annotation):
        if isinstance(each, ArgumentInfo):
            return []
        if isinstance(each, OptionInfo) and isinstance(each.default, str):  # typer's place of a name of its own
            return [each.default]
    return [f"--{option.name.replace('_', '-')}"]


def _shown(value: Any, name: str) -> str:
    key, equals, place = str(value).rpartition("=")
    if isinstance(value, Path) or "/" in place:
        return f"{key}{equals}{name}"
    return f"{value:g}" if isinstance(value, float) else str(value)

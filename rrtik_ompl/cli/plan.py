"""The command `rrtik plan`: a path for a problem, shortened, printed, saved and drawn."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from rrtik_ompl.base.choices import Accuracy, CommandShortening, ImproveStrategy, PathObjective, ProofMode, one_of
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.terminal import PAGE_FORMATS, ProblemName, Seed, command, note, progress, say, suggest
from rrtik_ompl.files.tables import FORMATS as PATH_FORMATS
from rrtik_ompl.files.text import check_target

if TYPE_CHECKING:
    from rrtik_ompl.model.path import JointPath
    from rrtik_ompl.world.problem import Problem


def _choice(names: object, what: str, text: str) -> Any:  # noqa: ANN401 - typer's class has no public name
    """Return an option that takes one of the names of a ``Literal``.

    Args:
        names: The ``Literal``.
        what: What is chosen, for the error message.
        text: The help of the option.
    """
    known: tuple[str, ...] = get_args(names)

    def parse(name: str) -> str:
        try:
            return one_of(known, name, what)
        except UnknownNameError:
            raise typer.BadParameter(f"'{name}' is not one of {', '.join(map(repr, known))}.") from None

    return typer.Option(parser=parse, metavar=what.split()[-1].upper(), help=f"{text} One of {', '.join(known)}.")


def plan(
    problem: ProblemName,
    planner: Annotated[
        str | None, typer.Option(help="See: rrtik list planners. If left out, the problem's planner, or else auto.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Limit of wall time [s].")] = 5.0,
    seed: Seed = 0,
    restarts: Annotated[int, typer.Option(help="Largest number of new attempts, if one ends early.")] = 20,
    parameter: Annotated[
        list[str] | None,
        typer.Option("--parameter", metavar="NAME=VALUE", help="An option of the planner, in JSON; repeatable."),
    ] = None,
    shorten: Annotated[
        CommandShortening,
        _choice(
            CommandShortening,
            "shortening method",
            "How the path is made shorter; auto keeps single-joint moves and makes them few.",
        ),
    ] = "auto",
    accuracy: Annotated[
        Accuracy | None,
        _choice(Accuracy, "accuracy", "Collisions: conservative counts a doubt as one; the problem's if left out."),
    ] = None,
    proof: Annotated[
        ProofMode,
        _choice(ProofMode, "proof", "Whether every motion has to be proven free for its whole length."),
    ] = "preferred",
    clearance: Annotated[
        float | None,
        typer.Option(
            help="Distance to keep from obstacles [m]; if left out 0.001, or less if start or goal have less."
        ),
    ] = None,
    improve: Annotated[
        float,
        typer.Option(help="How long to improve the path after it was found [s], within --seconds."),
    ] = 0.0,
    objective: Annotated[PathObjective, _choice(PathObjective, "objective", "What --improve makes small.")] = "length",
    strategy: Annotated[
        ImproveStrategy,
        _choice(ImproveStrategy, "strategy", "How --improve works: by plans with other seeds, or by this path alone."),
    ] = "restart-shorten",
    out: Annotated[Path | None, typer.Option(help="Save the path: .json, .csv or .txt (OMPL matrix).")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a self-contained 3-D page to this file.")] = None,
    still: Annotated[bool, typer.Option("--still", help="A page that does not plan by itself: smaller.")] = False,
    tree: Annotated[
        bool, typer.Option("--tree", help="Show in the page of --html how the planner searched, step by step.")
    ] = False,
    certificate: Annotated[
        Path | None, typer.Option(help="Write the certificate of the path: .json; the file of --out can hold both.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> int:
    """Find a path and print its moves.

    A path that moves several joints at once is printed as waypoints. Exit code 1 if no path was found, or if a
    certificate was asked for and the path is not proven free.
    """
    check_target(out, PATH_FORMATS)
    check_target(html, PAGE_FORMATS)
    check_target(certificate, (".json",))
    if tree and html is None:
        raise InputError("--tree is for the page: give --html too, or leave it out")

    from rrtik_ompl import load_problem
    from rrtik_ompl.cli import plan_report as report
    from rrtik_ompl.description.catalog import AUTO
    from rrtik_ompl.ompl_bridge.planner_names import options_of
    from rrtik_ompl.planning.plan import plan as find_path

    options_of(AUTO if planner is None else planner)
    options = _parameters(parameter or [])
    question = load_problem(problem)

    with progress(f"planning {question.name} with {planner or question.planner or AUTO}"):
        found = find_path(
            question,
            planner,
            seconds=seconds,
            seed=seed,
            restarts=restarts,
            parameters=options,
            accuracy=accuracy,
            proof=proof,
            clearance=clearance,
            improve=improve,
            objective=objective,
            strategy=strategy,
            shorten=False if shorten == "none" else shorten,
            tree=tree,
        )

    path = found.path
    if html is not None and (path is not None or found.tree is not None):
        from rrtik_ompl.viewer import view

        with progress("drawing"):
            view(found, html=html, still=still)
    lack = "" if path is None else _write(question, path, out, certificate)
    if as_json:
        print(json.dumps(report.document(question, found)))
    elif path is None:
        note(f"{question.name}: not found: {found.reason}")
        suggest(*_next_steps(problem, path, out, html))
    else:
        say(*report.summary(question, found, path, named=planner))
        _say_path(path, (out, html, None if lack else certificate))
        suggest(*_next_steps(problem, path, out, html))

    if tree and found.tree is None:
        note(f"planner {found.planner} keeps no tree: the page shows none; RRTConnect, bicrdt or roadmap have one")
    if lack:
        note(lack)
    elif less := report.less_clearance(path, clearance):
        note(less)
    return FOUND if found.found and not lack else NOT_FOUND


def _next_steps(problem: str, path: JointPath | None, out: Path | None, html: Path | None) -> list[str]:
    """Return suggestions for what to do after planning."""
    if path is None:
        return [f"look at it: {command('show', problem)}", "give it more time: --seconds"]
    seen = f"see it move: {command('plan', problem, '--html', 'plan.html')}" if html is None else f"open {html}"
    kept = "keep it: --out path.json" if out is None else f"time it: {command('time', problem, out)}"
    return [seen, kept]


def _say_path(path: JointPath | None, written: tuple[Path | None, ...]) -> None:
    """Print the moves or waypoints of a path, if there is one, and the files that were written."""
    if path is None:
        return
    from rrtik_ompl.cli import plan_report as report

    say(report.moves_table(path) if path.one_joint_at_a_time else report.waypoints_table(path))
    say(*(f"wrote {file}" for file in written if file is not None))


def _write(problem: Problem, path: JointPath, out: Path | None, certificate: Path | None) -> str:
    """Write the path and its certificate; return why there is no certificate, "" if nothing is missing."""
    if out is not None:
        path.save(out)
    if certificate is None:
        return ""

    from rrtik_ompl.cli.plan_report import write_certificate

    return write_certificate(problem, path, certificate, beside=certificate == out)


def _parameters(pairs: list[str]) -> dict[str, Any]:
    """Parse options: ``--parameter range=0.5`` becomes {"range": 0.5}; values are JSON, anything else is text."""
    found = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name:
            raise InputError(f"--parameter {pair}: expected NAME=VALUE, for example --parameter range=0.5")

        try:
            found[name] = json.loads(value)
        except json.JSONDecodeError:
            if value[:1] in ("[", "{"):
                raise InputError(f"--parameter {pair}: names stand in quotes: 'last_joints=[\"elbow\"]'") from None
            found[name] = value
    return found

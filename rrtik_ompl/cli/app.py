"""The command line `rrtik`. Exit 0: found or valid; 1: not found or not valid; 2: bad input; 130: interrupted."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.base.floors import fitting_packages
from rrtik_ompl.cli import BAD_INPUT, FOUND, INTERRUPTED, NOT_FOUND
from rrtik_ompl.cli.bench import bench
from rrtik_ompl.cli.check import check
from rrtik_ompl.cli.demos import demos
from rrtik_ompl.cli.drawing import checker, overlay, play, show
from rrtik_ompl.cli.ik import inverse_kinematics
from rrtik_ompl.cli.marker_places import markers
from rrtik_ompl.cli.motion import list_moves, time_path
from rrtik_ompl.cli.pilot import pilot
from rrtik_ompl.cli.plan import plan
from rrtik_ompl.cli.prove import prove
from rrtik_ompl.cli.reach import reach
from rrtik_ompl.cli.replan import replan_scenario
from rrtik_ompl.cli.reproduce import reproduce
from rrtik_ompl.cli.task import straight, task
from rrtik_ompl.cli.terminal import drop_output, note, prepare_terminal, say, stoppable
from rrtik_ompl.cli.trust import with_trust
from rrtik_ompl.files.tables import FORMATS as PATH_FORMATS
from rrtik_ompl.files.text import check_target

COMPLETING = "_RRTIK_COMPLETE"  # set by a shell that asks for completions
UsageError: Any = typer.BadParameter.__bases__[0]  # click's class, which typer bundles under a private name


class Kind(str, Enum):
    """What `rrtik list` can list."""

    robots = "robots"
    planners = "planners"
    problems = "problems"
    ik = "ik"
    suites = "suites"
    tasks = "tasks"


def _print_version(asked: bool) -> None:
    if asked:
        from rrtik_ompl.base.version import __version__

        print(f"rrtik {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    del version


def list_names(kind: Annotated[Kind | None, typer.Argument(help="All kinds if left out.")] = None) -> int:
    """List names of robots, planners, problems and others."""
    from rrtik_ompl import list_planners, list_problems, list_robots
    from rrtik_ompl.description.catalog import list_suites
    from rrtik_ompl.ik import list_methods
    from rrtik_ompl.tasks.task_file import list_tasks

    sources = {
        Kind.robots: list_robots,
        Kind.planners: list_planners,
        Kind.problems: list_problems,
        Kind.ik: list_methods,
        Kind.suites: list_suites,
        Kind.tasks: list_tasks,
    }

    for each in Kind if kind is None else (kind,):
        if kind is None:
            say(f"{each.value}:")
        say(*(name if kind else f"  {name}" for name in sources[each]()))
    return FOUND


def convert(
    source: Annotated[str, typer.Argument(metavar="IN", help="A path, a scene, or a problem (MotionBenchMaker too).")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="The ending says which format.")],
    robot: Annotated[str | None, typer.Option(help="Robot that the file is for, where the file does not say.")] = None,
    moveit: Annotated[
        bool, typer.Option("--moveit", help="Write a .yaml of a scene as MoveIt's PlanningScene.")
    ] = False,
) -> int:
    """Convert a path, a problem or a scene to another format.

    Paths: .json, .csv, .txt (OMPL's matrix). Problems, MotionBenchMaker's too, become problem files (.yaml). Scenes,
    those of problem files too, become MuJoCo's .xml, .scene for MoveIt, or with --moveit its PlanningScene (.yaml);
    from .xml, .mjcf and .scene also .yaml.
    """
    from rrtik_ompl import JointPath, load_problem, load_robot, load_scene
    from rrtik_ompl.problem_files.scene_out import WRITERS, write_planning_scene

    if moveit:
        check_target(target, (".yaml", ".yml"))
    writer = write_planning_scene if moveit else WRITERS.get(target.suffix.lower())

    if Path(source).suffix.lower() in PATH_FORMATS:
        check_target(target, PATH_FORMATS)
        JointPath.load(source, None if robot is None else load_robot(robot)).save(target)
    elif writer is not None:
        known = robot is None and Path(source).suffix  # else a problem that ships, or one of MotionBenchMaker
        scene = load_scene(source) if known else load_problem(source, robot=robot).world.scene
        writer(scene, target)
    elif Path(source).suffix.lower() in WRITERS:
        check_target(target, (".yaml", ".yml", *WRITERS))
        load_scene(source).save(target)
    else:
        check_target(target, (".yaml", ".yml", *WRITERS))
        load_problem(source, robot=robot).save(target)

    say(f"wrote {target}")
    return FOUND


def warmup() -> int:
    """Compile all kernels now, once per machine.

    Later commands then do not wait for them.
    """
    from rrtik_ompl.kernels import warm_up
    from rrtik_ompl.kernels.wasm.page_kernels import page_kernels

    ready = warm_up(say)
    if ready and page_kernels() is not None:
        say("pages that plan: ready")
    return FOUND if ready else NOT_FOUND


COMMANDS: dict[str, Callable[..., int]] = {
    "plan": plan,
    "straight": straight,
    "task": task,
    "demos": demos,
    "check": check,
    "prove": prove,
    "checker": checker,
    "show": show,
    "play": play,
    "moves": list_moves,
    "time": time_path,
    "replan": replan_scenario,
    "ik": inverse_kinematics,
    "reach": reach,
    "overlay": overlay,
    "pilot": pilot,
    "reproduce": reproduce,
    "bench": bench,
    "list": list_names,
    "warmup": warmup,
    "convert": convert,
}
OPEN_NO_FILES = ("checker", "reproduce", "bench", "list", "warmup")  # commands that open no robot files in this process
HELP = "Plan collision-free paths for robot arms.\n\nExit 0: found or valid; 1: not; 2: bad input; 130: interrupted."
MARKERS = "markers"  # name of a group of commands


def command_line(given: list[str]) -> typer.Typer:
    """Return the command line with only the command that is called, because parsing the options of all takes long."""
    called = given[:1] if given and given[0] in {*COMMANDS, MARKERS} else [*COMMANDS, MARKERS]

    # rrtik --install-completion, for bash, zsh and fish
    app = typer.Typer(help=HELP, add_completion=True, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.callback()(_options)

    for name in called:
        if name == MARKERS:
            app.add_typer(markers, name=name)
        else:
            app.command(name)(COMMANDS[name] if name in OPEN_NO_FILES else with_trust(COMMANDS[name]))
    return app


def main() -> None:
    """Run the command line and exit with its code."""
    sys.exit(run())


def run(arguments: list[str] | None = None) -> int:
    """Run the command line with ``arguments`` (the process's own if None) and return the exit code."""
    prepare_terminal()
    given = sys.argv[1:] if arguments is None else arguments

    try:
        if not given and COMPLETING in os.environ:
            return _complete()
        if not given:  # without arguments, print the help, but report an error
            with redirect_stdout(sys.stderr):
                command_line(given)(args=["--help"], prog_name="rrtik", standalone_mode=False)
            return BAD_INPUT

        with fitting_packages(), stoppable():
            code = command_line(given)(args=given, prog_name="rrtik", standalone_mode=False)
        sys.stdout.flush()
        if code == INTERRUPTED:  # typer converts KeyboardInterrupt to this exit code
            raise KeyboardInterrupt
        return int(code or 0)
    except RrtikError as error:
        return _fail(str(error))
    except UsageError as error:
        return _usage(error.format_message(), getattr(error, "ctx", None), given)
    except (KeyboardInterrupt, typer.Abort):
        note("interrupted; no file is half-written")
        return INTERRUPTED
    except (BrokenPipeError, SystemExit):  # the reader has closed the pipe; typer converts that to an exit
        drop_output()
        return FOUND
    except OSError as error:
        drop_output()
        return _fail(f"standard output cannot be written: {error.strerror or error}")


def _complete() -> int:
    """Answer a shell that completes a command; typer ends this with SystemExit."""
    try:
        command_line([])(prog_name="rrtik", standalone_mode=False)
    except SystemExit:
        sys.stdout.flush()
    return FOUND


def _fail(message: str) -> int:
    note(message)
    return BAD_INPUT


def _usage(text: str, context: typer.Context | None, given: list[str]) -> int:
    """Print in one line what is wrong with a command, and return the exit code."""
    named = [word for word in given[:1] if not word.startswith("-")]  # there is no context if an option lacks its value
    command = " ".join(["rrtik", *named]) if context is None else context.command_path
    return _fail(f"{' '.join(text.replace('Value error, ', '').split())} (see: {command} --help)")


if __name__ == "__main__":
    main()

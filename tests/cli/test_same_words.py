"""The command line says the same words as Python: options and defaults are arguments and defaults, but for a reason."""

import inspect
import math

import pytest
import typer

import rrtik_ompl as rrtik
from rrtik_ompl.benchmark.campaign import run_campaign
from rrtik_ompl.benchmark.report import write_report
from rrtik_ompl.benchmark.suite import load_suite
from rrtik_ompl.cli.app import COMMANDS
from rrtik_ompl.cli.markers import markers
from rrtik_ompl.motion.trajectory import Trajectory
from rrtik_ompl.pilot.overlay.film import ArmInPictures
from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_ompl.pilot.web.server import PilotServer
from rrtik_ompl.sensing.mapping import map_markers
from rrtik_ompl.sensing.markers.sheets import print_board, print_markers
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_ompl.viewer.film import film

WRAPPED = {
    "plan": [rrtik.plan],
    "straight": [rrtik.tip.straight, rrtik.tip.arc],
    "task": [rrtik.Task.plan, rrtik.TaskPlan.time_parameterize, rrtik.RateLimits.of, film],
    "demos": [rrtik.demos.record],
    "check": [],
    "prove": [rrtik.prove, rrtik.load_motions],
    "show": [rrtik.view, film],
    "play": [rrtik.view],
    "moves": [rrtik.one_joint_moves, rrtik.shorten],
    "time": [rrtik.time_parameterize, rrtik.RateLimits.of, Trajectory.save],
    "replan": [rrtik.replan, film],
    "replan --foreseen": [rrtik.replanning.plan_in_time, film],
    "ik": [rrtik.solve_ik, rrtik.PoseGoal],
    "ik --poses": [rrtik.solve_ik_many, rrtik.PoseGoal],
    "ik --trajectory": [rrtik.ik.solve_trajectory],
    "reach": [rrtik.ik.reach_map],
    "overlay": [ArmInPictures],
    "pilot": [SessionOptions, PilotServer],
    "reproduce": [],
    "bench": [load_suite, run_campaign, write_report],
    "checker": [],
    "list": [],
    "warmup": [],
    "convert": [],
    "markers print": [print_markers, print_board],
    "markers calibrate": [],
    "markers map": [map_markers],
    "markers sense": [Sensor],
}

# Options of every command that no argument stands for: what is read, written and printed.
FILES = {
    "certificate",
    "out",
    "html",
    "json",
    "csv",
    "mend",
    "plot",
    "record",
    "replay",
    "scene",
    "problem",
    "trust_xacro",
    "still",
    "film",
    "picture",
}

OTHER_WORDS = {  # arguments that no option is called by, and why
    "accelerations": "of sampled points in Python",
    "ghosts": "the command show draws what is in files",
    "goal_feed": "a function",
    "scene_feed": "a function",
    "clock": "a function",
    "feed_patience": "of a feed, which is a function",
    "on_attempt": "a function",
    "on_better": "a function",
    "on_ready": "a function",
    "on_picture": "a function",
    "on_run": "a function",
    "stop": "a function",
    "inline": "of notebooks",
    "limits": "made of --share and of --velocity-deg and its like",
    "marks": "bodies made in Python",
    "meshcat": "a visualizer that runs in Python",
    "tree": "rrtik plan --tree --html shows it",
    "checks": "an engine",
    "run": "rrtik replan --replay --html shows it",
    "path": "an argument of the command",
    "title": "the command says it",
    "world": "from the problem, or --scene",
    "parameters": "--parameter, once for each",
    "dots_per_inch": "of a picture in Python; a sheet is true to size",
}
OF_COMMANDS = {  # arguments without an option, and options without an argument, by command
    "straight": {
        "by": "the pose at the end",
        "to": "the pose at the end",
        "rpy": "the pose at the end",
    },
    "task": {
        "trajectory": "a file",
        "velocity": "rrtik time has it",
        "acceleration": "rrtik time has it",
        "jerk": "rrtik time has it",
        "start": "of the task's file",
        **dict.fromkeys(
            ("blend", "clearance", "tip_speed", "tip_acceleration", "torque", "payload"),
            "rrtik time has it, for a path",
        ),
    },
    "time": {"gripper": "a path has no commands to a gripper"},
    "play": {**dict.fromkeys(("before", "html", "still"), "rrtik show has it")},
    "moves": {
        "spoken": "a form of output",
        "shorten": "the method of shorten()",
        "method": "--shorten",
        **dict.fromkeys(("seconds", "seed", "clearance", "rules", "finest", "one_joint"), "rrtik plan has it"),
    },
    "replan": {
        "foreseen": "plan_in_time() in place of replan()",
        "horizon": "with --foreseen",
        **dict.fromkeys(("step", "max_edge", "margin", "speed_bound", "repair_budget"), "keys of the scenario's file"),
    },
    "replan --foreseen": {
        **dict.fromkeys(("speed", "margin"), "keys of the scenario's file"),
        "iterations": "what --seconds limits",
        "goal": "that of the scenario's problem",
        "foreseen": "the function",
        "planner": "refused",
        "lookahead_ticks": "refused",
    },
    "demos": dict.fromkeys(("camera", "size", "pictures"), "pictures=DemoPictures(task, cameras, size)"),
    "reach": {"free": "the world without a scene", "effective": "another map, that a robot brings"},
    "overlay": {"camera_file": "a file", "map": "a file", "frames": "how much of the film"},
    "pilot": {
        "camera": "the source",
        "video": "the source",
        "images": "the source",
        "simulated": "the source",
        "source": "one of four options",
        "map": "the file map_file; `map` is a function of Python",
        "map_file": "--map",
        "no_browser": "what is opened",
        **dict.fromkeys(("conform", "explain"), "in place of a session"),
    },
    "bench": {
        "folder": "--problems, since the command has another folder, --out",
        "problems": "the folder of load_suite()",
    },
    "markers print": {"kind": "which of two functions"},
    "markers map": {
        **dict.fromkeys(("camera_file", "into"), "a file"),
        "object": "its name in the file",
        "known": "distances that are compared with what is found",
        "every": "how much of the film",
    },
    "markers sense": {
        **dict.fromkeys(("camera_file", "rig", "map", "task", "grasp", "picture"), "a file, or what is written to it"),
        "frames": "how much of the film",
    },
}
GOAL = dict.fromkeys(("position", "quat_xyzw", "rpy"), "the goal") | {"trajectory": "one of three functions"}
OF_COMMANDS |= {
    "ik": GOAL | {"poses": "a file"},
    "ik --poses": GOAL | {"all": "refused", "threads": "all cores"},
    "ik --trajectory": GOAL
    | {"all": "refused"}
    | dict.fromkeys(("free_rotation_axis", "jump", "options"), "of trajectories in Python"),
}

OTHER_DEFAULTS = {  # defaults that differ, and why
    ("replan --foreseen", "rate"): "of a film; that of the run is a key of the scenario's file",
    ("time", "torque"): "a flag: False hands over None",
    ("replan", "lookahead_ticks"): "None: the scenario's",
    ("replan", "planner"): "None: the usual one, and no word against --replay and --foreseen",
    ("replan", "seconds"): "None: the scenario's",
    ("replan --foreseen", "seconds"): "None: that of plan_in_time()",
    ("replan --foreseen", "horizon"): "None: the scenario's seconds",
    ("ik", "seconds"): "None: that of the function, which --poses and --trajectory choose",
    ("ik --poses", "seconds"): "the same",
    ("ik --trajectory", "seconds"): "the same",
    ("ik", "position_tolerance"): "None: the goal's own",
    ("ik", "orientation_tolerance"): "None: the goal's own",
    ("ik --poses", "position_tolerance"): "None: the goal's own",
    ("ik --poses", "orientation_tolerance"): "None: the goal's own",
    ("ik --trajectory", "position_tolerance"): "None: the goal's own",
    ("ik --trajectory", "orientation_tolerance"): "None: the goal's own",
    ("markers print", "marker"): "None: 0.73 of a square, which is 22 mm of 30",
    ("markers map", "sides"): "none, as a word",
    ("markers sense", "smooth"): "None: but for a folder",
}


def options(command):
    """Options of a command by the argument that they stand for, with their defaults in SI units."""
    group, _, name = command.partition(" ")
    if group == "markers":
        click = typer.main.get_command(markers).commands[name]
    else:
        app = typer.Typer(add_completion=False)
        app.command()(COMMANDS[group])
        click = typer.main.get_command(app)

    found = {}
    for each in click.params:
        if each.param_type_name == "option" and each.name != "help":
            word = max(each.opts, key=len).removeprefix("--").replace("-", "_")
            stem, factor = word, 1.0
            for unit, size in (("_deg", math.pi / 180.0), ("_mm", 1e-3)):
                if word.endswith(unit):
                    stem, factor = word.removesuffix(unit), size
            given = each.default
            found[stem] = factor * given if isinstance(given, float) else given
    return found


REQUIRED = inspect.Parameter.empty  # the default of an argument without one


def arguments(functions):
    """Arguments of functions with their defaults."""
    found = {}
    for function in functions:
        for name, each in inspect.signature(function).parameters.items():
            if found.get(name, REQUIRED) is REQUIRED:
                found[name] = each.default
    return found


def same(one, other):
    """Whether two defaults mean the same; a file or another argument without default has none in the command."""
    return (
        other is REQUIRED
        or one == other
        or (isinstance(one, float) and isinstance(other, float) and math.isclose(one, other))
    )


def test_every_command_is_compared():
    asked = {name.partition(" --")[0] for name in WRAPPED}
    assert asked == {*COMMANDS, *(f"markers {name}" for name in typer.main.get_command(markers).commands)}


@pytest.mark.parametrize("command", [name for name, functions in WRAPPED.items() if functions])
def test_options_and_defaults_are_the_arguments_of_python_and_their_defaults(command):
    given, wanted, reasons = options(command), arguments(WRAPPED[command]), OF_COMMANDS.get(command, {})
    assert given.keys() - wanted.keys() - FILES <= reasons.keys() | {"parameter"}
    missing = {name for name in wanted.keys() - given.keys() if wanted[name] is not REQUIRED}
    assert missing <= reasons.keys() | OTHER_WORDS.keys()
    differ = {name for name in given.keys() & wanted.keys() if not same(given[name], wanted[name])}
    assert {(command, name) for name in differ} <= OTHER_DEFAULTS.keys()


def test_no_reason_is_left_over():
    given = {command: options(command) for command in WRAPPED}
    wanted = {command: arguments(functions) for command, functions in WRAPPED.items()}
    for command, reasons in OF_COMMANDS.items():
        assert reasons.keys() <= given[command].keys() ^ wanted[command].keys(), command
    assert set(OTHER_WORDS) <= {name for names in wanted.values() for name in names}
    for command, name in OTHER_DEFAULTS:
        assert not same(given[command][name], wanted[command][name]), (command, name)


@pytest.mark.parametrize("command", WRAPPED)
def test_a_unit_that_is_not_of_the_si_stands_in_the_name(command):
    group, _, name = command.partition(" ")
    if group == "markers":
        shown = typer.main.get_command(markers).commands[name].params
    else:
        app = typer.Typer(add_completion=False)
        app.command()(COMMANDS[group])
        shown = typer.main.get_command(app).params
    for each in shown:
        for unit in ("deg", "mm"):
            marked = f"[{unit}" in (getattr(each, "help", "") or "")
            assert marked == each.name.endswith(f"_{unit}"), each.name

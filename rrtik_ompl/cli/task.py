"""The commands `rrtik straight` and `rrtik task`: linear motions of the tip, and sequences of stages."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.filming import Camera, FilmFile, Filming, Hide, PictureFile, Rate, Size
from rrtik_ompl.cli.terminal import (
    PAGE_FORMATS,
    TRAJECTORY_FORMATS,
    Seed,
    command,
    note,
    plural,
    progress,
    say,
    suggest,
)
from rrtik_ompl.files.tables import FORMATS as PATH_FORMATS
from rrtik_ompl.files.text import check_target

if TYPE_CHECKING:
    from rrtik_ompl.tasks import TaskPlan

Three = tuple[float, float, float]


def straight(
    problem: Annotated[str, typer.Argument(help="A shipped problem or a YAML file: its robot, scene and start.")],
    by: Annotated[Three | None, typer.Option(help="Shift of the tip in the world [m].")] = None,
    to: Annotated[Three | None, typer.Option(help="Position of the tip at the end [m].")] = None,
    rpy_deg: Annotated[
        Three | None, typer.Option(help="Its roll, pitch, yaw at the end [deg]; as at the start if left out.")
    ] = None,
    through: Annotated[Three | None, typer.Option(help="Go along the circle through this point [m].")] = None,
    deviation: Annotated[float, typer.Option(help="Largest deviation of the tip from the line [m].")] = 1e-4,
    turn_deviation_deg: Annotated[float, typer.Option(help="Largest deviation of its orientation [deg].")] = 0.1,
    clearance: Annotated[
        float | None,
        typer.Option(help="Distance to keep from obstacles on top of margins [m]; that of the problem if left out."),
    ] = None,
    seed: Annotated[int, typer.Option(help="The same seed gives the same motion.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Save the path: .json, .csv or .txt (OMPL matrix).")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a self-contained 3-D page to this file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> int:
    """Move the tip in a straight line or an arc.

    It begins at the start of the problem. Exit code 1 if it does not come to the end; what it reached is written all
    the same.
    """
    if (by is None) == (to is None):
        raise typer.BadParameter("give the end of the line: '--by DX DY DZ' or '--to X Y Z', and only one of them.")

    check_target(out, PATH_FORMATS)
    check_target(html, PAGE_FORMATS)

    import numpy as np

    from rrtik_ompl import load_problem
    from rrtik_ompl.base.poses import pose_from_rpy
    from rrtik_ompl.tip import arc, straight
    from rrtik_ompl.world.route_check import as_it_stands

    question = load_problem(problem)
    tip = question.robot.fk(question.start)
    place = tip.translation + np.array(by) if by is not None else np.array(to)
    goal: Any = place if rpy_deg is None else pose_from_rpy(place, np.radians(rpy_deg))
    turn = float(np.radians(turn_deviation_deg))
    kept: dict[str, Any] = {"deviation": deviation, "turn_deviation": turn, "clearance": clearance, "seed": seed}

    with progress(f"following a line in {question.name}"):
        if through is None:
            made = straight(question.world, question.start, goal, **kept)
        else:
            made = arc(question.world, question.start, goal, through, **kept)

    written: list[Path] = []
    if made.path is not None and out is not None:
        made.path.save(out)
        written.append(out)
    if made.path is not None and html is not None:
        from rrtik_ompl.viewer import view

        view(question.world, made.path, html=html, title=f"{question.name}: {100.0 * made.fraction:.4g} % of the line")
        written.append(html)

    waypoints = 0 if made.path is None else len(made.path.waypoints)
    if as_json:
        names = ("found", "fraction", "reason", "proven", "seconds")
        print(json.dumps({**{name: getattr(made, name) for name in names}, "waypoints": waypoints}))
    else:
        still = as_it_stands(question.world.scene)
        why = f": {made.reason}" if made.reason else f", {waypoints} waypoints, proven free{still}"
        say(f"{question.name}: {100.0 * made.fraction:.4g} % of the line{why}")
        say(*(f"wrote {file}" for file in written))
        if made.path is not None:
            suggest("see it: --html line.html" if html is None else f"open {html}")
    return FOUND if made.found else NOT_FOUND


def task(
    task: Annotated[str, typer.Argument(help="A shipped task (see: rrtik list tasks) or a YAML file with task:.")],
    seconds: Annotated[float, typer.Option(help="Limit of wall time [s].")] = 10.0,
    seed: Seed = 0,
    out: Annotated[Path | None, typer.Option(help="Save all motions with their worlds: .json.")] = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(help="Time the whole task, and save it: .json, .csv, .mcap; .yaml, .ros.json for ROS 2."),
    ] = None,
    share: Annotated[float, typer.Option(help="Share of the joints' limits, above 0 to 1: 0.5 is half as fast.")] = 1.0,
    pause: Annotated[
        float, typer.Option(help="Rest where a gripper moves or an object is taken or put down [s].")
    ] = 1.0,
    html: Annotated[Path | None, typer.Option(help="Write a page that plays the whole task.")] = None,
    film: FilmFile = None,
    picture: PictureFile = None,
    rate: Rate = None,
    size: Size = None,
    camera: Camera = "overview",
    hide: Hide = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> int:
    """Plan a task: pick and place and other sequences of stages.

    Exit code 1 if no choice of alternatives and configurations works.
    """
    check_target(out, (".json",))
    check_target(trajectory, TRAJECTORY_FORMATS)
    check_target(html, PAGE_FORMATS)
    filming = Filming(film, picture, rate, size, camera, hide)
    filming.check()

    from rrtik_ompl.tasks import Task

    loaded = Task.load(task)
    with progress(f"planning {loaded.name}"):
        plan = loaded.plan(seconds=seconds, seed=seed)

    if plan.found and out is not None:
        plan.save(out)
    commands: Path | None = None
    duration: float | None = None
    if trajectory is not None and plan.found:
        duration, commands = _timed(plan, trajectory, share, pause)

    if plan.found and html is not None:
        from rrtik_ompl.viewer import view

        with progress("drawing"):
            view(loaded.world, plan.played(), html=html, title=f"{loaded.name}: {plural(len(plan.paths), 'motion')}")
    filmed = filming.write(loaded.world, plan) if plan.found else []

    if as_json:
        print(json.dumps({**_document(plan), "seed": seed, "duration": duration}))
    elif plan.found:
        say(*plan_lines(loaded.name, plan))
        say(*([] if duration is None else [f"  in {duration:.2f} s, each rest of {pause:g} s"]))
        say(*(f"wrote {file}" for file in (out, trajectory, commands, html, *filmed) if file is not None))
        seen = f"see it: {command('task', task, '--html', 'task.html')}" if html is None else f"open {html}"
        suggest(seen, *(["time it: --trajectory task.json"] if trajectory is None else []))
    else:
        note(f"{loaded.name}: not found: {plan.reason}")
        suggest("give it more time: --seconds")
    return FOUND if plan.found else NOT_FOUND


def _document(plan: TaskPlan) -> dict[str, Any]:
    """Return a plan as plain values for JSON."""
    motions = [{"stage": str(s), "waypoints": len(p.waypoints)} for s, p in zip(plan.stages, plan.paths, strict=True)]
    said = {name: getattr(plan, name) for name in ("found", "reason", "proven", "seconds", "statistics")}
    return {**said, "chosen": list(plan.chosen), "notes": list(plan.notes), "motions": motions}


def plan_lines(name: str, plan: TaskPlan, wrong: frozenset[int] = frozenset()) -> list[str]:
    """Return a plan as text: a line for each motion, and its notes; ``wrong``: numbers of the invalid motions."""
    from rrtik_ompl.world.route_check import as_it_stands

    chosen = f", alternatives {', '.join(str(k + 1) for k in plan.chosen)}" if plan.chosen else ""
    count = plural(len(plan.paths), "motion")
    lines = [f"{name}: {count}{chosen}{as_it_stands(plan.worlds[0].scene)}"]

    for number, (stage, path, world) in enumerate(zip(plan.stages, plan.paths, plan.worlds, strict=True)):
        names = ", ".join(item.name for item in world.scene.attached)
        proven = "not valid" if number in wrong else "proven free" if path.proven else "checked in steps"
        held = f", holds {names}" if names else ""
        lines.append(f"  {number + 1} {stage}: {len(path.waypoints)} waypoints, {proven}{held}")
    return [*lines, *(f"note: {note}" for note in plan.notes)]


def _timed(plan: TaskPlan, file: Path, share: float, pause: float) -> tuple[float, Path | None]:
    """Time a task and save its trajectory; return its duration [s], and the file of commands to the gripper, if any."""
    from rrtik_ompl import RateLimits
    from rrtik_ompl.motion.trajectory.text import ROS_JSON, written_ending

    with progress("timing"):
        timed = plan.time_parameterize(RateLimits.of(plan.worlds[0].robot, share=share), pause=pause)

    commands = None
    ending = written_ending(file)
    if timed.trajectory.gripper and ending in (ROS_JSON, ".yaml"):
        commands = file.with_name(f"{file.name[: -len(ending)]}.gripper{file.suffix.lower()}")
    timed.trajectory.save(file, gripper=commands)
    return timed.trajectory.duration, commands

"""Build one self-contained HTML file: meshcat's script, the recorded picture, and our own panel and player."""

from __future__ import annotations

import base64
import html
import json
import warnings
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any

from numpy.typing import ArrayLike

from rrtik_ompl.base.errors import InputError, PictureWarning
from rrtik_ompl.model.transitions import single_joint
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.tasks.played import PlayedTask
from rrtik_ompl.viewer.drawing.framing import Frame
from rrtik_ompl.viewer.drawing.marks import Mark
from rrtik_ompl.viewer.drawing.meshes import drawn_coarser
from rrtik_ompl.viewer.page_fixed import packed
from rrtik_ompl.viewer.page_planner import page_planner
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.search_story import joint_space, search_story, search_tree_of
from rrtik_ompl.viewer.still import first_picture
from rrtik_ompl.viewer.story import play_pace, story_of
from rrtik_ompl.viewer.subject import Showable, ShownPath, Subject
from rrtik_ompl.viewer.task_story import subject_asked
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

# The page may run only its own script, and send no request to other machines.
# WebAssembly may be compiled; text must not be evaluated as script.
SCRIPT_POLICY = "script-src 'unsafe-inline' 'wasm-unsafe-eval'"
POLICY = f"default-src 'none'; {SCRIPT_POLICY}; style-src 'unsafe-inline'; img-src data: blob:"
ASKING_POLICY = f"{POLICY}; connect-src 'self'"  # for a page that may send requests to its own server
SCRIPTS = (
    "kinematics.js",
    "stage.js",
    "tree.js",
    "panel.js",
    "replay.js",
    "clearance.js",
    "contacts.js",
    "solutions.js",
    "player.js",
    "camera.js",
    "shots.js",
)
SMALL_PICTURE = 560, 350  # [px]; of the first view, for browsers without WebGL
BOX_SHARE = 0.1  # side of an added box, as a share of the arm's diagonal
WITH_SEARCH = tuple(each for name in SCRIPTS for each in ((name, "search.js") if name == "panel.js" else (name,)))
STARTING = ("unpack.js", "start.js")
KERNELS = ("kernels.js", "obstacles.js", "fixed.js")
PLANNING = (
    "moves.js",
    "shapes.js",
    "saving.js",
    "opening.js",
    "opinion.js",
    "planner.js",
    "running.js",
    "reaching.js",
    "handles.js",
    "dragging.js",
    "controls.js",
)


def page(
    shown: Showable,
    path: ShownPath | PlayedTask | None = None,
    *,
    before: ShownPath | None = None,
    ghosts: ArrayLike | None = None,
    marks: Sequence[Mark] = (),
    run: ReplanRun | None = None,
    tree: object = None,
    title: str | None = None,
    still: bool = False,
    asks: bool = False,
) -> str:
    """Return the page that shows something, as the text of one HTML file that needs no other file and no network.

    The same input gives the same text.

    Args:
        shown: A ``Problem``, ``World``, ``Robot`` or ``Scene``.
        path: A ``JointPath``, or waypoints of shape (k, dof) [rad or m]; a ``PlayedTask`` with the first of its worlds.
        before: Another path for comparison; the trail of its tip is drawn, too.
        ghosts: Configurations drawn transparently, shape (k, dof).
        marks: Further bodies.
        run: A run to replay instead of a path; obstacles are where they were in it.
        tree: A ``SearchTree`` or ``Roadmap`` that is drawn, and grows.
        title: Heading; None derives it from the name of the problem or robot.
        still: Whether to leave out the planner of the page.
        asks: Whether the page asks its server about each path that it finds.

    Raises:
        InputError: If the input cannot be shown, or if the page shall ask but cannot plan.
    """
    text, _ = page_and_picture(
        shown,
        path,
        before=before,
        ghosts=ghosts,
        marks=marks,
        run=run,
        tree=tree,
        title=title,
        still=still,
        asks=asks,
        picture=False,
    )
    return text


def page_and_picture(
    shown: Showable,
    path: ShownPath | PlayedTask | None = None,
    *,
    before: ShownPath | None = None,
    ghosts: ArrayLike | None = None,
    marks: Sequence[Mark] = (),
    run: ReplanRun | None = None,
    tree: object = None,
    title: str | None = None,
    still: bool = False,
    asks: bool = False,
    picture: bool = True,
) -> tuple[str, bytes]:
    """Return a page as :func:`page` does, and a picture of its first view as a PNG, empty if none is asked for."""
    subject = subject_asked(shown, path, run, before, ghosts, marks)
    grown = search_tree_of(tree, subject.robot)
    recording, frame = draw(subject)
    coarser = drawn_coarser(subject.scene)
    if coarser:
        warnings.warn(f"{subject.name}: {coarser}", PictureWarning, stacklevel=3)
    first_view = first_picture(subject, recording, frame) if picture else b""
    # For a browser without WebGL; a notebook has the large one beside the page.
    small = b"" if picture else first_picture(subject, recording, frame, SMALL_PICTURE, 1.0)
    heading = _title(subject) if title is None else title

    told = story_of(subject, frame, heading, subject.name if title is None else "")
    told["coarser"] = coarser
    told["plan"] = None if still else _planning(shown, subject, frame)

    if asks and (not told["plan"] or told["plan"]["courses"]):
        raise InputError(f"{subject.name}: its page cannot plan: {_why_not(shown, subject)}; rrtik show draws it")
    if told["plan"]:
        told["plan"]["asks"] = asks

    world = getattr(shown, "world", shown)
    joints = joint_space(subject, world if isinstance(world, World) else None, grown)
    search = {"tree": None if grown is None else search_story(grown), "joints": joints}
    scripts = SCRIPTS if grown is None and joints is None else WITH_SEARCH

    story = json.dumps(told, allow_nan=False, separators=(",", ":"))
    text = Template(asset("page.html")).substitute(
        title=html.escape(heading),
        policy=html.escape(ASKING_POLICY if asks else POLICY),
        style=asset("page.css"),
        picture=base64.b64encode(small).decode("ascii"),
        notice=_meshcat("main.min.js.LICENSE.txt").replace("--", "- -"),
        meshcat=_packed_engine(),
        story=story.replace("<", "\\u003c"),  # escaped, so that no name can close the script element
        commands=packed(json.dumps([base64.b64encode(each).decode("ascii") for each in recording.commands]).encode()),
        kernels=_packed_scripts(KERNELS if told["plan"] else ()),
        search=packed(json.dumps(search, allow_nan=False, separators=(",", ":")).encode()),
        script=_packed_scripts(scripts + (PLANNING if told["plan"] else ())),
        start="\n".join(asset(name) for name in STARTING),
    )
    return text, first_view


def _planning(shown: Showable, subject: Subject, frame: Frame) -> dict[str, Any] | None:
    """Return the data with which the page plans by itself; None if it cannot, or if there is nothing to plan."""
    plain = subject.run is None and subject.times is None
    if not isinstance(shown, Problem) or subject.end is None or not plain:
        return None

    one_joint = subject.is_path and bool(single_joint(subject.waypoints))
    found = page_planner(shown, subject.end, BOX_SHARE * frame.arm, whole=frame.size, one_joint=one_joint)
    return None if found is None else found | play_pace(shown.robot, frame.arm)


def _why_not(shown: Showable, subject: Subject) -> str:
    """Return why a page cannot plan and let each path be proven."""
    if getattr(shown, "constraints", ()):
        return "it has path constraints, for which the page has no kernels"
    if isinstance(shown, Problem) and any(each.motion is not None for each in shown.world.scene.obstacles):
        return "it has obstacles that move"
    if subject.end is None:
        return "its goal is not of joint values; give a path to it"
    return "kernels check no joints of such ranges, or there are no kernels"


def _title(subject: Subject) -> str:
    if not subject.is_path:
        return subject.name
    if subject.run is not None:
        return f"{subject.name}: {subject.run.planner}, {subject.run.outcome}"
    if subject.times is not None:
        return f"{subject.name}: motion of {subject.times[-1]:.2f} s"

    moves = len(subject.waypoints) - 1
    return f"{subject.name}: path of {moves} move{'' if moves == 1 else 's'}"


@cache
def asset(name: str) -> str:
    """Return the text of one of the page's own files."""
    return files("rrtik_ompl.viewer").joinpath("assets", name).read_text(encoding="utf-8")


@cache
def _meshcat(name: str) -> str:
    """Return a file of meshcat's viewer, found without importing meshcat, which would take a second."""
    spec = find_spec("meshcat")
    folders = [] if spec is None else list(spec.submodule_search_locations or ())
    if not folders:
        raise InputError("the page needs the viewer of meshcat: pip install meshcat")
    return Path(folders[0], "viewer", "dist", name).read_text(encoding="utf-8")


@cache
def _packed_engine() -> str:
    return packed(_meshcat("main.min.js").encode("utf-8"))


@cache
def _packed_scripts(names: tuple[str, ...]) -> str:
    return packed("\n".join(['"use strict";', *map(asset, names)]).encode("utf-8"))

"""What a caller asks to see: a plan, or the plan of a task, stands for its problem with its motion."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.search_tree import SearchTree
from rrtik_ompl.planning.outcome import Plan
from rrtik_ompl.planning.search.roadmap import Roadmap
from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.tasks.played import PlayedTask
from rrtik_ompl.viewer.subject import Showable, ShownPath

Asked: TypeAlias = Showable | Plan | TaskPlan
AskedPath: TypeAlias = ShownPath | TaskPlan | PlayedTask
AskedTree: TypeAlias = SearchTree | Roadmap | bool


class Parts(NamedTuple):
    """The parts of what is asked for.

    Attributes:
        shown: A problem, world, robot or scene.
        path: What is played, or None.
        before: A path for comparison, or None.
        tree: A tree that is drawn, or None.
    """

    shown: Showable
    path: ShownPath | PlayedTask | None
    before: ShownPath | None
    tree: SearchTree | Roadmap | None


def parts_of(
    shown: Asked, path: AskedPath | None = None, before: ShownPath | None = None, tree: AskedTree | None = None
) -> Parts:
    """Return the parts of what is asked for; see :func:`rrtik_ompl.view`.

    Raises:
        InputError: If a plan comes with a second path, without its problem, or without the tree that is asked for.
    """
    own = shown.tree if isinstance(shown, Plan) else None
    if tree is True and own is None:
        raise InputError("tree to show: there is none; plan(problem, tree=True) keeps it, where the planner has one")
    drawn = own if tree is None else tree
    if isinstance(drawn, bool):
        drawn = own if drawn else None

    if isinstance(shown, Plan | TaskPlan) and path is not None:
        raise InputError(f"path to show: a {type(shown).__name__} has its own; give the problem in its place")
    if isinstance(shown, TaskPlan):
        return Parts(shown.worlds[0], shown.played(), before, drawn)
    if isinstance(shown, Plan):
        if shown.problem is None:
            raise InputError("plan to show: it came from another process without its problem: give that and plan.path")
        return Parts(shown.problem, shown.path, shown.unshortened if before is None else before, drawn)
    return Parts(shown, path.played() if isinstance(path, TaskPlan) else path, before, drawn)

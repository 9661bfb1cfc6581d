"""The judge of runs, as the tests use it."""

from __future__ import annotations

from rrtik_ompl.model.scene import Scene
from rrtik_ompl.replanning.feed import Feed
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.world.problem import Problem


def judged(
    run: ReplanRun, problem: Problem, truth: Scene | Feed | None = None, *, may_touch: bool = False
) -> ReplanRun:
    """The run, in which nothing touches (or only where that may be), and proven moves keep what they have to."""
    found = run.violations(problem, truth)
    if may_touch:
        found = tuple(each for each in found if each.proven)
    assert found == (), "\n".join(str(each) for each in found[:9])
    return run

"""Search for choices with which a whole task works: the farthest branch first, of these the shortest; backtracking.

Straight lines are followed at once, for they decide most; motions between postures are planned when all else fits.
"""

from __future__ import annotations

import heapq
from collections import Counter
from dataclasses import dataclass
from itertools import count

import numpy as np

from rrtik_ompl.base.arrays import TAU, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import ProblemError
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.planning.plan import plan_counted
from rrtik_ompl.tasks.branches import Branch, Expander, again
from rrtik_ompl.tasks.contact_life import MotionContact, lived
from rrtik_ompl.tasks.program import Step
from rrtik_ompl.tasks.setting import world_of_motion
from rrtik_ompl.tasks.stages import MoveTo
from rrtik_ompl.world.kept_clearance import CLEARANCE, proved, proved_as_clear
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

FIRST_ITERATIONS = 4_000  # of each planner for a motion between postures; four times as much in each further round
GROWTH = 4
LEAST_SECONDS = 1e-3  # for one of them
ROUNDS = 8
NAMED = 6  # stages whose failures a reason names
MOST_WORDS = 300  # letters of one failure


@dataclass(frozen=True, slots=True, eq=False)
class Done:
    """The branch that has done the whole task, and the motions on its way, with their paths and contacts."""

    last: Branch
    motions: tuple[tuple[Branch, JointPath], ...]
    contacts: tuple[tuple[MotionContact, ...], ...]


class TaskSearch:
    """One search.

    Args:
        budget: Time, and the seed of everything random.
    """

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._out_of_time = False
        self._expander = Expander(np.random.default_rng(budget.seed), budget.seed)
        self._open: list[tuple[int, float, int, Branch]] = []  # a heap: what is popped is the smallest
        self._numbers = count()
        self._ways: dict[int, JointPath] = {}  # of motions between postures, by their branches
        self._contacts: dict[int, tuple[MotionContact, ...]] = {}  # that they stand on
        self._blocked: set[int] = set()  # motions that were not found in this round
        self._late: list[Branch] = []  # what hangs on these

    def run(self, start: Branch) -> Done | None:
        """What does the whole task; None if no choices work."""
        self._push(start)
        for effort in range(ROUNDS):
            found = self._round(effort)
            if found is not None or self._out_of_time:
                return found

            waiting = self._late
            self._late = []
            self._blocked.clear()
            failed = [branch for branch, _, _ in self._expander.failures] if effort == 0 else []
            for branch in (*waiting, *failed):
                self._push(again(branch, effort + 1))
            for branch in self._expander.more():
                self._push(branch)
            if not self._open:
                return None
        return None

    def reason(self) -> str:
        """Why nothing was found: what failed, the farthest stage first, and how often."""
        failures = self._expander.failures
        texts: dict[str, tuple[Step, Counter[str]]] = {}
        for _, step, text in failures:
            texts.setdefault(step.number, (step, Counter()))[1][text] += 1

        order = sorted(texts.values(), key=lambda item: [int(n) for n in item[0].number.split(".")], reverse=True)
        parts = []
        for step, reasons in order[:NAMED]:
            text, _ = reasons.most_common(1)[0]
            times = reasons.total()
            short = text if len(text) <= MOST_WORDS else text[:MOST_WORDS] + "..."
            parts.append(f"{step} failed" + (f" {times} times, for instance: " if times > 1 else ": ") + short)

        late = ["out of time before all choices were tried"] if self._out_of_time else []
        return "; ".join([*late, *parts]) or "no choice of alternatives and configurations works"

    def _round(self, effort: int) -> Done | None:
        while self._open:
            if self._budget.over():
                self._out_of_time = True
                return None
            branch = heapq.heappop(self._open)[-1]
            if any(id(link) in self._blocked for link in branch.chain()):
                self._late.append(branch)
            elif branch.rest:
                for following in self._expander.after(branch):
                    self._push(following)
            elif self._expander.ends(branch):
                motions = self._motions(branch, effort)
                if motions is not None:
                    contacts = tuple(self._contacts.get(id(link), link.contacts) for link, _ in motions)
                    return Done(branch, tuple(motions), contacts)
        return None

    def _push(self, branch: Branch) -> None:
        heapq.heappush(self._open, (-branch.done, branch.cost, next(self._numbers), branch))

    def _motions(self, branch: Branch, effort: int) -> list[tuple[Branch, JointPath]] | None:
        """The motions of a branch that has done everything, those between postures planned; None if one fails."""
        found: list[tuple[Branch, JointPath]] = []
        for link in branch.chain():
            if link.moves and id(link) not in self._ways and not self._plan(link, effort):
                self._blocked.add(id(link))
                self._late.append(branch)
                return None
            path = self._ways.get(id(link), link.path)
            if path is not None:
                found.append((link, _begun_at(found[-1][1].end, path, link) if found else path))
        return found

    def _plan(self, link: Branch, effort: int) -> bool:
        """Find the way of a motion between postures."""
        before = link.before
        world = link.setting.world
        assert before is not None, "it comes after another"
        assert link.step is not None, "it has done one"
        kept = link.step.stage.constraints if isinstance(link.step.stage, MoveTo) else ()

        try:
            problem = Problem(world, before.q, link.q, name=f"stage {link.step.number}", constraints=kept)
        except ProblemError as error:
            self._failed(link, str(error))
            return False

        if problem.world.motion_proven(before.q, link.q):
            straight = JointPath.of(world.robot, np.stack([before.q, link.q]))
            if self._kept(link, proved_as_clear(straight, problem.world, CLEARANCE), effort):
                return True

        path = self._found(problem, link, effort)
        return path is not None and self._kept(link, path, effort)

    def _found(self, problem: Problem, link: Branch, effort: int) -> JointPath | None:
        """A path of a problem that a motion poses; why there is none is noted."""
        left = max(self._budget.left, LEAST_SECONDS)
        made = plan_counted(problem, Budget(self._budget.seed, left, FIRST_ITERATIONS * GROWTH**effort))
        if made.path is None:
            self._failed(link, made.reason)
        return made.path

    def _from_parting(self, link: Branch, world: World, q: Vector, goal: Vector, effort: int) -> JointPath | None:
        """A way on from where two have parted to the goal of a motion, both of shape (dof,)."""
        try:
            return self._found(Problem(world, q, goal), link, effort)
        except ProblemError as error:
            self._failed(link, str(error))
            return None

    def _failed(self, link: Branch, reason: str) -> None:
        """Note why the way of a motion between postures was not found."""
        assert link.before is not None, "it comes after another"
        assert link.step is not None, "it has done one"
        self._expander.failures.append((link.before, link.step, reason))

    def _kept(self, link: Branch, path: JointPath, effort: int) -> bool:
        """Keep the way of a motion; if what has parted on it touches again, another one is planned from there."""
        assert link.step is not None, "it has done one"

        setting = link.setting
        if setting.scene.contacts:
            world = world_of_motion(path, setting.world, link.step.stage)
            done = lived(path, world, setting.named, link.arriving)
            if done.world is not None:
                rest = self._from_parting(link, done.world, done.path.end, path.end, effort)
                if rest is None:
                    return False
                whole = proved(path_through(path, np.vstack([done.path.waypoints, rest.waypoints[1:]])), world)
                done = lived(whole, world, setting.named, link.arriving)
            if done.fault:
                self._failed(link, done.fault)
                return False
            path = done.path
            self._contacts[id(link)] = done.contacts

        self._ways[id(link)] = path
        return True


def _begun_at(q: Vector, path: JointPath, link: Branch) -> JointPath:
    """The path of a branch from q, shape (dof,), where the one before ended: perhaps whole turns of joints away.

    A plan may reach its goal the other way round of a continuous joint.
    """
    away = q - path.start
    if not away.any():
        return path
    assert link.step is not None, "it has done one"
    turned = path_through(path, np.vstack([q, path.waypoints[1:] + TAU * np.round(away / TAU)]))
    clearance = CLEARANCE if path.proof is None else path.proof.clearance
    return proved_as_clear(turned, world_of_motion(turned, link.setting.world, link.step.stage), clearance)

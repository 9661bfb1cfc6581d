"""Search for choices with which a whole task works, by best-first search with backtracking.

The branch with most stages done is expanded first, among these the shortest. Straight lines are followed at once, as
they exclude most choices; motions between configurations are planned when everything else fits.
"""

from __future__ import annotations

import heapq
from collections import Counter
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from rrtik_ompl.base.arrays import TAU, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import ProblemError
from rrtik_ompl.description.catalog import AUTO
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.planning.outcome import Request
from rrtik_ompl.planning.plan import planned
from rrtik_ompl.planning.short_path import short_path
from rrtik_ompl.tasks.branches import Branch, Expander
from rrtik_ompl.tasks.contact_life import MotionContact, follow_contacts
from rrtik_ompl.tasks.program import Step
from rrtik_ompl.tasks.setting import world_of_motion
from rrtik_ompl.tasks.stages import MoveTo
from rrtik_ompl.world.clearances import CLEARANCE, proved, proved_as_clear
from rrtik_ompl.world.problem import Problem, known_problem
from rrtik_ompl.world.world import World

# Iterations of each planner for a motion between configurations; GROWTH times as many in each further round.
FIRST_ITERATIONS = 4_000
GROWTH = 4
LEAST_SECONDS = 1e-3  # [s] least time for such a motion
ROUNDS = 8
MOST_FAILURES = 24  # failed steps after which the first round ends: more effort in some of them may do
NAMED = 6  # most stages whose failures a reason names
MOST_WORDS = 300  # most letters of one failure


@dataclass(frozen=True, slots=True, eq=False)
class Done:
    """The last branch of a completed task, and for each motion on the way its branch, its path and its contacts."""

    last: Branch
    motions: tuple[tuple[Branch, JointPath], ...]
    contacts: tuple[tuple[MotionContact, ...], ...]


class TaskSearch:
    """The search for one task.

    Args:
        budget: The time limit, and the seed of all random numbers.
    """

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._out_of_time = False
        self._expander = Expander(np.random.default_rng(budget.seed), budget.seed)

        # A heap of branches to expand: those with most stages done first, then the shortest, then the oldest.
        self._queue: list[tuple[int, float, int, Branch]] = []
        self._numbers = count()

        # Path and contacts of planned motions between configurations, by the id of their branch.
        self._paths: dict[int, JointPath] = {}
        self._contacts: dict[int, tuple[MotionContact, ...]] = {}

        # Ids of branches whose motion was not found in this round, and the branches that depend on such motions.
        self._motions_not_found: set[int] = set()
        self._waiting: list[Branch] = []

        # Number of failures after which branches have been tried again.
        self._retried = 0

        # Counts: rounds, branches that were expanded, motions between configurations for which a path was looked for.
        self._rounds = 0
        self._expanded = 0
        self._motions = 0

    @property
    def statistics(self) -> dict[str, int]:
        """Numbers of rounds, expanded branches, motions that were planned, and steps that failed."""
        return {
            "rounds": self._rounds,
            "branches": self._expanded,
            "motions_planned": self._motions,
            "failures": len(self._expander.failures),
        }

    def run(self, start: Branch) -> Done | None:
        """Search for choices with which the whole task works; None if there are none.

        Each round allows more effort than the one before: it retries the branches whose motions were not found, or
        that have failed, and continues with further configurations of the goals.
        """
        self._push(start)
        for effort in range(ROUNDS):
            self._rounds += 1
            done = self._run_round(effort)
            if done is not None or self._out_of_time:
                return done

            waiting = self._waiting
            self._waiting = []
            self._motions_not_found.clear()
            for branch in (*waiting, *self._failed_at_first()):
                self._push(replace(branch, effort=effort + 1))
            for branch in self._expander.more():
                self._push(branch)
            if not self._queue:
                return None
        return None

    def reason(self) -> str:
        """Return why nothing was found: which steps failed, the latest stage first, how often, and for example why."""
        failures = self._expander.failures
        failures_of_step: dict[str, tuple[Step, Counter[str]]] = {}
        for _, step, reason in failures:
            text = reason if isinstance(reason, str) else reason()
            failures_of_step.setdefault(step.number, (step, Counter()))[1][text] += 1

        latest_first = sorted(
            failures_of_step.values(),
            key=lambda item: [int(number) for number in item[0].number.split(".")],
            reverse=True,
        )
        sentences = []
        for step, reasons in latest_first[:NAMED]:
            text, _ = reasons.most_common(1)[0]
            count = reasons.total()
            shortened = text if len(text) <= MOST_WORDS else text[:MOST_WORDS] + "..."
            repeated = f" {count} times, for instance: " if count > 1 else ": "
            sentences.append(f"{step} failed{repeated}{shortened}")

        time_note = ["out of time before all choices were tried"] if self._out_of_time else []
        return "; ".join([*time_note, *sentences]) or "no choice of alternatives and configurations works"

    def _run_round(self, effort: int) -> Done | None:
        """Expand branches until one has done the whole task; None if none is left, the time is up, or too many fail."""
        while self._queue or self._expander.put_off:
            if not self._queue:
                for branch in self._expander.take_up():
                    self._push(branch)
            if self._budget.over():
                self._out_of_time = True
                return None
            if effort == 0 and len(self._expander.failures) >= MOST_FAILURES:
                return None
            branch = heapq.heappop(self._queue)[-1]
            self._expanded += 1
            if any(id(link) in self._motions_not_found for link in branch.chain()):
                self._waiting.append(branch)
            elif branch.rest:
                for following in self._expander.after(branch):
                    self._push(following)
            elif self._expander.ends(branch):
                motions = self._plan_motions(branch, effort)
                if motions is not None:
                    contacts = tuple(self._contacts.get(id(link), link.contacts) for link, _ in motions)
                    return Done(branch, tuple(motions), contacts)
        return None

    def _failed_at_first(self) -> list[Branch]:
        """Return the branches that have failed since the last round, in their order, and had not failed before."""
        failures = self._expander.failures[self._retried :]
        self._retried = len(self._expander.failures)
        return [branch for branch, _, _ in failures if branch.effort == 0]

    def _push(self, branch: Branch) -> None:
        heapq.heappush(self._queue, (-branch.done, branch.cost, next(self._numbers), branch))

    def _plan_motions(self, branch: Branch, effort: int) -> list[tuple[Branch, JointPath]] | None:
        """Plan the motions between configurations of a branch that has done all steps.

        Returns:
            All motions of the branch with their paths; None if one was not found, in which case the branch waits for
            the next round.
        """
        motions: list[tuple[Branch, JointPath]] = []
        for link in branch.chain():
            if link.moves and id(link) not in self._paths and not self._plan_motion(link, effort):
                self._motions_not_found.add(id(link))
                self._waiting.append(branch)
                return None
            path = self._paths.get(id(link), link.path)
            if path is not None:
                motions.append((link, _moved_to_start(motions[-1][1].end, path, link) if motions else path))
        return motions

    def _plan_motion(self, link: Branch, effort: int) -> bool:
        """Plan a motion between configurations, store its path and contacts, and return whether one was found.

        The straight motion is tried first.
        """
        self._motions += 1
        before = link.before
        world = link.setting.world
        assert before is not None, "it comes after another"
        assert link.step is not None, "it has done one"
        constraints = link.step.stage.constraints if isinstance(link.step.stage, MoveTo) else ()

        name = f"stage {link.step.number}"
        is_constrained = bool(constraints) or world.constraints is not None
        proven = not is_constrained and world.motion_proven(before.q, link.q)
        if proven:  # and so are its ends
            problem = known_problem(world, before.q, link.q, name=name)
        else:
            try:
                problem = Problem(world, before.q, link.q, name=name, constraints=constraints)
            except ProblemError as error:
                self._note_failure(link, str(error))
                return False
            # Its world has the constraints, placed as seen from the start.
            proven = is_constrained and problem.world.motion_proven(before.q, link.q)

        if proven:
            straight = JointPath.of(world.robot, np.stack([before.q, link.q]))
            if self._accept_path(link, proved_as_clear(straight, problem.world, CLEARANCE), effort):
                return True

        path = self._path_of(problem, link, effort)
        return path is not None and self._accept_path(link, path, effort)

    def _path_of(self, problem: Problem, link: Branch, effort: int) -> JointPath | None:
        """Plan a path for a motion's problem; if there is none, note the reason and return None."""
        seconds = max(self._budget.left, LEAST_SECONDS)
        short = short_path(problem, Request(Budget(self._budget.seed, seconds)), pull=True)
        if short is not None and short.path is not None:
            return short.path

        # Limited by iterations too, so that the result depends on the seed alone.
        budget = Budget(self._budget.seed, seconds, FIRST_ITERATIONS * GROWTH**effort)
        result = planned(problem, AUTO, Request(budget))
        if result.path is None:
            self._note_failure(link, result.reason)
        return result.path

    def _path_from_parting(self, link: Branch, world: World, q: Vector, goal: Vector, effort: int) -> JointPath | None:
        """Plan a path from the place where two things have parted to the goal of a motion, both of shape (dof,)."""
        try:
            return self._path_of(Problem(world, q, goal), link, effort)
        except ProblemError as error:
            self._note_failure(link, str(error))
            return None

    def _note_failure(self, link: Branch, reason: str) -> None:
        """Note why the path of a motion between configurations was not found."""
        assert link.before is not None, "it comes after another"
        assert link.step is not None, "it has done one"
        self._expander.failures.append((link.before, link.step, reason))

    def _accept_path(self, link: Branch, path: JointPath, effort: int) -> bool:
        """Store the path of a motion and its contacts; if things touch again, replan from where they had parted.

        Args:
            link: The branch of the motion.
            path: The path from the branch before to this one's configuration.
            effort: Round of the search, for a path that is planned anew.

        Returns:
            Whether a path is stored; if not, the reason is noted.
        """
        assert link.step is not None, "it has done one"

        setting = link.setting
        if setting.scene.contacts:
            world = world_of_motion(path, setting.world, link.step.stage)
            followed = follow_contacts(path, world, setting.grasp_pairs, link.arriving, setting.worlds)
            # The path now ends where two things have parted that would touch again later.
            if followed.world is not None:
                detour = self._path_from_parting(link, followed.world, followed.path.end, path.end, effort)
                if detour is None:
                    return False
                joined = proved(path_through(path, np.vstack([followed.path.waypoints, detour.waypoints[1:]])), world)
                followed = follow_contacts(joined, world, setting.grasp_pairs, link.arriving, setting.worlds)
            if followed.fault:
                self._note_failure(link, followed.fault)
                return False
            path = followed.path
            self._contacts[id(link)] = followed.contacts

        self._paths[id(link)] = path
        return True


def _moved_to_start(q: Vector, path: JointPath, link: Branch) -> JointPath:
    """Shift a path by whole turns of joints so that it begins at q, shape (dof,), where the motion before ended.

    This is needed because a plan may reach its goal in the other direction of a continuous joint.
    """
    difference = q - path.start
    if not difference.any():
        return path
    assert link.step is not None, "it has done one"
    shifted = path_through(path, np.vstack([q, path.waypoints[1:] + TAU * np.round(difference / TAU)]))
    clearance = CLEARANCE if path.proof is None else path.proof.clearance
    return proved_as_clear(shifted, world_of_motion(shifted, link.setting.world, link.step.stage), clearance)

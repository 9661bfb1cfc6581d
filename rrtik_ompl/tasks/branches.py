"""Expand the branches of a task's search by one stage, without planning the motions between configurations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError, ProblemError
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.ik.goal_configurations import GoalSearch
from rrtik_ompl.ik.method_interface import SAME_POSTURE
from rrtik_ompl.ik.near_goals import looked_for, near_goals
from rrtik_ompl.model.goal import PoseGoal, TipGoal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Touching
from rrtik_ompl.planning.tip_motion import DEVIATION, TURN_DEVIATION
from rrtik_ompl.planning.tip_motion.attempts import Attempt, Way, attempt, complete, leanings, path_of
from rrtik_ompl.planning.tip_motion.following import Tolerance, centred, follow
from rrtik_ompl.planning.tip_motion.rails import straight_rail
from rrtik_ompl.tasks.contact_life import MotionContact, follow_contacts, parted
from rrtik_ompl.tasks.finger_motion import finger_motion
from rrtik_ompl.tasks.handling import arrival, handled, may_touch
from rrtik_ompl.tasks.program import Step, options_of
from rrtik_ompl.tasks.setting import Setting
from rrtik_ompl.tasks.stages import Alternatives, Attach, Detach, Gripper, MoveTo, Straight
from rrtik_ompl.world.problem import Problem, known_problem
from rrtik_ompl.world.world import World

Reason: TypeAlias = str | Callable[[], str]  # why a step has failed; a function where it takes long to find out
# Poses are reached to a ten-billionth of a metre, so that what the arm grasps is held alike in all instances of a task.
TOLERANCE = Tolerance(DEVIATION, TURN_DEVIATION, arrived=1e-6)
NEAREST = 6  # configurations at a goal that are tried first, where kernels find them
THOROUGH = 1  # first round of the search in which straight lines are tried in all ways that a redundant arm has


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """A task done up to some place.

    Attributes:
        setting: Robot and scene there; for a motion, those during the motion, with the contacts on which it depends.
        q: Configuration of the arm, shape (dof,).
        rest: The steps that are left to do.
        before: The branch that this one continues; None at the start.
        step: The step that was done in between; None at the start.
        path: The path of a straight line; None for other steps.
        contacts: The contacts on which a straight line depends.
        setting_left: The setting after a motion, without the contacts that have ended; None if none has.
        arriving: Contacts of things that are taken or set down at the end of a motion.
        note: What is uncertain about the fingers' motion; "" if nothing is.
        done: Number of stages done.
        cost: Weighted length of all motions so far [rad; metres count the same].
        chosen: Indices of the alternatives taken.
        effort: Round of the search that made the branch.
    """

    setting: Setting
    q: Vector
    rest: tuple[Step, ...]
    before: Branch | None = None
    step: Step | None = None
    path: JointPath | None = None
    contacts: tuple[MotionContact, ...] = ()
    setting_left: Setting | None = None
    arriving: tuple[Touching, ...] = ()
    note: str = ""
    done: int = 0
    cost: float = 0.0
    chosen: tuple[int, ...] = ()
    effort: int = 0

    def chain(self) -> list[Branch]:
        """Return all branches from the start to this one, without the start."""
        links: list[Branch] = []
        here: Branch | None = self
        while here is not None and here.before is not None:
            links.append(here)
            here = here.before
        return links[::-1]

    @property
    def after(self) -> Setting:
        """Return the setting from the end of this branch on."""
        return self.setting if self.setting_left is None else self.setting_left

    @property
    def moves(self) -> bool:
        """Return whether the branch is a motion whose path has yet to be planned."""
        return self.step is not None and isinstance(self.step.stage, MoveTo)


@dataclass(slots=True, eq=False)
class Choices:
    """The configurations of a goal at one place of the search: those found so far, and the search for more.

    Attributes:
        branch: The branch that continues to the goal.
        problem: The problem to get there.
        search: The search for configurations; the nearest ones may have been found without it.
        arrives: Whether things that are taken or set down there may touch at these configurations.
        more: Whether there may be further configurations.
        rows: The configurations that have become branches, shape (k, dof).
    """

    branch: Branch
    problem: Problem
    search: GoalSearch
    arrives: bool
    more: bool
    rows: Matrix

    def new(self, rows: Matrix) -> Matrix:
        """Return which of some configurations are no branches yet; they become some now. Shapes (k, dof)."""
        known = self.rows
        new = [q for q in rows if not len(known) or (np.abs(known - q).max(axis=1) > SAME_POSTURE).all()]
        self.rows = np.array([*known, *new])
        return self.rows[len(known) :]


@dataclass(slots=True, eq=False)
class Expander:
    """Makes the branches that continue a branch.

    Attributes:
        rng: Random number generator for inverse kinematics.
        seed: Seed of the search along straight lines.
        failures: Failed steps, in order: the branch, the step, and the reason, which is read if the whole task fails.
        choices: Goals of the tip for which more configurations may be found.
        put_off: Branches before goals at which kernels have found nothing, which are searched if nothing else is left.
        put_off_before: Those for which that time has come.
    """

    rng: np.random.Generator
    seed: int
    failures: list[tuple[Branch, Step, Reason]] = field(default_factory=list)
    choices: list[Choices] = field(default_factory=list)
    put_off: list[Branch] = field(default_factory=list)
    put_off_before: list[Branch] = field(default_factory=list)

    def after(self, branch: Branch) -> Iterator[Branch]:
        """Yield the branches that are one step further; if the step fails, there are none, and the reason is noted."""
        step = branch.rest[0]
        rest = branch.rest[1:]
        stage = step.stage

        if isinstance(stage, Straight | Attach | Detach):
            branch = _at_pose(branch)
        try:
            if isinstance(stage, Alternatives):
                for number, row in enumerate(options_of(step)):
                    yield from self.after(replace(branch, rest=(*row, *rest), chosen=(*branch.chosen, number)))
            elif isinstance(stage, MoveTo):
                yield from self._after_move(branch, step, stage)
            elif isinstance(stage, Straight):
                yield from self._after_line(branch, step, stage)
            elif isinstance(stage, Gripper):
                yield from self._after_gripper(branch, step, stage)
            elif isinstance(stage, Attach | Detach):
                yield _following_branch(branch, step, branch.after.after(stage, branch.q), branch.q)
        except (ProblemError, InputError) as error:
            self.failures.append((branch, step, str(error)))

    def more(self) -> Iterator[Branch]:
        """Yield branches to further configurations of goals that occurred before."""
        for choices in self.choices:
            if not choices.search.exhausted:
                choices.search.more()
                yield from self._branches_of_choices(choices, choices.new(choices.search.rows))

    def take_up(self) -> list[Branch]:
        """Return the branches that were put off; their goals will be searched thoroughly."""
        branches = self.put_off
        self.put_off = []
        self.put_off_before += branches
        return branches

    def ends(self, branch: Branch) -> bool:
        """Check whether a branch with nothing left to do may end; if not, the reason is noted.

        After a last stage that changes the setting, the arm must not touch anything.
        """
        if branch.before is None or branch.step is None or branch.after is branch.before.after:
            return True
        touching = branch.after.world.explain(branch.q)
        if touching:
            reason = f"contact after it: {touching}; attach the object, open the gripper, or allow the pair"
            self.failures.append((branch.before, branch.step, reason))
        return not touching

    def _after_gripper(self, branch: Branch, step: Step, stage: Gripper) -> Iterator[Branch]:
        """Yield the branch after the fingers have moved, or note the fault if something is in their way."""
        setting = branch.after.after(stage, branch.q)
        things_taken = [thing.name for thing in handled(branch.rest[1:], setting.robot) if thing.by is not None]
        motion = finger_motion(branch.after, setting, branch.q, things_taken)
        if motion.fault:
            self.failures.append((branch, step, motion.fault))
            return
        yield replace(_following_branch(branch, step, _without_parted(setting, branch.q), branch.q), note=motion.note)

    def _after_move(self, branch: Branch, step: Step, stage: MoveTo) -> Iterator[Branch]:
        """Yield a branch for each configuration of a goal.

        Contacts at the goal, of things that are taken or set down there, are only allowed if no configuration is free
        without them.
        """
        try:
            choices = self._choices(branch, branch.after, stage)
        except ProblemError as error:
            choices = None
            reason: Reason = str(error)

        if choices is None or not len(choices.rows):
            arriving = branch.after.arriving(may_touch(branch.after.bare, branch.rest[1:]))
            if arriving is not branch.after:
                choices = self._choices(branch, arriving, stage)
        if choices is None:
            self.failures.append((branch, step, reason))
            return
        if not len(choices.rows) and self._put_off(branch, choices.problem):
            self.put_off.append(branch)
            return
        if not len(choices.rows):
            self.failures.append((branch, step, choices.search.reason_now()))
        if choices.more:
            self.choices.append(choices)
        yield from self._branches_of_choices(choices, choices.rows)

    def _choices(self, branch: Branch, setting: Setting, stage: MoveTo) -> Choices:
        """Find configurations of a stage's goal in a setting: the nearest ones, if that is quick, else the first."""
        known = self._known_problem(branch.q, setting, stage)
        problem = known or Problem(setting.world, branch.q, stage.goal, constraints=stage.constraints)
        # A plan may reach the goal in either direction of a continuous joint, so whole turns need not be tried.
        search = GoalSearch(problem, self.rng, all_turns=False)
        rows = near_goals(problem, NEAREST)
        if rows is None:
            rows = search.rows if self._put_off(branch, problem) else search.first()
        return Choices(branch, problem, search, setting is not branch.after, problem.goal.q is None, rows)

    def _put_off(self, branch: Branch, problem: Problem) -> bool:
        """Check whether a goal at which kernels find nothing is searched later: another one may do."""
        return branch not in self.put_off_before and looked_for(problem)

    def _known_problem(self, q: Vector, setting: Setting, stage: MoveTo) -> Problem | None:
        """Return the problem of a goal of the tip without constraints, if its start is proven free."""
        world = setting.world
        if not isinstance(stage.goal, TipGoal) or stage.constraints or world.constraints is not None:
            return None
        return known_problem(world, q, stage.goal) if world.motion_proven(q, q) else None

    def _branches_of_choices(self, choices: Choices, rows: Matrix) -> Iterator[Branch]:
        """Yield a branch for each of some configurations of a goal, shape (k, dof)."""
        branch = choices.branch
        ways = weighted_difference(branch.setting.robot, rows.reshape(-1, len(branch.q)), branch.q)
        for q, length in zip(rows, np.linalg.norm(ways, axis=1).tolist(), strict=True):
            arriving = self._arriving(branch, q) if choices.arrives or branch.after.scene.contacts else ()
            setting = branch.after.arriving(arriving)
            lasting = tuple(each for each in branch.after.scene.contacts if not parted(setting.bare, q, each))
            setting_left = setting.with_contacts_only(lasting)
            step = branch.rest[0]
            yield _following_branch(
                branch, step, setting, q, length=length, setting_left=setting_left, arriving=arriving
            )

    def _arriving(self, branch: Branch, q: Vector) -> tuple[Touching, ...]:
        """Return the contacts of things that are taken or set down at the end of a motion to q, shape (dof,)."""
        return arrival(branch.after.bare, branch.rest[1:], q).contacts

    def _after_line(self, branch: Branch, step: Step, stage: Straight) -> Iterator[Branch]:
        """Yield the branch at the end of a straight line of the tip; if it is not reached, the reason is noted."""
        world = branch.after.world
        # The line is proven next, by the tables of the same prover; the checks of collisions need others.
        if not world.motion_proven(branch.q, branch.q) and (touching := world.explain(branch.q)):
            self.failures.append((branch, step, f"it cannot begin: {touching}; move it or allow the pair"))
            return

        line = _line_of(branch, stage, self.seed)
        if line.leads_nowhere(world.robot):
            path_at_rest = JointPath.of(world.robot, branch.q[None]).proved(world)
            yield _following_branch(branch, step, branch.after, branch.q, path_at_rest)
            return

        setting, arriving, attempted, reason = self._follow_line(branch, line)
        if attempted is None:
            self.failures.append((branch, step, reason))
            return

        path = path_of(setting.world, attempted)
        assert path is not None, "it has come to its end"
        followed = follow_contacts(path, setting.world, setting.grasp_pairs, arriving, setting.worlds)
        if followed.fault:
            self.failures.append((branch, step, followed.fault))
            return

        setting_left = setting.with_contacts_only(followed.lasting)
        contacts = followed.contacts
        yield _following_branch(
            branch, step, setting, path.end, followed.path, setting_left=setting_left, contacts=contacts
        )

    def _follow_line(self, branch: Branch, line: Way) -> tuple[Setting, tuple[Touching, ...], Attempt | None, Reason]:
        """Follow a straight line, with contacts at its end only if it cannot be followed without them.

        To find these contacts, the line is first followed without collision checks.

        Returns:
            The setting during the motion, the contacts of things that are taken or set down at the end, the attempt if
            it has come to the end, and why not.
        """
        setting = branch.after
        steps = branch.rest[1:]
        world = setting.world
        attempted: Attempt | None = None
        if not handled(steps, world.robot):
            return setting, (), self._attempt(branch, line, world), partial(_ended, world, branch, line)

        unchecked = follow(world.robot, line.rails[0], branch.q, line.tolerance, centred(world.robot))
        end = unchecked.rows[-1]
        free_at_end = not unchecked.complete or world.motion_proven(end, end)
        looked_at = free_at_end or branch.effort >= THOROUGH
        if looked_at:
            attempted = self._attempt(branch, line, world)
            if attempted is not None:
                arriving = self._arriving(branch, attempted.rows[-1]) if setting.scene.contacts else ()
                return setting.arriving(arriving), arriving, attempted, ""
            if not unchecked.complete:
                return setting, (), None, partial(_ended, world, branch, line)

        reached = arrival(world, steps, end)
        if reached.contacts and not reached.fault:
            setting = setting.arriving(reached.contacts)
            attempted = self._attempt(branch, line, setting.world)
        elif not looked_at:
            attempted = self._attempt(branch, line, world)
        arriving = () if reached.fault else reached.contacts
        return setting, arriving, attempted, partial(_ended, setting.world, branch, line, reached.fault)

    def _attempt(self, branch: Branch, line: Way, world: World) -> Attempt | None:
        """Follow a line to its end in a world: in later rounds of the search in all ways that a redundant arm has."""
        usual = [centred(world.robot)]
        ways_to_lean = leanings(world, line, branch.q) if branch.effort >= THOROUGH else usual
        return complete(world, line, branch.q, ways_to_lean)


def _without_parted(setting: Setting, q: Vector) -> Setting:
    """Return a setting without the contacts of things that are apart at q, shape (dof,), as fingers have let go."""
    lasting = tuple(
        each for each in setting.scene.contacts if each.pair in setting.grasp_pairs or not parted(setting.bare, q, each)
    )
    return setting.with_contacts_only(lasting)


def _ended(world: World, branch: Branch, line: Way, fault: str = "") -> str:
    """Return where and why a straight line ends in a world."""
    attempted = attempt(world, line, branch.q, centred(world.robot))
    return f"ends at {100.0 * attempted.fraction:.3g} %: {fault or attempted.reason}"


def _at_pose(branch: Branch) -> Branch:
    """Return a branch whose motion has a pose as its goal with the tip at that pose to the last digits.

    Inverse kinematics ends within a share of the tolerances. So near to the pose, what the arm grasps is held alike in
    all instances of a task.
    """
    step = branch.step
    if step is None or not isinstance(step.stage, MoveTo) or not isinstance(step.stage.goal, PoseGoal):
        return branch
    robot = branch.setting.robot
    rail = straight_rail(robot.fk(branch.q), step.stage.goal.pose)
    followed = follow(robot, rail, branch.q, TOLERANCE, centred(robot))
    return replace(branch, q=followed.rows[-1]) if followed.complete else branch


def weighted_length(robot: Robot, rows: Matrix) -> float:
    """Return the weighted length of the way through configurations, shape (k, dof) [rad; metres count the same]."""
    return float(np.linalg.norm(weighted_difference(robot, rows[1:], rows[:-1]), axis=1).sum())


def _line_of(branch: Branch, stage: Straight, seed: int) -> Way:
    """Return the straight line of the tip for a stage that begins at the end of a branch."""
    tip = branch.after.robot.fk(branch.q)
    return Way((straight_rail(tip, stage.goal(tip)),), TOLERANCE, None, seed)


def _following_branch(
    branch: Branch,
    step: Step,
    setting: Setting,
    q: Vector,
    path: JointPath | None = None,
    *,
    length: float = 0.0,
    setting_left: Setting | None = None,
    arriving: tuple[Touching, ...] = (),
    contacts: tuple[MotionContact, ...] = (),
) -> Branch:
    """Return the branch that continues another one by a step.

    It takes over the rest of the steps, the choices and the effort, and adds the weighted length of the path, or that
    of the straight motion to ``q`` if the path has yet to be planned, to the cost.
    """
    cost = branch.cost + (length if path is None else weighted_length(setting.robot, path.waypoints))

    return Branch(
        setting,
        q,
        branch.rest[1:],
        before=branch,
        step=step,
        path=path,
        contacts=contacts,
        setting_left=setting_left,
        arriving=arriving,
        done=branch.done + 1,
        cost=cost,
        chosen=branch.chosen,
        effort=branch.effort,
    )

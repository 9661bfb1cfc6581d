"""`Task`: several stages of work in a row, planned as a whole: pick and place, drawing a tool out of its holder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, positive, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import require
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.model.judgement import Violation
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.tasks.branches import Branch
from rrtik_ompl.tasks.contact_life import MotionContact as MotionContact
from rrtik_ompl.tasks.contact_life import world_from
from rrtik_ompl.tasks.handling import never_set_down
from rrtik_ompl.tasks.program import check_program, steps_of
from rrtik_ompl.tasks.search import Done, TaskSearch
from rrtik_ompl.tasks.setting import Setting, world_of_motion
from rrtik_ompl.tasks.stages import Alternatives as Alternatives
from rrtik_ompl.tasks.stages import Attach as Attach
from rrtik_ompl.tasks.stages import Detach as Detach
from rrtik_ompl.tasks.stages import Gripper as Gripper
from rrtik_ompl.tasks.stages import MoveTo as MoveTo
from rrtik_ompl.tasks.stages import Stage, checked_stages
from rrtik_ompl.tasks.stages import Straight as Straight
from rrtik_ompl.tasks.standing import standing_faults
from rrtik_ompl.world.problem import usable_configuration
from rrtik_ompl.world.world import World

if TYPE_CHECKING:
    from rrtik_ompl.tasks.played import PlayedTask

SECONDS = 10.0  # [s] that a task may be planned
FAR = 0.05  # [m] between an object and what holds it, from which on that is said


@dataclass(frozen=True, slots=True, eq=False)
class TaskPlan:
    """The outcome of planning a task.

    Attributes:
        found: Whether all of it can be done.
        paths: The motions, each from where the one before ends.
        worlds: The world of each motion: what the arm holds and how far its gripper is open.
        stages: The stage that each motion does.
        chosen: Numbers of the alternatives that were taken, from 0, in their order.
        reason: "" if found, else which stages failed, how often and why.
        end: The world after the last stage, whatever that is; None if it is not found.
        notes: What the author of the task may not have meant, and what it stands on, a line each: an object attached
            from far away, contacts, fingers whose way is not proven.
        contacts: Those that each motion stood on: which things touched, how deep they may overlap, and up to which
            waypoint; from there on the motion is checked without.

    Example:
        >>> loaded = rrtik.load_task("titan4_drawer")
        >>> plan = loaded.task.plan(loaded.world, loaded.start, seed=1)
        >>> plan.found, len(plan.paths) == len(plan.worlds)
        (True, True)
    """

    found: bool
    paths: tuple[JointPath, ...]
    worlds: tuple[World, ...]
    stages: tuple[Stage, ...]
    chosen: tuple[int, ...]
    reason: str
    end: World | None = None
    notes: tuple[str, ...] = ()
    contacts: tuple[tuple[MotionContact, ...], ...] = ()

    __repr__ = in_one_line

    @property
    def proven(self) -> bool:
        """Whether every motion is proven in its own world, on the contacts that it is said to stand on.

        A motion that nobody has tried to prove, as those of a file, is proved when this is asked, each time anew. False
        too if a contact or the place of a thing is not true, see :meth:`violations`.
        """
        if not self.found or any(self._standing_faults()):
            return False
        for path, world, stage in zip(self.paths, self.worlds, self.stages, strict=True):
            proved = path if path.proof is not None else path.proved(world_of_motion(path, world, stage))
            if not proved.proven:
                return False
        return True

    def violations(self) -> tuple[Violation, ...]:
        """Check all motions again, each in its world, and without each contact once that has ended.

        Nor is the plan's word taken for what it stands on. A contact may allow a millimetre more than the two overlap
        where it begins, of which 5 mm count at most if no grasp has named the pair; and all things are where the motion
        before has left them.

        Returns:
            The first violation of every edge that has one, motion after motion; empty for a valid plan.
        """
        return tuple(each for motion in self.faults() for each in motion)

    def faults(self) -> tuple[tuple[Violation, ...], ...]:
        """The violations of each motion, see :meth:`violations`.

        Example:
            >>> loaded = rrtik.load_task("titan4_drawer")
            >>> set(loaded.task.plan(loaded.world, loaded.start, seed=1).faults())
            {()}
        """
        faults_of_motions: list[tuple[Violation, ...]] = []
        contacts = self._stood_on()
        motions = zip(self.paths, self.worlds, self.stages, contacts, self._standing_faults(), strict=True)

        for path, world, stage, stood_on, standing in motions:
            faults = [*standing, *path.violations(world_of_motion(path, world, stage))]
            parting_waypoints = sorted({each.until for each in stood_on if each.until is not None})
            for until in () if standing else parting_waypoints:  # what is not true is no ground for a check
                rest = path.with_waypoints(path.waypoints[until:])
                faults += rest.violations(world_from(world, stood_on, until))
            faults_of_motions.append(tuple(faults))
        return tuple(faults_of_motions)

    def played(self) -> PlayedTask:
        """The plan as a picture plays it: timed by :func:`time_task`, and what is said of it, see :meth:`faults`.

        Raises:
            InputError: If there is no motion.
        """
        from rrtik_ompl.tasks.played import played_task

        return played_task(self)

    def _stood_on(self) -> tuple[tuple[MotionContact, ...], ...]:
        return self.contacts or ((),) * len(self.paths)

    def _standing_faults(self) -> list[list[Violation]]:
        return standing_faults(self.paths, self.worlds, self._stood_on(), self.end)


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """Stages to be done one after the other, each from where the one before ends.

    Attributes:
        stages: `MoveTo`, `Straight`, `Attach`, `Detach`, `Gripper`, `Alternatives`.

    Raises:
        InputError: If there is none, or something else among them.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> post = rrtik.Obstacle("post", rrtik.Box([0.05, 0.05, 0.4]), [0.4, -0.3, 0.2])
        >>> world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene([post]))
        >>> ready = [0.0, -1.6, 1.8, -0.2, 1.6, 0.0]
        >>> task = rrtik.Task([rrtik.MoveTo(ready), rrtik.Straight(by=[0.0, 0.0, 0.1])])
        >>> plan = task.plan(world, "up", seed=1)
        >>> plan.found, len(plan.paths)
        (True, 2)
    """

    stages: tuple[Stage, ...]

    def __init__(self, stages: Sequence[Stage]) -> None:
        object.__setattr__(self, "stages", checked_stages(stages, "task"))

    def plan(self, world: World, start: ArrayLike | str, *, seconds: float = SECONDS, seed: int = 0) -> TaskPlan:
        """Choose alternatives and configurations such that the whole task works, and plan its motions.

        Every motion is collision-free in its own world: straight lines are proven, the others as :func:`plan` has them.

        Args:
            world: Robot and scene at the beginning.
            start: Configuration, shape (dof,), or the name of a posture.
            seconds: Limit of wall time [s].
            seed: The same seed gives the same plan, as long as the time limit does not cut in.

        Raises:
            InputError: If the stages make no sense in this world: something is attached twice, or detached where it is
                not held; the stage is named.
            UnknownNameError: If there is no object, link or posture of a name.
            ProblemError: If the start is in collision or outside the limits.
        """
        require(world, World, "world of a task", "use World(robot, scene)")
        steps = steps_of(self.stages)
        check_program(steps, world)

        given: Any = world.robot.posture(start) if isinstance(start, str) else start
        setting = Setting.beginning(world, world.robot.configuration(given, "start"))
        q = usable_configuration(setting.world, given, "start")
        if reason := never_set_down(steps, setting.world, np.array(q)):
            return TaskPlan(False, (), (), (), (), reason)

        time_limit = positive(seconds, "seconds")
        search = TaskSearch(Budget(whole_number(seed, "seed"), time_limit))
        done = search.run(Branch(setting, np.array(q), steps))
        if done is None:
            return TaskPlan(False, (), (), (), (), search.reason())
        return TaskPlan(
            found=True,
            paths=tuple(path for _, path in done.motions),
            worlds=tuple(branch.setting.world for branch, _ in done.motions),
            stages=tuple(branch.step.stage for branch, _ in done.motions if branch.step is not None),
            chosen=done.last.chosen,
            reason="",
            end=done.last.after.world,
            notes=_notes_of(done),
            contacts=done.contacts,
        )


def _notes_of(done: Done) -> tuple[str, ...]:
    """What is odd about a way: objects attached from far away; and the contacts that its motions stood on."""
    notes = []
    stood_on = {id(branch): contacts for (branch, _), contacts in zip(done.motions, done.contacts, strict=True)}

    for branch in done.last.chain():
        notes += [f"{branch.step}: {branch.note}"] if branch.note else []
        notes += [f"{branch.step} stands on a contact: {each}" for each in stood_on.get(id(branch), ())]
        if branch.before is not None and branch.step is not None and isinstance(branch.step.stage, Attach):
            stage = branch.step.stage
            distance = _gap(branch.before.after.world, branch.q, stage.object, stage.link)
            if distance > FAR:
                text = f"'{stage.object}' is {1e3 * distance:.0f} mm away from '{stage.link}' when it is attached"
                notes.append(f"{branch.step}: {text}")
    return tuple(notes)


def _gap(world: World, q: Vector, name: str, link: str) -> float:
    """Distance of an obstacle from a link and what is rigidly joined with it at q [m]; 0 where these have no solid."""
    robot = world.robot
    bodies = world.bodies
    joint = robot.model.frames[robot.model.getFrameId(link)].parentJoint
    links_joined = [k for k, body in enumerate(bodies) if body.joint == joint and body.name in robot.link_names]
    parts = [k for k, body in enumerate(bodies) if body.name == name]
    pairs = measured(bodies, list(product(links_joined, parts)), robot.joint_frames(q[None])[0], near_only=False)
    return min((pair.distance for pair in pairs), default=0.0)

"""Plan tasks: several stages of work in a row, such as pick and place, whose motions are planned together."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any, TypeVar, overload

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, finite_array, frozen, not_negative, positive, seed_of
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.copies import in_one_line, set_fields
from rrtik_ompl.base.errors import InputError, ProblemError, listed, require
from rrtik_ompl.files.kinds import read, write
from rrtik_ompl.geometry.collision.distances import beyond, measured
from rrtik_ompl.kernels.threads import in_threads
from rrtik_ompl.model.certificate import TaskCertificate
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.judgement import Violation
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.result import required
from rrtik_ompl.tasks.branches import Branch
from rrtik_ompl.tasks.contact_life import MotionContact as MotionContact
from rrtik_ompl.tasks.contact_life import world_from
from rrtik_ompl.tasks.handling import never_set_down
from rrtik_ompl.tasks.program import check_program, steps_of
from rrtik_ompl.tasks.randomness import Displacement as Displacement
from rrtik_ompl.tasks.randomness import Randomness as Randomness
from rrtik_ompl.tasks.search import Done, TaskSearch
from rrtik_ompl.tasks.setting import Setting, placed_constraints, world_of_motion
from rrtik_ompl.tasks.stages import Alternatives as Alternatives
from rrtik_ompl.tasks.stages import Attach as Attach
from rrtik_ompl.tasks.stages import Detach as Detach
from rrtik_ompl.tasks.stages import Gripper as Gripper
from rrtik_ompl.tasks.stages import MoveTo as MoveTo
from rrtik_ompl.tasks.stages import Stage as Stage
from rrtik_ompl.tasks.stages import Straight as Straight
from rrtik_ompl.tasks.stages import checked_regions, checked_stages, holding
from rrtik_ompl.tasks.standing import standing_faults
from rrtik_ompl.tasks.variations import Variation as Variation
from rrtik_ompl.tasks.variations import moved_scene, moved_stages
from rrtik_ompl.tasks.worlds import Left, Worlds, worlds_from
from rrtik_ompl.world.problem import usable_configuration
from rrtik_ompl.world.world import World

if TYPE_CHECKING:
    from rrtik_ompl.model.robot import Robot
    from rrtik_ompl.motion.trajectory.limits import RateLimits
    from rrtik_ompl.tasks.played import PlayedTask
    from rrtik_ompl.tasks.timed import TimedTask

Made = TypeVar("Made")
MOST_INSTANCES = 1_000_000  # in one call
SECONDS = 10.0  # [s] default time limit for planning a task
BLEND = 0.05  # [rad] or [m] default blend of corners
PAUSE = 1.0  # [s] default rest for a gripper or an object
FAR = 0.05  # [m] distance between an object and the link that holds it above which a note says so


@dataclass(frozen=True, slots=True, eq=False)
class TaskPlan:
    """The outcome of planning a task.

    Attributes:
        found: Whether the whole task can be done.
        paths: The motions, each from where the one before ends.
        worlds: The world of each motion, with the objects that the arm holds and the opening of its gripper.
        stages: The stage that each motion does.
        chosen: Indices of the alternatives that were taken, in their order.
        reason: "" if found, otherwise which stages failed, how often and why.
        end: The world after the last stage; None if no plan was found.
        notes: One line for each fact that the author of the task may not have intended, or on which the plan depends:
            an object attached from far away, contacts, fingers whose motion is not proven.
        contacts: For each motion the contacts on which it depends: which things touch, how deep they may overlap, and
            up to which waypoint; from there on the motion is checked without the contact.
        seconds: Wall time of planning [s]; 0 for a plan from a file.
        statistics: Counts of the search; empty for a plan from a file.

    Example:
        >>> plan = rrtik.Task.load("titan4_drawer").plan(seed=1)
        >>> plan.found, len(plan.paths) == len(plan.worlds), plan.path.end.shape
        (True, True, (6,))
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
    seconds: float = 0.0
    statistics: Mapping[str, Any] = field(default_factory=dict)

    __repr__ = in_one_line

    @property
    def proven(self) -> bool | None:
        """Whether every motion is proven free in its own world, with the contacts that the plan states; None without.

        A motion without a proof, such as one from a file, is proved on each access. The answer is False too if a stated
        contact or the place of a thing is not true, see :meth:`violations`.
        """
        if not self.found:
            return None
        return not any(self._standing_faults()) and all(path.proven for path in self._proved_paths())

    @property
    def path(self) -> JointPath | None:
        """The whole motion of the arm, without what is done between its parts; None if there is no plan or motion.

        It is proven if every motion is, each in its own world; motions without a proof are proved on each access.
        """
        if not self.found or not self.paths:
            return None
        whole = _joined(self._proved_paths())
        return whole.with_waypoints(whole.waypoints) if any(self._standing_faults()) else whole

    def require(self) -> JointPath:
        """Return the path of the whole motion.

        Raises:
            NotFoundError: If there is no plan, or no motion in it.

        Example:
            >>> world = rrtik.World(rrtik.load_robot("titan4"))
            >>> rrtik.Task([rrtik.MoveTo("ready"), rrtik.MoveTo("zero")]).plan(world, "zero").require().proven
            True
        """
        return required(self.path, "no motion for the task", self.reason)

    def violations(self) -> tuple[Violation, ...]:
        """Check all motions again, each in its world, and without each contact once it has ended.

        The contacts that the plan states are checked too. A contact may allow at most a millimetre more than the two
        things overlap where it begins, of which at most 5 mm count if no grasp has named the pair; and all things must
        be where the motion before has left them.

        Returns:
            The first violation of every edge that has one, motion after motion; empty for a valid plan.
        """
        return tuple(each for motion in self.faults() for each in motion)

    def faults(self) -> tuple[tuple[Violation, ...], ...]:
        """Return the violations of each motion, see :meth:`violations`.

        Example:
            >>> set(rrtik.Task.load("titan4_drawer").plan(seed=1).faults())
            {()}
        """
        faults_of_motions: list[tuple[Violation, ...]] = []
        contacts = self._stood_on()
        motions = zip(self.paths, self.worlds, self.stages, contacts, self._standing_faults(), strict=True)

        for path, world, stage, stood_on, standing in motions:
            faults = [*standing, *path.violations(world_of_motion(path, world, stage))]
            parting_waypoints = sorted({each.until for each in stood_on if each.until is not None})
            # If stated contacts are not true, checks that depend on them would mean nothing.
            for until in () if standing else parting_waypoints:
                rest = path.with_waypoints(path.waypoints[until:])
                faults += rest.violations(world_from(world, stood_on, until))
            faults_of_motions.append(tuple(faults))
        return tuple(faults_of_motions)

    def certificate(self, clearance: float = 0.0) -> TaskCertificate | None:
        """Certify all motions, each with what is held and what is in contact then; None if one is not proven.

        Path constraints of stages are part of it, motions of fingers between them are not.

        Args:
            clearance: Distance kept from every obstacle on top of its margin [m].

        Example:
            >>> plan = rrtik.Task.load("titan4_drawer").plan(seed=1)
            >>> plan.certificate().save("proof.json")
        """
        from rrtik_ompl.tasks.certified import certificate_of_task

        return certificate_of_task(self, not_negative(clearance, "clearance"))

    def verify(self, certificate: TaskCertificate, *, clearance: float = 0.0) -> str:
        """Verify a certificate of the plan: return its first fault in one line, or "" if it proves all motions free.

        The contacts that the plan states have to be true, and all things where the motion before has left them.

        Args:
            certificate: The certificate; nothing in it is trusted.
            clearance: Least distance that motions have to keep from obstacles on top of their margins [m].
        """
        from rrtik_ompl.tasks.certified import fault_of_task

        require(certificate, TaskCertificate, "certificate", "TaskPlan.certificate() makes one")
        untrue = next((each for motion in self._standing_faults() for each in motion), None)
        fault = "" if untrue is None else untrue.reason
        return fault or fault_of_task(certificate, self, not_negative(clearance, "clearance"))

    def time_parameterize(
        self,
        limits: RateLimits | Robot | None = None,
        *,
        blend: float = BLEND,
        pause: float = PAUSE,
        clearance: float | None = None,
        tip_speed: float | None = None,
        tip_acceleration: float | None = None,
        torque: ArrayLike | bool | None = None,
        payload: float = 0.0,
    ) -> TimedTask:
        """Time the whole task: each motion as :func:`rrtik_ompl.time_parameterize` times it, from rest to rest.

        Args:
            limits: Limits of the joints; None for those of the robot.
            blend: As there; rounded corners are checked in the world of their motion, and keep the constraints of
                their stage.
            pause: How long the arm rests at least where a gripper opens or closes and where an object is taken or put
                down [s]; it rests longer where the fingers do, at the velocity limits of their joints.
            clearance: As there.
            tip_speed: As there.
            tip_acceleration: As there.
            torque: As there.
            payload: As there.

        Raises:
            InputError: If there is no motion, or an option is not valid.

        Example:
            >>> timed = rrtik.Task.load("titan4_drawer").plan(seed=1).time_parameterize(pause=0.5)
            >>> len(timed.begins), bool(timed.trajectory.duration > timed.begins[-1])
            (4, True)
        """
        from rrtik_ompl.tasks.timed import timed_task

        return timed_task(
            self, limits, blend=blend, pause=pause, clearance=clearance, tip_speed=tip_speed,
            tip_acceleration=tip_acceleration, torque=torque, payload=payload,
        )  # fmt: skip

    def played(self) -> PlayedTask:
        """Return the plan as a picture plays it: timed at the robot's limits, with the verdict of :meth:`faults`.

        Raises:
            InputError: If there is no motion.
        """
        from rrtik_ompl.tasks.played import played_task

        return played_task(self)

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the plan to a .json file, whole or not at all.

        Raises:
            InputError: If the plan has no motion, the ending is not .json, or the file cannot be written.

        Example:
            >>> plan = rrtik.Task.load("titan4_drawer").plan(seed=1)
            >>> plan.save("task.json")
            >>> len(rrtik.TaskPlan.load("task.json").paths) == len(plan.paths)
            True
        """
        write(self, file)

    @staticmethod
    def load(file: str | os.PathLike[str], *, trust_xacro: bool = False) -> TaskPlan:
        """Read a plan that :meth:`save` has written.

        Its motions have no proofs; `proven` makes them.

        Args:
            file: A .json file.
            trust_xacro: Whether the macros of a robot's file are trusted, see `load_robot`.

        Raises:
            InputError: If the file is missing, malformed, or its parts do not fit each other.
        """
        return read(TaskPlan, file, trust_xacro=trust_xacro)

    def _proved_paths(self) -> list[JointPath]:
        """Return the paths of the motions; those without a proof are proved."""
        return [
            path if path.proof is not None else path.proved(world_of_motion(path, world, stage))
            for path, world, stage in zip(self.paths, self.worlds, self.stages, strict=True)
        ]

    def _stood_on(self) -> tuple[tuple[MotionContact, ...], ...]:
        return self.contacts or ((),) * len(self.paths)

    def _standing_faults(self) -> list[list[Violation]]:
        return standing_faults(self.paths, self.worlds, self._stood_on(), self.end)


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """Stages to be done one after the other, each from where the one before ends.

    Args:
        stages: `MoveTo`, `Straight`, `Attach`, `Detach`, `Gripper`, `Alternatives`.
        world: Robot and scene at the beginning; a task of a file has its own, others may leave it to :meth:`plan`.
        start: Configuration at the beginning, shape (dof,), or the name of a posture, likewise.
        name: Name used in messages.
        constraints: Regions that a frame must not leave on the way of any `MoveTo`, in addition to those of the stage;
            those ``from_start`` refer to where the task begins.
        random: What is random in the instances of the task that `rrtik_ompl.demos.record` plans; None if nothing is.

    Raises:
        InputError: If there are no stages, or something else is among them.

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
    constraints: tuple[TaskRegion, ...]
    name: str
    random: Randomness | None = field(repr=False)
    _world: World | None = field(repr=False)
    _start: Vector | str | None = field(repr=False)

    def __init__(
        self,
        stages: Iterable[Stage],
        world: World | None = None,
        start: ArrayLike | str | None = None,
        *,
        name: str = "task",
        constraints: Iterable[TaskRegion] = (),
        random: Randomness | None = None,
    ) -> None:
        require(world, World | None, "world of a task", "use World(robot, scene)")
        require(random, Randomness | None, "what is random in a task")
        placed = start if start is None or isinstance(start, str) else frozen(finite_array(start, (None,), "start"))
        set_fields(
            self,
            stages=checked_stages(stages, "task"),
            constraints=checked_regions(constraints, "a task"),
            name=name,
            random=random,
            _world=world,
            _start=placed,
        )

    @property
    def world(self) -> World:
        """Robot and scene at the beginning; an `InputError` if the task has none of its own."""
        if self._world is None:
            raise InputError("task: it has no world of its own; give plan() one, or Task(stages, world, start)")
        return self._world

    @property
    def start(self) -> Vector | str:
        """Configuration or posture at the beginning; an `InputError` if the task has none of its own."""
        if self._start is None:
            raise InputError("task: it has no start of its own; give plan() one, or Task(stages, world, start)")
        return self._start

    @staticmethod
    def load(file: str | os.PathLike[str], *, trust_xacro: bool = False) -> Task:
        """Load a shipped task by name, or a task file, with its world and its start.

        Args:
            file: A name of `list_tasks`, or a file.
            trust_xacro: Whether the macros of a robot's file are trusted, see `load_robot`.

        Raises:
            UnknownNameError: If it is a single word but not a known name.
            InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.

        Example:
            >>> plan = rrtik.Task.load("titan4_drawer").plan(seed=1)
            >>> plan.found, len(plan.paths) == len(plan.worlds)
            (True, True)
        """
        return read(Task, file, trust_xacro=trust_xacro)

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the task with its world and its start as YAML; if writing fails, no incomplete file is left.

        Raises:
            InputError: If it has no world or start of its own, the file cannot be written, or the format cannot express
                a part of it.

        Example:
            >>> task = rrtik.Task.load("titan4_drawer")
            >>> task.save("drawer.yaml")
            >>> len(rrtik.Task.load("drawer.yaml").stages) == len(task.stages)
            True
        """
        write(self, file)

    def plan(
        self,
        world: World | None = None,
        start: ArrayLike | str | None = None,
        *,
        seconds: float = SECONDS,
        seed: int | None = 0,
    ) -> TaskPlan:
        """Choose alternatives and configurations such that the whole task works, and plan its motions.

        Every motion is collision-free in its own world: straight lines are proven, the others are as :func:`plan` makes
        them.

        Args:
            world: Robot and scene at the beginning; those of the task if None.
            start: Configuration, shape (dof,), or the name of a posture; that of the task if None.
            seconds: Limit of wall time [s].
            seed: The same seed gives the same plan, unless the time limit ends the search. None draws one.

        Raises:
            InputError: If the stages are inconsistent in this world, as when something is attached twice, or detached
                while it is not held; the message names the stage.
            UnknownNameError: If an object, link or posture does not exist.
            ProblemError: If the start is in collision, outside the limits or outside the region of a constraint.
        """
        budget = Budget(seed_of(seed), positive(seconds, "seconds"))
        world = self.world if world is None else world
        start = self.start if start is None else start
        require(world, World, "world of a task", "use World(robot, scene)")
        return _planned(self, world, start, budget, Worlds(world))

    def varied(self, variation: Variation) -> Task:
        """Return one instance of the task, with its own world and start.

        Raises:
            InputError: If the task has no world or start of its own, or a goal cannot be moved.
            UnknownNameError: If there is no obstacle of a name, or no stage sets it down.

        Example:
            >>> task = rrtik.Task.load("panda_pick_place")
            >>> moved = task.varied(rrtik.Variation({"cup": [0.5, 0.2, 0.25]}))
            >>> moved.world.scene.obstacle("cup").pose.translation.tolist()
            [0.5, 0.2, 0.25]
        """
        require(variation, Variation, "variation of a task", "use Variation(poses, places, start)")
        start = self.start if variation.start is None else variation.start
        stages = moved_stages(self.stages, self.world, variation)
        scene = moved_scene(self.world.scene, variation.poses)
        return Task(stages, self.world.with_scene(scene), start, name=self.name, constraints=self.constraints)

    @overload
    def plan_many(
        self,
        variations: Iterable[Variation],
        *,
        seconds: float = SECONDS,
        seed: int | None = 0,
        threads: int | None = None,
        then: None = None,
    ) -> list[TaskPlan]: ...
    @overload
    def plan_many(
        self,
        variations: Iterable[Variation],
        *,
        seconds: float = SECONDS,
        seed: int | None = 0,
        threads: int | None = None,
        then: Callable[[TaskPlan], Made],
    ) -> list[Made]: ...
    def plan_many(
        self,
        variations: Iterable[Variation],
        *,
        seconds: float = SECONDS,
        seed: int | None = 0,
        threads: int | None = None,
        then: Callable[[TaskPlan], Made] | None = None,
    ) -> list[TaskPlan] | list[Made]:
        """Plan many instances of the task, in threads of this process.

        Each plan is that of ``task.varied(variation).plan(seed=...)`` with a seed that depends on ``seed`` and the
        number of the instance alone, however many threads there are, unless a time limit ends a search.

        Args:
            variations: What differs in each instance.
            seconds: Limit of wall time for each instance [s].
            seed: Seed of all instances: the k-th one has the k-th number of
                ``numpy.random.SeedSequence(seed).generate_state(count)``. None draws one.
            threads: Number of instances at a time; None for the number of cores.
            then: Called with each plan in its thread, such as ``lambda plan: plan.time_parameterize()``; what it
                returns is returned in the place of the plan. An instance's worlds are taken over by the next one, so
                what is done with a plan takes less time here than later on.

        Returns:
            One plan for each instance, in their order. If the start of one cannot be used, its plan is not found, and
            its ``reason`` says why.

        Raises:
            InputError: If the task has no world or start of its own, a goal cannot be moved, or a start has another
                number of joints.
            UnknownNameError: If there is no obstacle or posture of a name, or no stage sets an object down.

        Example:
            >>> task = rrtik.Task.load("titan4_drawer")
            >>> plans = task.plan_many([rrtik.Variation({"tool": [1.6, 0.3 + y, 0.0]}) for y in (0.0, 0.01)])
            >>> len(plans)
            2
        """
        given = listed(variations, "variations of a task", MOST_INSTANCES)
        for number, variation in enumerate(given):
            require(variation, Variation, f"variations[{number}]", "use Variation(poses, places, start)")
            _check_start(self.start if variation.start is None else variation.start, self.world, number)
            moved_stages(self.stages, self.world, variation)

        limit = positive(seconds, "seconds")
        numbers = np.random.SeedSequence(seed_of(seed)).generate_state(max(len(given), 1), np.uint32).tolist()

        left = Left()

        def planned(instance: tuple[Variation, int]) -> TaskPlan:
            variation, own_seed = instance
            start = self.start if variation.start is None else variation.start
            stages = moved_stages(self.stages, self.world, variation)
            task = Task(stages, self.world, start, constraints=self.constraints)
            try:
                return plan_after(task, variation.poses, left, seed=own_seed, seconds=limit)
            except ProblemError as error:
                return TaskPlan(False, (), (), (), (), str(error))

        instances = list(zip(given, numbers, strict=False))
        if then is None:
            return in_threads(planned, instances, threads)
        return in_threads(lambda instance: then(planned(instance)), instances, threads)


def _planned(task: Task, world: World, start: ArrayLike | str, budget: Budget, worlds: Worlds) -> TaskPlan:
    """Plan a task; arguments and errors as of :meth:`Task.plan`, but for the worlds, which make further ones."""
    steps = steps_of(holding(task.stages, placed_constraints(world, start, task.constraints)))
    check_program(steps, world)

    given: Any = world.robot.posture(start) if isinstance(start, str) else start
    setting = Setting.beginning(world, world.robot.configuration(given, "start"), worlds)
    q = usable_configuration(setting.world, given, "start")
    if reason := never_set_down(steps, setting.world, np.array(q)):
        return TaskPlan(False, (), (), (), (), reason, seconds=budget.elapsed)

    search = TaskSearch(budget.begun_now())
    done = search.run(Branch(setting, np.array(q), steps))
    taken = budget.elapsed
    if done is None:
        return TaskPlan(False, (), (), (), (), search.reason(), seconds=taken, statistics=search.statistics)
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
        seconds=taken,
        statistics=search.statistics,
    )


def plan_after(task: Task, poses: Mapping[str, pin.SE3], left: Left, *, seed: int, seconds: float) -> TaskPlan:
    """Plan an instance of a task, with the worlds that earlier instances of it have left.

    Its worlds are left to the next instance, which moves them: whoever needs them uses them before.

    Args:
        task: The instance's stages and start, in the world of the task as it is written.
        poses: Where obstacles of the instance stand, T_world_obstacle, by name.
        left: The worlds.
        seed: As of :meth:`Task.plan`.
        seconds: As there [s].

    Raises:
        ProblemError: As there.
    """
    budget = Budget(seed, seconds)
    with worlds_from(task.world, left) as worlds:
        world = worlds.of(task.world.robot, moved_scene(task.world.scene, poses))
        return _planned(task, world, task.start, budget, worlds)


def _check_start(start: ArrayLike | str, world: World, number: int) -> None:
    """Refuse a start of an instance of a task that is no configuration of the robot, or an unknown posture."""
    if isinstance(start, str):
        world.robot.posture(start)
    else:
        world.robot.configuration(start, f"start of variations[{number}]")


def _joined(paths: Sequence[JointPath]) -> JointPath:
    """Return motions that have proofs as one path, whose proof refers to a world only if all of theirs do."""
    rows = [paths[0].waypoints, *(path.waypoints[1:] for path in paths[1:])]
    proofs = [path.proof for path in paths if path.proof is not None]
    before = np.cumsum([0, *(len(path) - 1 for path in paths)]).tolist()
    motions = max(before[-1], 1)
    # A motion of one waypoint has no edge, so a gap of it counts as one of the next edge.
    gaps = [
        replace(gap, motion=min(first + gap.motion, motions - 1))
        for first, proof in zip(before, proofs, strict=False)
        for gap in proof.unproven
    ]

    maker = proofs[0].maker
    whole = Proof(
        motions,
        min(proof.clearance for proof in proofs),
        tuple(gaps),
        min(proof.margin for proof in proofs),
        maker=maker if all(proof.maker is maker for proof in proofs) else None,
    )
    return path_through(paths[0], np.vstack(rows)).with_proof(whole)


def _notes_of(done: Done) -> tuple[str, ...]:
    """Return the notes of a plan: uncertain finger motions, contacts, and objects attached from far away."""
    notes = []
    stood_on = {id(branch): contacts for (branch, _), contacts in zip(done.motions, done.contacts, strict=True)}

    for branch in done.last.chain():
        notes += [f"{branch.step}: {branch.note}"] if branch.note else []
        notes += [f"{branch.step} stands on a contact: {each}" for each in stood_on.get(id(branch), ())]
        if branch.before is not None and branch.step is not None and isinstance(branch.step.stage, Attach):
            stage = branch.step.stage
            distance = _far_gap(branch.before.after.bare, branch.q, stage.object, stage.link)
            if distance > FAR:
                text = f"'{stage.object}' is {1e3 * distance:.0f} mm away from '{stage.link}' when it is attached"
                notes.append(f"{branch.step}: {text}")
    return tuple(notes)


def _far_gap(world: World, q: Vector, name: str, link: str) -> float:
    """Return an obstacle's distance from a link and the links rigidly joined to it at q [m]; 0 if not above ``FAR``."""
    robot = world.robot
    bodies = world.bodies
    joint = robot.model.frames[robot.model.getFrameId(link)].parentJoint
    links_joined = [k for k, body in enumerate(bodies) if body.joint == joint and body.name in robot.link_names]
    parts = [k for k, body in enumerate(bodies) if body.name == name]
    frames = robot.joint_frames(q[None])[0]
    pairs = list(product(links_joined, parts))
    if any(not beyond(bodies[i], bodies[j], frames, FAR) for i, j in pairs):
        return 0.0  # which takes less time than to measure it
    return min((pair.distance for pair in measured(bodies, pairs, frames, near_only=False)), default=0.0)

"""One demonstration: a task that is drawn, planned, timed and sampled at the rate of a controller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.model.scene import AttachedObject
from rrtik_ompl.motion.trajectory import RateLimits
from rrtik_ompl.tasks import Attach, Task, TaskPlan, plan_after
from rrtik_ompl.tasks.randomness import Draws, Randomness
from rrtik_ompl.tasks.stages import every_stage
from rrtik_ompl.world.world import World

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Timing:
    """How demonstrations are planned and timed.

    Attributes:
        rate: Ticks per second of the controller.
        share: Share of the joints' limits.
        pause: Rest where a gripper moves or an object is taken or set down [s].
        seconds: Limit of wall time for planning one task [s].
    """

    rate: float
    share: float
    pause: float
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class Episode:
    """What has come of one attempt.

    Attributes:
        number: Number of the attempt, from 0.
        reason: Why there is no demonstration; "" if there is one.
        rejected: How many draws were not usable before this one, by the reason.
        drawn: Where each drawn obstacle stands: position [m] and quaternion (x, y, z, w), by its name.
        arrays: The demonstration at each of its k ticks: time [s], position and velocity of the joints, shape
            (k, dof), share to which the gripper is open (only of a robot with a gripper), poses of the objects, shape
            (k, objects, 7), and the number of the motion. Empty without a demonstration.
    """

    number: int
    reason: str
    rejected: Mapping[str, int]
    drawn: Mapping[str, list[float]] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def found(self) -> bool:
        """Whether there is a demonstration."""
        return not self.reason

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return len(self.arrays["time"]) if self.arrays else 0

    def record(self) -> dict[str, Any]:
        """Return what is said of the attempt in one line."""
        said = {"attempt": self.number, "found": self.found, "reason": self.reason, "ticks": self.ticks}
        return {**said, "rejected": dict(self.rejected), "drawn": dict(self.drawn)}


def observed(task: Task) -> tuple[str, ...]:
    """Return the names of the objects whose poses are recorded: those that are drawn or attached, in their order."""
    random = task.random or Randomness()
    attached = [stage.object for stage in every_stage(task.stages) if isinstance(stage, Attach)]
    return tuple(dict.fromkeys([*random.objects, *attached]))


def attempted(draws: Draws, seed: int, number: int, timing: Timing) -> Episode:
    """Draw, plan, time and sample one task; its random numbers depend on the seed and the number alone."""
    draw = draws.draw(np.random.default_rng([seed, number, 0]))
    if draw.task is None:
        return Episode(number, draw.reason, draw.rejected)

    names = [name for name in observed(draws.task) if name in draws.random.objects]
    drawn = {name: pose_row(draw.poses[name]).tolist() for name in names}
    own_seed = int(np.random.default_rng([seed, number, 1]).integers(2**31))
    try:
        plan = plan_after(draw.task, draw.poses, draws.left, seed=own_seed, seconds=timing.seconds)
        if not plan.found:
            return Episode(number, plan.reason, draw.rejected, drawn)
        if not plan.proven:
            return Episode(number, "a motion is not proven free", draw.rejected, drawn)
        return Episode(number, "", draw.rejected, drawn, ticks_of(plan, timing, observed(draws.task)))
    except RrtikError as error:
        return Episode(number, str(error), draw.rejected, drawn)


def ticks_of(plan: TaskPlan, timing: Timing, objects: tuple[str, ...]) -> Arrays:
    """Return the motion of a task at each tick of a controller, see :class:`Episode`.

    Ticks are a whole number of steps apart: the last one is the first at which all is over.

    Raises:
        InputError: If nothing moves.
    """
    robot = plan.worlds[0].robot
    timed = plan.time_parameterize(RateLimits.of(robot, share=timing.share), pause=timing.pause)
    trajectory = timed.trajectory
    count = int(np.ceil(trajectory.duration * timing.rate - 1e-6)) + 1
    time = np.arange(count) / timing.rate

    state = trajectory(time)  # which stands still after its end
    motion = np.maximum(np.searchsorted(timed.begins, time + 1e-9, side="right") - 1, 0)
    arrays: Arrays = {"time": time, "position": state.positions, "velocity": state.velocities}
    if robot.gripper is not None:
        arrays["gripper"] = robot.gripper.share(trajectory.gripper_positions(time))
    poses = _object_poses(arrays["position"], motion, plan.worlds, objects)
    return {**arrays, "object_pose": poses, "motion": motion}


def _object_poses(
    rows: Matrix, motion: NDArray[np.int64], worlds: Sequence[World], names: tuple[str, ...]
) -> NDArray[np.float64]:
    """Return position and quaternion (x, y, z, w) of each object at each tick, shape (k, objects, 7)."""
    poses = np.empty((len(rows), len(names), 7))
    ends = motion.searchsorted(np.arange(1, len(worlds) + 1))  # tick at which each motion is over
    for column, name in enumerate(names):
        begin = 0
        for _, alike in groupby(enumerate(worlds), partial(_place, name)):
            numbers, there = zip(*alike, strict=True)  # motions during which it is held alike
            ticks = slice(begin, int(ends[numbers[-1]]))
            begin = ticks.stop
            held = _held(there[0], name)
            if held is None:
                poses[ticks, column] = pose_row(there[0].scene.obstacle(name).pose)
                continue
            frames = there[0].robot.fk_batch(rows[ticks], held.link) @ held.pose.homogeneous
            poses[ticks, column, :3] = frames[:, :3, 3]
            poses[ticks, column, 3:] = _quaternions(frames[:, :3, :3])
    return poses


def _place(name: str, numbered: tuple[int, World]) -> tuple[str, bytes]:
    """Return the link that holds an object in a world, "" if none does, and the object's pose as seen from there."""
    _, world = numbered
    held = _held(world, name)
    if held is not None:
        return held.link, held.pose.homogeneous.tobytes()
    return "", world.scene.obstacle(name).pose.homogeneous.tobytes()


def _held(world: World, name: str) -> AttachedObject | None:
    """Return an object if it is attached to the arm."""
    return next((item for item in world.scene.attached if item.name == name), None)


def _quaternions(R: NDArray[np.float64]) -> Matrix:
    """Return rotations, shape (m, 3, 3), as quaternions (x, y, z, w) with w >= 0, shape (m, 4)."""
    rows = np.array([pin.Quaternion(each).coeffs() for each in R]).reshape(-1, 4)
    return np.where(rows[:, 3:] < 0.0, -rows, rows)

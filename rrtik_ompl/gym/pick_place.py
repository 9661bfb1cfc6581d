"""An arm takes a thing and puts it down elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import positive
from rrtik_ompl.base.errors import InputError, NotFoundError, ProblemError, require
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.gym.arm import COLLISION, LARGE, Arm, Row
from rrtik_ompl.tasks import Attach, Detach, Gripper, Task, TaskPlan, plan_after
from rrtik_ompl.tasks.randomness import Draws
from rrtik_ompl.tasks.setting import Setting
from rrtik_ompl.tasks.stages import GripperState, every_stage

CLOSE = -1.0
OPEN = 1.0
TOLD = 0.5  # size of the gripper's action from which on it is told something
MOST_DRAWS = 20  # instances of the task, of which the first that can be done is taken
SECONDS = 10.0  # [s] limit of wall time for planning an instance


class PickPlace(Arm):
    """``rrtik/PickPlace-v0``: take a thing and put it down at a place, as a task of ``rrtik demos`` draws both.

    Nothing has mass: joints are where they are told, and what is let go stays where it is. An observation is the
    joints' values [rad or m], how far the gripper is open (0 to 1), the pose of the thing (position [m], quaternion
    x, y, z, w), and where it is to be [m]. An action is the change of each joint as a share of ``increment``, -1 to 1,
    and behind them what the gripper is told: to close below -0.5, to open above 0.5. A gripper that closes where it can
    grasp takes the thing along from then on. What is not free is not done.

    The reward is the negative distance of the grasp from the thing while it is not held, and of the thing from its
    place [m], less 0.1 where something was in the way. An episode ends once the thing is let go at its place. ``info``
    has ``is_success``, ``distance`` (of the thing from its place), ``held`` and ``collision``.

    Each ``reset`` draws an instance of the task by the seed, and plans it, so that it can be done: `expert` does.

    Args:
        task: A task with one thing that is taken and set down, a ``random:`` section and a gripper, or its name.
        increment: Largest change of a joint in a step [rad or m].
        tolerance: Distance from its place at which the thing is there [m].
        reach: Distance of the thing from where the task grasps it at which the gripper takes it [m].

    Raises:
        InputError: If the task is none of these.

    Example:
        >>> import gymnasium, rrtik_ompl.gym
        >>> env = gymnasium.make("rrtik/PickPlace-v0")
        >>> observation, info = env.reset(seed=1)
        >>> for action in rrtik_ompl.gym.expert(env):
        ...     observation, reward, terminated, truncated, info = env.step(action)
        >>> terminated, info["held"], info["collision"]
        (True, False, False)
    """

    def __init__(
        self,
        task: Task | str = "so101_pick_place",
        *,
        increment: float = 0.05,
        tolerance: float = 0.02,
        reach: float = 0.01,
    ) -> None:
        require(task, Task | str, "task of an environment", "use Task.load(file), or the name of a task")
        known = Task.load(task) if isinstance(task, str) else task
        self._draws = Draws(known)
        stages = list(every_stage(known.stages))
        grippers = {stage.state: stage for stage in stages if isinstance(stage, Gripper)}
        taken = [stage for stage in stages if isinstance(stage, Attach)]
        if len({stage.object for stage in taken}) != 1 or set(grippers) != {"open", "close"}:
            raise InputError(f"task '{known.name}': an environment is of one thing that a gripper takes and lets go")
        self.tolerance = positive(tolerance, "tolerance")
        self.reach = positive(reach, "reach")
        super().__init__(known.world.robot, positive(increment, "increment"))

        self._attach = taken[0]
        self._grippers = grippers
        low = np.array([0.0, *(-LARGE,) * 3, *(-1.0,) * 4, *(-LARGE,) * 3])
        high = np.array([1.0, *(LARGE,) * 3, *(1.0,) * 4, *(LARGE,) * 3])
        self.observation_space = self._observed(low, high)
        self.action_space = self._acted(more=1)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Row, dict[str, Any]]:
        """Begin an episode; see the class.

        Raises:
            NotFoundError: If none of 20 instances can be done.
        """
        super().reset(seed=seed, options=options)
        self._plan = self._drawn()
        first = self._plan.worlds[0]
        self._begin(np.array(self._plan.paths[0].start))
        self._enter(Setting.beginning(first, self._q))
        held = next(world.scene.attached[0] for world in self._plan.worlds if world.scene.attached)
        assert self._plan.end is not None, "it was found"
        self._grasp = np.array(held.pose.translation)  # in the frame of the link
        self._place = np.array(self._plan.end.scene.obstacle(self._attach.object).pose.translation)
        return self._observation(), self._info(collision=False)

    def step(self, action: ArrayLike) -> tuple[Row, float, bool, bool, dict[str, Any]]:
        """Move the joints, then the gripper; see the class.

        Raises:
            InputError: If the action is not one finite number for each joint and one for the gripper, or before the
                first `reset`.
        """
        told = self._told(action)
        gripper = told[-1]
        free = self._move(told[:-1])
        if abs(gripper) > TOLD:
            free &= self._grip("close" if gripper < 0.0 else "open")
        info = self._info(collision=not free)
        self._ended = info["is_success"]
        away = 0.0 if info["held"] else self._away()
        reward = -away - info["distance"] - COLLISION * info["collision"]
        return self._observation(), reward, info["is_success"], False, info

    def expert(self) -> Iterator[Row]:
        """Yield the actions of the plan of this episode; see :func:`rrtik_ompl.gym.expert`."""
        self._require_begun()
        if self._held or not np.array_equal(self._q, self._plan.paths[0].start):
            raise InputError("expert: it begins where the episode does; call reset() first")
        still = np.zeros(self.robot.dof)
        ends = [*(bool(world.scene.attached) for world in self._plan.worlds), False]
        for path, holding in zip([*self._plan.paths, None], ends, strict=True):
            if holding != self._held and not self._ended:
                yield np.append(still, CLOSE if holding else OPEN).astype(np.float32)
            if path is not None:
                for shares in self._along(path.waypoints):
                    yield np.append(shares, 0.0).astype(np.float32)

    def _drawn(self) -> TaskPlan:
        """Draw and plan an instance."""
        reason = ""
        for _ in range(MOST_DRAWS):
            drawn = self._draws.draw(self.np_random)
            seed = int(self.np_random.integers(2**31))
            if drawn.task is None:
                reason = drawn.reason
                continue
            plan = plan_after(drawn.task, drawn.poses, self._draws.left, seed=seed, seconds=SECONDS)
            if plan.found and plan.paths:
                return plan
            reason = plan.reason
        raise NotFoundError(f"none of {MOST_DRAWS} instances of the task can be done; of the last one: {reason}")

    def _grip(self, state: GripperState) -> bool:
        """Open or close the gripper, and take or let go the thing; return whether that was free."""
        setting = self._setting
        try:
            if state == "close" and not self._held and self._away() <= self.reach:
                setting = setting.after(self._attach, self._q)
            elif state == "open" and self._held:
                setting = setting.after(Detach(self._attach.object), self._q)
            setting = setting.after(self._grippers[state], self._q)
        except (ProblemError, InputError):  # it would be left inside something
            return False
        if not setting.world.valid(self._q):
            return False
        self._enter(setting)
        return True

    def _enter(self, setting: Setting) -> None:
        """Go on in another world."""
        self._setting = setting
        self.world = setting.world
        self._held = bool(setting.scene.attached)

    def _thing(self) -> pin.SE3:
        """Return the pose of the thing in the world."""
        scene = self._setting.scene
        if not self._held:
            return scene.obstacle(self._attach.object).pose
        (item,) = scene.attached
        return self.robot.fk(self._q, item.link) * item.pose

    def _away(self) -> float:
        """Return the distance of the thing from where it is grasped [m]."""
        grasp = self.robot.fk(self._q, self._attach.link).act(self._grasp)
        return float(np.linalg.norm(grasp - self._thing().translation))

    def _observation(self) -> Row:
        fingers = self.robot.gripper
        assert fingers is not None, "tasks with a gripper need one"
        locked = self._setting.robot.source.get("locked", {})
        values = [locked.get(name, closed) for name, closed in zip(fingers.joints, fingers.closed, strict=True)]
        opening = np.clip(fingers.share([values]), 0.0, 1.0)
        return np.concatenate([self._q, opening, pose_row(self._thing()), self._place]).astype(np.float32)

    def _info(self, *, collision: bool) -> dict[str, Any]:
        distance = float(np.linalg.norm(self._thing().translation - self._place))
        done = not self._held and distance <= self.tolerance
        return {"is_success": done, "distance": distance, "held": self._held, "collision": collision}

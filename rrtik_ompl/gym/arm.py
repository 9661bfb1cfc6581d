"""What environments share: joints that are moved by increments, where the motion is free."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, bounded_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.world import World

Row = NDArray[np.float32]
LARGE = 10.0  # [m] bound of coordinates that are observed
ARRIVED = 1e-5  # [rad or m] of a joint: an expert has come to a waypoint; actions have single precision
COLLISION = 0.1  # taken off the reward of a step in which something was in the way


class Arm(gymnasium.Env):
    """An arm without dynamics: a joint is where it is told to be, if nothing is in the way.

    Args:
        robot: The arm.
        increment: Largest change of a joint in a step [rad or m].
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}
    render_mode = None
    world: World

    def __init__(self, robot: Robot, increment: float) -> None:
        self.robot = robot
        self.increment = increment
        self._q: Vector = np.zeros(robot.dof)
        self._begun = False
        self._ended = False

    @property
    def q(self) -> Vector:
        """Configuration of the arm, shape (dof,) [rad or m]."""
        return self._q.copy()

    def expert(self) -> Iterator[Row]:
        """As :func:`expert`."""
        raise NotImplementedError

    def _observed(self, low: Vector, high: Vector) -> gymnasium.spaces.Box:
        """Return the space of the joints, and of other numbers with these bounds."""
        robot = self.robot
        bounds = [np.concatenate(both).astype(np.float32) for both in ((robot.lower, low), (robot.upper, high))]
        return gymnasium.spaces.Box(*bounds, dtype=np.float32)

    def _acted(self, more: int = 0) -> gymnasium.spaces.Box:
        """Return the space of shares of the largest increment, and of so many other numbers, all from -1 to 1."""
        return gymnasium.spaces.Box(-1.0, 1.0, (self.robot.dof + more,), dtype=np.float32)

    def _begin(self, q: Vector) -> None:
        """Begin an episode at a configuration, shape (dof,)."""
        self._q = q
        self._begun = True
        self._ended = False

    def _require_begun(self) -> None:
        """Refuse what needs an episode before the first one."""
        if not self._begun:
            raise InputError("environment: no episode has begun; call reset() first")

    def _told(self, action: ArrayLike) -> Vector:
        """Return an action as numbers, in the shape of the space.

        Raises:
            InputError: If it is none, or no episode has begun.
        """
        self._require_begun()
        return bounded_array(action, self.action_space.shape or (), "action")

    def _move(self, shares: Vector) -> bool:
        """Move the joints by shares of the largest increment, shape (dof,), if that is free; return whether it was."""
        wanted = self.robot.clamp(self._q + self.increment * np.clip(shares, -1.0, 1.0))
        free = bool(self.world.motion_valid(self._q, wanted))
        if free:
            self._q = wanted
        return free

    def _along(self, waypoints: Matrix) -> Iterator[Vector]:
        """Yield shares of the largest increment along a path, shape (k, dof), for one step each.

        It ends with the episode, and where the arm is stopped.
        """
        for waypoint in waypoints:
            before = None
            while np.abs(waypoint - self._q).max() > ARRIVED:
                if self._ended or self._q is before:
                    return
                before = self._q
                gap = (waypoint - self._q) / self.increment
                yield gap / max(float(np.abs(gap).max()), 1.0)


def expert(env: gymnasium.Env) -> Iterator[Row]:
    """Yield the actions of a planned, proven motion to the end of an episode, each for the next step.

    Args:
        env: A `Reach`, or a `PickPlace` at the beginning of an episode, with what Gymnasium puts around it.

    Raises:
        InputError: If it is another environment, or an episode of it is under way.
        NotFoundError: If no motion is found.

    Example:
        >>> import gymnasium, rrtik_ompl.gym
        >>> env = gymnasium.make("rrtik/PickPlace-v0")
        >>> observation, info = env.reset(seed=1)
        >>> for action in rrtik_ompl.gym.expert(env):
        ...     observation, reward, terminated, truncated, info = env.step(action)
        >>> terminated, info["held"], info["collision"]
        (True, False, False)
    """
    arm = getattr(env, "unwrapped", None)
    if not isinstance(arm, Arm):
        raise InputError(f"expert: expected an environment of rrtik_ompl, got {type(env).__name__}")
    return arm.expert()

"""An arm brings its tip to a point."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, positive
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.gym.arm import COLLISION, LARGE, Arm, Row
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

AT_ONCE = 64  # configurations that are drawn together
MOST_DRAWS = 100  # times so many


class Reach(Arm):
    """``rrtik/Reach-v0``: bring the tip to a point among obstacles. Nothing has mass: joints are where they are told.

    An observation is the joints' values [rad or m], the position of the tip and the goal [m]; an action is the change
    of each joint as a share of ``increment``, -1 to 1. A step that is not free leaves the arm where it is. The reward
    is the negative distance of the tip from the goal [m], less 0.1 where something was in the way. An episode ends at
    the goal. ``info`` has ``is_success``, ``distance`` and ``collision``.

    ``reset`` draws both ends of an episode by its seed: free configurations, of which the tip of one is the goal.

    Args:
        world: The world, or the name of a problem that has it.
        increment: Largest change of a joint in a step [rad or m].
        tolerance: Distance from the goal at which it is reached [m].

    Raises:
        InputError: If the world has hardly any free configuration, or an argument cannot be used.

    Example:
        >>> import gymnasium, rrtik_ompl.gym
        >>> env = gymnasium.make("rrtik/Reach-v0")
        >>> observation, info = env.reset(seed=1)
        >>> for action in rrtik_ompl.gym.expert(env):
        ...     observation, reward, terminated, truncated, info = env.step(action)
        >>> terminated, info["collision"]
        (True, False)
    """

    def __init__(self, world: World | str = "panda_shelf", *, increment: float = 0.05, tolerance: float = 0.02) -> None:
        require(world, World | str, "world of an environment", "use World(robot, scene), or the name of a problem")
        self.world = load_problem(world).world if isinstance(world, str) else world
        self.tolerance = positive(tolerance, "tolerance")
        super().__init__(self.world.robot, positive(increment, "increment"))
        self.observation_space = self._observed(np.full(6, -LARGE), np.full(6, LARGE))
        self.action_space = self._acted()
        self._goal_q = self._q
        self._goal = np.zeros(3)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Row, dict[str, Any]]:
        """Begin an episode; see the class."""
        super().reset(seed=seed, options=options)
        self._begin(self._free_configuration())
        self._goal_q = self._free_configuration()
        self._goal = np.array(self.robot.fk(self._goal_q).translation)
        return self._observation(), self._info(collision=False)

    def step(self, action: ArrayLike) -> tuple[Row, float, bool, bool, dict[str, Any]]:
        """Move the joints; see the class.

        Raises:
            InputError: If the action is not one finite number for each joint, or before the first `reset`.
        """
        free = self._move(self._told(action))
        info = self._info(collision=not free)
        self._ended = info["is_success"]
        reward = -info["distance"] - COLLISION * info["collision"]
        return self._observation(), reward, info["is_success"], False, info

    def expert(self) -> Iterator[Row]:
        """Yield the actions from where the arm is; see :func:`rrtik_ompl.gym.expert`."""
        self._require_begun()
        path = plan(Problem(self.world, self._q, self._goal_q), seed=0).require()
        for shares in self._along(path.waypoints):
            yield shares.astype(np.float32)

    def _free_configuration(self) -> Vector:
        """Draw a free configuration, shape (dof,)."""
        for _ in range(MOST_DRAWS):
            rows = self.np_random.uniform(*self.robot.finite_range(), (AT_ONCE, self.robot.dof))
            free = rows[self.world.valid_batch(rows)]
            if len(free):
                return np.array(free[0])
        raise InputError(f"world of an environment: none of {MOST_DRAWS * AT_ONCE} random configurations is free")

    def _observation(self) -> Row:
        return np.concatenate([self._q, self.robot.fk(self._q).translation, self._goal]).astype(np.float32)

    def _info(self, *, collision: bool) -> dict[str, Any]:
        distance = float(np.linalg.norm(self.robot.fk(self._q).translation - self._goal))
        return {"is_success": distance <= self.tolerance, "distance": distance, "collision": collision}

"""For learning: an environment of gymnasium's kind without it, and expert plans by all cores."""

import numpy as np

import rrtik_ompl as rrtik


class Reach:
    """Gymnasium's reset() and step(); an action is how far the joints shall turn [rad]."""

    def __init__(self, world: rrtik.World, step: float = 0.2, length: int = 300) -> None:
        self.world, self.most, self.length = world, step, length

    def reset(self, seed: int | None = None) -> tuple[np.ndarray, dict[str, bool]]:
        """Begin between two free configurations."""
        rows = np.random.default_rng(seed).uniform(*self.world.robot.finite_range(), (1000, self.world.robot.dof))
        (self.q, self.goal), self.count = rows[self.world.valid_batch(rows)][:2], 0
        return np.concatenate([self.q, self.goal]), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, bool]]:
        """Turn the joints, at most as far as a step goes, if that is free."""
        target = self.q + min(1.0, self.most / max(np.abs(action).max(), 1e-12)) * action
        free, self.count = self.world.motion_valid(self.q, target), self.count + 1
        self.q = target if free else self.q
        away = float(np.linalg.norm(self.goal - self.q))
        return np.concatenate([self.q, self.goal]), -away, away < self.most, self.count >= self.length, {"free": free}


posts = [rrtik.Obstacle(f"post {k}", rrtik.Cylinder(0.03, 1.0), [np.cos(k) / 2, np.sin(k) / 2, 0.3]) for k in range(5)]
reach = Reach(rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene(posts)))
ends = np.array([reach.reset(seed=k)[0] for k in range(3)])
for k, plan in enumerate(rrtik.plan_many(reach.world, ends[:, :6], ends[:, 6:], "fastrrtconnect", seed=1)):
    reach.reset(seed=k)
    done, reward = False, 0.0
    for target in plan.path[1:] if plan.path else ():
        while not done and np.abs(target - reach.q).max() > 1e-9:
            reward, ended, cut = reach.step(target - reach.q)[1:4]
            done = ended or cut
    print(f"episode {k}: {reach.count} steps, reward {reward:.2f}" if plan.found else plan.reason)

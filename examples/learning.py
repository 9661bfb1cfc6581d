"""For learning: an arm as MuJoCo's file, expert plans by all cores, and a loop of gymnasium's kind without it."""

from pathlib import Path

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik


def write_mjcf(robot, file, thickness=0.04):
    """The joints of a serial arm as an MJCF file of MuJoCo, with a capsule from each joint to the next one."""
    chain, lines = robot.chain, [f'<mujoco model="{robot.name}"><compiler angle="radian"/><worldbody>']
    tip = robot.model.frames[robot.model.getFrameId(robot.tip)].placement
    ends = [*(place[:3, 3] for place in chain.placement[1:]), tip.translation]
    for k, (place, end) in enumerate(zip(chain.placement, ends, strict=True)):
        x, y, z, w = pin.Quaternion(place[:3, :3]).coeffs()
        numbers = {"pos": place[:3, 3], "quat": [w, x, y, z], "axis": chain.axis[k], "to": end}
        text = {name: " ".join(f"{value:.9g}" for value in row) for name, row in numbers.items()}
        lines.append(f'<body name="link{k}" pos="{text["pos"]}" quat="{text["quat"]}">')
        limits = f'range="{robot.lower[k]:.9g} {robot.upper[k]:.9g}"'
        lines.append(f'<joint name="{robot.joint_names[k]}" type="hinge" axis="{text["axis"]}" {limits}/>')
        if np.linalg.norm(end) > 2.0 * thickness:
            lines.append(f'<geom type="capsule" size="{thickness}" fromto="0 0 0 {text["to"]}"/>')
    lines.append(f'<site name="tip" pos="{text["to"]}"/>' + "</body>" * len(ends) + "</worldbody></mujoco>")
    Path(file).write_text("\n".join(lines))


class ReachEnvironment:
    """reset() -> (observation, info), step(action) -> (observation, reward, terminated, truncated, info)."""

    def __init__(self, world, step=0.2, length=300):
        self.world, self.most, self.length = world, step, length

    def reset(self, seed=None):
        """Begin between two free configurations."""
        rng = np.random.default_rng(seed)
        rows = rng.uniform(*self.world.robot.finite_range(), (1000, self.world.robot.dof))
        self.q, self.goal = rows[self.world.valid_batch(rows)][:2]
        self.count = 0
        return np.concatenate([self.q, self.goal]), {}

    def step(self, action):
        """Move the joints by an action [rad] at most as far as a step goes, if that is free."""
        shorter = min(1.0, self.most / max(np.abs(action).max(), 1e-12))
        target, self.count = self.q + shorter * action, self.count + 1
        free = self.world.motion_valid(self.q, target)
        self.q = target if free else self.q
        away = np.linalg.norm(self.goal - self.q)
        return np.concatenate([self.q, self.goal]), -away, away < self.most, self.count >= self.length, {"free": free}


write_mjcf(rrtik.load_robot("ur5"), "ur5.xml")
robot = rrtik.load_robot("ur5.xml")
apart = [rrtik.load_robot("ur5").fk(q).translation - robot.fk(q).translation for q in np.eye(6)]
print(f"tip of the MJCF file within {1e3 * np.abs(apart).max():.3g} mm of the shipped arm's")

rng = np.random.default_rng(1)
places = [rrtik.pose([0.5 * np.cos(k), 0.5 * np.sin(k), 0.3]) for k in range(5)]
posts = [rrtik.Obstacle(f"post {k}", rrtik.Cylinder(0.03, 1.0), place) for k, place in enumerate(places)]
world = rrtik.World(robot, rrtik.Scene(posts))
rows = rng.uniform(*robot.finite_range(), (400, robot.dof))
free = rows[world.valid_batch(rows)]
plans = rrtik.plan_many(world, free[:20], free[20:40], "fastrrtconnect", seed=1)
print(f"{sum(plan.found for plan in plans)} of {len(plans)} expert plans")

environment = ReachEnvironment(world)
for episode in range(3):
    seen, _ = environment.reset(seed=episode)
    expert = rrtik.plan_many(world, seen[:6], seen[None, 6:], "fastrrtconnect", seed=episode)[0]
    ended = False
    for target in expert.path.waypoints[1:] if expert.found else ():
        while not ended and np.abs(target - environment.q).max() > 1e-9:
            seen, reward, done, cut, _ = environment.step(target - environment.q)
            ended = done or cut
    print(f"episode {episode}: {environment.count} steps, reward {reward:.2f}" if expert.found else expert.reason)

"""A cup is carried around a post and stays upright to five degrees, on the whole way."""

import numpy as np

import rrtik_ompl as rrtik

robot = rrtik.load_robot("ur5_limited")
post = rrtik.Obstacle("post", rrtik.Box(0.1, 0.1, 0.9), [0.5, 0.0, 0.45])
world = rrtik.World(robot, rrtik.Scene([post]))
start = [-0.91, -1.19, 1.98, -2.36, -1.57, -0.91]
goal = [0.42, -1.19, 1.98, -2.36, -1.57, 0.42]
problem = rrtik.Problem(world, start, goal, constraints=[rrtik.constraints.upright(robot, tolerance_deg=5.0)])

path = rrtik.plan(problem, seed=1).require()
axes = robot.fk_batch(path.resample(0.01).waypoints)[:, :3, 2]
tilt = np.degrees(np.arccos(np.clip(axes @ robot.fk(start).rotation[:, 2], -1.0, 1.0)))
print(f"{path.length:.2f} rad, tilted by at most {tilt.max():.2f} degrees")

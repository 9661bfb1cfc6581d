"""A cloud of points as an obstacle: every point is a ball, exact in checks and proofs; the arm's own points go."""

import numpy as np

import rrtik_ompl as rrtik

robot = rrtik.load_robot("panda")
start = robot.posture("default")
rng = np.random.default_rng(1)
wall = rng.uniform([0.45, 0.15, 0.0], [0.47, 0.25, 0.9], (20_000, 3))  # what a camera saw
own = robot.fk(start).translation + rng.normal(0.0, 0.01, (500, 3))  # and of the arm itself

cloud = rrtik.PointCloud(np.vstack([wall, own]), radius=0.01).voxel(0.005)
cloud = rrtik.sensing.without_robot(cloud, robot, start, margin=0.02)
print(f"{len(cloud.points)} points are left")
world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("scan", cloud, margin=0.005)]))
goal = rrtik.PositionGoal([0.3, 0.5, 0.4], tolerance=0.01)
path = rrtik.plan(rrtik.Problem(world, start, goal), seed=1).require()
print(f"{path.length:.2f} rad, proven: {path.proven}")

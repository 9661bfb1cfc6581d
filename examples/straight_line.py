"""The tip of a UR5 in a straight line, on an arc, and how far a line comes that leaves the workspace."""

import numpy as np

import rrtik_ompl as rrtik

world = rrtik.World(rrtik.load_robot("ur5"))
ready = [0.0, -1.6, 1.8, -0.2, 1.6, 0.0]
tip = world.robot.fk(ready).translation

up = rrtik.tip.straight(world, ready, tip + np.array([0.0, 0.0, 0.2]))  # a position keeps the orientation
print(f"up: {up.fraction:.0%}, {len(up.require())} waypoints, within 0.1 mm of the line")

over = rrtik.tip.arc(world, ready, tip + np.array([0.0, 0.2, 0.0]), through=tip + np.array([0.0, 0.1, 0.1]))
print(f"over: {over.fraction:.0%}")

far = rrtik.tip.straight(world, ready, tip + np.array([2.0, 0.0, 0.0]))
print(f"far: {far.fraction:.0%}: {far.reason}")

motion = rrtik.time_parameterize(up.require(), world.robot, blend=0.05, world=world, tip_speed=0.1)
print(f"{motion.duration:.2f} s at 0.1 m/s at most")

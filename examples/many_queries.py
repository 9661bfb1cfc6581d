"""Many queries in one world: a roadmap is made once, then answers each at once."""

import time

import numpy as np

import rrtik_ompl as rrtik

robot = rrtik.load_robot("ur5")
shelf = rrtik.Obstacle("shelf", rrtik.Box(0.3, 0.8, 0.04), [0.6, 0.0, 0.4])
world = rrtik.World(robot, rrtik.Scene([shelf]))
roadmap = rrtik.Roadmap(world, seed=1)
roadmap.grow(500)
roadmap.save("ur5_shelf.npz")

drawn = np.random.default_rng(2).uniform(-3.0, 3.0, (400, robot.dof))
free = drawn[world.valid_batch(drawn)]
roadmap.path(free[0], free[1])  # the first call loads what it needs
begin = time.process_time()
routes = [roadmap.path(a, b) for a, b in zip(free[::2], free[1::2], strict=False)]
spent = 1e6 * (time.process_time() - begin) / len(routes)
print(f"{sum(route is not None for route in routes)} of {len(routes)} answered, {spent:.0f} us each")

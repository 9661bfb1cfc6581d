"""Joint values for a pose: one solution, all of them, many poses at once, a pose out of reach."""

import numpy as np

import rrtik_ompl as rrtik

robot = rrtik.load_robot("titan4")
here = robot.posture("ready")
goal = rrtik.PoseGoal(robot.fk(here))

one = rrtik.solve_ik(robot, goal, near=here)
print("nearest to here [deg]:", np.degrees(one.solutions[0]).round(1))
every = rrtik.solve_ik(robot, goal, all=True)
print(len(every.solutions), "solutions within the limits")

panda = rrtik.load_robot("panda")
poses = panda.fk_batch(np.random.default_rng(1).uniform(*panda.finite_range(), (1000, 7)))
batch = rrtik.solve_ik_many(panda, poses)
print(f"{np.mean(batch.found):.1%} of {len(poses)} poses solved")

far = rrtik.solve_ik(panda, rrtik.PoseGoal([2.0, 0.0, 0.5]))
print(f"out of reach: {far.reason}: {far.detail}")

"""A Panda reaches around a post: plan, give it times, save, draw."""

import rrtik_ompl as rrtik

robot = rrtik.load_robot("panda")
post = rrtik.Obstacle("post", rrtik.Box(0.1, 0.1, 1.0), [0.35, 0.25, 0.5], margin=0.02)
world = rrtik.World(robot, rrtik.Scene([post]))
goal = rrtik.PoseGoal([0.3, 0.5, 0.4, 3.1416, 0.0, 0.0])  # x, y, z [m], roll, pitch, yaw [rad]
problem = rrtik.Problem(world, robot.posture("default"), goal, name="around a post")

path = rrtik.plan(problem, seed=1).require()  # shortened; an error says why if there is none
print(f"{len(path)} waypoints, {path.length:.2f} rad, proven free: {path.proven}")

motion = rrtik.time_parameterize(path, robot, blend=0.2, world=world)
print(f"{motion.duration:.2f} s")
path.save("path.json")
motion.save("motion.csv", rate=250.0)
rrtik.view(problem, motion, html="motion.html")

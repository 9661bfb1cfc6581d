"""An arm from its Denavit-Hartenberg table, in a file that people edit."""

from pathlib import Path

import rrtik_ompl as rrtik

Path("elbow.yaml").write_text("""version: 1
name: elbow
dh:
  convention: standard
  radius: 0.04
  rows:
    - {joint: turn, d: 0.4, alpha_deg: 90, limits_deg: [-170, 170], velocity: 1.5}
    - {joint: lift, a: 0.5, theta_deg: 10, limits_deg: [-30, 120], velocity: 1.5}
    - {joint: bend, a: 0.4, limits_deg: [-150, 150], velocity: 2.0}
postures_deg: {home: [0, 60, -60], stretched: [0, 0, 0]}
""")

robot = rrtik.load_robot("elbow.yaml")
print(robot.joint_names, "tip at home:", robot.fk(robot.posture("home")).translation.round(3))
pillar = rrtik.Obstacle("pillar", rrtik.Cylinder(0.08, 1.6), [0.6, 0.0, 0.8])
world = rrtik.World(robot, rrtik.Scene([pillar]))
plan = rrtik.plan(rrtik.Problem(world, [-0.8, 0.2, 0.3], [0.8, 0.2, 0.3]), seed=1)
print(plan.path if plan.found else plan.reason)

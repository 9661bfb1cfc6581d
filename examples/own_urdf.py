"""An arm of one's own: a URDF with boxes and cylinders, its tip, a posture."""

from pathlib import Path

import rrtik_ompl as rrtik

LINK = """<link name="{0}"><collision><origin xyz="0 0 {5}"/>
<geometry><cylinder radius="0.04" length="{length}"/></geometry></collision></link>
<joint name="{2}" type="revolute"><parent link="{1}"/><child link="{0}"/><origin xyz="0 0 {4}"/>
<axis xyz="{3}"/><limit lower="-2.6" upper="2.6" velocity="2" effort="50"/></joint>"""
PARTS = [  # name, parent, joint, its axis, where it is, half the length
    ("shoulder", "base", "turn", "0 0 1", 0.1, 0.1),
    ("upper", "shoulder", "lift", "0 1 0", 0.25, 0.2),
    ("fore", "upper", "elbow", "0 1 0", 0.45, 0.2),
    ("hand", "fore", "wrist", "0 1 0", 0.45, 0.05),
]
links = "".join(LINK.format(*part, length=1.6 * part[-1]) for part in PARTS)
Path("arm.urdf").write_text(f'<robot name="mine"><link name="base"/>{links}</robot>')

robot = rrtik.load_robot("arm.urdf", tip="hand")
print(robot.name, robot.joint_names, "tip at zero:", robot.fk([0, 0, 0, 0]).translation)
table = rrtik.Obstacle("table", rrtik.Box(0.4, 0.8, 0.05), [0.55, 0, 0.35])
world = rrtik.World(robot, rrtik.Scene([table]))
plan = rrtik.plan(rrtik.Problem(world, [0.9, 0.6, 1.2, 0.4], [-0.9, 0.6, 1.2, 0.4]), seed=1)
print("found" if plan.found else plan.reason, plan.path)

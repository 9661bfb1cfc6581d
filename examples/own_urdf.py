"""An arm of one's own: a URDF with boxes and cylinders, its tip, a posture."""

from pathlib import Path

import rrtik_ompl as rrtik

LINK = """<link name="{name}"><collision><origin xyz="0 0 {half}"/><geometry>{shape}</geometry></collision></link>
<joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{name}"/><origin xyz="0 0 {offset}"/>
<axis xyz="{axis}"/><limit lower="-2.6" upper="2.6" velocity="2" effort="50"/></joint>"""
PARTS = [
    {"name": "shoulder", "parent": "base", "joint": "turn", "axis": "0 0 1", "offset": 0.1, "half": 0.1},
    {"name": "upper", "parent": "shoulder", "joint": "lift", "axis": "0 1 0", "offset": 0.25, "half": 0.2},
    {"name": "fore", "parent": "upper", "joint": "elbow", "axis": "0 1 0", "offset": 0.45, "half": 0.2},
    {"name": "hand", "parent": "fore", "joint": "wrist", "axis": "0 1 0", "offset": 0.45, "half": 0.05},
]
links = "".join(LINK.format(shape=f'<cylinder radius="0.04" length="{1.6 * p["half"]}"/>', **p) for p in PARTS)
Path("arm.urdf").write_text(f'<robot name="mine"><link name="base"/>{links}</robot>')

robot = rrtik.load_robot("arm.urdf", tip="hand")
print(robot.name, robot.joint_names, "tip at zero:", robot.fk([0, 0, 0, 0]).translation)
table = rrtik.Obstacle("table", rrtik.Box([0.4, 0.8, 0.05]), [0.55, 0, 0.35])
world = rrtik.World(robot, rrtik.Scene([table]))
plan = rrtik.plan(rrtik.Problem(world, [0.9, 0.6, 1.2, 0.4], [-0.9, 0.6, 1.2, 0.4]), seed=1)
print("found" if plan.found else plan.reason, plan.path)

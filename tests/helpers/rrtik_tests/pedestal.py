"""An arm of one joint on a tall pedestal, near which things are that no motion of the arm can avoid."""

import rrtik_ompl as rrtik
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.world.world import World

PEDESTAL = """<robot name="pedestal">
<link name="base"><collision><origin xyz="0 0 -0.5"/><geometry><box size="0.3 0.3 1.0"/></geometry></collision></link>
<link name="arm"><collision><origin xyz="0.3 0 0.1"/><geometry><box size="0.6 0.05 0.05"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>"""


def beside_pedestal(tmp_path, *obstacles):
    (tmp_path / "pedestal.urdf").write_text(PEDESTAL)
    robot = rrtik.load_robot(tmp_path / "pedestal.urdf", tip="arm")
    return rrtik.Problem(World(robot, Scene(obstacles)), [-1.0], [1.0])

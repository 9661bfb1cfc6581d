"""An arm that turns, slides and turns."""

import rrtik_ompl as rrtik

SLIDER = """<robot name="slider">
  <link name="base"/><link name="rail"/><link name="arm"/><link name="tool"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="rail"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="arm"/><origin xyz="0.2 0 0.1"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.8" velocity="1" effort="1"/></joint>
  <joint name="wrist" type="revolute"><parent link="arm"/><child link="tool"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
</robot>"""
LINK = """<link name="{0}">
  <collision><origin xyz="{1} 0 0"/><geometry><box size="{2} 0.05 0.05"/></geometry></collision>
</link>"""


def slider(folder):
    """The robot, its file in a folder."""
    text = SLIDER.replace('<link name="arm"/>', LINK.format("arm", 0.15, 0.3))
    text = text.replace('<link name="tool"/>', LINK.format("tool", 0.1, 0.2))
    (folder / "slider.urdf").write_text(text)
    return rrtik.load_robot(folder / "slider.urdf", tip="tool")

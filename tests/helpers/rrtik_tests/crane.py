"""A crane of three joints, its path and its page: what the tests of the viewer share."""

from __future__ import annotations

import json
import re
from types import SimpleNamespace
from typing import Any

import numpy as np

from rrtik_ompl.model.goal import JointGoal
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.shapes import Mesh

URDF = """
<robot name="crane">
  <link name="base"><visual><geometry><cylinder radius="0.2" length="0.1"/></geometry></visual></link>
  <link name="tower"><visual><origin xyz="0 0 0.4"/><geometry><box size="0.12 0.12 0.8"/></geometry></visual></link>
  <link name="jib"><visual><origin xyz="0.4 0 0"/><geometry><box size="0.8 0.1 0.1"/></geometry></visual></link>
  <link name="hand"><visual><geometry><sphere radius="0.07"/></geometry></visual></link>
  <joint name="slew" type="revolute"><parent link="base"/><child link="tower"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="hoist" type="prismatic"><parent link="tower"/><child link="jib"/><axis xyz="0 0 1"/>
    <limit lower="0.1" upper="0.8" velocity="1" effort="1"/></joint>
  <joint name="spin" type="continuous"><parent link="jib"/><child link="hand"/><origin xyz="0.8 0.1 0" rpy="0.3 0 0"/>
    <axis xyz="0 1 0"/><limit velocity="1" effort="1"/></joint>
</robot>"""
WAYPOINTS = np.array([[0.0, 0.2, 0.0], [1.2, 0.2, 0.0], [1.2, 0.7, 0.0], [1.2, 0.7, 4.0], [-1.0, 0.7, 4.0]])
TETRAHEDRON = Mesh(0.3 * np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def problem(robot: Robot, scene: Scene, goal: Any = None) -> Any:
    world = SimpleNamespace(robot=robot, scene=scene)
    return SimpleNamespace(world=world, start=WAYPOINTS[0], goal=goal or JointGoal(WAYPOINTS[-1]), name="lift")


def story(text: str) -> dict[str, Any]:
    found = re.search(r'<script id="story" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    loaded: dict[str, Any] = json.loads(found.group(1))
    return loaded

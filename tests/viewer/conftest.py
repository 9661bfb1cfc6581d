"""A crane among obstacles of every shape, the page that shows it, a tree of MB-RRT, and arms of few triangles."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rrtik_ompl.base.poses import pose
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.ik.mb_rrt.links import Links
from rrtik_ompl.ik.mb_rrt.published import grow
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Prism, Sphere
from rrtik_ompl.viewer import picture
from rrtik_ompl.viewer.drawing.robot_picture import link_parts
from rrtik_ompl.viewer.page import page
from rrtik_tests.crane import TETRAHEDRON, URDF, WAYPOINTS, problem


@pytest.fixture(scope="module")
def coarse_arms() -> Iterator[None]:
    """Arms of few triangles, for pages whose looks are not tested.

    Software draws each arm, its ghosts and its shadow anew in every frame, which took half a second.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(picture, "link_parts", partial(link_parts, triangles=1_000))
        yield


@pytest.fixture(scope="module")
def crane() -> Robot:
    return robot_from_urdf_text(URDF, tip="hand")


@pytest.fixture(scope="module")
def scene() -> Scene:
    drift = TimedPoses([0.0, 4.0], [pose([-1, 0, 0.5]), pose([-1, 1, 0.5])])
    return Scene(
        obstacles=(
            Obstacle("crate", Box([0.3, 0.3, 0.3]), pose([0.9, -0.9, 0.15])),
            Obstacle("pole", Cylinder(0.05, 1.0), pose([-0.9, -0.6, 0.5])),
            Obstacle("bar </script><b>", Capsule(0.05, 0.4), pose([-0.8, 0.9, 0.3])),
            Obstacle("corner/part", Prism([[0, 0], [0.4, 0], [0.4, 0.1], [0.1, 0.1], [0.1, 0.4], [0, 0.4]], 0.2)),
            Obstacle("spike", TETRAHEDRON, pose([0.2, 1.2, 0])),
            Obstacle("ground", HalfSpace([0, 0, 1], -0.06)),
            Obstacle("buoy", Sphere(0.1), pose([1.2, 0.9, 0.9]), ConstantVelocity([0.1, 0, 0])),
            Obstacle("door", Box([0.05, 0.4, 0.4]), pose([-1, 0, 0.5]), drift),
        ),
        attached=(AttachedObject("hook", "hand", Box([0.04, 0.04, 0.2]), pose([0, 0, -0.12])),),
    )


@pytest.fixture(scope="module")
def text(crane: Robot, scene: Scene) -> str:
    return page(problem(crane, scene), SimpleNamespace(waypoints=WAYPOINTS))


@pytest.fixture(scope="module", params=[2, 3])
def tree(request: pytest.FixtureRequest) -> Any:
    """MB-RRT's tree of an arm of four links, in the plane and in space."""
    goal = [0.2, 0.1, 0.2][: request.param]
    return grow(Links([0.1] * 4, request.param), goal, tolerance=0.002, rng=np.random.default_rng(0))

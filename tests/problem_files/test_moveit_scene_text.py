"""Scenes that MoveIt saves as text: both formats, every shape, and one line for every mistake."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from rrtik_ompl.problem_files.scene import load_scene

QUARTER = "0 0 0.7071067811865476 0.7071067811865476"
NEW = f"""(noname)+
* a table with legs
1 0 0.5
{QUARTER}
2
box
0.2 0.4 0.6
0.1 0 0
0 0 0 1
0 0 0 0
cylinder
0.03 0.5
0 0 -0.3
0 0 0 1
0.5 0.5 0.5 1
1
handle
0 0 0
0 0 0 1
* ball
0 0 0
0 0 0 1
1
sphere
0.07
0 2 0
0 0 0 1
0 0 0 0
0
.
"""
OLD = """scene of 2013
* ball
1
sphere
0.07
0 2 0
0 0 0 1
0 0 0 0
* wedge
1
mesh
4 4
0 0 0
1 0 0
0 1 0
0 0 1
0 2 1
0 1 3
0 3 2
1 2 3
0 0 3
0 0 0 1
0 0 0 0
* floor
1
plane
0 0 1 0.25
0 0 0
0 0 0 1
0 0 0 0
.
"""


def scene_of(tmp_path, text):
    (tmp_path / "s.scene").write_text(text)
    return load_scene(tmp_path / "s.scene")


def test_shapes_stand_where_object_and_shape_are_placed(tmp_path):
    table, leg, ball = scene_of(tmp_path, NEW).obstacles
    assert [each.name for each in (table, leg, ball)] == ["a table with legs", "a table with legs_2", "ball"]
    assert isinstance(table.shape, Box)
    np.testing.assert_allclose(table.shape.size, [0.2, 0.4, 0.6])
    np.testing.assert_allclose(table.pose.translation, [1.0, 0.1, 0.5], atol=1e-15)  # a quarter turn about z
    np.testing.assert_allclose(table.pose.rotation, pin.rpy.rpyToMatrix(0, 0, np.pi / 2), atol=1e-15)
    assert isinstance(leg.shape, Cylinder)
    assert (leg.shape.radius, leg.shape.length) == (0.03, 0.5)
    np.testing.assert_allclose(leg.pose.translation, [1.0, 0.0, 0.2], atol=1e-15)
    assert isinstance(ball.shape, Sphere)
    assert ball.shape.radius == 0.07


def test_the_older_format_has_no_poses_of_objects(tmp_path):
    ball, wedge, floor = scene_of(tmp_path, OLD).obstacles
    np.testing.assert_allclose(ball.pose.translation, [0.0, 2.0, 0.0])
    assert isinstance(wedge.shape, Mesh)
    assert wedge.shape.closed
    np.testing.assert_allclose(wedge.pose.translation, [0.0, 0.0, 3.0])
    assert isinstance(floor.shape, HalfSpace)
    assert floor.shape.offset == -0.25  # z + 0.25 = 0
    np.testing.assert_allclose(floor.shape.normal, [0.0, 0.0, 1.0])


def test_it_is_a_scene_for_every_load(tmp_path):
    (tmp_path / "s.scene").write_text(NEW)
    assert len(rrtik.load(tmp_path / "s.scene").obstacles) == 3
    assert len(rrtik.Scene.load(tmp_path / "s.scene").obstacles) == 3


BROKEN = {
    "empty": ("", r"s\.scene:0: the file ends without"),
    "cut off": (NEW[:120], r"s\.scene:\d+: "),
    "no end": (NEW.replace("\n.\n", "\n"), r"ends without the line '\.'"),
    "words for numbers": (NEW.replace("0.07", "big"), r"s\.scene:25: expected 1 finite numbers, found 'big'"),
    "nan": (NEW.replace("0.07", "nan"), r"finite numbers, found 'nan'"),
    "size of 0": (NEW.replace("0.07", "0"), r"s\.scene:25: sphere radius"),
    "half a count": (NEW.replace("\n2\nbox", "\n2.5\nbox"), r"s\.scene:5: expected a whole number"),
    "unknown shape": (NEW.replace("sphere", "teapot"), r"s\.scene:24: shape 'teapot' is not read; have box"),
    "a long quaternion": (NEW.replace(QUARTER, "0 0 1 1"), r"s\.scene:4: .*must have length 1"),
    "no object": (NEW.replace("* ball", "ball"), r"s\.scene:20: expected '\* NAME'"),
    "a name twice": (NEW.replace("* ball", "* a table with legs"), r"s\.scene: .*a table with legs"),
    "a vertex that is not there": (OLD.replace("1 2 3\n", "1 2 9\n"), r"s\.scene:\d+: mesh: .*vertex 9"),
    "yaml": ("version: 1\nscene: {}\n", r"s\.scene:2: expected '\* NAME'"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_mistake_is_one_line_with_its_place(tmp_path, case):
    text, expected = BROKEN[case]
    with pytest.raises(InputError, match=expected) as error:
        scene_of(tmp_path, text)
    assert "\n" not in str(error.value)

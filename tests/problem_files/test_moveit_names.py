"""Every name in a MoveIt scene or request is that of something there, or is told of; errors name the file that errs."""

import re
import warnings

import numpy as np
import pytest

import rrtik_ompl as rrtik
from bench.truth.moveit_pairs import GANTRY, Case, attached, box, joints, pose
from rrtik_ompl.base.errors import RrtikError, SceneWarning, UnknownNameError

FINGER = """<link name="claw"/><joint name="grip" type="prismatic"><parent link="tool"/><child link="claw"/>
<axis xyz="1 0 0"/><limit lower="0" upper="1" velocity="1" effort="1"/></joint></robot>"""
SRDF = """<robot name="gantry"><group name="arm"><chain base_link="base" tip_link="tool"/></group>
<group name="side"><joint name="x"/><joint name="y"/></group></robot>"""


@pytest.fixture
def written(tmp_path):
    """Write a pair beside the gantry with a finger; its folder. Keys of the scene and of the request are added."""

    def write(scene=None, request=None, srdf=False):
        Case(scene or {}, request or {}).write(tmp_path)
        (tmp_path / "gantry.urdf").write_text(GANTRY.replace("</robot>", FINGER))
        if srdf:
            (tmp_path / "gantry.srdf").write_text(SRDF)
        return tmp_path

    return write


def said(folder, robot="gantry.urdf"):
    """The warnings about the scene of a pair, or its refusal."""
    given = folder / robot if isinstance(robot, str) else robot
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            rrtik.load_problem(folder / "scene0001.yaml", robot=given)
        except RrtikError as error:
            return [str(error)]
    return [str(each.message) for each in caught if each.category is SceneWarning]


def line_of(folder, file, word):
    """The line of a file on which a word stands first."""
    text = (folder / file).read_text().split("\n")
    return f"{folder / file}:{next(k for k, line in enumerate(text, 1) if word in line)}: "


def matrix(*names, free=(), **more):
    """A table in which all pairs with one of some names are allowed."""
    rows = [[one != other and bool({one, other} & set(free)) for other in names] for one in names]
    return {"allowed_collision_matrix": {"entry_names": list(names), "entry_values": rows} | more}


def start(**values):
    return {"start_state": {"joint_state": {"name": list(values), "position": list(values.values())}}}


HOLDING = {"attached_collision_objects": [attached(box("rod", [0.1, 0.1, 0.1], pose(0, 0, 0), "tool"))]}
CUP = {"attached_collision_objects": [HOLDING["attached_collision_objects"][0] | {"touch_links": ["tool", "clav"]}]}

TOLD = {  # scene, request, with an SRDF; key, what is said
    "another robot": ({"robot_model_name": "panda"}, {}, True, "robot_model_name: the scene is of robot 'panda'"),
    "touch_links": (
        {"robot_state": CUP},
        {},
        True,
        r"robot_state\.attached_collision_objects\[0\]\.touch_links\[1\]: no link 'clav' .*did you mean 'claw'",
    ),
    "an entry": (
        matrix("tool", "plte", free=["plte"]),
        {},
        True,
        r"entry_names\[1\]: no link or object 'plte'.*mean 'plate'",
    ),
    "an entry that is like nothing": (
        matrix("tool", "fridge", free=["fridge"]),
        {},
        True,
        "no link or object 'fridge'",
    ),
    "two entries": (
        matrix("tool", "fridge", "kettle", free=["fridge", "kettle"]),
        {},
        True,
        r"'fridge'; what is said of it is left out \(so are kettle\)",
    ),
    "a default": (
        matrix(default_entry_names=["plte"], default_entry_values=[True]),
        {},
        True,
        r"default_entry_names\[0\]: no link or object 'plte'.*mean 'plate'",
    ),
    "an entry that is an exception": (
        matrix("tol", "plate", default_entry_names=["plate"], default_entry_values=[True]),
        {},
        True,
        r"entry_names\[0\]: no link or object 'tol'.*mean 'tool'",
    ),
    "a joint of the start": (
        {"robot_state": {"joint_state": {"name": ["grip"], "position": [0.5]}}},
        start(x=0, y=0, z=0, gripp=0.25),
        True,
        r"joint_state\.name\[3\]: no joint 'gripp' .*mean 'grip'",
    ),
    "joints above the goal's": (
        {},
        {"goal_constraints": [{"joint_constraints": joints(0, 0, 0)["joint_constraints"][1:]}]} | start(x=1, y=0, z=0),
        False,
        "group_name: without an SRDF its joints are taken to be those of the goal; held still: x",
    ),
}


@pytest.mark.parametrize("name", TOLD)
def test_what_is_not_there_is_told_with_its_file_line_and_key(written, name):
    scene, request, srdf, words = TOLD[name]
    [line] = said(written(scene, request, srdf))
    assert re.match(r".*/(scene|request)0001\.yaml:\d+: .*" + words, line)


SILENT = {
    "as it should be": (matrix("tool", "a", "plate", free=["plate"]), start(x=0, y=0, z=0, grip=0.2)),
    "links of a form with more links": (matrix("tool", "tool_b", "plate", free=["tool_b"]), {}),
    "an entry that decides nothing": (matrix("tool", "fridge"), {}),
    "a map that is not there": (matrix("tool", "<octomap>", free=["<octomap>"]), {}),
    "an object that was taken away": (
        matrix("tool", "can", free=["can"]) | {"world": {"collision_objects": [{"id": "can", "operation": "remove"}]}},
        {},
    ),
    "a joint of something else": ({}, start(x=0, y=0, z=0, wheel=2)),
    "a frame that stands in itself, as MotionBenchMaker's Fetch": (
        {"fixed_frame_transforms": [{"header": {"frame_id": "tool"}, "child_frame_id": "/tool"}]},
        {},
    ),
}


@pytest.mark.parametrize("srdf", [True, False])
@pytest.mark.parametrize("name", SILENT)
def test_sound_files_say_nothing(written, name, srdf):
    assert said(written(*SILENT[name], srdf)) == []


def test_the_file_name_of_a_robot_is_a_name_of_it_too(written):
    folder = written()
    text = (folder / "gantry.urdf").read_text()
    (folder / "gantry.urdf").write_text(text.replace('name="gantry"', 'name="g"'))
    assert said(folder) == []


def test_a_robot_of_the_caller_that_moves_other_joints_than_the_group_is_told(written):
    folder = written({}, {"group_name": "side"}, srdf=True)
    file, srdf = folder / "gantry.urdf", folder / "gantry.srdf"
    [line] = said(folder, rrtik.load_robot(file, srdf=srdf, group="arm"))
    assert line.startswith(line_of(folder, "request0001.yaml", "group_name") + "group_name: ")
    assert re.search("'side' .*x, y, .*x, y, z$", line)
    written({}, {"group_name": "amr"}, srdf=True)
    [line] = said(folder, rrtik.load_robot(file, srdf=srdf, group="arm"))
    assert "group_name: " in line
    assert "no group 'amr'; did you mean 'arm'? have arm, side" in line
    written({}, {"group_name": "arm"}, srdf=True)
    assert said(folder, rrtik.load_robot(file, srdf=srdf, joints=["x", "y", "z"])) == []


def test_a_robot_of_the_caller_whose_fingers_are_elsewhere_is_told(written):
    folder = written({}, start(x=0, y=0, z=0, grip=0.25))
    load = {"joints": ["x", "y", "z"]}
    [line] = said(folder, rrtik.load_robot(folder / "gantry.urdf", **load))
    assert "start_state.joint_state: joint 'grip' is at 0.25" in line
    assert said(folder, rrtik.load_robot(folder / "gantry.urdf", locked={"grip": 0.25}, **load)) == []


# --- the state, the base, the goal ----------------------------------------------------------------------------------


def base_in(frame):
    transform = {"translation": [0, 0, 1], "rotation": [0, 0, 0, 1]}
    return {"multi_dof_joint_state": {"header": {"frame_id": frame}, "transforms": [transform]}}


def short():
    return {"joint_state": {"name": ["x", "y"], "position": [0, 0, 0]}}


def goal(*wanted):
    """A goal of joints."""
    return {"goal_constraints": [{"joint_constraints": list(wanted)}]}


X, Y, Z = joints(1, 0, 0)["joint_constraints"]
FAULTY = {
    "positions of the request": ({}, {"start_state": short()}, "request", "start_state.joint_state: 2 joint names"),
    "positions of the scene": ({"robot_state": short()}, {}, "scene", "robot_state.joint_state: 2 joint names, but 3"),
    "base of the request": (
        {},
        {"start_state": base_in("map")},
        "request",
        "start_state.multi_dof_joint_state: the base is given in frame 'map'",
    ),
    "base of the scene": (
        {"robot_state": base_in("map")},
        {},
        "scene",
        "robot_state.multi_dof_joint_state: the base is given in frame 'map'",
    ),
    "group": ({}, {"group_name": "amr"}, "request", "group_name: .*no group 'amr'.*did you mean 'arm'"),
    "link": (
        {},
        {"goal_constraints": [{"position_constraints": [{"link_name": "tol", "constraint_region": {}}]}]},
        "request",
        r"goal_constraints\[0\]: .*'tol'",
    ),
    "joint": (
        {},
        goal(X, Y, Z, {"joint_name": "zz", "position": 0}),
        "request",
        r"goal_constraints\[0\]: no joint of robot 'gantry' 'zz'",
    ),
    "joint of no group": (
        {},
        goal(X, Y, Z, {"joint_name": "grip", "position": 0.5}),
        "request",
        r"goal_constraints\[0\]: joint 'grip' is none of group 'arm', so that no path brings it to 0\.5",
    ),
    "joint that is free": (
        {},
        goal(X, Y),
        "request",
        r"goal_constraints\[0\]: no value for joint 'z' of group 'arm'; a goal that leaves joints free is not read",
    ),
    "joint with two positions": (
        {},
        goal(X, Y, Z, {"joint_name": "x", "position": 0}),
        "request",
        "joint 'x' has two positions",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTY)
def test_a_fault_names_the_file_line_and_key_that_has_it(written, name):
    scene, request, file, words = FAULTY[name]
    [line] = said(written(scene, request, srdf=True))
    assert re.match(rf".*/{file}0001\.yaml:\d+: .*{words}", line)
    assert line.count("0001.yaml") == 1


def test_a_robot_that_the_caller_names_wrongly_is_no_fault_of_the_scene(written):
    with pytest.raises(UnknownNameError, match=r"^no robot 'gantri'"):
        rrtik.load_problem(written() / "scene0001.yaml", robot="gantri")


def test_a_goal_that_leaves_out_a_joint_between_two_of_it_is_refused_without_an_srdf(written):
    folder = written({}, goal(X, Z))
    [line] = said(folder)
    assert re.search(
        r"request0001\.yaml:\d+: goal_constraints\[0\]\.joint_constraints: it leaves out joint 'y' above 'z', and "
        r"without an SRDF the joints of group 'arm' are not known; put the SRDF beside the URDF",
        line,
    )


def test_a_goal_of_a_joint_that_is_there_already_is_taken(written):
    grip = {"joint_name": "grip", "position": 0.5, "tolerance_below": 0.1}
    folder = written({}, goal(X, Y, Z, grip) | start(x=0, y=0, z=0, grip=0.45), True)
    assert said(folder) == []


def test_a_group_that_the_goal_names_is_asked_of_a_moveit_folder_too(written):
    folder = written(
        {},
        {"group_name": "side"} | goal(X, Y),
        True,
    )
    problem = rrtik.load_problem(folder / "scene0001.yaml", robot=folder)
    assert problem.robot.joint_names == ("x", "y")


def test_joints_and_base_are_where_the_scene_has_them_if_the_request_says_nothing(written):
    state = {"joint_state": {"name": ["grip"], "position": [0.25]}} | base_in("world")
    folder = written({"robot_state": state})
    robot = rrtik.load_problem(folder / "scene0001.yaml", robot=folder / "gantry.urdf").robot
    np.testing.assert_allclose(robot.fk([0, 0, 0], "claw").translation, [0.25, 0, 1])


@pytest.mark.parametrize("named", [True, False])
def test_what_a_scaled_link_holds_is_scaled_also_if_it_comes_from_the_world(written, named):
    rod = box("rod", [0.4, 0.02, 0.02], pose(0.1, 0, 0.5))
    scene = {
        "world": {"collision_objects": [rod] if named else []},
        "robot_state": {"attached_collision_objects": [attached({"id": "rod"} if named else rod)]},
        "link_scale": [{"link_name": "tool", "scale": 2.0}],
    }
    folder = written(scene)
    [held] = rrtik.load_problem(folder / "scene0001.yaml", robot=folder / "gantry.urdf").world.scene.attached
    np.testing.assert_allclose(held.shape.size, [0.8, 0.04, 0.04])
    np.testing.assert_allclose(held.pose.translation, [0.1, 0, 0.5])

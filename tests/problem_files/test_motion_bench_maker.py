"""MotionBenchMaker pairs: what is read from them, what is refused, and the Panda set itself."""

import tarfile

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError, ProblemError, RrtikError
from rrtik_ompl.model.goal import JointGoal, PoseGoal, PositionGoal
from rrtik_ompl.model.shapes import Box, Cylinder, Sphere
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_tests.places import ROOT

ARCHIVE = ROOT.parent / "shared" / "data" / "mbm_panda.tar.bz2"
URDF = """<robot name="crane"><link name="base"/><link name="car"/><link name="hook">
<collision><geometry><sphere radius="0.1"/></geometry></collision></link><link name="claw">
<collision><origin xyz="0.3 0 0"/><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="rail" type="prismatic"><parent link="base"/><child link="car"/><axis xyz="1 0 0"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="hoist" type="prismatic"><parent link="car"/><child link="hook"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="grip" type="prismatic"><parent link="hook"/><child link="claw"/><axis xyz="1 0 0"/>
<limit lower="0" upper="1" velocity="1" effort="1"/></joint></robot>"""
SCENE = """robot_model_name: crane
allowed_collision_matrix:
  entry_names: [hook, crate, claw]
  entry_values: [[false, OK, true], [OK, false, false], [true, false, false]]
world:
  collision_objects:
    - id: crate
      pose: {position: [5, 0, 0], orientation: [0, 0, 0.7071067811865476, 0.7071067811865476]}
      primitives: [{type: box, dimensions: [1, 2, 3]}, {type: cylinder, dimensions: [0.5, 0.1]}]
      primitive_poses:
        - {position: [1, 0, 0], orientation: [0, 0, 0, 1]}
        - {position: [0, 0, 2], orientation: [0, 0, 0, 1]}
    - id: ball
      header: {frame_id: world}
      primitives: [{type: sphere, dimensions: [0.2]}]
      primitive_poses: [{position: [0, 9, 0]}]"""
REQUEST = """start_state:
  joint_state: {name: [grip, hoist, rail], position: [0.25, 0.5, -1]}
  multi_dof_joint_state: {joint_names: [virtual_joint], transforms: [{translation: [0, 0, 0], rotation: [0, 0, 0, 1]}]}
goal_constraints: [GOAL]
group_name: arm"""
JOINTS = "{joint_constraints: [{joint_name: hoist, position: 0.75}, {joint_name: rail, position: 1.5}]}"
BALL = (
    "position_constraints: [{link_name: claw, target_point_offset: {x: 0, y: 0, z: 0}, constraint_region: {"
    "primitives: [{type: sphere, dimensions: [0.01]}], primitive_poses: [{position: [1, 0, 0.5]}]}}]"
)
TURN = "orientation_constraints: [{link_name: claw, orientation: [0, 0, 0, 1], absolute_x_axis_tolerance: 0.1}]"


@pytest.fixture
def pair(tmp_path):
    (tmp_path / "crane.urdf").write_text(URDF)

    def write(scene=SCENE, request=REQUEST, goal=JOINTS):
        (tmp_path / "scene0007.yaml").write_text(scene.replace("OK", "true"))
        (tmp_path / "request0007.yaml").write_text(request.replace("GOAL", goal))
        return tmp_path / "scene0007.yaml"

    return write


def load(scene):
    return load_motion_bench_maker(scene, robot=scene.parent / "crane.urdf")


def test_objects_become_obstacles_with_composed_poses(pair):
    scene = load(pair()).world.scene
    assert scene.names == ("crate", "crate_2", "ball")
    box, cylinder, ball = scene.obstacles
    assert isinstance(box.shape, Box)
    assert box.shape.size.tolist() == [1, 2, 3]
    np.testing.assert_allclose(box.pose.translation, [5, 1, 0], atol=1e-15)
    np.testing.assert_allclose(box.pose.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    assert cylinder.shape == Cylinder(radius=0.1, length=0.5)
    np.testing.assert_allclose(cylinder.pose.translation, [5, 0, 2], atol=1e-15)
    assert ball.shape == Sphere(0.2)
    assert ball.pose.translation.tolist() == [0, 9, 0]


def test_joints_are_taken_by_name_and_the_others_are_held_where_they_start(pair):
    problem = load(pair())
    robot = problem.world.robot
    named = dict(zip(robot.joint_names, problem.start, strict=True))
    assert named == {"rail": -1.0, "hoist": 0.5}
    assert isinstance(problem.goal, JointGoal)
    assert dict(zip(robot.joint_names, problem.goal.q, strict=True)) == {"rail": 1.5, "hoist": 0.75}
    np.testing.assert_allclose(robot.fk(problem.start, "claw").translation, [-1 + 0.25, 0, 0.5])


def test_a_start_may_name_joints_that_the_robot_lacks_and_its_description_is_read_once(pair):
    states = (
        ("[grip, hoist, rail, wheel]", "[0.25, 0.5, -1, 7]"),
        ("[base_joint, grip, hoist, rail]", "[3, 0.25, 0.5, -1]"),
    )
    robots = []
    for names, values in states:
        request = REQUEST.replace("[grip, hoist, rail]", names).replace("[0.25, 0.5, -1]", values)
        robots.append(load(pair(request=request)).world.robot)
    assert robots[0] is robots[1]
    assert robots[0].movable == {"grip", "hoist", "rail"}


def test_allowed_collisions_with_obstacles_are_used(pair):
    assert ("hook", "crate") in load(pair()).world.scene.allowed_collisions


def test_the_base_stands_where_the_start_state_says(pair):
    problem = load(pair(request=REQUEST.replace("translation: [0, 0, 0]", "translation: [0, 1, 2]")))
    np.testing.assert_allclose(problem.world.robot.fk([0, 0], "hook").translation, [0, 1, 2])


def test_a_ball_is_a_position_goal_and_with_an_orientation_a_pose_goal(pair):
    both = REQUEST.replace("[0.25, 0.5, -1]", "[0.2, 0, 0]")
    problem = load(pair(request=both, goal=f"{{{BALL}}}"))
    assert isinstance(problem.goal, PositionGoal)
    assert (problem.goal.position.tolist(), problem.goal.tolerance) == ([1, 0, 0.5], 0.01)
    assert problem.world.robot.tip == "claw"
    problem = load(pair(request=both, goal=f"{{{BALL}, {TURN}}}"))
    assert isinstance(problem.goal, PoseGoal)
    assert (problem.goal.position_tolerance, problem.goal.orientation_tolerance) == (0.01, 0.01)


def test_load_problem_recognises_either_file_of_the_pair(pair):
    scene = pair()
    urdf = str(scene.parent / "crane.urdf")
    for file in (scene, scene.with_name("request0007.yaml")):
        np.testing.assert_array_equal(load_problem(file, robot=urdf).start, load(scene).start)


def test_a_pair_can_be_written_as_a_problem_file(pair, tmp_path):
    problem = load(pair())
    problem.save(tmp_path / "converted.yaml")
    copy = load_problem(tmp_path / "converted.yaml")
    np.testing.assert_array_equal(copy.start, problem.start)
    np.testing.assert_array_equal(copy.goal.q, problem.goal.q)
    np.testing.assert_allclose(copy.world.robot.fk([0, 0], "claw").translation, [0.25, 0, 0])
    assert copy.world.scene.names == problem.world.scene.names


BAD_SCENES = {
    "unknown robot": (("crane\n", "crain\n"), "scene0007.yaml:1: robot_model_name: no robot 'crain'"),
    "robot of no name": (("robot_model_name: crane", "robot_model_name: ''"), r"scene0007.yaml:1: robot_model_name: "),
    "robot missing": (("robot_model_name: crane\n", ""), "robot_model_name: missing"),
    "too few sizes": (("[1, 2, 3]", "[1, 2]"), r"scene0007\.yaml:7: .*collision_objects\[0\]: a box has 3 dimensions"),
    "unknown shape": (("type: sphere", "type: cone"), r"primitives\[0\]\.type: must be 'box', 'cylinder' or 'sphere'"),
    "negative size": (("[0.2]", "[-0.2]"), "must be 1e-06 or more, found -0.2"),
    "poses missing": (("primitive_poses: [{position: [0, 9, 0]}]", "primitive_poses: []"), "'ball' has 1 primitives"),
    "other frame": (
        ("frame_id: world", "frame_id: camera"),
        r"collision_objects\[1\]: no frame 'camera'; did you mean 'car'",
    ),
    "mesh": (("header:", "meshes: [{}]\n      header:"), "'ball' has 1 meshes, but 0 mesh_poses"),
    "no plane": (("header:", "planes: [{coef: [1]}]\n      header:"), r"planes\[0\]\.coef"),
    "name twice": (("id: ball", "id: crate"), "'crate' is used 2 times"),
    "ragged table": (("[true, false, false]]", "[true, false]]"), "entry_values must be a table of 3 x 3"),
}


@pytest.mark.parametrize(("change", "message"), BAD_SCENES.values(), ids=BAD_SCENES)
def test_a_wrong_scene_is_one_line(pair, change, message):
    scene = pair(SCENE.replace(*change))
    robot = None if "robot" in message else scene.parent / "crane.urdf"
    with pytest.raises(InputError, match=message) as caught:
        load_motion_bench_maker(scene, robot=robot)
    assert "scene0007.yaml" in str(caught.value)


BAD_REQUESTS = {
    "no goal": ("", r"request0007\.yaml:4: goal_constraints"),
    "unknown joint": ("{joint_constraints: [{joint_name: crank, position: 1}]}", "crank"),
    "nothing": ("{}", "goal: give joint_constraints, or one position"),
    "orientation alone": (f"{{{TURN}}}", "goal: give joint_constraints, or one position"),
    "joint value is text": ("{joint_constraints: [{joint_name: rail, position: one}]}", "must be a number, found text"),
    "two links": (f"{{{BALL}, {TURN.replace('claw', 'hook')}}}", "constraints on two links"),
    "cylinder region": (
        f"{{{BALL.replace('sphere, dimensions: [0.01]', 'cylinder, dimensions: [1, 1]')}}}",
        "one sphere or one box",
    ),
    "shifted and turned": (f"{{{BALL.replace('z: 0', 'z: 1')}, {TURN}}}", "target_point_offset together with"),
    "unknown link": (f"{{{BALL.replace('claw', 'jaw')}}}", "jaw"),
}


@pytest.mark.parametrize(("goal", "message"), BAD_REQUESTS.values(), ids=BAD_REQUESTS)
def test_a_wrong_request_is_one_line(pair, goal, message):
    with pytest.raises(InputError, match=message) as caught:
        load(pair(goal=goal))
    assert "0007.yaml" in str(caught.value)


def test_a_start_without_a_value_for_a_joint_is_refused(pair):
    request = REQUEST.replace("[grip, hoist, rail], position: [0.25, 0.5, -1]", "[grip, hoist], position: [0.25, 0.5]")
    with pytest.raises(InputError, match=r"request0007\.yaml:2: .*'rail'"):
        load(pair(request=request))


def test_a_missing_partner_is_named(pair):
    scene = pair()
    scene.with_name("request0007.yaml").unlink()
    with pytest.raises(InputError, match=r"request0007\.yaml: no such file"):
        load(scene)


def test_files_that_are_called_otherwise_are_given_both(pair, tmp_path):
    scene = pair()
    scene.rename(tmp_path / "world.yaml")
    with pytest.raises(InputError, match="give both"):
        load(tmp_path / "world.yaml")
    request = tmp_path / "request0007.yaml"
    assert load_motion_bench_maker(tmp_path / "world.yaml", request, tmp_path / "crane.urdf").start.shape == (2,)


def test_a_start_in_collision_names_the_request(pair):
    scene = SCENE.replace("position: [0, 9, 0]", "position: [-1, 0, 0.5]")
    with pytest.raises(ProblemError, match=r"request0007\.yaml.*ball"):
        load(pair(scene))


@pytest.fixture(scope="module")
def panda_set(tmp_path_factory):
    if not ARCHIVE.is_file():
        pytest.skip(f"the Panda set is not there ({ARCHIVE.name})")
    folder = tmp_path_factory.mktemp("mbm")
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(folder, filter="data")
    return next(folder.rglob("panda.urdf")).parent


def test_all_700_panda_problems_load_with_free_start_and_goal(panda_set):
    scenes = sorted((panda_set / "problems").glob("*/scene*.yaml"))
    assert len(scenes) == 700
    failures = []
    for scene in scenes:
        try:
            problem = load_motion_bench_maker(scene, robot=panda_set / "panda.urdf")
        except RrtikError as error:
            failures.append(str(error))
            continue
        assert problem.world.robot.dof == 7
        assert problem.world.valid(problem.start)
        assert problem.world.valid(problem.goal.q)
    assert failures == []


def test_a_panda_problem_loads_with_the_robot_of_the_registry(panda_set):
    problem = load_problem(panda_set / "problems" / "box_panda" / "scene0001.yaml")
    assert problem.world.robot.name == "panda"
    np.testing.assert_allclose(problem.start, [0, -0.785, 0, -2.356, 0, 1.571, 0.785])

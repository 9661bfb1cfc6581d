"""Problem files: every kind of robot, start and goal; writing and reading; errors with file and line; the schema."""

import json
import subprocess
import sys
from copy import deepcopy

import coal
import jsonschema
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError, ProblemError, RrtikError, UnknownNameError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.description.catalog import list_problems
from rrtik_ompl.files.strict_yaml import read_yaml, write_yaml
from rrtik_ompl.model.goal import GoalSet, JointGoal, PoseGoal, PositionGoal
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.problem_files.problem_values import load_unchecked, problem_schema
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

ARM = "{planar: {lengths: [1, 1, 1], limits_deg: [[-170, 170], [-170, 170], [-170, 170]], radius: 0.01}}"
URDF = """<robot name="slide"><link name="base"/><link name="car"/><link name="tool">
<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="rail" type="prismatic"><parent link="base"/><child link="car"/><axis xyz="1 0 0"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="turn" type="revolute"><parent link="car"/><child link="tool"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>"""
SRDF = """<robot name="slide"><group name="arm"><chain base_link="base" tip_link="tool"/></group>
<group_state name="home" group="arm"><joint name="rail" value="0.5"/><joint name="turn" value="1"/></group_state>
</robot>"""


def text(robot=ARM, start="{joints_deg: [0, 0, 0]}", goal="{joints_deg: [90, 0, 0]}", rest=""):
    return f"version: 1\nrobot: {robot}\nstart: {start}\ngoal: {goal}\n{rest}"


def load(folder, content):
    file = folder / "task.yaml"
    file.write_text(content)
    return load_problem(file)


@pytest.fixture
def slide(tmp_path):
    (tmp_path / "slide.urdf").write_text(URDF)
    (tmp_path / "slide.srdf").write_text(SRDF)
    return "{urdf: slide.urdf, srdf: slide.srdf, group: arm}"


def test_degrees_become_radians(tmp_path):
    problem = load(tmp_path, text())
    np.testing.assert_array_equal(problem.goal.q, [np.pi / 2, 0, 0])
    assert problem.name == "task"


def test_radians_stay_as_they_are(tmp_path):
    np.testing.assert_array_equal(load(tmp_path, text(start="{joints: [0.1, 0.2, 0.3]}")).start, [0.1, 0.2, 0.3])


def test_sliding_joints_are_metres_even_in_degrees(tmp_path, slide):
    problem = load(tmp_path, text(slide, "{joints_deg: [0.5, 90]}", "{joints: [1, 0]}"))
    np.testing.assert_allclose(problem.start, [0.5, np.pi / 2])


def test_a_named_posture_can_be_start_and_goal(tmp_path, slide):
    problem = load(tmp_path, text(slide, "{posture: home}", "{posture: home}"))
    np.testing.assert_array_equal(problem.start, [0.5, 1.0])
    np.testing.assert_array_equal(problem.goal.q, [0.5, 1.0])


def test_an_unknown_posture_lists_the_known_ones(tmp_path, slide):
    with pytest.raises(UnknownNameError, match=r"task\.yaml:3: start: .*'hom'.*home"):
        load(tmp_path, text(slide, "{posture: hom}"))


def test_every_kind_of_goal_is_read(tmp_path):
    place = "pose: {xyz: [1, 1, 0], rpy_deg: [0, 0, 90]}"
    goal = load(tmp_path, text(goal=f"{{{place}, position_tolerance: 0.002, orientation_tolerance: 0.03}}")).goal
    assert isinstance(goal, PoseGoal)
    assert (goal.position_tolerance, goal.orientation_tolerance) == (0.002, 0.03)
    np.testing.assert_allclose(goal.T_world_tip.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    goal = load(tmp_path, text(goal="{position: [1, 1, 0], tolerance: 0.005}")).goal
    assert isinstance(goal, PositionGoal)
    assert (goal.position.tolist(), goal.tolerance) == ([1, 1, 0], 0.005)
    goal = load(tmp_path, text(goal=f"{{any_of: [{{{place}}}, {{position: [1, 0, 0]}}]}}")).goal
    assert isinstance(goal, GoalSet)
    assert [type(member) for member in goal.members] == [PoseGoal, PositionGoal]
    goal = load(tmp_path, text(goal=f"{{region: {{{place}, free_rotation_axis: z, box: [0.1, 0, 0]}}}}")).goal
    assert (goal.free_rotation_axis, goal.box.tolist()) == ("z", [0.1, 0, 0])
    words = "frame: {xyz: [1, 0, 0]}, tip: {xyz: [0, 0, 0.1]}, y: [0, 0.2], yaw_deg: [-90, 90]"
    goal = load(tmp_path, text(goal=f"{{task_region: {{{words}}}}}")).goal
    assert goal.bounds.tolist() == [[0, 0], [0, 0.2], [0, 0], [0, 0], [0, 0], [-np.pi / 2, np.pi / 2]]
    assert goal.T_w_tip.translation.tolist() == [0, 0, 0.1]
    words = f"{place}, axis: [0, 0, 1], through: [2, 1, 0], turn_deg: [0, 90], slide: [-0.1, 0]"
    goal = load(tmp_path, text(goal=f"{{any_of: [{{about_axis: {{{words}}}}}]}}")).goal.members[0]
    np.testing.assert_allclose(goal.poses(np.eye(6)[5:] * np.pi / 2)[0, :3, 3], [2, 0, 0], atol=1e-12)


def test_the_resolution_is_passed_on_and_has_a_default(tmp_path):
    assert load(tmp_path, text(rest="motion_resolution: 0.05\n")).world.motion_resolution == 0.05
    assert load(tmp_path, text()).world.motion_resolution == 0.01


def test_another_robot_can_take_the_place_of_the_one_in_the_file(tmp_path, slide):
    (tmp_path / "task.yaml").write_text(text("titan4", "{joints: [0, 0]}", "{joints: [1, 1]}"))
    problem = load_problem(tmp_path / "task.yaml", robot=str(tmp_path / "slide.urdf"))
    assert problem.world.robot.joint_names == ("rail", "turn")


BOUNDS = [[-0.1, 0.2], [0, 0], [0, 1 / 3], [-4, 4], [0.1, 0.1], [-0.2, 0.3]]
GOALS = [
    JointGoal([0.1, 1 / 3, -1e-17]),
    PositionGoal([0.1, 0.2, 0.3], 1e-5),
    PoseGoal(pose([0.1, 0.2, 0.3], [0.1, 0.7, 0.5, 0.5]), 1e-4, 0.2),
    GoalSet([PoseGoal(pose([1, 0, 0])), PositionGoal([0, 1, 0])]),
    GoalSet([PoseGoal(pose([1, 0, 0]), 0.01)], "y", [0, 0.1, 0]),
    GoalSet([PoseGoal(pose([1, 0, 0]), 0.01), PoseGoal(pose([0, 1, 0])), PositionGoal([0, 1, 0])], "z"),
    TaskRegion(pose([1, 0, 0], [0.1, 0.7, 0.5, 0.5]), BOUNDS, pose([0, 0.1, 0]), 0.01, 0.02),
    TaskRegion.about_axis(pose([1, 0, 0.2]), [0, 0.6, 0.8], through=[1, 0.1, 0], slide=[-0.1, 1 / 3]),
    GoalSet([TaskRegion.about_axis(pose([1, 0, 0.2]), [0, 0, 1]), PoseGoal(pose([1, 0, 0]))]),
]


@pytest.mark.parametrize("goal", GOALS, ids=lambda goal: type(goal).__name__)
def test_a_problem_survives_writing_and_reading(tmp_path, goal):
    world = load(tmp_path, text()).world
    problem = Problem(world, [0.1 + 0.2, 1 / 3, 0], goal)
    problem.save(tmp_path / "copy.yaml")
    copy = load_problem(tmp_path / "copy.yaml")
    np.testing.assert_array_equal(copy.start, problem.start)
    assert type(copy.goal) is type(goal)
    assert copy.world.motion_resolution == world.motion_resolution
    np.testing.assert_array_equal(copy.world.robot.lower, world.robot.lower)
    Q = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    np.testing.assert_allclose(copy.goal.distance(world.robot, Q), goal.distance(world.robot, Q), rtol=1e-9)
    jsonschema.validate(read_yaml(tmp_path / "copy.yaml").data, problem_schema())


def test_files_of_a_robot_are_named_relative_to_the_new_file(tmp_path, slide):
    problem = load(tmp_path, text(slide, "{posture: home}", "{joints: [1, 1]}"))
    (tmp_path / "sub").mkdir()
    problem.save(tmp_path / "sub" / "copy.yaml")
    assert read_yaml(tmp_path / "sub" / "copy.yaml").data["robot"]["urdf"] == "../slide.urdf"
    assert load_problem(tmp_path / "sub" / "copy.yaml").world.robot.joint_names == ("rail", "turn")


def test_what_the_format_has_no_words_for_is_refused(tmp_path):
    world = load(tmp_path, text()).world
    with pytest.raises(InputError, match="goal: a problem file can"):
        Problem(world, [0, 0, 0], JointGoal([0, 0, 0], 0.1)).save(tmp_path / "copy.yaml")
    assert not (tmp_path / "copy.yaml").exists()


WALL = "scene: {obstacles: [{name: wall, box: [0.2, 0.2, 1], pose: {xyz: [X, Y, 0]}}]}\n"


def test_a_start_in_collision_names_file_line_and_pair(tmp_path):
    with pytest.raises(ProblemError, match=r"task\.yaml:3: start.*collision.*wall") as caught:
        load(tmp_path, text(rest=WALL.replace("X", "2.5").replace("Y", "0")))
    assert any("wall" in pair for pair in caught.value.contacts)


def test_a_goal_in_collision_names_its_line(tmp_path):
    with pytest.raises(ProblemError, match=r"task\.yaml:4: goal.*collision.*wall"):
        load(tmp_path, text(rest=WALL.replace("X", "0").replace("Y", "2.5")))


def test_a_goal_outside_the_limits_names_its_line_and_joint(tmp_path):
    with pytest.raises(ProblemError, match=r"task\.yaml:4: goal: .*joint2"):
        load(tmp_path, text(goal="{joints_deg: [0, 171, 0]}"))


def region(words):
    return text(goal=f"{{task_region: {{frame: {{xyz: [1, 0, 0]}}, {words}}}}}")


BAD = {
    "no version": (text().replace("version: 1\n", ""), "version: missing"),
    "version 2": (text().replace("version: 1", "version: 2"), ":1: version: must be 1, found 2"),
    "version true": (text().replace("version: 1", "version: true"), ":1: version: must be 1, found true"),
    "no robot": ("version: 1\nstart: {joints: [0]}\ngoal: {joints: [0]}\n", "robot: missing"),
    "no start": (f"version: 1\nrobot: {ARM}\ngoal: {{joints: [0, 0, 0]}}\n", "start: missing"),
    "empty goal": (text(goal=""), ":4: goal: nothing stands after the colon"),
    "unknown robot": (text("titan5"), ":2: robot: no robot 'titan5'; .*titan4"),
    "robot is a number": (text("4"), ":2: robot: robot needs one of the keys name, moveit, mjcf, planar"),
    "robot of two kinds": (text("{planar: {lengths: [1]}, urdf: a.urdf}"), "robot.urdf: unknown key 'urdf'"),
    "no such option": (text("{name: titan4, limit: envelope}"), "robot: .*no option 'limit'"),
    "no such limits": (text("{name: titan4, limits: enveloppe}"), "robot: .*enveloppe"),
    "missing urdf": (text("{urdf: missing.urdf}"), r":2: robot: .*missing\.urdf: no such file"),
    "links without length": (text("{planar: {lengths: []}}"), "robot.planar.lengths: needs at least 1"),
    "limits in radians key": (text("{planar: {lengths: [1], limits: [[0, 1]]}}"), "did you mean 'limits_deg'"),
    "a limit for one joint only": (text("{planar: {lengths: [1, 1, 1], limits_deg: [[0, 9]]}}"), "limits_deg"),
    "negative radius": (text("{point2d: {radius: -1, bounds: [[0, 1], [0, 1]]}}"), "radius: must be 0 or more"),
    "bounds of one axis": (text("{point2d: {bounds: [[0, 1]]}}"), "bounds: needs at least 2"),
    "too few joints": (text(start="{joints: [0, 0]}"), ":3: start: joints: robot '.*' has 3 joints"),
    "too many joints": (text(goal="{joints_deg: [0, 0, 0, 0]}"), ":4: goal: joints_deg: .*4 values"),
    "a joint is text": (text(start="{joints: [0, a, 0]}"), r":3: start\.joints\[1\]: must be a number, found text 'a'"),
    "a joint is nan": (text(start="{joints: [0, .nan, 0]}"), r"start\.joints\[1\]: must be a finite number"),
    "joints as text": (text(start="{joints: 0 0 0}"), r"start\.joints: must be a list"),
    "start as list": (text(start="[0, 0, 0]"), ":3: start: start needs one of the keys joints_deg, joints, posture"),
    "start by pose": (text(start="{pose: {xyz: [1, 0, 0]}}"), "start needs one of the keys"),
    "two kinds of goal": (text(goal="{joints: [0, 0, 0], pose: {xyz: [1, 0, 0]}}"), "goal.pose: unknown key 'pose'"),
    "unknown goal": (text(goal="{point: [1, 0, 0]}"), ":4: goal: goal needs one of the keys joints_deg, joints"),
    "zero tolerance": (text(goal="{position: [1, 0, 0], tolerance: 0}"), "goal.tolerance: must be greater than 0"),
    "wrong tolerance": (text(goal="{pose: {xyz: [1, 0, 0]}, tolerance: 1}"), "did you mean .*tolerance"),
    "position in 2-D": (text(goal="{position: [1, 0]}"), "goal.position: needs at least 3"),
    "nothing of any_of": (text(goal="{any_of: []}"), "goal.any_of: needs at least 1"),
    "joints in any_of": (text(goal="{any_of: [{joints: [0, 0, 0]}]}"), r"goal\.any_of\[0\]: a goal of the tip needs"),
    "axis of a region": (text(goal="{region: {pose: {xyz: [1, 0, 0]}, free_rotation_axis: w}}"), "'x', 'y' or 'z'"),
    "negative region": (text(goal="{region: {pose: {xyz: [1, 0, 0]}, box: [-1, 0, 0]}}"), r"box\[0\]: must be 0 or"),
    "ranges upside down": (region("x: [0.2, 0.1]"), ":4: goal: .*x goes from 0.2 up to 0.1"),
    "a range of nan": (region("yaw: [.nan, 1]"), r"goal\.task_region\.yaw\[0\]: must be a finite number"),
    "a range of one": (region("yaw: [1]"), r"task_region\.yaw: needs at least 2"),
    "two units": (region("yaw: [0, 1], yaw_deg: [0, 9]"), "give yaw or yaw_deg, not both"),
    "a range of nothing known": (region("jaw: [0, 1]"), "unknown key 'jaw'; did you mean 'yaw'"),
    "a region without a frame": (text(goal="{task_region: {x: [0, 1]}}"), "task_region.frame: missing"),
    "a long axis": (
        text(goal="{about_axis: {pose: {xyz: [1, 0, 0]}, axis: [0, 2, 0]}}"),
        ":4: goal: .*axis must have length 1, but has 2",
    ),
    "a bad member": (
        text(goal="{any_of: [{task_region: {frame: {xyz: [1, 0, 0]}, z: [1, 0]}}]}"),
        ":4: goal: .*z goes from 1 up to 0",
    ),
    "zero resolution": (text(rest="motion_resolution: 0\n"), ":5: motion_resolution: must be 1e-05 or more"),
    "resolution with unit": (text(rest="motion_resolution: 1 cm\n"), "must be a number, found text '1 cm'"),
    "unknown section": (text(rest="scenes: {}\n"), ":5: scenes: unknown key 'scenes'; did you mean 'scene'"),
    "unknown link": (text(rest="scene: {allowed_collisions: [[link1, ghost]]}\n"), ":5: scene: .*ghost"),
    "attached to nothing": (text(rest="scene: {attached: [{name: a, link: hand, sphere: 1}]}\n"), ":5: scene: .*hand"),
}


@pytest.mark.parametrize(("content", "message"), BAD.values(), ids=BAD)
def test_a_wrong_problem_is_one_line_with_file_line_key_and_remedy(tmp_path, content, message):
    with pytest.raises(RrtikError, match=message) as caught:
        load(tmp_path, content)
    assert "task.yaml:" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_further_errors_are_counted(tmp_path):
    with pytest.raises(InputError, match=r"\(and 1 more\)"):
        load(tmp_path, text(start="{joints: [a, b, 0]}"))


def test_an_unknown_name_lists_the_shipped_problems():
    with pytest.raises(UnknownNameError, match=r"titan4_sdv.*'titan4_sdu'"):
        load_problem("titan4_sdv")


def test_a_file_without_ending_is_found(tmp_path, monkeypatch):
    (tmp_path / "task").write_text(text())
    monkeypatch.chdir(tmp_path)
    assert load_problem("task").name == "task"


def test_the_schema_is_valid_and_plain_json():
    schema = problem_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    assert json.loads(json.dumps(schema)) == schema
    assert "null" not in json.dumps(schema)


@pytest.mark.parametrize("goal", ["{joints: [0, 0, 0]}", "{position: [1, 0, 0]}", "{any_of: [{position: [1, 0, 0]}]}"])
def test_the_schema_accepts_what_is_accepted(tmp_path, goal):
    load(tmp_path, text(goal=goal))
    jsonschema.validate(read_yaml(tmp_path / "task.yaml").data, problem_schema())


@pytest.mark.parametrize(
    "content",
    [
        text(start="{joints: [0, a, 0]}"),
        text(goal="{point: [1, 0, 0]}"),
        text(rest="scenes: {}\n"),
        text(rest="scene: {obstacles: [{name: a, sphere: 1, box: [1, 1, 1]}]}\n"),
        text(rest="scene: {obstacles: [{name: a, sphere: -1}]}\n"),
        text(rest="scene:\n"),
        text().replace("version: 1", "version: 2"),
    ],
)
def test_the_schema_refuses_what_is_refused(tmp_path, content):
    (tmp_path / "task.yaml").write_text(content)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(read_yaml(tmp_path / "task.yaml").data, problem_schema())


FULL = text(
    rest="scene:\n  obstacles:\n"
    "    - {name: a, box: [0.1, 0.1, 0.1], pose: {xyz: [-2, 0, 0], rpy_deg: [0,0,9]}, motion: {velocity: [1, 0, 0]}}\n"
    "    - {name: b, polygon: [[3.5, 3], [4, 3], [4, 4]], height: 1}\n"
    "    - {name: c, half_space: {normal: [0, 0, 1], offset: -1}}\n"
    "  attached: [{name: t, link: link1, capsule: {radius: 0.01, length: 0.1}}]\n"
    "  allowed_collisions: [[a, t]]\nmotion_resolution: 0.02\n"
)
JUNK = st.sampled_from([None, True, -1, 0, 1e300, float("nan"), "", "x", "link1", [], {}, [1], [[0]], {"a": 1}, 10**30])


def places(value, here=()):
    """All key paths of a document, leaves and branches."""
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in children:
        yield (*here, key)
        yield from places(child, (*here, key))


def is_a_problem_or_one_line(file):
    try:
        return isinstance(load_problem(file), Problem)
    except RrtikError as error:
        return "\n" not in str(error) and file.name in str(error)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=150)
@given(data=st.data())
def test_a_mutated_file_gives_a_problem_or_one_line(tmp_path, data):
    (tmp_path / "full.yaml").write_text(FULL)
    document = read_yaml(tmp_path / "full.yaml").data
    for _ in range(data.draw(st.integers(1, 3))):
        *parents, last = data.draw(st.sampled_from(list(places(document)) or [("version",)]))
        target = document
        for key in parents:
            target = target[key]
        action = data.draw(st.sampled_from(["drop", "retype", "rename"]))
        if action == "retype" or isinstance(target, list):
            target[last] = deepcopy(data.draw(JUNK))  # later steps change it
        else:
            value = target.pop(last)
            if action == "rename":
                target[last + "s"] = value
    write_yaml(tmp_path / "task.yaml", document)
    assert is_a_problem_or_one_line(tmp_path / "task.yaml")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=150)
@given(lines=st.lists(st.integers(0, len(FULL.splitlines()) - 1), max_size=20), cut=st.integers(0, len(FULL)))
def test_shuffled_doubled_and_cut_lines_give_a_problem_or_one_line(tmp_path, lines, cut):
    rows = FULL.splitlines()
    (tmp_path / "task.yaml").write_text("\n".join(rows[k] for k in lines) if lines else FULL[:cut])
    assert is_a_problem_or_one_line(tmp_path / "task.yaml")


def test_the_world_of_a_loaded_problem_is_a_world_with_its_scene(tmp_path):
    problem = load(tmp_path, FULL)
    assert isinstance(problem.world, World)
    assert problem.world.scene.names == ("a", "b", "c", "t")
    assert "titan4_sdu" in list_problems()


@pytest.mark.parametrize(
    ("padding", "message"),
    [
        ("{link4: -1}", r":2: robot\.padding\.link4: must be 0 or more, found -1$"),
        ("{link4: abc}", r":2: robot\.padding\.link4: must be a number, found text 'abc'$"),
        ("-1", r":2: robot\.padding: must be 0 or more, found -1$"),
        ("[1]", r":2: robot\.padding: must be a number, found a list of 1$"),
    ],
)
def test_a_wrong_padding_is_told_where_it_stands(tmp_path, padding, message):
    with pytest.raises(InputError, match=message):
        load(tmp_path, text(robot=f"{{name: xarm7, padding: {padding}}}"))


def test_the_values_of_a_file_are_read_without_asking_coal_or_making_a_world(tmp_path, monkeypatch):
    def refused(*_):
        raise AssertionError("asked")

    for name in ("collide", "distance"):
        monkeypatch.setattr(coal, name, refused)
    monkeypatch.setattr(World, "of", refused)
    content = text(rest=WALL.replace("X", "2.5").replace("Y", "0") + "clearance: 0.01\n")  # the start is in the wall
    (tmp_path / "task.yaml").write_text(content)
    settings, start, goal = load_unchecked(tmp_path / "task.yaml")
    assert (settings.robot.dof, settings.scene.names, settings.clearance) == (3, ("wall",), 0.01)
    assert start.tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(goal.q, [np.pi / 2, 0.0, 0.0])


def test_reading_a_file_loads_neither_kernels_nor_worlds(tmp_path):
    (tmp_path / "task.yaml").write_text(text(rest=WALL.replace("X", "2.5").replace("Y", "0")))
    work = f"""
import sys
from rrtik_ompl.problem_files.problem_values import load_unchecked
print(load_unchecked({str(tmp_path / "task.yaml")!r})[0])
print([name for name in sys.modules if name.startswith(("rrtik_ompl.world", "rrtik_ompl.kernels"))])
"""
    told = subprocess.run([sys.executable, "-c", work], check=True, capture_output=True, text=True).stdout
    assert told.splitlines()[-1] == "[]"

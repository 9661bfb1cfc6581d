"""Names to robots and problems: the cache, the options, the entries of problem files."""

import inspect
import os
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.catalog import (
    _load,
    find_planner,
    find_problem,
    list_planners,
    list_problems,
    list_robots,
    load_robot,
    robot_from_entry,
)

load_entry = partial(_load, "robot", "robots")
URDF = """<robot name="arm"><link name="base"/><link name="arm"/><joint name="j" type="revolute">
<parent link="base"/><child link="arm"/><origin xyz="{height} 0 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF.format(height=1))
    return path


class OnlyFspath:
    """A path that is nothing else."""

    def __init__(self, path):
        self._path = path

    def __fspath__(self):
        return self._path if isinstance(self._path, bytes) else str(self._path)


def entry_of(path):
    """The path as a folder lists it."""
    return next(each for each in os.scandir(path.parent) if each.name == path.name)


OWN = ("limits", "lengths", "limits_deg", "radius", "bounds", "base_height", "apart")


def as_options(given):
    """Options of load_robot, with a robot's own as its parameters."""
    own = {key: value for key, value in given.items() if key in OWN}
    return {key: value for key, value in given.items() if key not in OWN} | ({"parameters": own} if own else {})


@pytest.mark.parametrize("kind", [str, Path, entry_of, OnlyFspath])
def test_files_are_named_by_every_kind_of_path(urdf, kind):
    srdf = urdf.with_suffix(".srdf")
    srdf.write_text('<robot name="arm"><group name="all"><joint name="j"/></group></robot>')
    robot = load_robot(kind(urdf), srdf=kind(srdf), group="all", packages=kind(urdf.parent))
    assert robot is load_robot(urdf, srdf=srdf, group="all", packages=urdf.parent)


@pytest.mark.parametrize("option", ["srdf", "packages"])
def test_a_path_of_bytes_is_refused(urdf, option):
    with pytest.raises(InputError, match="name of a file"):
        load_robot(urdf, **{option: OnlyFspath(b"arm.srdf")})


def test_the_same_call_gives_the_same_object():
    options = {"parameters": {"lengths": [1.0, 2.0]}, "base_pose": {"xyz": [0, 0, 1]}}
    assert load_robot("planar", **options) is load_robot("planar", **options)
    lists, arrays = {"lengths": [1.0, 2.0]}, {"lengths": np.array([1.0, 2.0])}
    assert load_robot("planar", parameters=arrays) is load_robot("planar", parameters=lists)


def test_another_option_gives_another_robot():
    first, second = (load_robot("planar", parameters={"lengths": [1.0, length]}) for length in (2.0, 2.5))
    assert first is not second
    poses = (pin.SE3(np.eye(3), np.array([0, 0, height])) for height in (1.0, 2.0))
    first, second = (load_robot("titan4", base_pose=pose) for pose in poses)
    assert second.fk(np.zeros(6)).translation[2] - first.fk(np.zeros(6)).translation[2] == pytest.approx(1.0)


def test_a_file_that_changed_is_loaded_again(urdf):
    before = load_robot(urdf)
    assert load_robot(str(urdf)) is before
    urdf.write_text(URDF.format(height=2))
    os.utime(urdf, ns=(1, 1))
    assert load_robot(urdf).fk([0.0]).translation[0] == 2.0


def test_a_file_that_vanished_is_missed(urdf):
    load_robot(urdf)
    urdf.unlink()
    with pytest.raises(InputError, match="no such file"):
        load_robot(urdf)


def test_a_relative_path_follows_the_current_folder(tmp_path, monkeypatch):
    for number in (1, 2):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "arm.urdf").write_text(URDF.format(height=number))
        monkeypatch.chdir(folder)
        assert load_robot("arm.urdf").fk([0.0]).translation[0] == number


def test_an_unknown_name_lists_the_alternatives():
    with pytest.raises(UnknownNameError, match=r"titan5.*'titan4'") as caught:
        load_robot("titan5")
    assert caught.value.alternatives == list_robots()


def test_an_option_that_does_not_apply_names_those_that_do():
    with pytest.raises(
        InputError,
        match=r"titan4.*'group'.*base_pose.*limits",
    ):
        load_robot("titan4", group="arm")


@pytest.mark.parametrize(
    ("name", "options", "expected"),
    [
        ("titan4", {"limits": "wide"}, "no limit set 'wide'"),
        ("titan4", {"lengths": {"a9": 1.0}}, "no length 'a9'"),
        ("titan4", {"lengths": {"a2": -1.0}}, "a2 must be greater than 0"),
        ("titan4", {"tip": "finger"}, "'finger'"),
        ("titan4", {"base_pose": [0, 1]}, "base_pose: a pose is"),
        ("titan4", {"base_pose": "here"}, "base_pose: expected"),
        ("titan4", {"base_pose": {"position": [0, 0, 1]}}, "no key 'position'"),
        ("titan4", {"base_pose": {"xyz": [0, 0]}}, "shape"),
        ("titan4", {"base_pose": {"xyz": [0, 0, 0], "quat_xyzw": [1, 1, 1, 1]}}, "length 1"),
        ("planar", {"lengths": []}, "lengths"),
        ("planar", {"lengths": [1, -1]}, "greater than 0"),
        ("planar", {"lengths": [1, 1], "limits_deg": [[-1, 1]]}, "limits_deg"),
        ("planar", {"lengths": [1], "limits_deg": [[1, -1]]}, "lower must be below upper"),
        ("planar", {"lengths": [1], "radius": -1}, "radius"),
        ("point2d", {"radius": -1}, "radius"),
        ("point2d", {"bounds": [[0, 1]]}, "bounds"),
        ("puma560_3dof", {"lengths": {"d7": 0.1}}, "no length 'd7'"),
        ("arm.xacro", {}, "no such file"),
        ("some/arm.step", {}, "not a robot file"),
    ],
)
def test_a_bad_value_gets_one_line(name, options, expected):
    with pytest.raises(InputError, match=expected):
        load_robot(name, **as_options(options))


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({"tip": "gripper"}, "'tip', which is an option: tip="),
        ({"girth": 1}, "no option 'girth'"),
        (3, "must be of type"),
    ],
)
def test_parameters_are_what_the_robot_has_of_its_own(parameters, expected):
    with pytest.raises(InputError, match=expected):
        load_robot("titan4", parameters=parameters)


@pytest.mark.parametrize(
    "entry",
    [
        "titan4",
        {"name": "titan4", "limits": "envelope", "base_pose": {"xyz": [0.0, 0.0, 1.0], "quat_xyzw": [0, 0, 0, 1]}},
        {"planar": {"lengths": [1, 1, 1], "limits_deg": [[-45, 270], [-180, 180], [-180, 180]], "radius": 0.0}},
        {"planar": {"lengths": [1, 2]}, "base_pose": {"xyz": [1, 0, 0], "rpy_deg": [0, 0, 90]}},
        {"point2d": {"radius": 0.7, "bounds": [[0, 26], [0, 20]]}},
        {"name": "panda", "locked": {"panda_finger_joint1": 0.02}, "tip": "panda_link8"},
    ],
)
def test_the_source_of_a_robot_loads_it_again(entry):
    robot = robot_from_entry(entry)
    again = robot_from_entry(dict(robot.source))
    q = np.clip(np.full(robot.dof, 0.3), robot.lower, robot.upper)
    np.testing.assert_array_equal(again.fk(q).homogeneous, robot.fk(q).homogeneous)
    np.testing.assert_array_equal(again.lower, robot.lower)
    assert dict(again.source) == dict(robot.source)


def test_an_entry_names_files_relative_to_its_folder(urdf):
    robot = robot_from_entry({"urdf": urdf.name, "tip": "arm"}, urdf.parent)
    assert dict(robot.source) == {"urdf": str(urdf), "tip": "arm"}
    assert robot_from_entry(urdf.name, urdf.parent).tip == "arm"


@pytest.mark.parametrize("entry", [3, {}, {"name": "titan4", "urdf": "a.urdf"}, {"planar": 3}, {"name": 4}])
def test_an_entry_of_another_form_is_refused(entry):
    with pytest.raises(InputError, match="robot: "):
        robot_from_entry(entry)


def test_every_listed_problem_is_a_file():
    assert "titan4_sdu" in list_problems()
    assert all(find_problem(name).is_file() and isinstance(find_problem(name), Path) for name in list_problems())


def test_unknown_problems_and_planners_list_the_alternatives():
    with pytest.raises(UnknownNameError, match="did you mean 'titan4_sdu'"):
        find_problem("titan4_sud")
    with pytest.raises(UnknownNameError, match="no planner 'bicrtd'"):
        find_planner("bicrtd")


def test_every_listed_planner_is_a_class():
    assert all(isinstance(find_planner(name), type) for name in list_planners())


ODD = [5, b"x", "\0", [[1, 2]], {}, np.zeros(3), np.array(["a"]), object(), iter([1])]
TAKES = ("base_pose", "group", "joint_limits", "joints", "locked", "packages", "srdf", "strict", "tip", "xacro_args")


@pytest.mark.parametrize("name", ["planar", "point2d", "puma560", "titan4", "two_titan4", "urdf"])
def test_an_option_without_sense_is_refused_in_one_line(name, urdf):
    options = TAKES if name == "urdf" else inspect.signature(load_entry(name)).parameters
    refusals = []
    for option in (*options, "scale", "padding", "joint_ranges", "joint_weights"):
        for value in ODD:
            try:
                load_robot(urdf if name == "urdf" else name, **as_options({option: value}))
            except InputError as error:
                refusals.append(str(error))
    assert len(refusals) > len(options)
    assert [refusal for refusal in refusals if "\n" in refusal] == []


@pytest.mark.parametrize("option", [{"limits": [0, 1]}, {"lengths": 5}, {"lengths": np.zeros(3)}])
def test_limits_and_lengths_of_the_titan_are_checked(option):
    with pytest.raises(InputError, match=f"titan4: {next(iter(option))} must be of type"):
        load_robot("titan4", parameters=option)


@pytest.mark.parametrize(
    ("typed", "shipped"),
    [("Panda", "panda"), ("franka", "panda"), ("UR-5", "ur5"), ("SO-ARM101", "so101"), ("titan-4", "titan4")],
)
def test_the_very_arm_is_found_under_the_names_that_people_type(typed, shipped):
    assert load_robot(typed) is load_robot(shipped)


@pytest.mark.parametrize(
    ("typed", "remedy"),
    [
        ("fr3", 'load_robot("fr3_description")'),
        ("UR5e", 'load_robot("ur5e_description")'),
        ("iiwa14", 'load_robot("iiwa14_description")'),
        ("iiwa", 'load_robot("iiwa14_description")'),
        ("gen3", 'load_robot("gen3_description")'),
        ("sawyer", 'load_robot("sawyer_mj_description")'),
        ("lite6", "xarm_device.urdf.xacro"),
    ],
)
def test_an_arm_that_is_not_shipped_is_said_where_to_get(typed, remedy):
    with pytest.raises(InputError, match="not shipped") as caught:
        load_robot(typed)
    assert remedy in str(caught.value)
    assert "did you mean" not in str(caught.value)


@pytest.mark.parametrize(("typed", "meant"), [("pnada", "panda"), ("ur6", "ur"), ("titn4", "titan4")])
def test_a_similar_name_is_said_first(typed, meant):
    with pytest.raises(UnknownNameError, match=rf"^no robot '{typed}'; did you mean '{meant}\w*'\? have "):
        load_robot(typed)


@pytest.mark.parametrize("typed", ["kr3", "m10", "xy7", "cr5", "er5", "rx10", "r5"])
def test_a_similar_name_is_never_that_of_another_vendors_arm(typed):
    with pytest.raises(UnknownNameError, match=r"^(?!.*did you mean)"):
        load_robot(typed)


@pytest.fixture
def descriptions(tmp_path, monkeypatch):
    """A package like robot_descriptions, whose modules would download, and a cache in which one repository is."""
    package = tmp_path / "site" / "robot_descriptions"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("raise SystemExit('this package may not run')\n")
    (package / "_repositories.py").write_text(
        'REPOSITORIES = {"arms": Repository(url="https://example.org", commit="1234", cache_path="arms_folder")}\n'
    )
    module = (
        "from ._cache import clone_to_cache as _clone_to_cache\n"
        'REPOSITORY_PATH: str = _clone_to_cache("arms", commit=_getenv("ROBOT_DESCRIPTION_COMMIT", None))\n'
        'PACKAGE_PATH = _path.join(REPOSITORY_PATH, "robots")\n'
        "OTHER = [1, 2]\n"
        '{}_PATH: str = _path.join(PACKAGE_PATH, "arm.{}")\n'
    )
    (package / "arm_description.py").write_text(module.format("URDF", "urdf"))
    (package / "arm_mj_description.py").write_text(module.format("MJCF", "xml"))
    (package / "absent_description.py").write_text(module.format("URDF", "other"))
    (package / "odd_description.py").write_text('SOMETHING = "else"\n')

    files = tmp_path / "cache" / "arms_folder" / "robots"
    files.mkdir(parents=True)
    (files / "arm.urdf").write_text(ONE_JOINT)
    (files / "arm.xml").write_text(
        '<mujoco><worldbody><body><joint name="j" range="-1 1"/></body></worldbody></mujoco>'
    )

    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(tmp_path / "site")
    return tmp_path


ONE_JOINT = (
    '<robot name="arm"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>'
    '<child link="b"/></joint></robot>'
)


@pytest.mark.parametrize("name", ["arm_description", "arm_mj_description"])
def test_a_description_that_another_package_has_fetched_is_read_from_its_cache(descriptions, name):
    robot = load_robot(name)
    assert robot.joint_names == ("j",)
    assert robot_from_entry(robot.source) is robot


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("absent_description", "arm.other is not there; python -m robot_descriptions pull absent_description"),
        ("odd_description", "give its file"),
        ("amr_description", "did you mean 'arm_description'?"),
    ],
)
def test_a_description_that_is_not_there_is_one_line_with_the_remedy(descriptions, name, said):
    with pytest.raises(InputError) as caught:
        load_robot(name)
    assert said in str(caught.value)


def test_without_the_package_the_line_says_what_to_install():
    with pytest.raises(InputError, match="pip install robot_descriptions"):
        load_robot("fr3_description")

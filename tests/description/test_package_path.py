"""Packages of ROS are found by the names that their package.xml states, wherever ROS would find them."""

import os
import time

import pytest

from rrtik_ompl.base.errors import DescriptionWarning, InputError
from rrtik_ompl.description import package_path
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.package_path import Packages
from rrtik_ompl.description.urdf import robot_from_urdf

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
ARM = """<robot name="arm"><link name="base"><collision><geometry><mesh filename="{}"/></geometry></collision></link>
<link name="hand"/><joint name="turn" type="continuous"><parent link="base"/><child link="hand"/></joint></robot>"""


def package(folder, name):
    """Make a package, called otherwise than its folder, with a mesh."""
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "a.obj").write_bytes(TRIANGLE)
    (folder / "package.xml").write_text(
        f'<?xml version="1.0"?>\n<package format="3">\n  <name>{name}</name>\n</package>'
    )
    return folder


def described(file):
    """Write a URDF whose mesh is in the package arm_description."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(ARM.format("package://arm_description/meshes/a.obj"))
    return file


PLACES = {  # where the package is in a workspace, and where the URDF
    "own package": ("src/arm_ros/one", "src/arm_ros/one/urdf/arm.urdf"),
    "neighbour": ("src/arm_ros/one", "src/arm_ros/two/urdf/arm.urdf"),
    "neighbour in another repository": ("src/arm_ros/one", "src/other/two/urdf/arm.urdf"),
    "deeper neighbour": ("src/arm_ros/robots/made/one", "src/arm_ros/two/arm.urdf"),
}


@pytest.mark.parametrize("place", PLACES)
def test_a_package_is_found_by_the_name_in_its_package_xml(tmp_path, place):
    home, urdf = PLACES[place]
    package(tmp_path / home, "arm_description")
    if not urdf.startswith(home):
        package(tmp_path / urdf.split("/urdf")[0].removesuffix("/arm.urdf"), "another")
    robot = robot_from_urdf(described(tmp_path / urdf))
    assert robot.collision.geometryObjects[0].meshPath == str(tmp_path / home / "meshes" / "a.obj")


@pytest.mark.parametrize("given", ["one", "", ".."])
def test_a_folder_that_is_given_is_the_package_or_holds_it(tmp_path, given):
    package(tmp_path / "lib" / "one", "arm_description")
    robot = robot_from_urdf(described(tmp_path / "here" / "arm.urdf"), packages=tmp_path / "lib" / given)
    assert "/lib/one/" in robot.collision.geometryObjects[0].meshPath


@pytest.mark.parametrize(
    ("variable", "value", "home"),
    [
        ("AMENT_PREFIX_PATH", "{0}/none:{0}/install/arm", "install/arm/share/arm_description"),
        ("ROS_PACKAGE_PATH", "{0}/none:{0}/catkin/src", "catkin/src/deep/one"),
        ("ROBOT_DESCRIPTIONS_CACHE", "{0}/cache", "cache/arm_ros/one"),
    ],
)
def test_packages_are_found_where_ros_has_them(tmp_path, monkeypatch, variable, value, home):
    package(tmp_path / home, "arm_description")
    urdf = described(tmp_path / "here" / "arm.urdf")
    with pytest.raises(InputError, match=r"packages=\[the folder that holds 'arm_description'\]"):
        robot_from_urdf(urdf)
    monkeypatch.setenv(variable, value.format(tmp_path))
    assert robot_from_urdf(urdf).collision.geometryObjects[0].meshPath.startswith(str(tmp_path / home))


def test_of_two_packages_of_a_name_that_of_the_file_counts_and_one_that_is_given_before_all(tmp_path):
    own = package(tmp_path / "src" / "one", "arm_description")
    other = package(tmp_path / "src" / "a_copy", "arm_description")
    urdf = described(own / "urdf" / "arm.urdf")
    assert Packages((), urdf.parent).find("arm_description") == own
    assert Packages((other,), urdf.parent).find("arm_description") == other


def test_a_package_that_was_copied_under_another_name_is_taken_with_a_warning(tmp_path):
    (tmp_path / "arm" / "meshes").mkdir(parents=True)
    (tmp_path / "arm" / "meshes" / "a.obj").write_bytes(TRIANGLE)
    urdf = described(tmp_path / "arm" / "urdf" / "arm.urdf")
    with pytest.warns(DescriptionWarning, match=r"'arm_description' is not found; its files are taken from .*arm"):
        robot_from_urdf(urdf)


def test_neighbours_are_not_sought_in_all_of_the_home_folder(tmp_path, monkeypatch):
    own = package(tmp_path / "two", "another")
    package(tmp_path / "one", "arm_description")
    assert Packages((), own).find("arm_description") == tmp_path / "one"
    monkeypatch.setenv("HOME", str(tmp_path))
    assert Packages((), own).find("arm_description") is None


def test_folders_without_end_are_left_alone(tmp_path, monkeypatch):
    own = package(tmp_path / "src" / "two", "another")
    package(tmp_path / "src" / "deep" / "one", "arm_description")
    (tmp_path / "src" / "deep" / "ring").symlink_to(tmp_path)
    assert Packages((), own).find("arm_description") == tmp_path / "src" / "deep" / "one"
    monkeypatch.setattr(package_path, "MOST_FOLDERS", 2)
    assert Packages((), own).find("arm_description") is None


def test_one_of_five_hundred_packages_is_found_at_once(tmp_path):
    for number in range(500):
        (tmp_path / "src" / f"p{number}").mkdir(parents=True)
        (tmp_path / "src" / f"p{number}" / "package.xml").write_text(f"<package><name>robot_{number}</name></package>")
    begin = time.process_time()
    found = Packages((), tmp_path / "src" / "p0").find("robot_499")
    assert found == tmp_path / "src" / "p499"
    assert time.process_time() - begin < 1.0


def test_a_folder_whose_name_is_not_utf8_is_refused_in_one_line(tmp_path):
    home = tmp_path / os.fsdecode(b"arm_\xff")
    package(home / "one", "arm_description")
    urdf = described(home / "one" / "arm.urdf")
    with pytest.raises(InputError, match=r"arm\.urdf: the name .* is not UTF-8; rename it") as error:
        load_robot(urdf)
    assert "\n" not in str(error.value)

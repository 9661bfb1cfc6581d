"""What an extra brings, and is not there, is told with the command that installs it; nothing else is imported."""

import re
import sys
from importlib import import_module
from unittest.mock import patch

import pytest

from rrtik_ompl import load_motions, load_robot
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.floors import FLOORS, DependencyError
from rrtik_ompl.demos.formats import check_format
from rrtik_ompl.many.spread import cluster
from rrtik_ompl.motion.trajectory.text import write_mcap
from rrtik_tests.places import ROOT

PROJECT = (ROOT / "pyproject.toml").read_text()
SECTION = PROJECT.split("[project.optional-dependencies]")[1].split("[project.")[0]
EXTRAS = set(re.findall(r"^([a-z]+) = \[", SECTION, re.M))
PACKAGES = ("rrtik_ompl", "planners/rrtik_planners", "robots/rrtik_robots", "bench/rrtik_bench")
SOURCES = [file for package in PACKAGES for file in sorted((ROOT / package).rglob("*.py"))]
OWN = {"rrtik_ompl", "rrtik_planners", "rrtik_robots", "rrtik_bench"}
# What comes with a dependency: numba's, matplotlib's; for checkers alone; for whom a wheel is built.
BESIDE = {"llvmlite", "mpl_toolkits", "typing_extensions", "_typeshed", "hatchling"}

ROBOT = """<mujoco><worldbody><body><joint name="a" range="-1 1" limited="true"/>
<geom type="ellipsoid" size="0.1 0.2 0.3"/></body></worldbody></mujoco>"""


def mjcf(folder):
    (folder / "arm.xml").write_text(ROBOT)
    load_robot(folder / "arm.xml")


def xacro(folder):
    text = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="x" value="1"/></robot>'
    (folder / "arm.urdf.xacro").write_text(text)
    load_robot(folder / "arm.urdf.xacro")


def gym(folder):
    with patch.dict(sys.modules):
        for name in [name for name in sys.modules if name.startswith("rrtik_ompl.gym")]:
            del sys.modules[name]
        import_module("rrtik_ompl.gym")


NEEDED_BY = {
    "mcap": lambda folder: write_mcap(folder / "a.mcap", "robot", ["a"], []),
    "distributed": lambda folder: next(cluster([], "tcp://nowhere:1")),
    "gymnasium": gym,
    "h5py": lambda folder: check_format("hdf5", 30.0),
    "mujoco": mjcf,
    "pyarrow": lambda folder: check_format("lerobot", 30.0),
    "rosbags": lambda folder: load_motions(folder / "run.mcap", load_robot("planar3")),
    "xacro": xacro,
}


IMPORT = re.compile(r"^ *(?:from ([a-z_A-Z]\w*)[\w.]* import|import ([a-z_A-Z]\w*))", re.MULTILINE)


def imported(file):
    """Names of all packages that a file imports, wherever it does."""
    return {first or second for first, second in IMPORT.findall(file.read_text())}


def test_what_is_imported_is_a_dependency_or_stands_here():
    found = {name for file in SOURCES for name in imported(file)} - set(sys.stdlib_module_names) - OWN - BESIDE
    assert found - set(FLOORS) == set(NEEDED_BY)


@pytest.mark.parametrize("package", NEEDED_BY)
def test_an_extra_that_is_missing_is_named_with_its_command(package, tmp_path, monkeypatch):
    for known in [name for name in sys.modules if name.startswith(f"{package}.")]:
        monkeypatch.delitem(sys.modules, known)  # or a part that another test has imported is found
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises((InputError, DependencyError), match=r"^[^\n]*pip install [^\n]*$") as caught:
        NEEDED_BY[package](tmp_path)
    named = re.findall(r"pip install '?([\w\[\]-]+)", str(caught.value))
    assert named in (
        [package],
        [f"rrtik-ompl[{package}]"],
        ["rrtik-ompl[cluster]"],
        ["rrtik-ompl[data]"],
        ["rrtik-ompl[gym]"],
    )


@pytest.mark.parametrize("folder", ["rrtik_ompl", "planners", "robots", "bench", "docs", "examples"])
def test_every_extra_that_is_named_exists(folder):
    texts = [file.read_text() for ending in ("py", "md") for file in (ROOT / folder).rglob(f"*.{ending}")]
    named = {names for text in texts for names in re.findall(r"rrtik-ompl\[([\w,]+)\]", text)}
    assert {name for names in named for name in names.split(",")} <= EXTRAS

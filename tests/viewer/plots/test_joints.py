"""Pictures of joints over time: they are drawn, name every joint, and are the same for the same motion."""

import re
import subprocess
import sys

import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import RateLimits, time_parameterize
from rrtik_ompl.viewer.plots.joints import plot_joints

PATH = JointPath([[0.0, 0.0], [1.0, 0.2], [1.0, 0.0]], ["turn", "slide"], [False, True])


@pytest.fixture
def motion():
    return time_parameterize(PATH, RateLimits(1.0, 2.0, 10.0))


def test_a_motion_is_drawn_with_units_and_the_names_of_its_joints(tmp_path, motion):
    plot_joints(motion, tmp_path / "joints.svg")
    text = (tmp_path / "joints.svg").read_text()
    for word in (
        "turn",
        "slide",
        "position [deg]",
        "position [m]",
        "velocity [deg/s]",
        "acceleration [m/s",
        "time [s]",
    ):
        assert word in text


def test_a_path_without_times_is_drawn_over_its_waypoints(tmp_path):
    plot_joints(PATH, tmp_path / "joints.svg")
    text = (tmp_path / "joints.svg").read_text()
    assert "waypoint" in text
    assert "velocity" not in text


def test_a_picture_shows_one_line_per_joint(tmp_path, motion):
    cv2 = pytest.importorskip("cv2")
    plot_joints(motion, tmp_path / "joints.png")
    picture = cv2.imread(str(tmp_path / "joints.png"))[..., ::-1].astype(int)
    for color in ("#0072b2", "#d55e00"):
        wanted = [int(part, 16) for part in re.findall("..", color[1:])]
        assert (abs(picture - wanted).max(axis=2) < 10).sum() > 500


@pytest.mark.parametrize("ending", [".svg", ".png"])
def test_the_same_motion_gives_the_same_file(tmp_path, motion, ending):
    for name in ("a", "b"):
        plot_joints(motion, tmp_path / f"{name}{ending}")
    assert (tmp_path / f"a{ending}").read_bytes() == (tmp_path / f"b{ending}").read_bytes()


def test_another_ending_and_another_thing_are_refused(tmp_path, motion):
    with pytest.raises(InputError, match=r"\.pdf"):
        plot_joints(motion, tmp_path / "joints.pdf")
    with pytest.raises(InputError, match="motion to plot"):
        plot_joints([[0.0]], tmp_path / "joints.png")


def test_loading_the_library_loads_no_matplotlib():
    names = "rrtik_ompl.time_parameterize, rrtik_ompl.plot_joints"
    code = f"import sys, rrtik_ompl; {names}; print({{'matplotlib'}} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"

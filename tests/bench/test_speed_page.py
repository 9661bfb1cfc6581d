"""The speed page comes out whole where neither the peers nor the problems' sets are there."""

import os
import subprocess
import sys

import pytest

from rrtik_tests.places import ROOT

pytestmark = pytest.mark.slow

PACKAGES = os.pathsep.join(str(ROOT / folder) for folder in (".", "planners", "robots", "bench"))


def run(folder, *arguments):
    page = folder / "speed.md"
    command = [sys.executable, "-m", "bench", "speed", "--quick", "--out", str(page), *arguments]
    environment = {**os.environ, "PYTHONPATH": PACKAGES}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr  # 1: a bar was missed, which is no matter of this test
    return page.read_text()


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    names = ("whole", "exact", "spheres", "free-motions", "near-obstacles", "ompl-layer", "shipped-lengths", "solve-ik")
    return run(tmp_path_factory.mktemp("speed"), *(word for name in names for word in ("--only", name)))


def test_the_page_names_the_processor_and_the_versions(page):
    assert all(f"{name} " in page for name in ("numpy", "ompl", "pin", "coal", "roboplan"))
    assert "cores; Python" in page


def test_rows_without_their_data_say_so(page):
    assert page.count("Not run: give the folder of the MotionBenchMaker sets.") == 3


def test_rows_that_need_no_data_are_measured(page):
    for title in ("4. Panda along free motions", "5. Exact", "6. SimpleSetup", "7. Lengths", "10. Inverse"):
        assert f"## {title}" in page


def test_our_checks_are_never_wrong_near_obstacles(page):
    table = page.partition("## 5.")[2].partition("##")[0].strip().splitlines()
    heads = [cell.strip() for cell in table[2].split("|")]
    wrong = [line.split("|")[heads.index("ours wrong")].strip() for line in table[4:] if line.startswith("|")]
    assert wrong
    assert set(wrong) == {"0"}

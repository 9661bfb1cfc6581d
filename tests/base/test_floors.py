"""Packages older than their floor are named in a line, when they are loaded or when something of them is missing."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from rrtik_ompl.base import floors
from rrtik_ompl.base.floors import FLOORS, DependencyError, fitting_packages, too_old


def test_the_packages_of_this_environment_fit():
    with fitting_packages():
        import joblib
        import scipy
    assert too_old({"joblib": joblib, "scipy": scipy}) == ""


@pytest.mark.parametrize(
    ("module", "version", "said"),
    [
        ("cv2", "4.9.0", "opencv-python-headless 4.9.0 is too old; pip install 'opencv-python-headless>=4.10.0'"),
        ("numpy", "1.26.4", "numpy 1.26.4 is too old; pip install 'numpy>=2.0.2'"),
        ("numpy", "2.10.0rc1", ""),
        ("pinocchio", "3.10.0", ""),
        ("coal", None, ""),  # does not say: as it was installed
    ],
)
def test_an_old_one_is_told_by_its_version(module, version, said):
    assert too_old({module: SimpleNamespace(__version__=version)}) == said


@pytest.mark.parametrize("module", FLOORS)
def test_every_package_below_its_floor_is_named_with_the_version_that_fits(module, monkeypatch):
    package, floor = FLOORS[module]
    lower = f"{int(floor[0]) - 1}{floor[1:]}" if floor[0] != "0" else "0.0.1"
    said = f"{package} {lower} is too old; pip install '{package}>={floor}'"
    assert too_old({module: SimpleNamespace(__version__=lower)}) == said
    assert too_old({module: SimpleNamespace(__version__=floor)}) == ""
    monkeypatch.setattr(floors, "version_of", lambda name: lower if name == package else "")
    assert too_old({module: SimpleNamespace()}) == said


def test_an_old_one_explains_what_goes_wrong_and_what_is_not_used_is_no_reason(monkeypatch):
    monkeypatch.setitem(sys.modules, "joblib", SimpleNamespace(__version__="1.0.0"))
    with fitting_packages():
        pass
    with pytest.raises(DependencyError, match=r"^joblib 1\.0\.0 is too old; pip install 'joblib>="), fitting_packages():
        raise AttributeError("module 'joblib' has no attribute 'Parallel'")
    monkeypatch.undo()
    with pytest.raises(DependencyError, match=r"pin 3 .*liburdfdom.*cmeel-urdfdom<5"), fitting_packages():
        raise ImportError("liburdfdom_sensor.so.4.0: cannot open shared object file")


@pytest.mark.parametrize(
    "start", ["import rrtik_ompl; rrtik_ompl.World", "from rrtik_ompl.cli.app import run; run(['list'])"]
)
def test_it_is_said_where_a_name_is_first_used_and_by_commands(start):
    code = f"import numpy; numpy.__version__ = '1.26.4'; {start}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1].endswith("numpy 1.26.4 is too old; pip install 'numpy>=2.0.2'")

"""Packages older than their floor are named in a line, when they are loaded or when something of them is missing."""

import os
import subprocess
import sys
import warnings
from types import SimpleNamespace

import pytest

from rrtik_ompl.base import floors
from rrtik_ompl.base.errors import DependencyWarning
from rrtik_ompl.base.floors import FLOORS, OPENCV, DependencyError, fitting_packages, name_old_packages, too_old


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


@pytest.mark.parametrize("package", [*(package for package, _ in FLOORS.values()), *OPENCV])
def test_an_old_one_that_is_installed_is_named_once_though_it_is_not_used_yet(package, monkeypatch):
    monkeypatch.setattr(floors, "version_on_path", lambda name: "0.0.1" if name == package else "")
    name_old_packages.cache_clear()
    with pytest.warns(DependencyWarning, match=rf"^{package} 0\.0\.1 is too old; pip install '{package}>="):
        name_old_packages()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        name_old_packages()


def test_of_the_packages_of_this_environment_none_is_named():
    name_old_packages.cache_clear()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        name_old_packages()


@pytest.mark.parametrize("package", ["opencv-python-headless", "opencv-python"])
def test_an_old_one_that_cannot_be_loaded_is_told_by_what_is_installed(package, monkeypatch):
    monkeypatch.setattr(floors, "version_on_path", lambda name: "4.9.0.80" if name == package else "")
    with pytest.raises(DependencyError, match=rf"^{package} 4\.9\.0\.80 is too old"), fitting_packages():
        raise ImportError("numpy.core.multiarray failed to import")  # what OpenCV 4.9 says beside numpy 2
    with pytest.raises(ValueError, match="something else"), fitting_packages():
        raise ValueError("something else")


def test_a_command_line_whose_typer_is_too_old_says_so_in_a_line(tmp_path):
    (tmp_path / "typer.py").write_text("__version__ = '0.9.0'")  # and nothing else of it
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    code = "from rrtik_ompl.cli.entry import main; main()"
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.stderr == "rrtik: typer 0.9.0 is too old; pip install 'typer>=0.15.4'\n"
    assert done.returncode == 2


@pytest.mark.parametrize(
    "start", ["import rrtik_ompl; rrtik_ompl.World", "from rrtik_ompl.cli.app import run; run(['list'])"]
)
def test_it_is_said_where_a_name_is_first_used_and_by_commands(start):
    code = f"import numpy; numpy.__version__ = '1.26.4'; {start}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1].endswith("numpy 1.26.4 is too old; pip install 'numpy>=2.0.2'")

"""Who may import whom, what imports cost, and that what is imported is there."""

import ast
import inspect
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from importlinter import api

import rrtik_ompl
from rrtik_ompl.base.lazy import public_values
from rrtik_tests.places import ROOT

PEERS = {
    "vamp",
    "roboplan",
    "pytracik",
    "trac_ik",
    "ikpy",
    "mujoco",
    "eaik",
    "mplib",
    "tesseract_robotics",
    "pydrake",
    "genesis",
    "torch",
    "lerobot",
    "pyroboplan",
    "roboticstoolbox",
}  # measured where they are installed


def test_imports_keep_the_contracts_of_pyproject():
    code = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout


def test_every_room_of_the_ladder_has_a_row_in_the_architecture():
    contracts = api.read_configuration(str(ROOT / "pyproject.toml"))["contracts_options"]
    ladder = next(contract["layers"] for contract in contracts if contract["id"] == "ladder")
    rooms = [room for floor in ladder for room in re.findall(r"\w+", floor)]
    rows = re.findall(r"^\| `(\w+)/`", (ROOT / "ARCHITECTURE.md").read_text(), re.MULTILINE)
    public_modules = {"following", "ompl", "tip"}  # lists of names, in one row

    assert [room for room in rows if room in rooms] == [room for room in rooms[::-1] if room not in public_modules]


@pytest.mark.parametrize(
    "script", sorted((ROOT / "bench").rglob("*.py")), ids=lambda file: f"{file.parent.name}/{file.stem}"
)
def test_a_script_of_bench_imports_what_there_is(script):
    nodes = list(ast.walk(ast.parse(script.read_text())))
    modules = {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    modules |= {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    assert not {name for name in modules if name.split(".")[0] not in PEERS and find_spec(name) is None}


def test_mypy_checks_every_file_of_bench(monkeypatch):
    monkeypatch.chdir(ROOT)
    sources, _ = pytest.importorskip("mypy.main").process_options([])  # of pyproject.toml; single modules have no path
    checked = {Path(source.path or f"bench/{source.module}.py").resolve() for source in sources}
    assert [file for file in sorted((ROOT / "bench").rglob("*.py")) if file.resolve() not in checked] == []


def test_importing_the_package_imports_nothing_heavy():
    heavy = ["cv2", "meshcat", "numba", "matplotlib", "scipy"]
    code = f"import sys, rrtik_ompl; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_command_line_is_there_before_numpy():
    code = "import sys, rrtik_ompl.cli.app; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_what_plan_needs_is_imported_without_what_checks_files():
    code = "import sys, rrtik_ompl; rrtik_ompl.plan, rrtik_ompl.Problem, rrtik_ompl.World, rrtik_ompl.load_robot"
    spared = ["ompl", "numba", "scipy", "yaml", "numpy.random"]
    spared += [f"rrtik_ompl.{m}" for m in ("planning.moves.search", "ik.genetic.search", "ik.baselines")]
    spared += [f"rrtik_ompl.world.{m}" for m in ("certificate_check", "certificate_making", "distances")]
    code += f"; print([m for m in {spared} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.kernels
def test_a_plan_loads_none_of_what_only_a_wing_or_a_file_needs():
    code = """
import sys
import rrtik_ompl as rrtik

robot = rrtik.load_robot("panda")
post = rrtik.Obstacle("post", rrtik.Box(0.1, 0.1, 1.0), [0.45, 0.3, 0.5])
goal = rrtik.PositionGoal([0.3, 0.5, 0.4], tolerance=0.005)
plan = rrtik.plan(rrtik.Problem(rrtik.World(robot, rrtik.Scene([post])), robot.posture("default"), goal))
plan.require(), plan.proven
print(*{name.partition(".")[0] for name in sys.modules})
"""
    wings = "cv2 matplotlib meshcat tornado umsgpack zmq IPython PIL"
    files = "ompl subprocess tempfile yaml typer rich joblib scipy importlib_metadata mcap xacro"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {*f"{wings} {files}".split()} & {*done.stdout.split()} == set()


def test_a_world_is_loaded_without_a_compiler_and_without_what_covers_are_made_with():
    code = "import sys, rrtik_ompl.world.world, rrtik_ompl.kernels.covers.cache, rrtik_ompl.kernels.checks.fast_world"
    code += "; print([m for m in ('numba', 'scipy') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_is_there_and_says_what_it_is():
    assert set(rrtik_ompl.__all__) < set(dir(rrtik_ompl))
    assert [name for name, value in public_values(rrtik_ompl).items() if not inspect.getdoc(value)] == []

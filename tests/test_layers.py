"""The house is a ladder: a module imports only from those that stand before it."""

import ast
import inspect
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import rrtik_ompl

ROOT = Path(__file__).resolve().parent.parent
RUNGS = (
    "errors choices arrays shapes files poses transitions robot",
    "tip_distance task_region scene goal collision covers fast description catalog",
    "world search path problem ik problem_files moves reach",
    "ompl_bridge planning shortening generated_problems",
    "trajectory replanning plots",
    "viewer sensing overlay reproduce benchmark pilot cli __main__",
)
PEERS = {"vamp", "roboplan", "pytracik", "trac_ik", "ikpy", "eaik"}  # measured where they are installed
LADDER = [name for rung in RUNGS for name in rung.split()]


def _modules():
    for file in sorted((ROOT / "rrtik_ompl").rglob("*.py")):
        parts = file.relative_to(ROOT / "rrtik_ompl").with_suffix("").parts
        if parts != ("__init__",):
            yield parts[0], file


def _imports(file):
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_every_module_has_its_place_on_the_ladder():
    assert {room for room, _ in _modules()} == set(LADDER)


@pytest.mark.parametrize(("room", "file"), list(_modules()), ids=lambda value: getattr(value, "stem", value))
def test_a_module_imports_only_from_the_rungs_below(room, file):
    allowed = set(LADDER[: LADDER.index(room)]) | {room}
    inside = {name.split(".")[1] for name in _imports(file) if name.startswith("rrtik_ompl.")}
    assert inside <= allowed | {n for n in inside if n not in LADDER}, f"{file.name} reaches up: {inside - allowed}"


def test_the_core_knows_no_robot_and_no_planner():
    reached = {name.split(".")[0] for _, file in _modules() for name in _imports(file)}
    assert not reached & {"rrtik_planners", "rrtik_robots"}


def test_robots_and_planners_do_not_know_each_other():
    for folder, other in (("planners", "rrtik_robots"), ("robots", "rrtik_planners")):
        for file in (ROOT / folder).rglob("*.py"):
            assert other not in {name.split(".")[0] for name in _imports(file)}, file


@pytest.mark.parametrize("script", sorted((ROOT / "bench").glob("*.py")), ids=lambda file: file.stem)
def test_a_script_of_bench_imports_what_there_is(script):
    nodes = list(ast.walk(ast.parse(script.read_text())))
    modules = {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    modules |= {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    known = {path.stem for path in script.parent.iterdir()} | PEERS
    assert not {name for name in modules if name.split(".")[0] not in known and find_spec(name) is None}


def test_importing_the_package_imports_nothing_heavy():
    heavy = ["cv2", "meshcat", "numba", "matplotlib", "scipy"]
    code = f"import sys, rrtik_ompl; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_world_is_loaded_without_a_compiler_and_without_what_covers_are_made_with():
    code = "import sys, rrtik_ompl.world, rrtik_ompl.covers.cache, rrtik_ompl.fast.checks.fast_world"
    code += "; print([m for m in ('numba', 'scipy') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_is_there_and_says_what_it_is():
    assert set(rrtik_ompl.__all__) < set(dir(rrtik_ompl))
    assert [name for name in rrtik_ompl.__all__ if not inspect.getdoc(getattr(rrtik_ompl, name))] == []

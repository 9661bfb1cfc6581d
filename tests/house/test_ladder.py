"""Who may import whom: rooms by the floors of ARCHITECTURE.md."""

import re

import pytest

import house_imports

LIBRARY = house_imports.LIBRARY


@pytest.fixture(scope="module")
def ladder():
    """Rooms and modules in the root from below."""
    return [name for floor in house_imports.floors() for name in floor]


def between_roots():
    """Imports from one source root to another, as pairs of modules."""
    for module, targets in house_imports.arrows().items():
        for target in targets:
            if module.split(".")[0] != target.split(".")[0]:
                yield module, target


def room(module):
    return module.split(".")[1]


# --- rooms -------------------------------------------------------------------------------------------------------


def test_every_room_stands_on_a_floor(ladder):
    rooms = {room(name) for name in house_imports.module_names() if name.startswith(f"{LIBRARY}.")} - {"__main__"}
    assert rooms == set(ladder), "add the room to the table of floors in ARCHITECTURE.md, or take it out there"


def test_a_room_imports_only_from_floors_below(ladder):
    upwards = []
    for module, targets in house_imports.module_graph().items():
        if module.startswith(f"{LIBRARY}.") and room(module) in ladder:
            allowed = ladder[: ladder.index(room(module)) + 1]
            upwards += [f"{module} -> {target}" for target in sorted(targets) if room(target) not in allowed]
    assert upwards == [], "imports that lead up the ladder of ARCHITECTURE.md"


def test_the_face_of_the_library_is_seen_through():
    faces = house_imports.face_homes()
    assert faces[LIBRARY]["plan"] == f"{LIBRARY}.planning"
    assert faces[f"{LIBRARY}.fast"]["FastWorld"] == f"{LIBRARY}.fast.checks.fast_world"


def test_packages_import_the_library_alone():
    others = [f"{module} -> {target}" for module, target in between_roots() if target.split(".")[0] != LIBRARY]
    assert others == [], "robots, planners and tables know the library, which knows none of them by name"


@pytest.mark.parametrize("package", ["rrtik_planners", "rrtik_robots"])
def test_a_package_imports_no_more_of_the_library_than_its_floor(package, ladder):
    words = house_imports.floor_of_root()[package]
    assert "up to" in words, "ARCHITECTURE.md, Source roots: say up to which room"
    top, *more = [name for name in re.findall(r"`(\w+)`", words) if name != LIBRARY]
    allowed = {*ladder[: ladder.index(top) + 1], *more}
    pairs = [(module, target) for module, target in between_roots() if module.split(".")[0] == package]
    above = [f"{module} -> {target}" for module, target in pairs if target != LIBRARY and room(target) not in allowed]
    assert pairs
    assert above == []


# --- what the finder sees ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import rrtik_ompl as rrtik\nrrtik.plan()", "planning"),
        ("import rrtik\nrrtik.plan()", "planning"),
        ("import rrtik_ompl\nrrtik_ompl.Robot", "robot"),
        ("from rrtik_ompl import plan", "planning"),
        ("from rrtik_ompl import plan as p", "planning"),
        ("from rrtik import plan", "planning"),
        ("from rrtik_ompl import catalog", "catalog"),
        ("from rrtik_ompl.kernels import FastWorld", "fast.checks.fast_world"),
        ("from rrtik_ompl import fast\nfast.FastWorld", "fast.checks.fast_world"),
        ("def f():\n    from rrtik_ompl.world.path import JointPath", "path"),
        ("if TYPE_CHECKING:\n    import rrtik_ompl.world.path", "path"),
        ("import_module('rrtik_ompl.world.path')", "path"),
        ("importlib.import_module(f'rrtik_ompl.cli.{name}')", "cli"),
        ("__import__('rrtik_ompl.world.path')", "path"),
        ("library('checks.check_kernels')", "fast.checks.check_kernels"),
        ("from .scene import Scene", "scene"),
        ("from . import scene", "scene"),
    ],
)
def test_an_import_is_seen_in_every_form(text, found, tmp_path, monkeypatch):
    file = tmp_path / "rrtik_ompl" / "somewhere.py"
    file.parent.mkdir()
    file.write_text(text)
    monkeypatch.setattr(house_imports, "module_name", lambda path: f"{LIBRARY}.somewhere")
    assert house_imports.imports(file) - set(house_imports.face_homes()) == {f"{LIBRARY}.{found}"}

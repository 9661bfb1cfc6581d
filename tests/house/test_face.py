"""What type checkers and editors see of the public names is what there is."""

import ast
import inspect
from importlib import import_module
from pkgutil import resolve_name

import pytest

import rrtik_ompl
from rrtik_ompl.base.lazy import public_values
from rrtik_tests.places import ROOT

SOURCES = {"rrtik_ompl": ROOT, "rrtik_planners": ROOT / "planners", "rrtik_robots": ROOT / "robots"}


def lazy_modules():
    """Names and files of the modules whose names are imported when they are used, as their block for checkers says."""
    for package, place in SOURCES.items():
        for file in sorted((place / package).rglob("*.py")):
            text = file.read_text()
            if "__getattr__" in text and "if TYPE_CHECKING:" in text and "__all__" in text:
                yield ".".join(file.relative_to(place).with_suffix("").parts).removesuffix(".__init__"), file


LAZY = dict(lazy_modules())


def imported(statements):
    """Where each name comes from that statements import from modules."""
    lines = [each for each in statements if isinstance(each, ast.ImportFrom)]
    return {alias.asname or alias.name: f"{line.module}:{alias.name}" for line in lines for alias in line.names}


def test_the_face_and_its_parts_are_lazy():
    assert {"rrtik_ompl", "rrtik_ompl.ik", "rrtik_ompl.ompl", "rrtik_ompl.tip", "rrtik_planners"} <= set(LAZY)


@pytest.mark.parametrize("name", LAZY)
def test_type_checkers_see_the_names_that_are_imported_late(name):
    body = ast.parse(LAZY[name].read_text()).body
    (block,) = [each for each in body if isinstance(each, ast.If) and ast.unparse(each.test) == "TYPE_CHECKING"]
    seen = imported(block.body)
    module = import_module(name)
    assert set(seen) == set(module.__all__) - set(imported(body))
    assert [each for each, home in seen.items() if getattr(module, each) is not resolve_name(home)] == []


def functions():
    """Public functions, and methods of public classes that these define."""
    for name, value in public_values(rrtik_ompl).items():
        if inspect.isfunction(value):
            yield name, value
        if not inspect.isclass(value):
            continue
        for member, held in vars(value).items():
            if member == "__init__" or not member.startswith("_"):
                function = inspect.unwrap(getattr(held, "fget", None) or getattr(held, "__func__", held))
                if inspect.isfunction(function) and function.__module__.startswith("rrtik_"):
                    yield f"{name}.{member}", function


FUNCTIONS = dict(functions())


def test_options_are_in_signatures():
    """None is hidden behind ``**options``, which neither an editor nor a type checker knows."""
    assert len(FUNCTIONS) > 300
    hidden = [name for name, each in FUNCTIONS.items() if each.__code__.co_flags & inspect.CO_VARKEYWORDS]
    assert hidden == []


def test_every_parameter_and_result_has_a_type():
    bare = []
    for name, function in FUNCTIONS.items():
        parameters = list(inspect.signature(function, follow_wrapped=False).parameters)
        wanted = {each for each in parameters if each not in ("self", "cls")}
        wanted |= {"return"} - ({"return"} if name.endswith(".__init__") else set())
        bare += [f"{name}: {each}" for each in sorted(wanted - set(function.__annotations__))]
    assert bare == []

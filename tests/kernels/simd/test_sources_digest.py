"""Which edits make kernels anew: those of kernels and layouts, no others."""

import ast
import importlib
import inspect
import shutil
import subprocess
import sys

import pytest

from rrtik_ompl.kernels.simd import code_files

pytestmark = pytest.mark.kernels

KERNELS = "checks.check_kernels"


@pytest.fixture
def edited(monkeypatch):
    """Reads a module of the package as if somebody had edited it."""

    def edit(name):
        text = code_files.source_text
        monkeypatch.setattr(code_files, "source_text", lambda module: text(module) + "# changed\n" * (module == name))
        monkeypatch.setattr(code_files, "sources_digest", code_files.sources_digest.__wrapped__)

    return edit


def test_another_source_or_processor_has_another_file(edited, monkeypatch):
    before = code_files.machine_key(KERNELS)
    monkeypatch.setattr(code_files, "processor_identity", lambda: "another")
    other = code_files.machine_key(KERNELS)
    edited("simd.lanes")
    assert len({code_files.file_name(KERNELS, key) for key in (before, other, code_files.machine_key(KERNELS))}) == 3


def test_an_edit_of_a_kernel_or_a_layout_makes_anew_what_depends_on_it_and_nothing_else(edited):
    before = {name: code_files.machine_key(name) for name in code_files.kernel_modules()}
    edited("search.connect_layout")
    assert {name for name, key in before.items() if code_files.machine_key(name) != key} == {
        "search.connect_kernels",
        "search.repair_kernels",
        "search.short.kernels",
    }


def test_an_edit_of_covers_makes_nothing_anew(tmp_path):
    copy = tmp_path / "rrtik_ompl"
    shutil.copytree(code_files.FOLDER.parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    code = "from rrtik_ompl.kernels.simd.code_files import *; print(*map(machine_key, kernel_modules()))"

    def keys():
        return subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)

    before = keys().stdout
    (copy / "kernels" / "covers" / "spheres.py").write_text(
        "# changed\n" + (copy / "kernels" / "covers" / "spheres.py").read_text()
    )
    assert keys().stdout == before
    (copy / "kernels" / "checks" / "gjk.py").write_text(
        "# changed\n" + (copy / "kernels" / "checks" / "gjk.py").read_text()
    )
    assert keys().stdout != before


@pytest.mark.parametrize("module", ["tables.robot_tables", "tables.packing", "simd.library", "checks.fast_world"])
def test_an_edit_of_what_holds_no_kernel_makes_nothing_anew(edited, module):
    before = {name: code_files.machine_key(name) for name in code_files.kernel_modules()}
    assert all(module not in code_files.kernel_sources(name) for name in before)
    edited(module)
    assert {name: code_files.machine_key(name) for name in before} == before


def holds_nothing(module):
    """Whether a module of ``kernels/`` is a docstring alone, as packages are."""
    statements = ast.parse(inspect.getsource(importlib.import_module(f"rrtik_ompl.kernels.{module}"))).body
    return len(statements) == 1 and isinstance(statements[0], ast.Expr)


IMPORTED = """
import sys
import numba  # once: it takes longer than all that is measured
import rrtik_ompl
print(*[m for m in sys.modules if m.startswith("rrtik_ompl")])
for name in sys.argv[1:]:
    for module in [m for m in sys.modules if m.startswith("rrtik_ompl")]:
        del sys.modules[module]
    __import__(f"rrtik_ompl.kernels.{name}")
    print(*[m for m in sys.modules if m.startswith("rrtik_ompl.")])
"""


def test_the_sources_of_a_kernel_are_all_that_it_imports():
    names = code_files.kernel_modules()
    done = subprocess.run([sys.executable, "-c", IMPORTED, *names], capture_output=True, text=True, check=True)
    kept_apart = {"simd.code_files", "simd.targets"}  # where code is kept, and for what machine, stands in its key
    of_the_package, *of_kernels = done.stdout.splitlines()
    for name, line in zip(names, of_kernels, strict=True):
        imported = set(line.split()) - set(of_the_package.split())
        outside = {m for m in imported if m.split(".")[1] != "kernels"}
        assert outside <= {
            "rrtik_ompl.files",
            *(f"rrtik_ompl.files.{name}" for name in ("cache", "digest", "notice")),
        }, "the digest sees kernels/ alone"
        prefix = "rrtik_ompl.kernels."
        loaded = {m.removeprefix(prefix) for m in imported if m.startswith(prefix)}
        others = loaded - set(code_files.kernel_sources(name)) - kept_apart
        assert [module for module in others if not holds_nothing(module)] == []

"""The build hook puts what could be compiled into a wheel; one that must have all kernels is not built without."""

import runpy
import subprocess
import sys
import types
from pathlib import Path

import pytest

from rrtik_ompl.kernels.simd import code_files


@pytest.fixture
def hook(monkeypatch):
    """The build hook's module, without hatch, and a hook whose messages are kept."""
    name = "hatchling.builders.hooks.plugin.interface"
    interface = types.ModuleType(name)
    interface.BuildHookInterface = object
    monkeypatch.setitem(sys.modules, name, interface)
    module = types.SimpleNamespace(**runpy.run_path(str(code_files.FOLDER / "simd" / "hatch_build.py")))
    made, said = module.KernelBitcode(), []
    made.root = str(code_files.FOLDER.parent.parent)
    made.app = types.SimpleNamespace(display_info=said.append, display_warning=said.append)
    return made, module.KernelBitcode.initialize.__globals__, said


def test_a_wheel_takes_along_what_could_be_compiled(hook, monkeypatch):
    made, names, said = hook
    order = [sys.executable, "-c", "import sys, pathlib; pathlib.Path(sys.argv[1], 'k-8.bitcode').touch()"]
    monkeypatch.setitem(names, "_compiler", lambda *given: subprocess.Popen([*order, str(given[-1])]))
    build = {"force_include": {}}
    made.initialize("standard", build)
    assert [*build["force_include"].values()] == ["rrtik_ompl/kernels/k-8.bitcode"]
    assert all(Path(file).is_file() for file in build["force_include"])
    assert said == ["kernels as bitcode: k-8.bitcode"]


def test_a_wheel_is_built_without_a_compiler(hook, monkeypatch):
    made, names, said = hook
    build = {"force_include": {}}
    made.initialize("editable", build)
    monkeypatch.setitem(names, "_compiler", lambda *_: subprocess.Popen([sys.executable, "-c", "raise SystemExit(1)"]))
    made.initialize("standard", build)
    monkeypatch.setitem(names, "_compiler", lambda *_: subprocess.Popen(["no such program"]))
    made.initialize("standard", build)
    assert build == {"force_include": {}}
    assert [message.partition(":")[0] for message in said] == ["kernels as bitcode"] * 2


def test_a_wheel_that_must_have_all_kernels_is_not_built_without(hook, monkeypatch):
    made, names, _ = hook
    monkeypatch.setitem(names, "SETTING", "1")
    ends = [sys.executable, "-c", "import sys; sys.exit(int(sys.argv[1]))"]
    for missing in ("8", "16"):
        monkeypatch.setitem(
            names, "_compiler", lambda w, *_, bad=missing: subprocess.Popen([*ends, str(int(w == bad))])
        )
        with pytest.raises(RuntimeError, match="not all could be compiled"):
            made.initialize("standard", {"force_include": {}})

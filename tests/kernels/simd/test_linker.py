"""Object files of x86-64 run without LLVM, those for Windows too; what asks for more is left to LLVM."""

import ctypes
import subprocess
import sys

import llvmlite.binding as llvm
import numpy as np
import pytest

from rrtik_ompl import load_problem
from rrtik_ompl.kernels.simd import library
from rrtik_ompl.kernels.simd.bitcode_store import own_bitcode
from rrtik_ompl.kernels.simd.linker import linked
from rrtik_ompl.kernels.simd.targets import TARGETS, this_target
from rrtik_tests.windows_calls import windows_library

x86 = pytest.mark.skipif(this_target().name != "x86_64-linux", reason="machine code for Linux on x86-64")
pytestmark = [pytest.mark.kernels, x86]

KERNELS = "checks.check_kernels"
BY_NAME = {target.name: target for target in TARGETS}
LINUX, WINDOWS = BY_NAME["x86_64-linux"], BY_NAME["x86_64-windows"]


def object_of(text, triple=LINUX.code):
    """The object file of some assembly of LLVM."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    module = llvm.parse_assembly(text)
    module.triple = triple
    return llvm.Target.from_triple(triple).create_target_machine(reloc="pic", codemodel="default").emit_object(module)


def called(address, *values):
    return ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * len(values))(address)(*values)


CONSTANTS = """
@table = internal constant [4 x double] [double 1.5, double 2.5, double 3.5, double 4.5], align 32
declare double @cos(double)
define double @second(double %x) {
  %at = getelementptr double, ptr @table, i64 1
  %value = load double, ptr %at
  %c = call double @cos(double %x)
  %sum = fadd double %value, %c
  ret double %sum
}
define double @twice(double %x) {
  %y = call double @second(double %x)
  %z = fadd double %y, %y
  ret double %z
}
"""


def test_constants_calls_and_functions_of_c_are_reached():
    found = linked(object_of(CONSTANTS), ["second", "twice"])
    assert called(found["second"], 0.25) == 2.5 + np.cos(0.25)
    assert called(found["twice"], 0.25) == 2.0 * (2.5 + np.cos(0.25))


def test_a_name_that_is_nowhere_is_told():
    with pytest.raises(RuntimeError, match="missing"):
        linked(object_of("declare void @missing()\ndefine void @f() {\ncall void @missing()\nret void\n}"), ["f"])
    with pytest.raises(RuntimeError, match="no function third"):
        linked(object_of(CONSTANTS), ["third"])


@pytest.mark.parametrize(
    "data",
    [
        object_of("@x = internal global i64 1\ndefine ptr @f() {\nret ptr @x\n}"),
        object_of("@x = internal global i64 0\ndefine ptr @f() {\nret ptr @x\n}"),
        object_of("@x = external global i64\ndefine ptr @f() {\nret ptr @x\n}"),
        object_of("define void @f() {\nret void\n}", "aarch64-unknown-linux-gnu"),
        object_of("define void @f() {\nret void\n}", "x86_64-apple-macosx15.0.0"),
        b"",
    ],
    ids=["written", "zeros", "not far", "ARM", "Mach-O", "nothing"],
)
def test_what_kernels_do_not_ask_for_is_left_to_llvm(data):
    assert linked(data, ["f"]) is None


def test_kernels_for_windows_give_the_same_answers(monkeypatch):
    world = load_problem("panda_shelf").world
    bitcode = own_bitcode(KERNELS)
    module = llvm.parse_bitcode(bitcode.code)
    machine = library.target_machine(WINDOWS.code)
    module.triple = WINDOWS.code
    module.data_layout = str(machine.target_data)
    asked = []
    made = Noticed(windows_library(bitcode.entries, machine.emit_object(module)), asked)

    rng = np.random.default_rng(1)
    Q, ends = rng.uniform(world.robot.lower, world.robot.upper, (2, 300, world.robot.dof))
    ends = Q + 0.05 * (ends - Q)
    own = [*world.valid_batch(Q), *world.motion_valid_batch(Q, ends)]
    assert 30 < sum(own) < 570
    monkeypatch.setattr(world.fast, "_kernels", made)
    assert [*world.valid_batch(Q), *world.motion_valid_batch(Q, ends)] == own
    assert asked


class Noticed:
    """A library whose use is noted."""

    def __init__(self, functions, asked):
        self._functions, self._asked = functions, asked

    def __getattr__(self, name):
        self._asked.append(name)
        return getattr(self._functions, name)


def test_a_plan_with_kernels_that_are_there_loads_no_compiler():
    code = (
        "import sys, rrtik_ompl as r; problem = r.load_problem('planar3_boxes'); assert r.plan(problem, seed=1).found"
    )
    code += "; print([name for name in ('llvmlite', 'numba') if name in sys.modules])"
    for _ in range(2):  # the first makes them, if they are not there
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]"]

"""Code that was made for Windows on x86-64, run on Linux: small functions that turn one way of calling into the other.

Windows passes arguments in other registers and wants more of them left alone; LLVM knows both ways (win64cc and ccc).
"""

import ctypes
from ctypes import CDLL

import llvmlite.binding as llvm

from rrtik_ompl.kernels.simd import linker
from rrtik_ompl.kernels.simd.code_files import PREFIX
from rrtik_ompl.kernels.simd.library import Library
from rrtik_ompl.kernels.simd.processor import target_machine
from rrtik_ompl.kernels.simd.targets import this_target

ONE = ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "rint", "floor", "ceil")
TWO = ("atan2", "pow", "fmod")
C = {  # the result and the arguments
    "memset": ("ptr", "ptr", "i32", "i64"),
    "memmove": ("ptr", "ptr", "ptr", "i64"),
    "memcpy": ("ptr", "ptr", "ptr", "i64"),
    **dict.fromkeys(ONE, ("double", "double")),
    **dict.fromkeys(TWO, ("double", "double", "double")),
}


def windows_library(counts, data):
    """A library of an object file for Windows; ``counts`` has the numbers of arguments of its functions, by name."""
    names = [PREFIX + entry for entry in counts]
    found = linker.linked(data, names, _found_as_windows_calls_it)
    callers = {entry: _caller(found[PREFIX + entry], count) for entry, count in counts.items()}
    return Library(counts, callers)


def _found_as_windows_calls_it(name):
    if name == "__chkstk":
        return linker._executable(b"\xc3")  # a return: Linux lets a stack grow by itself
    result, *kinds = C[name]
    here = ctypes.cast(getattr(CDLL("libm.so.6"), name), ctypes.c_void_p).value
    return _turned(here, result, kinds, "ccc", "win64cc")


def _caller(address, count):
    return _turned(address, "i64", ["i64"] * count, "win64cc", "ccc")


def _turned(address, result, kinds, its, ours):
    """The address of a function that is called in our way and calls another one in its way."""
    arguments = ", ".join(f"{kind} %x{k}" for k, kind in enumerate(kinds))
    text = f"define {ours} {result} @turned({arguments}) {{\n"
    text += f"%r = call {its} {result} inttoptr (i64 {address} to ptr)({arguments})\nret {result} %r\n}}"
    machine = target_machine(this_target().code)
    module = llvm.parse_assembly(text)
    module.triple = machine.triple
    return linker.linked(machine.emit_object(module), ["turned"])["turned"]

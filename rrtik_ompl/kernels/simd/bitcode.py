"""A kernel module as one piece of LLVM bitcode: numba compiles its functions, plain C functions lead to them.

Bitcode is the same for every processor of a kind of machine, and is retargeted to other kinds. LLVM alone makes code of
it, for one processor.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core.registry import cpu_target

from rrtik_ompl.kernels.simd import compiled
from rrtik_ompl.kernels.simd.code_files import PREFIX, Code
from rrtik_ompl.kernels.simd.records import argument_types
from rrtik_ompl.kernels.simd.targets import Target

WHOLE = ir.IntType(64)
RUNTIMES = ("Py", "_Py", "NRT_", "numba_", "__svml")  # beginnings of names that only Python or numba can provide


def compiled_module(name: str) -> Code:
    """Compile the functions of a module of this package that Python calls.

    Raises:
        RuntimeError: If a kernel needs Python or numba to run.
    """
    module = import_module(f"rrtik_ompl.kernels.{name}")
    functions = compiled.entries(module.__name__)
    linked = llvm.parse_assembly(str(_entry_points(functions)))
    for function in functions.values():
        overload = _overload(function)
        code = overload.library._get_module_for_linking().clone()
        code.get_function(overload.fndesc.llvm_func_name).linkage = "external"  # or it is dropped as not called
        linked.triple = code.triple
        linked.data_layout = code.data_layout
        linked.link_in(code)
    _hide_all_but(linked, {PREFIX + entry for entry in functions})
    foreign = sorted(f.name for f in linked.functions if f.is_declaration and f.name.startswith(RUNTIMES))
    if foreign:
        raise RuntimeError(f"{name}: kernels may not allocate, raise or use objects, but need {', '.join(foreign)}")
    return Code({entry: _count(function) for entry, function in functions.items()}, linked.as_bitcode())


def _count(function: Any) -> int:
    return int(function.py_func.__code__.co_argcount)


def _overload(function: Any) -> Any:
    """Numba's result for the arguments as they are annotated: whole numbers, and addresses, which are whole numbers."""
    kinds = argument_types(function.py_func)
    function.compile(kinds)
    return function.overloads[kinds]


def _entry_points(functions: dict[str, Any]) -> Any:
    """C functions of whole numbers that call those of numba, which return a status and the result at an address."""
    module = ir.Module("entry_points")
    for entry, function in functions.items():
        overload = _overload(function)
        count = _count(function)
        convention = cpu_target.target_context.call_conv
        kind = convention.get_function_type(types.int64, (types.int64,) * count)
        inner = ir.Function(module, kind, overload.fndesc.llvm_func_name)
        outer = ir.Function(module, ir.FunctionType(WHOLE, [WHOLE] * count), PREFIX + entry)
        builder = ir.IRBuilder(outer.append_basic_block())
        result = builder.alloca(WHOLE)
        trouble = builder.alloca(kind.args[1].pointee)
        builder.store(ir.Constant(WHOLE, 0), result)
        builder.call(inner, [result, trouble, *outer.args])
        builder.ret(builder.load(result))
    return module


def _hide_all_but(module: Any, shown: set[str]) -> None:
    """Make all else private to the module, so that what is called once is inlined; drop what nobody needs.

    That includes the names of values, which are more than half of the bitcode and change nothing that it computes.
    """
    for item in (*module.functions, *module.global_variables):
        if not item.is_declaration and item.name not in shown:
            item.linkage = "internal"
    machine = llvm.Target.from_triple(module.triple).create_target_machine()
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options())
    passes = builder.getModulePassManager()
    passes.add_global_dead_code_eliminate_pass()
    passes.add_strip_dead_prototype_pass()
    passes.add_strip_symbols_pass()
    passes.run(module, builder)


def retargeted(code: Code, target: Target) -> Code:
    """Bitcode for another kind of machine.

    Raises:
        RuntimeError: If LLVM cannot make code for it, or finds the bitcode invalid.
    """
    module = llvm.parse_bitcode(code.code)
    module.triple = target.triple
    module.data_layout = str(target_generator(target).target_data)
    module.verify()
    return Code(code.entries, module.as_bitcode())


def target_generator(target: Target, effort: int = 3) -> Any:
    """LLVM's code generator for any processor of a kind of machine; ``effort`` is 0 to 3, LLVM's level.

    Raises:
        RuntimeError: If this LLVM was built without it.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    return llvm.Target.from_triple(target.code).create_target_machine(opt=effort, reloc="pic", codemodel="default")

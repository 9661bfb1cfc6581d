"""Kernel modules as one WebAssembly module: LLVM's object for wasm32 is one that a browser takes, without a linker.

Addresses stay whole numbers of 64 bits, in arguments and in tables, as everywhere in the kernels; only where memory is
read or written does LLVM cut them to 32. The module imports its memory, the top of its stack, and ``sin`` and ``cos``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import llvmlite.binding as llvm

from rrtik_ompl.kernels.simd.code_files import PREFIX, Code

TRIPLE = "wasm32-unknown-unknown"
FEATURES = "+simd128,+bulk-memory"
HEAD_BYTES = 8  # "\0asm" and the version
CUSTOM_SECTION = 0  # names and what only linkers read

ROOTS = {"sqrt": ("double", "llvm.sqrt.f64"), "sqrtf": ("float", "llvm.sqrt.f32")}  # C's, and LLVM's instructions


def wasm_module(libraries: Mapping[str, Code]) -> bytes:
    """One module of several libraries of kernels.

    Args:
        libraries: Their bitcode, by what their functions' names begin with: ``{"ik": ...}`` exports ``ik_solve``.

    Raises:
        RuntimeError: If this LLVM cannot make it.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(cpu="", features=FEATURES, opt=3)
    whole = llvm.parse_assembly("")
    whole.triple = TRIPLE
    whole.data_layout = str(machine.target_data)
    for name, code in libraries.items():
        whole.link_in(llvm.parse_assembly(_exported(code, name, str(machine.target_data))))
    passes = llvm.create_new_module_pass_manager()
    passes.add_merge_functions_pass()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(whole, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    emitted: bytes = machine.emit_object(whole)
    return b"".join([emitted[:HEAD_BYTES], *(data for kind, data in sections(emitted) if kind != CUSTOM_SECTION)])


def _exported(code: Code, name: str, layout: str) -> str:
    """A library as LLVM's text for wasm32, its functions exported under names of their own."""
    text = str(llvm.parse_bitcode(code.code))
    text = re.sub(r'"(?:target-cpu|target-features|tune-cpu)"="[^"]*"', "", text)
    text = re.sub(r'target triple = "[^"]*"', f'target triple = "{TRIPLE}"', text)
    text = re.sub(r'target datalayout = "[^"]*"', f'target datalayout = "{layout}"', text)
    for entry in code.entries:
        shown = f"{name}_{entry}"
        old = rf"(define [^\n]*)@{PREFIX}{entry}(\([^\n]*?\)(?: local_unnamed_addr| unnamed_addr)?)"
        new = rf'\1@{shown}\2 "wasm-export-name"="{shown}"'
        text, count = re.subn(old, new, text)
        if count != 1:
            raise RuntimeError(f"WebAssembly: {name} has {count} functions {entry}")
    for called, (kind, intrinsic) in ROOTS.items():
        inner = f"%r = call {kind} @{intrinsic}({kind} %x) ret {kind} %r"
        defined = f"define internal {kind} @{called}({kind} %x) alwaysinline {{ {inner} }}"
        declared = "" if f"@{intrinsic}(" in text else f"\ndeclare {kind} @{intrinsic}({kind})"
        text = re.sub(rf"declare {kind} @{called}\({kind}[^\n]*", lambda _, new=defined + declared: new, text)  # type: ignore[misc]
    return text


def sections(module: bytes) -> Iterator[tuple[int, bytes]]:
    """The sections of a WebAssembly module: the kind of each, and its bytes with their head."""
    begin = HEAD_BYTES
    while begin < len(module):
        size, inside = leb128(module, begin + 1)
        yield module[begin], module[begin : inside + size]
        begin = inside + size


def leb128(data: Any, at: int) -> tuple[int, int]:
    """A whole number, seven bits a byte (LEB128), and the place behind it."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, at

"""Kernels as a WebAssembly module."""

import pytest

from rrtik_ompl.fast.wasm.emit import EXPORTS, IMPORTS, names_of, sections
from rrtik_ompl.fast.wasm.page_kernels import LIBRARIES, page_kernels

pytestmark = pytest.mark.kernels


def test_the_module_exports_every_entry_and_imports_what_a_page_gives():
    module = page_kernels()
    assert module[:8] == b"\0asm\1\0\0\0"
    exported = names_of(module, EXPORTS)
    assert {name.split("_")[0] for name in exported} == set(LIBRARIES)
    assert {"connect_solve", "connect_resume", "shortcut_resume", "ik_solve", "check_classify"} <= set(exported)
    assert set(names_of(module, IMPORTS)) <= {"__linear_memory", "__stack_pointer", "sin", "cos"}


def test_it_has_no_sections_that_only_linkers_read():
    kinds = [kind for kind, _ in sections(page_kernels())]
    assert 0 not in kinds
    assert kinds == sorted(kinds)

"""Kernels as a WebAssembly module."""

from functools import cache

import pytest

from rrtik_ompl.kernels.wasm import page_kernels as page_kernels_module
from rrtik_ompl.kernels.wasm.emit import leb128, sections
from rrtik_ompl.kernels.wasm.page_kernels import LIBRARIES, page_kernels

pytestmark = pytest.mark.kernels
IMPORTS, EXPORTS = 2, 7  # kinds of sections
FUNCTION, TABLE, MEMORY, GLOBAL = range(4)  # kinds of imports


def names_of(module, kind):
    """Names in the import (kind 2, fields alone) or export section (kind 7) of a module."""
    found = []
    for section, data in sections(module):
        if section != kind:
            continue
        _, at = leb128(data, 1)
        count, at = leb128(data, at)
        for _ in range(count):
            if kind == IMPORTS:
                _, at = text(data, at)
            name, at = text(data, at)
            found.append(name)
            at = behind_import(data, at) if kind == IMPORTS else leb128(data, at + 1)[1]
    return found


def behind_import(data, at):
    kind = data[at]
    if kind == FUNCTION:
        return leb128(data, at + 1)[1]
    if kind == GLOBAL:
        return at + 3
    at += 1 if kind == MEMORY else 2  # a table begins with the kind of its elements
    limited, at = data[at], at + 1
    _, at = leb128(data, at)
    return leb128(data, at)[1] if limited & 1 else at


def text(data, at):
    size, at = leb128(data, at)
    return data[at : at + size].decode(), at + size


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


def test_why_pages_do_not_plan_is_said_once(monkeypatch):
    def broken():
        raise RuntimeError("no target\nwasm32")

    monkeypatch.setattr(page_kernels_module, "read_code", lambda file, key: None)
    monkeypatch.setattr(page_kernels_module, "cache_folder", lambda kind: None)
    monkeypatch.setattr(page_kernels_module, "made_page_kernels", broken)
    fresh = cache(page_kernels.__wrapped__)
    with pytest.warns(RuntimeWarning, match=r"^pages do not plan.*no target wasm32$") as said:
        assert (fresh(), fresh()) == (None, None)
    assert len(said) == 1

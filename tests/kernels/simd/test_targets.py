"""Bitcode of one kind of machine is that of all of them; what was made for no known kind is never used."""

import warnings

import llvmlite.binding as llvm
import pytest

from rrtik_ompl.kernels.simd import bitcode, bitcode_store, code_files, library, targets
from rrtik_ompl.kernels.simd.bitcode_store import own_bitcode
from rrtik_ompl.kernels.simd.targets import TARGETS, target_of, this_target
from rrtik_tests.object_files import symbols
from rrtik_tests.sizes import how_many

pytestmark = pytest.mark.kernels

KERNELS = "checks.distance_kernels"
MATHEMATICS = ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "pow", "fmod", "sqrt", "fma"]
ROUNDING = ["floor", "ceil", "rint", "round", "trunc", "fmin", "fmax"]
NUMBERS = {f"{name}{kind}" for name in MATHEMATICS + ROUNDING for kind in ("", "f")}
C_LIBRARY = NUMBERS | {"memcpy", "memmove", "memset"}  # in glibc and in Apple's libSystem alike
OWN_C = {  # LLVM knows them
    "x86_64-linux": {"sincos", "sincosf"},
    "aarch64-linux": {"sincos", "sincosf"},
    "arm64-macos": {"bzero", "__sincos_stret", "__sincosf_stret"},
    "x86_64-macos": {"sincos", "sincosf"},  # which our linker finds under the names of Apple
    "x86_64-windows": {"__chkstk"},
}
FOREIGN = [target for target in TARGETS if target != this_target()]
BY_NAME = {target.name: target for target in TARGETS}

TRIPLES = {
    "x86_64-unknown-linux-gnu": "x86_64-linux",
    "x86_64-conda-linux-gnu": "x86_64-linux",
    "aarch64-unknown-linux-gnu": "aarch64-linux",
    "aarch64-redhat-linux": "aarch64-linux",
    "arm64-apple-darwin24.6.0": "arm64-macos",
    "arm64-apple-macosx15.0.0": "arm64-macos",
    "x86_64-apple-darwin24.6.0": "x86_64-macos",
    "x86_64-pc-windows-msvc": "x86_64-windows",
    "x86_64-pc-windows-msvc-elf": "x86_64-windows",
    "AMD64-windows": "x86_64-windows",
    "aarch64-pc-windows-msvc": None,
    "armv7l-unknown-linux-gnueabihf": None,
    "riscv64-unknown-linux-gnu": None,
    "": None,
}


@pytest.fixture(scope="module")
def code():
    return own_bitcode(KERNELS)


@pytest.mark.parametrize(("triple", "name"), TRIPLES.items())
def test_a_triple_names_a_kind_of_machine(triple, name):
    assert target_of(triple) == (None if name is None else BY_NAME[name])


def test_kinds_have_names_and_triples_of_their_own():
    assert [target_of(target.triple) for target in TARGETS] == [*TARGETS]
    assert len(BY_NAME) == len(TARGETS)


def checked_object(name, code, target, effort):
    """The object file of a library for a kind of machine, whose names have been checked."""
    made = bitcode.retargeted(code, target)
    module = llvm.parse_bitcode(made.code)
    assert (target_of(module.triple), made.entries) == (target, code.entries)
    module.triple = target.code
    data = bitcode.target_generator(target, effort).emit_object(module)
    defined, needed = symbols(data)
    assert defined == {code_files.PREFIX + entry for entry in code.entries}, name
    assert needed <= C_LIBRARY | OWN_C[target.name], name
    return data


@pytest.mark.parametrize("target", TARGETS, ids=BY_NAME)
def test_code_for_every_kind_is_made_here_and_needs_the_c_library_alone(code, target):
    magic = b"\xcf\xfa\xed\xfe" if target.name == "arm64-macos" else b"\x7fELF"
    assert checked_object(KERNELS, code, target, 3).startswith(magic)


@pytest.mark.slow
@pytest.mark.parametrize("name", code_files.kernel_modules())
def test_code_of_every_library_is_made_for_other_kinds(name):
    """A part of the tests makes it for the last kind alone, whose processor and C library are both another's."""
    for target in FOREIGN[-how_many(len(FOREIGN), 1) :]:
        checked_object(name, own_bitcode(name), target, 0)


def test_missing_names_are_seen(code):
    text = "declare i64 @PyLong_AsLong(i64)\ndefine i64 @rrtik_f(i64 %x) {\n"
    text += "%y = call i64 @PyLong_AsLong(i64 %x)\nret i64 %y\n}"
    asking = code_files.Code({"f": 1}, llvm.parse_assembly(text).as_bitcode())
    for target in TARGETS:
        data = bitcode.target_generator(target).emit_object(llvm.parse_bitcode(bitcode.retargeted(asking, target).code))
        assert symbols(data) == ({"rrtik_f"}, {"PyLong_AsLong"})


@pytest.mark.parametrize("target", FOREIGN, ids=[target.name for target in FOREIGN])
def test_bitcode_of_another_kind_gives_the_same_code_of_this_processor(code, target):
    assert library.machine_code(bitcode.retargeted(code, target)).code == library.machine_code(code).code


@pytest.mark.parametrize("triple", ["aarch64-pc-windows-msvc", "riscv64-unknown-linux-gnu"])
def test_bitcode_of_no_known_kind_is_never_used(code, triple, tmp_path, monkeypatch):
    module = llvm.parse_bitcode(code.code)
    module.triple = triple
    unknown = code_files.Code(code.entries, module.as_bitcode())
    assert library.machine_code(unknown) is None

    def fail(name):
        raise ValueError(f"{name} is compiled")

    monkeypatch.setenv("RRTIK_CACHE", "")
    monkeypatch.setattr(bitcode_store, "FOLDER", tmp_path)
    monkeypatch.setattr(bitcode, "compiled_module", fail)
    code_files.write_code(tmp_path / code_files.bitcode_name(KERNELS), code_files.bitcode_key(KERNELS), unknown)
    with pytest.raises(ValueError, match="is compiled"):
        library._made(KERNELS)


def test_a_machine_of_no_known_kind_takes_the_reference_path_and_says_so_once(monkeypatch):
    monkeypatch.setattr(targets.platform, "machine", lambda: "ARM64")
    monkeypatch.setattr(targets.sys, "platform", "win32")
    monkeypatch.setattr(library, "_libraries", {})
    monkeypatch.setattr(library, "_said", set())
    monkeypatch.setattr(library, "_kept", lambda name: pytest.fail("code was tried"))
    monkeypatch.setattr(library, "_made", lambda name: pytest.fail("code was made"))
    this_target.cache_clear()
    try:
        said = r"plain numpy, many times slower: there are no kernels for ARM64 with windows \(there are for [^\n]*\)$"
        with pytest.warns(RuntimeWarning, match=said):
            assert library.library(KERNELS) is None
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert library.library("checks.check_kernels") is None
    finally:
        this_target.cache_clear()


def test_every_kernel_that_does_not_compile_is_told_in_one_line_with_its_name(monkeypatch):
    def fail(name):
        raise ValueError(f"in {name}:\n  line 3\n" + "no such name\n" * 999 if name != "b" else "of all")

    monkeypatch.setattr(library, "_kept", lambda name: None)
    monkeypatch.setattr(library, "_made", fail)
    monkeypatch.setattr(library, "_libraries", {})
    monkeypatch.setattr(library, "_said", set())
    with pytest.warns(RuntimeWarning) as caught:
        assert [library.library(name) for name in ("a", "b", "c", "a", "b")] == [None] * 5
    said = [str(warning.message) for warning in caught]
    assert [line.split(":")[0] for line in said] == [f"there are no kernels {name}" for name in "abc"]
    assert all(line.isprintable() and len(line) < 500 for line in said)
    assert "ValueError: in c: line 3 no such name" in said[2]
    monkeypatch.setattr(library, "_libraries", {})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        library.library("b")  # the same reason


def test_a_build_makes_every_width_that_any_machine_asks_for():
    names = {(target.name, width) for target in TARGETS for width in target.lanes}
    wide = {f"x86_64-{system}" for system in ("linux", "macos", "windows")}
    assert names == {(name, 16) for name in wide} | {(name, 8) for name in wide | {"aarch64-linux", "arm64-macos"}}
    assert set(targets.targets_of_this_width()) == {t for t in TARGETS if targets.WIDTH in t.lanes}

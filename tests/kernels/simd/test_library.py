"""Kernels are made once for a processor, load without numba, and a bad cache costs time, never a wrong answer."""

import fcntl
import os
import shutil
import subprocess
import sys
import types
import warnings
from hashlib import sha256

import numpy as np
import pytest

from rrtik_ompl.cli import terminal
from rrtik_ompl.cli.app import run
from rrtik_ompl.files import notice
from rrtik_ompl.files.cache import cache_folder, one_at_a_time
from rrtik_ompl.kernels import shipped, warm_up, warming
from rrtik_ompl.kernels.simd import bitcode, bitcode_store, code_files, compiled, library

# kernels are compiled anew here, which takes minutes on a busy machine
pytestmark = [pytest.mark.kernels, pytest.mark.timeout(3600)]

KERNELS = "covers.point_kernels"  # few functions, of which every kind of test compiles some
PROGRAM = """
import sys, warnings; warnings.simplefilter("error")
import numpy as np
from rrtik_ompl.files import notice
from rrtik_ompl.kernels.covers import points
notice.listener = lambda message: print("compiling", file=sys.stderr)
rng = np.random.default_rng(1)
cloud, directions = rng.normal(size=(2, 300, 3))
triangles = rng.normal(size=(40, 3, 3))
centres = triangles.mean(axis=1)
radii = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
print(points.extreme_points(cloud, directions).tolist())
print(points.distances_to_nearest(cloud, triangles, centres, radii).round(12).tolist())
kept = points.library(points.KERNELS)
print("numpy" if kept is None else "numba" if "numba" in sys.modules else "kept")
"""


def start(code=PROGRAM, **environment):
    environment = {"NUMBA_CACHE_DIR": os.environ.get("NUMBA_CACHE_DIR", ""), **environment}
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **{k: v for k, v in environment.items() if v}, "RRTIK_CACHE": environment["RRTIK_CACHE"]},
    )


def finished(process):
    out, err = process.communicate(timeout=3000)
    assert process.returncode == 0, err
    corners, distances, backend = out.splitlines()
    return corners + distances, backend, err


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    """A cache folder that was empty when two processes started at once, and how they ended."""
    folder = tmp_path_factory.mktemp("cache")
    processes = [start(RRTIK_CACHE=str(folder)) for _ in range(2)]
    return folder, [finished(process) for process in processes]


@pytest.fixture(scope="module")
def filled(started):
    """The folder that they have filled, and what they answered."""
    folder, ends = started
    return folder, ends[0][0]


@pytest.fixture(scope="module")
def kept():
    """The user's own cache with all kernels in it."""
    assert warm_up(lambda _: None)
    return cache_folder("kernels")


@pytest.fixture
def cached(filled, tmp_path, monkeypatch):
    """A copy of that folder as this process's cache: the file of the kernels."""
    shutil.copytree(filled[0], tmp_path, dirs_exist_ok=True)
    monkeypatch.setenv("RRTIK_CACHE", str(tmp_path))
    monkeypatch.setattr(library, "_libraries", {})
    (file,) = (tmp_path / "kernels").glob("*.code")
    return file


@pytest.mark.slow
def test_what_one_process_compiled_the_next_loads_without_numba(filled):
    assert finished(start(RRTIK_CACHE=str(filled[0]))) == (filled[1], "kept", "")


def test_kernels_that_are_there_need_no_numba_at_all(filled):
    process = start("import sys; sys.modules['numba'] = None\n" + PROGRAM, RRTIK_CACHE=str(filled[0]))
    answers, _, said = finished(process)
    assert (answers, said) == (filled[1], "")


def test_plain_numpy_answers_the_same(filled):
    plain = PROGRAM.replace("notice.listener", "points.library = lambda name: None; notice.listener")
    assert finished(start(plain, RRTIK_CACHE=str(filled[0]))) == (filled[1], "numpy", "")


@pytest.mark.slow
def test_both_widths_answer_the_same(filled, tmp_path):
    other = "8" if compiled.WIDTH == 16 else "16"
    quickly = {"NUMBA_OPT": "1"}  # the machine code is optimised all the same
    answers, _, said = finished(start(RRTIK_CACHE=str(tmp_path), RRTIK_LANES=other, **quickly))
    assert (answers, said) == (filled[1], "compiling\n")


@pytest.mark.slow
def test_of_processes_that_start_at_once_one_compiles_and_the_others_wait(started):
    folder, ends = started
    assert ends[0][0] == ends[1][0]
    assert sorted((backend, said) for _, backend, said in ends) == [("kept", ""), ("numba", "compiling\n")]
    assert len([*(folder / "kernels").glob("*.code")]) == 1


@pytest.mark.parametrize("folder", ["", "file/below"])
def test_without_a_folder_kernels_live_in_memory(filled, tmp_path, folder):
    (tmp_path / "file").write_text("not a folder")
    answers, backend, _ = finished(start(RRTIK_CACHE=folder and str(tmp_path / folder)))
    assert (answers, backend) == (filled[1], "numba")


def checked(body):
    return sha256(body).digest() + body


def described(data):
    """What a file says of itself: its key, its functions."""
    return data[32:].partition(b"\n")[0]


def swapped(data, place):
    return data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]


DAMAGES = {
    "empty": lambda data: b"",
    "short": lambda data: data[:-100],
    "nonsense": lambda data: b"nonsense" * 100,
    "one bit of the checksum": lambda data: swapped(data, 3),
    "one bit of the description": lambda data: swapped(data, 40),
    "one bit of the code": lambda data: swapped(data, len(data) // 2),
    "another's": lambda data: checked(data[32:].replace(b"lanes", b"lines", 1)),
    "no machine code": lambda data: checked(data[32:].partition(b"\n")[0] + b"\n" + b"nonsense" * 100),
    "other functions": lambda data: checked(data[32:].replace(b'"inside"', b'"insidx"', 1)),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_file_is_made_anew(cached, damage, capfd, monkeypatch):
    monkeypatch.setattr(notice, "listener", lambda message: None)  # a command line may have set its own
    whole = cached.read_bytes()
    cached.write_bytes(damage(whole))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert library.library(KERNELS) is not None
    assert described(cached.read_bytes()) == described(whole)  # the code may differ by what else is in the process
    assert library._kept(KERNELS) is not None
    assert capfd.readouterr() == ("", "")


def test_a_folder_in_the_files_place_is_no_trouble(cached):
    cached.unlink()
    cached.mkdir()
    assert library.library(KERNELS) is not None
    assert [*cached.parent.glob("*.code")] == [cached]


def test_a_library_is_loaded_once(cached):
    assert library.library(KERNELS) is library.library(KERNELS)


NO_POINTS = np.zeros(3)


def test_functions_take_whole_numbers_only(cached):
    kernels = library.library(KERNELS)
    at = NO_POINTS.ctypes.data
    assert kernels.inside(at, 0, at, False, at, at) == 0
    with pytest.raises(Exception, match="argument 3"):
        kernels.inside(at, 0, 0.5, 0, at, at)
    with pytest.raises(TypeError):
        kernels.inside(0, 0)


def test_every_entry_of_every_module_is_in_its_library():
    for name in code_files.kernel_modules():
        entries = compiled.entries(bitcode.import_module(f"rrtik_ompl.kernels.{name}").__name__)
        assert set(entries) == set(vars(library.library(name)))
        assert entries


def test_what_an_inlined_function_calls_is_not_inlined_for_that():
    called = compiled.kernel(lambda number: number + 1)
    between = compiled.inlined(lambda number: called(number))
    compiled.kernel(lambda number: between(number))(1)
    assert "alwaysinline" in between.inspect_llvm(between.signatures[0])
    assert "alwaysinline" not in called.inspect_llvm(called.signatures[0])


def test_bitcode_of_another_kind_of_processor_is_not_taken():
    foreign = b'target triple = "riscv64-unknown-elf"\n'
    module = bitcode.llvm.parse_assembly(foreign.decode())
    assert library.machine_code(code_files.Code({}, module.as_bitcode())) is None
    assert library.machine_code(code_files.Code({}, b"nonsense")) is None


def test_a_process_that_is_killed_gives_its_lock_back(tmp_path):
    file = tmp_path / "kernels" / "a.code"
    held = "import pathlib, time; from rrtik_ompl.files.cache import one_at_a_time\n"
    held += f"with one_at_a_time(pathlib.Path({str(file)!r})):\n    print(flush=True); time.sleep(1000)"
    with subprocess.Popen([sys.executable, "-c", held], stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        with file.with_suffix(".lock").open() as lock, pytest.raises(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        process.kill()
    with one_at_a_time(file):
        pass


def test_a_kernel_that_needs_python_is_refused(monkeypatch):
    def allocating(count):
        return np.zeros(count).size

    name = "rrtik_ompl.kernels.allocating"
    monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setattr(compiled, "_entries", {})
    allocating.__module__ = name
    compiled.entry(allocating)
    with pytest.raises(RuntimeError, match=r"allocating.*NRT"):
        bitcode.compiled_module("allocating")


def test_a_compiler_that_fails_is_told_once_and_replaced_by_numpy(cached, monkeypatch):
    def fail(name):
        raise ValueError(f"no {name}")

    shutil.rmtree(cached.parent)
    monkeypatch.setattr(bitcode, "compiled_module", fail)
    monkeypatch.setattr(library, "_said", set())
    with pytest.warns(RuntimeWarning, match="plain numpy, many times slower: ValueError: no [\\w.]*kernels"):
        assert not warm_up(print, jobs=1)
    assert library.library(KERNELS) is None


@pytest.mark.slow
def test_warming_up_makes_all_kernels(kept, cached, capsys):
    before = cached.read_bytes()
    shutil.copytree(kept, cached.parent, dirs_exist_ok=True)
    cached.unlink()
    assert run(["warmup"]) == 0
    ready = [*(f"{name}: ready" for name in code_files.kernel_modules()), "pages that plan: ready"]
    assert capsys.readouterr().out.splitlines() == ready
    assert described(cached.read_bytes()) == described(before)
    assert library._kept(KERNELS) is not None


@pytest.mark.slow
def test_several_kernels_are_made_by_other_processes(kept, cached, monkeypatch):
    shutil.copytree(kept, cached.parent, dirs_exist_ok=True)
    names = ["checks.distance_kernels", "ik.ik_kernels", "timing.kernels"]
    before = {name: library.code_file(name).read_bytes() for name in names}
    for name in names:
        library.code_file(name).unlink()
    monkeypatch.setattr(library, "_made", None)  # this process makes none
    made = []
    monkeypatch.setattr(warming, "_Maker", lambda make=warming._Maker: made.append(make()) or made[-1])
    said = []
    assert warm_up(said.append, jobs=2)
    assert len(made) <= 2  # a process goes on with what it has compiled
    assert said == [f"{name}: ready" for name in code_files.kernel_modules()]
    for name in names:
        assert described(library.code_file(name).read_bytes()) == described(before[name])


def test_what_a_process_does_not_live_to_make_is_made_here(kept, cached, monkeypatch):
    shutil.copytree(kept, cached.parent, dirs_exist_ok=True)
    files = [library.code_file(name) for name in ("ik.ik_kernels", "timing.kernels")]
    for file in files:
        file.unlink()
    monkeypatch.setattr(warming, "MAKE", "input()")
    assert warm_up(lambda _: None, jobs=2)
    assert all(file.is_file() for file in files)


def test_compiling_is_told_in_one_line(monkeypatch, capsys):
    monkeypatch.setattr(notice, "listener", terminal.note)
    monkeypatch.setattr(notice, "_told", set())
    notice.tell_once(notice.COMPILING)
    notice.tell_once(notice.COMPILING)
    assert capsys.readouterr().err == f"rrtik: {notice.COMPILING}\n"


def test_the_sources_of_kernels_need_no_collision_library():
    code = "import sys; sys.modules.update(dict.fromkeys(('coal', 'pinocchio', 'ompl', 'scipy')))\n"
    code += f"import rrtik_ompl.kernels.simd.bitcode; names = {code_files.kernel_modules()}\n"
    code += "for name in names:\n    __import__('rrtik_ompl.kernels.' + name)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A folder with bitcode as a package brings it."""
    folder = tmp_path_factory.mktemp("package")
    shipped.write_bitcode(folder, [KERNELS])
    return folder


@pytest.fixture
def packaged(written, cached, tmp_path, monkeypatch):
    """The file of bitcode that the package brings, an empty cache and no compiler."""

    def fail(name):
        raise ValueError(f"{name} is compiled")

    folder = shutil.copytree(written, tmp_path / "package")
    shutil.rmtree(cached.parent)
    monkeypatch.setattr(bitcode_store, "FOLDER", folder)
    monkeypatch.setattr(bitcode, "compiled_module", fail)
    monkeypatch.setattr(library, "_said", set())
    return folder / code_files.bitcode_name(KERNELS)


def test_bitcode_of_the_package_saves_compiling(packaged, cached):
    at = NO_POINTS.ctypes.data
    assert library.library(KERNELS).inside(at, 0, at, 0, at, at) == 0
    assert cached.is_file()


@pytest.mark.parametrize("damage", ["short", "one bit of the code", "another's", "no machine code"])
def test_damaged_bitcode_of_the_package_is_passed_over(packaged, damage):
    packaged.write_bytes(DAMAGES[damage](packaged.read_bytes()))
    with pytest.warns(RuntimeWarning, match="kernels is compiled"):
        assert library.library(KERNELS) is None


def test_a_damaged_cache_of_numba_is_not_trusted(tmp_path):
    source, folder = tmp_path / "twice.py", tmp_path / "numba"
    source.write_text(
        "from rrtik_ompl.kernels.simd.compiled import kernel\n"
        "@kernel\ndef twice(x):\n    return 2 * x\nprint(twice(21))"
    )
    for _ in range(2):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
        done = subprocess.run([sys.executable, source], capture_output=True, text=True, env=environment, check=False)
        assert (done.stdout, done.stderr) == ("42\n", "")
        files = [file for file in folder.rglob("*") if file.is_file()]
        assert files
        for file in files:
            file.write_bytes(b"nonsense")


KINDS = """
import sys
import numba
from rrtik_ompl.kernels.simd.compiled import kernel
@kernel
def marked(x, mark):
    return x + 1 if mark == 0 else x * mark
@numba.njit
def without(x):
    return marked(x, 0)
@numba.njit
def within(x, mark):
    return marked(x, mark)
calls = {"without": lambda: without(5), "with": lambda: within(5, 7)}
print(*[calls[name]() for name in sys.argv[1:]])
"""


@pytest.mark.slow
def test_code_for_other_kinds_of_arguments_is_not_taken_from_numbas_cache(tmp_path):
    """Two processes that fill it at once can leave each other's code under a name."""
    source, folder = tmp_path / "kinds.py", tmp_path / "numba"
    source.write_text(KINDS)

    def answers(*names):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
        command = [sys.executable, source, *names]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert done.stderr == ""
        return done.stdout.split()

    assert answers("without", "with") == ["6", "35"]
    first, second = sorted(folder.rglob("*marked*.nbc"))
    first_code, second_code = first.read_bytes(), second.read_bytes()
    for order in (["without", "with"], ["with", "without"], ["with"]):
        first.write_bytes(second_code)
        second.write_bytes(first_code)
        assert answers(*order) == [{"without": "6", "with": "35"}[name] for name in order]

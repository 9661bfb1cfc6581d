"""Cached files: only those are used that nobody else could have written, and their folder is made so."""

import os
import stat
import subprocess
import sys

import pytest

from rrtik_ompl.files.cache import FOLDER_VARIABLE, cache_folder, nobody_else_s, write_whole
from rrtik_ompl.kernels.simd import library as libraries
from rrtik_ompl.kernels.simd.code_files import Code, write_code

OTHER_USER = 54321
only_root = pytest.mark.skipif(os.geteuid() != 0, reason="needs to make files of another user")


@pytest.fixture
def file(tmp_path):
    made = tmp_path / "kernels" / "a"
    write_whole(made, lambda stream: stream.write(b"code"))
    return made


def test_what_is_written_is_the_users_own(file):
    assert nobody_else_s(file)
    assert not nobody_else_s(file.with_name("b"))


@pytest.mark.parametrize("mode", [0o020, 0o002, 0o022])
def test_a_file_or_folder_that_others_can_write_to_is_not_used(file, mode):
    for place in (file, file.parent):
        kept = stat.S_IMODE(place.stat().st_mode)
        place.chmod(kept | mode)
        assert not nobody_else_s(file)
        place.chmod(kept)
    assert nobody_else_s(file)


@only_root
def test_what_another_user_owns_is_not_used(file, monkeypatch):
    for place in (file, file.parent):
        os.chown(place, OTHER_USER, -1)
        assert not nobody_else_s(file)
        os.chown(place, 0, -1)
    monkeypatch.setattr(os, "geteuid", lambda: OTHER_USER)
    assert nobody_else_s(file)  # root's


def test_a_folder_above_that_others_can_write_to_is_enough_to_put_another_in_its_place(tmp_path):
    made = tmp_path / "open" / "rrtik-ompl" / "kernels" / "a"
    write_whole(made, lambda stream: stream.write(b"code"))
    above = tmp_path / "open"
    assert nobody_else_s(made)
    for mode in (0o777, 0o775, 0o757):
        above.chmod(mode)
        assert not nobody_else_s(made)
    above.chmod(0o1777)  # as /tmp: what is another's stays where it is
    assert nobody_else_s(made)
    made.parent.chmod(0o1777)  # but anybody may add files to the folder itself
    assert not nobody_else_s(made)


def test_the_folders_of_a_link_and_of_what_it_leads_to_both_count(tmp_path):
    made = tmp_path / "real" / "kernels" / "a"
    write_whole(made, lambda stream: stream.write(b"code"))
    (tmp_path / "links").mkdir()
    (tmp_path / "links" / "cache").symlink_to(tmp_path / "real")
    linked = tmp_path / "links" / "cache" / "kernels" / "a"
    assert nobody_else_s(linked)
    for folder in (tmp_path / "links", tmp_path / "real"):
        folder.chmod(0o777)
        assert not nobody_else_s(linked)
        folder.chmod(0o755)
    assert nobody_else_s(linked)


def test_all_folders_that_a_generous_umask_made_are_closed(tmp_path):
    before = os.umask(0)
    try:
        write_whole(tmp_path / "home" / ".cache" / "rrtik-ompl" / "kernels" / "a", lambda stream: stream.write(b"code"))
    finally:
        os.umask(before)
    assert nobody_else_s(tmp_path / "home" / ".cache" / "rrtik-ompl" / "kernels" / "a")


def test_a_folder_of_a_generous_umask_is_closed_when_it_is_written_to(tmp_path):
    before = os.umask(0)
    try:
        write_whole(tmp_path / "kernels" / "a", lambda stream: stream.write(b"code"))
    finally:
        os.umask(before)
    assert nobody_else_s(tmp_path / "kernels" / "a")


def test_kernels_that_others_could_have_written_are_not_loaded(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    name, seen = "checks.check_kernels", []
    monkeypatch.setattr(libraries, "_addresses", lambda name, code: seen.append(code.code) or {})
    write_code(libraries.code_file(name), libraries.machine_key(name), Code({}, b"code"))
    assert libraries._kept(name) is not None
    libraries.code_file(name).chmod(0o666)
    assert libraries._kept(name) is None
    assert seen == [b"code"]


def test_a_home_that_cannot_be_written_costs_time_and_nothing_else(tmp_path, monkeypatch):
    (tmp_path / "home").write_text("a file where a folder should be, so that root cannot write there either")
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    for home in (tmp_path / "home", tmp_path / "home" / "below"):
        monkeypatch.setenv("HOME", str(home))
        folder = cache_folder("covers")
        assert folder.is_relative_to(home)
        write_whole(folder / "a", lambda stream: stream.write(b"cover"))
        assert not nobody_else_s(folder / "a")
    assert (tmp_path / "home").is_file()


WRITER = """
import sys
from pathlib import Path
from rrtik_ompl.files.cache import write_whole
for _ in range(200):
    write_whole(Path(sys.argv[1]) / "kernels" / "a", lambda stream: stream.write(sys.argv[2].encode() * 10_000))
"""


def test_processes_that_start_cold_at_once_leave_one_whole_file(tmp_path):
    started = [subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path), letter]) for letter in "ab"]
    file, found = tmp_path / "kernels" / "a", set()
    while any(process.poll() is None for process in started):
        if file.exists():
            found.add(file.read_bytes())
    assert [process.returncode for process in started] == [0, 0]
    assert found | {file.read_bytes()} <= {b"a" * 10_000, b"b" * 10_000}
    assert os.listdir(file.parent) == ["a"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_what_is_interrupted_while_it_is_written_leaves_nothing_behind(tmp_path, error):
    def half(stream):
        stream.write(b"half")
        raise error

    with pytest.raises(error):
        write_whole(tmp_path / "cache" / "code.bin", half)
    assert list((tmp_path / "cache").iterdir()) == []

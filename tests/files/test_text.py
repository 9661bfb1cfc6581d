"""Files that are written whole or not at all: whatever their name, their mode, and who else writes them."""

import csv
import os
import resource
import signal
import stat
from concurrent.futures import ThreadPoolExecutor

import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.text import write_bytes, write_text


def test_any_name_that_the_file_system_takes_can_be_written(tmp_path):
    longest = tmp_path / ("n" * 250 + ".json")
    rrtik.JointPath([[0.0], [1.0]]).save(longest)
    assert len(rrtik.JointPath.load(longest).waypoints) == 2
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / ("n" * 300), "text")
    assert os.listdir(tmp_path) == [longest.name]


def test_threads_that_write_one_file_leave_one_of_their_texts(tmp_path):
    file, texts = tmp_path / "a.txt", [str(k) * 10_000 for k in range(8)]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(20):
            list(pool.map(lambda text: write_text(file, text), texts))
            assert file.read_text() in texts
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_file_keeps_its_mode_and_a_protected_one_its_text(tmp_path):
    file = tmp_path / "a.txt"
    write_bytes(file, b"old")
    file.chmod(0o640)
    write_bytes(file, b"new")
    assert (file.read_bytes(), stat.S_IMODE(file.stat().st_mode)) == (b"new", 0o640)
    file.chmod(0o400)
    with pytest.raises(InputError, match="write-protected"):
        write_bytes(file, b"newer")
    assert (file.read_bytes(), stat.S_IMODE(file.stat().st_mode)) == (b"new", 0o400)


def test_a_new_file_has_the_mode_of_any_other(tmp_path):
    (tmp_path / "other").touch()
    write_bytes(tmp_path / "a.txt", b"")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "other").stat().st_mode


def full_disk(size):
    """Files grow no larger than that from now on."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


@pytest.mark.parametrize("named", [False, True])
def test_a_full_disk_leaves_the_old_file_and_no_other(tmp_path, monkeypatch, named):
    if named:  # where the system has no files without a name
        monkeypatch.delattr(os, "O_PATH", raising=False)
    write_text(tmp_path / "a.json", "old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        full_disk(1000)
        with pytest.raises(InputError, match=r"a\.json.*File too large"):
            write_text(tmp_path / "a.json", "n" * 2000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (os.listdir(tmp_path), (tmp_path / "a.json").read_text()) == (["a.json"], "old")


@pytest.mark.skipif(not hasattr(os, "O_TMPFILE"), reason="Linux alone has files without a name")
def test_a_kill_in_the_middle_leaves_nothing(tmp_path):
    write_text(tmp_path / "a.json", "old")
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)  # ends the process at once, in the middle of the file
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        full_disk(100_000)
        write_text(tmp_path / "a.json", "n" * 200_000)
        os._exit(0)
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGXFSZ
    assert (os.listdir(tmp_path), (tmp_path / "a.json").read_text()) == (["a.json"], "old")


def test_half_a_letter_is_named(tmp_path):
    with pytest.raises(InputError, match=r"\\ud800"):
        write_text(tmp_path / "a.txt", "a\ud800")
    assert os.listdir(tmp_path) == []


def test_a_table_with_a_name_that_no_reader_takes_is_refused(tmp_path):
    longer = csv.field_size_limit() + 1
    (tmp_path / "a.csv").write_text(f"{'j' * longer},b\n0,0\n")
    with pytest.raises(InputError, match=r"a\.csv: line 1"):
        rrtik.JointPath.load(tmp_path / "a.csv")

"""The record of a session where the disk is full, and where there is one already."""

import resource
from contextlib import contextmanager

import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.record import Record, read_record
from rrtik_tests.pilot_session import alarmed, session


@contextmanager
def room_for(size):
    """Files grow no larger meanwhile."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_where_the_disk_is_full_the_session_goes_on_and_says_so_once(tmp_path):
    record = Record(tmp_path / "a.jsonl")
    made, _ = session(record)
    before = (tmp_path / "a.jsonl").read_bytes()
    with room_for(len(before) + 150):
        for step in range(20):
            made.command("select", 0.1 * step, joint=step % 6)
        assert "selected" in made.message
        made.tick(3.0)
        assert alarmed(made, "a.jsonl", "File too large")
        made.command("select", 3.1, joint=2)
        made.tick(3.2)
        assert "selected" in made.message
    made.command("select", 3.3, joint=1)  # room again: the record has ended all the same, for lines are missing
    kept = (tmp_path / "a.jsonl").read_bytes()
    assert kept.startswith(before)
    assert kept.endswith(b"}\n")
    assert len(before) < len(kept) <= len(before) + 150
    assert list(read_record(tmp_path / "a.jsonl"))


def test_a_record_is_not_written_over(tmp_path):
    file = tmp_path / "a.jsonl"
    file.write_text('{"time": 0, "kind": "begin"}\n')
    with pytest.raises(InputError, match=r"a\.jsonl: .*another name"):
        Record(file)
    assert file.read_text() == '{"time": 0, "kind": "begin"}\n'
    file.write_text("")
    Record(file).close()

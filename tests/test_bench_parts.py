"""Measurements in parts go on where they were interrupted."""

import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parent.parent / "bench"


def test_parts_that_are_done_are_not_done_again(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [str(BENCH), *sys.path])
    from parts import in_parts

    kept, asked = tmp_path / "page.parts.jsonl", []

    def work(name, number):
        asked.append(number)
        if len(asked) in (3, 5):
            raise KeyboardInterrupt
        return {"square": number**2}

    parts = [("a", k) for k in range(4)]
    with pytest.raises(KeyboardInterrupt):
        in_parts(work, parts, jobs=1, kept=kept)
    kept.write_text(kept.read_text() + '["a 2", {"squ')  # as if cut off in the middle of a line
    with pytest.raises(KeyboardInterrupt):
        in_parts(work, parts, jobs=1, kept=kept)
    assert [found["square"] for found in in_parts(work, parts, jobs=1, kept=kept)] == [0, 1, 4, 9]
    assert asked == [0, 1, 2, 2, 3, 3]
    assert not kept.exists()

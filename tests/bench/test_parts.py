"""Measurements in parts go on where they were interrupted."""

from dataclasses import dataclass

import numpy as np
import pytest

from bench.shared import parts


@dataclass
class Square:
    """Of a number; infinite of 3."""

    area: float
    sides: tuple[str, ...] = ()


def cube(number: int) -> int:
    return number**3


def test_parts_that_are_done_are_not_done_again(tmp_path):
    page, kept, asked = tmp_path / "page.md", tmp_path / "page.parts.jsonl", []

    def work(name: str, number: int) -> Square:
        asked.append(number)
        if len(asked) in (3, 5):
            raise KeyboardInterrupt
        return Square(np.inf if number == 3 else float(number**2), (name,))

    def measured():
        with parts.Parts(page, jobs=1) as measure:
            return measure(work, [("a", k) for k in range(4)]), measure(cube, [(2,)])

    with pytest.raises(KeyboardInterrupt):
        measured()
    kept.write_text(kept.read_text() + '["work a 2", {"ar')  # as if cut off in the middle of a line
    with pytest.raises(KeyboardInterrupt):
        measured()
    assert measured() == ([Square(0.0, ("a",)), Square(1.0, ("a",)), Square(4.0, ("a",)), Square(np.inf, ("a",))], [8])
    assert asked == [0, 1, 2, 2, 3, 3]
    assert not kept.exists()


def test_several_processes_give_results_in_order_and_an_error_keeps_what_is_done(tmp_path):
    page, kept = tmp_path / "page.md", tmp_path / "page.parts.jsonl"
    numbers = [(k,) for k in range(4)]
    with parts.Parts(page, jobs=2) as measure:
        assert measure(cube, numbers) == [0, 1, 8, 27]
        with pytest.raises(TypeError):
            measure(cube, [("word",)])
        assert len(kept.read_text().splitlines()) == 4


def test_an_error_before_anything_is_done_leaves_no_file(tmp_path):
    with pytest.raises(TypeError), parts.Parts(tmp_path / "page.md", jobs=1) as measure:
        measure(cube, [("word",)])
    assert list(tmp_path.iterdir()) == []


def test_a_part_that_another_version_has_kept_is_measured_again(tmp_path, capsys):
    page, kept = tmp_path / "page.md", tmp_path / "page.parts.jsonl"
    kept.write_text('["cube 2", {"was": "a record"}]\n')
    with parts.Parts(page, jobs=1) as measure:
        assert measure(cube, [(2,)]) == [8]
    assert "cube 2: kept by another version, measured again" in capsys.readouterr().err

"""The motion that a page plays: how long each move lasts, and how it is told."""

from __future__ import annotations

import numpy as np
import pytest

from rrtik_ompl.model.robot import Robot
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.story import grid_cell, play_times
from rrtik_ompl.viewer.subject import subject_of
from rrtik_tests.crane import WAYPOINTS, story


def test_a_move_lasts_in_proportion_to_the_travel_of_its_joint(crane: Robot) -> None:
    times = play_times(crane, np.array([[0.0, 0.2, 0.0], [1.0, 0.2, 0.0], [1.0, 0.2, 2.0], [1.0, 0.2, 2.0]]), 2.0)
    first, second, still = np.diff(times)
    assert second == pytest.approx(2.0 * first)
    assert still == 0.0


def test_each_move_names_the_joints_that_move(text: str) -> None:
    assert [move["joints"] for move in story(text)["moves"]] == [[0], [1], [2], [0]]


@pytest.mark.parametrize(("size", "cell"), [(1.0, 0.05), (3.2, 0.2), (31.0, 2.0), (0.02, 0.001)])
def test_grid_cells_are_round_numbers(size: float, cell: float) -> None:
    assert grid_cell(size) == pytest.approx(cell)


def test_a_long_path_is_drawn_in_a_bounded_number_of_pieces(crane: Robot) -> None:
    way = np.linspace(WAYPOINTS[0], WAYPOINTS[-1], 2000)
    window, _ = draw(subject_of(crane, way))
    assert 100 <= sum("/trail/" in path for path in window.paths) <= 150
    assert not any("/beads/" in path for path in window.paths)

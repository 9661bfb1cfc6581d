"""RRT-Connect joins two configurations, in Python and in kernels."""

from __future__ import annotations

import numpy as np
import pytest

from rrtik_ompl.base.budget import no_stop
from rrtik_ompl.replanning.connecting import KernelConnect, PythonConnect, TreeOptions
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_tests.moving_plane import HIGH, LOW, box, plane


@pytest.mark.parametrize("kind", ["plain", "kernel"])
def test_both_searches_join_two_pieces_of_a_path(kind):
    world = MovingWorld(plane(box("wall", 10.0, 10.0, 2.0, 12.0)).world)
    options = TreeOptions(LOW, HIGH, 1.0, 5)
    connect = PythonConnect(options) if kind == "plain" else KernelConnect(world, options)
    first = np.array([[1.0, 10.0], [4.0, 10.0], [8.0, 10.0]])
    second = np.array([[12.0, 10.0], [15.0, 10.0], [19.0, 10.0]])
    found = connect(first, second, world, no_stop)
    assert (found.path[0] == first[0]).all()
    assert (found.path[-1] == second[-1]).all()
    assert world.motion_valid_batch(found.path[:-1], found.path[1:]).all()
    assert any((found.path[found.begin] == row).all() for row in first)
    assert any((found.path[found.end] == row).all() for row in second)

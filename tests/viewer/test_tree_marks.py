"""MB-RRT's tree in the 3-D page."""

import numpy as np
import pytest

from bench.shared.mb_rrt_tree import tree_marks


def test_every_index_of_a_tree_has_its_links_and_its_ball_and_the_answer_ends_at_the_goal(tree):
    marks = {mark.name: mark for mark in tree_marks(tree)}
    for index in range(1, 5):
        tube = marks[f"links of index {index}"]
        ends = tree.nodes[index]
        near = np.linalg.norm(tube.vertices[:, None, : ends.shape[1]] - ends[None], axis=2).min(axis=0)
        assert near.max() < 0.002  # every node lies on a tube
    assert "links of index 5" not in marks
    ball = marks["where joint 2 can be"].vertices
    centre = np.pad(tree.goal, (0, 3 - len(tree.goal)))
    np.testing.assert_allclose(np.linalg.norm(ball - centre, axis=1), 0.3, rtol=1e-9)
    assert np.linalg.norm(marks["answer"].vertices - centre, axis=1).min() < 0.006


def test_units_scale_the_whole_tree(tree):
    one, hundredth = tree_marks(tree), tree_marks(tree, unit=0.01)
    for a, b in zip(one, hundredth, strict=True):
        assert np.ptp(b.vertices, axis=0).max() == pytest.approx(0.01 * np.ptp(a.vertices, axis=0).max(), rel=1e-9)

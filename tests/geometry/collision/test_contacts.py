"""What is said of two bodies that touch, or nearly do."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.solids import bvh
from rrtik_ompl.model.judgement import Contact

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, -1.0]])
BOWL = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])  # without a lid: a surface


def bowls(gap):
    """Two bowls, the second one upside down over the first."""
    over = pin.SE3(pin.exp3(np.array([np.pi, 0.0, 0.0])), np.array([0.0, 0.0, gap]))
    places = (pin.SE3.Identity(), over)
    return [Body(name, 0, T, bvh(SQUARE, BOWL), "link") for name, T in zip("ab", places, strict=True)]


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_meshes_that_do_not_touch_have_no_depth(gap):
    (contact,) = measured(bowls(gap), [(0, 1)], np.eye(4)[None], near_only=False)
    assert contact.distance == pytest.approx(gap, abs=1e-12)
    for near in measured(bowls(gap), [(0, 1)], np.eye(4)[None], near_only=True):
        assert near.distance == 0.0


def test_an_overlap_of_nothing_is_not_negative():
    assert str(Contact("a", "b", 0.0, np.zeros(3), np.zeros(3))) == "'a' and 'b' touch"
    assert str(Contact("a", "b", -9e-7, np.zeros(3), np.zeros(3))) == "'a' and 'b' touch"
    assert str(Contact("a", "b", -2e-6, np.zeros(3), np.zeros(3))).endswith("overlap by 0.002 mm")
    assert str(Contact("a", "b", -1e-3, np.zeros(3), np.zeros(3))) == "'a' and 'b' overlap by 1 mm"

"""Joint values are kept in radians and shown in degrees; those of joints that slide in metres."""

import numpy as np
import pytest

from rrtik_ompl.base.units import joint_unit, joint_units, reading, shown_unit


def test_units_follow_the_kind_of_joint():
    assert joint_units(np.array([False, True])) == [joint_unit(False), joint_unit(True)] == ["rad", "m"]
    assert [shown_unit(slides)[1] for slides in (False, True)] == ["deg", "m"]


def test_a_reading_is_the_value_times_the_factor_of_its_unit():
    for slides in (False, True):
        factor, unit = shown_unit(slides)
        assert reading(0.7, joint_unit(slides)) == (pytest.approx(0.7 * factor), unit)

"""Joint values are kept in radians and shown in degrees; those of joints that slide in metres."""

import numpy as np
import pytest

from rrtik_ompl.base.units import closest_configuration, how_far, joint_unit, joint_units, reading, shown_unit


def test_units_follow_the_kind_of_joint():
    assert joint_units(np.array([False, True])) == [joint_unit(False), joint_unit(True)] == ["rad", "m"]
    assert [shown_unit(slides)[1] for slides in (False, True)] == ["deg", "m"]


def test_a_reading_is_the_value_times_the_factor_of_its_unit():
    for slides in (False, True):
        factor, unit = shown_unit(slides)
        assert reading(0.7, joint_unit(slides)) == (pytest.approx(0.7 * factor), unit)


@pytest.mark.parametrize(
    ("distance", "angle", "told"),
    [
        (1.0625, 0.0, "1.06 m"),
        (0.0032, 0.0, "3.2 mm"),
        (1.06, np.radians(12.0), "1.06 m and 12 degrees"),
        (0.0, np.radians(12.0), "12 degrees"),
        (0.0, 0.0, "0 mm"),
        (2.0, 1e-6, "2 m"),
    ],
)
def test_how_far_a_pose_is_away_is_told_in_units_that_fit(distance, angle, told):
    assert how_far(distance, angle) == told
    assert closest_configuration(distance, angle) == f"the closest configuration is {told} away"

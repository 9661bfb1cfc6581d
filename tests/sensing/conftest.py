"""A photograph of a stand and a valve, as a synthetic camera would take it."""

import cv2
import numpy as np
import pytest

from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_tests.marker_files import CAMERA
from rrtik_tests.marker_views import facing


@pytest.fixture(scope="module")
def taken():
    """A picture of the stand and the valve, and T_stand_valve."""
    stand, valve = facing([0.4, -0.3, 0.0], [-0.1, 0.05, 0.8]), facing([0.4, 0.2, 0.1], [0.1, -0.05, 1.0])
    prints = [(T, marker_print(marker_cells("4x4_50", n), 0.08)) for n, T in ((3, stand), (7, valve))]
    gray = photograph(clean_picture(CAMERA, prints, rays=5), np.random.default_rng(0))
    return cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR), stand.inverse() * valve

"""The precision tables of [1, ch. 4]: their arithmetic, and what a simulated camera predicts."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_bench.report.rows import Bar, Row, about, judged, within
from rrtik_bench.sensing.precision import NORMAL_QUARTILES
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix, Vector

SOURCE = "[1, ch. 4]"
COUNT = 100  # observations of a series
CAMERA = np.array([[877.6915, 0.2272, 320.6451], [0.0, 869.8953, 242.8119], [0.0, 0.0, 1.0]])  # [px]
MARKER = 80.0  # [mm]
NOISE = 0.03  # [px] of each corner coordinate
STEP = 1e-6  # of the differences
# Marker before the camera: mean x, y, z and standard deviation of z, per series [mm]
SERIES = (
    (1.0280, 0.7641, 505.7898, 0.0671),
    (1.0885, 3.8133, 996.4844, 0.3676),
    (3.3554, 14.3850, 1296.7787, 0.5402),
    (8.9229, 18.9287, 1536.6946, 0.7901),
    (114.1568, 26.7594, 1727.4685, 1.8604),
    (58.5330, 3.8215, 2035.0656, 2.1142),
)
FAR = 1600.0  # [mm]; beyond, detection itself becomes worse, which the simulated camera does not know
# Virtual gripper: distance to the marker, largest, smallest, printed standard deviation, quartiles [mm]
GRIPPER = (
    (500, 1963.3162, 1962.3938, 0.5261, 1962.7860, 1963.1051),
    (1000, 2134.1887, 2131.7919, 1.2301, 2132.3903, 2133.0369),
    (1500, 2407.2225, 2398.0351, 5.3397, 2400.3763, 2404.6499),
    (2000, 2791.8982, 2777.4443, 5.5185, 2782.7907, 2787.0907),
)
# Two markers 300 mm apart: distance to the camera, mean and standard deviation of what was measured [mm], error [%]
ACCURACY = (
    (600, 299.1255, 0.0432, -0.2915),
    (1000, 300.3340, 0.0814, 0.1113),
    (1500, 300.8539, 0.1088, 0.2846),
    (2000, 302.9160, 0.1712, 0.9720),
)


def arithmetic(quick: bool) -> list[Row]:
    """Figures that follow from others in the tables."""
    del quick
    rows = []
    for number, printed, spread in ((1, 0.0067, SERIES[0][3]), (6, 0.2114, SERIES[5][3])):
        ours = spread / np.sqrt(COUNT)
        rows.append(judged(f"test 1, series {number}: precision of the mean", f"{printed} mm", f"{ours:.4f} mm", ours,
                           Bar((0.0, 10.0), held=about(printed, 1e-4))))  # fmt: skip
    for distance, most, least, printed, first, third in GRIPPER:
        largest = 0.5 * (most - least) * np.sqrt(COUNT / (COUNT - 1))
        likely = (third - first) / NORMAL_QUARTILES
        excess = printed / largest
        rows.append(
            judged(f"test 2, {distance} mm: standard deviation", f"{printed} mm",
                   f"at most {largest:.3f} mm with that range; by the quartiles {likely:.2f} mm", excess,
                   Bar((0.0, 10.0), held=(0.0, 1.0), refuted=(1.0, 10.0)),
                   f"printed {100.0 * (excess - 1.0):.0f} % above what that range allows; use the quartiles"
                   if excess > 1.0 else "")
        )  # fmt: skip
    for distance, mean, _, printed in ACCURACY:
        ours = (mean - 300.0) / 3.0
        rows.append(judged(f"accuracy, x = 300 mm at {distance} mm: error", f"{printed} %", f"{ours:.4f} %", ours,
                           Bar((-100.0, 100.0), held=about(printed, 2e-3))))  # fmt: skip
    return rows


def simulated(quick: bool) -> list[Row]:
    """The standard deviation of z that a camera with noise of 0.03 px at the corners has."""
    del quick
    rows = []
    for number, (x, y, z, printed) in enumerate(SERIES, start=1):
        ours = _spread_of_z(np.array([x, y, z]))
        rows.append(
            judged(f"series {number}, z = {z:.0f} mm: standard deviation of z", f"{printed} mm", f"{ours:.3f} mm", ours,
                   Bar((0.0, 100.0), held=within(1.5, printed), differs=within(2.0, printed) if z > FAR else None),
                   "propagated to first order, marker parallel to the picture")
        )  # fmt: skip
    return rows


def _spread_of_z(place: Vector) -> float:
    """By the Gauss-Newton covariance of a pose from its four corners [mm]."""
    here = np.concatenate([np.zeros(3), place])
    moves = STEP * np.diag([1.0, 1.0, 1.0, *np.full(3, place[2])])
    columns = [(_corners(here + move) - _corners(here - move)) / (2.0 * move.max()) for move in moves]
    jacobian = np.stack([column.ravel() for column in columns], axis=1)
    covariance = NOISE**2 * np.linalg.inv(jacobian.T @ jacobian)
    return float(np.sqrt(covariance[5, 5]))


def _corners(pose: Vector) -> Matrix:
    """Pixels of the four corners for a rotation vector and a position [mm], shape (4, 2)."""
    square = 0.5 * MARKER * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    seen = (square @ pin.exp3(pose[:3]).T + pose[3:]) @ CAMERA.T
    pixels: Matrix = seen[:, :2] / seen[:, 2:]
    return pixels


TABLES = (
    Table("sensing-arithmetic", "Precision and accuracy: what follows", SOURCE, arithmetic, 1, 1),
    Table("sensing-noise", "Precision against distance, simulated", SOURCE, simulated, 1, 1,
          fitted=f"the noise of a corner, {NOISE} px"),
)  # fmt: skip

"""The precision tables of [1, ch. 4]: their arithmetic, and what a simulated camera predicts."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_bench.report.rows import INFINITE, Bar, Row, about, judged, within
from rrtik_bench.sensing.precision import NORMAL_QUARTILES, Series
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix, Vector

SOURCE = "[1, ch. 4]"
COUNT = 100  # observations of a series
SAMPLES = 20_000  # normal ones, which tell what is rare
CAMERA = np.array([[877.6915, 0.2272, 320.6451], [0.0, 869.8953, 242.8119], [0.0, 0.0, 1.0]])  # [px]
MARKER = 80.0  # [mm]
NOISE = 0.03  # [px] of each corner coordinate
STEP = 1e-6  # of the differences
FAR = 1600.0  # [mm]; beyond, detection itself becomes worse, which the simulated camera does not know
# Table 4.1, coordinates x, y and z of each series: largest, smallest, mean, standard deviation [mm]
COORDINATES = (
    ((1.0442, 1.0038, 1.0280, 0.0071), (0.7767, 0.7487, 0.7641, 0.0065), (505.9640, 505.6400, 505.7898, 0.0671)),
    ((1.1374, 1.0531, 1.0885, 0.0160), (3.8323, 3.7894, 3.8133, 0.0113), (997.2500, 995.7280, 996.4844, 0.3676)),
    ((3.3963, 3.3017, 3.3554, 0.0201), (14.4725, 14.3246, 14.3850, 0.0252), (1298.9100, 1295.5000, 1296.7787, 0.5402)),
    ((9.0354, 8.8338, 8.9229, 0.0377), (18.9694, 18.8956, 18.9287, 0.0133), (1539.0600, 1534.8000, 1536.6946, 0.7901)),
    (
        (114.5460, 113.9340, 114.1568, 0.1240),
        (26.8476, 26.6144, 26.7594, 0.0486),
        (1733.2800, 1724.1400, 1727.4685, 1.8604),
    ),
    ((58.6802, 58.3940, 58.5330, 0.0497), (4.0331, 3.5828, 3.8215, 0.0775), (2041.1300, 2029.8200, 2035.0656, 2.1142)),
)
# Table 4.2, z of each series: quartiles with the median between them [mm]
QUARTILES = (
    (505.7473, 505.7885, 505.8320),
    (996.1815, 996.4480, 996.7228),
    (1296.5000, 1296.6100, 1297.0500),
    (1535.9500, 1536.9250, 1536.9825),
    (1725.9425, 1727.2550, 1728.5025),
    (2033.8500, 2035.1500, 2035.9125),
)
# Table 4.3, virtual gripper by its distance to the marker [mm]
GRIPPER = {
    500: Series(COUNT, 1963.3162, 1962.3938, 1962.9328, 0.5261, (1962.7860, 1962.9616, 1963.1051)),
    1000: Series(COUNT, 2134.1887, 2131.7919, 2132.7625, 1.2301, (2132.3903, 2132.7536, 2133.0369)),
    1500: Series(COUNT, 2407.2225, 2398.0351, 2402.7820, 5.3397, (2400.3763, 2403.4463, 2404.6499)),
    2000: Series(COUNT, 2791.8982, 2777.4443, 2784.6694, 5.5185, (2782.7907, 2784.4271, 2787.0907)),
}
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
    for number, printed, spread in ((1, 0.0067, COORDINATES[0][2][3]), (6, 0.2114, COORDINATES[5][2][3])):
        ours = spread / np.sqrt(COUNT)
        rows.append(judged(f"test 1, series {number}: precision of the mean", f"{printed} mm", f"{ours:.4f} mm", ours,
                           Bar((0.0, 10.0), held=about(printed, 1e-4))))  # fmt: skip
    rows += deviations()
    for distance, mean, _, printed in ACCURACY:
        ours = (mean - 300.0) / 3.0
        rows.append(judged(f"accuracy, x = 300 mm at {distance} mm: error", f"{printed} %", f"{ours:.4f} %", ours,
                           Bar((-100.0, 100.0), held=about(printed, 2e-3))))  # fmt: skip
    return rows


def deviations() -> list[Row]:
    """Whether printed standard deviations are possible with what is printed beside them."""
    columns = [Series(COUNT, *column) for series in COORDINATES for column in series[:2]]
    columns += [Series(COUNT, *series[2], quartiles) for series, quartiles in zip(COORDINATES, QUARTILES, strict=True)]
    possible = sum(each.possible for each in columns)
    rows = [
        judged("test 1, x, y and z of six series: standard deviations", "18 of them",
               f"{possible} of {len(columns)} are possible with their range, mean and quartiles", possible,
               Bar((0.0, 18.0), held=(18.0, 18.0), refuted=(0.0, 17.0)))
    ]  # fmt: skip
    for distance, series in GRIPPER.items():
        printed, largest = series.deviation, series.possible_deviations
        bounds = ", ".join(f"{bound:.3f} by its {known}" for known, bound in largest.items())
        excess = printed / series.largest_possible_deviation
        rows.append(
            judged(f"test 2, {distance} mm: standard deviation", f"{printed} mm",
                   f"at most [mm] {bounds}; normal by the quartiles {series.robust_deviation:.2f}", excess,
                   Bar((0.0, 10.0), held=(0.0, 1.0), refuted=(1.0, 10.0)),
                   f"printed {100.0 * (excess - 1.0):.0f} % above what any sample can have; use the quartiles")
        )  # fmt: skip
    return rows


def simulated(quick: bool) -> list[Row]:
    """The standard deviations that a camera with noise of 0.03 px at the corners has; the noise was fitted to z."""
    del quick
    rows = []
    for number, series in enumerate(COORDINATES, start=1):
        place = np.array([mean for _, _, mean, _ in series])
        z = place[2]
        for axis, (_, _, _, printed), ours in zip("xyz", series, _spreads(place), strict=True):
            bar = Bar((0.0, 100.0), held=within(1.5, printed), differs=within(2.0, printed) if z > FAR else None)
            reading = "propagated to first order, marker parallel to the picture"
            if axis != "z":
                bar = Bar((0.0, 100.0), held=within(1.5, printed), differs=within(3.0, printed))
                reading += "; by the noise fitted to z, if corners err independently: common errors shift x and y alone"
            name = f"series {number}, z = {z:.0f} mm: standard deviation of {axis}"
            digits = 3 if axis == "z" else 4
            rows.append(judged(name, f"{printed} mm", f"{ours:.{digits}f} mm", ours, bar, reading))
    return rows


def _spreads(place: Vector) -> Vector:
    """By the Gauss-Newton covariance of a pose from its four corners [mm], shape (3,)."""
    here = np.concatenate([np.zeros(3), place])
    moves = STEP * np.diag([1.0, 1.0, 1.0, *np.full(3, place[2])])
    columns = [(_corners(here + move) - _corners(here - move)) / (2.0 * move.max()) for move in moves]
    jacobian = np.stack([column.ravel() for column in columns], axis=1)
    covariance = NOISE**2 * np.linalg.inv(jacobian.T @ jacobian)
    spreads: Vector = np.sqrt(np.diag(covariance))[3:]
    return spreads


def shapes(quick: bool) -> list[Row]:
    """Whether printed extremes and quartiles are those of normal samples of 100, by 20,000 of them."""
    del quick
    samples = np.random.default_rng(0).normal(size=(SAMPLES, COUNT))
    deviation = samples.std(axis=1, ddof=1)
    low, middle, high = np.quantile(samples, [0.25, 0.5, 0.75], axis=1)
    chance = {
        "range": np.ptp(samples, axis=1) / deviation,
        "quartiles": (high - low) / NORMAL_QUARTILES / deviation,
        "median": (middle - samples.mean(axis=1)) / deviation,
    }
    rare = {what: _without_rare(values) for what, values in chance.items()}

    rows = []
    for number, (series, quartiles) in enumerate(zip(COORDINATES, QUARTILES, strict=True), start=1):
        for axis, (largest, smallest, _, spread) in zip("xyz", series, strict=True):
            rows.append(_shape(f"series {number}, {axis}: range", f"{largest:g} to {smallest:g} mm",
                               (largest - smallest) / spread, rare["range"]))  # fmt: skip
        _, _, mean, spread = series[2]
        first, median, third = quartiles
        rows.append(_shape(f"series {number}, z: between the quartiles", f"{first:g} to {third:g} mm",
                           (third - first) / NORMAL_QUARTILES / spread, rare["quartiles"]))  # fmt: skip
        rows.append(_shape(f"series {number}, z: median less mean", f"{median:g} mm",
                           (median - mean) / spread, rare["median"]))  # fmt: skip
    return rows


def _without_rare(values: Vector) -> tuple[float, float]:
    """What all but one in a thousand values lie between."""
    low, high = np.quantile(values, [0.0005, 0.9995])
    return float(low), float(high)


def _shape(name: str, printed: str, ours: float, usual: tuple[float, float]) -> Row:
    """A printed statistic in standard deviations; outside what is usual the sample is not normal."""
    low, high = usual
    text = f"{ours:.2f} of the deviation; a normal sample has {low:.2f} to {high:.2f}"
    bar = Bar((-INFINITE, INFINITE), held=usual, differs=(low - 0.2, high + 0.2))
    return judged(
        name, printed, text, ours, bar, "" if low <= ours <= high else "rarer than one in a thousand normal samples"
    )


def _corners(pose: Vector) -> Matrix:
    """Pixels of the four corners for a rotation vector and a position [mm], shape (4, 2)."""
    square = 0.5 * MARKER * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    seen = (square @ pin.exp3(pose[:3]).T + pose[3:]) @ CAMERA.T
    pixels: Matrix = seen[:, :2] / seen[:, 2:]
    return pixels


TABLES = (
    Table("sensing-arithmetic", "Precision and accuracy: what follows", SOURCE, arithmetic, 1, 1),
    Table("sensing-shape", "Extremes and quartiles beside normal samples", SOURCE, shapes, 1, 1,
          bars="the source claims no distribution; what is rare, one in a thousand, is ours"),
    Table("sensing-noise", "Precision against distance, simulated", SOURCE, simulated, 1, 1,
          fitted=f"the noise of a corner, {NOISE} px"),
)  # fmt: skip

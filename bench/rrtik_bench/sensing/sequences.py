"""Known distances of 125, 300, 400 and 500 mm between two markers [1, ch. 4.5]: all but 300 mm were only plotted."""

from __future__ import annotations

import numpy as np

from rrtik_bench.report.rows import Bar, Row, judged
from rrtik_bench.sensing.runs import CAMERA, SIDE, in_view, pair_at
from rrtik_bench.sensing.synthetic_camera import published_camera
from rrtik_bench.sensing.tables import ACCURACY, SOURCE
from rrtik_bench.tables import Table
from rrtik_ompl.sensing.markers.corner_pose import ALIGNED_SIGMA, pose_of_square, square_corners

APART = (125, 300, 400, 500)  # [mm]
NEAR = tuple(row[0] for row in ACCURACY)  # distances to the camera [mm]


def errors(apart: int) -> dict[int, float]:
    """Error [%] by distance to the camera [mm], by a camera without noise that takes its lens for perfect.

    NaN where the markers do not both lie in the picture.
    """
    believed, found = published_camera(), {}
    for distance in NEAR:
        places = pair_at(1e-3 * distance, 1e-3 * apart)
        if not in_view(places):
            found[distance] = float("nan")
            continue
        pixels = [CAMERA.project(square_corners(SIDE) @ T.rotation.T + T.translation) for T in places]
        centres = [pose_of_square(believed, seen, SIDE, ALIGNED_SIGMA).T_camera_object.translation for seen in pixels]
        found[distance] = 100.0 * (float(np.linalg.norm(centres[1] - centres[0])) / (1e-3 * apart) - 1.0)
    return found


def sequences(quick: bool) -> list[Row]:
    """What a lens that is not corrected does to each sequence."""
    del quick
    rows = []
    for apart in APART:
        found = errors(apart)
        text = ", ".join(f"{distance}: {error:.2f} %" for distance, error in found.items())
        printed = ", ".join(f"{row[0]}: {row[3]:.2f} %" for row in ACCURACY) if apart == 300 else "a plot"
        reading = "no noise, the lens of a usual web camera taken for perfect; nan: not in the picture"
        rows.append(Row(f"{apart} mm apart: error by distance", printed, text, None, reading))
        usable = [abs(error) for distance, error in found.items() if distance <= 1500 and not np.isnan(error)]
        rows.append(judged(f"{apart} mm apart: largest error up to 1500 mm", "usable", f"{max(usable):.2f} %",
                           max(usable), Bar((0.0, 100.0), held=(0.0, 0.5), differs=(0.5, 3.0)),
                           "less than 0.5 % is what the printed sequence has"))  # fmt: skip
    return rows


TABLES = (
    Table(
        "sensing-sequences",
        "Sequences at 125 to 500 mm",
        SOURCE,
        sequences,
        1,
        1,
        bars="0.5 % from the printed sequence of 300 mm, for the others ours",
    ),
)

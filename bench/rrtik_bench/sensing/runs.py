"""Series of photographs by the synthetic camera, as in [1, ch. 4]: the same marker, distances and lens matrix.

Noise of 1 % of full scale is what makes OpenCV's own corners as unsteady as the published ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph, published_camera
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.corner_pose import (
    ALIGNED_SIGMA,
    ROUGH_SIGMA,
    CornerPose,
    pose_of_square,
    square_corners,
)
from rrtik_ompl.sensing.markers.detection import find_markers
from rrtik_ompl.sensing.markers.dictionaries import marker_cells

DICTIONARY = "4x4_50"
SIDE = 0.08  # of the published markers [m]
LENS = (0.05, -0.12, 0.0005, -0.0007, 0.03)  # of a usual web camera
CAMERA = published_camera(LENS)
PLAIN: Mapping[str, Any] = {"noise": 0.01, "blur": 0.6}
HARD: Mapping[str, Any] = {"noise": 0.01, "blur": 1.0, "gradient": 0.4, "flicker": 0.02, "jpeg": 85}
ARM = 1.92  # from the marker to the gripper of the virtual arm, across the line of sight [m]
MOST_TILT = np.deg2rad(40.0)


def facing(tilt: float, direction: float, roll: float, place: Sequence[float] | Vector) -> Any:
    """``T_camera_marker`` of a marker at a place [m] that looks at the camera's plane.

    Args:
        tilt: Between the marker's normal and the optical axis [rad].
        direction: Of the axis of that tilt, from the camera's x axis [rad].
        roll: Of the marker about its normal [rad].
        place: Shape (3,).
    """
    tipped = pin.exp3(tilt * np.array([np.cos(direction), np.sin(direction), 0.0]))
    turned = pin.exp3(np.array([0.0, 0.0, roll])) @ np.diag([1.0, -1.0, -1.0])
    return pin.SE3(tipped @ turned, np.asarray(place, dtype=np.float64))


def random_poses(distance: float, count: int, seed: int) -> list[Any]:
    """Markers at a distance along the optical axis [m], tilted by up to 40 degrees, at most 8 degrees aside."""
    rng, poses = np.random.default_rng([seed, round(1e3 * distance)]), []
    for _ in range(count):
        tilt, direction, roll = rng.uniform([0.0, 0.0, -np.pi], [MOST_TILT, 2.0 * np.pi, np.pi])
        poses.append(facing(tilt, direction, roll, [*(distance * rng.uniform(-0.1, 0.1, 2)), distance]))
    return poses


def seen_poses(
    places: Sequence[Any], count: int, seed: int, *, align: bool = True, believed: Camera = CAMERA, **how: Any
) -> list[list[CornerPose | None]]:
    """What is made of ``count`` photographs of markers that stand still; None where one was not found.

    Args:
        places: ``T_camera_marker`` of each.
        count: Photographs.
        seed: Of their noise.
        align: As in `find_markers`.
        believed: The camera that is used for the poses; the photographs are taken by `CAMERA`.
        how: As in `photograph`.
    """
    prints = [(T, marker_print(marker_cells(DICTIONARY, k), SIDE)) for k, T in enumerate(places)]
    clean, rng = clean_picture(CAMERA, prints, rays=8), np.random.default_rng(seed)
    sigma, rows = ALIGNED_SIGMA if align else ROUGH_SIGMA, []
    for _ in range(count):
        found = {m.number: m for m in find_markers(photograph(clean, rng, **how), DICTIONARY, align=align)}
        poses = [pose_of_square(believed, found[k].corners, SIDE, sigma) if k in found else None
                 for k in range(len(places))]  # fmt: skip
        rows.append(poses)
    return rows


def positions(rows: Sequence[Sequence[CornerPose | None]], marker: int = 0) -> Matrix:
    """Where one marker was seen [m]; photographs in which it was not are left out. Shape (k, 3)."""
    found = [row[marker] for row in rows]
    return np.array([pose.T_camera_object.translation for pose in found if pose is not None]).reshape(-1, 3)


def gripper_distances(rows: Sequence[Sequence[CornerPose | None]]) -> Vector:
    """From the camera to a gripper that is `ARM` away from the marker along its x axis [m]. Shape (k,)."""
    tips = [pose.T_camera_object.act(np.array([ARM, 0.0, 0.0])) for row in rows if (pose := row[0]) is not None]
    return np.asarray(np.linalg.norm(np.array(tips).reshape(-1, 3), axis=1))


def gripper_poses(distance: float, count: int) -> list[Any]:
    """Markers at a distance [m] whose x axis lies across the line of sight, tilted about it by 15 to 45 degrees."""
    tilts = np.deg2rad(np.linspace(15.0, 45.0, count))
    return [facing(tilt, 0.0, 0.0, [0.0, 0.0, distance]) for tilt in tilts]


def pair_at(distance: float, apart: float) -> list[Any]:
    """Two markers on one plate that is tilted by 20 degrees about the line between them."""
    return [facing(np.deg2rad(20.0), 0.0, 0.0, [side * apart / 2.0, 0.0, distance]) for side in (-1.0, 1.0)]


def pair_distances(rows: Sequence[Sequence[CornerPose | None]]) -> Vector:
    """Between the centres of two markers [m], where both were seen. Shape (k,)."""
    both = [[p.T_camera_object.translation for p in row if p is not None] for row in rows]
    return np.array([np.linalg.norm(ends[1] - ends[0]) for ends in both if len(ends) == 2])


def in_view(places: Sequence[Any]) -> bool:
    """Whether markers with a rim of one cell lie wholly in the picture."""
    for T in places:
        pixels = CAMERA.project(square_corners(SIDE * 8.0 / 6.0) @ T.rotation.T + T.translation)
        if (pixels < 0.0).any() or (pixels > np.array([CAMERA.width, CAMERA.height]) - 1.0).any():
            return False
    return True

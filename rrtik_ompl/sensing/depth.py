"""Convert depth pictures to point clouds."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Vector, bounded_array, not_negative, positive, whole_number
from rrtik_ompl.base.copies import changed
from rrtik_ompl.base.errors import CloudWarning, InputError, at_most, listed, require
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.kernels.covers.memory import called
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box, PointCloud
from rrtik_ompl.model.shapes.point_cloud import RADIUS
from rrtik_ompl.sensing.cameras.camera import Camera

KERNELS = "clouds.picture_kernels"
MOST_CELLS = 1 << 27  # of the grid of `cloud_from_depths`
ROUNDING = 1e-5  # [m] more than single precision errs within the farthest depth


def cloud_from_depth(
    depth: ArrayLike,
    camera: Camera,
    pose: ArrayLike | pin.SE3 | None = None,
    *,
    radius: float = RADIUS,
    scale: float = 1.0,
    nearest: float = 0.05,
    farthest: float = 10.0,
    every: int = 1,
    mask: ArrayLike | None = None,
) -> PointCloud:
    """Return a point cloud with one point for each pixel that has a valid depth.

    Args:
        depth: Depth along the camera's axis, shape (height, width). Values that are not finite, or not between
            ``nearest`` and ``farthest``, are left out, and so is what the mask of a ``numpy.ma`` array hides.
        camera: Intrinsics of the camera, as :meth:`rrtik_ompl.sensing.Camera.load` reads them.
        pose: T_world_camera (x right, y down, z away from it); None for points in the camera frame.
        radius: Radius of the ball that represents each point [m].
        scale: Metres per unit of the picture; 0.001 for millimetres.
        nearest: Least valid depth [m].
        farthest: Largest valid depth [m].
        every: Use every n-th pixel along both axes.
        mask: Picture of the same size that is not 0 (True, 1, 255) where the depth is used; None to use all of it.

    Raises:
        InputError: If the picture or its mask has another size than the camera's, a number makes no sense, or no pixel
            is left.

    Warns:
        CloudWarning: If pixels with a depth are left out because no ray through the lens reaches them; it counts them.

    Example:
        >>> import numpy as np
        >>> camera = rrtik.sensing.Camera([[100.0, 0.0, 1.0], [0.0, 100.0, 1.0], [0.0, 0.0, 1.0]], 3, 3)
        >>> rrtik.sensing.cloud_from_depth(np.full((3, 3), 2.0), camera).points[0].tolist()
        [-0.019999999552965164, -0.019999999552965164, 2.0]
    """
    require(camera, Camera, "camera", "use Camera.load(file)")
    picture = _picture(np.ma.filled(depth, 0.0) if np.ma.isMaskedArray(depth) else depth, camera, "depth picture")
    used = (
        np.ones(picture.shape, dtype=bool) if mask is None else _picture(mask, camera, "mask of a depth picture") != 0
    )

    step = min(whole_number(every, "every", 1), max(picture.shape))
    nearest_depth = not_negative(nearest, "nearest")
    z = positive(scale, "scale") * picture[::step, ::step]
    is_measured = np.isfinite(z) & (z >= nearest_depth) & (z <= positive(farthest, "farthest")) & (z > 0.0)
    if not is_measured.any():
        raise InputError(
            f"depth picture: no pixel has a depth between {nearest_depth:g} and {farthest:g} m; check its scale"
        )

    row, column = np.nonzero(is_measured & used[::step, ::step])
    if not len(row):
        raise InputError("depth picture: its mask leaves no pixel with a depth; it must not be 0 where depth is used")

    rays = camera.rays(step * np.column_stack([column, row]).astype(np.float64))
    is_reached = np.isfinite(rays[:, 0])
    if not is_reached.any():
        raise InputError("depth picture: no ray through the lens reaches its pixels; check the camera's distortion")
    if missed := np.count_nonzero(~is_reached):
        counted = f"{missed} of {len(rays)} pixels with a depth are left out"
        reason = "no ray through the lens reaches them; check the camera's distortion"
        warnings.warn(f"depth picture: {counted}: {reason}", CloudWarning, stacklevel=2)

    depths = z[row, column][is_reached]
    points = np.column_stack([rays[is_reached] * depths[:, None], depths])

    if pose is not None:
        camera_pose = rigid(pose, "pose of the camera")
        points = points @ camera_pose.rotation.T + camera_pose.translation

    return PointCloud(points, radius)


def _picture(values: ArrayLike, camera: Camera, what: str, kind: type[np.floating[Any]] = np.float64) -> NDArray[Any]:
    """Return a picture as numbers, shape (height, width); raise an error if it has not the camera's size."""
    try:
        picture = np.asarray(values, dtype=kind)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what}: expected numbers") from error
    if picture.shape != (camera.height, camera.width):
        size = f"{camera.height} rows of {camera.width}"
        raise InputError(f"{what}: the camera has {size} pixels, got an array of shape {picture.shape}")
    return picture


def cloud_from_depths(
    views: Iterable[Iterable[Any]],
    within: tuple[ArrayLike, ArrayLike],
    *,
    cell: float = 0.02,
    radius: float = 0.005,
    scale: float = 1.0,
    nearest: float = 0.05,
    farthest: float = 10.0,
    without: Iterable[Obstacle] = (),
) -> PointCloud:
    """Return one thinned cloud of the depth pictures of one or several cameras, in some milliseconds.

    Space is divided into cubes, and the cloud has the middle of each cube that a pixel is in. Its radius is such that
    each ball covers the whole cube and ``radius`` around it, so nothing that was measured is left uncovered.
    ``PointCloud.dropped`` counts the pixels without a valid depth: 0, not finite, or out of range.

    Args:
        views: For each picture the depth, the camera and T_world_camera, as in :func:`cloud_from_depth`, and, if
            wanted, a mask that is not 0 where the depth is used.
        within: Lowest and highest coordinates of the points in the world, shape (3,) each [m]; others are left out.
        cell: Side of a cube [m].
        radius: Error of the measured points [m].
        scale: Metres per unit of the pictures; 0.001 for millimetres.
        nearest: Least valid depth [m].
        farthest: Largest valid depth [m].
        without: Boxes (`Obstacle`) in the world in which points are left out, such as one around the thing to be
            grasped.

    Raises:
        InputError: If a picture or mask has another size than its camera's, a number makes no sense, the grid has too
            many cubes, or no point is left.

    Example:
        >>> import numpy as np
        >>> camera = rrtik.sensing.Camera([[100.0, 0.0, 1.0], [0.0, 100.0, 1.0], [0.0, 0.0, 1.0]], 3, 3)
        >>> picture = np.array([[0, 0, 0], [0, 2000, 0], [0, 0, 2000]], dtype=np.uint16)
        >>> view = picture, camera, rrtik.pose()
        >>> cloud = rrtik.sensing.cloud_from_depths([view], ([-1, -1, 0], [1, 1, 3]), scale=0.001)
        >>> len(cloud.points), cloud.dropped
        (2, 7)
    """
    low, high = (bounded_array(end, (3,), f"within: {name}") for end, name in zip(within, ("low", "high"), strict=True))
    side = positive(cell, "cell")
    counts = np.ceil((high - low) / side).astype(np.int64)
    if (counts < 1).any():
        raise InputError(f"within: low must be below high, got {low.tolist()} and {high.tolist()}")
    at_most(float(np.prod(counts.astype(np.float64))), MOST_CELLS, "cloud_from_depths: cubes", "take a larger cell")
    unit = positive(scale, "scale")
    depths = max(not_negative(nearest, "nearest"), 1e-9), positive(farthest, "farthest")
    own_radius = not_negative(radius, "radius")
    boxes = [_inverse_of(each) for each in listed(without, "without")]

    occupied = np.zeros(int(np.prod(counts)), dtype=bool)
    dropped = 0
    for view in listed(views, "views"):
        depth, camera, pose, *masks = listed(view, "each of the views")
        require(camera, Camera, "camera of a view", "use Camera.load(file)")
        missed, keys = _cells(
            depth, camera, rigid(pose, "pose of the camera"), masks, (unit, *depths), (low, side, counts), boxes
        )
        dropped += missed
        occupied[keys] = True

    found = np.flatnonzero(occupied)
    if len(found) == 0:
        missing = f"{dropped} pixels have no valid depth"
        raise InputError(f"depth pictures: no point is left, and {missing}; check scale, within and without")
    x = found % counts[0]
    rest = found // counts[0]
    middles = low + side * (np.column_stack([x, rest % counts[1], rest // counts[1]]) + 0.5)
    cloud = PointCloud(middles.astype(np.float32), own_radius + 0.5 * np.sqrt(3.0) * side + ROUNDING)
    return changed(cloud, dropped=dropped)


def _cells(
    depth: ArrayLike,
    camera: Camera,
    pose: pin.SE3,
    masks: list[ArrayLike],
    range_of_depths: tuple[float, float, float],
    grid: tuple[Vector, float, NDArray[np.int64]],
    boxes: list[tuple[pin.SE3, Vector]],
) -> tuple[int, NDArray[np.int64]]:
    """Return how many pixels of a picture have no valid depth, and the numbers of the cubes of the others.

    Args:
        depth: The picture.
        camera: Its camera.
        pose: T_world_camera.
        masks: The picture's mask, if there is one.
        range_of_depths: Metres per unit; least and largest valid depth [m].
        grid: Lowest coordinates [m], side of a cube [m], and number of cubes along each axis.
        boxes: Poses T_box_world and half sides [m] of the boxes that are left out.
    """
    low, side, counts = grid
    picture = _picture(
        np.ma.filled(depth, 0.0) if np.ma.isMaskedArray(depth) else depth, camera, "depth picture", np.float32
    )
    used = [(_picture(mask, camera, "mask of a depth picture") != 0).ravel() for mask in masks]

    # In units of cubes from the lowest corner of the grid.
    directions = _directions(camera, pose.rotation.tobytes(), side)
    offset = (pose.translation - low) / side
    kernels = library(KERNELS)
    if kernels is None:
        return _cells_in_numpy(picture, used, (directions, offset), range_of_depths, grid, boxes)

    pixels = np.ascontiguousarray(picture)
    numbers = np.array([*range_of_depths, *offset, *counts, *low, side])
    rows = np.array([[*to_box.rotation.ravel(), *to_box.translation, *half] for to_box, half in boxes])
    mask = np.logical_and.reduce(used).astype(np.int32) if used else np.empty(0, dtype=np.int32)
    keys = np.empty(pixels.size, dtype=np.int64)
    measured = np.zeros(1, dtype=np.int64)
    asked = (pixels, pixels.size, mask, len(used), directions, numbers, rows, len(boxes))
    found = called(kernels.find_cells, *asked, keys, measured)
    return pixels.size - int(measured[0]), keys[:found]


def _cells_in_numpy(
    picture: NDArray[np.float32],
    used: list[Mask],
    rays: tuple[NDArray[np.float32], Vector],
    range_of_depths: tuple[float, float, float],
    grid: tuple[Vector, float, NDArray[np.int64]],
    boxes: list[tuple[pin.SE3, Vector]],
) -> tuple[int, NDArray[np.int64]]:
    """As _cells, without kernels."""
    scale, nearest, farthest = range_of_depths
    low, side, counts = grid
    directions, offset = rays
    z = (picture * np.float32(scale)).ravel()
    with np.errstate(invalid="ignore"):
        inside = (z >= nearest) & (z <= farthest)
    missed = len(z) - int(np.count_nonzero(inside))
    for mask in used:
        inside &= mask

    with np.errstate(invalid="ignore"):
        places = [z * row for row in directions]
        for place, start, count in zip(places, offset.astype(np.float32), counts, strict=True):
            place += start
            inside &= (place >= 0.0) & (place < count)
    chosen = np.flatnonzero(inside)
    x, y, z = (place[chosen] for place in places)
    if boxes:
        points = low + side * np.column_stack([x, y, z]).astype(np.float64)
        outside: Mask = np.ones(len(points), dtype=bool)
        for to_box, half in boxes:
            in_box = points @ to_box.rotation.T + to_box.translation
            outside &= (np.abs(in_box) > half).any(axis=1)
        x = x[outside]
        y = y[outside]
        z = z[outside]
    cells = [place.astype(np.int64) for place in (x, y, z)]
    return missed, cells[0] + counts[0] * (cells[1] + counts[1] * cells[2])


@lru_cache(maxsize=8)
def _directions(camera: Camera, rotation: bytes, side: float) -> NDArray[np.float32]:
    """Return the rays of all pixels in world axes, shape (3, pixels); a depth times one of them is in cubes."""
    column, row = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = camera.rays(np.column_stack([column.ravel(), row.ravel()]).astype(np.float64))
    axes = np.frombuffer(rotation).reshape(3, 3)
    turned = axes @ np.vstack([rays.T, np.ones(len(rays))]) / side
    return np.ascontiguousarray(turned, dtype=np.float32)


def _inverse_of(obstacle: Obstacle) -> tuple[pin.SE3, Vector]:
    """Return T_box_world and the half sides [m] of a box that is left out."""
    require(obstacle, Obstacle, "each of what is left out", "use Obstacle(name, Box(x, y, z), pose)")
    if not isinstance(obstacle.shape, Box):
        raise InputError(f"without: '{obstacle.name}' must be a box, got {type(obstacle.shape).__name__}")
    return obstacle.pose.inverse(), 0.5 * obstacle.shape.size + obstacle.margin

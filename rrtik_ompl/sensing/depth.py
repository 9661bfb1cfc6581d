"""Convert depth pictures to point clouds."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, not_negative, positive, whole_number
from rrtik_ompl.base.errors import CloudWarning, InputError, require
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.model.shapes import PointCloud
from rrtik_ompl.model.shapes.point_cloud import RADIUS
from rrtik_ompl.sensing.cameras.camera import Camera


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


def _picture(values: ArrayLike, camera: Camera, what: str) -> Matrix:
    """Return a picture as numbers, shape (height, width); raise an error if it has not the camera's size."""
    try:
        picture = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what}: expected numbers") from error
    if picture.shape != (camera.height, camera.width):
        size = f"{camera.height} rows of {camera.width}"
        raise InputError(f"{what}: the camera has {size} pixels, got an array of shape {picture.shape}")
    return picture

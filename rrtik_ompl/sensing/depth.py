"""Convert depth pictures to point clouds."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import not_negative, positive, whole_number
from rrtik_ompl.base.errors import InputError, require
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
) -> PointCloud:
    """Return a point cloud with one point for each pixel that has a valid depth.

    Args:
        depth: Depth along the camera's axis, shape (height, width). Values that are not finite, or not between
            ``nearest`` and ``farthest``, are left out.
        camera: Intrinsics of the camera, as :meth:`rrtik_ompl.sensing.Camera.load` reads them.
        pose: T_world_camera (x right, y down, z away from it); None for points in the camera frame.
        radius: Radius of the ball that represents each point [m].
        scale: Metres per unit of the picture; 0.001 for millimetres.
        nearest: Least valid depth [m].
        farthest: Largest valid depth [m].
        every: Use every n-th pixel along both axes.

    Raises:
        InputError: If the picture has another size than the camera's, a number makes no sense, or no pixel is left.

    Example:
        >>> import numpy as np
        >>> camera = rrtik.sensing.Camera([[100.0, 0.0, 1.0], [0.0, 100.0, 1.0], [0.0, 0.0, 1.0]], 3, 3)
        >>> rrtik.sensing.cloud_from_depth(np.full((3, 3), 2.0), camera).points[0].tolist()
        [-0.019999999552965164, -0.019999999552965164, 2.0]
    """
    require(camera, Camera, "camera", "use Camera.load(file)")
    try:
        picture = np.asarray(depth, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError("depth picture: expected numbers") from error
    if picture.shape != (camera.height, camera.width):
        size = f"{camera.height} rows of {camera.width}"
        raise InputError(f"depth picture: the camera has {size} pixels, got an array of shape {picture.shape}")

    step = min(whole_number(every, "every", 1), max(picture.shape))
    nearest_depth = not_negative(nearest, "nearest")
    z = positive(scale, "scale") * picture[::step, ::step]
    is_measured = np.isfinite(z) & (z >= nearest_depth) & (z <= positive(farthest, "farthest")) & (z > 0.0)
    if not is_measured.any():
        raise InputError(
            f"depth picture: no pixel has a depth between {nearest_depth:g} and {farthest:g} m; check its scale"
        )

    row, column = np.nonzero(is_measured)
    depths = z[row, column]
    rays = camera.rays(step * np.column_stack([column, row]).astype(np.float64))
    points = np.column_stack([rays * depths[:, None], depths])

    if pose is not None:
        camera_pose = rigid(pose, "pose of the camera")
        points = points @ camera_pose.rotation.T + camera_pose.translation

    return PointCloud(points, radius)

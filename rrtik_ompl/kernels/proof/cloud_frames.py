"""Which bodies of a proof are clouds, and where they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.kernels.proof import layout


def cloud_bodies(bodies: Sequence[Body]) -> list[int]:
    """Numbers of the bodies that are clouds."""
    return [k for k, body in enumerate(bodies) if isinstance(body.geometry, CloudSolid)]


def cloud_poses(bodies: Sequence[Body]) -> Matrix:
    """Frames of the clouds as the kernels read them, shape (clouds, FRAME_SIZE)."""
    places = [bodies[k].placement for k in cloud_bodies(bodies)]
    return np.array([[*place.rotation.ravel(), *place.translation] for place in places]).reshape(-1, layout.FRAME_SIZE)

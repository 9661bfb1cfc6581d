"""A synthetic camera whose truth is known, and marked objects that it sees."""

import numpy as np
import pinocchio as pin

from rrtik_bench.sensing.synthetic_camera import clean_picture, marker_print, photograph, published_camera
from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.sensing.markers.dictionaries import marker_cells
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MountedMarker

CAMERA = published_camera((0.05, -0.12, 0.0005, -0.0007, 0.03))
SIDE = 0.08


def facing(turn, place):
    """T_camera_marker of a marker that looks at the camera, turned by a rotation vector."""
    return pin.SE3(pin.exp3(np.array(turn, dtype=float)) @ np.diag([1.0, -1.0, -1.0]), np.array(place, dtype=float))


def picture_of(markers, seed=0, **how):
    prints = [(T, marker_print(marker_cells("4x4_50", number), SIDE)) for number, T in markers]
    return photograph(clean_picture(CAMERA, prints, rays=6), np.random.default_rng(seed), **how)


T_BOX_MARKERS = [pose([0.0, 0.0, 0.05]), pose([0.15, 0.0, 0.05])]
BOX = MarkedObject(
    "box",
    "target",
    tuple(MountedMarker(10 + k, SIDE, T) for k, T in enumerate(T_BOX_MARKERS)),
    (Obstacle("body", Box([0.3, 0.1, 0.1])),),
    (GraspType("top", [pose([0.0, 0.0, 0.1]), pose([0.05, 0.0, 0.1])]),),
)
STAND = MarkedObject("stand", "base", (MountedMarker(0, SIDE),))

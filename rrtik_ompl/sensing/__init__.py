"""Perception of printed markers by cameras: detection, poses with their uncertainty, objects, and scenes.

OpenCV is imported only here, in ``pilot``, and where a film or a height field is read as a picture. Frames are named in
full: ``T_camera_marker`` maps points of the marker's frame to the camera's (x right, y down, z away from it).
"""

import os
from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names

# OpenCV reads this when it is imported. Its warnings are suppressed, because our own errors say what matters.
os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")

if TYPE_CHECKING:
    from rrtik_ompl.sensing.cameras.camera import Camera as Camera
    from rrtik_ompl.sensing.cameras.pan_tilt_zoom import PanTiltZoom as PanTiltZoom
    from rrtik_ompl.sensing.depth import cloud_from_depth as cloud_from_depth
    from rrtik_ompl.sensing.depth import cloud_from_depths as cloud_from_depths
    from rrtik_ompl.sensing.mapping import map_markers as map_markers
    from rrtik_ompl.sensing.markers.marker_map import MarkerMap as MarkerMap
    from rrtik_ompl.sensing.rig import Rig as Rig
    from rrtik_ompl.sensing.rig import detect_in_rig as detect_in_rig
    from rrtik_ompl.sensing.rig_file import pictures_together as pictures_together
    from rrtik_ompl.sensing.scene_feed import scenes_of_pictures as scenes_of_pictures
    from rrtik_ompl.sensing.scene_from_view import relative_pose as relative_pose
    from rrtik_ompl.sensing.sensor import Sensor as Sensor
    from rrtik_ompl.sensing.sight import detect_objects as detect_objects
    from rrtik_ompl.world.robot_points import without_robot as without_robot
else:
    _HOMES = {
        "sensing.cameras.camera": ("Camera",),
        "sensing.cameras.pan_tilt_zoom": ("PanTiltZoom",),
        "sensing.depth": (
            "cloud_from_depth",
            "cloud_from_depths",
        ),
        "sensing.mapping": ("map_markers",),
        "sensing.markers.marker_map": ("MarkerMap",),
        "sensing.rig": (
            "Rig",
            "detect_in_rig",
        ),
        "sensing.rig_file": ("pictures_together",),
        "sensing.scene_feed": ("scenes_of_pictures",),
        "sensing.scene_from_view": ("relative_pose",),
        "sensing.sensor": ("Sensor",),
        "sensing.sight": ("detect_objects",),
        "world.robot_points": ("without_robot",),
    }
    __getattr__, __dir__, __all__ = lazy_names(__name__, _HOMES)

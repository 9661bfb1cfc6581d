"""Perception of printed markers by cameras: detection, poses with their uncertainty, objects, and scenes.

OpenCV is imported only here, in ``pilot``, and where a film or a height field is read as a picture. Frames are named in
full: ``T_camera_marker`` maps points of the marker's frame to the camera's (x right, y down, z away from it).
"""

import os

# OpenCV reads this when it is imported. Its warnings are suppressed, because our own errors say what matters.
os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")

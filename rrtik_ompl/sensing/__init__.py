"""What a camera sees of printed markers: detection, poses with their uncertainty, objects, scenes.

OpenCV is imported here and in ``pilot``, and where a film or a field of heights is a picture. Frames are named in full:
``T_camera_marker`` maps points of the marker to points of the camera (x right, y down, z away from it).
"""

import os

os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")  # read when OpenCV is imported; our own errors say what matters

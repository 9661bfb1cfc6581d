"""Camera files of others: those that OpenCV's tools write (YAML, XML), and ROS's camera_info files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal, TypeVar

import cv2
import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.sections import Name, Number, Section, parse
from rrtik_ompl.files.strict_yaml import YamlDocument
from rrtik_ompl.sensing.cameras.camera import Camera

_STARTS, _TAG = ("%YAML:1", "<?xml"), "!!opencv-matrix"  # of what OpenCV writes; it writes %YAML 1.2 by now
_MATRICES = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "M1")  # of its own samples
_LENSES = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "D", "D1")
_WIDTHS, _HEIGHTS = ("image_width", "image_Width", "width"), ("image_height", "image_Height", "height")

Read = TypeVar("Read")
Size = Annotated[int, Field(strict=True, gt=0, le=100_000)]


class MatrixEntry(Section):
    """A matrix of ROS: its size, and its numbers row by row."""

    rows: int
    cols: int
    data: list[Number]


class CameraInfo(Section):
    """What ROS's camera_calibration writes."""

    image_width: Size
    image_height: Size
    camera_name: Name | None = None
    camera_matrix: MatrixEntry
    distortion_model: Literal["plumb_bob", "rational_polynomial"] = "plumb_bob"
    distortion_coefficients: MatrixEntry
    rectification_matrix: MatrixEntry | None = None
    projection_matrix: MatrixEntry | None = None

    def build(self) -> Camera:
        """The camera; rectification and projection do not concern pictures as they are taken."""
        return _camera(self.camera_matrix.data, self.distortion_coefficients.data, self.image_width, self.image_height)


def is_of_opencv(text: str) -> bool:
    """Whether a file is one of OpenCV's storage."""
    return text.lstrip().startswith(_STARTS) or _TAG in text


def camera_from_opencv(text: str, name: str) -> Camera:
    """The camera of a file that OpenCV wrote.

    Args:
        text: Of the file.
        name: Of the file, for errors.

    Raises:
        InputError: If there is no camera with its picture's size in it, or one with another model of the lens.
    """
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        matrix, lens = (_first(storage, names, cv2.FileNode.mat) for names in (_MATRICES, _LENSES))
        width, height = (_first(storage, names, cv2.FileNode.real) for names in (_WIDTHS, _HEIGHTS))
    except (cv2.error, SystemError):
        raise InputError(f"{name}: is not a file of OpenCV that can be read; write the camera anew") from None

    if matrix is None:
        raise InputError(f"{name}: has no camera_matrix; it is a file of OpenCV without a camera")
    if width is None or height is None:
        raise InputError(f"{name}: has no image_width and image_height; add the size of the calibrated pictures")

    try:
        return _camera(matrix, np.zeros(5) if lens is None else lens, width, height)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def camera_from_ros(document: YamlDocument) -> Camera:
    """The camera of a camera_info file.

    Raises:
        InputError: If it cannot be used; one line with file, line and key.
    """
    entry = parse(document, CameraInfo)
    with document.at(()):
        return entry.build()


def is_of_ros(document: YamlDocument) -> bool:
    """Whether a YAML file is a camera_info of ROS."""
    return isinstance(document.data, dict) and "camera_matrix" in document.data and "image_width" in document.data


def _first(storage: cv2.FileStorage, names: tuple[str, ...], read: Callable[[cv2.FileNode], Read]) -> Read | None:
    for name in names:
        node = storage.getNode(name)
        if not node.empty():
            return read(node)
    return None


def _camera(matrix: ArrayLike, lens: ArrayLike, width: float, height: float) -> Camera:
    numbers = np.ravel(np.asarray(lens, dtype=np.float64))
    rest = 5
    if np.any(numbers[rest:]):
        raise InputError(
            f"the lens has {len(numbers)} coefficients; five are modelled: k1, k2, p1, p2, k3; calibrate with these"
        )

    square = np.asarray(matrix, dtype=np.float64)
    if square.size != 9:
        raise InputError(f"camera matrix must have 3 x 3 numbers, got {square.size}")
    return Camera(square.reshape(3, 3), width, height, np.pad(numbers[:rest], (0, max(rest - len(numbers), 0))))

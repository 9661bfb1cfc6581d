"""Read and write calibrated cameras as YAML files; files of OpenCV, ROS and kalibr can be read, too."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.sections import (
    NAME,
    NOT_NEGATIVE,
    NUMBER,
    NUMBERS,
    POSITIVE,
    VECTOR4,
    VERSION,
    WHOLE,
    Choice,
    Listed,
    Number,
    Section,
    Whole,
    key,
    parse,
)
from rrtik_ompl.files.strict_yaml import YamlDocument, read_yaml, write_yaml
from rrtik_ompl.files.text import read_text
from rrtik_ompl.sensing.calibration import Calibration
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.lenses import LENSES

PIXELS = Whole(1, 100_000)
# Beginnings of OpenCV's files, and a tag for newer ones, which begin with %YAML 1.2.
_STARTS, _TAG = ("%YAML:1", "<?xml"), "!!opencv-matrix"
_MATRICES = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "M1")  # keys in the files of OpenCV's samples
_LENSES = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "D", "D1")
_FISHEYE = ("fisheye_model",)  # not 0 in files of OpenCV's sample for calibration if the lens is one
_WIDTHS, _HEIGHTS = ("image_width", "image_Width", "width"), ("image_height", "image_Height", "height")

# Names of lens models in files of ROS and of kalibr.
_OF_ROS = {"plumb_bob": "brown", "rational_polynomial": "rational", "equidistant": "fisheye", "fisheye": "fisheye"}
_OF_KALIBR = {"pinhole-radtan": "brown", "pinhole-equidistant": "fisheye", "pinhole-equi": "fisheye"}

Read = TypeVar("Read")


class CameraEntry(Section):
    """Intrinsics in OpenCV's conventions; all in pixels."""

    size = key(Listed(PIXELS, 2, 2))
    fx = key(POSITIVE)
    fy = key(POSITIVE)
    cx = key(NUMBER)
    cy = key(NUMBER)
    lens = key(Choice(*LENSES), "the lens model", default="brown")
    distortion = key(
        Listed(NUMBER, 4, 8),
        "k1, k2, p1, p2, k3; of a rational lens k4, k5, k6, too; of a fisheye k1, k2, k3, k4",
        default=None,
    )
    error_px = key(NOT_NEGATIVE, "root mean square reprojection error of the calibration", default=None)
    sigmas_px = key(VECTOR4, "standard deviations of fx, fy, cx, cy", default=None)
    distortion_sigmas = key(Listed(NOT_NEGATIVE, 4, 8), "standard deviations of the distortion", default=None)
    correlation = key(
        Listed(NUMBERS), "correlations of the errors of fx, fy, cx, cy and of the distortion, in rows", default=None
    )
    tone = key(
        Number(-1.0, 2.0),
        "how light is coded as grey: 0 linear, 1 sRGB; estimated in each picture if absent",
        default=None,
    )
    readout = key(NOT_NEGATIVE, "time from the first row to the last one [s]; 0 for a global shutter", default=0.0)
    view_errors_px = key(NUMBERS, "of each photograph that was used", default=None)

    def build(self) -> Camera:
        """Return the camera."""
        matrix = [[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]]
        lens = _coefficients(self.distortion or [], self.lens)
        doubts = [*(self.sigmas_px or [0.0] * 4), *_coefficients(self.distortion_sigmas or [], self.lens)]
        return Camera(
            matrix,
            self.size[0],
            self.size[1],
            lens,
            sigmas=doubts,
            tone=self.tone,
            lens=self.lens,
            correlation=self.correlation,
            readout=self.readout,
        )


class CameraFile(Section):
    """A file with one camera."""

    version = key(VERSION)
    camera = key(CameraEntry)


def read_camera(file: str | os.PathLike[str]) -> Camera:
    """Read a camera; see :meth:`Camera.load`.

    Raises:
        InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
    """
    text = read_text(file)
    if is_of_opencv(text):
        return camera_from_opencv(text, str(file))

    document = read_yaml(file)
    if is_of_ros(document):
        return camera_from_ros(document)
    if "cam0" in document.data:
        return camera_from_kalibr(document)

    entry = parse(document, CameraFile).camera
    with document.at(("camera",)):
        return entry.build()


def write_camera(camera: Camera | Calibration, file: str | os.PathLike[str]) -> None:
    """Write a camera; for a `Calibration`, its errors are written, too.

    Raises:
        InputError: If the file cannot be written.
    """
    lens = camera.camera if isinstance(camera, Calibration) else camera
    (fx, _, cx), (_, fy, cy), _ = lens.matrix.tolist()
    data: dict[str, Any] = {"size": [lens.width, lens.height], "fx": fx, "fy": fy, "cx": cx, "cy": cy}
    if lens.lens != "brown":
        data["lens"] = lens.lens
    data["distortion"] = lens.distortion.tolist()

    if lens.sigmas.any():
        data["sigmas_px"] = lens.sigmas[:4].tolist()
        data["distortion_sigmas"] = lens.sigmas[4:].tolist()
    if not np.array_equal(lens.correlation, np.eye(len(lens.sigmas))):
        data["correlation"] = lens.correlation.tolist()
    if lens.tone is not None:
        data["tone"] = lens.tone
    if lens.readout > 0.0:
        data["readout"] = lens.readout

    if isinstance(camera, Calibration):
        data["error_px"] = camera.error
        data["view_errors_px"] = [e for e in camera.view_errors.tolist() if e == e]

    write_yaml(file, {"version": 1, "camera": data})


class MatrixEntry(Section):
    """A matrix in ROS's format: its size, and its numbers row by row."""

    rows = key(WHOLE)
    cols = key(WHOLE)
    data = key(Listed(NUMBER))


class CameraInfo(Section):
    """A camera file written by ROS's camera_calibration."""

    image_width = key(PIXELS)
    image_height = key(PIXELS)
    camera_name = key(NAME, default=None)
    camera_matrix = key(MatrixEntry)
    distortion_model = key(Choice(*_OF_ROS), default="plumb_bob")
    distortion_coefficients = key(MatrixEntry)
    rectification_matrix = key(MatrixEntry, default=None)
    projection_matrix = key(MatrixEntry, default=None)

    def build(self) -> Camera:
        """Return the camera; rectification and projection do not apply to raw pictures."""
        lens = _OF_ROS[self.distortion_model]
        size = self.image_width, self.image_height
        return _camera(self.camera_matrix.data, self.distortion_coefficients.data, *size, lens)


def is_of_opencv(text: str) -> bool:
    """Check whether the text of a file is in OpenCV's storage format."""
    return text.lstrip().startswith(_STARTS) or _TAG in text


def camera_from_opencv(text: str, name: str) -> Camera:
    """Return the camera of a file written by OpenCV.

    Args:
        text: Text of the file.
        name: Name of the file, for error messages.

    Raises:
        InputError: If the file contains no camera with its picture size, or one with another lens model.
    """
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        matrix, lens = (_first(storage, names, cv2.FileNode.mat) for names in (_MATRICES, _LENSES))
        width, height, fisheye = (_first(storage, names, cv2.FileNode.real) for names in (_WIDTHS, _HEIGHTS, _FISHEYE))
    except (cv2.error, SystemError):
        raise InputError(f"{name}: is not a file of OpenCV that can be read; write the camera anew") from None

    if matrix is None:
        raise InputError(f"{name}: has no camera_matrix; it is a file of OpenCV without a camera")
    if width is None or height is None:
        raise InputError(f"{name}: has no image_width and image_height; add the size of the calibrated pictures")

    try:
        coefficients = np.zeros(0) if lens is None else lens
        return _camera(matrix, coefficients, width, height, "fisheye" if fisheye else _by_count(coefficients))
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def camera_from_ros(document: YamlDocument) -> Camera:
    """Return the camera of a camera_info file.

    Raises:
        InputError: If it cannot be used; one line with file, line and key.
    """
    entry = parse(document, CameraInfo)
    with document.at(()):
        return entry.build()


def camera_from_kalibr(document: YamlDocument) -> Camera:
    """Return the first camera of a file of kalibr (camchain).

    Raises:
        InputError: If it cannot be used, such as one with the lens of a fisheye; one line with file, line and key.
    """
    entry = document.data["cam0"]
    with document.at(("cam0",)):
        try:
            models = f"{entry['camera_model']}-{entry['distortion_model']}"
            fx, fy, cx, cy = entry["intrinsics"]
            lens = entry["distortion_coeffs"]
            width, height = entry["resolution"]
        except (KeyError, TypeError, ValueError):
            raise InputError(
                "a file of kalibr needs camera_model, distortion_model, intrinsics of four numbers, distortion_coeffs "
                "and resolution"
            ) from None
        if models not in _OF_KALIBR:
            read = "pinhole-radtan and pinhole-equi are read: calibrate with one of them"
            raise InputError(f"a file of kalibr with the model {models}; {read}")
        return _camera([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], lens, width, height, _OF_KALIBR[models])


def is_of_ros(document: YamlDocument) -> bool:
    """Check whether a YAML file is a camera_info file of ROS."""
    return isinstance(document.data, dict) and "camera_matrix" in document.data and "image_width" in document.data


def _first(storage: cv2.FileStorage, names: tuple[str, ...], read: Callable[[cv2.FileNode], Read]) -> Read | None:
    for name in names:
        node = storage.getNode(name)
        if not node.empty():
            return read(node)
    return None


def _by_count(coefficients: ArrayLike) -> str:
    """Return the lens model of OpenCV's coefficients, which may be followed by zeros of larger models."""
    return "rational" if np.any(np.ravel(coefficients)[len(LENSES["brown"].names) :]) else "brown"


def _camera(matrix: ArrayLike, coefficients: ArrayLike, width: float, height: float, lens: str) -> Camera:
    square = np.asarray(matrix, dtype=np.float64)
    if square.size != 9:
        raise InputError(f"camera matrix must have 3 x 3 numbers, got {square.size}")
    numbers = _coefficients(np.ravel(np.asarray(coefficients, dtype=np.float64)), lens)
    return Camera(square.reshape(3, 3), width, height, numbers, lens=lens)


def _coefficients(numbers: Sequence[float] | Vector, lens: str) -> Vector:
    """Return as many coefficients as a lens model has; those that are left out are 0.

    Raises:
        InputError: If there are more that are not 0.
    """
    names = LENSES[lens].names
    if np.any(numbers[len(names) :]):
        raise InputError(
            f"the lens has {len(numbers)} coefficients; {len(names)} are modelled: {', '.join(names)}; calibrate with "
            "these"
        )
    return np.pad(np.asarray(numbers[: len(names)], dtype=np.float64), (0, max(len(names) - len(numbers), 0)))

"""A calibrated camera <-> its YAML file; files of OpenCV and ROS are read too."""

from __future__ import annotations

import os
from typing import Annotated, Any

from pydantic import Field

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.sections import NotNegative, Number, Numbers, Positive, Section, Vector4, Version, parse
from rrtik_ompl.files.strict_yaml import read_yaml, write_yaml
from rrtik_ompl.files.text import read_text
from rrtik_ompl.sensing.calibration import Calibration
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.foreign_files import camera_from_opencv, camera_from_ros, is_of_opencv, is_of_ros

Pixels = Annotated[int, Field(strict=True, gt=0, le=100_000)]


class CameraEntry(Section):
    """Intrinsics in OpenCV's conventions; all in pixels, distortion as k1, k2, p1, p2, k3."""

    size: Annotated[list[Pixels], Field(min_length=2, max_length=2, description="width, height")]
    fx: Positive
    fy: Positive
    cx: Number
    cy: Number
    distortion: Annotated[list[Number], Field(min_length=4, max_length=5)] = [0.0] * 5
    error_px: NotNegative | None = Field(None, description="root mean square reprojection error of the calibration")
    sigmas_px: Vector4 | None = Field(None, description="standard deviations of fx, fy, cx, cy")
    distortion_sigmas: Annotated[list[NotNegative], Field(min_length=4, max_length=5)] | None = Field(
        None, description="standard deviations of the distortion"
    )
    tone: Annotated[Number, Field(ge=-1.0, le=2.0)] | None = Field(
        None, description="how light is coded as grey: 0 linear, 1 sRGB; estimated in each picture if absent"
    )
    view_errors_px: Numbers | None = Field(None, description="of each photograph that was used")

    def build(self) -> Camera:
        """The camera."""
        matrix = [[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]]
        doubts = (*(self.sigmas_px or (0.0,) * 4), *(*(self.distortion_sigmas or (0.0,) * 5), 0.0)[:5])
        lens = (*self.distortion, 0.0)[:5]
        return Camera(matrix, self.size[0], self.size[1], lens, sigmas=doubts, tone=self.tone)


class CameraFile(Section):
    """A file with one camera."""

    version: Version
    camera: CameraEntry


def load_camera(path: str | os.PathLike[str]) -> Camera:
    """Read a camera file: one of ours, what OpenCV's tools write, or a camera_info file of ROS.

    Raises:
        InputError: If the file cannot be used; one line with file, line, key, what was found and the remedy.
    """
    text = read_text(path)
    if is_of_opencv(text):
        return camera_from_opencv(text, str(path))

    document = read_yaml(path)
    if is_of_ros(document):
        return camera_from_ros(document)

    entry = parse(document, CameraFile).camera
    with document.at(("camera",)):
        return entry.build()


def save_camera(camera: Camera | Calibration, path: str | os.PathLike[str]) -> None:
    """Write a camera, with the errors of its calibration if that is given.

    Raises:
        InputError: If the file cannot be written.
    """
    lens = camera.camera if isinstance(camera, Calibration) else camera
    (fx, _, cx), (_, fy, cy), _ = lens.matrix.tolist()
    data: dict[str, Any] = {"size": [lens.width, lens.height], "fx": fx, "fy": fy, "cx": cx, "cy": cy}
    data["distortion"] = lens.distortion.tolist()

    if lens.sigmas.any():
        data["sigmas_px"] = lens.sigmas[:4].tolist()
        data["distortion_sigmas"] = lens.sigmas[4:].tolist()
    if lens.tone is not None:
        data["tone"] = lens.tone

    if isinstance(camera, Calibration):
        data["error_px"] = camera.error
        data["view_errors_px"] = [e for e in camera.view_errors.tolist() if e == e]
    elif not isinstance(camera, Camera):
        raise InputError(f"camera to save must be a Camera or a Calibration, got {type(camera).__name__}")

    write_yaml(path, {"version": 1, "camera": data})

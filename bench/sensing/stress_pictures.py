"""Pictures of printed markers under everything that goes wrong with a camera, with the true pose.

This renderer shares nothing with `rrtik_bench.sensing.synthetic_camera`: rays are traced to a sheet that may be bent,
light falls on it, the lens blurs light, and the sensor codes it by sRGB's curve (IEC 61966-2-1). 25 rays a photosite.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.markers.dictionaries import marker_cells

Light = NDArray[np.float32]

SIDE = 0.08  # of a marker [m]
INK, PAPER, WALL = 0.04, 0.80, 0.35  # share of the light that comes back
RAYS = 5  # along a side of a photosite
FINE = 40  # samples along a side of a cell
LENS_STEPS = 12  # of the fixed point that takes the lens out


@dataclass(frozen=True, slots=True)
class Trouble:
    """What is wrong with a picture; lengths in shares of the marker's side where nothing else is said.

    Attributes:
        linear: The sensor does not code light by a curve.
        noise: Of the coded values, of full scale.
        blur: Standard deviation of the lens's spot [pixels].
        motion: Length of a blur along a random direction [pixels].
        falling: Share of the light that is lost across the marker.
        shadow: Light in a shadow with a hard edge through the marker; 1 for none.
        spot: Light of a mirrored lamp, of full scale.
        haze: Transmission per metre.
        snow: Number of particles before the marker.
        strip: Width of what hangs over the marker, as a range.
        corner: Side of what hides one corner.
        light: Of the scene; 1 makes white paper 80 % of full scale.
        jpeg: Quality of a compression.
        ink: How far black has spread [m].
        bent: Radius of the sheet [m]; 0: flat.
        vignetting: Share of the light that is lost in the corners of the picture.
        chromatic: Share by which the picture in red light is larger than that in blue; the picture has three channels.
        filmic: The sensor codes light by a curve with a toe and a shoulder in place of that of sRGB.
        sharpened: Share of the detail of two pixels that is added after coding.
        speed: Of all markers along a random direction [m/s]; truth is where they are when the middle row is taken.
        readout: Time from the first row to the last [s].
    """

    linear: bool = False
    noise: float = 0.008
    blur: float = 0.6
    motion: tuple[float, float] = (0.0, 0.0)
    falling: float = 0.0
    shadow: float = 1.0
    spot: float = 0.0
    haze: float = 1.0
    snow: int = 0
    strip: tuple[float, float] = (0.0, 0.0)
    corner: float = 0.0
    light: float = 1.0
    jpeg: int | None = None
    ink: float = 0.0
    bent: float = 0.0
    vignetting: float = 0.0
    chromatic: float = 0.0
    filmic: bool = False
    sharpened: float = 0.0
    speed: float = 0.0
    readout: float = 0.0


def taken(
    camera: Camera,
    markers: list[tuple[Any, int]],
    dictionary: str,
    trouble: Trouble,
    rng: np.random.Generator,
    *,
    side: float = SIDE,
    rays: int = RAYS,
) -> NDArray[np.uint8]:
    """The picture of markers at ``T_camera_marker``, each with its number, by ``rays`` along a side of a photosite.

    It is grey, shape (height, width), or with chromatic aberration has a channel for blue, green and red.
    """
    if trouble.chromatic > 0.0:
        colours = [_larger(camera, share * trouble.chromatic) for share in (-0.5, 0.0, 0.5)]
        alike = replace(trouble, chromatic=0.0, jpeg=None)
        seed = int(rng.integers(2**32))
        channels = []
        for number, each in enumerate(colours):
            # The same scene in each colour, but noise of its own.
            light = _light(each, markers, dictionary, alike, np.random.default_rng(seed), side, rays)
            channels.append(_coded(light, alike, np.random.default_rng([seed, number])))
        return _packed(np.dstack(channels), trouble.jpeg)
    return _packed(_coded(_light(camera, markers, dictionary, trouble, rng, side, rays), trouble, rng), trouble.jpeg)


def _larger(camera: Camera, share: float) -> Camera:
    """The camera with a picture that is larger by a share."""
    matrix = camera.matrix * np.array([[1.0 + share, 1.0, 1.0], [1.0, 1.0 + share, 1.0], [1.0, 1.0, 1.0]])
    return replace(camera, matrix=matrix)


def _light(
    camera: Camera,
    markers: list[tuple[Any, int]],
    dictionary: str,
    trouble: Trouble,
    rng: np.random.Generator,
    side: float,
    rays: int,
) -> Light:
    """The light on the sensor."""
    light = np.full((camera.height, camera.width), WALL, dtype=np.float32)
    light += _blurred(rng.normal(0.0, 1.5, light.shape).astype(np.float32), 12.0)
    light = np.clip(light, 0.05, 0.9)
    # How far all markers move while the picture is taken [m].
    travel = np.zeros(3)
    if trouble.speed > 0.0:
        way = rng.standard_normal(3)
        travel = trouble.speed * trouble.readout * way / np.linalg.norm(way)
    for T, number in markers:
        _draw(light, camera, T, _sheet(dictionary, number, side, trouble.ink), side, trouble, rng, (rays, travel))
    light *= np.float32(trouble.light)
    if trouble.haze < 1.0:
        passed = np.float32(trouble.haze ** np.linalg.norm(markers[0][0].translation))
        light = passed * light + (1.0 - passed) * np.float32(0.45)
    for _ in range(trouble.snow):
        x, y, size = rng.uniform([0, 0, 0.8], [camera.width, camera.height, 3.0])
        _add_spot(light, x, y, size, rng.uniform(0.2, 0.8))
    light = _blurred(light, trouble.blur)
    if trouble.motion[1] > 0.0:
        light = _moved(light, rng.uniform(*trouble.motion), rng.uniform(0.0, np.pi))
    if trouble.vignetting > 0.0:
        light *= _falling_off(camera, trouble.vignetting)
    return light


def _falling_off(camera: Camera, lost: float) -> Light:
    """The share of the light that arrives, which falls with the square of the distance from the middle."""
    down, across = np.mgrid[-1.0 : 1.0 : camera.height * 1j, -1.0 : 1.0 : camera.width * 1j]
    return np.asarray(1.0 - lost * 0.5 * (down**2 + across**2), dtype=np.float32)


def with_clear_marker(
    picture: NDArray[np.uint8],
    camera: Camera,
    truth: Any,
    marker: tuple[str, int],
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    """The picture with a piece of a clear one that shows another marker, apart from the one that is in it.

    Args:
        picture: Shape (height, width).
        camera: Its camera.
        truth: Pose of the marker that is in it.
        marker: Dictionary and number of the other one.
        rng: Says where it is.
    """
    low, high = _box(camera, truth)
    for attempt in range(1000):
        T = facing(rng, camera, (0.4 + 1e-3 * attempt, 0.8 + 2e-3 * attempt), (0.0, 40.0))
        begin, end = _box(camera, T)
        if (begin > high).any() or (end < low).any():
            break
    clear = taken(camera, [(T, marker[1])], marker[0], Trouble(), rng)
    piece = np.s_[begin[1] : end[1], begin[0] : end[0]]
    both = picture.copy()
    both[piece] = clear[piece]
    return both


def _box(camera: Camera, T: Any) -> tuple[Matrix, Matrix]:
    """Left top and right bottom of a marker with its rim and a little more [pixels]."""
    reach = 0.5 * SIDE * 1.4
    outline = np.array([[x, y, 0.0] for x in (-reach, reach) for y in (-reach, reach)])
    pixels = camera.project(outline @ T.rotation.T + T.translation)
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - 3, 0, [camera.width, camera.height])
    high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 4, 0, [camera.width, camera.height])
    return low, high


def _blurred(light: Light, spot: float) -> Light:
    return np.asarray(cv2.GaussianBlur(light, (0, 0), spot), dtype=np.float32)


def _sheet(dictionary: str, number: int, side: float, ink: float) -> Light:
    """Reflectance of a marker and its rim of one cell, `FINE` samples a cell."""
    cells = np.pad(marker_cells(dictionary, number), 1, constant_values=255)
    fine = np.kron(cells, np.ones((FINE, FINE), dtype=np.uint8))
    if ink > 0.0:
        reach = round(ink / (side / (len(cells) - 2)) * FINE)
        round_spot = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        fine = np.asarray(cv2.erode(fine, round_spot), dtype=np.uint8)
    return (INK + (PAPER - INK) * fine / np.float32(255.0)).astype(np.float32)


def _draw(
    light: Light,
    camera: Camera,
    T: Any,
    sheet: Light,
    side: float,
    trouble: Trouble,
    rng: np.random.Generator,
    taking: tuple[int, Vector],
) -> None:
    rays, travel = taking
    cells = len(sheet) // FINE
    half = 0.5 * side * cells / (cells - 2)
    outline = np.array([[x, y, 0.0] for x in (-half, half) for y in (-half, half)]) @ T.rotation.T + T.translation
    pixels = camera.project(np.vstack([outline + share * travel for share in (-0.5, 0.0, 0.5)]))
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - 4, 0, [camera.width, camera.height])
    high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 5, 0, [camera.width, camera.height])
    if (high <= low).any():
        return
    # Rays through the corners of photosites; within one, where they meet the sheet is linear to 0.001 pixels.
    u, v = np.meshgrid(np.arange(low[0], high[0] + 1) - 0.5, np.arange(low[1], high[1] + 1) - 0.5)
    late = (v - 0.5 * (camera.height - 1)) / (camera.height - 1)
    at_corners = _on_sheet(_undistorted(camera, u, v), T, trouble.bent, late[None] * travel[:, None, None])
    x, y = (_between(each, rays) for each in at_corners)
    hit = (np.abs(x) < half) & (np.abs(y) < half)
    column, row = (x + half) / (2 * half) * len(sheet), (half - y) / (2 * half) * len(sheet)
    at = (column - 0.5).astype(np.float32), (row - 0.5).astype(np.float32)
    plain = np.asarray(cv2.remap(sheet, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), dtype=np.float32)
    grey = _lit(plain, x / side, y / side, trouble, rng)
    shape = (high[1] - low[1], rays, high[0] - low[0], rays)
    share = hit.reshape(shape).mean(axis=(1, 3), dtype=np.float32)
    seen = np.where(hit, grey, 0.0).reshape(shape).mean(axis=(1, 3), dtype=np.float32)
    place = light[low[1] : high[1], low[0] : high[0]]
    place[:] = seen + (1.0 - share) * place


def _between(corners: Matrix, rays: int) -> Light:
    """Values at so many places along each side of every photosite from those at its corners."""
    share = (np.arange(rays, dtype=np.float32) + np.float32(0.5)) / np.float32(rays)
    start = corners.astype(np.float32)
    across = (start[:, :-1, None] + share * np.diff(start, axis=1)[:, :, None]).reshape(len(start), -1)
    down = (across[:-1, None] + share[:, None] * np.diff(across, axis=0)[:, None]).reshape(-1, across.shape[1])
    return np.asarray(down, dtype=np.float32)


def _undistorted(camera: Camera, u: Matrix, v: Matrix) -> tuple[Matrix, Matrix]:
    """Directions of pixels through Brown's lens, by a fixed point."""
    k1, k2, p1, p2, k3 = camera.distortion
    x0, y0 = (u - camera.matrix[0, 2]) / camera.matrix[0, 0], (v - camera.matrix[1, 2]) / camera.matrix[1, 1]
    x, y = x0, y0
    for _ in range(LENS_STEPS if camera.distortion.any() else 0):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        x, y = (
            (x0 - 2.0 * p1 * x * y - p2 * (r2 + 2.0 * x * x)) / radial,
            (y0 - p1 * (r2 + 2.0 * y * y) - 2.0 * p2 * x * y) / radial,
        )
    return x, y


def _on_sheet(
    directions: tuple[Matrix, Matrix], T: Any, radius: float, moved: NDArray[np.floating[Any]]
) -> tuple[Matrix, Matrix]:
    """Where rays meet the sheet, in its own flat coordinates [m]; it is bent away from the camera about its y axis.

    Args:
        directions: Of the rays, x and y on the plane z = 1.
        T: Pose of the sheet.
        radius: Of the bend [m]; 0 for none.
        moved: How far the sheet is from that pose when each ray is taken, shape (3, ...) [m].
    """
    turn = T.rotation.T
    origin = -np.tensordot(turn, T.translation.reshape(3, 1, 1) + moved, 1)
    d = [turn[k, 0] * directions[0] + turn[k, 1] * directions[1] + turn[k, 2] for k in range(3)]
    along = -origin[2] / d[2]
    for _ in range(8 if radius else 0):
        x = np.clip(origin[0] + along * d[0], -0.95 * radius, 0.95 * radius)
        along = (-(radius - np.sqrt(radius**2 - x**2)) - origin[2]) / d[2]
    x, y = origin[0] + along * d[0], origin[1] + along * d[1]
    return (radius * np.arcsin(np.clip(x / radius, -1.0, 1.0)) if radius else x), y


def _lit(grey: Light, x: Light, y: Light, trouble: Trouble, rng: np.random.Generator) -> Light:
    """The sheet under its light, and what hangs before it; x and y in sides of the marker."""
    way, edge = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.25, 0.25)
    across = np.cos(way) * x + np.sin(way) * y
    if trouble.falling:
        grey = grey * (1.0 - trouble.falling * np.clip(across + 0.5, 0.0, 1.0)).astype(np.float32)
    if trouble.shadow < 1.0:
        grey = np.where(across < edge, np.float32(trouble.shadow) * grey, grey)
    if trouble.spot:
        a, b = rng.uniform(-0.35, 0.35, 2)
        grey = grey + np.float32(trouble.spot) * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * 0.12**2)).astype(
            np.float32
        )
    if trouble.strip[1]:
        grey = np.where(np.abs(across - edge) < 0.5 * rng.uniform(*trouble.strip), np.float32(0.5), grey)
    if trouble.corner:
        a, b = rng.choice([-0.5, 0.5], 2)
        hidden = (np.abs(x - a) < trouble.corner) & (np.abs(y - b) < trouble.corner)
        grey = np.where(hidden, np.float32(rng.choice([0.1, 0.6])), grey)
    return grey.astype(np.float32)


def _add_spot(light: Light, x: float, y: float, size: float, strength: float) -> None:
    reach = int(3 * size) + 1
    left, top = max(int(x) - reach, 0), max(int(y) - reach, 0)
    part = light[top : int(y) + reach + 1, left : int(x) + reach + 1]
    v, u = np.mgrid[top : top + part.shape[0], left : left + part.shape[1]]
    cover = np.float32(strength) * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * size**2)).astype(np.float32)
    part[:] = (1.0 - cover) * part + cover * np.float32(0.9)


def _moved(light: Light, length: float, way: float) -> Light:
    reach = int(np.ceil(length / 2)) + 1
    kernel, fine = np.zeros((2 * reach + 1, 2 * reach + 1), dtype=np.float32), 200
    for s in np.linspace(-0.5, 0.5, fine):
        a, b = reach + s * length * np.cos(way), reach + s * length * np.sin(way)
        i, j = int(b), int(a)
        for di, dj in ((0, 0), (0, 1), (1, 0), (1, 1)):
            kernel[i + di, j + dj] += abs(1 - di - (b - i)) * abs(1 - dj - (a - j)) / fine
    return np.asarray(cv2.filter2D(light, cv2.CV_32F, kernel), dtype=np.float32)


def _coded(light: Light, trouble: Trouble, rng: np.random.Generator) -> NDArray[np.uint8]:
    value = np.clip(light.astype(np.float64), 0.0, 1.0)
    if trouble.filmic:  # an S on top of the square root
        root = np.sqrt(value)
        value = 0.6 * root + 0.4 * root * root * (3.0 - 2.0 * root)
    elif not trouble.linear:
        value = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1.0 / 2.4) - 0.055)
    value = value + trouble.noise * rng.standard_normal(value.shape)
    if trouble.sharpened > 0.0:
        value += trouble.sharpened * (value - cv2.GaussianBlur(value, (0, 0), 2.0))
    taken: NDArray[np.uint8] = np.clip(np.rint(255.0 * value), 0, 255).astype(np.uint8)
    return taken


def _packed(taken: NDArray[np.uint8], quality: int | None) -> NDArray[np.uint8]:
    """The picture after a compression."""
    if quality is None:
        return taken
    packed = cv2.imencode(".jpg", taken, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    how = cv2.IMREAD_GRAYSCALE if taken.ndim == 2 else cv2.IMREAD_COLOR
    return np.asarray(cv2.imdecode(packed, how), dtype=np.uint8)


def facing(rng: np.random.Generator, camera: Camera, distance: tuple[float, float], tilt: tuple[float, float]) -> Any:
    """``T_camera_marker`` at a random place in the picture; distances [m], log-uniform, and tilts [deg] from ranges."""
    while True:
        far = float(np.exp(rng.uniform(np.log(distance[0]), np.log(distance[1]))))
        bent, way, roll = np.deg2rad(rng.uniform(*tilt)), rng.uniform(0.0, 2 * np.pi), rng.uniform(-np.pi, np.pi)
        spot = rng.uniform([-0.3, -0.22], [0.3, 0.22]) * far
        tipped = pin.exp3(bent * np.array([np.cos(way), np.sin(way), 0.0]))
        T = pin.SE3(tipped @ pin.exp3(np.array([0.0, 0.0, roll])) @ np.diag([1.0, -1.0, -1.0]), np.array([*spot, far]))
        reach = 0.5 * SIDE * 1.4
        outline = np.array([[x, y, 0.0] for x in (-reach, reach) for y in (-reach, reach)])
        pixels = camera.project(outline @ T.rotation.T + T.translation)
        if (pixels > 4).all() and (pixels < np.array([camera.width, camera.height]) - 5).all():
            return T

"""Map markers from photographs: where they are relative to one of them, with covariances, by bundle adjustment."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector, frozen, not_negative, whole_number
from rrtik_ompl.base.errors import InputError, UnknownNameError, few, listed, require
from rrtik_ompl.base.poses import quaternion_xyzw
from rrtik_ompl.sensing.adjustment import OF_POSE, OF_TARGET, Adjustment, Sight, Unknowns, adjusted, intrinsics, robust
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.markers.alignment import MIN_LIKENESS
from rrtik_ompl.sensing.markers.corner_pose import pose_of_square, square_corners
from rrtik_ompl.sensing.markers.detection import SeenMarker, find_markers
from rrtik_ompl.sensing.markers.marker_map import MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.sight import MIN_SIDE_PIXELS, as_gray, check_size

SIDE_SIGMA = 0.0003  # [m]; standard deviation of a side that is measured with a ruler
MIN_PICTURES = 2  # in which a marker has to be seen
# Corners that are farther from where they should be are not of this arrangement: [pixels], and as a share of the side,
# as sheets may be bent.
MOST_OFF, MOST_BENT = 1.0, 0.02
# Share of the photographs with a marker, or of the markers of a photograph, that may not fit.
_MOST_MISFITS = 0.25
_WRONG = 4.0  # standard deviations between what is stated and what is seen
_CAP = 20.0  # [pixels]; errors above it count as this when first poses are chosen
_BEST_LOOKS = 4  # number of photographs of a marker, those with the largest, from which its first pose is taken
_ROUNDS_OF_CHOICE = 3


@dataclass(frozen=True, slots=True, eq=False)
class MappedPicture:
    """A photograph of a map.

    Attributes:
        name: Its name.
        time: When it was taken [s].
        T_reference_camera: Pose of the camera in the frame of the reference marker.
        covariance: Covariance of (position [m], small rotation [rad]) in this frame, shape (6, 6).
        numbers: The markers in it that were used.
        error: Root mean square distance of their corners from where they should be [pixels].
    """

    name: str
    time: float
    T_reference_camera: pin.SE3
    covariance: Matrix
    numbers: tuple[int, ...]
    error: float

    def document(self) -> dict[str, Any]:
        """Return the pose of the camera as plain values; metres, radians, quaternion x, y, z, w."""
        return {
            "picture": self.name,
            "time": self.time,
            "frame": "reference",
            "xyz": self.T_reference_camera.translation.tolist(),
            "quat_xyzw": quaternion_xyzw(self.T_reference_camera).tolist(),
            "covariance": self.covariance.tolist(),
            "markers": list(self.numbers),
            "error_px": self.error,
        }


@dataclass(frozen=True, slots=True, eq=False)
class MappedMarkers:
    """Markers whose places were found, and how well.

    Attributes:
        dictionary: Their dictionary.
        reference: The number of the marker in whose frame all is.
        markers: The markers with pose, covariance, and side with its standard deviation, by number.
        pictures: The photographs that were used.
        covariance: Covariance of all poses of markers together, (position [m], small rotation [rad]) of each in their
            order, shape (6 m, 6 m).
        error: Root mean square distance of all corners from where they should be [pixels].
        unexplained: How much of it the errors of detection, sides and camera do not explain [pixels].
        unused: Why photographs, and markers in them, were not used: one line each.
    """

    dictionary: str
    reference: int
    markers: tuple[MountedMarker, ...]
    pictures: tuple[MappedPicture, ...]
    covariance: Matrix
    error: float
    unexplained: float
    unused: tuple[str, ...]

    def marker_map(self, name: str = "markers") -> MarkerMap:
        """Return a map with all markers on one object, which is the base, in the frame of the reference marker."""
        return MarkerMap(self.dictionary, (MarkedObject(name, "base", self.markers),))

    def on_object(self, mounted: Sequence[MountedMarker]) -> tuple[MountedMarker, ...]:
        """Return the markers in the frame of an object, in which the reference stays where it is mounted.

        Args:
            mounted: The markers of the object, one of which is the reference.

        Raises:
            InputError: If the reference is none of them.
        """
        stays = next((each.T_object_marker for each in mounted if each.number == self.reference), None)
        if stays is None:
            raise InputError(f"marker {self.reference} is not on the object; take one that is as the reference")
        turn = np.kron(np.eye(2), stays.rotation)
        return tuple(
            replace(
                each,
                T_object_marker=stays * each.T_object_marker,
                covariance=None if each.covariance is None else turn @ each.covariance @ turn.T,
            )
            for each in self.markers
        )

    def distance(self, first: int, other: int) -> tuple[float, float]:
        """Return the distance between the middles of two markers, and its standard deviation [m].

        Raises:
            UnknownNameError: If there is no marker of a number.
        """
        numbers = [marker.number for marker in self.markers]
        for number in (first, other):
            if number not in numbers:
                raise UnknownNameError("marker", str(number), [str(each) for each in numbers])
        a, b = numbers.index(first), numbers.index(other)
        way = self.markers[b].T_object_marker.translation - self.markers[a].T_object_marker.translation
        length = float(np.linalg.norm(way))
        slope = np.zeros(len(self.covariance))
        slope[OF_POSE * b : OF_POSE * b + 3] += way / max(length, 1e-12)
        slope[OF_POSE * a : OF_POSE * a + 3] -= way / max(length, 1e-12)
        return length, float(np.sqrt(slope @ self.covariance @ slope))


class _Look(NamedTuple):
    """A marker in a photograph."""

    picture: int
    seen: SeenMarker
    poses: tuple[pin.SE3, ...]  # T_camera_marker, the best first


def map_markers(
    pictures: Iterable[Picture],
    camera: Camera,
    dictionary: str,
    *,
    side: float,
    sides: Mapping[int, float] | None = None,
    side_sigma: float = SIDE_SIGMA,
    reference: int | None = None,
) -> MappedMarkers:
    """Find where markers are relative to each other, from photographs in which several of them are seen at a time.

    Poses of markers and of the camera minimise the distances of all corners from where they should be, weighed by their
    covariances (bundle adjustment [85]). Sides and intrinsics are fitted too, as far as they are uncertain. What the
    stated errors do not explain is added to the error of every corner, until the residuals are as large as they should
    be.

    Args:
        pictures: Photographs of one arrangement at rest, all with the camera.
        camera: The camera, with its standard deviations.
        dictionary: Dictionary of the markers.
        side: Side of their black squares [m].
        sides: Sides of markers of other sizes, by number [m].
        side_sigma: Standard deviation of each side [m].
        reference: The marker in whose frame all is; None for the smallest number.

    Raises:
        InputError: If a photograph does not have the camera's size, too few show several markers, the reference is not
            seen, a marker moved or has another side than stated, or the photographs contradict the camera's file.

    Example:
        >>> import rrtik_robots
        >>> shipped = f"{rrtik_robots.__path__[0]}/problems/pilot"
        >>> camera = rrtik.sensing.Camera.load(f"{shipped}/camera_640.yaml")
        >>> taken = [moment[0] for moment in rrtik.sensing.pictures_together([f"{shipped}/photographs"])]
        >>> found = rrtik.sensing.map_markers(taken, camera, "4x4_50", side=0.08)
        >>> len(found.pictures)
        3
    """
    require(camera, Camera, "camera", "use Camera.load(file)")
    side_sigma = not_negative(side_sigma, "side_sigma")
    side_of = {whole_number(number, "number of a marker"): each for number, each in (sides or {}).items()}

    names: list[tuple[str, float]] = []
    looks: list[_Look] = []
    for picture in listed(pictures, "pictures"):
        require(picture, Picture, "picture", "use pictures_together")
        looks += _looks(picture, len(names), camera, dictionary, side, side_of)
        names.append((picture.name, picture.time))

    numbers = sorted({look.seen.number for look in looks})
    if not numbers:
        raise InputError(f"no marker of {dictionary} is seen well in {len(names)} pictures; go nearer, hold still")
    if reference is None:
        reference = numbers[0]
    if reference not in numbers:
        raise InputError(
            f"marker {reference} is seen in no picture, but {few(map(str, numbers), 3)}; choose another reference"
        )

    mounted = {number: MountedMarker(number, side_of.get(number, side), side_sigma=side_sigma) for number in numbers}
    return _Mapper(camera, dictionary, reference, mounted, names).mapped(looks)


def _looks(
    picture: Picture, index: int, camera: Camera, dictionary: str, side: float, sides: Mapping[int, float]
) -> list[_Look]:
    """Return the markers in a picture that are sharp and large enough."""
    check_size(picture.pixels, camera, picture.name)
    looks = []
    for seen in find_markers(as_gray(picture.pixels), dictionary, tone=camera.tone, camera=camera):
        if seen.spread is None or seen.likeness < MIN_LIKENESS or seen.side < MIN_SIDE_PIXELS:
            continue
        own = sides.get(seen.number, side)
        pose = pose_of_square(camera, seen.corners, own, spread=seen.spread)
        poses = (pose.T_camera_object,) if pose.other is None else (pose.T_camera_object, pose.other)
        looks.append(_Look(index, seen, poses))
    return looks


class _Mapper:
    """The state of a map while it is made."""

    def __init__(
        self,
        camera: Camera,
        dictionary: str,
        reference: int,
        mounted: Mapping[int, MountedMarker],
        names: Sequence[tuple[str, float]],
    ) -> None:
        self.camera = camera
        self.dictionary = dictionary
        self.reference = reference
        self.mounted = mounted
        self.names = names
        self.markers: dict[int, pin.SE3] = {}
        self.cameras: dict[int, pin.SE3] = {}
        self.unused: list[str] = []

    def mapped(self, looks: Sequence[_Look]) -> MappedMarkers:
        """Return the map."""
        looks = self._seen_often(looks)
        self._place(looks)
        lost = sorted({look.seen.number for look in looks} - self.markers.keys())
        self.unused += [f"marker {number}: in no picture together with one that is placed" for number in lost]
        looks = self._seen_often([each for each in looks if each.picture in self.cameras])
        looks = [each for each in looks if each.seen.number in self.markers]
        if len(self.markers) < 2 or len(self.cameras) < MIN_PICTURES:
            raise InputError(
                f"{len(self.cameras)} pictures show {len(self.markers)} markers together; at least two must show two: "
                "take more, with several markers in each"
            )

        self._choose(looks)
        looks, fit = self._fitted(looks)
        self._check(fit)
        return self._result(looks, fit)

    def _seen_often(self, looks: Sequence[_Look]) -> list[_Look]:
        """Return the looks at markers that are in enough pictures, of pictures with several of those."""
        kept = list(looks)
        while True:
            count: dict[int, int] = defaultdict(int)
            together: dict[int, int] = defaultdict(int)
            for look in kept:
                count[look.seen.number] += 1
                together[look.picture] += 1
            fewer = [each for each in kept if count[each.seen.number] >= MIN_PICTURES and together[each.picture] > 1]
            if len(fewer) == len(kept):
                return kept
            kept = fewer

    def _place(self, looks: Sequence[_Look]) -> None:
        """Place cameras and markers one after the other, from the reference outwards, those seen best first."""
        self.markers = {self.reference: pin.SE3.Identity()}
        open_looks = sorted(looks, key=lambda look: -look.seen.side)
        while True:
            look = next((e for e in open_looks if (e.seen.number in self.markers) != (e.picture in self.cameras)), None)
            if look is None:
                return
            if look.picture in self.cameras:
                self.markers[look.seen.number] = self.cameras[look.picture] * look.poses[0]
            else:
                self.cameras[look.picture] = self.markers[look.seen.number] * look.poses[0].inverse()

    def _choose(self, looks: Sequence[_Look]) -> None:
        """Choose for each marker and each camera the pose, among those that single looks say, that fits best."""
        by_marker = _grouped(looks, lambda look: look.seen.number)
        by_picture = _grouped(looks, lambda look: look.picture)
        self.markers = {number: T for number, T in self.markers.items() if number in by_marker}
        self.cameras = {picture: T for picture, T in self.cameras.items() if picture in by_picture}

        for _ in range(_ROUNDS_OF_CHOICE):
            before = (dict(self.markers), dict(self.cameras))
            for picture, group in by_picture.items():
                told = [self.markers[e.seen.number] * T.inverse() for e in group[:_BEST_LOOKS] for T in e.poses]
                options = [self.cameras[picture], *told]
                costs = [sum(self._off(e, T, self.markers[e.seen.number]) for e in group) for T in options]
                self.cameras[picture] = options[int(np.argmin(costs))]
            for number, group in by_marker.items():
                if number == self.reference:
                    continue
                told = [self.cameras[e.picture] * T for e in group[:_BEST_LOOKS] for T in e.poses]
                options = [self.markers[number], *told]
                costs = [sum(self._off(e, self.cameras[e.picture], T) for e in group) for T in options]
                self.markers[number] = options[int(np.argmin(costs))]
            if before == (self.markers, self.cameras):
                return

    def _off(self, look: _Look, camera: pin.SE3, marker: pin.SE3) -> float:
        """Return the squared distance of a marker's corners from where they should be, at most that of `_CAP`."""
        at = camera.inverse() * marker
        points = square_corners(self.mounted[look.seen.number].side) @ at.rotation.T + at.translation
        if (points[:, 2] <= 0.0).any() and self.camera.lens != "fisheye":
            return _CAP**2
        off = self.camera.project(points) - look.seen.corners
        return min(float(np.square(off).sum(axis=1).mean()), _CAP**2)

    def _fitted(self, looks: list[_Look]) -> tuple[list[_Look], Adjustment]:
        """Fit everything without the looks that contradict the others."""
        try:
            found, errors = robust(*self._problem(looks), MOST_OFF)
            bad = errors > np.array([max(MOST_OFF, MOST_BENT * look.seen.side) for look in looks])
            removed = [look for look, each in zip(looks, bad, strict=True) if each]
            self._check_rest(looks, removed)
            self._keep(found)

            looks = self._seen_often([look for look, each in zip(looks, bad, strict=True) if not each])
            self._keep_placed(looks)
            fit = adjusted(*self._problem(looks))
            self._keep(fit.found)
        except np.linalg.LinAlgError:
            raise InputError("the pictures do not determine where the markers are; take more, from all sides") from None
        if fit.error > MOST_OFF:
            raise InputError(
                f"the pictures contradict each other, corners lie {fit.error:.1f} pixels off: calibrate the camera, "
                "and take all pictures with everything at rest"
            )
        self.unused += [
            f"{self.names[look.picture][0]}: marker {look.seen.number} is not where the other pictures have it"
            for look in removed
        ]
        return looks, fit

    def _check_rest(self, looks: Sequence[_Look], removed: Sequence[_Look]) -> None:
        """Refuse an arrangement that changed.

        Raises:
            InputError: If a marker is at several places, or a picture is of another arrangement.
        """
        misfits = {id(look) for look in removed}
        every = [*(look for look in looks if id(look) not in misfits), *removed]
        for number, group in _grouped(every, lambda look: look.seen.number).items():
            bad = [self.names[look.picture][0] for look in group if id(look) in misfits]
            if len(bad) > 1 and len(bad) > _MOST_MISFITS * len(group):
                raise InputError(
                    f"marker {number} is elsewhere in {few(bad, 3)} than in other pictures: it moved between them, its "
                    "number is printed twice, or its side is another one; take all pictures with everything at rest"
                )

    def _keep_placed(self, looks: Sequence[_Look]) -> None:
        """Forget markers and cameras without a look."""
        numbers = {look.seen.number for look in looks}
        if self.reference not in numbers:
            raise InputError(f"marker {self.reference} does not fit the others; choose another reference")
        self.markers = {number: T for number, T in self.markers.items() if number in numbers}
        pictures = {look.picture for look in looks}
        self.cameras = {picture: T for picture, T in self.cameras.items() if picture in pictures}

    def _problem(self, looks: Sequence[_Look]) -> tuple[list[Sight], Unknowns, Vector, int]:
        """Return the arguments of a fit."""
        numbers = sorted(self.markers)
        pictures = sorted(self.cameras)
        sights = [
            Sight(
                pictures.index(look.picture),
                numbers.index(look.seen.number),
                square_corners(self.mounted[look.seen.number].side),
                look.seen.corners,
                np.asarray(look.seen.spread),
                pin.SE3.Identity(),
            )
            for look in looks
        ]
        start = Unknowns(
            self.camera,
            tuple(self.cameras[picture] for picture in pictures),
            tuple(self.markers[number] for number in numbers),
            np.zeros(len(numbers)),
        )
        shares = np.array([self.mounted[number].side_sigma / self.mounted[number].side for number in numbers])
        return sights, start, shares, numbers.index(self.reference)

    def _keep(self, found: Unknowns) -> None:
        """Keep the poses of a fit."""
        self.cameras = dict(zip(sorted(self.cameras), found.cameras, strict=True))
        self.markers = dict(zip(sorted(self.markers), found.targets, strict=True))

    def _check(self, fit: Adjustment) -> None:
        """Refuse sides and intrinsics that the pictures contradict.

        Raises:
            InputError: If there are such.
        """
        wrong = []
        # One wrong side moves all others a little, too, as only their ratios are seen.
        ratios = fit.found.sizes - np.median(fit.found.sizes)
        for number, size in zip(sorted(self.markers), ratios, strict=True):
            marker = self.mounted[number]
            if abs(size) * marker.side > _WRONG * marker.side_sigma > 0.0:
                wrong.append((number, marker.side, marker.side * float(np.exp(size))))
        if wrong:
            worst = max(wrong, key=lambda each: abs(np.log(each[2] / each[1])))
            raise InputError(
                f"marker {worst[0]}: a side of {1e3 * worst[1]:.1f} mm is stated, but beside the others it looks like "
                f"{1e3 * worst[2]:.1f} mm; measure it, and state the sides that differ"
            )

        known = self.camera.sigmas > 0.0
        moved = np.abs(intrinsics(fit.found.lens) - intrinsics(self.camera))[known] / self.camera.sigmas[known]
        if moved.max(initial=0.0) > _WRONG:
            raise InputError(
                f"the pictures contradict the camera's file by {moved.max():.1f} standard deviations: calibrate the "
                "camera with this focus and zoom, or state what is not certain (sigmas_px, distortion_sigmas)"
            )

    def _result(self, looks: Sequence[_Look], fit: Adjustment) -> MappedMarkers:
        numbers = sorted(self.markers)
        markers = []
        for k, number in enumerate(numbers):
            at = slice(OF_TARGET * k, OF_TARGET * k + OF_POSE)
            grown = float(np.exp(fit.found.sizes[k]))
            stated = self.mounted[number]
            side = stated.side * grown
            doubt = side * float(np.sqrt(fit.of_targets[at.stop, at.stop]))
            covariance = None if number == self.reference else fit.of_targets[at, at]
            markers.append(MountedMarker(number, side, self.markers[number], doubt, covariance))

        pictures = []
        by_picture = _grouped(list(zip(looks, fit.errors, strict=True)), lambda each: each[0].picture)
        for k, picture in enumerate(sorted(self.cameras)):
            name, time = self.names[picture]
            group = by_picture[picture]
            used = tuple(sorted(look.seen.number for look, _ in group))
            error = float(np.sqrt(np.mean([each**2 for _, each in group])))
            pictures.append(MappedPicture(name, time, self.cameras[picture], frozen(fit.of_cameras[k]), used, error))

        without = sorted(set(range(len(self.names))) - self.cameras.keys())
        self.unused += [f"{self.names[k][0]}: fewer than two markers that can be used" for k in without]
        of_poses = np.arange(len(numbers) * OF_TARGET) % OF_TARGET < OF_POSE
        joint = np.flatnonzero(of_poses)
        return MappedMarkers(
            self.dictionary,
            self.reference,
            tuple(markers),
            tuple(pictures),
            frozen(fit.of_targets[np.ix_(joint, joint)]),
            fit.error,
            fit.unexplained,
            tuple(self.unused),
        )


def _grouped(items: Sequence[Any], name: Callable[[Any], int]) -> dict[int, list[Any]]:
    groups: dict[int, list[Any]] = defaultdict(list)
    for item in items:
        groups[name(item)].append(item)
    return dict(sorted(groups.items()))

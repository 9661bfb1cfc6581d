"""Bundle adjustment: fit poses of cameras and of targets to the pixels of the targets' points in all pictures at once.

Each sight of a target gives pixels of ``T_camera_target = camera^-1 * between * target``, with a known pose in between.
For a map of markers, every photograph has a camera pose of its own, every marker is a target, and nothing is between;
for a camera on an arm there is one camera pose, one target, and the posture of the arm is between.

Sides of targets and intrinsics of the camera are fitted too, as far as they are said to be uncertain. The poses of
cameras are eliminated first (the Schur complement), as they are many and do not depend on each other [85].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import brentq

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.sensing.calibration_fit import stepped
from rrtik_ompl.sensing.cameras.camera import Camera

Stack = NDArray[np.float64]  # arrays of more than two axes

OF_POSE = 6  # position [m], and a small rotation about the axes of the frame in which the pose is given [rad]
OF_TARGET = 7  # those of its pose, and the logarithm of its size
_MOST_STEPS = 60
_CONVERGED = 1e-9  # relative gain of the last step
_LARGEST_DAMPING = 1e8
_ROUNDS = 4  # in which fit and unexplained error are determined in turn
_MOST_UNEXPLAINED = 100.0  # [pixels]
_ROBUST_ROUNDS = 8
_TIMES_MEDIAN = 1.5


class Sight(NamedTuple):
    """A target seen in a picture.

    Attributes:
        camera: Index of the pose of the camera.
        target: Index of the target.
        points: Of the target, in its own frame, shape (k, 3) [m].
        pixels: Where they are seen, shape (k, 2).
        spread: Covariance of the pixels, shape (2 k, 2 k) [pixels^2].
        between: The known pose between the frame of the camera's pose and the frame of the target's pose.
    """

    camera: int
    target: int
    points: Matrix
    pixels: Matrix
    spread: Matrix
    between: pin.SE3


class Unknowns(NamedTuple):
    """What is fitted.

    Attributes:
        lens: Intrinsics of all cameras.
        cameras: Poses of the cameras.
        targets: Poses of the targets.
        sizes: Logarithms of the targets' sizes, as multiples of what is stated, shape (m,).
    """

    lens: Camera
    cameras: tuple[pin.SE3, ...]
    targets: tuple[pin.SE3, ...]
    sizes: Vector


class Adjustment(NamedTuple):
    """The result of a bundle adjustment.

    Attributes:
        found: The fitted values.
        unexplained: Standard deviation of an error of each pixel, beside the stated one, that residuals show [pixels].
        errors: Root mean square distance of the points from their pixels in each sight, shape (s,) [pixels].
        of_targets: Covariance of all targets' seven numbers, followed by those of the intrinsics, shape (t, t); 0 where
            nothing is fitted.
        of_cameras: Covariance of the pose of each camera, shape (n, 6, 6).
    """

    found: Unknowns
    unexplained: float
    errors: Vector
    of_targets: Matrix
    of_cameras: Stack

    @property
    def error(self) -> float:
        """Root mean square of the errors of all sights [pixels]."""
        return float(np.sqrt(np.mean(np.square(self.errors))))


def adjusted(sights: Sequence[Sight], start: Unknowns, size_sigmas: Vector, fixed: int | None = None) -> Adjustment:
    """Fit everything to the sights by Levenberg-Marquardt.

    Args:
        sights: All sights.
        start: Where to begin.
        size_sigmas: Standard deviations of the targets' sizes, as shares of the sizes, shape (m,); 0 for known ones.
        fixed: The target whose pose is not fitted, because all others refer to it.

    Raises:
        numpy.linalg.LinAlgError: If the sights do not determine the unknowns.
    """
    bundle = _Bundle(sights, start, size_sigmas, fixed)
    found = start
    unexplained = 0.0
    for _ in range(_ROUNDS):
        bundle.weigh(unexplained)
        found = bundle.solved(found)
        before = unexplained
        unexplained = bundle.unexplained(found)
        if abs(unexplained - before) <= 0.01 * unexplained:
            break
    bundle.weigh(unexplained)
    return bundle.result(bundle.solved(found), unexplained)


def robust(
    sights: Sequence[Sight], start: Unknowns, size_sigmas: Vector, fixed: int | None, usual: float
) -> tuple[Unknowns, Vector]:
    """Fit everything so that sights that contradict the others have little weight.

    The weight of a sight is that of Cauchy's distribution of its error, and is determined again after each fit, first
    from where the fit begins.

    Args:
        sights: See `adjusted`.
        start: See `adjusted`.
        size_sigmas: See `adjusted`.
        fixed: See `adjusted`.
        usual: Error of a sight that fits [pixels].

    Returns:
        The fitted values, and the error of each sight, shape (s,) [pixels].
    """
    bundle = _Bundle(sights, start, size_sigmas, fixed)
    found = start
    for _ in range(_ROBUST_ROUNDS):
        errors = bundle.errors(found)
        scale = max(usual, _TIMES_MEDIAN * float(np.median(errors)))
        bundle.weigh(0.0, 1.0 / (1.0 + np.square(errors / scale)))
        found = bundle.solved(found)
    return found, bundle.errors(found)


class _Bundle:
    """The sights of all targets, stacked point by point."""

    def __init__(self, sights: Sequence[Sight], start: Unknowns, size_sigmas: Vector, fixed: int | None) -> None:
        counts = [len(sight.points) for sight in sights]
        self.sights = sights
        self.points = np.vstack([sight.points for sight in sights])
        self.pixels = np.vstack([sight.pixels for sight in sights])
        self.ends = np.cumsum(counts)
        self.rows = [slice(2 * (end - count), 2 * end) for end, count in zip(self.ends, counts, strict=True)]
        self.camera_of = np.repeat([sight.camera for sight in sights], counts)
        self.target_of = np.repeat([sight.target for sight in sights], counts)
        self.between_turn = np.repeat([sight.between.rotation for sight in sights], counts, axis=0)
        self.between_shift = np.repeat([sight.between.translation for sight in sights], counts, axis=0)
        self.whiten: list[Matrix] = []

        self.stated = start.lens
        doubts = start.lens.sigmas
        targets = np.ones((len(start.targets), OF_TARGET), dtype=bool)
        targets[:, -1] = size_sigmas > 0.0
        if fixed is not None:
            targets[fixed, :OF_POSE] = False
        self.free = np.concatenate([targets.ravel(), doubts > 0.0])

        weights = np.zeros((len(start.targets), OF_TARGET))
        weights[targets[:, -1], -1] = 1.0 / size_sigmas[targets[:, -1]] ** 2
        self.prior = np.diag(np.concatenate([weights.ravel(), np.zeros(len(doubts))]))
        known = np.flatnonzero(doubts > 0.0)
        if len(known):
            covariance = start.lens.correlation[np.ix_(known, known)] * np.outer(doubts[known], doubts[known])
            at = weights.size + known
            self.prior[np.ix_(at, at)] = np.linalg.inv(covariance)

    def weigh(self, unexplained: float, shares: Vector | None = None) -> None:
        """Set the weights of all pixels.

        Args:
            unexplained: An error beside the stated one [pixels].
            shares: By which the weights of each sight are multiplied, shape (s,).
        """
        self.whiten = []
        for sight, share in zip(self.sights, np.ones(len(self.sights)) if shares is None else shares, strict=True):
            covariance = sight.spread + unexplained**2 * np.eye(len(sight.spread))
            self.whiten.append(np.sqrt(share) * np.linalg.inv(np.linalg.cholesky(covariance)))

    def errors(self, found: Unknowns) -> Vector:
        """Return the root mean square distance of the points from their pixels in each sight, shape (s,) [pixels]."""
        off = self._off(found)
        return np.array([np.sqrt(2.0 * np.mean(off[rows] ** 2)) for rows in self.rows])

    def solved(self, found: Unknowns) -> Unknowns:
        """Minimise the weighted squares of the residuals."""
        damping = 1e-6
        cost = self._cost(found)
        for _ in range(_MOST_STEPS):
            slopes, residuals = self._linearised(found)
            equations = self._equations(found, slopes, residuals)
            while True:
                moved = _moved(found, self.stated, *self._step(equations, damping))
                new_cost = np.inf if moved is None else self._cost(moved)
                if new_cost < cost or damping > _LARGEST_DAMPING:
                    break
                damping *= 10.0
            if moved is None or new_cost >= cost:
                return found
            gain = cost - new_cost
            found = moved
            cost = new_cost
            damping = max(0.1 * damping, 1e-12)
            if gain <= _CONVERGED * cost:
                break
        return found

    def unexplained(self, found: Unknowns) -> float:
        """Return the error of each pixel beside the stated one with which the residuals are as large as they should be.

        They should sum to the number of pixel coordinates less that of what is fitted; the same is done for the
        heterogeneity of measurements in several laboratories (Paule and Mandel [86]).
        """
        off = self._off(found)
        blocks = [np.linalg.eigh(sight.spread) for sight in self.sights]
        values = np.concatenate([each for each, _ in blocks])
        squares = np.concatenate([(v.T @ off[rows]) ** 2 for (_, v), rows in zip(blocks, self.rows, strict=True)])
        with_prior = int((np.diag(self.prior) > 0.0).sum())
        expected = max(len(squares) - OF_POSE * len(found.cameras) - int(self.free.sum()) + with_prior, 1)

        def surplus(variance: float) -> float:
            return float((squares / (values + variance)).sum()) - expected

        if surplus(0.0) <= 0.0:
            return 0.0
        if surplus(_MOST_UNEXPLAINED**2) >= 0.0:
            return _MOST_UNEXPLAINED
        return float(np.sqrt(brentq(surplus, 0.0, _MOST_UNEXPLAINED**2, xtol=1e-9)))

    def result(self, found: Unknowns, unexplained: float) -> Adjustment:
        """Return the fit with its covariances."""
        slopes, residuals = self._linearised(found)
        of_cameras, mixed, of_others, _, _ = self._equations(found, slopes, residuals)
        inverse = np.linalg.inv(of_cameras)
        follow = inverse @ mixed
        free = self.free
        reduced = of_others - np.einsum("nij,nik->jk", mixed, follow)
        covariance = np.zeros_like(reduced)
        covariance[np.ix_(free, free)] = np.linalg.inv(reduced[np.ix_(free, free)])

        return Adjustment(
            found,
            unexplained,
            self.errors(found),
            covariance,
            inverse + follow @ covariance @ follow.transpose(0, 2, 1),
        )

    def _seen(self, found: Unknowns) -> tuple[Stack, Stack, Stack]:
        """Return the rotations of the cameras, points turned and placed at each stage, all one row for each point.

        Returns:
            ``R_camera`` (m, 3, 3); points relative to their target's origin in the axes of its frame, (m, 3); points
            relative to the camera's place, in the axes of its frame, (m, 3).
        """
        turns = np.array([T.rotation for T in found.targets])[self.target_of]
        shifts = np.array([T.translation for T in found.targets])[self.target_of]
        on_target = np.einsum("mij,mj->mi", turns, self.points * np.exp(found.sizes)[self.target_of, None])
        at = np.einsum("mij,mj->mi", self.between_turn, on_target + shifts) + self.between_shift
        views = np.array([T.rotation for T in found.cameras])[self.camera_of]
        return views, on_target, at - np.array([T.translation for T in found.cameras])[self.camera_of]

    def _off(self, found: Unknowns) -> Vector:
        """Return pixels minus those that are expected, shape (2 m,)."""
        views, _, at = self._seen(found)
        return (self.pixels - found.lens.project(np.einsum("mji,mj->mi", views, at))).ravel()

    def _cost(self, found: Unknowns) -> float:
        off = self._off(found)
        squares = sum(np.square(whiten @ off[rows]).sum() for whiten, rows in zip(self.whiten, self.rows, strict=True))
        numbers = self._numbers(found)
        return float(squares + numbers @ self.prior @ numbers)

    def _numbers(self, found: Unknowns) -> Vector:
        """Return how far sizes and intrinsics are from what is stated, and 0 for each pose."""
        targets = np.zeros((len(found.targets), OF_TARGET))
        targets[:, -1] = found.sizes
        return np.concatenate([targets.ravel(), intrinsics(found.lens) - intrinsics(self.stated)])

    def _linearised(self, found: Unknowns) -> tuple[list[tuple[Matrix, Matrix]], list[Vector]]:
        """Return the slopes of each sight's whitened residuals, and the residuals, shape (2 k,).

        Slopes are by the camera's pose, shape (2 k, 6), and by all other numbers, shape (2 k, t).
        """
        views, on_target, at = self._seen(found)
        in_camera = np.einsum("mji,mj->mi", views, at)
        by_point = found.lens.jacobian(in_camera, np.zeros(3))[:, :3].reshape(-1, 2, 3)
        by_lens = found.lens.own_slopes(in_camera)
        off = (self.pixels - found.lens.project(in_camera)).ravel()

        # Of a point's place relative to the camera, in the frame of the camera's pose; then of the target's frame.
        by_place = np.einsum("mki,mji->mkj", by_point, views)
        by_own_place = np.einsum("mki,mij->mkj", by_place, self.between_turn)
        # A small rotation w moves a point p by w x p, and g (w x p) = (p x g) w.
        by_camera = -np.concatenate([by_place, np.cross(at[:, None], by_place)], axis=2).reshape(-1, OF_POSE)
        turned = np.cross(on_target[:, None], by_own_place)
        grown = np.einsum("mki,mi->mk", by_own_place, on_target)[:, :, None]
        by_target = np.concatenate([by_own_place, turned, grown], axis=2).reshape(-1, OF_TARGET)

        slopes = []
        residuals = []
        for sight, rows, whiten in zip(self.sights, self.rows, self.whiten, strict=True):
            others = np.zeros((len(whiten), len(self.free)))
            others[:, OF_TARGET * sight.target : OF_TARGET * (sight.target + 1)] = by_target[rows]
            others[:, OF_TARGET * len(found.targets) :] = by_lens[rows]
            others[:, ~self.free] = 0.0
            slopes.append((whiten @ by_camera[rows], whiten @ others))
            residuals.append(whiten @ off[rows])
        return slopes, residuals

    def _equations(
        self, found: Unknowns, slopes: list[tuple[Matrix, Matrix]], residuals: list[Vector]
    ) -> tuple[Stack, Stack, Matrix, Matrix, Vector]:
        """Return the normal matrices of cameras, of both, and of all others, and the right sides."""
        of_cameras = np.zeros((len(found.cameras), OF_POSE, OF_POSE))
        mixed = np.zeros((len(found.cameras), OF_POSE, len(self.free)))
        of_others = self.prior.copy()
        right_cameras = np.zeros((len(found.cameras), OF_POSE))
        right_others = -self.prior @ self._numbers(found)
        for sight, (by_camera, others), off in zip(self.sights, slopes, residuals, strict=True):
            of_cameras[sight.camera] += by_camera.T @ by_camera
            mixed[sight.camera] += by_camera.T @ others
            of_others += others.T @ others
            right_cameras[sight.camera] += by_camera.T @ off
            right_others += others.T @ off
        return of_cameras, mixed, of_others, right_cameras, right_others

    def _step(self, equations: tuple[Stack, Stack, Matrix, Matrix, Vector], damping: float) -> tuple[Matrix, Vector]:
        """Return the steps of the cameras, shape (n, 6), and of the others, shape (t,)."""
        of_cameras, mixed, of_others, right_cameras, right_others = equations
        damped = of_cameras * (1.0 + damping * np.eye(OF_POSE))
        follow = np.linalg.solve(damped, np.concatenate([mixed, right_cameras[:, :, None]], axis=2))
        reduced = of_others + damping * np.diag(np.diag(of_others))
        reduced -= np.einsum("nij,nik->jk", mixed, follow[:, :, :-1], optimize=True)
        right = right_others - np.einsum("nij,ni->j", mixed, follow[:, :, -1])

        others = np.zeros(len(self.free))
        others[self.free] = np.linalg.solve(reduced[np.ix_(self.free, self.free)], right[self.free])
        return follow[:, :, -1] - follow[:, :, :-1] @ others, others


def intrinsics(camera: Camera) -> Vector:
    """Return fx, fy, cx, cy and the coefficients of the lens, shape (4 + k,)."""
    return np.concatenate([camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]], camera.distortion])


def _moved(found: Unknowns, stated: Camera, cameras: Matrix, others: Vector) -> Unknowns | None:
    """Return the unknowns after a step; None if they make no sense."""
    if not (np.isfinite(cameras).all() and np.isfinite(others).all()):
        return None
    count = OF_TARGET * len(found.targets)
    targets = others[:count].reshape(-1, OF_TARGET)
    lens = found.lens
    if others[count:].any():
        fx, fy, cx, cy, *coefficients = intrinsics(found.lens) + others[count:]
        if min(fx, fy) <= 0.0:
            return None
        matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        lens = replace(stated, matrix=matrix, distortion=np.array(coefficients))
    return Unknowns(
        lens,
        tuple(stepped(T, step) for T, step in zip(found.cameras, cameras, strict=True)),
        tuple(stepped(T, step[:OF_POSE]) for T, step in zip(found.targets, targets, strict=True)),
        found.sizes + targets[:, -1],
    )

"""The clearance curve of a path: how far the arm stays from obstacles, where that is least, and what is not proven."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.model.judgement import FARTHEST, ClearanceCurve
from rrtik_ompl.model.proof import Gap, Proof
from rrtik_ompl.world.row_checks import RowChecks

PLACES = 240  # number of samples on a path, in addition to its waypoints
NEAREST = 1e-5  # [m] least clearance that is distinguished from 0
STEPS = 255  # number of levels from NEAREST to FARTHEST in equal ratios, each 5 % above the one before
LEVELS = frozen(np.append(0.0, np.geomspace(NEAREST, FARTHEST, STEPS)))


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A motion in pieces, such as those between the waypoints of a path, with a function that proves it.

    Attributes:
        motions: Index of the piece that each sampled place is on, shape (m,).
        shares: Position of each place on its piece, from 0 to 1, shape (m,).
        at: Computes the configurations, shape (k, dof), at given pieces and shares, shape (k,) each.
        prove: Proves all pieces free with a clearance [m], that of the world if None; the gaps' motions are indices of
            pieces.
    """

    motions: NDArray[np.int64]
    shares: Vector
    at: Callable[[NDArray[np.int64], Vector], Matrix]
    prove: Callable[[float | None], Proof]


def clearance_along(checks: RowChecks, waypoints: Matrix) -> ClearanceCurve:
    """Compute the clearance curve of a path, waypoints of shape (k, dof).

    Its samples are spread evenly over the bound on the arm's displacement.
    """
    return clearance_on(checks, course_along(checks, waypoints))


def course_along(checks: RowChecks, waypoints: Matrix) -> Course:
    """Return a path, waypoints of shape (k, dof), as a course; a single waypoint is a motion that stands still."""
    rows = np.vstack([waypoints, waypoints]) if len(waypoints) == 1 else waypoints
    motions, shares, _ = places_along(checks, rows)

    def prove(clearance: float | None) -> Proof:
        required_clearance = checks.settings.required_clearance if clearance is None else clearance
        return checks.prover.route(rows, clearance=required_clearance)

    return Course(motions, shares, partial(_between, rows), prove)


def clearance_on(checks: RowChecks, course: Course) -> ClearanceCurve:
    """Compute the clearance curve of a course.

    The distances at the sampled places come from proofs of single configurations. The least distance on the curve holds
    for all proven pieces as a whole and not only for the samples: proofs of the pieces with larger clearances report
    the places at which these are not kept, and these places are added to the curve. So are the places at which the
    proof with the required clearance fails.
    """
    proof = course.prove(None)
    unproven = tuple(gap.motion for gap in proof.unproven)

    levels, pairs = _proven_levels(checks, course.at(course.motions, course.shares))
    levels_of_proven = levels[~np.isin(course.motions, unproven)]

    # Index of the last level below the required clearance, or -1.
    level_of_unproven = int(np.searchsorted(LEVELS, proof.clearance)) - 1
    gaps = [(gap, level_of_unproven) for gap in proof.unproven]
    gaps += (
        _gaps_above_proven_level(course, int(levels_of_proven.min()), set(unproven)) if levels_of_proven.size else []
    )
    gaps = [(gap, level) for gap, level in gaps if np.isfinite(gap.share)]

    # Add the places where proofs fail to the samples, in order along the course.
    if gaps:
        motions = np.array([gap.motion for gap, _ in gaps])
        shares = np.array([gap.share for gap, _ in gaps])
        levels_of_gaps, _ = _proven_levels(checks, course.at(motions, shares))
        levels = np.append(levels, np.minimum(levels_of_gaps, [level for _, level in gaps]))
        pairs = (*pairs, *((gap.first, gap.second) for gap, _ in gaps))

        motions = np.append(course.motions, motions)
        shares = np.append(course.shares, shares)

        order = np.lexsort((shares, motions))
        levels = levels[order]
        pairs = tuple(pairs[k] for k in order)
        course = replace(course, motions=motions[order], shares=shares[order])

    distances = LEVELS[np.maximum(levels, 0)]
    return ClearanceCurve(course.motions, frozen(course.shares), frozen(distances), pairs, unproven)


def _gaps_above_proven_level(course: Course, level_of_samples: int, unproven: set[int]) -> list[tuple[Gap, int]]:
    """Find the largest level that all proven pieces keep, and the places where the next one fails.

    The level is found by bisection over ``LEVELS`` between 0 and the level of the samples.

    Args:
        course: The course.
        level_of_samples: Index of the level that all samples on proven pieces keep.
        unproven: Indices of the pieces that are not proven free.

    Returns:
        The gaps at the next level above the proven one, each with the index of the proven level; empty if the pieces
        keep the level of the samples.
    """
    gaps: list[Gap] = []
    proven_level = 0
    refused_level = level_of_samples + 1
    tried_level = level_of_samples

    while refused_level - proven_level > 1:
        proof = course.prove(float(LEVELS[tried_level]))
        gaps_of_level = [gap for gap in proof.unproven if gap.motion not in unproven]
        if gaps_of_level:
            refused_level = tried_level
            gaps = gaps_of_level
        else:
            proven_level = tried_level
        tried_level = (proven_level + refused_level) // 2

    return [(gap, proven_level) for gap in gaps]


def places_along(checks: RowChecks, waypoints: Matrix) -> tuple[NDArray[np.int64], Vector, Matrix]:
    """Sample a path, waypoints of shape (k, dof), evenly over the bound on the arm's displacement; its end is the last.

    Returns:
        The motion that each sample is on, shape (m,); its position on the motion, from 0 to 1, shape (m,); the
        configurations, shape (m, dof).
    """
    rows = np.vstack([waypoints, waypoints]) if len(waypoints) == 1 else waypoints
    travel = np.abs(np.diff(rows, axis=0)) @ checks.solids.weights
    counts = np.maximum(np.ceil(PLACES * travel / max(float(travel.sum()), 1e-300)), 1.0).astype(np.int64)
    motions = np.append(np.repeat(np.arange(len(counts)), counts), len(counts) - 1)
    shares = np.append(np.concatenate([np.arange(n) / n for n in counts]), 1.0)
    return motions, shares, _between(rows, motions, shares)


def distances_at(checks: RowChecks, places: Matrix) -> Vector:
    """Return the distance [m] that configurations, shape (m, dof), are proven to keep from obstacles, shape (m,).

    Distances are rounded down to the levels of a curve.
    """
    return np.asarray(LEVELS[np.maximum(_proven_levels(checks, places)[0], 0)])


def _between(rows: Matrix, motions: NDArray[np.int64], shares: Vector) -> Matrix:
    """Interpolate between the waypoints ``rows`` at given motions and shares, shape (m,) each: shape (m, dof)."""
    configurations: Matrix = (1.0 - shares)[:, None] * rows[motions] + shares[:, None] * rows[motions + 1]
    return configurations


def _proven_levels(checks: RowChecks, places: Matrix) -> tuple[NDArray[np.int64], tuple[tuple[str, str], ...]]:
    """Find by bisection the largest level that each configuration, shape (m, dof), is proven to keep.

    Returns:
        Indices into ``LEVELS``, shape (m,), -1 where not even 0 is proven; for each configuration the names of the two
        bodies at which the last proof failed, "" if none did.
    """
    proven_levels = np.full(len(places), -1)
    refused_levels = np.full(len(places), len(LEVELS))
    pairs = [("", "")] * len(places)

    while (undecided := np.flatnonzero(refused_levels - proven_levels > 1)).size:
        # One bisection step for all configurations; those with the same level are proven together.
        tried_levels = (proven_levels[undecided] + refused_levels[undecided]) // 2
        for level in np.unique(tried_levels).tolist():
            group = undecided[tried_levels == level]
            gaps = checks.prover.still_gaps(places[group], clearance=float(LEVELS[level]))
            is_proven = np.ones(len(group), dtype=bool)
            for gap in gaps:
                is_proven[gap.motion] = False
                pairs[group[gap.motion]] = (gap.first, gap.second)
            proven_levels[group[is_proven]] = level
            refused_levels[group[~is_proven]] = level

    return proven_levels, tuple(pairs)

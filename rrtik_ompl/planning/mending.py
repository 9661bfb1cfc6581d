"""Mend a motion: the stretches that are not proven free are replaced by proven ones near by, all else stays.

Ways around are found without regard to the motion. Each is then pulled towards it: its waypoints move straight to their
places on the motion as far as proofs allow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, not_negative, positive, seed_of
from rrtik_ompl.base.choices import Between
from rrtik_ompl.base.errors import InputError, NotFoundError, require
from rrtik_ompl.model.path import JointPath, path_of
from rrtik_ompl.model.robot import Robot, poses
from rrtik_ompl.model.transitions import part_counts, subdivided
from rrtik_ompl.motion.received.points import Motion, curve_of
from rrtik_ompl.motion.trajectory.checks import chords_of
from rrtik_ompl.motion.trajectory.splines import Splines
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.world.detours import with_detours
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

CHORDS = 2e-4  # [m] largest distance of two bodies from a curved motion that is mended by straight lines
SHORT = 0.05  # [rad; metres count like radians] longest part of a motion that is kept or replaced as a whole
SEEDS = 4  # number of plans for a stretch, the nearest of which is taken
PULLS = (1.0, 0.5, 0.25, 0.1, 0.03)  # shares of its distance from the motion by which a waypoint is moved
MOST_SWEEPS = 60  # largest number of times that each waypoint is moved
STILL = 1e-3  # [rad; metres count like radians] largest move of a waypoint in a sweep after which there is none
THIN = 0.005  # [rad; metres count like radians] distance up to which waypoints are left out
FINE = 0.01  # [rad; metres count like radians] step in which a departure is measured


@dataclass(frozen=True, slots=True, eq=False)
class Mended:
    """A proven path near a motion.

    Attributes:
        path: The path, with its proof.
        stretches: Number of stretches that were replaced.
        departure: Largest distance of a configuration on them from the motion [rad; metres count like radians].
        tip_departure: The same for the tip [m].
    """

    path: JointPath
    stretches: int
    departure: float
    tip_departure: float

    def __str__(self) -> str:
        if self.stretches == 0:
            return "nothing had to be mended"
        count = f"{self.stretches} stretch{'es' * (self.stretches != 1)} replaced"
        return f"{count}; at most {self.departure:.3g} rad from the motion, the tip {1e3 * self.tip_departure:.3g} mm"


def mended(
    world: World,
    motion: Motion,
    *,
    between: Between | None = None,
    clearance: float | None = None,
    seconds: float = 5.0,
    seed: int | None = 0,
) -> Mended:
    """Return a proven path near a motion, with the same ends.

    A stretch is replaced from the last point before it that is proven free to the first one after it: by the nearest of
    several detours and plans, all of which are pulled towards the motion as far as they are proven. A curved motion
    becomes straight lines whose bodies stay within 0.2 mm of it.

    Args:
        world: The world.
        motion: As of :func:`rrtik_ompl.prove`.
        between: As of :func:`rrtik_ompl.prove`.
        clearance: Distance to keep from every obstacle on top of its margin [m]; None for what the world requires.
        seconds: Time limit of each plan [s].
        seed: Seed of detours and plans; None draws one.

    Raises:
        InputError: If the motion does not fit the robot.
        NotFoundError: If an end of the motion is not proven free, or no way around something is found.
    """
    require(world, World, "world of a motion to mend", "make it with World(robot, scene)")
    kept = world.settings.required_clearance if clearance is None else not_negative(clearance, "clearance")
    limit = positive(seconds, "seconds")
    first_seed = seed_of(seed)

    given = _straightened(curve_of(motion, world.robot, between), world)
    counts = part_counts(given, SHORT)
    rows = world.robot.onto_limits(subdivided(given, counts)[0])
    is_given = np.isin(np.arange(len(rows)), np.append(0, np.cumsum(counts)))
    free = world.prover.proven(rows, rows, clearance=kept)
    for what, row in (("begin", 0), ("end", -1)):
        if not free[row]:
            reason = world.explain(rows[row]) or "not proven free"
            raise NotFoundError(f"the motion cannot be mended: its {what}: {reason}")

    parts = [rows[:1]]
    departures = [(0.0, 0.0)]
    done = 0  # the row up to which the path is mended
    for bad in np.flatnonzero(~world.prover.proven(rows[:-1], rows[1:], clearance=kept)).tolist():
        if bad < done:
            continue
        first = max(int(np.flatnonzero(free[: bad + 1])[-1]), done)
        last = bad + 1 + int(np.flatnonzero(free[bad + 1 :])[0])
        stretch = rows[first : last + 1]
        way = _way_around(world, stretch, kept, limit, first_seed)
        departures.append(_departures(world.robot, way, stretch))
        between_stretches = rows[done + 1 : first][is_given[done + 1 : first]]
        parts += [between_stretches, way[1:] if first == done else way]
        done = last
    parts.append(rows[done + 1 :][is_given[done + 1 :]])

    route = np.vstack(parts)
    proof = world.prover.route(route, clearance=kept)
    if not proof.proven:
        raise NotFoundError(f"the motion cannot be mended: {proof.unproven[0]}")
    return Mended(path_of(world.robot, route, proof), len(departures) - 1, *np.max(departures, axis=0).tolist())


def _straightened(curve: Splines, world: World) -> Matrix:
    """Return waypoints, shape (k, dof), whose straight motions stay near a curve."""
    h = np.diff(curve.times)
    chords = chords_of(h, curve.greatest_accelerations() @ world.weights, CHORDS)
    return np.vstack([curve.at(chords.pieces, chords.shares), curve.end])


def _way_around(world: World, stretch: Matrix, clearance: float, seconds: float, seed: int) -> Matrix:
    """Return proven waypoints between the ends of a stretch, shape (k, dof), as near to it as one is found.

    Raises:
        NotFoundError: If no way is found.
    """
    ends = stretch[[0, -1]]
    rng = np.random.default_rng(seed)
    detours = (with_detours(world, rows, clearance=clearance, rng=rng) for rows in (ends, stretch))
    ways = [rows for rows in detours if rows is not None]

    reason = ""
    for k in range(SEEDS):
        try:
            found = plan(Problem(world, *ends), seconds=seconds, seed=seed + k, clearance=clearance or None)
        except InputError as error:  # the clearance is too large for the ends, or these are not free
            reason = str(error)
            break
        reason = found.reason
        if found.path is not None and np.allclose(found.path.end, ends[1]):
            ways.append(np.asarray(found.path.waypoints))

    proven = [rows for rows in ways if world.prover.route(rows, clearance=clearance).proven]
    if not proven:
        raise NotFoundError(f"the motion cannot be mended: no way around: {reason or 'none is proven'}")
    pulled = [_pulled(world, rows, stretch, clearance) for rows in proven]
    return min(pulled, key=lambda rows: _departures(world.robot, rows, stretch)[0])


def _pulled(world: World, way: Matrix, stretch: Matrix, clearance: float) -> Matrix:
    """Pull a proven way towards a stretch with the same ends; return its waypoints, shape (k, dof)."""
    rows = subdivided(way, part_counts(way, SHORT))[0]
    aims = _at(stretch, _shares_along(rows))
    shares = np.array(PULLS)[:, None, None]
    inner = np.arange(1, len(rows) - 1)

    for _ in range(MOST_SWEEPS):
        largest = 0.0
        for chosen in (inner[::2], inner[1::2]):  # neighbours of those that move stay
            tried = (1.0 - shares) * rows[chosen] + shares * aims[chosen]  # shape (pulls, chosen, dof)
            flat = world.robot.onto_limits(tried.reshape(-1, rows.shape[1]))
            before, after = (np.tile(rows[chosen + side], (len(PULLS), 1)) for side in (-1, 1))
            free = world.prover.proven(before, flat, clearance=clearance)
            free[free] = world.prover.proven(flat[free], after[free], clearance=clearance)

            # The largest pull of each that is proven.
            proven = free.reshape(len(PULLS), -1)
            moved = chosen[proven.any(axis=0)]
            new = flat.reshape(tried.shape)[proven.argmax(axis=0), np.arange(len(chosen))][proven.any(axis=0)]
            largest = max(largest, np.linalg.norm(new - rows[moved], axis=1).max(initial=0.0))
            rows[moved] = new
        if largest < STILL:
            break
    return _thinned(world, rows, clearance)


def _thinned(world: World, rows: Matrix, clearance: float) -> Matrix:
    """Leave out waypoints of a proven way, shape (k, dof), that lie near the way without them if that is proven."""
    kept = [0]
    while kept[-1] < len(rows) - 1:
        begin = kept[-1]
        end = begin + 2
        while end < len(rows) and _farthest(rows[begin + 1 : end], rows[[begin, end]]) < THIN:
            end += 1
        ends = np.arange(begin + 1, end)
        free = world.prover.proven(np.repeat(rows[[begin]], len(ends), axis=0), rows[ends], clearance=clearance)
        free[0] = True
        kept.append(int(ends[free][-1]))
    return rows[kept]


def _shares_along(rows: Matrix) -> Vector:
    """Return how far along a way its waypoints are, from 0 to 1, shape (k,)."""
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(rows, axis=0), axis=1)))
    return np.asarray(lengths / max(lengths[-1], 1e-300))


def _at(rows: Matrix, shares: Vector) -> Matrix:
    """Return the configurations on a way at shares of its length, shape (m, dof)."""
    along = _shares_along(rows)
    return np.stack([np.interp(shares, along, column) for column in rows.T], axis=1)


def _departures(robot: Robot, way: Matrix, stretch: Matrix) -> tuple[float, float]:
    """Return how far the configurations and the tip on a way are from those on a stretch, at most [rad or m, and m]."""
    dense, near = (subdivided(rows, part_counts(rows, FINE))[0] for rows in (way, stretch))
    tips = (poses(robot, rows)[:, :3, 3] for rows in (dense, near))
    return _farthest(dense, near), _farthest(*tips)


def _farthest(rows: Matrix, others: Matrix) -> float:
    """Return the largest distance of one of some rows from the polygon through others."""
    if len(others) == 1:
        return float(np.linalg.norm(rows - others[0], axis=1).max())
    begins = others[:-1]
    edges = np.diff(others, axis=0)
    squares = np.maximum((edges**2).sum(axis=1), 1e-300)
    farthest = 0.0
    for row in rows:
        shares = np.clip(((row - begins) * edges).sum(axis=1) / squares, 0.0, 1.0)
        farthest = max(farthest, float(np.linalg.norm(begins + shares[:, None] * edges - row, axis=1).min()))
    return farthest

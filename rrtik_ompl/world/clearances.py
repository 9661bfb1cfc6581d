"""The clearance that a path keeps: what was asked for, or as much of a preference as its own ends have."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, not_negative
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.world_settings import FINEST_RESOLUTION
from rrtik_ompl.world.world import World, form_of

CLEARANCE = 1e-3  # [m] that is kept where nobody says
SPARE = 1e-3  # [m] that searches keep on top, but not more than twice: they look at points of a motion alone
HALVINGS = 10  # of what is kept, until it is given up
BISECTIONS = 30


class Clearances(NamedTuple):
    """What can be kept between given ends.

    Attributes:
        proven_clearance: To be proven of every motion, beside the margins [m].
        searched_clearance: To be kept by searches, which look at points of a motion alone [m].
    """

    proven_clearance: float
    searched_clearance: float


def clearances_between(world: World, ends: Matrix, clearance: float | None) -> Clearances | None:
    """What can be kept on the way between configurations, shape (k, dof); None if not even these are proven free.

    Args:
        world: The world.
        ends: Where a path begins and ends.
        clearance: Wanted [m]; None for a millimetre, or less if the ends have less, but not less than the world keeps.
    """
    for clearances in _candidates(world, clearance):
        if world.prover.proven(ends, ends, clearance=clearances.searched_clearance).all():
            return clearances
    return None


def clearances_of_pairs(world: World, ends: NDArray[np.float64], clearance: float | None) -> list[Clearances | None]:
    """:func:`clearances_between` for several pairs of configurations, shape (m, 2, dof), in a few calls."""
    found: list[Clearances | None] = [None] * len(ends)
    undecided = np.arange(len(ends))
    for clearances in _candidates(world, clearance):
        if len(undecided) == 0:
            break
        rows = ends[undecided].reshape(-1, ends.shape[2])
        proven = world.prover.proven(rows, rows, clearance=clearances.searched_clearance).reshape(-1, 2).all(axis=1)
        for k in undecided[proven].tolist():
            found[k] = clearances
        undecided = undecided[~proven]

    return found


def _candidates(world: World, clearance: float | None) -> Iterator[Clearances]:
    """What may be kept, the most first."""
    least_clearance = world.settings.required_clearance
    wanted_clearance = max(CLEARANCE if clearance is None else clearance, least_clearance)
    halved = (wanted_clearance * 0.5**k for k in range(HALVINGS))
    smaller = (half for half in halved if half > least_clearance)
    for searched in chain((wanted_clearance + min(wanted_clearance, SPARE),), smaller, (least_clearance,)):
        yield Clearances(min(wanted_clearance, searched), searched)


def possible_clearance(world: World, clearance: float | None, rows: Matrix) -> float | None:
    """What is asked for [m], or as much of it as the ends of a route, shape (k, dof), have; None stays None."""
    if clearance is None:
        return None
    clearances = clearances_between(world, rows[[0, -1]], clearance)
    return 0.0 if clearances is None else clearances.proven_clearance


def keeping(world: World, clearance: float, *, proven: float | None = None) -> World:
    """Return the same world for searches that keep a distance: what it keeps itself, or more.

    Args:
        world: The world, which may keep a clearance of its own.
        clearance: That motions keep in steps at least [m].
        proven: That they are proven to keep at least [m]; None if nothing needs be proven that the world does not ask.
    """
    settings = world.settings
    inflation = max(clearance - settings.clearance, settings.inflation)
    if proven is None:
        return form_of(world, inflation=inflation)
    return form_of(world, inflation=inflation, proving=max(proven, settings.proving or 0.0))


def search_form(world: World, clearances: Clearances) -> World:
    """Return the same world for searches: motions keep more than what is to be kept, at points that lie close enough.

    No point of the arm moves between two of them farther than twice what searches keep beyond what is to be
    proven, so that what is thin is not stepped over: in between, too, obstacles are that far away [16].
    """
    with_clearance = keeping(world, clearances.searched_clearance)
    step = 2.0 * (clearances.searched_clearance - clearances.proven_clearance)
    if FINEST_RESOLUTION <= step < world.motion_resolution:
        return form_of(with_clearance, motion_resolution=step)
    return with_clearance


def check_clearance(world: World, clearance: float | None, ends: dict[str, Matrix]) -> None:
    """Refuse a clearance that a start or a goal cannot keep.

    Args:
        world: The world.
        clearance: Wanted [m]; None is never refused.
        ends: Configurations, shape (dof,) each, by what they are.

    Raises:
        InputError: It names the pair of bodies and what is possible.
    """
    if clearance is None:
        return

    wanted_clearance = not_negative(clearance, "clearance")
    for what, q in ends.items():
        gap = next(iter(world.prover.route(q[None], clearance=wanted_clearance).unproven), None)
        if gap is not None and world.prover.proven(q[None], q[None], clearance=world.settings.required_clearance)[0]:
            largest = 1e3 * _largest_clearance(world, q, wanted_clearance)
            pair = f"'{gap.first}' and '{gap.second}'"
            raise InputError(
                f"clearance: {what} cannot keep {1e3 * wanted_clearance:g} mm: {pair}; at most {largest:.3f} mm here"
            )


def check_route_clearance(world: World, clearance: float | None, rows: Matrix) -> None:
    """Refuse a clearance that an end of a route, shape (k, dof), cannot keep; see :func:`check_clearance`."""
    check_clearance(world, clearance, {"the start": rows[0], "the end of the path": rows[-1]})


def provable_clearances(world: World, rows: Matrix, clearance: float | None) -> Iterator[float]:
    """The clearances that a route, shape (k, dof), is itself proven to keep: what is wanted, what the world keeps [m].

    Args:
        world: The world.
        rows: The route.
        clearance: Wanted [m]; None for a millimetre, or less if the ends have less, but not less than the world keeps.
    """
    clearances = clearances_between(world, rows[[0, -1]], clearance)
    if clearances is None:
        return
    for candidate in sorted({clearances.proven_clearance, world.settings.required_clearance}, reverse=True):
        if world.prover.route(rows, clearance=candidate).proven:
            yield candidate


def proved(path: JointPath, world: World, *, clearance: float | None = None, seconds: float | None = None) -> JointPath:
    """As :meth:`rrtik_ompl.JointPath.proved`, of a path of the world's robot."""
    required_clearance = world.settings.required_clearance if clearance is None else clearance
    return path.with_proof(world.prover.route(path.waypoints, clearance=required_clearance, seconds=seconds))


def proved_as_clear(path: JointPath, world: World, clearance: float) -> JointPath:
    """A path with a proof that it keeps a clearance [m], or as much as a millimetre of it, or that it is free."""
    proved_path = proved(path, world, clearance=clearance)
    least_clearance = world.settings.required_clearance
    fallbacks = {max(min(clearance, CLEARANCE), least_clearance), least_clearance} - {clearance}
    for smaller_clearance in sorted(fallbacks, reverse=True):
        if proved_path.proven:
            break
        proved_path = proved(path, world, clearance=smaller_clearance)
    return proved_path


def _largest_clearance(world: World, q: Matrix, refused: float) -> float:
    """Return the largest clearance that a configuration keeps [m], below one that it does not."""
    low = 0.0
    high = refused
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        proven = world.prover.proven(q[None], q[None], clearance=middle).all()
        low, high = (middle, high) if proven else (low, middle)
    return low

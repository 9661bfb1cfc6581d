"""Cuts from one place of a route straight to another. Source: [1, ch. 5.3, methods 1 and 2].

The sequential cut goes from each waypoint to the last one that can be reached, the random cut from one random place to
another. If the world has kernels, the whole loop of random cuts runs in a kernel
(:mod:`rrtik_ompl.kernels.search.shortcut`): first without the shortcuts that the kernels cannot decide, as checking
these takes a hundred times as long, then with them.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.search.motions.motion_table import NO_LIMIT
from rrtik_ompl.kernels.search.shortcut import ShortcutSearch
from rrtik_ompl.model.transitions import without_repeats
from rrtik_ompl.planning.shortening.task import Task
from rrtik_ompl.world.motion_queries import decider

TRIES = 400  # tries if neither time nor checks are limited
PATIENCE = 2000  # tries in a row without a gain that end the search
TRIES_PER_CALL = 64  # tries of the kernel between two calls of `stop`
# Additions of "shortcut" to the published random cut, see the kernel.
WAYPOINTS = 0.5  # share of ends that are waypoints
PULLS = 0.3  # share of tries that pull a waypoint


def sequential_cut(route: Matrix, task: Task) -> Matrix:
    """Cut a route, shape (k, n), from its start; deterministic.

    From each waypoint the later ones are tried from the last one back to the next one, which needs no check.
    """
    cut_route = [route[:1]]
    pivot = 0
    last = len(route) - 1
    while pivot < last:
        found = task.first_link(route[pivot], route[last : pivot + 1 : -1])
        if found is None:
            cut_route.append(route[pivot + 1 : pivot + 2])
            pivot += 1
        else:
            cut_route.append(found[1])
            pivot = last - found[0]
        task.report(np.vstack([*cut_route, route[pivot + 1 :]]))
    return without_repeats(np.vstack(cut_route))


def random_cut(route: Matrix, task: Task, *, tries: int = TRIES) -> Matrix:
    """Apply the published random cut to a route, shape (k, n): both ends of a cut are uniform in arc length."""
    return _cut(route, task, tries, share=0.0, pull=0.0)


def shortcut(route: Matrix, task: Task, *, tries: int = TRIES) -> Matrix:
    """Apply random cuts whose ends may be waypoints, too, and (in a kernel) pulls of single waypoints."""
    return _cut(route, task, tries, share=WAYPOINTS, pull=PULLS)


def _cut(route: Matrix, task: Task, tries: int, *, share: float, pull: float) -> Matrix:
    """Apply random cuts to a route, in kernels if the world has them.

    Args:
        route: Shape (k, n).
        task: Checks motions.
        tries: Limit of the tries if the task has none.
        share: Share of the ends of cuts that are waypoints.
        pull: Share of the tries that pull a waypoint, in kernels only.
    """
    limit = NO_LIMIT if task.bounded else tries
    if task.kernel_world is None or len(route) < 3:
        return cut_in_python(route, task, limit, share)

    for asking in (False, True):
        search = kernel_search(route, task, seed=2 * task.seed + asking, share=share, pull=pull, asking=asking)
        run(search, task, limit)
        route = task.better(route, without_repeats(search.waypoints))
    return route


def kernel_search(route: Matrix, task: Task, *, seed: int, share: float, pull: float, asking: bool) -> ShortcutSearch:
    """Return a search in the kernels of a task's world, which must have them.

    With ``asking``, the world decides what the kernels cannot, if it can decide more.

    Args:
        route: Shape (k, n).
        task: Its world has kernels.
        seed: Seed of the random cuts.
        share: Share of the ends of cuts that are waypoints.
        pull: Share of the tries that pull a waypoint.
        asking: Whether to ask the world where the kernels cannot decide.
    """
    world = task.kernel_world
    assert world is not None
    return ShortcutSearch(
        world.motions,
        route,
        seed=seed,
        share=share,
        pull=pull,
        asking=asking and decider(world, task.free_batch) is not None,
    )


def run(search: ShortcutSearch, task: Task, tries: int, patience: int = PATIENCE) -> None:
    """Run a search until its tries, its patience or the time is up, and add its tries to the task's count."""
    before = task.asked
    listened = task.listened

    def stop() -> bool:
        task.asked = before + search.tries
        if listened:
            task.report(search.waypoints)
        return task.expired()

    tries = int(min(tries, task.checks_left))
    search.run(tries, patience=patience, ask=task.free_batch, stop=stop, chunk=TRIES_PER_CALL)
    task.asked = before + search.tries


def cut_in_python(route: Matrix, task: Task, tries: int = TRIES, share: float = 0.0) -> Matrix:
    """Apply random cuts without kernels; arguments as of the cuts above."""
    rng = np.random.default_rng(task.seed)
    failures = 0
    route = without_repeats(route)
    for _ in range(tries):
        if task.expired() or failures >= PATIENCE or len(route) < 3:
            break
        shorter = _one_cut(route, task, rng, share)
        failures = failures + 1 if shorter is None else 0
        if shorter is not None:
            route = shorter
            task.report(route)
    return route


def _one_cut(route: Matrix, task: Task, rng: np.random.Generator, share: float) -> Matrix | None:
    """Return the route after one random cut, or None if that gains nothing or is not free.

    Args:
        route: Shape (k, n).
        task: Checks motions.
        rng: Draws the places.
        share: Probability that an end of the cut is a waypoint.
    """
    places = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(route, axis=0), axis=1)))
    first, second = sorted(_place(places, rng, share) for _ in range(2))
    first_edge = _edge_at(places, first)
    second_edge = _edge_at(places, second)
    if first_edge == second_edge:
        return None

    a = _point(route, places, first_edge, first)
    b = _point(route, places, second_edge, second)
    cut = np.vstack([a[None], task.moves(a, b)])
    new = without_repeats(np.vstack([route[: first_edge + 1], cut, route[second_edge + 1 :]]))
    if task.rank(new) >= task.rank(route) or not task.free_batch(cut[:-1], cut[1:]).all():
        return None
    return new if task.confirmed(new, route) else None


def _edge_at(places: Vector, place: float) -> int:
    """Return the index of the edge on which a place is.

    Args:
        places: Arc length of each waypoint from the start, shape (k,).
        place: Arc length of the place.
    """
    return min(int(np.searchsorted(places, place, side="right")) - 1, len(places) - 2)


def _place(places: Vector, rng: np.random.Generator, share: float) -> float:
    """Draw a random place on a route as arc length from the start; with a probability of ``share`` it is a waypoint."""
    at_waypoint = share > 0.0 and rng.random() < share
    return float(rng.choice(places)) if at_waypoint else float(rng.uniform(0.0, places[-1]))


def _point(route: Matrix, places: Vector, edge: int, place: float) -> Vector:
    """Return the configuration at a place on an edge, never outside the box between its ends."""
    share = (place - places[edge]) / (places[edge + 1] - places[edge])
    a = route[edge]
    b = route[edge + 1]
    point: Vector = np.clip((1.0 - share) * a + share * b, np.minimum(a, b), np.maximum(a, b))
    return point

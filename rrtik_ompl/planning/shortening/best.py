"""The method "auto": pull a few cut routes taut, then alternate random shortcuts and pulling.

A route with few bends is pulled taut in a few dozen checks, so every start is first cut to a handful of waypoints. Only
new bends can make a taut route shorter; random shortcuts make them. All limits count checks, not time.
"""

from __future__ import annotations

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.search.taut import layout
from rrtik_ompl.kernels.search.taut.tightening import Tightening
from rrtik_ompl.model.transitions import length_of, route_length
from rrtik_ompl.planning.moves.axis_cut import axis_cut_rounds
from rrtik_ompl.planning.shortening.cuts import PULLS, WAYPOINTS, kernel_search, random_cut, run, sequential_cut
from rrtik_ompl.planning.shortening.retraction import STEPS, retract
from rrtik_ompl.planning.shortening.task import Task
from rrtik_ompl.world.motion_queries import KernelWorld, has_kernels

STARTS = 3  # starts; random shortcuts lead to different homotopy classes of routes
START_TRIES = 20  # tries of random shortcuts for a start
START_CHECKS = 60  # limit of the motions checked to pull a start taut
ROUND_TRIES = 60  # tries of random shortcuts in a round
ROUND_CHECKS = 60  # limit of the motions checked to pull it taut
ROUNDS_WITHOUT_LIMIT = 4  # rounds if neither time nor checks are limited
LEAST_GAIN = 1e-4  # share of the length that counts as a gain
IDLE_ROUNDS = 6  # rounds in a row without a gain that end the work
FINEST = 16  # factor by which the last retraction is finer if there are no kernels


def best_in_time(route: Matrix, task: Task) -> Matrix:
    """Shorten a route, shape (k, n), by several starts and rounds until time, checks or patience run out."""
    if task.one_joint:
        return task.better(route, axis_cut_rounds(route, task.free_batch, budget=task.rest))
    world = task.kernel_world
    if len(route) < 3 or world is None or not has_kernels(world, layout.KERNELS):
        return _without_kernels(route, task)

    best = _best_start(route, task, world)
    rounds = rounds_without_gain = 0
    while not task.expired() and rounds_without_gain < IDLE_ROUNDS and (task.bounded or rounds < ROUNDS_WITHOUT_LIMIT):
        seed = STARTS + rounds
        found = _taut(_cut(best, task, seed, ROUND_TRIES, PULLS), task, world, seed, ROUND_CHECKS)
        rounds += 1
        rounds_without_gain = rounds_without_gain + 1 if length_of(found) > (1.0 - LEAST_GAIN) * length_of(best) else 0
        best = task.better(best, found)
        task.report(best)
    return best


def _best_start(route: Matrix, task: Task, world: KernelWorld) -> Matrix:
    """Return the best of several starts, each pulled taut: the sequential cut, and random shortcuts."""
    first = sequential_cut(route, task)
    best = task.better(route, _taut(first, task, world, 0, ROUND_CHECKS))
    task.report(best)
    for start in range(1, STARTS):
        if task.expired():
            break
        best = task.better(best, _taut(_cut(route, task, start, START_TRIES, 0.0), task, world, start, START_CHECKS))
        task.report(best)
    return best


def _cut(route: Matrix, task: Task, seed: int, tries: int, pull: float) -> Matrix:
    """Return the route after some random shortcuts."""
    search = kernel_search(route, task, seed=_seed(task, seed), share=WAYPOINTS, pull=pull, asking=False)
    run(search, task, tries)
    return search.waypoints


def _taut(route: Matrix, task: Task, world: KernelWorld, seed: int, checks: int) -> Matrix:
    """Pull a route taut with at most ``checks`` checked motions."""
    work = Tightening(world.motions, route, seed=_seed(task, seed))
    before = task.asked

    def stop() -> bool:
        task.asked = before + work.checks
        return task.expired()

    work.run(int(min(checks, task.checks_left)), stop=stop)
    task.asked = before + work.checks
    return work.waypoints


def _seed(task: Task, number: int) -> int:
    return 1000 * task.seed + number


def _without_kernels(route: Matrix, task: Task) -> Matrix:
    """Shorten without kernels: retract the better one of a retracted sequential cut and a random cut in small steps."""
    cut = sequential_cut(route, task)
    found = task.better(cut, retract(cut, task))
    found = task.better(found, random_cut(route, task))
    return task.better(found, retract(found, task, step=route_length(found) / (STEPS * FINEST)))

"""The best that several methods find together within the time given."""

from __future__ import annotations

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.moves.axis_cut_rounds import axis_cut_rounds
from rrtik_ompl.shortening.random_cut import PULLS, WAYPOINTS, kernel_search, random_cut, run
from rrtik_ompl.shortening.retraction import STEPS, retract
from rrtik_ompl.shortening.sequential import sequential_cut
from rrtik_ompl.shortening.task import Task
from rrtik_ompl.transitions import route_length

STARTS = 8  # searches from the input: random shortcuts end in different classes of routes
QUICK_TRIES = 1000  # of a search that leaves out what the kernels cannot decide
TRIES = 300  # of one that has those checked by the world
MAX_ROUNDS_WITHOUT_DEADLINE = 3  # of improvement where there is no end to the time, at most
LEAST_GAIN = 1e-4  # of the length, or a round gained nothing
MOST_HALVINGS = 4  # of the steps of retraction
IDLE_ROUNDS = 3  # without gain end the work


def best_in_time(route: Matrix, task: Task) -> Matrix:
    """Shorten a route, shape (k, n), by whatever helps: shortcuts from several seeds, then retraction and shortcuts."""
    if task.one_joint:
        return task.better(route, axis_cut_rounds(route, task.free_batch, seed=task.seed, stop=task.expired))
    if task.kernel_world is None or len(route) < 3:
        return _without_kernels(route, task)
    best = _several_starts(route, task)
    rounds = idle = 0
    while not task.expired() and idle < IDLE_ROUNDS and (task.bounded or rounds < MAX_ROUNDS_WITHOUT_DEADLINE):
        before = route_length(best)
        best = _improved(best, task, rounds)
        rounds += 1
        idle = idle + 1 if route_length(best) > (1.0 - LEAST_GAIN) * before else 0
    return best


def _several_starts(route: Matrix, task: Task) -> Matrix:
    """The best route that shortcuts from several seeds lead to, undecided ones left out."""
    best = route
    for start in range(STARTS):
        if task.expired():
            break
        best = task.better(best, _searched(route, task, seed=start, asking=False))
        task.report(best)
    return best


def _improved(route: Matrix, task: Task, number: int) -> Matrix:
    """One round: quick shortcuts, retraction in steps that get smaller, then undecided shortcuts too."""
    found = _searched(route, task, seed=STARTS + number, asking=False)
    found = task.better(found, retract(found, task, step=route_length(found) / (STEPS << min(number, MOST_HALVINGS))))
    found = _searched(found, task, seed=STARTS + number, asking=True)
    task.report(found)
    return found


def _searched(route: Matrix, task: Task, *, seed: int, asking: bool) -> Matrix:
    options = {"share": WAYPOINTS, "pull": PULLS}
    search = kernel_search(route, task, seed=1000 * task.seed + seed, asking=asking, **options)
    run(search, task, TRIES if asking else QUICK_TRIES)
    return task.better(route, search.waypoints)


def _without_kernels(route: Matrix, task: Task) -> Matrix:
    """Retraction of a sequential cut or a random cut, whichever is better, and retraction of that in small steps."""
    cut = sequential_cut(route, task)
    found = task.better(cut, retract(cut, task))
    found = task.better(found, random_cut(route, task))
    return task.better(found, retract(found, task, step=route_length(found) / (STEPS << MOST_HALVINGS)))

"""The baseline of MB-RRT [3]: an RRT in the space of joint angles whose every vertex is tried at the goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.mb_rrt.growth import PASSES
from rrtik_ompl.ik.mb_rrt.links import Links, joints_to_chain
from rrtik_ompl.ik.mb_rrt.run import TreeSearch, first_hit

STEP = np.radians(3.0)  # "3 units" of the published demonstration
BLOCK = 500  # vertices between two tests of the goal


def grow_in_joint_space(
    links: Links,
    goal: ArrayLike,
    *,
    tolerance: float,
    rng: np.random.Generator,
    passes: int = PASSES,
    stop: bool = True,
    step: float = STEP,
) -> TreeSearch:
    """Grow a classical RRT in [-pi, pi]^n from the stretched arm; uniform samples, no bias, no wrapping round.

    Args:
        links: A planar chain.
        goal: Shape (2,).
        tolerance: Unit of the lengths; a miss must be smaller.
        rng: Random numbers.
        passes: Limit; one vertex is one published iteration.
        stop: Whether to stop at the first success.
        step: Longest edge [rad, Euclidean].

    Raises:
        InputError: If the goal is out of reach, the chain is not planar or the step not above 0.
    """
    target = links.reachable(goal)
    if links.dimension != 2 or not step > 0.0:
        raise InputError("the joint-space tree needs a planar chain and a step greater than 0")
    limit = float(finite_array(tolerance, (), "tolerance"))

    Q = np.zeros((passes + 1, links.count))
    done = 0
    solved = 0
    chains = np.zeros((passes, links.count + 1, 2))
    misses = np.zeros(passes)

    while done < passes and not (stop and solved):
        fresh = slice(done, min(done + BLOCK, passes))
        _extend(Q, fresh.start + 1, fresh.stop + 1, step, rng)
        chains[fresh] = joints_to_chain(links.lengths, Q[fresh.start + 1 : fresh.stop + 1])
        misses[fresh] = np.linalg.norm(chains[fresh, -1] - target, axis=1)
        done = fresh.stop
        solved = first_hit(misses[:done], limit)
    levels = (np.zeros((1, 2)), *(chains[:done, i] for i in range(1, links.count + 1)))
    parents = (np.zeros(done, dtype=np.int64), *(np.arange(done),) * (links.count - 1))
    run = TreeSearch(links, target, levels, parents, misses[:done], solved)
    return run.until(solved) if stop and solved else run


def _extend(Q: Matrix, begin: int, end: int, step: float, rng: np.random.Generator) -> None:
    """Add the vertices begin..end-1 to the rows of a tree."""
    samples = rng.uniform(-np.pi, np.pi, (end - begin, Q.shape[1]))
    squares = np.einsum("ij,ij->i", Q[:end], Q[:end])
    for row, sample in zip(range(begin, end), samples, strict=True):
        near = Q[np.argmin(squares[:row] - 2.0 * (Q[:row] @ sample))]
        towards = sample - near
        Q[row] = near + towards * min(1.0, step / float(np.linalg.norm(towards)))
        squares[row] = Q[row] @ Q[row]

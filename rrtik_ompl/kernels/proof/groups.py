"""What proofs compare as one at first: bodies of one joint, and obstacles that stand near each other.

A ball and a box around all of them answer for many pairs at once, wherever an arm is far from a part of the scene, or a
gripper from the links that carry it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import TypeAlias

import numpy as np

from rrtik_ompl.kernels.tables.solid_tables import ConvexSolid
from rrtik_ompl.kernels.tables.z_order import z_order

MANY = 32  # obstacles, from which on neighbours among them are compared as one
BLOCK = 16  # so many neighbours, and so many blocks of neighbours

Members: TypeAlias = tuple[int, ...]  # numbers of bodies
Levels: TypeAlias = Sequence[Sequence[Members]]  # blocks of bodies, then blocks of BLOCK blocks, and so on
Parts: TypeAlias = Sequence[Sequence[ConvexSolid]]


def compared_as_one(
    joints: Sequence[int],
    paddings: Sequence[float],
    convex: Sequence[bool],
    pairs: Sequence[tuple[int, int]],
    common: Callable[[int, int], int],
    blocks: Callable[[Sequence[int]], Levels] | None,
) -> list[tuple[Members, Levels]]:
    """Bodies of one joint with one padding, each with blocks of bodies that none of them may touch.

    These stand still, or one joint carries them and, by way of others, the first ones. A body that is alone is listed
    beside many obstacles only.

    Args:
        joints: The joint that carries each body.
        paddings: The padding of each.
        convex: Whether all solids of each are convex.
        pairs: Those that must not touch.
        common: The last joint that carries both of two.
        blocks: Makes blocks of neighbours among many obstacles (``MANY``); None where each is one.
    """
    movers: dict[tuple[int, float, int], list[int]] = {}
    for i, j in pairs:
        base = common(joints[i], joints[j])
        mover, still = (i, j) if base == joints[j] else (j, i)
        if base == joints[still] != joints[mover] and convex[mover] and convex[still]:
            movers.setdefault((joints[mover], paddings[mover], still), []).append(mover)
    beside: dict[tuple[Members, int], list[int]] = {}
    for (_, _, still), members in movers.items():
        beside.setdefault((tuple(members), joints[still]), []).append(still)
    made = list[tuple[Members, Levels]]()
    for (together, base), stills in beside.items():
        if blocks is not None and base == 0 and len(stills) >= MANY:
            made.append((together, blocks(stills)))
        elif len(together) > 1:
            made.append((together, [[(still,) for still in stills]]))
    return made


def group_rows(
    groups: Sequence[tuple[Members, Levels]],
    joints: Sequence[int],
    ends: Sequence[int],
    sweeps: dict[tuple[Members, int], int],
    begin: int,
) -> tuple[list[tuple[int, ...]], dict[Members, int], list[int]]:
    """Pairs of several bodies, made of those that begin the table.

    Args:
        groups: Bodies of one joint, each with blocks of others.
        joints: The joint that carries each body.
        ends: The number of each body's solid, and how many there are.
        sweeps: Numbers of the sweeps; those of the groups are added.
        begin: The number of the first of these pairs.

    Returns:
        The pairs, the numbers of the solids around several bodies, and the numbers of those pairs that no other holds.
    """
    rows: list[tuple[int, ...]] = []
    together: dict[Members, int] = {}
    top: list[int] = []
    first = 0

    def solid(members: Members) -> int:
        return ends[members[0]] if len(members) == 1 else together.setdefault(members, ends[-1] + len(together))

    for members, levels in groups:
        base = joints[levels[0][0][0]]
        sweep = sweeps.setdefault((members, base), len(sweeps))
        held = range(first, first := first + len(members) * sum(map(len, levels[0])))  # pairs of bodies
        for number, level in enumerate(levels):
            own = range(begin + len(rows), begin + len(rows) + len(level))
            place = held.start
            for block in level:
                end = min(place + (BLOCK if number else len(members) * len(block)), held.stop)
                rows.append((solid(members), solid(block), base, sweep, -1, place, end, members[0], -1, block[0], -1))
                place = end
            held = own
        top += held
    return rows, together, top


def neighbours(parts: Parts, stills: Sequence[int]) -> Levels:
    """Neighbours in space, up to BLOCK of them at a time, and neighbours among these blocks."""
    order = z_order(np.array([parts[k][0].corners.mean(axis=0) for k in stills])).tolist()
    levels = [_joined([(stills[k],) for k in order])]
    while len(levels[-1]) > BLOCK:
        levels.append(_joined(levels[-1]))
    return levels


def _joined(blocks: Sequence[Members]) -> list[Members]:
    """One block in the place of every BLOCK."""
    return [tuple(chain.from_iterable(blocks[k : k + BLOCK])) for k in range(0, len(blocks), BLOCK)]

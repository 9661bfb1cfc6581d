"""OMPL's environments and the like of them: spaces of reals, what is free in them, and queries."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from ompl import base as ob

from rrtik_ompl.base.arrays import Mask, Matrix

SPHERES, HYPERCUBE_EDGE, CHAIN_LINKS = 30, 0.1, 10
WHITE = 127  # of 255, above which a pixel is free


@dataclass(frozen=True)
class Environment:
    """A space, what is free in it, and queries; ``resolution`` is the share of the extent between two looks."""

    name: str
    lower: float
    upper: float
    free: Callable[[ob.State], bool]
    queries: Matrix
    resolution: float = 0.01
    range: float | None = None


def grid(folder: Path) -> Environment:
    """A grid of cells, free where there is a 0; from the middle of one corner's cell to that of the other one."""
    lines = (folder / "env1.txt").read_text().splitlines()
    cells: Mask = np.array([[int(word) for word in line.split()] for line in lines[4:] if line.split()]) == 0
    size = len(cells)

    def free(state: ob.State) -> bool:
        return bool(cells[min(int(state[0]), size - 1), min(int(state[1]), size - 1)])

    return Environment("grid (env1)", 0.0, float(size), free, np.array([[[0.5, 0.5], [size - 0.5, size - 0.5]]]))


def circles(folder: Path) -> Environment:
    """Discs in a plane; the first ten queries of OMPL's file whose ends are free."""
    rows = [line.split() for line in (folder / "circle_obstacles.txt").read_text().splitlines()]
    discs = np.array([[float(word) for word in row[1:4]] for row in rows if len(row) == 4 and row[0].isdigit()])
    lines = [line.split() for line in (folder / "circle_queries.txt").read_text().splitlines() if line.split()]
    ends = np.array([[float(word) for word in row[-2:]] for row in lines])
    square = discs[:, 2] ** 2

    def free(state: ob.State) -> bool:
        return bool((((discs[:, 0] - state[0]) ** 2 + (discs[:, 1] - state[1]) ** 2) > square).all())

    upper = float(np.ceil(max(ends.max(), (discs[:, :2] + discs[:, 2:]).max())))
    away = np.linalg.norm(ends[:, None] - discs[None, :, :2], axis=2)
    usable = (away > discs[:, 2]).all(axis=1).reshape(-1, 2).all(axis=1)
    return Environment("circles", 0.0, upper, free, ends.reshape(-1, 2, 2)[usable][:10])


def maze(folder: Path) -> Environment:
    """The picture of OMPL's Point2DPlanning: white is free."""
    data = (folder / "normal.ppm").read_bytes()
    head, rest = b"", data
    while len([line for line in head.split(b"\n") if line and not line.startswith(b"#")]) < 3:
        line, _, rest = rest.partition(b"\n")
        head += line + b"\n"
    width, height = (int(word) for word in [n for n in head.split(b"\n") if not n.startswith(b"#")][1].split())
    picture = np.frombuffer(rest[: 3 * width * height], dtype=np.uint8).reshape(height, width, 3)
    white: Mask = np.array((picture > WHITE).all(axis=2), dtype=bool)

    def free(state: ob.State) -> bool:
        return bool(white[min(int(state[1]), height - 1), min(int(state[0]), width - 1)])

    ends = np.array([[[44.0, 44.0], [446.0, 404.0]]])
    return Environment("maze picture", 0.0, float(width), free, ends, 1.0 / (np.sqrt(2.0) * width))


def spheres(dof: int) -> Environment:
    """Balls at random places of a box from -1 to 1, from one corner to the opposite one."""
    rng = np.random.default_rng(dof)
    middles, ends = rng.uniform(-1.0, 1.0, (SPHERES, dof)), np.stack([np.full(dof, -0.9), np.full(dof, 0.9)])
    radii = np.minimum(0.4, 0.9 * np.linalg.norm(ends[:, None] - middles, axis=2).min(axis=0))
    square = radii**2

    def free(state: ob.State) -> bool:
        return bool((((middles - state[0:dof]) ** 2).sum(axis=1) > square).all())

    return Environment(f"{SPHERES} spheres, {dof} coordinates", -1.0, 1.0, free, ends[None], 0.005)


def hypercube(dof: int) -> Environment:
    """OMPL's HypercubeBenchmark: along edges of a cube, from one corner to the opposite one."""

    def free(state: ob.State) -> bool:
        beyond = False
        for k in range(dof - 1, -1, -1):
            if not beyond:
                beyond = state[k] > HYPERCUBE_EDGE
            elif state[k] < 1.0 - HYPERCUBE_EDGE:
                return False
        return True

    ends = np.stack([np.zeros(dof), np.ones(dof)])
    return Environment(f"hypercube, {dof} coordinates", 0.0, 1.0, free, ends[None], 0.001, 0.05)


def chain(links: int) -> Environment:
    """Like OMPL's KinematicChainBenchmark: a chain of length 1 in a plane that may not cross itself, nor a wall.

    It is unrolled from half a circle to a straight line that lies behind its base.
    """
    bends = np.full(links, np.pi / links)
    bends[0] = 0.0
    straight = np.zeros(links)
    straight[0] = np.pi - 1e-3
    walls = np.array([[[0.5, -0.2], [0.5, -2.0]], [[-0.6, 0.1], [-0.6, 2.0]]])

    def free(state: ob.State) -> bool:
        turned = np.cumsum(state[0:links])
        places = np.zeros((links + 1, 2))
        places[1:] = np.cumsum(np.stack([np.cos(turned), np.sin(turned)], axis=1), axis=0) / links
        pieces = np.stack([places[:-1], places[1:]], axis=1)
        apart = np.abs(np.subtract.outer(np.arange(links), np.arange(links))) > 1
        return not (crossing(pieces, pieces) & apart).any() and not crossing(pieces, walls).any()

    return Environment(f"chain, {links} links", -np.pi, np.pi, free, np.stack([bends, straight])[None], 0.005)


def crossing(A: Matrix, B: Matrix) -> Mask:
    """Which segments cross, shapes (k, 2, 2) and (m, 2, 2) to (k, m)."""
    return _sides(A, B) & _sides(B, A).T


def _sides(A: Matrix, B: Matrix) -> Mask:
    """Whether the ends of segments of B lie on two sides of the lines of A, shape (k, m)."""
    along = (A[:, 1] - A[:, 0])[:, None, None]
    away = B[None] - A[:, :1, None].reshape(-1, 1, 1, 2)
    turns = along[..., 0] * away[..., 1] - along[..., 1] * away[..., 0]
    found: Mask = turns.prod(axis=2) < 0.0
    return found


def environments(folder: Path) -> Iterator[Environment]:
    """All of them."""
    yield from (grid(folder), circles(folder), maze(folder))
    yield from (spheres(dof) for dof in (3, 6, 20))
    yield from (hypercube(dof) for dof in (3, 6))
    yield chain(CHAIN_LINKS)

"""A map of reach: a value for every cell of a grid, its slices, and its files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, frozen, positive, whole_number
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.files.named_arrays import NamedArrays
from rrtik_ompl.files.text import known_ending, write_bytes, write_text

FORMATS = (".npz", ".csv")

Grid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ReachMap:
    """A value for every cell of a grid in the world.

    Attributes:
        robot: Name of the arm.
        measure: What the values are: one of ``MEASURES``.
        corner: Low corner of the first cell, shape (3,) [m].
        size: Side of a cell [m].
        values: Shape (x, y, z), 0 where no sample came.
        samples: Postures that counted.
        base: Where the arm's base is, shape (3,) [m].

    Example:
        >>> reach = rrtik.reach_map(rrtik.load_robot("planar3"), samples=2000, seed=1)
        >>> reach.measure, reach.values.ndim
        ('orientations', 3)
    """

    robot: str
    measure: str
    corner: Vector
    size: float
    values: Grid
    samples: int
    base: Vector

    __reduce__ = as_value
    __repr__ = in_one_line

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Cells in which a sample came, shape (x, y, z)."""
        is_inside: NDArray[np.bool_] = self.values > 0.0
        return is_inside

    @property
    def flat(self) -> bool:
        """Whether there is one layer of cells, as for a planar arm."""
        return bool(self.values.shape[2] == 1)

    @property
    def volume(self) -> float:
        """Of these cells [m3]; 0 of a flat map."""
        return 0.0 if self.flat else float(np.count_nonzero(self.reached)) * self.size**3

    @property
    def area(self) -> float:
        """Of these cells seen from above [m2]."""
        return float(np.count_nonzero(self.reached.any(axis=2))) * self.size**2

    @property
    def best(self) -> Vector:
        """Middle of the cell with the largest value, shape (3,) [m]."""
        place = np.unravel_index(int(np.argmax(self.values)), self.values.shape)
        middle: Vector = self.corner + self.size * (np.array(place) + 0.5)
        return middle

    def centres(self, axis: int) -> Vector:
        """Middles of the cells along an axis, shape (n,) [m]."""
        axis = whole_number(axis, "axis of a reachability map")
        at_most(axis, 2, "axis of a reachability map", "0 is x, 1 is y, 2 is z")
        middles: Vector = self.corner[axis] + self.size * (np.arange(self.values.shape[axis]) + 0.5)
        return middles

    def value(self, points: Matrix) -> Vector:
        """The values at points, shape (m, 3) [m]; 0 outside the grid. Shape (m,)."""
        places = np.floor((finite_array(points, (None, 3), "points") - self.corner) / self.size).astype(int)
        is_inside = ((places >= 0) & (places < self.values.shape)).all(axis=1)
        found = np.zeros(len(places))
        found[is_inside] = self.values[tuple(places[is_inside].T)]
        return found

    def slices(self) -> list[Slice]:
        """Two cuts: upright through the base along x, and level at the height where most cells are reached.

        The second alone if there is one layer of cells.
        """
        ahead = int(np.clip((self.base[1] - self.corner[1]) / self.size, 0, self.values.shape[1] - 1))
        level = int(np.argmax(self.reached.sum(axis=(0, 1))))
        height = self.centres(2)[level]
        x, y, z = (self.centres(k) for k in range(3))
        bx, by, bz = (float(value) for value in self.base)
        side = self.values[:, ahead].T
        top = self.values[:, :, level].T

        cuts = [
            Slice(f"side, y = {y[ahead]:.2f} m", "x [m]", "z [m]", x, z, side, base=(bx, bz)),
            Slice(f"top, z = {height:.2f} m", "x [m]", "y [m]", x, y, top, base=(bx, by)),
        ]
        return cuts[1:] if self.flat else cuts

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything as .npz, or one row per reached cell (its middle and value) as .csv, whole or not at all.

        Raises:
            InputError: If the ending is another one or the file cannot be written.
        """
        ending = known_ending(path, FORMATS, "map of reach")
        if ending == ".csv":
            places = np.argwhere(self.reached)
            rows = np.column_stack([self.corner + self.size * (places + 0.5), self.values[self.reached]])
            write_text(path, "\n".join([f"x,y,z,{self.measure}", *(",".join(f"{v:.6g}" for v in r) for r in rows), ""]))
            return

        data = BytesIO()
        scalars = {name: getattr(self, name) for name in ("robot", "measure", "size", "samples")}
        np.savez_compressed(data, corner=self.corner, values=self.values, base=self.base, **scalars)
        write_bytes(path, data.getvalue())


@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """A picture of values over a plane.

    Attributes:
        title: What is cut.
        across, up: Labels of the axes.
        x, y: Middles of the cells [m], shapes (n,) and (m,).
        values: Shape (m, n).
        boxes: Rectangles to draw: low x, low y, high x, high y.
        points: Places to mark, each x, y.
        base: Where the arm's base is in this plane.
        meanings: What values mean, for a legend, where they are no amounts; boxes are then a vehicle, points cameras.
    """

    title: str
    across: str
    up: str
    x: Vector
    y: Vector
    values: Grid
    boxes: tuple[tuple[float, float, float, float], ...] = ()
    points: tuple[tuple[float, float], ...] = ()
    base: tuple[float, float] = (0.0, 0.0)
    meanings: Mapping[float, str] = field(default_factory=dict)


def load_reach_map(path: str | os.PathLike[str]) -> ReachMap:
    """Read a map that was saved as .npz.

    Raises:
        InputError: If the file cannot be used.

    Example:
        >>> rrtik.reach_map(rrtik.load_robot("planar3"), samples=2000, seed=1).save("reach.npz")
        >>> rrtik.load_reach_map("reach.npz").robot
        'planar3'
    """
    if known_ending(path, FORMATS, "map of reach") != ".npz":
        raise InputError(f"{path}: only .npz holds a whole map; a .csv cannot be read back")
    data = NamedArrays(path)
    try:
        return ReachMap(
            robot=str(data["robot"]),
            measure=str(data["measure"]),
            corner=frozen(finite_array(data["corner"], (3,), "corner")),
            size=positive(data["size"], "size"),
            values=frozen(finite_array(data["values"], (None, None, None), "values")),
            samples=data.count("samples"),
            base=frozen(finite_array(data["base"], (3,), "base")),
        )
    except InputError as error:
        raise InputError(f"{path}: is no map of reach: {error}; make one with `rrtik reach ... --out`") from error

"""The occupied cells of an octree, as mapping programs produce it."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, bounded_array, frozen, positive
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.files.kinds import read
from rrtik_ompl.model.shapes.box_pile import BoxPile, few_enough


@dataclass(frozen=True, slots=True, eq=False)
class Octree(BoxPile):
    """A union of cubes along the axes of their frame.

    Attributes:
        centres: Centres of the cubes, shape (n, 3) [m].
        sides: Their full side lengths, shape (n,) [m].
        source: Path of the file it was read from, or "".
        scale: Metres per unit of that file; it is written back with the scene.

    Raises:
        InputError: If there are no cubes, or more than a scene can hold, a number is not finite, or a side is not
            positive.

    Example:
        >>> rrtik.Octree([[0.0, 0.0, 0.1], [0.4, 0.0, 0.3]], [0.2, 0.6])
        Octree(2 cubes of 0.2 to 0.6 m)
    """

    key = "octree"

    centres: Matrix
    sides: Vector
    source: str
    scale: float

    __reduce__ = as_value

    def __init__(self, centres: ArrayLike, sides: ArrayLike, *, source: str = "", scale: float = 1.0) -> None:
        require(source, str, "source of an octree")
        what = f"octree {source}" if source else "octree"
        rows = bounded_array(centres, (None, 3), f"{what}: centres")
        widths = np.asarray(sides)
        widths = bounded_array(np.broadcast_to(widths, len(rows)) if widths.ndim == 0 else sides, (len(rows),), what)

        if len(rows) == 0:
            raise InputError(f"{what}: none of its cells is occupied; leave the obstacle out")
        if not (widths > 0.0).all():
            raise InputError(f"{what}: sides must be greater than 0, got {widths.min():g}")
        few_enough(len(rows), what, "use PointCloud.load(file, radius).voxel(size), or a map of a coarser resolution")

        object.__setattr__(self, "centres", frozen(rows))
        object.__setattr__(self, "sides", frozen(widths))
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "scale", positive(scale, f"{what}: scale"))

    @staticmethod
    def load(file: str | os.PathLike[str], *, scale: float = 1.0) -> Octree:
        """Read a map of OctoMap, a ``.bt`` file: its occupied cells as cubes.

        Args:
            file: The file.
            scale: Metres per unit of the file.

        Raises:
            InputError: If the file cannot be read, is broken, or has no occupied cell or too many; one line.

        Example:
            >>> rooms = rrtik.Octree.load("rooms.bt")  # doctest: +SKIP
        """
        return read(Octree, file, scale=scale)

    def __repr__(self) -> str:
        return f"Octree({len(self.sides)} cubes of {self.sides.min():g} to {self.sides.max():g} m)"

    @property
    def boxes(self) -> tuple[Matrix, Matrix]:
        """Centres and full side lengths of the cubes [m], shape (n, 3) each."""
        return self.centres, np.repeat(self.sides[:, None], 3, axis=1)

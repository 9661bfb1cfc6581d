"""Maps of reach by forward kinematics of random configurations: where the tip can be, and which way it can point.

A map is a lower bound: more samples fill more of it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, finite_array, frozen, positive, seed_of, whole_number
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.files import notice
from rrtik_ompl.files.kinds import read
from rrtik_ompl.files.named_arrays import NamedArrays
from rrtik_ompl.files.text import known_ending, write_bytes, write_text
from rrtik_ompl.model.robot import Robot, jacobians, poses
from rrtik_ompl.world.world import World, check_world

SAMPLES = 200_000
BLOCK = 20_000  # number of configurations that are processed at once
TURNS = 16  # turns of the first joint for each sample; they turn the arm as one body and need no kinematics
CELLS = 18  # number of cells across the farthest reach, if no size is given
MAX_CELLS = 4_000_000  # 32 MB of values
MOST_SAMPLES = 1_000_000_000  # takes a processor some minutes
PROBE = 4096  # number of configurations that determine the size of the grid
BELOW = 1e-3  # The single layer of a planar arm ends this share of a cell above the arm, which is seen from above.
PROBE_MARGIN = 1.1  # ratio of the reach of the grid to the reach of the probe
FORMATS = (".npz", ".csv")
DIRECTIONS = 64  # number of directions; each has one bit of a 64-bit number
FINE = 16  # The nearest direction is looked up in a cube with 2 * FINE + 1 = 33 cells a side.
MANY_IN_NUMPY = 50_000  # samples that take up to a millisecond each to check in numpy
GOLDEN = np.pi * (3.0 - np.sqrt(5.0))  # [rad], the golden angle

Grid = NDArray[np.float64]


def reach_map(
    robot: Robot,
    *,
    measure: str = "orientations",
    cell: float | None = None,
    samples: int = SAMPLES,
    world: World | None = None,
    axis: str | None = None,
    seed: int | None = 0,
) -> ReachMap:
    """Map where an arm can bring its tip.

    Args:
        robot: The arm.
        measure: The value of a cell. ``orientations``: the share of 64 evenly spread directions (in the plane for
            planar arms) in which the tip's axis was seen to point. ``manipulability``: the largest product of the
            Jacobian's singular values that was seen, sqrt(det(J J^T)) for six or more joints [31], with metres and
            radians mixed. ``samples``: the number of samples.
        cell: Side of a cell [m]; about an 18th of the reach if None.
        samples: Number of configurations to draw. Without a world, and if the first joint turns the whole arm, each is
            counted in 16 turns of that joint.
        world: If given, only free configurations count. Its robot must be this one.
        axis: The axis of the tip's frame that points, for ``orientations``: "x", "y" or "z"; z if None, and x for
            planar arms.
        seed: Seed of the random numbers; None draws one.

    Raises:
        UnknownNameError: If there is no such measure.
        InputError: If an argument makes no sense, or the grid would be too large.

    Example:
        >>> reach = rrtik.ik.reach_map(rrtik.load_robot("planar3"), samples=2000, seed=1)
        >>> reach.measure, reach.values.ndim
        ('orientations', 3)
    """
    check_world(world, robot)
    if world is not None and world.fast is None and samples > MANY_IN_NUMPY:
        notice.warn_of_minutes(f"{samples} samples of a reachability map")
    measure = one_of(MEASURES, measure, "measure of reach")
    axis = ("x" if robot.planar else "z") if axis is None else axis
    if not isinstance(axis, str) or axis not in ("x", "y", "z"):
        raise InputError(f"axis must be x, y or z, got {axis!r:.80}")
    count = whole_number(samples, "samples", 1)
    at_most(count, MOST_SAMPLES, "samples")
    rng = np.random.default_rng(seed_of(seed))

    base = poses(robot, np.zeros((1, robot.dof)), robot.link_names[0])[0, :3, 3]
    corner, size, shape = _grid(robot, base, cell)
    counter = MEASURES[measure](int(np.prod(shape)), robot.planar)
    counted = 0

    for points, pointing, quality in _samples(robot, world, counter, "xyz".index(axis), count, rng):
        cells_of_points = np.floor((points - corner) / size).astype(int)
        in_grid = ((cells_of_points >= 0) & (cells_of_points < shape)).all(axis=1)
        cells = np.ravel_multi_index(tuple(cells_of_points[in_grid].T), shape)
        counter.add(cells, pointing[in_grid], quality[in_grid])
        counted += len(cells)

    return ReachMap(robot.name, measure, frozen(corner), size, frozen(counter.values.reshape(shape)), counted, base)


def _samples(
    robot: Robot, world: World | None, counter: Counter, axis: int, count: int, rng: np.random.Generator
) -> Iterator[tuple[Matrix, Matrix, Vector]]:
    """Yield samples in blocks: random configurations and, where possible, these turned about the first axis.

    Args:
        robot: The arm.
        world: If given, only its free configurations are taken, and they are not turned.
        counter: Computes the quality of a configuration.
        axis: Index of the tip's axis that points.
        count: Number of random configurations.
        rng: Source of random numbers.

    Yields:
        Positions of the tip [m], shape (m, 3), directions of its axis, shape (m, 3), and qualities, shape (m,).
    """
    low, high = robot.finite_range()
    turn = _first_turn(robot) if world is None else None
    for begin in range(0, count, BLOCK):
        Q = rng.uniform(low, high, (min(BLOCK, count - begin), robot.dof))
        if world is not None:
            Q = Q[world.valid_batch(Q)]

        tips = poses(robot, Q)
        quality = counter.quality(robot, Q)
        points = tips[:, :3, 3]
        pointing = tips[:, :3, axis]
        yield points, pointing, quality

        if turn is None:
            continue
        # Turning the whole arm about its first axis does not change the quality.
        for _ in range(TURNS - 1):
            angles = rng.uniform(low[0], high[0], len(Q))
            points, pointing = turn(points, pointing, angles - Q[:, 0])
            Q[:, 0] = angles
            yield points, pointing, quality


def _first_turn(robot: Robot) -> Callable[[Matrix, Matrix, Vector], tuple[Matrix, Matrix]] | None:
    """Return a function that turns points and directions of the tip about the first joint's axis.

    The function takes points [m], shape (m, 3), directions, shape (m, 3), and angles [rad], shape (m,), and returns the
    turned points and directions. None if the first joint does not turn the whole arm as one body.
    """
    chain = robot.chain
    moves_only_itself = np.count_nonzero(chain.gain[:, 0]) == 1 and chain.gain[0, 0] == 1.0
    joints_on_base = np.count_nonzero(chain.parent == -1)
    if robot.prismatic[0] or not moves_only_itself or joints_on_base != 1:
        return None

    # The frame of the first joint; index 0 is the world.
    frame = chain.joint_frames(np.zeros((1, robot.dof)))[0, 1]
    axis = frame[:3, :3] @ chain.axis[0]
    origin = frame[:3, 3]

    def turn(points: Matrix, pointing: Matrix, angles: Vector) -> tuple[Matrix, Matrix]:
        c = np.cos(angles)[:, None]
        s = np.sin(angles)[:, None]

        def rotated(v: Matrix) -> Matrix:
            moved: Matrix = c * v + s * np.cross(axis, v) + (1.0 - c) * (v @ axis)[:, None] * axis
            return moved

        return origin + rotated(points - origin), rotated(pointing)

    return turn


def _grid(robot: Robot, base: Vector, cell: float | None) -> tuple[Vector, float, tuple[int, int, int]]:
    """Lay out a grid around all positions of the tip that a random probe reaches, with the base on a cell's corner.

    Args:
        robot: The arm.
        base: Position of the arm's base, shape (3,) [m].
        cell: Side of a cell [m], or None for a suitable one.

    Returns:
        Low corner of the first cell, shape (3,) [m], side of a cell [m], and numbers of cells along x, y, z.
    """
    rng = np.random.default_rng(0)
    tips = poses(robot, rng.uniform(*robot.finite_range(), (PROBE, robot.dof)))[:, :3, 3] - base
    reach = PROBE_MARGIN * float(np.linalg.norm(tips, axis=1).max())
    if reach == 0.0:
        raise InputError(f"robot '{robot.name}': no joint moves its tip, so there is nothing to map; name another tip")

    size = reach / CELLS if cell is None else positive(cell, "cell")
    margin = 0.5 * (PROBE_MARGIN - 1.0) * reach

    with np.errstate(over="ignore"):
        first = np.floor((tips.min(axis=0) - margin) / size)
        last = np.ceil((tips.max(axis=0) + margin) / size)
        if robot.planar:
            first[2] = BELOW - 1.0
            last[2] = BELOW
        numbers = np.maximum(last - first, 1.0)
        count = float(np.prod(numbers))

    if not count <= MAX_CELLS:
        raise InputError(f"cell of {size:g} m makes {count:.3g} cells; at most {MAX_CELLS}")
    shape = tuple(map(int, numbers))
    return base + size * first, size, (shape[0], shape[1], shape[2])


@dataclass(frozen=True, slots=True, eq=False)
class ReachMap:
    """A value for every cell of a grid in the world.

    Attributes:
        robot: Name of the arm.
        measure: What the values are: one of ``MEASURES``.
        corner: Low corner of the first cell, shape (3,) [m].
        size: Side of a cell [m].
        values: Value of each cell, shape (x, y, z); 0 where there was no sample.
        samples: Number of samples in the grid.
        base: Position of the arm's base, shape (3,) [m].

    Example:
        >>> reach = rrtik.ik.reach_map(rrtik.load_robot("planar3"), samples=2000, seed=1)
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
        """Whether each cell has a sample, shape (x, y, z)."""
        is_inside: NDArray[np.bool_] = self.values > 0.0
        return is_inside

    @property
    def flat(self) -> bool:
        """Whether there is a single layer of cells, as for a planar arm."""
        return bool(self.values.shape[2] == 1)

    @property
    def volume(self) -> float:
        """Volume of the reached cells [m3]; 0 for a flat map."""
        return 0.0 if self.flat else float(np.count_nonzero(self.reached)) * self.size**3

    @property
    def area(self) -> float:
        """Area of the reached cells seen from above [m2]."""
        return float(np.count_nonzero(self.reached.any(axis=2))) * self.size**2

    @property
    def best(self) -> Vector:
        """Centre of the cell with the largest value, shape (3,) [m]."""
        place = np.unravel_index(int(np.argmax(self.values)), self.values.shape)
        middle: Vector = self.corner + self.size * (np.array(place) + 0.5)
        return middle

    def centres(self, axis: int) -> Vector:
        """Return the centres of the cells along an axis (0, 1 or 2 for x, y or z), shape (n,) [m]."""
        axis = whole_number(axis, "axis of a reachability map")
        at_most(axis, 2, "axis of a reachability map", "0 is x, 1 is y, 2 is z")
        middles: Vector = self.corner[axis] + self.size * (np.arange(self.values.shape[axis]) + 0.5)
        return middles

    def value(self, points: Matrix) -> Vector:
        """Return the values of the cells that hold points, shape (m, 3) [m]; 0 outside the grid. Shape (m,)."""
        places = np.floor((finite_array(points, (None, 3), "points") - self.corner) / self.size).astype(int)
        is_inside = ((places >= 0) & (places < self.values.shape)).all(axis=1)
        found = np.zeros(len(places))
        found[is_inside] = self.values[tuple(places[is_inside].T)]
        return found

    def slices(self) -> list[Slice]:
        """Return two cuts: an upright one through the base along x, and a level one where most cells are reached.

        A flat map has only the level one.
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

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the map as .npz, or one row per reached cell (centre and value) as .csv, whole or not at all.

        Raises:
            InputError: If the ending is another one or the file cannot be written.
        """
        ending = known_ending(file, FORMATS, "map of reach")
        if ending == ".csv":
            places = np.argwhere(self.reached)
            rows = np.column_stack([self.corner + self.size * (places + 0.5), self.values[self.reached]])
            write_text(file, "\n".join([f"x,y,z,{self.measure}", *(",".join(f"{v:.6g}" for v in r) for r in rows), ""]))
            return

        data = BytesIO()
        scalars = {name: getattr(self, name) for name in ("robot", "measure", "size", "samples")}
        np.savez_compressed(data, corner=self.corner, values=self.values, base=self.base, **scalars)
        write_bytes(file, data.getvalue())

    @staticmethod
    def load(file: str | os.PathLike[str]) -> ReachMap:
        """Read a map that was saved as .npz.

        Raises:
            InputError: If the file cannot be used.

        Example:
            >>> rrtik.reach_map(rrtik.load_robot("planar3"), samples=2000, seed=1).save("reach.npz")
            >>> rrtik.ik.ReachMap.load("reach.npz").robot
            'planar3'
        """
        return read(ReachMap, file)


@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """A picture of values over a plane.

    Attributes:
        title: What the picture shows.
        across, up: Labels of the axes.
        x, y: Centres of the cells [m], shapes (n,) and (m,).
        values: Value of each cell, shape (m, n): rows along y, columns along x.
        boxes: Rectangles to draw: low x, low y, high x, high y [m].
        points: Places to mark: x, y [m].
        base: Position of the arm's base in this plane: x, y [m].
        meanings: Meaning of each value, for a legend, if values are labels and not amounts; boxes are then a vehicle,
            points cameras.
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


def read_reach_map(file: str | os.PathLike[str]) -> ReachMap:
    """Read a map; see :meth:`ReachMap.load`.

    Raises:
        InputError: If the file cannot be used.
    """
    if known_ending(file, FORMATS, "map of reach") != ".npz":
        raise InputError(f"{file}: only .npz holds a whole map; a .csv cannot be read back")
    data = NamedArrays(file)
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
        raise InputError(f"{file}: is no map of reach: {error}; make one with `rrtik reach ... --out`") from error


class Counter:
    """Collects the samples of each cell; this one counts them, subclasses measure something else.

    Args:
        cells: Number of cells.
        planar: Whether the arm is planar.
    """

    def __init__(self, cells: int, planar: bool) -> None:
        self.planar = planar
        self.totals = np.zeros(cells)

    def quality(self, robot: Robot, Q: Matrix) -> Vector:
        """Return a value for each configuration, shape (m,), that does not change when the arm turns as a whole."""
        del robot
        return np.ones(len(Q))

    def add(self, cells: NDArray[np.int64], pointing: Matrix, quality: Vector) -> None:
        """Add samples.

        Args:
            cells: Index of the cell of each sample, shape (m,).
            pointing: Direction of the tip's axis, shape (m, 3).
            quality: Result of :meth:`quality`, shape (m,).
        """
        del pointing
        np.add.at(self.totals, cells, quality)

    @property
    def values(self) -> Vector:
        """Value of each cell, shape (cells,)."""
        return self.totals


class Orientations(Counter):
    """Measures in which of the directions the tip has pointed; each cell has one bit for each direction."""

    def __init__(self, cells: int, planar: bool) -> None:
        super().__init__(cells, planar)
        self.seen = np.zeros(cells, dtype=np.uint64)
        ticks = np.arange(-FINE, FINE + 1)
        cube = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
        self.nearest = np.argmax(cube @ _directions(planar).T, axis=1).astype(np.uint64)

    def add(self, cells: NDArray[np.int64], pointing: Matrix, quality: Vector) -> None:
        """Set the bit of the direction that is nearest to each sample's."""
        del quality
        place = np.rint(FINE * pointing).astype(np.int64) + FINE
        nearest = self.nearest[(place[:, 0] * (2 * FINE + 1) + place[:, 1]) * (2 * FINE + 1) + place[:, 2]]
        np.bitwise_or.at(self.seen, cells, np.uint64(1) << nearest)

    @property
    def values(self) -> Vector:
        """Share of the directions that were seen in each cell, shape (cells,)."""
        share: Vector = np.bitwise_count(self.seen) / DIRECTIONS
        return share


class Manipulability(Counter):
    """Measures the largest manipulability that was seen in each cell."""

    def quality(self, robot: Robot, Q: Matrix) -> Vector:
        """Return the product of the Jacobian's singular values [31], of which there are min(dof, 6)."""
        jacobian = jacobians(robot, Q)
        flipped = jacobian.transpose(0, 2, 1)
        gram = flipped @ jacobian if robot.dof < 6 else jacobian @ flipped  # The smaller one has no extra zeros.
        root: Vector = np.sqrt(np.maximum(np.linalg.det(gram), 0.0))
        return root

    def add(self, cells: NDArray[np.int64], pointing: Matrix, quality: Vector) -> None:
        """Add samples; each cell keeps its largest quality."""
        del pointing
        np.maximum.at(self.totals, cells, quality)


def _directions(planar: bool) -> Matrix:
    """Return evenly spread unit vectors, shape (DIRECTIONS, 3): a circle, or a Fibonacci spiral on the sphere."""
    if planar:
        angle = TAU * np.arange(DIRECTIONS) / DIRECTIONS
        return np.stack([np.cos(angle), np.sin(angle), np.zeros(DIRECTIONS)], axis=1)
    height = 1.0 - (2.0 * np.arange(DIRECTIONS) + 1.0) / DIRECTIONS
    turn = GOLDEN * np.arange(DIRECTIONS)
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


MEASURES: Mapping[str, Callable[[int, bool], Counter]] = MappingProxyType(
    {"orientations": Orientations, "manipulability": Manipulability, "samples": Counter}
)

"""Maps of reach by forward kinematics of random postures: in which cell the tip is, and which way it points.

A map is a lower bound: more samples fill more of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen, positive, whole_number
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.ik.reach.grid_map import ReachMap
from rrtik_ompl.ik.reach.measures import MEASURES, Counter
from rrtik_ompl.model.robot import Robot, poses
from rrtik_ompl.world.check_world import check_world
from rrtik_ompl.world.world import World

SAMPLES = 200_000
BLOCK = 20_000  # postures at a time
TURNS = 16  # of the first joint for each of them: the whole arm turns as one body, which needs no kinematics
CELLS = 18  # of the grid across the farthest reach, if no size is given
MAX_CELLS = 4_000_000  # 32 MB of values
MOST_SAMPLES = 1_000_000_000  # some minutes of a processor
PROBE = 4096  # postures that determine how large the grid must be
BELOW = 1e-3  # of a cell: the layer of a planar arm ends so far above the arm, which is seen from above
PROBE_MARGIN = 1.1  # how much larger than what the probe reached


def reach_map(
    robot: Robot,
    *,
    measure: str = "orientations",
    cell: float | None = None,
    samples: int = SAMPLES,
    world: World | None = None,
    axis: str | None = None,
    seed: int = 0,
) -> ReachMap:
    """Map where an arm can bring its tip.

    Args:
        robot: The arm.
        measure: ``orientations``: share of 64 evenly spread directions (planar arms: of the plane) in which the tip's
            axis was seen to point; ``manipulability``: the largest product of the Jacobian's singular values
            seen, sqrt(det(J J^T)) from six joints on [31], metres and radians as they are;
            ``samples``: how many came.
        cell: Side of a cell [m]; about an 18th of the reach if None.
        samples: Postures to draw; where nothing but the arm is considered, each in 16 turns of the first joint.
        world: If given, only postures that are free count. Its robot must be this one.
        axis: Of the tip's frame, "x", "y" or "z": what points, for ``orientations``; z if None, of planar arms x.
        seed: Of the random numbers.

    Raises:
        UnknownNameError: If there is no such measure.
        InputError: If an argument makes no sense, or the grid would be too large.

    Example:
        >>> reach = rrtik.reach_map(rrtik.load_robot("planar3"), samples=2000, seed=1)
        >>> reach.measure, reach.values.ndim
        ('orientations', 3)
    """
    check_world(world, robot)
    measure = one_of(MEASURES, measure, "measure of reach")
    axis = ("x" if robot.planar else "z") if axis is None else axis
    if not isinstance(axis, str) or axis not in ("x", "y", "z"):
        raise InputError(f"axis must be x, y or z, got {axis!r:.80}")
    count = whole_number(samples, "samples", 1)
    at_most(count, MOST_SAMPLES, "samples")
    rng = np.random.default_rng(whole_number(seed, "seed"))

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
    """Where the tip of random postures is, which way it points, shape (m, 3) each, and their quality, shape (m,)."""
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
        for _ in range(TURNS - 1):  # the same arm turned about its first axis: its quality is the same
            angles = rng.uniform(low[0], high[0], len(Q))
            points, pointing = turn(points, pointing, angles - Q[:, 0])
            Q[:, 0] = angles
            yield points, pointing, quality


def _first_turn(robot: Robot) -> Callable[[Matrix, Matrix, Vector], tuple[Matrix, Matrix]] | None:
    """Turns points and directions, shapes (m, 3), about the first joint's axis by angles, shape (m,).

    None if the first joint does not carry the whole arm by turning it.
    """
    chain = robot.chain
    alone = np.count_nonzero(chain.gain[:, 0]) == 1 and chain.gain[0, 0] == 1.0
    if robot.prismatic[0] or not alone or np.count_nonzero(chain.parent == -1) != 1:
        return None

    frame = robot.chain.joint_frames(np.zeros((1, robot.dof)))[0, 1]
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
    """Corner, cell size and numbers of cells of a grid that holds all tips; the base is on a cell's corner."""
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

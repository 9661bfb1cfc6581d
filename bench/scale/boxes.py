"""What thousands of boxes cost a UR5: worlds, checks, moving one, whole plans."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from bench.shared.clocks import spent
from rrtik_ompl import Box, Obstacle, Problem, Scene, World, load_robot, plan, pose

PLANNER, BUSY = "fastrrtconnect", 20.0  # [s]: no clock ends a search on a busy machine
EDGE, ROOM = 0.02, 1.5  # [m] of a box; radius of the ball that they fill
# [rad] of the first two joints in a corner: from one turn to another the arm would have to pass through floor and walls
LOWEST, HIGHEST = (-2.9, -3.0), (-0.2, -0.1)
MANY = 1000  # boxes, from which on as much of the room is full
FACES, WALL, THICK = 3, 0.75, 0.02  # of a room: half of its sides, thickness of its panels [m]
FIRST = 500  # pairs of configurations that are looked at
PLANS, FEWEST, ROWS, WORLDS, MOVES = 8, 3, 8000, 2, 200  # FEWEST plans among the most boxes


@dataclass(frozen=True)
class Among:
    """Processor times among ``count`` boxes: a world [us a box], a configuration, a move of one box [us], plans [ms].

    ``moved``: a move with the check of a configuration; ``plans``: default calls; ``named``: of the planner, and
    ``motions`` that each of these checked; ``free``: share of the configurations.
    """

    count: int
    world: float
    check: float
    move: float
    moved: float
    plans: list[float]
    named: list[float]
    motions: list[int]
    found: int
    free: float


def scene_of(count: int) -> Scene:
    """Boxes in a ball around the base, none of them in it."""
    rng = np.random.default_rng(1)
    away = rng.normal(size=(count, 3))
    away *= (np.cbrt(rng.uniform(0.03, 1.0, count)) * ROOM / np.linalg.norm(away, axis=1))[:, None]
    edge = EDGE * min(1.0, (MANY / count) ** (1 / 3))
    return Scene(tuple(Obstacle(f"box {k}", Box([edge] * 3), pose(p)) for k, p in enumerate(away)))


def corner_of(count: int) -> Scene:
    """The same corner of a room around the base whatever the number: a floor and two walls, each of square panels."""
    along = max(int((count / FACES) ** 0.5), 1)
    edge = 2.0 * WALL / along
    spots = edge * (np.arange(along) + 0.5) - WALL
    panel, flat = Box([edge, edge, THICK]), np.array([(x, y, 0.0) for x in spots for y in spots])
    quarter = np.pi / 2.0
    faces = [
        pose([0.0, 0.0, -0.03]),
        pose([WALL, 0.0, WALL, 0.0, quarter, 0.0]),
        pose([0.0, WALL, WALL, quarter, 0.0, 0.0]),
    ]
    moves = [pose(p) for p in flat]
    placed = [face * move for face in faces for move in moves]
    return Scene(tuple(Obstacle(f"panel {k}", panel, each) for k, each in enumerate(placed)))


def among_boxes(count: int) -> Among:
    """A UR5 among boxes drawn around it."""
    return _among(scene_of(count), PLANS if count <= MANY else FEWEST)


def among_panels(count: int) -> Among:
    """A UR5 in a corner of about so many panels."""
    return _among(corner_of(count), PLANS, corner=True)


def _among(scene: Scene, plans: int, *, corner: bool = False) -> Among:
    robot, count = load_robot("ur5"), len(scene.obstacles)
    made = [spent(partial(World, robot, scene)) for _ in range(WORLDS + 1)][1:]
    world: World = made[0][1]
    lower, upper = robot.finite_range()
    if corner:
        lower, upper = np.append(LOWEST, lower[2:] / 2.0), np.append(HIGHEST, upper[2:] / 2.0)
    rows = np.random.default_rng(2).uniform(lower, upper, (ROWS, robot.dof))
    free = rows[world.valid_batch(rows)]
    check = min(spent(partial(world.valid_batch, rows))[0] for _ in range(3)) / ROWS
    starts, ends = free[: len(free) // 2 * 2 : 2], free[1::2]
    if corner:  # much of it is free: what a straight motion solves is left out
        blocked = ~world.motion_valid_batch(starts[:FIRST], ends[:FIRST])
        starts, ends = starts[:FIRST][blocked], ends[:FIRST][blocked]
    problems = [Problem(world, a, b) for a, b in zip(starts[:plans], ends[:plans], strict=True)]
    defaults = [partial(plan, problem, seed=1, seconds=BUSY) for problem in problems]
    named = [partial(plan, problem, PLANNER, seed=1, seconds=BUSY, shorten=False) for problem in problems]
    defaults[0]()
    named[0]()
    whole = [spent(call) for call in defaults]
    runs = [spent(call) for call in named]
    moves = _move(world)
    return Among(
        count=count,
        world=1e6 * min(taken for taken, _ in made) / count,
        check=1e6 * check,
        move=1e6 * moves[0],
        moved=1e6 * moves[1],
        plans=[1e3 * taken for taken, _ in whole],
        named=[1e3 * taken for taken, _ in runs],
        motions=[int(found.statistics.get("motions", 0)) for _, found in runs],
        found=sum(found.found for _, found in whole),
        free=len(free) / ROWS,
    )


def _move(world: World) -> tuple[float, float]:
    """Processor time of moving one box, and of that with a check of a configuration behind it [s]."""
    poses = [pose([0.6, 0.3, 0.01 * k]) for k in range(MOVES)]
    q = np.zeros(world.robot.dof)
    name = world.scene.obstacles[0].name
    taken = []
    for asked in (False, True):
        moved = world.with_scene(world.scene).moved(name, poses[0])

        def walk(moved: World = moved, asked: bool = asked) -> None:
            for each in poses:
                moved = moved.moved(name, each)
                if asked:
                    moved.valid(q)

        taken.append(min(spent(walk)[0] for _ in range(3)) / MOVES)
    return taken[0], taken[1]

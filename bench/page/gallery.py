"""Pages to look at, each one file that needs no network: arms that people have, two arms, a maze, a cloud, a tree."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

import rrtik_ompl as rrtik
from bench.shared.mb_rrt_tree import tree_marks
from rrtik_ompl.ik.mb_rrt.links import Links
from rrtik_ompl.ik.mb_rrt.published import grow
from rrtik_ompl.planning.generated_problems import generated_problem

SEED = 1
POINTS = 4_000  # of the cloud


def planned(problem: rrtik.Problem, planner: str | None, file: Path) -> None:
    """The page of a problem and its path."""
    found = rrtik.plan(problem, planner, seed=SEED, seconds=30.0)
    if found.path is None:
        raise SystemExit(f"{problem.name}: {found.reason}")
    rrtik.view(problem, rrtik.shorten(found.path, problem, seed=SEED), html=file)


def shelf_in_a_cloud() -> rrtik.Problem:
    """A UR5 beside a ball that a camera has seen: points of its surface."""
    rng = np.random.default_rng(SEED)
    directions = rng.normal(size=(POINTS, 3))
    points = 0.15 * directions / np.linalg.norm(directions, axis=1)[:, None] + [0.55, 0.45, 0.5]
    scan = rrtik.Obstacle("scan", rrtik.PointCloud(points, 0.01))
    world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene((scan,)))
    return rrtik.Problem(world, [0.0, -1.2, 1.0, 0.2, 0.0, 0.0], [1.6, -1.2, 1.0, 0.2, 0.0, 0.0])


def tree(file: Path) -> None:
    """The tree of MB-RRT that solves the inverse kinematics of a chain of four links in space."""
    run = grow(Links([0.1] * 4, 3), [0.2, 0.1, 0.2], tolerance=0.002, rng=np.random.default_rng(SEED))
    rrtik.view(rrtik.Scene(), marks=tree_marks(run), html=file, title="MB-RRT: the tree of a chain of four links")


def pages() -> Iterator[tuple[str, str, Callable[[Path], None]]]:
    """The name of each page, what it shows, and what writes it."""
    for robot, family, seed in (("panda", "pipes", 1), ("ur5", "clutter", 0), ("xarm7", "panel", 1)):
        text = f"{robot} before generated obstacles ({family}, seed {seed})"
        problem = partial(generated_problem, rrtik.load_robot(robot), family, seed)
        yield f"{robot}_{family}", text, lambda file, problem=problem: planned(problem(), None, file)  # type: ignore[misc]
    for name, planner, text in (
        ("panda_shelf", None, "a Panda reaches from one compartment of a shelf into another"),
        ("titan4_sdu", "bicrdt", "TITAN 4 takes a tool from a panel, one joint at a time"),
        ("titan4_prisms", "RRTConnect", "TITAN 4 between prisms"),
        ("two_titan4", None, "two TITAN 4 on one vehicle, planned together"),
        ("env_e", None, "a point in a maze of walls"),
        ("planar6_c", "bicrdt", "an arm of six links in the plane"),
    ):
        yield name, text, lambda file, name=name, planner=planner: planned(rrtik.load_problem(name), planner, file)  # type: ignore[misc]
    yield "cloud", "a UR5 beside a cloud of points", lambda file: planned(shelf_in_a_cloud(), None, file)
    yield "mb_rrt_tree", "the tree of MB-RRT", tree


def main(folder: Path) -> None:
    """Write all pages, and say how large each is."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text, write in pages():
        file = folder / f"{name}.html"
        write(file)
        print(f"{file}: {file.stat().st_size / 1e6:.2f} MB: {text}", flush=True)

"""Pages to look at, each one file that needs no network: arms that people have, two arms, a maze, a cloud, trees.

With ``--pictures`` each page is also drawn, and with ``--films`` what moves is filmed. Needs Chromium.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from typer import Argument, Option

import rrtik_ompl as rrtik
from bench.shared.mb_rrt_tree import tree_marks
from rrtik_ompl.ik.mb_rrt.links import Links
from rrtik_ompl.ik.mb_rrt.published import grow
from rrtik_ompl.planning.generated_problems import generated_problem
from rrtik_ompl.viewer.film import drawn

SEED = 1
POINTS = 4_000  # of the cloud
SIZE = (1280, 720)  # [px] of pictures and films

Shown = dict[str, Any]  # the arguments of `rrtik.view`


def planned(problem: rrtik.Problem, planner: str | None, *, tree: bool = False) -> Shown:
    """A problem with its path, or with the tree of its search."""
    found = rrtik.plan(problem, planner, seed=SEED, seconds=30.0, tree=tree)
    if found.path is None:
        raise SystemExit(f"{problem.name}: {found.reason}")
    return {"shown": found} if tree else {"shown": problem, "path": found.path}


def shelf_in_a_cloud() -> rrtik.Problem:
    """A UR5 beside a ball that a camera has seen: points of its surface."""
    rng = np.random.default_rng(SEED)
    directions = rng.normal(size=(POINTS, 3))
    points = 0.15 * directions / np.linalg.norm(directions, axis=1)[:, None] + [0.55, 0.45, 0.5]
    scan = rrtik.Obstacle("scan", rrtik.PointCloud(points, 0.01))
    world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene((scan,)))
    return rrtik.Problem(world, [0.0, -1.2, 1.0, 0.2, 0.0, 0.0], [1.6, -1.2, 1.0, 0.2, 0.0, 0.0])


def two_joints() -> rrtik.Problem:
    """An arm of two links in the plane among three obstacles, whose joint space can be drawn."""
    arm = rrtik.load_robot("planar", parameters={"lengths": [1.0, 0.8], "radius": 0.04})
    scene = rrtik.Scene(
        [
            rrtik.Obstacle("box", rrtik.Box(0.4, 0.4, 0.4), [1.1, 0.9, 0.0]),
            rrtik.Obstacle("post", rrtik.Cylinder(0.15, 0.5), [-0.2, 1.3, 0.0]),
            rrtik.Obstacle("low box", rrtik.Box(0.5, 0.3, 0.3), [0.9, -0.9, 0.0]),
        ]
    )
    return rrtik.Problem(rrtik.World(arm, scene), [-0.3, 0.4], [2.6, -0.6], name="two joints")


def links() -> Shown:
    """The tree of MB-RRT that solves the inverse kinematics of a chain of four links in space."""
    run = grow(Links([0.1] * 4, 3), [0.2, 0.1, 0.2], tolerance=0.002, rng=np.random.default_rng(SEED))
    return {"shown": rrtik.Scene(), "marks": tree_marks(run), "title": "MB-RRT: the tree of a chain of four links"}


def pages() -> Iterator[tuple[str, str, Callable[[], Shown]]]:
    """The name of each page, what it shows, and what makes that."""
    for robot, family, seed in (("panda", "pipes", 1), ("ur5", "clutter", 0), ("xarm7", "panel", 1)):
        text = f"{robot} before generated obstacles ({family}, seed {seed})"
        yield f"{robot}_{family}", text, partial(_generated, robot, family, seed)
    for name, planner, text in (
        ("panda_shelf", None, "a Panda reaches from one compartment of a shelf into another"),
        ("titan4_sdu", "bicrdt", "TITAN 4 takes a tool from a panel, one joint at a time"),
        ("titan4_prisms", "RRTConnect", "TITAN 4 between prisms"),
        ("two_titan4", None, "two TITAN 4 on one vehicle, planned together"),
        ("env_e", None, "a point in a maze of walls"),
        ("planar6_c", "bicrdt", "an arm of six links in the plane"),
    ):
        yield name, text, partial(_shipped, name, planner)
    yield "cloud", "a UR5 beside a cloud of points", lambda: planned(shelf_in_a_cloud(), None)
    yield "search", "how C-RDT searches, in space and in joint space", lambda: planned(two_joints(), "crdt", tree=True)
    yield "mb_rrt_tree", "the tree of MB-RRT", links


def _generated(robot: str, family: str, seed: int) -> Shown:
    return planned(generated_problem(rrtik.load_robot(robot), family, seed), None)


def _shipped(name: str, planner: str | None) -> Shown:
    return planned(rrtik.load_problem(name), planner)


def main(
    folder: Annotated[Path, Argument(help="Of the pages.")],
    pictures: Annotated[bool, Option("--pictures", help="A .png of each page beside it.")] = False,
    films: Annotated[bool, Option("--films", help="A .mp4 of each page whose arm moves.")] = False,
) -> None:
    """Write all pages, and say how large each is."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text, make in pages():
        file = folder / f"{name}.html"
        shown = make()
        rrtik.view(**shown, html=file)
        print(f"{file}: {file.stat().st_size / 1e6:.2f} MB: {text}", flush=True)
        if pictures:
            (picture,) = drawn(file.read_text(encoding="utf-8"), 1, SIZE)
            picture.save(file.with_suffix(".png"))
        if films and "marks" not in shown:
            rrtik.film(**shown, file=file.with_suffix(".mp4"), size=SIZE)

"""Section: clouds that a camera's loop makes die when nobody holds them."""

from __future__ import annotations

import gc

import numpy as np

from bench.shared.clocks import resident
from bench.shared.parts import Parts
from rrtik_bench.report.page import Report
from rrtik_ompl import Obstacle, PointCloud, Scene, World, load_robot, plan
from rrtik_ompl.model.shapes.point_cloud import PointCloud as Cloud
from rrtik_ompl.world.problem import Problem

SCANS, POINTS, EVERY = 10_000, 2_000, 500
FLAT_MB = 5.0
MIDDLE = (0.6, 0.5, 0.8)  # of a scan [m], beside the arm


def scans(count: int) -> list[list[float]]:
    """Living clouds and resident memory [MB] after each of some blocks of scans; the last scan is held meanwhile."""
    robot = load_robot("ur5")
    rng = np.random.default_rng(0)
    start = np.array([0.0, -1.2, 1.0, 0.2, 0.0, 0.0])
    goal = np.array([1.6, -1.2, 1.0, 0.2, 0.0, 0.0])
    told = []
    for number in range(count):
        points = rng.normal(MIDDLE, 0.05, (POINTS, 3))
        world = World(robot, Scene((Obstacle("scan", PointCloud(points, radius=0.005)),)))
        if world.valid(start) and world.valid(goal):
            plan(Problem(world, start, goal), seed=0)
        if number % EVERY == EVERY - 1 or number == count - 1:
            gc.collect()
            living = sum(isinstance(each, Cloud) for each in gc.get_objects())
            told.append([float(living), resident()])
    return told


def section(parts: Parts, size: float) -> Report:
    """Scans one after the other, each a world and a plan."""
    count = max(10, round(SCANS * size))
    (told,) = parts(scans, [(count,)])
    most = int(max(living for living, _ in told))
    grown = told[-1][1] - told[len(told) // 4][1]

    report = Report("", "")
    what = f"living clouds in a loop of {count:,} scans of {POINTS:,} points, each a world and a plan"
    report.bar(what, "1: the last one, which is held", f"{most}", most <= 1)
    report.bar(
        "memory over the last three quarters of them", f"flat to {FLAT_MB:g} MB", f"{grown:+.1f} MB", grown <= FLAT_MB
    )
    return report

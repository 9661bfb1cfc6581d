"""What proofs spend on pairs of links that one or two joints move, and which of these pairs never come together.

A pair that is apart at all values of its joints could be proven once per robot, and left out of every later proof.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.model.robot import Chain, Robot
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker
from rrtik_ompl.world.world import World

FEW = 2  # joints that move a pair
DRAWN = 20_000  # configurations
ROUNDS, REPEATS = 8, 10
Names = tuple[str, str]


@dataclass(frozen=True)
class NearPair:
    """A pair that few joints move: the share of configurations in which it is proven apart."""

    names: Names
    joints: tuple[str, ...]
    apart: float


@dataclass(frozen=True)
class Shares:
    """Time of all proofs without pairs of links, beside the time with all pairs; and the pairs that few joints move."""

    pairs: list[NearPair]
    milliseconds: float
    without_never: float
    without_few: float


def near_pairs(files: list[str], urdf: str) -> Shares:
    """Measure the proofs of the first paths of MotionBenchMaker problems, smallest processor time of several rounds."""
    robot = rrtik.load_robot(Path(urdf))
    problems = [load_motion_bench_maker(Path(file), robot=robot) for file in files]
    found = [rrtik.plan(problem, "fastrrtconnect", seed=1, proof="off").path for problem in problems]
    rows = [path.waypoints for path in found if path is not None]
    pairs = _pairs(robot, problems[0].world)
    never = [pair.names for pair in pairs if pair.apart == 1.0]
    left_out: tuple[list[Names], ...] = ([], never, [pair.names for pair in pairs])
    worlds = [[_without(problem.world, names) for problem in problems] for names in left_out]
    best = np.full((len(worlds), len(rows)), np.inf)
    for _ in range(ROUNDS):
        for k, own in enumerate(worlds):
            for n, (world, route) in enumerate(zip(own, rows, strict=True)):
                world.prove(route)
                begin = process_time()
                for _ in range(REPEATS):
                    world.prove(route)
                best[k, n] = min(best[k, n], (process_time() - begin) / REPEATS)
    whole, without_never, without_few = best.sum(axis=1).tolist()
    return Shares(pairs, 1e3 * whole, without_never / whole, without_few / whole)


def _without(world: World, names: list[Names]) -> World:
    """The world in which some pairs may touch, so that nobody proves them apart."""
    scene = world.scene
    return world.with_scene(replace(scene, allowed_collisions=(*scene.allowed_collisions, *names)))


def _pairs(robot: Robot, world: World) -> list[NearPair]:
    """The world's pairs of links that few joints move."""
    drawn = np.random.default_rng(0).uniform(*robot.finite_range(), (DRAWN, robot.dof))
    names = list(robot.model.names)
    found: dict[Names, NearPair] = {}
    for i, j in world.pairs:
        first, second = world.bodies[i], world.bodies[j]
        between = _carrying(robot.chain, first) ^ _carrying(robot.chain, second)
        pair = (first.name, second.name)
        if "obstacle" in (first.kind, second.kind) or not 0 < len(between) <= FEW:
            continue
        alone = World(robot)
        others = {(alone.bodies[a].name, alone.bodies[b].name) for a, b in alone.pairs} - {pair}
        kept = _without(alone, sorted(others))
        apart = float(kept.motions_proven(drawn, drawn).mean())
        found[pair] = NearPair(pair, tuple(names[k] for k in sorted(between)), apart)
    return list(found.values())


def _carrying(chain: Chain, body: Body) -> set[int]:
    """Numbers of the joints that carry a body, the first 1."""
    joints, joint = set(), body.joint
    while joint > 0:
        joints.add(joint)
        joint = int(chain.parent[joint - 1]) + 1
    return joints

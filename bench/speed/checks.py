"""Speed rows about collision checks: free motions, exact batches near obstacles, how much is left to coal."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from bench.peers.libraries.ompl_callback import Checker
from bench.shared.clocks import spent
from bench.speed.cases import (
    REACHES,
    Options,
    arms_among_boxes,
    asked_configurations,
    clutter,
    exact_problem,
    family,
    near_contact,
    panda_files,
    shipped_problems,
    sphere_problem,
    uniform,
    without_itself,
)
from bench.speed.ours import joint_values
from rrtik_bench.report.page import Report
from rrtik_ompl import World, load_robot
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels import FREE, UNDECIDED

STEPS = 31  # of a motion of 1 rad: 32 configurations, which fill all lanes
REPEATS = 7
MOTIONS = 2000
MANY_BOXES = 50
FREE_BARS = {"cage": 70.0, "table": 60.0, "50 boxes": 70.0}  # [ns]
ASKED = "on motions that RRT-Connect asks about"
NEAR_SCENE = "within 0.1 rad of contact with the scene"
NEAR_ITSELF = "within 0.1 rad of contact of the arm with itself"
KINDS = (ASKED, NEAR_SCENE, NEAR_ITSELF)
WRONG = """Judged by fresh requests, pair by pair (`World.certify`), on every fifth configuration. Those of Pinocchio's
loop are the known misses of `pinocchio.computeCollisions` on reused data."""
PEER_SHARE = 5  # the peer is asked about every fifth configuration


def free_motions(options: Options, report: Report) -> None:
    """One configuration along free motions of 1 rad, forward kinematics and all collisions."""
    rows = []
    for name, world in _free_worlds(options):
        found = _along_free(world, options)
        if found is None:
            rows.append([name, "no free motion found", ""])
            continue
        cost, count = found
        rows.append([name, f"{cost:.1f}", str(count)])
        bar = next((value for scene, value in FREE_BARS.items() if name.startswith(scene)), np.inf)
        report.bar(f"one configuration along free motions, {name}", f"{bar:g} ns (aim 35 ns)", rows[-1][1], cost <= bar)
    head = ["", "ns per configuration", "motions"]
    report.table("4. Panda along free motions of 1 rad, 32 configurations each", head, rows)


def _free_worlds(options: Options) -> Iterator[tuple[str, World]]:
    files = {family(file): file for file in reversed(panda_files(options, 1))}
    for kind in ("cage", "table_pick"):
        if kind in files:
            problem = sphere_problem(files[kind])
            if problem is not None:
                yield f"{kind}, 59 spheres", problem.world
            yield f"{kind}, covers of the exact solids", exact_problem(files[kind]).world
    scene = clutter(MANY_BOXES, REACHES["panda"], np.random.default_rng(options.seed))
    if files:
        spheres = sphere_problem(next(iter(files.values())))
        if spheres is not None:
            yield f"{MANY_BOXES} boxes, 59 spheres", World(spheres.world.robot, scene)
    yield f"{MANY_BOXES} boxes, covers of the exact solids", World(load_robot("panda"), scene)


def _along_free(world: World, options: Options) -> tuple[float, int] | None:
    """Nanoseconds per configuration and number of motions, None if there are no free ones."""
    if world.fast is None:
        return None
    rng, wanted = np.random.default_rng(options.seed), MOTIONS // (10 if options.quick else 1)
    found: list[Matrix] = []
    for _ in range(20):
        A = uniform(world, 10 * MOTIONS, rng)
        A = A[world.fast.classify(joint_values(world, A)) == FREE]
        way = rng.normal(size=A.shape)
        B = A + way / np.linalg.norm(way, axis=1)[:, None]
        inside = world.robot.within_limits(B)
        V, W = joint_values(world, A[inside]), joint_values(world, B[inside])
        free = world.fast.classify_edges(V, W, np.full(len(V), STEPS)) == FREE
        found += list(np.stack([V[free], W[free]], axis=1))
        if len(found) >= wanted:
            break
    if not found:
        return None
    V, W = (np.ascontiguousarray(part) for part in np.array(found[:wanted]).transpose(1, 0, 2))
    steps, fast = np.full(len(V), STEPS), world.fast
    best = min(spent(lambda: fast.classify_edges(V, W, steps))[0] for _ in range(REPEATS))
    return 1e9 * best / (len(V) * (STEPS + 1)), len(V)


def near_obstacles(options: Options, report: Report) -> None:
    """Exact batches near obstacles against Pinocchio and coal, and what the kernels leave undecided."""
    rows: list[list[str]] = []
    found: dict[str, list[Any]] = {kind: [] for kind in KINDS}
    for name, kind, world, Q in _near(options):
        cells, ratio, share = _exact_batch(world, Q)
        rows.append([name, kind, *cells])
        found[kind].append((ratio, share))
    head = ["", "", "configurations", "free", "ours [us]", "pin + coal, our solids [us]", "pin + coal, meshes [us]"]
    head += ["ratio, our solids", "ours wrong", "pin + coal wrong", "undecided [%]"]
    report.table("5. Exact `valid_batch` near obstacles, per configuration", head, rows)
    report.note("Wrong answers", WRONG)
    for kind, figures in found.items():
        ratios, shares = np.array(figures).T
        text = f"median {np.median(ratios):.3g} x, smallest {min(ratios):.3g} x"
        what = f"exact `valid_batch` against Pinocchio and coal with broadphase, configurations {kind}"
        report.bar(what, "10 x (aim 15 x)", text, bool(np.median(ratios) >= 10.0))
        text = f"median {100 * np.median(shares):.1f} %, largest {100 * max(shares):.1f} %"
        report.bar(f"undecided configurations {kind}", "<= 10 % (aim 4 %)", text, bool(np.median(shares) <= 0.1))


def _exact_batch(world: World, Q: Matrix) -> tuple[list[str], float, float]:
    """Cells of the table, the ratio to Pinocchio and coal on the same solids, the share left to coal."""
    some = Q[::PEER_SHARE]
    peers = [plain_checks(world, as_loaded=loaded) for loaded in (False, True)]
    world.valid_batch(Q[:1])
    costs, answers = [], []
    for _ in range(3):
        runs: list[tuple[float, Any]] = [
            spent(lambda: world.valid_batch(Q)),
            *(spent(partial(_one_by_one, peer, world, some)) for peer in peers),
        ]
        costs.append([1e6 * seconds / len(rows) for (seconds, _), rows in zip(runs, (Q, some, some), strict=True)])
        answers = [found for _, found in runs]
    ours, theirs, on_meshes = np.min(costs, axis=0)
    fresh = world.certify(some)
    wrong = [int((np.array(found) != fresh).sum()) for found in (answers[0][::PEER_SHARE], answers[1])]
    share = _undecided(world, Q)
    cells = [f"{len(Q)}", f"{answers[0].mean():.2f}", f"{ours:.2f}", f"{theirs:.1f}", f"{on_meshes:.1f}"]
    return [*cells, f"{theirs / ours:.3g}", *map(str, wrong), f"{100 * share:.1f}"], float(theirs / ours), share


def _one_by_one(peer: Checker, world: World, rows: Matrix) -> list[bool]:
    return [peer(full) for full in world.robot.pinocchio_configuration(rows)]


def plain_checks(world: World, *, as_loaded: bool) -> Checker:
    """What a user of Pinocchio writes: one configuration, a tree of bounding boxes, stop at the first collision.

    Args:
        world: Robot, obstacles and the pairs to check.
        as_loaded: Links keep their triangle meshes; otherwise they are the solids that a World checks.
    """
    robot, geometry = world.robot, pin.GeometryModel()
    loaded = [item.geometry for item in robot.collision.geometryObjects] if as_loaded else []
    solids = [*loaded, *(body.geometry for body in world.bodies[len(loaded) :])]
    for number, (body, solid) in enumerate(zip(world.bodies, solids, strict=True)):
        geometry.addGeometryObject(pin.GeometryObject(str(number), body.joint, body.placement, solid))
    for first, second in world.pairs:
        geometry.addCollisionPair(pin.CollisionPair(first, second))
    return Checker(robot.model, geometry, broadphase=True)


def _near(options: Options) -> Iterator[tuple[str, str, World, Matrix]]:
    """Worlds and configurations in them, of all kinds."""
    rng, count = np.random.default_rng(options.seed), 1000 if options.quick else 5000
    problems = [exact_problem(file) for file in panda_files(options, 1)] + shipped_problems()
    for problem in problems[: 1 if options.quick else None]:
        yield problem.name, ASKED, problem.world, asked_configurations(problem, count, rng)
        yield (
            problem.name,
            NEAR_SCENE,
            problem.world,
            near_contact(problem.world, without_itself(problem.world), count, rng),
        )
    for name, world in arms_among_boxes(options):
        yield name, NEAR_SCENE, world, near_contact(world, without_itself(world), count, rng)
        alone = World(world.robot)
        yield f"{name.partition(',')[0]} alone", NEAR_ITSELF, alone, near_contact(alone, alone, count, rng)


def _undecided(world: World, Q: Matrix) -> float:
    """Share of configurations that the kernels leave to coal."""
    if world.fast is None:
        return 1.0
    return float((world.fast.classify(joint_values(world, Q)) == UNDECIDED).mean())

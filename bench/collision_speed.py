"""Cost of exact collision checks beside a plain ``pinocchio.computeCollisions`` loop, in one run.

    python bench/collision_speed.py [--quick] [--out bench/reports/collision_speed.md]

Process CPU time per configuration, median of the repeats, the candidates interleaved. The plain loop asks Pinocchio
about every pair of the same robot and obstacles, without a broadphase, and stops at the first collision.
"""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pinocchio as pin

from rrtik_ompl import Obstacle, Scene, World, load_robot
from rrtik_ompl.shapes import Box

ROBOTS = {"titan4": 1.7, "panda": 0.8}
OBSTACLES = (1, 10, 50)
CANDIDATES = ("valid", "valid_batch", "certify", "loop, meshes as loaded", "loop, our solids")


def clutter(count: int, reach: float, rng: np.random.Generator) -> Scene:
    """Boxes around the arm; none stands so near to the first axis that the arm could not but touch it."""
    azimuth = rng.uniform(-np.pi, np.pi, count)
    radius, height = reach * rng.uniform(0.45, 1.0, count), reach * rng.uniform(-0.2, 0.7, count)
    centres = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height])
    boxes = (Box(rng.uniform(0.05, 0.15, 3) * reach) for _ in range(count))
    poses = (pin.SE3(np.eye(3), centre) for centre in centres)
    return Scene([Obstacle(f"box{k}", box, pose) for k, (box, pose) in enumerate(zip(boxes, poses, strict=True))])


def plain_loop(world: World, *, as_loaded: bool) -> Callable[[np.ndarray], None]:
    """The loop that a user of Pinocchio writes first: every pair, no broadphase, stop at the first collision.

    With ``as_loaded`` the links keep their triangle meshes; otherwise they are the solids that a World checks.
    """
    robot, geometry = world.robot, pin.GeometryModel()
    loaded = [item.geometry for item in robot.collision.geometryObjects] if as_loaded else []
    solids = [*loaded, *(body.geometry for body in world.bodies[len(loaded) :])]
    for number, (body, solid) in enumerate(zip(world.bodies, solids, strict=True)):
        geometry.addGeometryObject(pin.GeometryObject(str(number), body.joint, body.placement, solid))
    for first, second in world.pairs:
        geometry.addCollisionPair(pin.CollisionPair(first, second))
    data, geometry_data = robot.model.createData(), pin.GeometryData(geometry)

    def run(Q: np.ndarray) -> None:
        for q in robot.lift(Q):
            pin.computeCollisions(robot.model, data, geometry, geometry_data, q, True)

    return run


def measure(world: World, Q: np.ndarray, repeats: int) -> dict[str, float]:
    meshes, solids = (plain_loop(world, as_loaded=choice) for choice in (True, False))
    work = {
        "valid": lambda: [world.valid(q) for q in Q],
        "valid_batch": lambda: world.valid_batch(Q),
        "certify": lambda: world.certify(Q),
        "loop, meshes as loaded": lambda: meshes(Q),
        "loop, our solids": lambda: solids(Q),
    }
    times: dict[str, list[float]] = {name: [] for name in CANDIDATES}
    for _ in range(repeats + 1):
        for name, run in work.items():
            begin = time.process_time()
            run()
            times[name].append(1e6 * (time.process_time() - begin) / len(Q))
    return {name: float(np.median(values[1:])) for name, values in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer configurations")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "reports" / "collision_speed.md")
    options = parser.parse_args()
    count, repeats = (300, 3) if options.quick else (2000, 5)
    packages = ", ".join(f"{p} {version(p)}" for p in ("pin", "coal", "numpy"))
    lines = [
        "# Exact collision checks",
        "",
        f"Microseconds of CPU time per configuration, median of {repeats} interleaved repeats of {count} uniform",
        f"random configurations inside the limits, seed 0. {platform.machine()}, Python {platform.python_version()},",
        f"{packages}.",
        "Made by `python bench/collision_speed.py`.",
        "",
        "| robot | boxes | pairs | free | " + " | ".join(CANDIDATES) + " | loop as loaded / valid_batch |",
        "|---|---|---|---|" + "---|" * (len(CANDIDATES) + 1),
    ]
    for name, reach in ROBOTS.items():
        robot = load_robot(name)
        for boxes in OBSTACLES:
            rng = np.random.default_rng(0)
            world = World(robot, clutter(boxes, reach, rng))
            Q = rng.uniform(robot.lower, robot.upper, (count, robot.dof))
            cost = measure(world, Q, repeats)
            free, ratio = world.valid_batch(Q).mean(), cost["loop, meshes as loaded"] / cost["valid_batch"]
            cells = " | ".join(f"{cost[c]:.1f}" for c in CANDIDATES)
            lines.append(f"| {name} | {boxes} | {len(world.pairs)} | {free:.2f} | {cells} | {ratio:.1f} |")
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()

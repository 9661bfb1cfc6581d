"""The unpacked MotionBenchMaker sets: their files, and problems on exact meshes or on VAMP's spheres."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from rrtik_ompl import Obstacle, Problem, ProblemError, Robot, Scene, World, load_robot
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder
from rrtik_ompl.model.shapes.shape import Shape
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

GROUPS = {"panda": "panda_arm", "ur5": "manipulator", "fetch": "arm_with_torso"}  # of each robot


def scene_files(folder: Path, arm: str, problems: int) -> list[str]:
    """The first problems of each family of an arm's set."""
    families = sorted(path for path in (folder / f"mbm_{arm}" / "problems").glob("*") if path.is_dir())
    return [str(file) for family in families for file in sorted(family.glob("scene*.yaml"))[:problems]]


def problem_of(file: str, *, balls: bool) -> Problem | None:
    """A problem of a set on exact meshes; or on the balls and obstacles of VAMP, None if an end collides there."""
    scene = Path(file)
    folder = scene.parent.parent.parent
    arm = scene.parent.name.rsplit("_", 1)[1]

    exact = load_motion_bench_maker(scene, robot=_robot(folder, arm, balls=False))
    if not balls:
        return exact

    of_boxes = scene.parent.name.startswith("box_")
    obstacles = [
        Obstacle(obstacle.name, _vamp_shape(obstacle.shape, of_boxes), obstacle.pose)
        for obstacle in exact.world.scene.obstacles
    ]
    try:
        world = World(_robot(folder, arm, balls=True), Scene(tuple(obstacles)), accuracy="conservative")
        return Problem(world, exact.start, exact.goal)
    except ProblemError:
        return None


@cache
def _robot(folder: Path, arm: str, *, balls: bool) -> Robot:
    name = f"{arm}_spherized.urdf" if balls else f"{arm}.urdf"
    return load_robot(folder / name, srdf=folder / f"{arm}.srdf", group=GROUPS[arm])


def _vamp_shape(shape: Shape, of_boxes: bool) -> Shape:
    """VAMP checks capsules for cylinders, except in the family ``box``, where it takes the boxes around them."""
    if not isinstance(shape, Cylinder):
        return shape
    if of_boxes:
        return Box((2.0 * shape.radius, 2.0 * shape.radius, shape.length))
    return Capsule(shape.radius, shape.length)

"""Our arms and problems as files that everybody reads: URDF, SRDF, STL."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from bench.peers.task import BASE, GROUP, TIP, Solid, Task
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.shape_table import shape_of
from rrtik_ompl.ik.tip_columns import TipColumns, tip_columns
from rrtik_ompl.model.goal import JointGoal
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, Mesh, Shape, Sphere
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


class NoTask(ValueError):
    """The problem has something that not every peer knows."""


def task_of(problem: Problem, folder: Path, seconds: float) -> Task:
    """The problem as files in a folder, the same for all peers: the arm's own solids, limits and pairs.

    Raises:
        NoTask: If the goal is not one configuration, or the scene holds more than boxes, balls, cylinders and capsules.
    """
    scene, robot = problem.world.scene, problem.robot
    if not isinstance(problem.goal, JointGoal) or scene.attached or scene.allowed_collisions:
        raise NoTask(f"{problem.name}: peers take one goal configuration, nothing attached, no contact allowed")
    urdf, srdf = folder / "arm.urdf", folder / "arm.srdf"
    urdf.write_text(serial_urdf(robot, _links(problem.world), folder))
    srdf.write_text(_allowed_pairs(problem.world))
    solids = [solid for item in scene.obstacles for solid in _solids(item.name, item.shape, item.pose)]
    joints = [f"joint{k}" for k in range(robot.dof)]
    ends = problem.start.tolist(), problem.goal.q.tolist()
    return Task(str(urdf), str(srdf), joints, solids, *ends, seconds)


def serial_urdf(robot: Robot, bodies: tuple[Body, ...] = (), folder: Path | None = None) -> str:
    """The joints from base to tip as a URDF of its own, ``link0`` to ``tip``; every axis is z.

    Args:
        robot: The arm.
        bodies: Solids of its links; each link of the arm becomes a link that is fixed to ``link0``, ``link1`` ...
        folder: For meshes.

    Raises:
        ValueError: If the arm has coupled joints.
    """
    tip = uncoupled_columns(robot)
    links = [f"link{k}" for k in range(robot.dof + 1)]
    text = ['<robot name="arm">', *(f'<link name="{name}"/>' for name in (*links, TIP))]
    for k, (low, high) in enumerate(zip(*robot.finite_range(), strict=True)):
        kind = "prismatic" if tip.prismatic[k] else "revolute"
        text.append(
            f'<joint name="joint{k}" type="{kind}">{_between(links[k], links[k + 1], tip.fixed[k])}'
            f'<axis xyz="0 0 1"/><limit lower="{low}" upper="{high}" velocity="1" effort="1"/></joint>'
        )
    text.append(f'<joint name="last" type="fixed">{_between(links[-1], TIP, tip.fixed[-1])}</joint>')
    text += _body_text(robot, bodies, folder)
    return "\n".join([*text, "</robot>"])


def uncoupled_columns(robot: Robot) -> TipColumns:
    """What stands between the joints of an arm without coupled ones.

    Raises:
        ValueError: If it has some.
    """
    tip = tip_columns(robot)
    if not np.array_equal(tip.gain, np.eye(robot.dof)) or tip.offset.any():
        raise ValueError("coupled joints")
    return tip


def _body_text(robot: Robot, bodies: tuple[Body, ...], folder: Path | None) -> Iterator[str]:
    """Links that hold the solids, and the joints that fix them."""
    ours, theirs = robot.joint_frames(np.zeros((1, robot.dof)))[0], _frames_at_zero(robot)
    for name, joint in dict.fromkeys((body.name, body.joint) for body in bodies):
        turned, parts = pin.SE3(np.linalg.inv(theirs[joint]) @ ours[joint]), ""
        for number, body in enumerate(body for body in bodies if body.name == name):
            shape, pose = shape_of(body.geometry), turned * body.placement
            if isinstance(shape, Mesh) and folder is not None:
                file = folder / f"{name}_{number}.stl"
                _write_stl(file, shape)
                parts += _collision(pose.homogeneous, f'<mesh filename="{file.name}"/>')
            else:
                parts += "".join(_collision(np.array(s.pose), _element(s)) for s in _solids(name, shape, pose))
        yield f'<link name="{name}">{parts}</link>'
        yield f'<joint name="{name}_fixed" type="fixed">{_between(f"link{joint}", name, np.eye(4))}</joint>'


def _frames_at_zero(robot: Robot) -> list[np.ndarray]:
    """Poses of ``link0``, ``link1`` ... when all joints are at zero."""
    frames = [np.eye(4)]
    for fixed in tip_columns(robot).fixed[:-1]:
        frames.append(frames[-1] @ fixed)
    return frames


def _links(world: World) -> tuple[Body, ...]:
    """The arm's solids as they were loaded: a mesh is its triangles."""
    robot = world.robot
    loaded = (item.geometry for item in robot.collision.geometryObjects)
    bodies = (body for body in world.bodies if body.kind == "link")
    return tuple(Body(b.name, b.joint, b.placement, g, b.kind) for b, g in zip(bodies, loaded, strict=True))


def _allowed_pairs(world: World) -> str:
    """An SRDF with the group, and the pairs of links that the world does not check."""
    names = list(dict.fromkeys(body.name for body in world.bodies if body.kind == "link"))
    checked = {frozenset((world.bodies[i].name, world.bodies[j].name)) for i, j in world.pairs}
    allowed = (pair for pair in combinations(names, 2) if frozenset(pair) not in checked)
    lines = [f'<disable_collisions link1="{a}" link2="{b}" reason="Never"/>' for a, b in allowed]
    group = f'<group name="{GROUP}"><chain base_link="{BASE}" tip_link="{TIP}"/></group>'
    return "\n".join(['<robot name="arm">', group, *lines, "</robot>"])


def _solids(name: str, shape: Shape | None, pose: Any) -> Iterator[Solid]:
    """A shape as boxes, balls, cylinders; a capsule becomes a cylinder and two balls."""
    place = pose.homogeneous.tolist()
    if isinstance(shape, Box):
        yield Solid(name, "box", shape.size.tolist(), place)
    elif isinstance(shape, Sphere):
        yield Solid(name, "sphere", [shape.radius], place)
    elif isinstance(shape, Cylinder | Capsule):
        yield Solid(name, "cylinder", [shape.radius, shape.length], place)
        for end, height in (("lower", -0.5), ("upper", 0.5)) if isinstance(shape, Capsule) else ():
            cap = pose * pin.SE3(np.eye(3), np.array([0.0, 0.0, height * shape.length]))
            yield Solid(f"{name}, {end} cap", "sphere", [shape.radius], cap.homogeneous.tolist())
    else:
        raise NoTask(f"{name}: not every peer takes a {type(shape).__name__}")


def _collision(T: np.ndarray, geometry: str) -> str:
    return f"<collision>{_origin(T)}<geometry>{geometry}</geometry></collision>"


def _element(solid: Solid) -> str:
    if solid.kind == "box":
        return f'<box size="{" ".join(map(repr, solid.size))}"/>'
    if solid.kind == "sphere":
        return f'<sphere radius="{solid.size[0]!r}"/>'
    return f'<cylinder radius="{solid.size[0]!r}" length="{solid.size[1]!r}"/>'


def _between(parent: str, child: str, T: np.ndarray) -> str:
    return f'<parent link="{parent}"/><child link="{child}"/>{_origin(T)}'


def _origin(T: np.ndarray) -> str:
    rpy, xyz = pin.rpy.matrixToRpy(T[:3, :3]), T[:3, 3]
    return f'<origin xyz="{" ".join(map(repr, map(float, xyz)))}" rpy="{" ".join(map(repr, map(float, rpy)))}"/>'


def _write_stl(file: Path, mesh: Mesh) -> None:
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows = np.zeros(len(corners), STL_TRIANGLE)
    rows["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    rows["corners"] = corners
    file.write_bytes(bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())

"""Draw the arm in the scene tree: one node per joint, with the links and attached objects below it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.colors import hexadecimal
from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Scene
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.meshes import Look, look_of_coal, look_of_shape, triangle_count
from rrtik_ompl.viewer.drawing.nodes import Material, Node

ROBOT_TRIANGLES = 40_000  # largest number for the whole arm; meshes are simplified beyond that


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A solid that moves with a joint.

    Attributes:
        name: Its name in the scene tree.
        joint: Pinocchio joint number, 0 for the base.
        placement: Pose in the joint's frame, shape (4, 4).
        look: Its drawable form.
        color: '#rrggbb'.
    """

    name: str
    joint: int
    placement: NDArray[np.float64]
    look: Look
    color: str


def node_name(name: str) -> str:
    """Convert a name to one step of a path in the scene tree; the conversion is unique.

    The step begins with a colon, because the viewer stores nodes in JavaScript objects, which already have properties
    such as ``constructor``.
    """
    return ":" + name.replace("%", "%25").replace("/", "%2F")


def held_node_name(name: str) -> str:
    """Convert the name of an attached object, which shares the node of a joint with links."""
    return "held" + node_name(name)


def joint_nodes(robot: Robot) -> list[str]:
    """Return the names of the nodes that move, one per Pinocchio joint, the world first."""
    return [node_name(name) for name in robot.model.names]


def link_parts(robot: Robot, triangles: int = ROBOT_TRIANGLES) -> list[Part]:
    """Return the links' visual geometry, or else their collision geometry, with about ``triangles`` triangles."""
    drawn = _link_parts(robot.visual.geometryObjects, triangles)
    return drawn or _link_parts(robot.collision.geometryObjects, triangles)


def _link_parts(bodies: Sequence[pin.GeometryObject], triangles: int) -> list[Part]:
    total = max(sum(triangle_count(body.geometry) for body in bodies), 1)
    parts = []

    for body in bodies:
        share = triangles * triangle_count(body.geometry) // total
        look = look_of_coal(body.geometry, max(share, 200))
        if look is not None:
            parts.append(
                Part(node_name(body.name), body.parentJoint, body.placement.homogeneous, look, _link_color(body))
            )
    return parts


def _link_color(body: pin.GeometryObject) -> str:
    """Return the colour in the robot's description, or one of two alternating greys, which make joints visible."""
    if body.overrideMaterial:
        return hexadecimal(body.meshColor[:3])
    return palette.ROBOT_ALTERNATE if body.parentJoint % 2 else palette.ROBOT


def attached_parts(robot: Robot, attached: Sequence[AttachedObject]) -> list[Part]:
    """Return the attached objects as parts.

    Raises:
        UnknownNameError: If one of them is attached to a link that the robot does not have.
    """
    parts = []
    for item in attached:
        if item.link not in robot.link_names:
            raise UnknownNameError(
                f"link of robot '{robot.name}'", item.link, robot.link_names, where=f"attached '{item.name}'"
            )

        frame = robot.model.frames[robot.model.getFrameId(item.link, pin.FrameType.BODY)]
        placement = (frame.placement * item.pose).homogeneous
        name = held_node_name(item.name)
        parts.append(
            Part(name, frame.parentJoint, placement, look_of_shape(item.shape), item.color or palette.ATTACHED)
        )
    return parts


def nodes_of(robot: Robot, scene: Scene, names: Collection[str]) -> list[list[str]]:
    """Return the paths in the scene tree of links, attached objects and obstacles with the given names."""
    joints = joint_nodes(robot)
    frames = robot.model.frames
    solids = (*robot.visual.geometryObjects, *robot.collision.geometryObjects)

    links = {(joints[s.parentJoint], node_name(s.name)) for s in solids if frames[s.parentFrame].name in names}
    held = {(joints[p.joint], p.name) for p in attached_parts(robot, [a for a in scene.attached if a.name in names])}
    obstacles = [["obstacles", node_name(o.name)] for o in scene.obstacles if o.name in names]

    return [["robot", *steps] for steps in sorted(links | held)] + obstacles


def draw_parts(node: Node, robot: Robot, parts: list[Part], frames: NDArray[np.float64]) -> None:
    """Draw the arm below a node, at the joint frames of one configuration, shape (joints + 1, 4, 4)."""
    names = joint_nodes(robot)
    for name, placement in zip(names, frames, strict=True):
        node[name].set_transform(placement)

    for part in parts:
        leaf = node[names[part.joint]][part.name]
        leaf.set_object(part.look.geometry, Material(color=palette.number(part.color), shininess=40))
        leaf.set_transform(part.placement @ part.look.placement)


def swept_points(parts: list[Part], frames: NDArray[np.float64]) -> Matrix:
    """Return corners of boxes around all parts in the world frame, shape (p, 3), for frames (m, joints + 1, 4, 4)."""
    corners = []
    for part in parts:
        poses = frames[:, part.joint] @ part.placement
        corners.append(np.einsum("mij,pj->mpi", poses[:, :3, :3], part.look.corners) + poses[:, None, :3, 3])
    return np.concatenate([c.reshape(-1, 3) for c in corners]) if corners else np.empty((0, 3))

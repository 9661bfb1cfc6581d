"""Write scenes for others: MuJoCo's MJCF, the ``.scene`` text of MoveIt and RViz, and MoveIt's PlanningScene.

All have obstacles alone. What they cannot state, attached objects, motions, margins and contacts, is named in one
warning.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.errors import InputError, SceneWarning, at_most, few
from rrtik_ompl.base.poses import turned_z
from rrtik_ompl.files.strict_yaml import write_yaml
from rrtik_ompl.files.text import file_name, write_text
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, PointCloud, Prism, Shape, Sphere
from rrtik_ompl.model.shapes.box_pile import BoxPile
from rrtik_ompl.model.shapes.polygons import convex_parts
from rrtik_ompl.problem_files.moveit_messages import SHAPE_NUMBERS

MOST_PARTS = 20_000  # of all obstacles together
FLAT = 1e-6  # of a mesh's extent: a vertex may lie so far before a face of a convex one
CHUNK = 256  # faces at a time, to bound memory


class Part(NamedTuple):
    """A box, ball, cylinder, capsule, half-space or mesh, and its pose in the world (``pinocchio.SE3``)."""

    shape: Shape
    pose: Any


def write_mjcf_scene(scene: Scene, file: str | os.PathLike[str]) -> None:
    """Write the obstacles of a scene as MuJoCo's MJCF: a body for each of them, in the world.

    MuJoCo takes meshes for their hulls; a warning names those that are not convex. A polygon becomes convex parts.

    Raises:
        InputError: If the scene has too many boxes or balls, or the file cannot be written.

    Warns:
        SceneWarning: If something cannot be stated; one line.
    """
    root = Element("mujoco", {"model": file_name(file).stem})
    SubElement(root, "compiler", {"angle": "radian"})
    assets = SubElement(root, "asset")
    world = SubElement(root, "worldbody")
    hulls = []

    for obstacle, parts in _parts(scene, file):
        body = SubElement(world, "body", {"name": obstacle.name, **_place(obstacle.pose)})
        for number, part in enumerate(parts, 1):
            name = obstacle.name if number == 1 else f"{obstacle.name}_{number}"
            own = obstacle.pose.actInv(part.pose)
            if isinstance(part.shape, HalfSpace):
                own = own * pin.SE3(turned_z(part.shape.normal), part.shape.offset * part.shape.normal)
            geom = SubElement(body, "geom", {"name": name, **_place(own)})
            if isinstance(part.shape, Mesh):
                _mesh_asset(assets, name, part.shape)
                geom.attrib.update(type="mesh", mesh=name)
                hulls += [obstacle.name] if isinstance(obstacle.shape, Mesh) and not _is_convex(part.shape) else []
            else:
                kind, size = _geom(part.shape)
                geom.attrib.update(type=kind, size=_text(size))

    _warn(scene, file, [f"to MuJoCo the hulls of {few(hulls)} collide, not the meshes"] if hulls else [])
    indent(root)
    write_text(file, tostring(root, encoding="unicode") + "\n")


def write_scene_text(scene: Scene, file: str | os.PathLike[str]) -> None:
    """Write the obstacles of a scene as MoveIt and RViz save them (``.scene``).

    Capsules, which MoveIt does not have, are written as their surface in triangles.

    Raises:
        InputError: If the scene has too many boxes or balls, a name has a line break, or the file cannot be written.

    Warns:
        SceneWarning: If something cannot be stated; one line.
    """
    lines = [file_name(file).stem]
    for obstacle, parts in _parts(scene, file):
        if "\n" in obstacle.name:
            raise InputError(f"{file}: the name {obstacle.name!r} cannot be written")
        lines += [f"* {obstacle.name}", *_pose_lines(pin.SE3.Identity()), str(len(parts))]
        for part in parts:
            lines += [*_shape_lines(part.shape), *_pose_lines(part.pose), "0 0 0 0"]  # the colour
        lines.append("0")  # subframes
    _warn(scene, file, [])
    write_text(file, "\n".join([*lines, "."]) + "\n")


def write_planning_scene(scene: Scene, file: str | os.PathLike[str]) -> None:
    """Write the obstacles of a scene as MoveIt's PlanningScene, in YAML with ROS's keys, in the frame "world".

    Capsules, which MoveIt does not have, are written as their surface in triangles.

    Raises:
        InputError: If the scene has too many boxes or balls, or the file cannot be written.

    Warns:
        SceneWarning: If something cannot be stated; one line.
    """
    objects = []
    for obstacle, parts in _parts(scene, file):
        message: dict[str, Any] = {"header": {"frame_id": "world"}, "id": obstacle.name}
        message["pose"] = _pose_message(obstacle.pose)
        for part in parts:
            solids, poses, solid = _solid_message(part.shape)
            message.setdefault(solids, []).append(solid)
            message.setdefault(poses, []).append(_pose_message(obstacle.pose.actInv(part.pose)))
        objects.append(message)

    _warn(scene, file, [])
    name = file_name(file).stem
    write_yaml(file, {"name": name, "robot_model_name": "", "world": {"collision_objects": objects}})


WRITERS: dict[str, Callable[[Scene, str | os.PathLike[str]], None]] = {
    ".xml": write_mjcf_scene,
    ".mjcf": write_mjcf_scene,
    ".scene": write_scene_text,
}


def _parts(scene: Scene, file: str | os.PathLike[str]) -> Iterator[tuple[Obstacle, list[Part]]]:
    """Yield each obstacle with the simple solids that it consists of."""
    left = MOST_PARTS
    for obstacle in scene.obstacles:
        left -= _count(obstacle.shape)
        if left < 0:
            remedy = "leave out its clouds and octrees, or make them coarser"
            at_most(MOST_PARTS - left, MOST_PARTS, f"{file}: boxes and balls of the scene", remedy)
        yield obstacle, [Part(shape, obstacle.pose * place) for shape, place in _simple(obstacle.shape)]


def _count(shape: Shape) -> int:
    if isinstance(shape, PointCloud):
        return len(shape.points)
    return len(shape.boxes[0]) if isinstance(shape, BoxPile) else 1


def _simple(shape: Shape) -> Iterator[tuple[Shape, Any]]:
    """Yield the simple solids of a shape, with their poses in its frame."""
    upright = np.eye(3)
    if isinstance(shape, BoxPile):
        for centre, size in zip(*shape.boxes, strict=True):
            yield Box(size), pin.SE3(upright, centre)
    elif isinstance(shape, PointCloud):
        for point in shape.points.astype(np.float64):
            yield Sphere(shape.radius), pin.SE3(upright, point)
    elif isinstance(shape, Prism):
        for polygon in convex_parts(shape.polygon):
            yield Mesh(*Prism(polygon, shape.height).surface()), pin.SE3.Identity()
    else:
        yield shape, pin.SE3.Identity()


def _geom(shape: Shape) -> tuple[str, Sequence[float]]:
    """Return type and size of a geom."""
    match shape:
        case Box():
            return "box", (0.5 * shape.size).tolist()
        case Sphere():
            return "sphere", [shape.radius]
        case Cylinder():
            return "cylinder", [shape.radius, 0.5 * shape.length]
        case Capsule():
            return "capsule", [shape.radius, 0.5 * shape.length]
        case HalfSpace():
            return "plane", [0.0, 0.0, 1.0]  # endless
    raise InputError(f"a {type(shape).__name__} cannot be written as a geom")


def _shape_lines(shape: Shape) -> list[str]:
    """Return the lines of a shape of a ``.scene``."""
    match shape:
        case Box():
            return ["box", _text(shape.size)]
        case Sphere():
            return ["sphere", _text([shape.radius])]
        case Cylinder():
            return ["cylinder", _text([shape.radius, shape.length])]
        case HalfSpace():
            return ["plane", _text([*shape.normal, -shape.offset])]
    vertices, triangles = shape.surface()
    faces = [" ".join(map(str, row)) for row in np.asarray(triangles).tolist()]
    return ["mesh", f"{len(vertices)} {len(faces)}", *map(_text, vertices), *faces]


def _solid_message(shape: Shape) -> tuple[str, str, dict[str, Any]]:
    """Return a shape of a CollisionObject, after the keys under which it and its pose stand."""
    if isinstance(shape, HalfSpace):
        return "planes", "plane_poses", {"coef": [*shape.normal.tolist(), -shape.offset]}
    if shape.moveit:
        number = next(number for number, key in SHAPE_NUMBERS.items() if key == shape.key)
        sizes = np.hstack([getattr(shape, name) for name in shape.moveit]).tolist()
        return "primitives", "primitive_poses", {"type": number, "dimensions": sizes}

    vertices, triangles = shape.surface()
    corners = [{"vertex_indices": row} for row in np.asarray(triangles).tolist()]
    points = [dict(zip("xyz", row, strict=True)) for row in np.asarray(vertices, dtype=np.float64).tolist()]
    return "meshes", "mesh_poses", {"triangles": corners, "vertices": points}


def _mesh_asset(assets: Element, name: str, mesh: Mesh) -> None:
    """Add a mesh by its numbers."""
    faces = " ".join(map(str, np.asarray(mesh.triangles).ravel().tolist()))
    SubElement(assets, "mesh", {"name": name, "vertex": _text(mesh.vertices), "face": faces})


def _is_convex(mesh: Mesh) -> bool:
    """Check whether no vertex of a mesh lies in front of one of its triangles."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    offsets = np.einsum("ni,ni->n", normals, corners[:, 0])
    slack = FLAT * np.ptp(mesh.vertices, axis=0).max()
    rows = range(0, len(normals), CHUNK)
    return all((mesh.vertices @ normals[k : k + CHUNK].T <= offsets[k : k + CHUNK] + slack).all() for k in rows)


def _place(pose: Any) -> dict[str, str]:  # noqa: ANN401 - pinocchio has no types
    """Return a pose as attributes of MJCF."""
    x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
    return {"pos": _text(pose.translation), "quat": _text([w, x, y, z])}


def _pose_lines(pose: Any) -> list[str]:  # noqa: ANN401 - pinocchio has no types
    """Return a pose as two lines: a position, a quaternion x y z w."""
    return [_text(pose.translation), _text(pin.Quaternion(pose.rotation).coeffs())]


def _pose_message(pose: Any) -> dict[str, dict[str, float]]:  # noqa: ANN401 - pinocchio has no types
    """Return a pose as geometry_msgs/Pose."""
    turn = pin.Quaternion(pose.rotation).coeffs().tolist()
    return {
        "position": dict(zip("xyz", pose.translation.tolist(), strict=True)),
        "orientation": dict(zip("xyzw", turn, strict=True)),
    }


def _text(values: ArrayLike) -> str:
    """Return numbers as text, with all their digits."""
    return " ".join(map(repr, np.asarray(values, dtype=np.float64).ravel().tolist()))


def _warn(scene: Scene, file: str | os.PathLike[str], faults: list[str]) -> None:
    """Name in one warning what is not written."""
    moving = [repr(each.name) for each in scene.obstacles if each.motion is not None]
    kept_off = [repr(each.name) for each in scene.obstacles if each.margin]
    faults = [
        *faults,
        *([f"attached: {few([repr(each.name) for each in scene.attached])}"] if scene.attached else []),
        *([f"motions of {few(moving)}"] if moving else []),
        *([f"margins of {few(kept_off)}"] if kept_off else []),
        *(["which pairs may touch"] if scene.allowed_collisions or scene.contacts else []),
    ]
    if faults:
        warnings.warn(SceneWarning(f"{file}: not written: {'; '.join(faults)}"), stacklevel=3)

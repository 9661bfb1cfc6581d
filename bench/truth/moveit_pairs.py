"""Scenes and requests in MoveIt's words about a ball on three slides, and what is right of each, by coal alone."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import yaml

from bench.shared.judge import distance
from rrtik_ompl.base.arrays import Matrix, Vector

SLIDES = (("x", "base", "a", "1 0 0"), ("y", "a", "b", "0 1 0"), ("z", "b", "tool", "0 0 1"))
SLIDE = """<joint name="{}" type="prismatic"><parent link="{}"/><child link="{}"/><axis xyz="{}"/>
<limit lower="-5" upper="5" velocity="1" effort="1"/></joint>
"""
GANTRY = (
    """<robot name="gantry"><link name="base"/><link name="a"/><link name="b"/>
<link name="tool"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
"""
    + "".join(SLIDE.format(*slide) for slide in SLIDES)
    + "</robot>\n"
)

Message = dict[str, Any]
Solid = tuple[Any, Any]  # of coal, and its pose: an obstacle's in the world, a part's in the frame of the tool
NOWHERE = pin.SE3.Identity()
QUARTER = [0.0, 0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5))]  # a quarter turn about z
TWO_RADIANS = [0.0, 0.0, float(np.sin(1.0)), float(np.cos(1.0))]  # about z


def at(x: float, y: float, z: float) -> pin.SE3:
    """A place without a turn."""
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def pose(x: float, y: float, z: float, turn: list[float] | None = None) -> Message:
    """The same as a message."""
    return {"position": [x, y, z], "orientation": turn or [0, 0, 0, 1]}


def box(name: str, size: list[float], place: Message, frame: str = "base", **more: Any) -> Message:
    """An object of one box."""
    primitives = [{"type": "box", "dimensions": size}]
    return {"id": name, "header": {"frame_id": frame}, "primitives": primitives, "primitive_poses": [place]} | more


def attached(item: Message) -> Message:
    """An object that the tool holds."""
    return {"link_name": "tool", "object": item, "touch_links": ["tool"]}


PLATE = box("plate", [0.2, 1, 1], pose(0.5, 0, 0))
ROD = box("rod", [0.7, 0.02, 0.02], pose(0, 0, 0), "tool")
WALL: Solid = (coal.Box(0.2, 1.0, 1.0), at(0.5, 0.0, 0.0))
BALL: Solid = (coal.Sphere(0.01), NOWHERE)
STICK: Solid = (coal.Box(0.7, 0.02, 0.02), NOWHERE)


def joints(x: float, y: float, z: float) -> Message:
    """A goal of all three slides."""
    names = zip("xyz", (x, y, z), strict=True)
    wanted = [{"joint_name": n, "position": v, "tolerance_above": 0.001, "tolerance_below": 0.001} for n, v in names]
    return {"joint_constraints": wanted}


def ball(place: Message, frame: str = "base", radius: float = 0.01, **more: Any) -> Message:
    """A position that the tool has to reach."""
    region = {"primitives": [{"type": "sphere", "dimensions": [radius]}], "primitive_poses": [place]}
    return {"header": {"frame_id": frame}, "link_name": "tool", "constraint_region": region} | more


def turned(tolerances: list[float], orientation: list[float], frame: str = "base") -> Message:
    """An orientation that the tool has to have."""
    axes = {f"absolute_{axis}_axis_tolerance": value for axis, value in zip("xyz", tolerances, strict=True)}
    return {"header": {"frame_id": frame}, "link_name": "tool", "orientation": orientation} | axes


def tree_of_one_cell(child: int) -> list[int]:
    """The bytes of a map of which one cell, an eighth of an eighth..., of the finest level is occupied."""
    nodes = []
    for level in range(16):
        number = child if level == 0 else 7 - child  # the innermost corner of the cells of level 1
        nodes.append((2 if level == 15 else 3) << (2 * number))
    return [b if b < 128 else b - 256 for node in nodes for b in struct.pack("<H", node)]


@dataclass(frozen=True)
class Case:
    """A pair of files, and what is right of it.

    Attributes:
        scene, request: Keys that are added to an empty scene and to a request from 0 to 1 along x.
        refused: Words of the refusal; "" if it has to be read.
        parts: What moves with the tool.
        obstacles: What stands.
        room: What the parts must keep from the obstacles [m].
        base: Where the slides begin.
        goal: Whether a place of the tool, shape (3,), is at the goal.
        kept: Whether one may be on a path.
    """

    scene: Message = field(default_factory=dict)
    request: Message = field(default_factory=dict)
    refused: str = ""
    parts: tuple[Solid, ...] = (BALL,)
    obstacles: tuple[Solid, ...] = (WALL,)
    room: float = 0.0
    base: pin.SE3 = NOWHERE
    goal: Callable[[Vector], bool] = lambda tip: bool(np.allclose(tip, [1.0, 0.0, 0.0], atol=1e-5))
    kept: Callable[[Vector], bool] = lambda tip: bool(len(tip) == 3)

    def write(self, folder: Path) -> Path:
        """Write both files and the URDF; the scene's file."""
        world = {"collision_objects": [PLATE], "octomap": {}} | self.scene.get("world", {})
        scene = {"name": "s", "robot_model_name": "gantry", "robot_state": {}} | self.scene | {"world": world}
        start = {"joint_state": {"name": ["x", "y", "z"], "position": [0, 0, 0]}} | self.request.get("start_state", {})
        request = {"group_name": "arm", "goal_constraints": [joints(1, 0, 0)]} | self.request | {"start_state": start}
        (folder / "gantry.urdf").write_text(GANTRY)
        (folder / "request0001.yaml").write_text(yaml.safe_dump(request))
        file = folder / "scene0001.yaml"
        file.write_text(yaml.safe_dump(scene))
        return file

    def distance(self, q: Vector) -> float:
        """Of the nearest part from the nearest obstacle at a configuration [m], by coal."""
        tool = self.base * at(*q)
        pairs = product(self.parts, self.obstacles)
        return min(
            (distance(part, tool * place, solid, there) for (part, place), (solid, there) in pairs), default=np.inf
        )

    def tip(self, q: Vector) -> Vector:
        """Where the tool is at a configuration."""
        place: Vector = (self.base * at(*q)).translation
        return place


def base_at(place: Message) -> Message:
    """A start state whose base stands elsewhere."""
    transform = {"translation": place["position"], "rotation": place["orientation"]}
    return {
        "multi_dof_joint_state": {
            "header": {"frame_id": "world"},
            "joint_names": ["virtual"],
            "transforms": [transform],
        }
    }


def near(place: list[float], radius: float = 0.0101) -> Callable[[Vector], bool]:
    """Whether a place is within a ball."""
    return lambda tip: bool(np.linalg.norm(tip - place) <= radius)


def world(*items: Message, **more: Any) -> Message:
    """The scene's key of that name."""
    return {"world": {"collision_objects": list(items)} | more}


def matrix(names: list[str], values: list[Any], **more: Any) -> Message:
    """The table of allowed collisions."""
    return {"allowed_collision_matrix": {"entry_names": names, "entry_values": values} | more}


def solids(key: str, poses: str, solid: Message, place: Message, frame: str = "base") -> Message:
    """An object of one mesh or plane."""
    return {"id": key, "header": {"frame_id": frame}, key: [solid], poses: [place]}


def octomap(data: list[int], binary: bool = True) -> Message:
    """A map of cells of 0.2 m."""
    tree = {"binary": binary, "id": "OcTree", "resolution": 0.2, "data": data}
    return {"header": {"frame_id": "base"}, "origin": pose(0.4, -0.1, -0.1), "octomap": tree}


def moved(item: Message, **more: Any) -> Message:
    """The same object with other keys."""
    return item | more


def position(place: Message, size: list[float], **more: Any) -> Message:
    """A box in which the tool has to be."""
    region = {"primitives": [{"type": "box", "dimensions": size}], "primitive_poses": [place]}
    return {"header": {"frame_id": "base"}, "link_name": "tool", "constraint_region": region} | more


def fixed(parent: str, child: str, x: float) -> Message:
    """A frame that stands in another one, along its x axis."""
    transform = {"translation": [x, 0, 0], "rotation": [0, 0, 0, 1]}
    return {"header": {"frame_id": parent}, "child_frame_id": child, "transform": transform}


BLOCK = {  # 0.2 x 1 x 1 m, whose lowest corner is its origin
    "vertices": [{"x": x, "y": y, "z": z} for x, y, z in product((0.0, 0.2), (0.0, 1.0), (0.0, 1.0))],
    "triangles": [
        {"vertex_indices": row}
        for a, b, c, d in ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        for row in ([a, b, c], [a, c, d])
    ],
}
GROUND: Solid = (coal.Halfspace(np.array([0.0, 0.0, 1.0]), -0.4), NOWHERE)
HELD = {"attached_collision_objects": [attached(ROD)]}
SIDEWAYS = pin.SE3(pin.Quaternion(*[QUARTER[k] for k in (3, 0, 1, 2)]).matrix(), np.array([0.0, 0.0, 0.5]))
FREE_PAIR: tuple[Solid, ...] = ()
AT_ONE = [1.0, 0.0, 0.2]

CASES: dict[str, Case] = {
    "a plate": Case(),
    "held in the scene's state": Case({"robot_state": HELD}, parts=(BALL, STICK)),
    "held in the start state": Case({}, {"start_state": HELD}, parts=(BALL, STICK)),
    "held in both": Case({"robot_state": HELD}, {"start_state": HELD}, parts=(BALL, STICK)),
    "padding of a link": Case({"link_padding": [{"link_name": "tool", "padding": 0.1}]}, room=0.1),
    "scale of a link": Case(
        {"link_scale": [{"link_name": "tool", "scale": 10.0}]}, parts=((coal.Sphere(0.1), NOWHERE),)
    ),
    "padding and scale of what is held": Case(
        {
            "robot_state": HELD,
            "link_padding": [{"link_name": "tool", "padding": 0.03}],
            "link_scale": [{"link_name": "tool", "scale": 0.5}],
        },
        parts=((coal.Sphere(0.005), NOWHERE), (coal.Box(0.35, 0.01, 0.01), NOWHERE)),
        room=0.03,
    ),
    "a padding of a link that does not exist": Case(
        {"link_padding": [{"link_name": "tol", "padding": 0.1}]}, refused="link_padding.*'tol'.*did you mean 'tool'"
    ),
    "a map that is none": Case(world(PLATE, octomap=octomap([1, 2, 3])), refused="octomap.*not a tree of OctoMap"),
    "a full map that is none": Case(
        world(PLATE, octomap=octomap([1, 2], False)), refused="octomap.*not a tree of OctoMap"
    ),
    "a map of one cell": Case(
        world(octomap=octomap(tree_of_one_cell(7))), obstacles=((coal.Box(0.2, 0.2, 0.2), at(0.5, 0.0, 0.0)),)
    ),
    "a joint kept on the path": Case(
        {},
        {
            "path_constraints": {
                "joint_constraints": [
                    {"joint_name": "z", "position": 0, "tolerance_above": 0.01, "tolerance_below": 0.01, "weight": 1}
                ]
            }
        },
        kept=lambda tip: bool(abs(tip[2]) <= 0.01),
    ),
    "a box kept on the path": Case(
        {},
        {"path_constraints": {"position_constraints": [position(pose(0.5, 0, 0), [4, 4, 0.02])]}},
        kept=lambda tip: bool(abs(tip[2]) <= 0.01),
    ),
    "an orientation kept on the path": Case(
        {}, {"path_constraints": {"orientation_constraints": [turned([0.1, 0.1, 3.2], QUARTER)]}}
    ),
    "an orientation that is never kept": Case(
        {},
        {"path_constraints": {"orientation_constraints": [turned([0.1, 0.1, 0.1], QUARTER)]}},
        refused="path_constraints.*90|path_constraints.*84",
    ),
    "a path in a frame that moves": Case(
        {},
        {
            "path_constraints": {
                "position_constraints": [position(pose(0, 0, 0), [1, 1, 1], header={"frame_id": "tool"})]
            }
        },
        refused="path_constraints.*'tool' moves with the arm",
    ),
    "a goal in the frame of a raised base": Case(
        {},
        {
            "start_state": base_at(pose(0, 0, 1)),
            "goal_constraints": [{"position_constraints": [ball(pose(1, 0, 0.2), target_point_offset=[0, 0, 0])]}],
        },
        obstacles=((coal.Box(0.2, 1.0, 1.0), at(0.5, 0.0, 1.0)),),
        base=at(0, 0, 1),
        goal=near([1.0, 0.0, 1.2]),
    ),
    "a goal in the frame of the tool at the start": Case(
        {},
        {
            "start_state": {"joint_state": {"name": ["x", "y", "z"], "position": [0.1, 0, 0]}},
            "goal_constraints": [{"position_constraints": [ball(pose(0.9, 0, 0.2), "tool")]}],
        },
        goal=near(AT_ONE),
    ),
    "a goal in a fixed frame": Case(
        {
            "fixed_frame_transforms": [
                {
                    "header": {"frame_id": "map"},
                    "child_frame_id": "cell",
                    "transform": {"translation": [1, 1, 0], "rotation": [0, 0, 0, 1]},
                }
            ]
        },
        {"goal_constraints": [{"position_constraints": [ball(pose(0, -1, 0.2), "cell")]}]},
        goal=near(AT_ONE),
    ),
    "a goal in the frame of an object": Case(
        {},
        {"goal_constraints": [{"position_constraints": [ball(pose(0.5, 0, 0.2), "plate")]}]},
        goal=near(AT_ONE),
    ),
    "a goal beside the tool's origin": Case(
        {},
        {"goal_constraints": [{"position_constraints": [ball(pose(1, 0, 0.5), target_point_offset={"z": 0.3})]}]},
        goal=near(AT_ONE),
    ),
    "a goal in a box": Case(
        {},
        {"goal_constraints": [{"position_constraints": [position(pose(1.2, 0, 0.2), [0.4, 0.02, 0.02])]}]},
        goal=lambda tip: bool((np.abs(tip - [1.2, 0.0, 0.2]) <= [0.2, 0.01, 0.01]).all()),
    ),
    "a goal in a frame that does not exist": Case(
        {}, {"goal_constraints": [{"position_constraints": [ball(pose(1, 0, 0.2), "nosuchframe")]}]}, "'nosuchframe'"
    ),
    "a goal free about z": Case(
        {},
        {
            "goal_constraints": [
                {
                    "position_constraints": [ball(pose(1, 0, 0.2))],
                    "orientation_constraints": [turned([0.1, 0.1, 3.15], TWO_RADIANS)],
                }
            ]
        },
        goal=near(AT_ONE),
    ),
    "objects of a base that is moved and turned": Case(
        world(box("can", [0.1, 0.1, 0.1], pose(0.6, 0, -0.35), "base"), PLATE | {"header": {"frame_id": "world"}}),
        {
            "start_state": base_at(pose(0, 0, 0.5, QUARTER)),
            "goal_constraints": [{"position_constraints": [ball(pose(1, 0, 0.2), "world")]}],
        },
        obstacles=(WALL, (coal.Box(0.1, 0.1, 0.1), at(0.0, 0.6, 0.15))),
        base=SIDEWAYS,
        goal=near(AT_ONE),
    ),
    "ROS's form of the matrix": Case(
        matrix(["plate", "tool"], [{"enabled": [False, True]}, {"enabled": [True, False]}]), obstacles=FREE_PAIR
    ),
    "default entries": Case(
        matrix([], [], default_entry_names=["plate"], default_entry_values=[True]), obstacles=FREE_PAIR
    ),
    "default entries beside the table": Case(
        matrix(
            ["plate", "tool"],
            [[False, False], [False, False]],
            default_entry_names=["plate"],
            default_entry_values=[True],
        )
    ),
    "an object taken away at once": Case(world(moved(PLATE, operation=1)), obstacles=FREE_PAIR),
    "an object taken away later": Case(world(PLATE, {"id": "plate", "operation": "remove"}), obstacles=FREE_PAIR),
    "all objects taken away": Case(world(PLATE, {"id": "", "operation": 1}), obstacles=FREE_PAIR),
    "an object with another part": Case(
        world(PLATE, moved(box("plate", [0.1, 0.1, 3], pose(0.2, 0.6, 0)), operation=2)),
        obstacles=(WALL, (coal.Box(0.1, 0.1, 3.0), at(0.2, 0.6, 0.0))),
    ),
    "an object moved": Case(
        world(PLATE, {"id": "plate", "operation": 3, "header": {"frame_id": "base"}, "pose": pose(0.1, 0.3, 0)}),
        obstacles=((coal.Box(0.2, 1.0, 1.0), at(0.6, 0.3, 0.0)),),
    ),
    "an object of the world that is held": Case(
        world(PLATE, box("bar", [0.02, 0.02, 0.4], pose(0, 0, 0.3))),
        {"start_state": {"attached_collision_objects": [{"link_name": "tool", "object": {"id": "bar"}}]}},
        parts=(BALL, (coal.Box(0.02, 0.02, 0.4), at(0.0, 0.0, 0.3))),
    ),
    "an object of the world that a scaled link holds": Case(
        world(PLATE, box("bar", [0.02, 0.02, 0.4], pose(0, 0, 0.3)))
        | {"link_scale": [{"link_name": "tool", "scale": 2.0}]},
        {"start_state": {"attached_collision_objects": [{"link_name": "tool", "object": {"id": "bar"}}]}},
        parts=((coal.Sphere(0.02), NOWHERE), (coal.Box(0.04, 0.04, 0.8), at(0.0, 0.0, 0.3))),
    ),
    "a base of the scene's state": Case(
        {"robot_state": base_at(pose(0, 0, 1))},
        {"goal_constraints": [{"position_constraints": [ball(pose(1, 0, 0.2))]}]},
        obstacles=((coal.Box(0.2, 1.0, 1.0), at(0.5, 0.0, 1.0)),),
        base=at(0, 0, 1),
        goal=near([1.0, 0.0, 1.2]),
    ),
    "an object at the tool where the scene has that": Case(
        {"robot_state": {"joint_state": {"name": ["x", "y", "z"], "position": [0.4, 0.1, 0]}}}
        | world(box("plate", [0.2, 1, 1], pose(0.1, -0.1, 0), "tool"))
    ),
    "held at a place of the world where the scene has the tool": Case(
        {
            "robot_state": {
                "joint_state": {"name": ["x", "y", "z"], "position": [0.4, 0.1, 0.2]},
                "attached_collision_objects": [attached(box("rod", [0.7, 0.02, 0.02], pose(0.4, 0.1, 0.2), "world"))],
            }
        },
        parts=(BALL, STICK),
    ),
    "a goal in the frame of what was held there": Case(
        {
            "robot_state": {
                "joint_state": {"name": ["x"], "position": [0.4]},
                "attached_collision_objects": [attached(box("rod", [0.7, 0.02, 0.02], pose(0.4, 0, 0), "world"))],
            }
        },
        {"goal_constraints": [{"position_constraints": [ball(pose(1, 0, 0.2), "rod")]}]},
        parts=(BALL, STICK),
        goal=near(AT_ONE),
    ),
    "fixed frames in any order": Case(
        {"fixed_frame_transforms": [fixed("shelf", "cell", 0.3), fixed("world", "shelf", 0.2)]}
        | world(moved(PLATE, header={"frame_id": "cell"}, primitive_poses=[pose(0, 0, 0)]))
    ),
    "fixed frames in each other": Case(
        {"fixed_frame_transforms": [fixed("shelf", "cell", 0.3), fixed("cell", "shelf", 0.2)]},
        refused="fixed_frame_transforms.*cell, shelf",
    ),
    "coordinates with names and constants of ROS": Case(
        world(
            moved(
                PLATE,
                primitives=[{"type": 1, "dimensions": [0.2, 1, 1]}],
                primitive_poses=[{"position": {"x": 0.5, "y": 0.0, "z": 0.0}, "orientation": {"w": 1.0}}],
            )
        )
    ),
    "a goal that is to be seen": Case(
        {},
        {"goal_constraints": [joints(1, 0, 0) | {"visibility_constraints": [{"target_radius": 0.1}]}]},
        "visibility_constraints.*is not read",
    ),
    "trajectory constraints": Case(
        {}, {"trajectory_constraints": {"constraints": [{"name": "a"}]}}, r"trajectory_constraints: it is not read"
    ),
    "a scene that is a difference": Case({"is_diff": True}, refused="is_diff: it is not read"),
    "a misspelt key": Case({"link_paddings": [{"link_name": "tool"}]}, refused="did you mean 'link_padding'"),
    "a mesh": Case(world(solids("meshes", "mesh_poses", BLOCK, pose(0.4, -0.5, -0.5)))),
    "a mesh of which a link holds half": Case(
        {
            "robot_state": {
                "attached_collision_objects": [attached(solids("meshes", "mesh_poses", BLOCK, pose(0, 0, 0), "tool"))]
            },
            "link_scale": [{"link_name": "tool", "scale": 0.5}],
        },
        parts=((coal.Sphere(0.005), NOWHERE), (coal.Box(0.1, 0.5, 0.5), at(0.1, 0.5, 0.5))),
    ),
    "a plane": Case(
        world(solids("planes", "plane_poses", {"coef": [0, 0, 2, 1]}, pose(0, 0, 0.1))), obstacles=(GROUND,)
    ),
    "a mesh of numbers": Case(world(moved(PLATE, meshes=[{"triangles": [1]}])), refused=r"meshes\[0\]\.triangles\[0\]"),
}


def configurations(case: Case, count: int, seed: int) -> Matrix:
    """Random ones around the obstacles and the start, shape (count, 3)."""
    rows: Matrix = np.random.default_rng(seed).uniform([-0.6, -1.0, -1.0], [1.4, 1.0, 1.0], (count, 3))
    if case.base is SIDEWAYS:
        rows = np.array([case.base.actInv(row) for row in rows])
    return rows

"""MoveIt's messages as MotionBenchMaker files hold them: PlanningScene, MotionPlanRequest and their parts.

Every key of a message belongs to one of three classes. It is read; or it has no effect on the path problem (who
planned, for how long, colours) and is listed in ``says_nothing``; or it is refused if its value is not empty. A value
is empty if ROS fills it in by default: nothing, no text, 0, false, and lists and groups of these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
import pinocchio as pin
from pydantic import BaseModel, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import IDENTITY_QUATERNION, pose_from_xyzw
from rrtik_ompl.files.sections import Length, Name, NotNegative, Number, Positive, Vector3, Vector4
from rrtik_ompl.model.shapes import SHAPES, HalfSpace, Mesh, Shape

KNOWN = {key: kind for key, kind in sorted(SHAPES.items()) if kind.moveit}
SHAPE_NUMBERS = {1: "box", 2: "sphere", 3: "cylinder", 4: "cone", 5: "prism"}  # constants of shape_msgs/SolidPrimitive
OPERATION_NUMBERS = {0: "add", 1: "remove", 2: "append", 3: "move"}  # constants of moveit_msgs/CollisionObject
if TYPE_CHECKING:
    PrimitiveName = str
else:
    PrimitiveName = Literal[tuple(KNOWN)]


def _by_number(names: dict[int, str]) -> BeforeValidator:
    """Return a validator that replaces the numeric constants of a message by their names."""

    def named(value: object) -> object:
        if isinstance(value, bool) or not isinstance(value, int):
            return value.lower() if isinstance(value, str) else value
        return names.get(value, value)

    return BeforeValidator(named)


def _listed(keys: str) -> BeforeValidator:
    """Return a validator that turns ``{x: .., y: .., z: ..}``, as ROS prints a vector, into a list of numbers."""

    def listed(value: object) -> object:
        if not isinstance(value, dict):
            return value
        for key in value:
            if key not in tuple(keys):
                raise PydanticCustomError("unread", "'{name}' is no coordinate", {"name": str(key)})
        return [value.get(key, 0.0) for key in keys]

    return BeforeValidator(listed)


def _row(value: object) -> object:
    """Turn ``{enabled: [..]}``, as ROS writes a row of a table, into the row."""
    return value["enabled"] if isinstance(value, dict) and set(value) == {"enabled"} else value


Vector = Annotated[Vector3, _listed("xyz")]
Quaternion = Annotated[Vector4, _listed("xyzw")]


class Message(BaseModel):
    """A message that refuses unknown keys unless their values are empty.

    Attributes:
        says_nothing: Keys that are ignored, because they do not affect the problem.
    """

    says_nothing: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def _all_is_read(cls, data: object) -> object:
        for key, value in data.items() if isinstance(data, dict) else ():
            if key in cls.model_fields or key in cls.says_nothing or is_empty(value):
                continue
            near = get_close_matches(str(key), cls.model_fields, n=1, cutoff=0.85)
            raise PydanticCustomError(
                "unread",
                "it is not read, and a path without it may be wrong; {remedy}",
                {
                    "key": str(key),
                    "remedy": f"did you mean '{near[0]}'?" if near else "take it out if the problem does not need it",
                },
            )
        return data


def is_empty(value: object) -> bool:
    """Check whether a value of a message is empty: what ROS fills in by default."""
    if isinstance(value, dict):
        return all(map(is_empty, value.values()))
    if isinstance(value, list):
        return all(map(is_empty, value))
    return value is None or value == "" or value == 0  # False equals 0


class PoseMessage(Message):
    """A pose."""

    position: Vector = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    orientation: Quaternion = Field(default_factory=lambda: list(IDENTITY_QUATERNION))

    @property
    def given(self) -> bool:
        """Whether the pose was filled in: a quaternion of zeros stands for none."""
        return bool(self.model_fields_set) and any(self.orientation)

    def build(self) -> pin.SE3:
        """Return the pose as ``pinocchio.SE3``; the identity if it was not filled in."""
        return pose_from_xyzw(self.position, self.orientation if any(self.orientation) else IDENTITY_QUATERNION)


class Header(Message):
    """The frame that coordinates refer to."""

    says_nothing = ("seq", "stamp")

    frame_id: str = ""


class Primitive(Message):
    """A shape: box [x, y, z], cylinder [height, radius], sphere [radius], full sizes in metres."""

    type: Annotated[PrimitiveName, _by_number(SHAPE_NUMBERS)]
    dimensions: Annotated[list[Length], Field(min_length=1, max_length=3)]

    def check(self) -> None:
        """Raise an error if the number of dimensions is wrong.

        Raises:
            InputError: It says how many there must be.
        """
        count = sum(self._counts().values())
        if len(self.dimensions) != count:
            raise InputError(f"a {self.type} has {count} dimensions, found {len(self.dimensions)}")

    def build(self, factor: float = 1.0) -> Shape:
        """Return the shape, scaled by a factor.

        Raises:
            InputError: If the number of dimensions is wrong.
        """
        self.check()
        kind = KNOWN[self.type]
        sizes = self._counts()
        rest = iter([factor * size for size in self.dimensions])
        values = {}
        for name in kind.moveit:
            values[name] = next(rest) if sizes[name] == 1 else [next(rest) for _ in range(sizes[name])]
        return kind(**values)

    def _counts(self) -> dict[str, int]:
        """Return how many numbers each measure has."""
        return {m.name: 3 if m.kind == "three lengths" else 1 for m in KNOWN[self.type].measures}


class MeshTriangle(Message):
    """The corners of a triangle, as numbers of vertices."""

    vertex_indices: Annotated[list[int], Field(min_length=3, max_length=3)]


class MeshMessage(Message):
    """A mesh by its triangles and vertices [m]."""

    triangles: list[MeshTriangle] = Field(default_factory=list)
    vertices: list[Vector] = Field(default_factory=list)

    def build(self, factor: float = 1.0) -> Shape:
        """Return the mesh, scaled by a factor about the mean of its vertices, as MoveIt does.

        Raises:
            InputError: If it is no mesh.
        """
        vertices = np.array(self.vertices, dtype=np.float64).reshape(-1, 3)
        if factor != 1.0 and len(vertices):
            centre = vertices.mean(axis=0)
            vertices = centre + factor * (vertices - centre)
        return Mesh(vertices, [each.vertex_indices for each in self.triangles])


class PlaneMessage(Message):
    """A plane a x + b y + c z + d = 0; what lies behind it is filled."""

    coef: Vector4

    def build(self, factor: float = 1.0) -> Shape:
        """Return the half-space; it has no size that a factor could scale.

        Raises:
            InputError: If its normal is 0.
        """
        del factor
        *normal, d = self.coef
        return HalfSpace(normal, -d)


Solid = Primitive | MeshMessage | PlaneMessage


class CollisionObject(Message):
    """One or several shapes under one name, and the operation on them."""

    says_nothing = ("type",)

    id: str = ""
    header: Header = Field(default_factory=Header)  # a factory takes a fifth of the time of a copy
    pose: PoseMessage = Field(default_factory=PoseMessage)
    primitives: list[Primitive] = Field(default_factory=list)
    primitive_poses: list[PoseMessage] = Field(default_factory=list)
    meshes: list[MeshMessage] = Field(default_factory=list)
    mesh_poses: list[PoseMessage] = Field(default_factory=list)
    planes: list[PlaneMessage] = Field(default_factory=list)
    plane_poses: list[PoseMessage] = Field(default_factory=list)
    subframe_names: list[Name] = Field(default_factory=list)
    subframe_poses: list[PoseMessage] = Field(default_factory=list)
    operation: Annotated[Literal["add", "remove", "append", "move"], _by_number(OPERATION_NUMBERS)] = "add"

    def check(self) -> None:
        """Raise an error if lists have different lengths.

        Raises:
            InputError: If a shape or a subframe has no pose, or if a shape has a wrong number of dimensions.
        """
        for solid in self.primitives:
            solid.check()

        for what, solids, key, poses in self._lists():
            if len(poses) != len(solids) and (poses or not self.pose.given):
                raise InputError(
                    f"'{self.id}' has {len(solids)} {what}, but {len(poses)} {key}; give one pose for each"
                )
        if len(self.subframe_poses) != len(self.subframe_names):
            count = f"{len(self.subframe_names)} subframe_names, but {len(self.subframe_poses)} subframe_poses"
            raise InputError(f"'{self.id}' has {count}; give one pose for each")

    @property
    def solids(self) -> list[Solid]:
        """Its primitives, meshes and planes, in this order."""
        return [*self.primitives, *self.meshes, *self.planes]

    @property
    def poses(self) -> list[PoseMessage]:
        """The poses that are given for these."""
        return [*self.primitive_poses, *self.mesh_poses, *self.plane_poses]

    def places(self) -> list[pin.SE3]:
        """Return the pose of each shape in the frame of the object."""
        return [
            place
            for _, solids, _, poses in self._lists()
            for place in [each.build() for each in poses] or [pin.SE3.Identity()] * len(solids)
        ]

    def _lists(self) -> Iterator[tuple[str, Sequence[Solid], str, list[PoseMessage]]]:
        """Yield the shapes of each kind and their poses, with the keys of both."""
        yield "primitives", self.primitives, "primitive_poses", self.primitive_poses
        yield "meshes", self.meshes, "mesh_poses", self.mesh_poses
        yield "planes", self.planes, "plane_poses", self.plane_poses


class AllowedMatrix(Message):
    """Which pairs of names may touch."""

    entry_names: list[str] = Field(default_factory=list)
    entry_values: list[Annotated[list[bool], BeforeValidator(_row)]] = Field(default_factory=list)
    default_entry_names: list[str] = Field(default_factory=list)
    default_entry_values: list[bool] = Field(default_factory=list)

    def stated(self) -> dict[tuple[str, str], bool]:
        """Return the entries of the table for pairs of different names, each pair once.

        Raises:
            InputError: If the table is not square.
        """
        rows = self.entry_values
        count = len(self.entry_names)
        if len(rows) != count or any(len(row) != count for row in rows):
            raise InputError(f"entry_values must be a table of {count} x {count}, one row and column per entry name")

        found = {}
        for i, first in enumerate(self.entry_names):
            for j, second in enumerate(self.entry_names[:i]):
                found[second, first] = rows[i][j] or rows[j][i]
        return found

    def defaults(self) -> dict[str, bool]:
        """Return for each name with a default whether it may touch the names for which the table has no entry with it.

        Raises:
            InputError: If the numbers of names and values differ.
        """
        names = self.default_entry_names
        values = self.default_entry_values
        if len(names) != len(values):
            raise InputError(f"{len(names)} default_entry_names, but {len(values)} default_entry_values")
        return dict(zip(names, values, strict=True))


class Octomap(Message):
    """The cells of a map of OctoMap."""

    says_nothing = ("header",)

    binary: bool = False
    id: str = ""
    resolution: Number = 0.0
    data: list[int] = Field(default_factory=list)


class PlacedOctomap(Message):
    """A map of OctoMap, and where it is."""

    header: Header = Header()
    origin: PoseMessage = PoseMessage()
    octomap: Octomap = Octomap()


class WorldMessage(Message):
    """The obstacles."""

    collision_objects: list[CollisionObject] = Field(default_factory=list)
    octomap: PlacedOctomap = PlacedOctomap()


class JointState(Message):
    """Joint values [rad or m]."""

    says_nothing = ("header", "velocity", "effort")

    name: list[str] = Field(default_factory=list)
    position: list[Number] = Field(default_factory=list)


class Transform(Message):
    """A pose in the format of geometry_msgs/Transform."""

    translation: Vector = Field(default=[0.0, 0.0, 0.0])
    rotation: Quaternion = Field(default=list(IDENTITY_QUATERNION))

    def build(self) -> pin.SE3:
        """Return the pose as ``pinocchio.SE3``; the identity if it was not filled in."""
        return pose_from_xyzw(self.translation, self.rotation if any(self.rotation) else IDENTITY_QUATERNION)


class BaseState(Message):
    """State of the joint between world and base."""

    says_nothing = ("joint_names", "twist", "wrench")

    header: Header = Header()
    transforms: list[Transform] = Field(default_factory=list, max_length=1)


class AttachedMessage(Message):
    """An object that is attached to a link."""

    says_nothing = ("detach_posture", "weight")

    link_name: Name
    object: CollisionObject
    touch_links: list[str] = Field(default_factory=list)


class RobotState(Message):
    """Joint values, the pose of the base, and attached objects."""

    says_nothing = ("is_diff",)  # joints without a value keep that of the scene

    joint_state: JointState = JointState()
    multi_dof_joint_state: BaseState = BaseState()
    attached_collision_objects: list[AttachedMessage] = Field(default_factory=list)

    def values(self) -> dict[str, float]:
        """Return the value of each joint.

        Raises:
            InputError: If the numbers of names and positions differ.
        """
        names = self.joint_state.name
        positions = self.joint_state.position
        if len(names) != len(positions):
            raise InputError(f"{len(names)} joint names, but {len(positions)} positions; give one position for each")
        return dict(zip(names, positions, strict=True))


class FixedFrame(Message):
    """A frame that stands still in another one."""

    header: Header = Header()
    child_frame_id: Name
    transform: Transform = Transform()


class LinkPadding(Message):
    """The padding of a link [m]."""

    link_name: Name
    padding: NotNegative = 0.0


class LinkScale(Message):
    """The scale factor of a link."""

    link_name: Name
    scale: Positive = 1.0


class SceneMessage(Message):
    """A PlanningScene."""

    says_nothing = ("name", "object_colors")

    robot_model_name: str  # may be empty, for any robot
    robot_state: RobotState = RobotState()
    fixed_frame_transforms: list[FixedFrame] = Field(default_factory=list)
    allowed_collision_matrix: AllowedMatrix = AllowedMatrix()
    link_padding: list[LinkPadding] = Field(default_factory=list)
    link_scale: list[LinkScale] = Field(default_factory=list)
    world: WorldMessage = WorldMessage()


class JointConstraint(Message):
    """The wanted value of a joint, and the allowed deviations from it [rad or m]."""

    says_nothing = ("weight",)

    joint_name: str
    position: Number
    tolerance_above: NotNegative = 0.0
    tolerance_below: NotNegative = 0.0


class Region(Message):
    """Volume that a link has to reach: a union of primitives."""

    primitives: list[Primitive] = Field(default_factory=list)
    primitive_poses: list[PoseMessage] = Field(default_factory=list)


class PositionConstraint(Message):
    """A point of a link has to be inside a region."""

    says_nothing = ("weight",)

    header: Header = Header()
    link_name: Name
    target_point_offset: Annotated[list[Number], _listed("xyz")] = Field(default_factory=list)
    constraint_region: Region

    @property
    def offset(self) -> list[float]:
        """The point of the link in its frame [m], [x, y, z]."""
        return self.target_point_offset or [0.0, 0.0, 0.0]

    def volume(self) -> tuple[Primitive, pin.SE3]:
        """Return the only primitive of the region, and its pose.

        Raises:
            InputError: If there is not exactly one, or it is neither a sphere nor a box.
        """
        solids = self.constraint_region.primitives
        places = self.constraint_region.primitive_poses
        if len(solids) != 1 or len(places) != 1 or solids[0].type not in ("sphere", "box"):
            raise InputError("position_constraints: only a region of one sphere or one box can be read")
        solids[0].check()
        return solids[0], places[0].build()


class OrientationConstraint(Message):
    """The link has to have an orientation, within an angle about each of its axes; pi or more leaves one free."""

    says_nothing = ("weight",)

    header: Header = Header()
    link_name: Name
    orientation: Quaternion
    absolute_x_axis_tolerance: Positive = 1e-2
    absolute_y_axis_tolerance: Positive = 1e-2
    absolute_z_axis_tolerance: Positive = 1e-2
    parameterization: Literal[0, 1] = 0  # Euler angles about x, y and z, or a rotation vector

    def build_rotation(self) -> Matrix:
        """Return the orientation as a matrix, shape (3, 3)."""
        rotation: Matrix = pose_from_xyzw([0.0, 0.0, 0.0], self.orientation).rotation
        return rotation

    @property
    def tolerances(self) -> tuple[float, float, float]:
        """Tolerances about the x, y and z axes of the orientation [rad]."""
        return self.absolute_x_axis_tolerance, self.absolute_y_axis_tolerance, self.absolute_z_axis_tolerance


class Constraints(Message):
    """Conditions on the end of the motion, or on all of it."""

    says_nothing = ("name",)

    joint_constraints: list[JointConstraint] = Field(default_factory=list)
    position_constraints: list[PositionConstraint] = Field(default_factory=list)
    orientation_constraints: list[OrientationConstraint] = Field(default_factory=list)

    @property
    def links(self) -> tuple[str, ...]:
        """Links that position and orientation constraints refer to."""
        places = [c.link_name for c in self.position_constraints]
        return (*places, *(c.link_name for c in self.orientation_constraints))


class RequestMessage(Message):
    """A MotionPlanRequest."""

    says_nothing = (
        "allowed_planning_time",
        "max_acceleration_scaling_factor",
        "max_velocity_scaling_factor",
        "num_planning_attempts",
        "pipeline_id",
        "planner_id",
        "workspace_parameters",  # only for a mobile base
    )

    start_state: RobotState
    goal_constraints: Annotated[list[Constraints], Field(min_length=1, max_length=1)]
    path_constraints: Constraints = Constraints()
    group_name: Name

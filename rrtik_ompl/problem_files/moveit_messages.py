"""The parts of MoveIt's messages that MotionBenchMaker files are made of; keys that are not used are not looked at."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal

import pinocchio as pin
from pydantic import BaseModel, Field

from rrtik_ompl.errors import InputError
from rrtik_ompl.files.sections import Length, Name, Number, Positive, Vector3, Vector4
from rrtik_ompl.poses import IDENTITY_QUATERNION, pose
from rrtik_ompl.scene import Obstacle
from rrtik_ompl.shapes import SHAPES, Shape

KNOWN = {key: kind for key, kind in sorted(SHAPES.items()) if kind.moveit}
if TYPE_CHECKING:
    PrimitiveName = str
else:
    PrimitiveName = Literal[tuple(KNOWN)]


class PoseMessage(BaseModel):
    """A pose."""

    position: Vector3 = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    orientation: Vector4 = Field(default_factory=lambda: list(IDENTITY_QUATERNION))

    def build(self) -> Any:
        """The pose as ``pinocchio.SE3``."""
        return pose(self.position, self.orientation)


class Header(BaseModel):
    """The frame that coordinates refer to."""

    frame_id: str = ""


class Primitive(BaseModel):
    """A shape: box [x, y, z], cylinder [height, radius], sphere [radius], full sizes in metres."""

    type: PrimitiveName
    dimensions: Annotated[list[Length], Field(min_length=1, max_length=3)]

    def build(self) -> Shape:
        """The shape."""
        kind = KNOWN[self.type]
        sizes = {m.name: 3 if m.kind == "three lengths" else 1 for m in kind.measures}
        if len(self.dimensions) != sum(sizes.values()):
            raise InputError(f"a {self.type} has {sum(sizes.values())} dimensions, found {len(self.dimensions)}")
        rest, values = iter(self.dimensions), {}
        for name in kind.moveit:
            values[name] = next(rest) if sizes[name] == 1 else [next(rest) for _ in range(sizes[name])]
        return kind(**values)


class CollisionObject(BaseModel):
    """One or several primitives under one name."""

    id: Name
    header: Header = Field(default_factory=Header)  # made anew in a fifth of the time of a copy
    pose: PoseMessage = Field(default_factory=PoseMessage)
    primitives: list[Primitive] = Field(default_factory=list)
    primitive_poses: list[PoseMessage] = Field(default_factory=list)
    meshes: list[Any] = Field(default_factory=list)
    planes: list[Any] = Field(default_factory=list)

    def check_frame(self, known: tuple[str, ...]) -> None:
        """Refuse an object whose coordinates refer to a frame other than the world's."""
        frame = self.header.frame_id.removeprefix("/")
        if frame and frame not in known:
            raise InputError(f"'{self.id}' is given in frame '{frame}'; write it in the frame 'world'")

    def build(self) -> Iterator[Obstacle]:
        """The obstacles: ``id``, then ``id_2``, ``id_3``..."""
        if self.meshes or self.planes:
            raise InputError(f"'{self.id}': meshes and planes are not read; write them as box, cylinder or sphere")
        if len(self.primitive_poses) != len(self.primitives):
            count = f"{len(self.primitives)} primitives, but {len(self.primitive_poses)} primitive_poses"
            raise InputError(f"'{self.id}' has {count}; give one pose for each")
        own = self.pose.build() if "pose" in self.model_fields_set else pin.SE3.Identity()
        for k, (solid, place) in enumerate(zip(self.primitives, self.primitive_poses, strict=True)):
            name = self.id if k == 0 else f"{self.id}_{k + 1}"
            yield Obstacle(name, solid.build(), own * place.build())


class AllowedMatrix(BaseModel):
    """Which pairs of names may touch."""

    entry_names: list[str] = Field(default_factory=list)
    entry_values: list[list[bool]] = Field(default_factory=list)

    def pairs(self) -> Iterator[tuple[str, str]]:
        """The pairs that may touch, each once."""
        count = len(self.entry_names)
        if len(self.entry_values) != count or any(len(row) != count for row in self.entry_values):
            raise InputError(f"entry_values must be a table of {count} x {count}, one row and column per entry name")
        for i, first in enumerate(self.entry_names):
            for j, second in enumerate(self.entry_names[:i]):
                if self.entry_values[i][j] or self.entry_values[j][i]:
                    yield second, first


class WorldMessage(BaseModel):
    """The obstacles."""

    collision_objects: list[CollisionObject] = Field(default_factory=list)


class SceneMessage(BaseModel):
    """What is used of a PlanningScene."""

    robot_model_name: Name
    allowed_collision_matrix: AllowedMatrix = AllowedMatrix()
    world: WorldMessage = WorldMessage()


class JointState(BaseModel):
    """Joint values [rad or m]."""

    name: list[str]
    position: list[Number]


class Transform(BaseModel):
    """Where the base stands."""

    translation: Vector3 = Field(default=[0.0, 0.0, 0.0])
    rotation: Vector4 = Field(default=list(IDENTITY_QUATERNION))


class BaseState(BaseModel):
    """State of the joint between world and base."""

    transforms: list[Transform] = Field(default_factory=list)


class RobotState(BaseModel):
    """Joint values, and the pose of the base."""

    joint_state: JointState
    multi_dof_joint_state: BaseState = BaseState()

    def values(self) -> dict[str, float]:
        """Value of each joint."""
        names, positions = self.joint_state.name, self.joint_state.position
        if len(names) != len(positions):
            raise InputError(f"start_state: {len(names)} joint names, but {len(positions)} positions")
        return dict(zip(names, positions, strict=True))

    def base_pose(self) -> Any:
        """T_world_base."""
        placed = self.multi_dof_joint_state.transforms
        return pose(placed[0].translation, placed[0].rotation) if placed else pin.SE3.Identity()


class JointConstraint(BaseModel):
    """The value that a joint has to reach."""

    joint_name: str
    position: Number


class Region(BaseModel):
    """Volume that a link has to reach: only its primitives are looked at."""

    primitives: list[Primitive] = Field(default_factory=list)
    primitive_poses: list[PoseMessage] = Field(default_factory=list)


class PositionConstraint(BaseModel):
    """The link has to be inside a region."""

    link_name: Name
    target_point_offset: dict[str, Number] | list[Number] = Field(default_factory=list)
    constraint_region: Region

    def ball(self) -> tuple[list[float], float]:
        """Centre and radius [m] of the region."""
        solids, places = self.constraint_region.primitives, self.constraint_region.primitive_poses
        offset = self.target_point_offset
        shifted = any(offset.values() if isinstance(offset, dict) else offset)
        if len(solids) != 1 or len(places) != 1 or solids[0].type != "sphere" or shifted:
            raise InputError("position_constraints: only one sphere about the link's own origin can be read")
        return places[0].position, solids[0].dimensions[0]


class OrientationConstraint(BaseModel):
    """The link has to have an orientation."""

    link_name: Name
    orientation: Vector4
    absolute_x_axis_tolerance: Positive = 1e-2
    absolute_y_axis_tolerance: Positive = 1e-2
    absolute_z_axis_tolerance: Positive = 1e-2

    @property
    def tolerance(self) -> float:
        """An angle [rad] inside all three tolerances."""
        return min(self.absolute_x_axis_tolerance, self.absolute_y_axis_tolerance, self.absolute_z_axis_tolerance)


class Constraints(BaseModel):
    """What the end of the motion has to satisfy."""

    joint_constraints: list[JointConstraint] = Field(default_factory=list)
    position_constraints: list[PositionConstraint] = Field(default_factory=list)
    orientation_constraints: list[OrientationConstraint] = Field(default_factory=list)

    @property
    def links(self) -> tuple[str, ...]:
        """Links that positions and orientations refer to."""
        places = [c.link_name for c in self.position_constraints]
        return (*places, *(c.link_name for c in self.orientation_constraints))


class RequestMessage(BaseModel):
    """What is used of a MotionPlanRequest."""

    start_state: RobotState
    goal_constraints: Annotated[list[Constraints], Field(min_length=1, max_length=1)]
    group_name: Name

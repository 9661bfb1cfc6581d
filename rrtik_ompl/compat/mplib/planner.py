"""MPlib's ``Planner``, in the calls of its versions 0.1 and 0.2."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, number_rows, positive
from rrtik_ompl.base.errors import CloudWarning, InputError, PoseWarning, ProblemError, few
from rrtik_ompl.compat.joints import Joints, joints_of
from rrtik_ompl.compat.mplib.fcl import parts_of
from rrtik_ompl.compat.mplib.pose import Pose, placement, swapped
from rrtik_ompl.compat.mplib.views import (
    AllowedCollisions,
    Articulation,
    Kinematics,
    PlanningWorld,
    WorldCollisionResult,
    link_number,
)
from rrtik_ompl.files.kinds import FilePath
from rrtik_ompl.files.text import file_name
from rrtik_ompl.ik.numeric.descent import descend
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Mesh, PointCloud, Shape, Sphere
from rrtik_ompl.motion.trajectory import RateLimits, time_parameterize
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.tip_motion.attempts import Way, attempt, farthest, path_of
from rrtik_ompl.planning.tip_motion.following import Leaning, Tolerance
from rrtik_ompl.planning.tip_motion.rails import screw_rail
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

SUCCESS = "Success"
NO_IK = "IK Failed! Cannot find valid solution."
NO_SCREW = "screw plan failed"
POSITION_TOLERANCE = 8e-4  # [m] of goal poses, with which MPlib's threshold of 1e-3 is kept
ORIENTATION_TOLERANCE = 4e-4  # [rad]
SCREW_DEVIATION = 5e-4  # [m] of the tip from the screw
SCREW_TURN = 5e-3  # [rad]
BLEND = 0.1  # [rad or m] how far before a corner of a path its rounding may begin
SCREW_BLEND = 0.1  # [rad or m]
SHORT = 0.015  # [m] from a goal at which a screw that is stopped may end; MPlib's end as far from goals
SHORT_TURN = 0.05  # [rad]
LAST = 0.25  # [rad or m] that a joint moves at most to get there
NEAR = 0.1  # [rad or m] two solutions of inverse kinematics that are nearer count as one
FIRST_SECONDS = 0.05  # [s] after which it is asked whether a goal pose can be reached at all
MOST_WORLDS = 8  # worlds of one scene that are kept: one for each posture of the fingers

Result = dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class _Held:
    """A thing that a link holds: its parts in the frame of the link."""

    link: str
    parts: list[tuple[Shape, pin.SE3]]


@dataclass(frozen=True, slots=True, eq=False)
class _Query:
    """What the calls of both versions ask for beside a goal.

    Attributes:
        start: Values of all joints at the start.
        seconds: Limit of wall time [s].
        time_step: Time between two rows of the result at most [s].
        use_point_cloud, use_attach: Whether clouds and attached objects count.
        failed: How a failure is called.
    """

    start: Vector
    seconds: float
    time_step: float
    use_point_cloud: bool | None
    use_attach: bool | None
    failed: str


class Planner:
    """MPlib's planner for one robot and what surrounds it: same calls, frames and status lines; paths are proven.

    Quaternions are in the order w, x, y, z. ``qpos`` has a value for each joint of ``user_joint_names`` (in degrees or
    metres: radians and metres, as always), or for those of the move group alone. Results are dictionaries: "status" is
    "Success" or MPlib's line; "time", "position", "velocity", "acceleration", "duration" as MPlib's, in steps of at
    most ``time_step``; "proven", whether the path is proven free for its whole length; where there is none, "reason".

    Objects and clouds that were given count in all calls, unless ``use_point_cloud=False`` or ``use_attach=False``.
    Options of MPlib's search (``rrt_range``, ``planner_name``, ``qpos_step``, ...) are accepted and without effect.

    Attributes:
        robot, pinocchio_model, planning_world: See `Articulation`, `Kinematics`, `PlanningWorld`.
        move_group, move_group_link_id, move_group_joint_indices: The link that goals refer to, and what moves it.
        user_joint_names, user_link_names, joint_name_2_idx, link_name_2_idx: Names and numbers.
        joint_limits: Limits of all joints [rad or m], shape (n, 2).
        joint_types: Types of all joints, as Pinocchio calls them.
        joint_vel_limits, joint_acc_limits: Limits of the move group's joints, by which motions are timed; may be set.
        base: T_world_base (``pinocchio.SE3``), which `set_base_pose` sets.
        current_qpos: Values of all joints where nothing else is said, which ``robot.set_qpos`` sets.
        acm: Pairs that may touch.
        seed: Seed of all random numbers.

    Args:
        urdf: The robot's URDF.
        move_group: The link that goals refer to.
        srdf: Its SRDF; that beside the URDF, if there is one, where it is None or "".
        package_keyword_replacement, new_package_keyword: A folder that stands in place of ``package://``.
        user_link_names: Names of links in the order of their numbers; all if empty.
        user_joint_names: Names of joints in the order of ``qpos``; all if empty.
        joint_vel_limits, joint_acc_limits: See above; 1 rad/s, rad/s^2 (m) each if None.
        use_convex, verbose: Without effect; solids are what they are.
        objects: Objects in the world (`FCLObject`).
        normal_objects, normal_object_names: The same in the form of MPlib 0.1.

    Raises:
        InputError: If a file cannot be read, or a number of limits is not that of the move group's joints.
        UnknownNameError: If a name is no link or joint.

    Example:
        >>> from importlib.resources import files
        >>> import rrtik_ompl.compat.mplib as mplib
        >>> planner = mplib.Planner(files("rrtik_robots.titan4") / "titan4.urdf", move_group="grip_point")
        >>> here, there = np.radians([[0, 20, -80, 60, 0, 0], [40, 30, -90, 60, 0, 0]])
        >>> planner.pinocchio_model.compute_forward_kinematics(there)
        >>> goal = planner.pinocchio_model.get_link_pose(planner.move_group_link_id)
        >>> result = planner.plan_pose(goal, here, time_step=0.05)
        >>> result["status"], result["proven"], result["position"].shape[1]
        ('Success', True, 6)
    """

    def __init__(
        self,
        urdf: FilePath,
        move_group: str,
        srdf: FilePath | None = "",
        package_keyword_replacement: str = "",
        user_link_names: Sequence[str] = (),
        user_joint_names: Sequence[str] = (),
        joint_vel_limits: ArrayLike | None = None,
        joint_acc_limits: ArrayLike | None = None,
        *,
        new_package_keyword: str = "",
        use_convex: bool = False,
        objects: Iterable[Any] = (),
        normal_objects: Iterable[Any] = (),
        normal_object_names: Iterable[str] = (),
        verbose: bool = False,
    ) -> None:
        del use_convex, verbose
        self.urdf = _existing(urdf)
        self.srdf = _srdf_beside(self.urdf) if srdf is None or srdf == "" else _existing(srdf)
        keyword = new_package_keyword or package_keyword_replacement
        self.joints: Joints = joints_of(self.urdf, self.srdf, keyword, user_joint_names, user_link_names)

        self.user_joint_names = list(self.joints.names)
        self.user_link_names = list(self.joints.links)
        self.joint_name_2_idx = {name: k for k, name in enumerate(self.user_joint_names)}
        self.link_name_2_idx = {name: k for k, name in enumerate(self.user_link_names)}
        self.joint_limits: Matrix = self.joints.limits.copy()
        self.joint_types = list(self.joints.kinds)
        self.move_group = link_number(self.joints.links, move_group, "move_group")
        self.move_group_link_id = self.link_name_2_idx[self.move_group]
        chain = self.joints.chains[self.move_group]
        self.move_group_joint_indices = [k for k, name in enumerate(self.user_joint_names) if name in chain]
        self._moving = tuple(self.user_joint_names[k] for k in self.move_group_joint_indices)
        if not self._moving:
            raise InputError(f"planner: no joint of user_joint_names moves the move group '{self.move_group}'")

        self.joint_vel_limits = self._limits(joint_vel_limits, "joint_vel_limits")
        self.joint_acc_limits = self._limits(joint_acc_limits, "joint_acc_limits")
        self.seed = 0
        self.random = np.random.default_rng(self.seed)
        self.base = pin.SE3.Identity()
        self.current_qpos = self.joints.clipped(np.zeros(len(self.joints.names)))

        self._objects: dict[str, list[tuple[Shape, pin.SE3]]] = {}
        self._held: dict[str, _Held] = {}
        self._scenes: dict[tuple[bool, bool], Scene] = {}
        self._worlds: dict[tuple[Robot, Scene], World] = {}
        self.acm = AllowedCollisions(self._changed)
        self.robot = Articulation(self)
        self.pinocchio_model = Kinematics(self)
        self.planning_world = PlanningWorld(self)
        for thing in objects:
            self.planning_world.add_object(thing)
        names = list(normal_object_names)
        things = list(normal_objects)
        if len(names) != len(things):
            raise InputError(f"normal_objects: {len(things)} objects, but {len(names)} normal_object_names; name each")
        for name, thing in zip(names, things, strict=True):
            self.put_object(name, thing)

    # -- joints ----------------------------------------------------------------------------------------------------

    def pad_move_group_qpos(self, qpos: ArrayLike, articulation: object = None) -> Vector:
        """Return values of all joints, shape (n,); those of the move group alone are completed by the current ones.

        Raises:
            InputError: If their number is neither, one is not finite, or more than a turn outside its limits.
        """
        del articulation
        given = np.asarray(qpos, dtype=np.float64).ravel() if not isinstance(qpos, np.ndarray) else qpos.ravel()
        if len(given) == len(self._moving) != len(self.user_joint_names):
            full = self.current_qpos.copy()
            full[self.move_group_joint_indices] = given
            given = full
        return self.joints.qpos(given, "qpos")

    pad_qpos = pad_move_group_qpos

    def wrap_joint_limit(self, qpos: Vector) -> bool:
        """Turn joints of ``qpos``, in place, by whole turns into their limits; return whether all are within them."""
        within = True
        for k, kind in enumerate(self.joint_types):
            low, high = self.joint_limits[k]
            if kind.startswith("JointModelR") and not -1e-3 <= qpos[k] - low < 0.0:
                qpos[k] -= 2.0 * np.pi * np.floor((qpos[k] - low) / (2.0 * np.pi))
            within = within and bool(low - 1e-3 <= qpos[k] <= high + 1e-3)
        return within

    # -- the world -------------------------------------------------------------------------------------------------

    def set_base_pose(self, pose: object) -> None:
        """Set T_world_base: x, y, z, qw, qx, qy, qz, or another form that `placement` takes."""
        self.base = placement(pose, "base pose")
        self._changed()

    def update_point_cloud(
        self,
        points: ArrayLike | None = None,
        resolution: float = 1e-3,
        name: str = "scene_pcd",
        *,
        pc: ArrayLike | None = None,
        radius: float | None = None,
    ) -> None:
        """Put a cloud of points into the world, or replace the one of that name; an empty one removes it.

        Args:
            points, pc: Points in the world [m], shape (n, 3); those that are not finite are left out, with a warning
                that counts them.
            resolution, radius: How near to a point nothing may come [m].
            name: Name of the cloud.
        """
        given = pc if points is None else points
        rows = number_rows(() if given is None else given, f"points of '{name}'")
        if rows.size == 0:
            rows = rows.reshape(0, 3)
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise InputError(f"points of '{name}': expected shape (n, 3), got {rows.shape}")
        kept = rows[np.isfinite(rows).all(axis=1)]
        if len(kept) < len(rows):
            message = f"cloud '{name}': {len(rows) - len(kept)} of {len(rows)} points are not finite and left out"
            warnings.warn(CloudWarning(message), stacklevel=2)
        if len(kept) == 0:
            warnings.warn(CloudWarning(f"cloud '{name}' is empty: there is none now"), stacklevel=2)
            self.remove_point_cloud(name)
            return
        room = positive(resolution if radius is None else radius, "resolution of a cloud")
        cloud = PointCloud(kept, room)
        before = self._objects.get(name)
        self._objects[name] = [(cloud, pin.SE3.Identity())]
        if before is not None and len(before) == 1 and isinstance(before[0][0], PointCloud) and name not in self._held:
            self._see(Obstacle(name, cloud, self.base.inverse()))
        else:
            self._changed()

    def _see(self, seen: Obstacle) -> None:
        """Put a cloud in the place of the last one of its name: tables of worlds are kept but for its points."""
        for counting, before in self._scenes.items():
            if seen.name in before.names:
                obstacles = [seen if each.name == seen.name else each for each in before.obstacles]
                scene = replace(before, obstacles=tuple(obstacles))
                self._scenes[counting] = scene
                for robot, known in [key for key in self._worlds if key[1] is before]:
                    self._worlds[robot, scene] = self._worlds.pop((robot, known)).with_obstacle(seen)

    def remove_point_cloud(self, name: str = "scene_pcd") -> bool:
        """Remove a cloud; return whether there was one."""
        return self.remove_object(name)

    def put_object(self, name: str, thing: object, pose: object = None) -> None:
        """Put an object into the world, or replace the one of that name; see `PlanningWorld.add_object`."""
        self._objects[name] = parts_of(name, thing, pose)
        self._held.pop(name, None)
        self._changed()

    set_normal_object = put_object

    def remove_object(self, name: str) -> bool:
        """Remove an object or a cloud, also if it is attached; return whether there was one of that name."""
        found = self._objects.pop(name, None) is not None
        found = self._held.pop(name, None) is not None or found
        self._changed()
        return found

    remove_normal_object = remove_object

    @property
    def object_names(self) -> list[str]:
        """Names of all objects, also of those that are attached."""
        return [*self._objects, *self._held]

    @property
    def attached_names(self) -> list[str]:
        """Names of the objects that are attached."""
        return list(self._held)

    def update_attached_box(
        self, size: ArrayLike, pose: object, art_name: str | int | None = None, link_id: int = -1
    ) -> None:
        """Attach a box of full sides ``size`` [m] to a link at T_link_box.

        Args:
            size: Its sides, shape (3,).
            pose: T_link_box.
            art_name: Ignored, as there is one robot; in the calls of MPlib 0.1 the link's number stands here.
            link_id: Number of the link; the move group if -1.
        """
        self._attach("box", [(Box(np.ravel(np.asarray(size, dtype=np.float64))), pose)], art_name, link_id)

    def update_attached_sphere(
        self, radius: float, pose: object, art_name: str | int | None = None, link_id: int = -1
    ) -> None:
        """Attach a sphere [m] to a link; see `update_attached_box`."""
        self._attach("sphere", [(Sphere(radius), pose)], art_name, link_id)

    def update_attached_mesh(
        self, mesh_path: FilePath, pose: object, art_name: str | int | None = None, link_id: int = -1
    ) -> None:
        """Attach the mesh of a file to a link; see `update_attached_box`."""
        self._attach("mesh", [(Mesh.load(mesh_path), pose)], art_name, link_id)

    def update_attached_object(
        self,
        collision_geometry: Shape,
        pose: object,
        name: str = "attached_geom",
        art_name: str | int | None = None,
        link_id: int = -1,
    ) -> None:
        """Attach a shape to a link under a name; see `update_attached_box`."""
        self._attach("geometry", [(collision_geometry, pose)], art_name, link_id, name)

    def update_attached_tool(self, fcl_collision_geometry: Shape, pose: object, link_id: int = -1) -> None:
        """Attach a shape to a link, as MPlib 0.1 calls it."""
        self._attach("geometry", [(fcl_collision_geometry, pose)], link_id, -1, "attached_geom")

    def attach_object(self, name: str, link_id: int = -1, pose: object = None) -> None:
        """Attach an object of the world to a link, where it is or at T_link_object.

        Raises:
            InputError: If there is no object of that name.
        """
        if name not in self._objects:
            raise InputError(f"attach_object: there is no object '{name}'; there is {few(self._objects) or 'none'}")
        link = self._link(link_id)
        at = self._link_pose(link).inverse() if pose is None else placement(pose, f"pose of '{name}'")
        self._held[name] = _Held(link, [(shape, at * place) for shape, place in self._objects.pop(name)])
        self._changed()

    def detach_object(self, name: str = "attached_geom", also_remove: bool = False) -> bool:
        """Detach an object, which stays in the world where it is now, or is removed; return whether it was attached."""
        held = self._held.pop(name, None)
        if held is not None and not also_remove:
            at = self._link_pose(held.link)
            self._objects[name] = [(shape, at * place) for shape, place in held.parts]
        elif also_remove:
            self._objects.pop(name, None)
        self._changed()
        return held is not None

    def _attach(
        self, kind: str, parts: list[tuple[Shape, Any]], art_name: str | int | None, link_id: int, name: str = ""
    ) -> None:
        number = art_name if isinstance(art_name, (int, np.integer)) else link_id
        link = self._link(int(number))
        name = name or f"{self.robot.name}_{self.link_name_2_idx[link]}_{kind}"
        self._objects.pop(name, None)
        self._held[name] = _Held(link, [(shape, placement(pose, f"pose of '{name}'")) for shape, pose in parts])
        self._changed()

    def _link(self, number: int) -> str:
        return self.move_group if number == -1 else link_number(self.user_link_names, number, "link_id")

    def _link_pose(self, link: str) -> pin.SE3:
        """Return T_world_link where the joints are."""
        return self.base * self.joints.whole.fk(self.joints.of_whole(self.current_qpos), link)

    def _changed(self) -> None:
        """Forget the scenes and worlds of before."""
        self._scenes.clear()
        self._worlds.clear()

    def _scene(self, use_point_cloud: bool, use_attach: bool) -> Scene:
        """Return what surrounds the robot, in the frame of its base."""
        known = self._scenes.get((use_point_cloud, use_attach))
        if known is not None:
            return known

        to_base = self.base.inverse()
        parts_by_name: dict[str, list[str]] = {}
        obstacles = []
        for name, parts in self._objects.items():
            if name in self.acm.everywhere or (isinstance(parts[0][0], PointCloud) and not use_point_cloud):
                continue
            parts_by_name[name] = _part_names(name, len(parts))
            for part, (shape, place) in zip(parts_by_name[name], parts, strict=True):
                obstacles.append(Obstacle(part, shape, to_base * place))

        attached = []
        for name, held in self._held.items() if use_attach else ():
            if name in self.acm.everywhere:
                continue
            parts_by_name[name] = _part_names(name, len(held.parts))
            allowed = self._fingers(held.link)
            for part, (shape, place) in zip(parts_by_name[name], held.parts, strict=True):
                attached.append(AttachedObject(part, held.link, shape, place, allow=allowed))

        known_names = {*self.joints.whole.link_names, *parts_by_name}
        pairs = [
            (a, b)
            for pair in self.acm.pairs
            if len(pair) == 2 and pair <= known_names
            for first, second in [sorted(pair)]
            for a in parts_by_name.get(first, [first])
            for b in parts_by_name.get(second, [second])
        ]
        # The base may touch objects: it stands on a table, and no motion changes that.
        base = [link for link, chain in self.joints.chains.items() if link and not chain]
        pairs += [(link, obstacle.name) for link in base for obstacle in obstacles]
        scene = Scene(obstacles, attached, pairs)
        self._scenes[use_point_cloud, use_attach] = scene
        return scene

    def _fingers(self, link: str) -> tuple[str, ...]:
        """Return the links that hang on a link by further joints: fingers, which touch what it holds."""
        own = self.joints.chains[link]
        chains = self.joints.chains.items()
        return tuple(name for name, chain in chains if name and len(chain) > len(own) and chain[: len(own)] == own)

    def _world(self, robot: Robot, use_point_cloud: bool | None, use_attach: bool | None) -> World:
        scene = self._scene(use_point_cloud is not False, use_attach is not False)
        key = robot, scene
        if key not in self._worlds:
            while len(self._worlds) >= MOST_WORLDS:
                self._worlds.pop(next(iter(self._worlds)))
            self._worlds[key] = World(robot, scene)
        return self._worlds[key]

    # -- collisions ------------------------------------------------------------------------------------------------

    def check_for_self_collision(
        self, articulation: object = None, qpos: ArrayLike | None = None, *, state: ArrayLike | None = None
    ) -> list[WorldCollisionResult]:
        """Return what of the robot and of what it holds touches itself at ``qpos``, by default where the joints are.

        The values may stand first, as in MPlib 0.2.
        """
        return [each for each in self._contacts(articulation, qpos, state) if "sceneobject" not in each.collision_type]

    def check_for_env_collision(
        self,
        articulation: object = None,
        qpos: ArrayLike | None = None,
        with_point_cloud: bool | None = None,
        use_attach: bool | None = None,
        *,
        state: ArrayLike | None = None,
    ) -> list[WorldCollisionResult]:
        """Return what of the robot and of what it holds touches objects, as `check_for_self_collision`."""
        found = self._contacts(articulation, qpos, state, with_point_cloud, use_attach)
        return [each for each in found if "sceneobject" in each.collision_type]

    def check_for_collision(
        self, collision_function: Callable[[], list[Any]], state: ArrayLike | None = None, qpos: ArrayLike | None = None
    ) -> list[Any]:
        """Return what a function finds, such as ``planning_world.check_collision``, with the joints at ``state``."""
        values = state if qpos is None else qpos
        before = self.current_qpos
        if values is not None:
            self.current_qpos = self.pad_move_group_qpos(values)
        try:
            return collision_function()
        finally:
            self.current_qpos = before

    def _contacts(
        self,
        first: object,
        second: ArrayLike | None,
        state: ArrayLike | None,
        use_point_cloud: bool | None = None,
        use_attach: bool | None = None,
    ) -> list[WorldCollisionResult]:
        given = next((v for v in (state, second, first) if v is not None and not isinstance(v, Articulation)), None)
        q = self.current_qpos if given is None else self.pad_move_group_qpos(np.asarray(given, dtype=np.float64))
        robot = self.joints.whole
        world = self._world(robot, use_point_cloud, use_attach)
        scene = world.scene
        obstacles = {each.name for each in scene.obstacles}
        attached = {each.name for each in scene.attached}

        results = []
        for contact in world.contacts(self.joints.of_whole(q)):
            names = sorted((contact.first, contact.second), key=lambda name: (name in obstacles, name in attached))
            kinds = ["sceneobject" if n in obstacles else "attached" if n in attached else "self" for n in names]
            owners = [self.robot.name if kind == "self" else name for kind, name in zip(kinds, names, strict=True)]
            kind = "self" if kinds == ["self", "self"] else "_".join(kinds)
            depth = max(-contact.distance, 0.0)
            results.append(WorldCollisionResult(kind, owners[0], owners[1], names[0], names[1], depth))
        return results

    # -- inverse kinematics ----------------------------------------------------------------------------------------

    def transform_goal_to_wrt_base(self, goal_pose: object) -> Pose:
        """Return T_base_goal for T_world_goal; it is also the row x, y, z, qw, qx, qy, qz."""
        return Pose(self.base.inverse() * placement(goal_pose, "goal pose"))

    def IK(
        self,
        goal_pose: object,
        start_qpos: ArrayLike,
        mask: Sequence[bool] | Vector | None = None,
        n_init_qpos: int = 20,
        threshold: float = 1e-3,
        return_closest: bool = False,
        verbose: bool = False,
    ) -> tuple[str, Any]:
        """Find configurations without collision at a pose relative to the base, nearest to the start first.

        Args:
            goal_pose: T_base_goal.
            start_qpos: Values of all joints, or of the move group's.
            mask: Joints that stand still, by the order of ``qpos``.
            n_init_qpos: The largest number of solutions.
            threshold: Without effect; solutions keep MPlib's default.
            return_closest: Whether to return the nearest solution alone.
            verbose: Without effect.

        Returns:
            "Success" and the solutions, values of all joints, shape (n,) each; or MPlib's line and None (an empty list
            where ``goal_pose`` is a row of numbers, as in MPlib 0.1).
        """
        del threshold, verbose
        start = self.joints.clipped(self.pad_move_group_qpos(start_qpos))
        found = self._solutions(placement(goal_pose, "goal pose"), start, self._masked(mask))[:n_init_qpos]
        if not found:
            return NO_IK, None if return_closest or hasattr(goal_pose, "p") else []
        return SUCCESS, found[0] if return_closest else found

    def _solutions(
        self,
        goal: pin.SE3,
        start: Vector,
        still: set[str],
        use_point_cloud: bool | None = None,
        use_attach: bool | None = None,
    ) -> list[Vector]:
        """Return values of all joints at T_base_goal, nearest to ``start`` first."""
        moving = [joint for joint in self._moving if joint not in still]
        if not moving:
            return []
        arm = self.joints.arm(self.move_group, moving, start)
        begin = self._of_arm(arm, start)
        wanted = PoseGoal(goal, POSITION_TOLERANCE, ORIENTATION_TOLERANCE)
        world = self._world(arm, use_point_cloud, use_attach)
        rows: list[Vector] = []
        for q in solve_ik(arm, wanted, near=begin, all=True, world=world, seed=self.seed).solutions:
            if all(np.linalg.norm(q - other) >= NEAR for other in rows):
                rows.append(q)
        return [self._with_arm(start, arm, q) for q in rows]

    def _of_arm(self, arm: Robot, full: Vector) -> Vector:
        """Return the configuration of an arm within its limits, shape (dof,), for values of all joints."""
        return arm.clamp(full[[self.joint_name_2_idx[joint] for joint in arm.joint_names]])

    def _with_arm(self, full: Vector, arm: Robot, q: Vector) -> Vector:
        """Return values of all joints with those of an arm at q."""
        row = full.copy()
        row[[self.joint_name_2_idx[joint] for joint in arm.joint_names]] = q
        return row

    # -- plans -----------------------------------------------------------------------------------------------------

    def plan_qpos(
        self,
        goal_qposes: Sequence[ArrayLike],
        current_qpos: ArrayLike,
        *,
        time_step: float = 0.1,
        rrt_range: float = 0.1,
        planning_time: float = 1.0,
        fix_joint_limits: bool = True,
        fixed_joint_indices: Sequence[int] | None = None,
        simplify: bool = True,
        constraint_function: object = None,
        constraint_jacobian: object = None,
        constraint_tolerance: float = 1e-3,
        verbose: bool = False,
        use_point_cloud: bool | None = None,
        use_attach: bool | None = None,
    ) -> Result:
        """Plan to the nearest of some configurations that can be reached, as MPlib 0.2 calls it.

        Args:
            goal_qposes: Values of all joints or of the move group's, for each goal.
            current_qpos: Values of all joints or of the move group's at the start.
            time_step: Time between two rows of the result at most [s].
            planning_time: Limit of wall time [s].
            fix_joint_limits: Whether joints outside their limits are moved onto them.
            fixed_joint_indices: Numbers of joints that stand still.
            constraint_function: Refused; path constraints are those of `rrtik_ompl.constraints`.
            use_point_cloud, use_attach: Whether clouds and attached objects count.
            rrt_range, simplify, constraint_jacobian, constraint_tolerance, verbose: Without effect.
        """
        del rrt_range, simplify, constraint_jacobian, constraint_tolerance, verbose
        _refuse_constraint(constraint_function)
        start = self._start(current_qpos, fix_joint_limits)
        query = _Query(start, planning_time, time_step, use_point_cloud, use_attach, "RRTConnect Failed.")
        return self._to_qpos(goal_qposes, fixed_joint_indices or (), query)

    def plan_qpos_to_qpos(
        self,
        goal_qposes: Sequence[ArrayLike],
        current_qpos: ArrayLike,
        time_step: float = 0.1,
        rrt_range: float = 0.1,
        planning_time: float = 1.0,
        fix_joint_limits: bool = True,
        use_point_cloud: bool | None = None,
        use_attach: bool | None = None,
        planner_name: str = "RRTConnect",
        no_simplification: bool = False,
        constraint_function: object = None,
        constraint_jacobian: object = None,
        constraint_tolerance: float = 1e-3,
        fixed_joint_indices: Sequence[int] | None = None,
        verbose: bool = False,
    ) -> Result:
        """Plan to the nearest of some configurations that can be reached, as MPlib 0.1 calls it; see `plan_qpos`."""
        del rrt_range, planner_name, no_simplification, constraint_jacobian, constraint_tolerance, verbose
        _refuse_constraint(constraint_function)
        start = self._start(current_qpos, fix_joint_limits)
        query = _Query(start, planning_time, time_step, use_point_cloud, use_attach, "RRT Failed.")
        return self._to_qpos(goal_qposes, fixed_joint_indices or (), query)

    def plan_pose(
        self,
        goal_pose: object,
        current_qpos: ArrayLike,
        mask: Sequence[bool] | Vector | None = None,
        *,
        time_step: float = 0.1,
        rrt_range: float = 0.1,
        planning_time: float = 1.0,
        fix_joint_limits: bool = True,
        wrt_world: bool = True,
        simplify: bool = True,
        constraint_function: object = None,
        constraint_jacobian: object = None,
        constraint_tolerance: float = 1e-3,
        verbose: bool = False,
        use_point_cloud: bool | None = None,
        use_attach: bool | None = None,
    ) -> Result:
        """Plan to a pose of the move group, as MPlib 0.2 calls it.

        Args:
            goal_pose: T_world_goal, or T_base_goal without ``wrt_world``.
            current_qpos: Values of all joints or of the move group's at the start.
            mask: Joints that stand still, by the order of ``qpos``.
            wrt_world: Whether the goal is in the world.
            time_step, planning_time, fix_joint_limits, use_point_cloud, use_attach: See `plan_qpos`.
            constraint_function: Refused.
            rrt_range, simplify, constraint_jacobian, constraint_tolerance, verbose: Without effect.
        """
        del rrt_range, simplify, constraint_jacobian, constraint_tolerance, verbose
        _refuse_constraint(constraint_function)
        start = self._start(current_qpos, fix_joint_limits)
        query = _Query(start, planning_time, time_step, use_point_cloud, use_attach, "RRTConnect Failed.")
        return self._to_pose(self._goal(goal_pose, wrt_world), mask, query)

    def plan_qpos_to_pose(
        self,
        goal_pose: object,
        current_qpos: ArrayLike,
        mask: Sequence[bool] | Vector | None = None,
        time_step: float = 0.1,
        rrt_range: float = 0.1,
        planning_time: float = 1.0,
        fix_joint_limits: bool = True,
        use_point_cloud: bool | None = None,
        use_attach: bool | None = None,
        wrt_world: bool = True,
        planner_name: str = "RRTConnect",
        no_simplification: bool = False,
        constraint_function: object = None,
        constraint_jacobian: object = None,
        constraint_tolerance: float = 1e-3,
        verbose: bool = False,
    ) -> Result:
        """Plan to a pose of the move group, as MPlib 0.1 calls it; see `plan_pose`."""
        del rrt_range, planner_name, no_simplification, constraint_jacobian, constraint_tolerance, verbose
        _refuse_constraint(constraint_function)
        start = self._start(current_qpos, fix_joint_limits)
        query = _Query(start, planning_time, time_step, use_point_cloud, use_attach, "RRT Failed.")
        return self._to_pose(self._goal(goal_pose, wrt_world), mask, query)

    def plan_screw(
        self,
        goal_pose: object = None,
        current_qpos: ArrayLike | None = None,
        qpos_step: float = 0.1,
        time_step: float = 0.1,
        use_point_cloud: bool | None = None,
        use_attach: bool | None = None,
        wrt_world: bool = True,
        verbose: bool = False,
        *,
        target_pose: object = None,
        qpos: ArrayLike | None = None,
    ) -> Result:
        """Move the move group about and along one axis to a pose, as both versions of MPlib call it.

        Args:
            goal_pose, target_pose: T_world_goal, or T_base_goal without ``wrt_world``.
            current_qpos, qpos: Values of all joints or of the move group's at the start.
            time_step, use_point_cloud, use_attach: See `plan_qpos`.
            wrt_world: Whether the goal is in the world.
            qpos_step, verbose: Without effect; the move group leaves the screw by at most 0.5 mm and 5 mrad, before
                corners of the path are rounded.

        If the screw is stopped, by the arm's reach or by something in its way, and the arm comes as near to the goal as
        15 mm and 0.05 rad beside the end of the screw, it goes there: "reason" says how near that is and what stops the
        screw, and a `PoseWarning` does.
        """
        del qpos_step, verbose
        start = self._start(qpos if current_qpos is None else current_qpos, True)
        goal = self._goal(target_pose if goal_pose is None else goal_pose, wrt_world)
        arm = self.joints.arm(self.move_group, self._moving, start)
        world = self._world(arm, use_point_cloud, use_attach)
        begin = self._of_arm(arm, start)
        way = Way((screw_rail(arm.fk(begin), goal),), Tolerance(SCREW_DEVIATION, SCREW_TURN), None, self.seed)
        if way.leads_nowhere(arm):
            return self._standing(begin, time_step, world.motion_proven(begin, begin))

        # As MPlib does, by the least motion of the joints; where that is stopped, by other ways to use their freedom.
        found = attempt(world, way, begin, Leaning(begin, np.zeros(arm.dof)))
        if found.fraction < 1.0:
            found = farthest(world, way, begin[None])
        path = path_of(world, found)
        if path is None or found.fraction < 1.0:
            stopped = f"after {100.0 * found.fraction:.3g} % of the way: {found.reason}"
            nearest = None if path is None else _to_nearest(path, world, goal)
            if nearest is None:
                return _failed(NO_SCREW, stopped)
            path, off = nearest
            reason = f"the motion ends {off} from the goal; the screw ends {stopped}"
            warnings.warn(f"plan_screw: {reason}", PoseWarning, stacklevel=2)
            return {**self._timed(path, world, time_step, SCREW_BLEND, True), "reason": reason}
        return self._timed(path, world, time_step, SCREW_BLEND, True)

    def TOPP(self, path: ArrayLike, step: float = 0.1, verbose: bool = False) -> tuple[Any, ...]:
        """Time a path of the move group's joints, shape (k, m), by ``joint_vel_limits`` and ``joint_acc_limits``.

        Returns:
            Times [s], positions, velocities and accelerations at them, and the duration [s].
        """
        del verbose
        rows = number_rows(path, "path to time")
        arm = self.joints.arm(self.move_group, self._moving, self.current_qpos)
        result = self._timed(JointPath.of(arm, rows), self._world(arm, None, None), step, BLEND, None)
        return tuple(result[key] for key in ("time", "position", "velocity", "acceleration", "duration"))

    def _limits(self, limits: ArrayLike | None, what: str) -> Vector:
        count = len(self._moving)
        if limits is None or np.size(np.asarray(limits)) == 0:
            return np.ones(count)
        row = np.asarray(limits, dtype=np.float64).ravel()
        if len(row) != count:
            raise InputError(
                f"{what}: expected {count} numbers, one for each of {', '.join(self._moving)}, got {len(row)}"
            )
        return row

    def _start(self, qpos: ArrayLike | None, fix_joint_limits: bool) -> Vector:
        """Return values of all joints at the start, which are the current ones from now on."""
        if qpos is None:
            raise InputError("current_qpos: expected the values of the joints at the start")
        start = self.pad_move_group_qpos(qpos)
        self.current_qpos = self.joints.clipped(start) if fix_joint_limits else start.copy()
        return self.current_qpos

    def _goal(self, pose: object, wrt_world: bool) -> pin.SE3:
        """Return T_base_goal."""
        goal = placement(pose, "goal pose")
        return self.base.inverse() * goal if wrt_world else goal

    def _to_qpos(self, goals: Sequence[ArrayLike], still: Sequence[int], query: _Query) -> Result:
        """Plan to the nearest of some configurations that can be reached; joints of some numbers stand still."""
        rows = [self.joints.clipped(self.pad_move_group_qpos(goal)) for goal in goals]
        if not rows:
            raise InputError("goal_qposes: expected one configuration or more")
        names = {self.user_joint_names[k] for k in still}
        arm = self.joints.arm(self.move_group, [joint for joint in self._moving if joint not in names], query.start)
        begin = self._of_arm(arm, query.start)
        ends = sorted((self._of_arm(arm, row) for row in rows), key=lambda q: float(np.linalg.norm(q - begin)))

        result = _failed(f"{query.failed} Timeout", "")
        for end in ends:
            result = self._found(arm, end, query.seconds / len(ends), query)
            if result["status"] == SUCCESS:
                break
        return self._of_group(result, arm, query.start)

    def _to_pose(self, goal: pin.SE3, mask: Sequence[bool] | Vector | None, query: _Query) -> Result:
        """Plan to T_base_goal; joints in the mask stand still."""
        still = self._masked(mask)
        moving = [joint for joint in self._moving if joint not in still]
        if not moving:
            return _failed(NO_IK, "mask: no joint of the move group is left")
        arm = self.joints.arm(self.move_group, moving, query.start)
        wanted = PoseGoal(goal, POSITION_TOLERANCE, ORIENTATION_TOLERANCE)
        uses = query.use_point_cloud, query.use_attach
        result = self._found(arm, wanted, min(query.seconds, FIRST_SECONDS), query)
        if result["status"].endswith("Timeout"):
            if self._solutions(goal, query.start, still, *uses):
                result = self._found(arm, wanted, query.seconds, query)
            else:
                result["status"] = NO_IK
        if result["status"] == NO_IK and self._solutions(swapped(goal), query.start, still, *uses):
            result["reason"] += "; its quaternion read as x, y, z, w can be reached: MPlib's order is w, x, y, z"
        return self._of_group(result, arm, query.start)

    def _masked(self, mask: Sequence[bool] | Vector | None) -> set[str]:
        """Return the joints that stand still by a mask in the order of ``qpos``."""
        return {self.user_joint_names[k] for k in np.flatnonzero([] if mask is None else np.asarray(mask))}

    def _found(self, arm: Robot, goal: Vector | PoseGoal, seconds: float, query: _Query) -> Result:
        """Plan for an arm; positions of the result are those of its joints."""
        world = self._world(arm, query.use_point_cloud, query.use_attach)
        try:
            problem = Problem(world, self._of_arm(arm, query.start), goal)
        except ProblemError as error:
            return _failed(f"{query.failed} Invalid {error.part}", str(error))
        found = plan(problem, seconds=positive(seconds, "planning_time"), seed=self.seed)
        if found.path is None:
            return _failed(f"{query.failed} Timeout", found.reason)
        return self._timed(found.path, world, query.time_step, BLEND, found.path.proven)

    def _of_group(self, result: Result, arm: Robot, start: Vector) -> Result:
        """Return a result with columns for all joints of the move group, also for those that stood still."""
        if result["status"] != SUCCESS or arm.dof == len(self._moving):
            return result
        columns = [self._moving.index(joint) for joint in arm.joint_names]
        still = start[self.move_group_joint_indices]
        for key, rest in (("position", still), ("velocity", 0.0 * still), ("acceleration", 0.0 * still)):
            rows = np.tile(rest, (len(result["time"]), 1))
            rows[:, columns] = result[key]
            result[key] = rows
        return result

    def _timed(self, path: JointPath, world: World, time_step: float, blend: float, proven: bool | None) -> Result:
        """Return the result of a path: as fast as the limits allow, with rounded corners."""
        if np.ptp(path.waypoints, axis=0).max() < 1e-9:
            return self._standing(path.waypoints[0], time_step, proven)
        by_name = {joint: k for k, joint in enumerate(self._moving)}
        chosen = [by_name[joint] for joint in world.robot.joint_names]
        velocity = np.asarray(self.joint_vel_limits)
        acceleration = np.asarray(self.joint_acc_limits)
        limits = _rate_limits(tuple(velocity[chosen].tolist()), tuple(acceleration[chosen].tolist()))
        motion = time_parameterize(path, limits, blend=blend, world=world, clearance=0.0)
        times = _clock(motion.duration, time_step)
        state = motion(times)
        return _success(times, state.positions, state.velocities, state.accelerations, motion.duration, proven)

    def _standing(self, q: Vector, time_step: float, proven: bool | None) -> Result:
        """Return the result of a motion that stands still for one step."""
        times = _clock(positive(time_step, "time_step"), time_step)
        rest = np.zeros((len(times), len(q)))
        return _success(times, rest + q, rest, rest.copy(), float(times[-1]), proven)


@lru_cache(maxsize=16)
def _rate_limits(velocity: tuple[float, ...], acceleration: tuple[float, ...]) -> RateLimits:
    return RateLimits(velocity, acceleration)


def _existing(name: object) -> Path:
    file = file_name(name)
    if not os.path.isfile(file):
        raise InputError(f"planner: there is no file {file}")
    return file


def _srdf_beside(urdf: Path) -> Path | None:
    """Return the SRDF beside a URDF, by the names that MPlib gives it; None if there is none."""
    names = urdf.with_suffix(".srdf"), urdf.with_name(urdf.stem + "_mplib.srdf")
    return next((file for file in names if file.is_file()), None)


def _part_names(name: str, count: int) -> list[str]:
    return [name] if count == 1 else [f"{name} {k + 1}" for k in range(count)]


def _clock(duration: float, time_step: float) -> Vector:
    """Return times from 0 to the end, no farther apart than a step [s]."""
    steps = max(ceil(duration / positive(time_step, "time_step") - 1e-9), 1)
    return np.linspace(0.0, duration, steps + 1)


def _success(
    times: Vector, positions: Matrix, velocities: Matrix, accelerations: Matrix, duration: float, proven: bool | None
) -> Result:
    return {
        "status": SUCCESS,
        "time": times,
        "position": positions,
        "velocity": velocities,
        "acceleration": accelerations,
        "duration": duration,
        "proven": proven is True,
    }


def _to_nearest(path: JointPath, world: World, goal: pin.SE3) -> tuple[JointPath, str] | None:
    """Lead a path that ends before its goal on to where the tip is nearest to it; None if that is far, or not free.

    Returns:
        The path, and in words how far from the goal it ends.
    """
    arm = world.robot
    end = descend(arm, PoseGoal(goal), path.end[None])[0][0]
    error = arm.fk(end).actInv(goal)
    shift = float(np.linalg.norm(error.translation))
    turn = float(np.linalg.norm(pin.log3(error.rotation)))
    step = float(np.abs(end - path.end).max())
    if shift > SHORT or turn > SHORT_TURN or step > LAST or not world.motion_proven(path.end, end):
        return None
    return JointPath.of(arm, np.vstack([path.waypoints, end])), f"{1e3 * shift:.2g} mm and {np.degrees(turn):.2g} deg"


def _failed(status: str, reason: str) -> Result:
    return {"status": status, "reason": reason}


def _refuse_constraint(function: object) -> None:
    if function is not None:
        raise InputError(
            "constraint_function: functions of a path are not taken; plan with rrtik_ompl.plan(Problem(..., "
            "constraints=[...])) and rrtik_ompl.constraints"
        )

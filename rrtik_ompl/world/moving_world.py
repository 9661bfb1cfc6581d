"""Collision checks among moving obstacles, which follow a changing scene within one control tick.

Only the kernels decide (:mod:`rrtik_ompl.kernels`): whatever they cannot prove free counts as blocked, so that no
answer waits for coal. When the scene changes, only the obstacles that moved are packed again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, not_negative
from rrtik_ompl.base.choices import Accuracy
from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.geometry.collision.bodies import Body, Pairs, far_apart
from rrtik_ompl.geometry.collision.certificate import distance, fixed_contact
from rrtik_ompl.geometry.collision.cloud_solid import cloud_solid
from rrtik_ompl.kernels import FREE, FastWorld
from rrtik_ompl.kernels.proof.moving import MovedObstacles
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.kernels.proof.taken_proof import TakenProof
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions, motions_of, step_counts
from rrtik_ompl.model.robot import Robot, inside_limits
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene, pairs_that_may_touch
from rrtik_ompl.model.shapes import PointCloud, same_shape
from rrtik_ompl.model.shapes.shape import same_but_for_points
from rrtik_ompl.world.arm_cache import arm_cache
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.world import World

SAME_PLACE = 1e-6  # tolerance [m], and of direction vectors, within which two attached objects are held alike


class MovingWorld:
    """Collision checks of a robot among obstacles that may be moved; takes the place of a conservative ``World``.

    A configuration is free if it is within the limits and the kernels prove that there is no self-collision and that
    every obstacle is farther than its margin, its ``inflation`` and the clearance of the world together. Motions are
    checked in steps as a ``World`` does, and proven if the world requires it. While an obstacle overlaps the arm's
    fixed base, nothing is free.

    Attributes:
        robot, weights, motion_resolution: Those of the world.
        accuracy: "conservative".
        scene: Where the obstacles are now.
        fast: The tables, for searches in kernels; None without kernels or while ``blocked``. They are updated in
            place, so their address never changes.
        blocked: A line that says which obstacle overlaps which fixed part of the arm; "" if none does.
        checked: Number of configurations checked so far, counted as if no motion had been refused early.

    Args:
        world: The robot and the scene, with the obstacles at their initial poses.
        moving: Names of the obstacles that may be moved; all of them if None.
        copies: Number of poses that each of these has at the same time (its current and its predicted ones).
        self_collision: False leaves out pairs without an obstacle, so that :meth:`clearance` is that of obstacles.

    Raises:
        InputError: If the world has path constraints, which are not kept here.
    """

    accuracy: Accuracy = "conservative"
    # Kernels do not compare solids here: a repair of a path has to fit into a fixed share of a tick.
    resolves = False

    def __init__(
        self, world: World, *, moving: Sequence[str] | None = None, copies: int = 1, self_collision: bool = True
    ) -> None:
        require(world, World, "world of a moving world", "use World(robot, scene)")
        if world.constraints is not None:
            raise InputError("world of a moving world: it has path constraints, which are not kept there; use .unheld")

        self._proving = world.settings.proving
        self._clearance = world.settings.clearance
        self.robot: Robot = world.robot
        self.weights = world.weights
        self.motion_resolution = world.motion_resolution
        self.scene = world.scene
        self.checked = 0

        # Add the copies of obstacles, and keep the pairs of which a body moves.
        names_that_move = {o.name for o in self.scene.obstacles} if moving is None else set(moving)
        bodies = [self._with_clearance(body, body.margin) for body in world.bodies]
        self._bodies, pairs, self._copy_of_body = _with_copies(bodies, world.pairs, names_that_move, copies)
        self._first_obstacles = {o.name: o for o in self.scene.obstacles}
        checked_pairs = tuple(p for p in pairs if any(self._bodies[i].joint > 0 for i in p))
        if not self_collision:
            checked_pairs = tuple(p for p in checked_pairs if any(self._bodies[i].kind == "obstacle" for i in p))

        cache = arm_cache(self.robot)
        self._fast = cache.pack(self._bodies, checked_pairs, cache.covers_of(self._bodies))
        self._motions: dict[tuple[bool, float], FastMotions] = {}
        self._inflation = [0.0] * len(self._bodies)

        # Fixed bodies cannot be avoided, so they are checked whenever obstacles are moved.
        self._pairs_at_rest = tuple(p for p in world.pairs if all(self._bodies[i].joint == 0 for i in p))
        self.blocked = self._contact_of_base()

        first_bodies = tuple(bodies)  # the bodies without the copies, which come behind them
        pairs_of_first = tuple(p for p in checked_pairs if max(p) < len(first_bodies))
        self._prover = MovingProver(self.robot, first_bodies, pairs_of_first, always_colliding=bool(self.blocked))

    @property
    def fast(self) -> FastWorld | None:
        """The tables for searches in kernels; None where they must not be used, see the class."""
        return self._fast if self._fast.address and self._proving is None and not self.blocked else None

    @property
    def motions(self) -> FastMotions | None:
        """The motion checks for searches in kernels, valid wherever obstacles are; None where ``fast`` is None."""
        return motions_of(self, self._motions)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the obstacles."""
        return tuple(o.name for o in self.scene.obstacles)

    def move(self, *scenes: Scene, inflation: Mapping[str, float] | None = None) -> None:
        """Move the obstacles to their poses in the current scene, and their copies to the predicted ones, in place.

        A point cloud may also get other points.

        Args:
            *scenes: The current scene, then one for each further copy. If there are fewer, the last one is used for
                the remaining copies.
            inflation: Distance to keep from obstacles on top of their margins [m], by name; obstacles that are not
                named keep their earlier inflation.

        Raises:
            InputError: If a scene has other obstacles, attached objects or allowed pairs than the world began with, or
                an inflation is not 0 or more.
            UnknownNameError: If an inflation is given for an unknown obstacle.
        """
        for scene in scenes:
            _check_obstacles(scene, self._first_obstacles)
            check_held(scene, self.scene)
            if pairs_that_may_touch(scene) != pairs_that_may_touch(self.scene):
                raise InputError("scene: other pairs may touch than before; make a new world")
        for name, metres in (inflation or {}).items():
            if name not in self._first_obstacles:
                raise UnknownNameError("obstacle", name, self._first_obstacles, where="inflation")
            not_negative(metres, f"inflation: that of '{name}'")

        # Change the bodies of obstacles that have moved; the tables are then updated in place.
        obstacles_of_copies = [{o.name: o for o in scene.obstacles} for scene in scenes]
        for k, body in enumerate(self._bodies):
            if body.kind != "obstacle":
                continue
            obstacle = obstacles_of_copies[min(self._copy_of_body[k], len(obstacles_of_copies) - 1)][body.name]
            geometry = cloud_solid(obstacle.shape) if isinstance(obstacle.shape, PointCloud) else body.geometry
            placement = obstacle.pose * body.within
            unchanged = geometry is body.geometry and np.array_equal(placement.homogeneous, body.placement.homogeneous)
            if not unchanged or obstacle.margin + self._clearance != body.margin:
                moved = replace(body, placement=placement, geometry=geometry)
                self._bodies[k] = self._with_clearance(moved, obstacle.margin)
            if inflation is not None and body.name in inflation:
                self._inflation[k] = float(inflation[body.name])

        self.scene = scenes[0]
        self.blocked = self._contact_of_base()
        self._fast.update_obstacles(self._bodies, self._inflation)
        self._prover.place(self._bodies, self._inflation, always_colliding=bool(self.blocked))

    def clearance(self, Q: Matrix) -> Vector:
        """Return lower bounds of the clearance of configurations, (m, dof) -> (m,) [m].

        Clearance is the distance to contact, minus margins and inflation.
        """
        return self._fast.least_clearance(self.robot.chain.joint_values(Q))

    def valid(self, q: Vector) -> bool:
        """Check whether q, shape (dof,), is free."""
        return bool(self.valid_batch(q[None])[0])

    def valid_batch(self, Q: Matrix) -> Mask:
        """Return which rows of Q, shape (m, dof), are free, shape (m,)."""
        self.checked += len(Q)
        free: Mask = self._fast.classify(self.robot.chain.joint_values(Q), resolve=False) == FREE
        return free & inside_limits(self.robot, Q) & (not self.blocked)

    def motion_valid(self, a: Vector, b: Vector) -> bool:
        """Check whether the straight motion from a to b, shapes (dof,), is free."""
        return bool(self.motion_valid_batch(a[None], b[None])[0])

    def motion_valid_batch(self, A: Matrix, B: Matrix) -> Mask:
        """Return which straight motions A[k] -> B[k], shapes (m, dof), are free, shape (m,)."""
        steps = step_counts(A, B, self.weights, self.motion_resolution)
        self.checked += int(steps.sum()) + len(steps)
        sides = self.robot.chain.joint_values(A), self.robot.chain.joint_values(B)
        free: Mask = self._fast.classify_edges(*sides, steps, resolve=False) == FREE
        free &= inside_limits(self.robot, A) & inside_limits(self.robot, B) & (not self.blocked)
        # The margins of the bodies contain the clearance already, so only the rest is added to them.
        if self._proving is not None:
            free[free] = self._prover.proven(A[free], B[free], clearance=self._proving - self._clearance)
        return free

    def motions_proven(
        self, A: Matrix, B: Matrix, *, less: float = 0.0, inflation: Mapping[str, float] | None = None
    ) -> Mask:
        """Return which straight motions A[k] -> B[k], shapes (m, dof), are proven free as a whole, shape (m,).

        The proofs hold for the current poses of the obstacles; their copies at predicted poses are ignored.

        Args:
            A: Start configurations, shape (m, dof).
            B: End configurations, shape (m, dof).
            less: By how much margins and inflation may be undercut [m].
            inflation: As for :meth:`move`, for this call only; None for the current inflation.
        """
        if inflation is None:
            return self._prover.proven(A, B, clearance=-less)
        inflations = [inflation.get(b.name, usual) for b, usual in zip(self._bodies, self._inflation, strict=True)]
        blocked = bool(self.blocked)
        self._prover.place(self._bodies, inflations, always_colliding=blocked)
        try:
            return self._prover.proven(A, B, clearance=-less)
        finally:
            self._prover.place(self._bodies, self._inflation, always_colliding=blocked)

    def _with_clearance(self, body: Body, margin: float) -> Body:
        """Return a body with a given margin [m], to which the clearance of the world is added if it is an obstacle."""
        total_margin = margin + self._clearance
        if body.kind != "obstacle" or total_margin == body.margin:
            return body
        return replace(body, margin=total_margin)

    def base_apart(self, ways: Mapping[str, float]) -> bool:
        """Check whether obstacles are apart from the fixed parts of the arm, even after moving by some distances.

        Args:
            ways: How far each obstacle may still move in any direction [m], by name; 0 for obstacles that are not
                named.
        """
        for pair in self._pairs_at_rest:
            base_part, obstacle = sorted((self._bodies[k] for k in pair), key=lambda body: body.kind == "obstacle")
            travel = ways.get(obstacle.name, 0.0)
            if travel > 0.0 and not far_apart(base_part, obstacle, travel):
                places = base_part.placement.homogeneous, obstacle.placement.homogeneous
                if distance(base_part.geometry, places[0], obstacle.geometry, places[1], travel) is None:
                    return False
        return not self.blocked

    def _contact_of_base(self) -> str:
        """Return the line for ``blocked``. Copies at predicted poses do not count, as the base cannot avoid them."""
        names = fixed_contact(tuple(self._bodies), self._pairs_at_rest)
        return "" if names is None else f"'{names[0]}' and '{names[1]}' overlap, and the base cannot give way"


class MovingProver(Prover):
    """Prover among obstacles that are moved, at their current poses. Its table is packed once and updated in place.

    Attributes:
        obstacles: Those of the table; None as long as there is no table.
    """

    _fixed = False
    _new_inflations: Sequence[float] | None = None
    obstacles: MovedObstacles | None = None

    def place(self, bodies: Sequence[Body], inflations: Sequence[float], *, always_colliding: bool) -> None:
        """Set the poses of the obstacles. The table is updated when the next motion is to be proven, not before.

        Args:
            bodies: The bodies in their original order, obstacles with new placements and margins.
            inflations: For each body the distance to keep on top of its margin [m]; only used for obstacles.
            always_colliding: Whether an obstacle touches a body that never moves; then nothing is proven.
        """
        self.bodies = tuple(bodies)
        self._new_inflations = inflations
        self.always_colliding = always_colliding

    def elsewhere(self) -> MovingProver:
        """Return a prover of the same bodies, whose obstacles may be placed independently of those of this one.

        Both are for the same thread.
        """
        packed = super()._packed_for(0.0, 0.0).for_thread(placing=True, same_thread=True)
        other = replace(self, tables=TakenProof(packed), kin=object(), _coal=None)
        other.obstacles = self._table_obstacles().within(packed)
        return other

    def _table_obstacles(self) -> MovedObstacles:
        """Return the obstacles of the table, which is made if there is none."""
        if self.obstacles is None:
            self.obstacles = MovedObstacles(super()._packed_for(0.0, 0.0), self.bodies)
        return self.obstacles

    def _packed_for(self, clearance: float, slack: float) -> ProofPairs:
        obstacles = self._table_obstacles()
        if self._new_inflations is not None:
            obstacles.put(self.bodies, self._new_inflations)
            self._new_inflations = None
        return super()._packed_for(clearance, slack)


def _check_obstacles(scene: Scene, known: Mapping[str, Obstacle]) -> None:
    """Raise an error unless a scene has the known obstacles, with the same names and shapes.

    Point clouds may have other points.
    """
    if {o.name for o in scene.obstacles} != known.keys():
        raise InputError(f"scene: expected the obstacles {', '.join(sorted(known))}, got {scene}")
    for obstacle in scene.obstacles:
        if not same_but_for_points(obstacle.shape, known[obstacle.name].shape):
            raise InputError(f"scene: '{obstacle.name}' has another shape than before; make a new world")


def check_held(scene: Scene, before: Scene) -> None:
    """Refuse a scene with other attached objects than before, because these are part of the arm's fixed tables.

    Raises:
        InputError: The message names the attached objects.
    """
    held_now = {item.name: item for item in scene.attached}
    held_before = {item.name: item for item in before.attached}
    if held_now.keys() != held_before.keys():
        given = ", ".join(sorted(held_now)) or "nothing"
        wanted = ", ".join(sorted(held_before)) or "nothing"
        raise InputError(f"scene: the arm held {wanted}, and now {given}; give scenes with the same attached objects")

    for name, item in held_now.items():
        if not _held_alike(item, held_before[name]):
            raise InputError(
                f"scene: '{name}' is held otherwise than before; give scenes with the same attached objects"
            )


def _held_alike(first: AttachedObject, second: AttachedObject) -> bool:
    """Check whether two attached objects are the same, at the same pose on the same link.

    What they may touch counts among the pairs of the scene (:func:`pairs_that_may_touch`).
    """
    same_link = first.link == second.link
    same_margins = first.padding == second.padding and first.margin == second.margin
    same_place = np.allclose(first.pose.homogeneous, second.pose.homogeneous, rtol=0.0, atol=SAME_PLACE)
    return same_link and same_margins and same_place and same_shape(first.shape, second.shape)


def _with_copies(
    first_bodies: Sequence[Body], pairs_of_first: Pairs, names: set[str], copies: int
) -> tuple[list[Body], list[tuple[int, int]], dict[int, int]]:
    """Add copies of some obstacles to the bodies and pairs of a world.

    Args:
        first_bodies: The bodies of the world.
        pairs_of_first: Pairs of their indices that must not touch.
        names: Names of the obstacles that are copied.
        copies: Number of poses of each of these, the first one included.

    Returns:
        All bodies, the copies behind the original ones; all pairs of their indices; and the copy number of each body,
        by its index, 0 for the original ones.
    """
    bodies = list(first_bodies)
    pairs = list(pairs_of_first)
    copy_of_body = dict.fromkeys(range(len(bodies)), 0)

    for k, body in enumerate(first_bodies):
        if body.kind == "obstacle" and body.name in names:
            for copy in range(1, copies):
                copy_of_body[len(bodies)] = copy
                pairs += [(i, len(bodies)) for pair in pairs_of_first if k in pair for i in pair if i != k]
                bodies.append(body)
    return bodies, pairs, copy_of_body

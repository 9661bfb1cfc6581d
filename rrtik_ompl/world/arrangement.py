"""The solids of a robot in a scene and all data that depends on these alone, shared by all forms of a world."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.copies import Items, Once, changed
from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.geometry.collision.bodies import (
    DISTANCE_TOLERANCE,
    Body,
    Pairs,
    by_motion,
    colliding_pairs,
    far_apart,
    link_bodies,
    mounted,
    pieces_of,
    scene_bodies,
)
from rrtik_ompl.geometry.collision.bodies import in_contact as bodies_in_contact
from rrtik_ompl.geometry.collision.body_arrays import BodyArrays, arrays_in_contact, body_arrays
from rrtik_ompl.geometry.collision.certificate import fixed_contact
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.motion_bound import approach_weights, displacement_weights
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene, exchanged, pose_at
from rrtik_ompl.model.shapes import Mesh
from rrtik_ompl.model.shapes.mesh import open_edges_told
from rrtik_ompl.model.world_settings import WorldSettings
from rrtik_ompl.world.arm_cache import Spheres, arm_cache


@dataclass(frozen=True, eq=False)
class Arrangement:
    """The solids of a robot in a scene, with moving obstacles at their poses at time 0; made by :func:`arranged`.

    Attributes:
        robot, scene: The robot and the scene.
        bodies: The solids; those of the robot's links first.
        pairs: Pairs of indices into ``bodies`` that must not touch.
        checked: Pairs of which at least one body moves and that must not overlap at all.
        in_contact: Pairs of which at least one body moves and that may overlap to a given depth. That they do not
            overlap deeper is proven; the collision kernels ignore them.
        standing: Pairs of which both bodies never move.
        weights: No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,).
        always_colliding: Whether two bodies that never move touch.
        self_margin: Distance that links and attached objects must keep from each other [m].
        covers: Computes on first call the outer and inner sphere covers of each body.
        approaches: Computes on first call weights of each checked pair, shape (dof,): its bodies come nearer by at
            most ``weights @ |b - a|`` [m] from a to b.
        numbers: Computes on first call the indices of obstacles and their bodies, which do not depend on poses.
        arrays: Gives the bodies as arrays.
        doubts: Warnings about the description that were not given yet.
        bare: The same arrangement without contacts; None if there are none, or if it is not known.
    """

    robot: Robot
    scene: Scene
    bodies: Items[Body]
    pairs: Pairs
    checked: Pairs
    in_contact: Pairs
    standing: Pairs
    weights: Vector
    always_colliding: bool
    self_margin: float
    covers: Once[tuple[Spheres, ...]]
    approaches: Once[dict[tuple[int, int], Vector]]
    numbers: Once[Numbers]
    arrays: Once[BodyArrays]  # referenced here, so that the cache of body_arrays keeps them
    doubts: list[str] = field(default_factory=list)
    bare: Arrangement | None = None

    @cached_property
    def moving(self) -> Pairs:
        """The pairs of which at least one body moves."""
        return tuple(sorted(self.checked + self.in_contact)) if self.in_contact else self.checked

    @cached_property
    def containment(self) -> Containment:
        """Checks whether a body is wholly inside another."""
        return Containment(self.bodies.as_tuple, self.checked, [outer for outer, _ in self.covers()])

    def exchanged(self, obstacle: Obstacle) -> tuple[Arrangement, tuple[int, ...]] | None:
        """Return the arrangement with another obstacle in the place of the one of the same name.

        Returns:
            The new arrangement, and the indices of the obstacle's bodies. None where more would be different: the
            obstacle has another margin or number of pieces, or a new shape where contacts are allowed, whose depths
            depend on shapes.

        Raises:
            UnknownNameError: If there is no obstacle of that name.
        """
        index = self.index_of(obstacle.name)
        before = self.scene.obstacles[index]
        is_same_shape = obstacle.shape is before.shape
        own_pieces = pieces_of(obstacle)
        numbers = self.numbers().bodies[obstacle.name]
        if len(own_pieces) != len(numbers) or obstacle.margin != before.margin:
            return None
        if self.scene.contacts and not is_same_shape:
            return None

        pose = pose_at(obstacle, 0.0)
        bodies = self.bodies
        for number, piece in zip(numbers, own_pieces, strict=True):
            placement = pose * piece.placement
            body = replace(bodies[number], placement=placement, geometry=piece.geometry, within=piece.placement)
            bodies = bodies.with_(number, body)

        pairs_at_rest = self.numbers().standing(None if self.always_colliding else numbers)
        other = replace(
            self,
            scene=exchanged(self.scene, index, obstacle),
            bodies=bodies,
            arrays=Once(body_arrays, bodies),
            bare=None,
            always_colliding=_touching(bodies, pairs_at_rest),
        )
        if not is_same_shape:
            covers = Once(arm_cache(self.robot).covers_of, bodies)
            other = replace(other, covers=covers, doubts=list(_doubts_of(obstacle)))
        return other, tuple(numbers)

    def held_elsewhere(self, item: AttachedObject) -> tuple[Arrangement, tuple[int, ...]]:
        """Return the arrangement with an attached object elsewhere on its link, and the indices of its bodies.

        Args:
            item: As it is held now: of the scene's object of its name all but the pose. The scene has no contacts.
        """
        _, mount = mounted(self.robot, item)
        bodies = self.bodies
        numbers = tuple([k for k, body in enumerate(bodies) if body.kind == "attached" and body.name == item.name])
        for number in numbers:
            bodies = bodies.with_(number, replace(bodies[number], placement=mount * bodies[number].within))

        attached = tuple([item if each.name == item.name else each for each in self.scene.attached])
        pairs_at_rest = self.numbers().standing(None if self.always_colliding else numbers)
        other = replace(
            self,
            scene=changed(self.scene, attached=attached),
            bodies=bodies,
            arrays=Once(body_arrays, bodies),
            weights=_weights(self.robot, bodies),
            approaches=Once(_approaches, self.robot, bodies, self.checked),
            always_colliding=_touching(bodies, pairs_at_rest),
        )
        return other, numbers

    def index_of(self, name: str) -> int:
        """Return the index of an obstacle in the scene.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        known = self.numbers().obstacles
        if name not in known:
            raise UnknownNameError("obstacle", name, known)
        return known[name]

    def with_clearance(self, clearance: float) -> Items[Body]:
        """Return the bodies with a clearance [m] added to the margins of obstacles."""
        if clearance == 0.0:
            return self.bodies
        return Items(
            tuple(
                replace(body, margin=body.margin + clearance) if body.kind == "obstacle" else body
                for body in self.bodies.as_tuple
            )
        )


def arrangement_of(settings: WorldSettings) -> Arrangement:
    """Return the arrangement for the settings of a world; see :func:`arranged`."""
    return arranged(settings.robot, settings.scene, settings.self_margin)


def arranged(robot: Robot, scene: Scene, self_margin: float) -> Arrangement:
    """Arrange the solids of a robot in a scene and sort their pairs.

    Args:
        robot: The arm.
        scene: Its surroundings; moving obstacles are taken at time 0.
        self_margin: Distance that links and attached objects must keep from each other [m].

    Raises:
        InputError: If the scene does not fit the robot.
    """
    bodies = Items(link_bodies(robot, self_margin) + scene_bodies(robot, scene.at(0.0), self_margin))
    pairs = colliding_pairs(robot, scene, bodies.as_tuple)
    moving, standing = by_motion(bodies, pairs)
    arrays = Once(body_arrays, bodies)
    arrays()  # what needs them finds those that are kept here

    bare = Arrangement(
        robot,
        scene,
        bodies,
        pairs,
        checked=moving,
        in_contact=(),
        standing=standing,
        weights=_weights(robot, bodies),
        always_colliding=fixed_contact(bodies.as_tuple, standing) is not None,
        self_margin=self_margin,
        covers=Once(arm_cache(robot).covers_of, bodies),
        approaches=Once(_approaches, robot, bodies, moving),
        numbers=Once(Numbers.of, scene.obstacles, bodies, standing),
        arrays=arrays,
        doubts=list(_doubts(robot, scene)),
    )
    return with_contacts(bare, scene) if scene.contacts else bare


def with_contacts(bare: Arrangement, scene: Scene) -> Arrangement:
    """Return an arrangement with the contacts of a scene, from that of the same scene without contacts.

    Raises:
        UnknownNameError, InputError: If the contacts do not fit, see :func:`~.bodies.in_contact`.
    """
    robot = bare.robot
    bodies = Items(bodies_in_contact(robot, scene, bare.bodies.as_tuple))
    arrays = arrays_in_contact(bare.arrays(), bodies.as_tuple)
    checked = tuple(pair for pair in bare.checked if pair not in arrays.contacts)
    always_colliding = bare.always_colliding
    if any(pair in arrays.contacts for pair in bare.standing):
        always_colliding = fixed_contact(bodies.as_tuple, bare.standing) is not None

    return replace(
        bare,
        scene=scene,
        bodies=bodies,
        checked=checked,
        in_contact=tuple(pair for pair in bare.checked if pair in arrays.contacts),
        always_colliding=always_colliding,
        approaches=Once(_approaches, robot, bodies, checked),
        arrays=Once(lambda: arrays),
        bare=bare,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """Indices that relate the obstacles of a scene to its bodies.

    Attributes:
        obstacles: Index of each obstacle in the scene, by its name.
        bodies: Indices of the bodies of each obstacle, by its name.
        fixed: For each body the pairs that contain it and whose bodies never move.
    """

    obstacles: dict[str, int]
    bodies: dict[str, list[int]]
    fixed: dict[int, list[tuple[int, int]]]

    @classmethod
    def of(cls, obstacles: Sequence[Obstacle], bodies: Sequence[Body], standing: Pairs) -> Numbers:
        """Collect the indices of a scene.

        Args:
            obstacles: The obstacles, in the order of the scene.
            bodies: All bodies of the world.
            standing: Pairs of indices of bodies that must not touch and never move.
        """
        body_numbers: dict[str, list[int]] = {}
        for k, body in enumerate(bodies):
            if body.kind == "obstacle":
                body_numbers.setdefault(body.name, []).append(k)

        pairs_of_body: dict[int, list[tuple[int, int]]] = {}
        for pair in standing:
            for k in pair:
                pairs_of_body.setdefault(k, []).append(pair)

        return cls({each.name: k for k, each in enumerate(obstacles)}, body_numbers, pairs_of_body)

    def standing(self, moved: Iterable[int] | None) -> Pairs:
        """Return the never-moving pairs that contain one of the given bodies (indices); all such pairs if None."""
        if moved is None:
            return tuple(dict.fromkeys(pair for pairs in self.fixed.values() for pair in pairs))
        return tuple(pair for k in moved for pair in self.fixed.get(k, ()))


def _weights(robot: Robot, bodies: Sequence[Body]) -> Vector:
    return displacement_weights(robot, [body for body in bodies if body.kind != "obstacle"])


def _approaches(robot: Robot, bodies: Items[Body], pairs: Pairs) -> dict[tuple[int, int], Vector]:
    return dict(zip(pairs, approach_weights(robot, bodies, pairs), strict=True))


def _touching(bodies: Sequence[Body], pairs: Pairs) -> bool:
    """Check whether any of some pairs of fixed bodies touches; bounding balls exclude most pairs first."""
    pairs_nearby = [(bodies[i], bodies[j]) for i, j in pairs if not far_apart(bodies[i], bodies[j], DISTANCE_TOLERANCE)]
    return any(fixed_contact(both, ((0, 1),)) is not None for both in pairs_nearby)


def _doubts(robot: Robot, scene: Scene) -> Iterator[str]:
    """Yield warnings about geometry that a world does not treat as a solid.

    Nothing is said of meshes that have a file: the user was warned when it was read.
    """
    if not robot.collision.geometryObjects:
        yield f"robot '{robot.name}' has no collision geometry: all is free"
    for items in (scene.obstacles, scene.attached):
        for item in items:
            yield from _doubts_of(item)


def _doubts_of(item: Obstacle | AttachedObject) -> Iterator[str]:
    """Yield the warnings about the geometry of one thing."""
    shape = item.shape
    if isinstance(shape, Mesh) and not (shape.closed or shape.source):
        yield f"the mesh of '{item.name}' has {open_edges_told(shape)}"

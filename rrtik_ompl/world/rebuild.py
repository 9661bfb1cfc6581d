"""Worlds made from worlds: for other processes, all made anew, and with an obstacle elsewhere. What they doubt."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.choices import Accuracy
from rrtik_ompl.base.copies import Items, KeptHere, Once, ThreadOwn
from rrtik_ompl.base.errors import DescriptionWarning, MeshWarning, UnknownNameError, require
from rrtik_ompl.geometry.collision.bodies import Body, Pairs, far_apart
from rrtik_ompl.geometry.collision.certificate import Certificate, fixed_contact
from rrtik_ompl.geometry.collision.margins import DISTANCE_TOLERANCE
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Mesh
from rrtik_ompl.world.exact_checks import ExactChecker
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.settings import WorldSettings

Kind = TypeVar("Kind", bound="Rebuilt")


class Rebuilt:
    """A world of which others are made."""

    pairs: Pairs
    _settings: WorldSettings
    _obstacles: Items[Obstacle]
    _bodies: Items[Body]
    prover: ThreadOwn[Prover] = ThreadOwn()
    _checks: ThreadOwn[ExactChecker] = ThreadOwn()
    _motions: ThreadOwn[KeptHere] = ThreadOwn()
    _always_colliding: bool
    _certificate: Callable[[], Certificate]
    _numbers: _Numbers | None = None

    @classmethod
    def of(cls: type[Kind], settings: WorldSettings) -> Kind:
        """A world made from settings: all of them are arguments of its class.

        Raises:
            InputError: If they are none.
        """
        require(settings, WorldSettings, "settings of a world", "use world.settings, or dataclasses.replace of them")
        return cls(**{each.name: getattr(settings, each.name) for each in fields(settings)})

    @property
    def settings(self) -> WorldSettings:
        """What the world is made from; ``World.of(replace(world.settings, ...))`` is another form of it."""
        scene = self._settings.scene
        if (obstacles := self._obstacles.whole) is not scene.obstacles:
            scene = copy.copy(scene)  # nothing else is checked again
            object.__setattr__(scene, "obstacles", obstacles)
            self._settings = replace(self._settings, scene=scene)
        return self._settings

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self._settings.robot

    @property
    def scene(self) -> Scene:
        """The surroundings."""
        return self.settings.scene

    @property
    def accuracy(self) -> Accuracy:
        """What counts as free where the kernels cannot decide: "exact" or "conservative"."""
        return self._settings.accuracy

    @property
    def motion_resolution(self) -> float:
        """Largest step of any point of the arm between two checked configurations [m]."""
        return self._settings.motion_resolution

    @property
    def self_margin(self) -> float:
        """How far links, and what they hold, must stay from each other where they must not touch [m]."""
        return self._settings.self_margin

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The solids of the robot and the scene, with the margins of obstacles, without the clearance."""
        return self._bodies.whole

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy answers as the world does, and may be used in another thread or process."""
        return _quietly, (type(self), self.settings)

    def moved(self: Kind, name: str, pose: ArrayLike | pin.SE3) -> Kind:
        """The world in which an obstacle stands elsewhere; what that costs does not grow with their number.

        The new world takes over the tables of this one and writes a few rows of them. This one is as it was; should it
        be asked again, it makes its tables anew, as it does for other threads.

        Args:
            name: Of the obstacle.
            pose: T_world_obstacle, in any form that :func:`rrtik_ompl.base.poses.rigid` takes.

        Raises:
            UnknownNameError: If there is no obstacle of that name.
            InputError: If the pose is none.

        Example:
            >>> ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), rrtik.pose([0.4, 0.0, 0.4]))
            >>> world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene([ball]))
            >>> world = world.moved("ball", [0.4, 0.3, 0.4])
            >>> world.scene.obstacle("ball").pose.translation.tolist()
            [0.4, 0.3, 0.4]
        """
        require(name, str, "name of an obstacle")
        self._numbers = numbers = self._numbers or _Numbers.of(self)
        if name not in numbers.obstacles:
            raise UnknownNameError("obstacle", name, numbers.obstacles)
        obstacle = replace(self._obstacles[numbers.obstacles[name]], pose=pose)
        placements = numbers.placements(obstacle)
        other, checks = copy.copy(self), self._checks
        other._obstacles = self._obstacles.with_(numbers.obstacles[name], obstacle)
        for number, placement in placements.items():
            moved = checks.moved(number, placement)
            if moved is None:
                return _quietly(type(self), other.settings)
            if checks.bodies is other._bodies:
                other._bodies = moved.bodies
            else:  # there they have other margins
                other._bodies = other._bodies.with_(number, replace(other._bodies[number], placement=placement))
            checks = moved
        other._checks, other._motions = checks, self._motions
        self._motions = KeptHere()
        other._certificate = other._second_checker()
        still = numbers.standing(None if self._always_colliding else placements)
        other._always_colliding = _touching(self.robot, other._bodies, still)
        moving = tuple(placements)
        other.prover = self.prover.moved(other._bodies, moving, always_colliding=other._always_colliding)
        return other

    def _second_checker(self) -> Callable[[], Certificate]:
        """What makes the checker behind :meth:`World.certify`, when that is asked for."""
        return Once(_certificate, self.robot, self._bodies, self.pairs, self._settings.clearance)


def with_room(bodies: Items[Body], room: float) -> Items[Body]:
    """The same bodies, but for obstacles, which have that much more margin [m]."""
    if room == 0.0:
        return bodies
    return Items(tuple(replace(b, margin=b.margin + room) if b.kind == "obstacle" else b for b in bodies.whole))


@dataclass(slots=True, eq=False)
class _Numbers:
    """Where the obstacles of a scene stand among its obstacles and bodies; the same for all worlds moved from one."""

    obstacles: dict[str, int]
    bodies: dict[str, list[int]]
    fixed: dict[int, list[tuple[int, int]]]  # pairs of each body that both never move

    @classmethod
    def of(cls, world: Rebuilt) -> _Numbers:
        """Those of a world."""
        bodies: dict[str, list[int]] = {}
        for k, body in enumerate(world.bodies):
            if body.kind == "obstacle":
                bodies.setdefault(body.name, []).append(k)
        fixed: dict[int, list[tuple[int, int]]] = {}
        for pair in world.pairs:
            if all(world.bodies[k].joint == 0 for k in pair):
                for k in pair:
                    fixed.setdefault(k, []).append(pair)
        return cls({each.name: k for k, each in enumerate(world.scene.obstacles)}, bodies, fixed)

    def placements(self, obstacle: Obstacle) -> dict[int, pin.SE3]:
        """Where the bodies of an obstacle are, by their numbers."""
        here = obstacle.pose if obstacle.motion is None else obstacle.motion.pose_at(obstacle.pose, 0.0)
        return {
            number: here * part.placement
            for number, part in zip(self.bodies[obstacle.name], pieces(obstacle.shape), strict=True)
        }

    def standing(self, moved: Iterable[int] | None) -> Pairs:
        """Of the pairs that never move those of some bodies; all of them where nobody names bodies."""
        if moved is None:
            return tuple(dict.fromkeys(pair for own in self.fixed.values() for pair in own))
        return tuple(pair for k in moved for pair in self.fixed.get(k, ()))


def _certificate(robot: Robot, bodies: Items[Body], pairs: Pairs, clearance: float) -> Certificate:
    return Certificate(robot, with_room(bodies, clearance).whole, pairs)


def _touching(robot: Robot, bodies: Sequence[Body], pairs: Pairs) -> bool:
    """Whether one of some pairs of bodies that never move touches; most are told apart by the balls around them."""
    near = [(bodies[i], bodies[j]) for i, j in pairs if not far_apart(bodies[i], bodies[j], DISTANCE_TOLERANCE)]
    return any(fixed_contact(robot, both, ((0, 1),)) is not None for both in near)


def _quietly(kind: type[Kind], settings: WorldSettings) -> Kind:
    """A world like one that there is already; what it doubts was said there."""
    with warnings.catch_warnings():
        for doubt in (MeshWarning, DescriptionWarning):
            warnings.simplefilter("ignore", doubt)
        return kind.of(settings)


def hollow_solids(robot: Robot, scene: Scene) -> Iterator[str]:
    """What a world does not take for a solid, where nobody was told when a file was read."""
    if not robot.collision.geometryObjects:
        yield f"robot '{robot.name}' has no collision geometry: all is free"
    for name, shape in ((item.name, item.shape) for items in (scene.obstacles, scene.attached) for item in items):
        if isinstance(shape, Mesh) and not (shape.closed or shape.source):
            yield f"the mesh of '{name}' has {shape.open_edges} open edges; it is treated as a surface, not as a solid"

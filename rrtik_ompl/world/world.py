"""A robot in a scene: which configurations and motions are free, how far from contact, and what touches."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from inspect import Signature, signature
from typing import Any, Concatenate, ParamSpec

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import MOST_NUMBERS, Mask, Matrix, Vector, finite_array, not_negative, positive
from rrtik_ompl.base.choices import Accuracy
from rrtik_ompl.base.copies import ThreadOwn, changed, in_notebook, restored
from rrtik_ompl.base.errors import DescriptionWarning, InputError, MeshWarning, Renamed, require
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.geometry.collision.bodies import Body, Pairs
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions, motions_of, step_counts
from rrtik_ompl.model.judgement import Contact, Judge, Judged, Violation
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.world_settings import WorldSettings, checked_settings
from rrtik_ompl.world.judgement import judged_path
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.route_check import violations_of
from rrtik_ompl.world.row_checks import RowChecks, checks_of

P = ParamSpec("P")


def _with_arguments_of(
    settings: Callable[P, WorldSettings],
) -> Callable[[Callable[..., None]], Callable[Concatenate[Any, P], None]]:
    """Let a constructor take the arguments of another, by name where it does not name them, for people and checkers."""

    def declared(constructor: Callable[Concatenate[Any, ...], None]) -> Callable[Concatenate[Any, P], None]:
        named = {
            name: each for name, each in signature(constructor).parameters.items() if each.kind != each.VAR_KEYWORD
        }
        others = [each for name, each in signature(settings).parameters.items() if name not in named]
        constructor.__signature__ = Signature([*named.values(), *others])  # type: ignore[attr-defined]
        return constructor

    return declared


class World(Judge):
    """Exact collision checks of a robot in a scene; several threads may ask one world, each in memory of its own.

    Answers are coal's, on the robot's and the scene's own geometry; kernels give most of them without calling coal
    (:mod:`rrtik_ompl.world.exact_checks`). A conservative world never calls coal and refuses what they cannot prove.

    Motions are straight lines in configuration space, checked at both ends and at equal steps in between, so many that
    no point of the arm moves more than ``motion_resolution`` between two checks. The same configurations are checked
    in both directions.

    What moves of the arm has to stay farther from an obstacle than its margin, and from the arm's other bodies than
    ``self_margin``; the base, which no posture moves, must only not touch an obstacle.

    All of it is made from :attr:`settings`. The other forms of a world (``with_...``, :meth:`proving`, :meth:`moved`,
    copies) are worlds made from the same settings but for what they are asked to change; what does not depend on that
    they share.

    Attributes:
        settings: The arguments, checked; ``robot``, ``scene``, ``motion_resolution``, ``accuracy`` and ``self_margin``
            are also attributes of the world. ``World.of(replace(world.settings, ...))`` is another form of it.
        bodies: The solids of the robot and the scene.
        pairs: Numbers of the bodies that must not touch.
        constraints: What is held (:class:`~rrtik_ompl.constraints.held_regions.HeldRegions`); None if nothing is.
        checks: Answers what the methods of a world ask, of rows that are trusted; of each thread's own.
        weights: No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,).

    Args:
        robot: The arm.
        scene: Its surroundings; empty if None. Moving obstacles are where they are at time 0.
        **settings: By their names, the others of :class:`~rrtik_ompl.model.world_settings.WorldSettings`, which says
            what each means: ``accuracy``, ``motion_resolution``, ``clearance``, ``constraints`` and so on.

    Raises:
        InputError: If the scene names links that do not exist, a length makes no sense, or a region cannot be held.
        UnknownNameError: If there is no such accuracy.
    """

    checks: ThreadOwn[RowChecks] = ThreadOwn()
    resolves = True  # kernels compare solids too where outer balls leave a motion in doubt

    @_with_arguments_of(WorldSettings)
    def __init__(self, robot: Robot, scene: Scene | None = None, **settings: Any) -> None:
        self._settings = WorldSettings(robot, Scene() if scene is None else scene, **settings)
        self.checks = checks_of(self._settings)

    @classmethod
    def of(cls, settings: WorldSettings) -> World:
        """Return a world made from settings: all of them are arguments of its class.

        Raises:
            InputError: If they are none.
        """
        require(settings, WorldSettings, "settings of a world", "use world.settings, or dataclasses.replace of them")
        return _world_of(settings)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return a copy answers as the world does, and may be used in another thread or process."""
        return like, (self.settings,)

    def __repr__(self) -> str:
        return f"World({self._settings.summary})"

    _repr_html_ = in_notebook

    @property
    def settings(self) -> WorldSettings:
        """What the world is made from."""
        return self._settings

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self._settings.robot

    @property
    def scene(self) -> Scene:
        """The surroundings."""
        return self._settings.scene

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
    def constraints(self) -> HeldRegions | None:
        """What is held; None if nothing is."""
        return self.checks.constraints

    @property
    def prover(self) -> Prover:
        """Proves motions free; where there are path constraints, free and held."""
        return self.checks.prover

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The solids of the robot and the scene, with the margins of obstacles, without the clearance."""
        return self.checks.solids.bodies.as_tuple

    @property
    def pairs(self) -> Pairs:
        """Numbers of the bodies that must not touch."""
        return self.checks.solids.pairs

    @property
    def weights(self) -> Vector:
        """No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,)."""
        return self.checks.solids.weights

    @property
    def fast(self) -> FastWorld | None:
        """The world's tables, for planners that run in kernels; None without kernels or where these do not suffice.

        They do not where motions have to be proven or held, nor where something is in contact: they know nothing of it.
        """
        tables = self.checks.checker.fast
        settings = self._settings
        enough = settings.proving is None and self.constraints is None and not settings.scene.contacts
        return tables if tables.address and enough and not self.checks.solids.always_colliding else None

    @property
    def motions(self) -> FastMotions | None:
        """How motions are checked, for searches in kernels: one table for all of them. None where ``fast`` is."""
        return motions_of(self, self.checks.checker.motions)

    @property
    def free_motions(self) -> FastMotions | None:
        """How kernels check motions for collisions alone, whatever else they must be; None where they cannot.

        Pairs that are in contact are left out: how deep they overlap is proven of what is found.
        """
        free = form_of(self, proving=None, constraints=())
        scene = free.scene
        if not scene.contacts:
            return free.motions
        pairs = (*scene.allowed_collisions, *(contact.names for contact in scene.contacts))
        return free.with_scene(replace(scene, contacts=(), allowed_collisions=pairs)).motions

    @property
    def unheld(self) -> World:
        """The same world without path constraints."""
        return self if self.constraints is None else form_of(self, constraints=())

    def with_settings(self, **changes: Any) -> World:
        """Return the same world but for some of its settings; it shares what does not depend on them.

        Args:
            **changes: Values by the names of :class:`~rrtik_ompl.model.world_settings.WorldSettings`.

        Raises:
            InputError: If a value makes no sense.
            UnknownNameError: If there is no setting of a name.

        Example:
            >>> world = rrtik.World(rrtik.load_robot("planar3")).with_settings(clearance=0.05, self_margin=0.01)
            >>> world
            World(planar3, Scene(empty), self_margin=0.01 m, clearance=0.05 m)
        """
        return form_of(self, **checked_settings(changes))

    def with_scene(self, scene: Scene) -> World:
        """Return a world of the same robot in another scene, with the same settings.

        Raises:
            InputError: If it is no scene, or does not fit the robot or the path constraints.
        """
        return self.with_settings(scene=scene)

    def with_accuracy(self, accuracy: Accuracy) -> World:
        """Return the same world, "exact" or "conservative"; shares everything else.

        Raises:
            UnknownNameError: If there is no such accuracy.
        """
        return self.with_settings(accuracy=accuracy)

    def with_resolution(self, motion_resolution: float) -> World:
        """Return the same world, its motions checked in steps of another size [m]; shares everything else.

        Raises:
            InputError: If the size is none, or less than 0.01 mm.
        """
        return self.with_settings(motion_resolution=motion_resolution)

    refined = Renamed("with_resolution")

    def with_clearance(self, clearance: float) -> World:
        """Return the same world, where a distance [m] is kept from obstacles on top of their margins.

        It takes the place of an earlier one; 0 takes it away. Checks, proofs and whatever moves in it keep it;
        :meth:`contacts` and :meth:`clearance` tell of margins alone.

        Raises:
            InputError: If the clearance is negative or infinite.
        """
        return self.with_settings(clearance=clearance)

    def proving(self, clearance: float | None = 0.0) -> World:
        """Return the same world, where motions have to be proven too, with a clearance [m]; searches in kernels cannot.

        It takes the place of an earlier one; None takes it away.

        Raises:
            InputError: If the clearance is negative or infinite.
        """
        return self.with_settings(proving=clearance)

    def moved(self, name: str, pose: ArrayLike | pin.SE3) -> World:
        """Return the world in which an obstacle stands elsewhere; what that costs hardly grows with their number.

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
        return _world_with(self.checks.moved(name, pose))

    def valid(self, q: ArrayLike) -> bool:
        """Check whether q, shape (dof,), is inside the limits and free of collision.

        Raises:
            InputError: If q has the wrong length or a value that is not finite.
        """
        return bool(self.checks.free(self._rows(q, 1))[0])

    def valid_batch(self, Q: ArrayLike) -> Mask:
        """Return which rows of Q, shape (m, dof), are inside the limits and free of collision. Shape (m,).

        Raises:
            InputError: If Q has the wrong shape or a value that is not finite.
        """
        return self.checks.free(self._rows(Q, 2))

    def motion_valid(self, a: ArrayLike, b: ArrayLike) -> bool:
        """Check whether the straight motion from a to b, shape (dof,) each, is valid; the same answer from b to a."""
        return bool(self.checks.motions_free(self._rows(a, 1), self._rows(b, 1))[0])

    def motion_valid_batch(self, A: ArrayLike, B: ArrayLike) -> Mask:
        """Return which straight motions A[k] -> B[k], shape (m, dof) each, are valid. Shape (m,)."""
        return self.checks.motions_free(*self._both_ends(A, B))

    def motion_proven(self, a: ArrayLike, b: ArrayLike) -> bool:
        """Check whether each configuration of the straight motion from a to b, shape (dof,) each, is proven free."""
        clearance = self._settings.required_clearance
        return bool(self.prover.proven(self._rows(a, 1), self._rows(b, 1), clearance=clearance)[0])

    def motions_proven(self, A: ArrayLike, B: ArrayLike, *, clearance: float | None = None) -> Mask:
        """Return which straight motions A[k] -> B[k], shape (m, dof) each, are proven free as a whole. Shape (m,).

        ``clearance`` [m] is kept from every obstacle on top of its margin, by default what the world keeps. What grazes
        an obstacle cannot be proven.
        """
        required_clearance = self._proven_clearance(clearance)
        return self.prover.proven(*self._both_ends(A, B), clearance=required_clearance)

    def prove(
        self,
        waypoints: ArrayLike,
        *,
        clearance: float | None = None,
        slack: float = 0.0,
        seconds: float | None = None,
    ) -> Proof:
        """Prove the straight motions between waypoints, shape (k, dof), free for their whole length; after [16].

        Args:
            waypoints: See above; a single one counts as a motion that stands still.
            clearance: To be kept from every obstacle on top of its margin [m]; what the world keeps if None.
            slack: To be kept between all bodies on top of that [m]: how far a point may leave the straight motions.
            seconds: When to stop; what was not looked at by then is not proven.

        Raises:
            InputError: If there are no waypoints, one is no finite row of ``dof`` numbers, or a number is out of range.
        """
        required_clearance = self._proven_clearance(clearance)
        required_slack = not_negative(slack, "slack")
        time_limit = None if seconds is None else positive(seconds, "seconds")
        rows = self._rows(waypoints, 2)
        return self.prover.route(rows, clearance=required_clearance, slack=required_slack, seconds=time_limit)

    def has_proven(self, proof: Proof) -> bool:
        """Check whether a proof covers every motion, keeps what the world keeps, and was made by a form of the world.

        Raises:
            InputError: If it is no proof.
        """
        require(proof, Proof, "proof", "use world.prove(waypoints)")
        return proof.proven and proof.clearance >= self._settings.required_clearance and self.prover.made(proof)

    def violations(self, waypoints: ArrayLike, *, resolution: float | None = None) -> tuple[Violation, ...]:
        """Check the straight motions between waypoints, shape (k, dof), again: the second check of a path.

        A motion that is proven free for its whole length (:meth:`prove`) needs no more. Every other one is checked in
        steps in which no point of the arm moves more than half of the motion resolution (or ``resolution`` [m], if
        given), by :meth:`certify`.

        Returns:
            The first violation of every motion that has one.

        Raises:
            InputError: If a waypoint is no finite row of ``dof`` numbers, there are too many checks, or ``resolution``
                is not positive.

        Example:
            >>> problem = rrtik.load_problem("planar3_boxes")
            >>> [each.edge for each in problem.world.violations([problem.start, problem.goal.q])]
            [0]
        """
        step = None if resolution is None else positive(resolution, "resolution", "give metres")
        return violations_of(self.checks, self._rows(waypoints, 2), step)

    def judged(self, waypoints: ArrayLike) -> Judged:
        """What is said of the straight motions between waypoints, shape (k, dof), where they are drawn.

        Raises:
            InputError: If a waypoint is no finite row of ``dof`` numbers.
        """
        return judged_path(self.checks, self._rows(waypoints, 2))

    def steps(self, a: ArrayLike, b: ArrayLike, resolution: float | None = None) -> int:
        """Number of steps in which a motion is checked: the bound on the arm's displacement over the resolution."""
        step = self.motion_resolution if resolution is None else positive(resolution, "resolution", "give metres")
        return int(step_counts(self._rows(a, 1), self._rows(b, 1), self.weights, step)[0])

    def contacts(self, q: ArrayLike) -> tuple[Contact, ...]:
        """Return every pair of bodies that touches or is within its margin at q, deepest first; empty if q is free."""
        return self.checks.contacts(self._rows(q, 1)[0])

    def closest(self, q: ArrayLike, *, known_free: bool = False) -> Contact | None:
        """The pair of bodies that is nearest to contact or to its margin at q, or deepest in it; None if there is none.

        ``known_free`` leaves out the check for contacts, where they were ruled out before.
        """
        row = self._rows(q, 1)[0]
        if known_free is not True and (touching := self.checks.contacts(row)):
            return touching[0]
        return self.checks.closest(row)

    def clearance(self, q: ArrayLike) -> float:
        """Smallest signed distance less its margin at q [m]: negative in collision, +inf if nothing can collide."""
        nearest = self.closest(q)
        return float("inf") if nearest is None else nearest.clearance

    def too_near(self, q: ArrayLike) -> tuple[Contact, ...]:
        """Every pair that keeps its margin at q, and not the clearance on top of it, nearest first; see ``settings``.

        The ``margin`` of such a contact is that of the obstacle and the clearance together.
        """
        return self.checks.too_near(self._rows(q, 1)[0])

    def explain(self, q: ArrayLike) -> str:
        """Return a line that says why q is not valid; "" if it is.

        It names the joint outside its limit, the pair in collision, nearer than its margin or than the clearance, or
        the path constraint that q does not keep.
        """
        return self.checks.explain(self._rows(q, 1)[0])

    def certify(self, Q: ArrayLike) -> Mask:
        """A second opinion on rows of Q, (m, dof) -> (m,), not by the checks of planners: proofs first, then coal."""
        return self.checks.certified(self._rows(Q, 2))

    def _proven_clearance(self, asked: float | None) -> float:
        return self._settings.required_clearance if asked is None else not_negative(asked, "clearance")

    def _both_ends(self, A: ArrayLike, B: ArrayLike) -> tuple[Matrix, Matrix]:
        starts = self._rows(A, 2)
        ends = self._rows(B, 2)
        if len(starts) != len(ends):
            raise InputError(f"motions need as many starts as ends, got {len(starts)} and {len(ends)}")
        return starts, ends

    def _rows(self, Q: ArrayLike, dimensions: int) -> Matrix:
        """Checked configurations as rows, shape (m, dof)."""
        rows = Q if isinstance(Q, np.ndarray) and Q.dtype == np.float64 and Q.size <= MOST_NUMBERS else None
        if rows is None or rows.ndim != dimensions or rows.shape[-1] != self.robot.dof or not np.isfinite(rows).all():
            what = f"configurations of robot '{self.robot.name}'"
            rows = self.robot.configuration(Q) if dimensions == 1 else finite_array(Q, (None, self.robot.dof), what)
        return np.atleast_2d(rows)


def form_of(world: World, **known: Any) -> World:
    """The same world but for some of its settings, which are known to be right; see :meth:`World.with_settings`."""
    settings = world.settings
    if all(getattr(settings, name) == value for name, value in known.items()):
        return world
    return _world_of(changed(settings, **known))


def _world_of(settings: WorldSettings) -> World:
    """Return a world of settings that are known to be right: ``World(...)`` without its checks."""
    return _world_with(checks_of(settings))


def _world_with(checks: RowChecks) -> World:
    return restored(World, {"_settings": checks.settings, "checks": checks})


def like(settings: WorldSettings) -> World:
    """Return a world of the settings of one that there was already; what it doubts was said there."""
    with warnings.catch_warnings():
        for doubt in (MeshWarning, DescriptionWarning):
            warnings.simplefilter("ignore", doubt)
        return World.of(settings)


def check_world(world: World | None, robot: Robot) -> None:
    """Refuse what is no robot, no world, or the world of another robot.

    Raises:
        InputError: It says how to make what is needed.
    """
    require(robot, Robot, "robot", "use load_robot(name or file)")
    if world is None:
        return
    require(world, World, "world", "make it with World(robot, scene)")
    if world.robot is not robot:
        raise InputError(f"world: it holds another robot, '{world.robot.name}'; make it with World(robot, scene)")

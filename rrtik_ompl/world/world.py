"""A robot in a scene: which configurations and motions are free, how far from contact, and what touches."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import (
    MOST_NUMBERS,
    Mask,
    Matrix,
    Vector,
    dimensions,
    finite_array,
    not_negative,
    positive,
    whole_number,
)
from rrtik_ompl.base.choices import Accuracy
from rrtik_ompl.base.copies import ThreadOwn, changed, in_notebook, in_print, restored
from rrtik_ompl.base.errors import DescriptionWarning, InputError, MeshWarning, listed, require
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.geometry.collision.bodies import Body, Pairs
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions, motions_of, step_counts
from rrtik_ompl.model.certificate import Certificate
from rrtik_ompl.model.distances import Distances
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.judgement import Contact, Judge, Judged, Violation
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.model.world_settings import MOTION_RESOLUTION, WorldSettings, checked_settings
from rrtik_ompl.world.certificates import Certifiable, certificate_for, fault_of
from rrtik_ompl.world.judgement import judged_path
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.route_check import violations_of
from rrtik_ompl.world.row_checks import RowChecks, checks_of


class World(Judge):
    """Exact collision checks of a robot in a scene. Several threads may use one world; each has its own working memory.

    The reference is coal on the robot's and the scene's own geometry. Compiled kernels decide most checks without
    calling coal, and agree with it (:mod:`rrtik_ompl.world.exact_checks`). A conservative world never calls coal: it
    counts as blocked what the kernels cannot prove free.

    Motions are straight lines in configuration space. They are checked at both ends and at equal steps in between, with
    as many steps as are needed so that no point of the arm moves more than ``motion_resolution`` between two checks.
    The same configurations are checked in both directions.

    The moving parts of the arm must stay farther from an obstacle than its margin, and farther from the arm's other
    bodies than ``self_margin``. The base, which no joint moves, must only not touch an obstacle.

    A world is defined by :attr:`settings`. The other forms of a world (``with_...``, :meth:`proving`, :meth:`moved`,
    copies) are worlds with some settings changed; they share all data that does not depend on these.

    Attributes:
        settings: The arguments, checked; ``robot``, ``scene``, ``motion_resolution``, ``accuracy`` and ``self_margin``
            are also attributes of the world. ``World.of(replace(world.settings, ...))`` is another form of it.
        bodies: The solids of the robot and the scene.
        pairs: Pairs of indices into ``bodies`` that must not touch.
        constraints: The path constraints (:class:`~rrtik_ompl.constraints.held_regions.HeldRegions`); None if there
            are none.
        checks: Implements the methods of the world for arrays that need no validation; one object for each thread.
        weights: No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,).

    Args:
        robot: The arm.
        scene: Its surroundings; empty if None. Moving obstacles are where they are at time 0.
        accuracy, motion_resolution, self_margin, clearance, proving, inflation, constraints: The other fields of
            :class:`~rrtik_ompl.model.world_settings.WorldSettings`, where each is described.

    Raises:
        InputError: If the scene names links that do not exist, a length makes no sense, or a region cannot be held.
        UnknownNameError: If there is no such accuracy.

    Example:
        >>> post = rrtik.Obstacle("post", rrtik.Box([0.2, 0.2, 0.2]), [2.0, 1.0, 0.0])
        >>> world = rrtik.World(rrtik.load_robot("planar3"), rrtik.Scene([post]))
        >>> world.valid([0.0, 0.0, 0.0]), round(world.clearance([0.0, 0.0, 0.0]), 3)
        (True, 0.9)
    """

    checks: ThreadOwn[RowChecks] = ThreadOwn()
    # Where the sphere covers leave a motion undecided, kernels also compare the solids.
    resolves = True

    def __init__(
        self,
        robot: Robot,
        scene: Scene | None = None,
        *,
        accuracy: Accuracy = "exact",
        motion_resolution: float = MOTION_RESOLUTION,
        self_margin: float = 0.0,
        clearance: float = 0.0,
        proving: float | None = None,
        inflation: float = 0.0,
        constraints: Iterable[TaskRegion] = (),
    ) -> None:
        self._settings = WorldSettings(
            robot,
            Scene() if scene is None else scene,
            accuracy=accuracy,
            motion_resolution=motion_resolution,
            self_margin=self_margin,
            clearance=clearance,
            proving=proving,
            inflation=inflation,
            constraints=listed(constraints, "path constraints"),
        )
        self.checks = checks_of(self._settings)

    @classmethod
    def of(cls, settings: WorldSettings) -> World:
        """Create a world from its settings, the inverse of :attr:`settings`.

        Raises:
            InputError: If ``settings`` is not a :class:`~rrtik_ompl.model.world_settings.WorldSettings`.
        """
        require(settings, WorldSettings, "settings of a world", "use world.settings, or dataclasses.replace of them")
        return _world_of(settings)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the settings alone; a copy gives the same answers, in this or another process."""
        return like, (self.settings,)

    def __repr__(self) -> str:
        return f"World({self._settings.summary})"

    _repr_html_ = in_notebook
    _repr_png_ = in_print

    @property
    def settings(self) -> WorldSettings:
        """The settings that define the world."""
        return self._settings

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self._settings.robot

    @property
    def scene(self) -> Scene:
        """The surroundings of the arm."""
        return self._settings.scene

    @property
    def accuracy(self) -> Accuracy:
        """The treatment of configurations that kernels cannot decide: "exact" asks coal, "conservative" blocks them."""
        return self._settings.accuracy

    @property
    def motion_resolution(self) -> float:
        """Largest step of any point of the arm between two checked configurations [m]."""
        return self._settings.motion_resolution

    @property
    def self_margin(self) -> float:
        """The distance that links and attached objects must keep from each other [m]."""
        return self._settings.self_margin

    @property
    def constraints(self) -> HeldRegions | None:
        """The path constraints; None if there are none."""
        return self.checks.constraints

    @property
    def prover(self) -> Prover:
        """Proves whole motions free, and that they keep the path constraints if there are any."""
        return self.checks.prover

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The solids of the robot and the scene. Their margins are those of the obstacles, without the clearance."""
        return self.checks.solids.bodies.as_tuple

    @property
    def pairs(self) -> Pairs:
        """Pairs of indices into ``bodies`` that must not touch."""
        return self.checks.solids.pairs

    @property
    def weights(self) -> Vector:
        """No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,)."""
        return self.checks.solids.weights

    @property
    def fast(self) -> FastWorld | None:
        """The tables for planners that run in kernels; None without kernels or where the tables do not suffice.

        They do not suffice where motions have to be proven or keep path constraints, and where bodies may be in
        contact: the tables represent none of these.
        """
        tables = self.checks.checker.fast
        settings = self._settings
        enough = settings.proving is None and self.constraints is None and not settings.scene.contacts
        return tables if tables.address and enough and not self.checks.solids.always_colliding else None

    @property
    def motions(self) -> FastMotions | None:
        """The motion checks for searches in kernels, one table for all of them; None where ``fast`` is None."""
        return motions_of(self, self.checks.checker.motions)

    @property
    def free_motions(self) -> FastMotions | None:
        """The kernels' collision checks of motions, without path constraints and proofs; None where there are none.

        Pairs that may be in contact are left out. How deep they overlap is proven afterwards, of the path that is
        found.
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

    def with_scene(self, scene: Scene) -> World:
        """Return a world of the same robot in another scene, with the same settings.

        Raises:
            InputError: If it is not a scene, or does not fit the robot or the path constraints.
        """
        return _changed(self, scene=scene)

    def with_accuracy(self, accuracy: Accuracy) -> World:
        """Return the same world with another accuracy, "exact" or "conservative"; everything else is shared.

        Raises:
            UnknownNameError: If there is no such accuracy.
        """
        return _changed(self, accuracy=accuracy)

    def with_resolution(self, motion_resolution: float) -> World:
        """Return the same world with another motion resolution [m]; everything else is shared.

        Raises:
            InputError: If the resolution is not a number, or less than 0.01 mm.
        """
        return _changed(self, motion_resolution=motion_resolution)

    def with_clearance(self, clearance: float) -> World:
        """Return the same world with a clearance [m] that is kept from obstacles on top of their margins.

        It replaces an earlier clearance; 0 removes it. Checks, proofs and planners keep it. :meth:`contacts` and
        :meth:`clearance` report distances relative to the margins alone.

        Raises:
            InputError: If the clearance is negative or infinite.
        """
        return _changed(self, clearance=clearance)

    def proving(self, clearance: float | None = 0.0) -> World:
        """Return the same world, in which motions are valid only if proven free with a clearance [m].

        It replaces an earlier value; None removes the requirement. Planners that search in kernels cannot use such a
        world.

        Raises:
            InputError: If the clearance is negative or infinite.
        """
        return _changed(self, proving=clearance)

    def moved(self, name: str, pose: ArrayLike | pin.SE3) -> World:
        """Return the world with one obstacle at another pose, at a cost that hardly depends on the number of obstacles.

        The new world takes over the tables of this one and updates a few rows of them. This world stays as it was: if
        it is used again, it builds its tables anew.

        Args:
            name: Name of the obstacle.
            pose: T_world_obstacle, in any form that :func:`rrtik_ompl.base.poses.rigid` takes.

        Raises:
            UnknownNameError: If there is no obstacle of that name.
            InputError: If ``pose`` is not a pose.

        Example:
            >>> ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), rrtik.pose([0.4, 0.0, 0.4]))
            >>> world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene([ball]))
            >>> world = world.moved("ball", [0.4, 0.3, 0.4])
            >>> world.scene.obstacle("ball").pose.translation.tolist()
            [0.4, 0.3, 0.4]
        """
        require(name, str, "name of an obstacle")
        obstacle = self.scene.obstacles[self.checks.solids.index_of(name)]
        placed = changed(obstacle, pose=rigid(pose, f"pose of '{name}'"))
        return _world_with(self.checks.with_obstacle(placed))

    def with_obstacle(self, obstacle: Obstacle) -> World:
        """Return the world with another obstacle in the place of the one of the same name, at a cost as :meth:`moved`.

        It is meant for what sensors see anew: the cloud of the next picture, or a box that was measured again. Clouds,
        octrees, boxes, balls, cylinders, capsules and half-spaces are put into the tables in place of one of their
        kind. For other shapes, and with another margin, the tables are built anew.

        Args:
            obstacle: The new one; its shape, pose, margin and motion may be others.

        Raises:
            UnknownNameError: If there is no obstacle of its name.
            InputError: If ``obstacle`` is no obstacle.

        Example:
            >>> seen = rrtik.Obstacle("seen", rrtik.PointCloud([[0.4, 0.0, 0.4]]))
            >>> world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene([seen]))
            >>> cloud = rrtik.PointCloud([[0.4, 0.3, 0.4], [0.5, 0.3, 0.4]])
            >>> world = world.with_obstacle(rrtik.Obstacle("seen", cloud))
            >>> world.scene.obstacle("seen").shape
            PointCloud(2 points, radius=0.01 m)
        """
        require(obstacle, Obstacle, "obstacle")
        return _world_with(self.checks.with_obstacle(obstacle))

    def valid(self, q: ArrayLike) -> bool:
        """Check whether q, shape (dof,), is inside the limits and free of collision.

        Raises:
            InputError: If q has the wrong length or a value that is not finite.
        """
        return bool(self.checks.free(self._rows(q, 1))[0])

    def valid_batch(self, Q: ArrayLike) -> Mask:
        """Return which configurations Q, shape (m, dof), are inside the limits and free of collision, shape (m,).

        Raises:
            InputError: If Q has the wrong shape or a value that is not finite.
        """
        return self.checks.free(self._rows(Q, 2))

    def motion_valid(self, a: ArrayLike, b: ArrayLike) -> bool:
        """Check whether the straight motion from a to b, shape (dof,) each, is valid.

        The answer is the same for the motion from b to a.
        """
        return bool(self.checks.motions_free(self._rows(a, 1), self._rows(b, 1))[0])

    def motion_valid_batch(self, A: ArrayLike, B: ArrayLike) -> Mask:
        """Return which straight motions A[k] -> B[k], shape (m, dof) each, are valid, shape (m,)."""
        return self.checks.motions_free(*self._both_ends(A, B))

    def motion_proven(self, a: ArrayLike, b: ArrayLike) -> bool:
        """Check whether every configuration of the straight motion from a to b, shape (dof,) each, is proven free."""
        clearance = self._settings.required_clearance
        return bool(self.prover.proven(self._rows(a, 1), self._rows(b, 1), clearance=clearance)[0])

    def motions_proven(self, A: ArrayLike, B: ArrayLike, *, clearance: float | None = None) -> Mask:
        """Return which straight motions A[k] -> B[k], shape (m, dof) each, are proven free as a whole, shape (m,).

        ``clearance`` [m] is kept from every obstacle on top of its margin; by default it is the clearance of the world.
        A motion that grazes an obstacle cannot be proven.
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
            waypoints: The path; a single waypoint counts as a motion that stands still.
            clearance: Distance kept from every obstacle on top of its margin [m]; that of the world if None.
            slack: Distance kept between all bodies in addition [m]: how far a point of the arm may deviate from the
                straight motions.
            seconds: Time limit [s]; motions that were not examined by then count as not proven.

        Raises:
            InputError: If there are no waypoints, one is no finite row of ``dof`` numbers, or a number is out of range.
        """
        required_clearance = self._proven_clearance(clearance)
        required_slack = not_negative(slack, "slack")
        time_limit = None if seconds is None else positive(seconds, "seconds")
        rows = self._rows(waypoints, 2)
        return self.prover.route(rows, clearance=required_clearance, slack=required_slack, seconds=time_limit)

    def certificate(self, path: Certifiable, clearance: float = 0.0) -> Certificate | None:
        """Certify a motion: return a proof that others can verify, or None if not every part of it is proven free.

        Args:
            path: A path of this robot, or its waypoints, shape (k, dof); or a :class:`Trajectory`, with its curves.
            clearance: Distance kept from every obstacle on top of its margin [m].

        Raises:
            InputError: If the path is another robot's, or the clearance is negative or infinite.

        Example:
            >>> problem = rrtik.load_problem("planar3_boxes")
            >>> path = rrtik.plan(problem, seed=1).path
            >>> problem.world.certificate(path, path.proof.clearance).save("proof.json")
        """
        return certificate_for(self, path, clearance)

    def verify(self, certificate: Certificate, path: Certifiable, *, clearance: float = 0.0) -> str:
        """Verify a certificate of a motion: return its first fault in one line, or "" if it proves the motion free.

        Only the bodies, pairs and the chain of joints of this world are read; none of its own checks are used.

        Args:
            certificate: The certificate; nothing in it is trusted.
            path: A path, or its waypoints, shape (k, dof), or a :class:`Trajectory`; waypoints and times have to equal
                those of the certificate to the bit.
            clearance: Least distance that the path has to keep from obstacles on top of their margins [m].

        Raises:
            InputError: If an argument has the wrong type, or the path moves other joints than the world's robot, or
                these in another order.

        Example:
            >>> problem = rrtik.load_problem("planar3_boxes")
            >>> path = rrtik.plan(problem, seed=1).path
            >>> problem.world.verify(problem.world.certificate(path), path)
            ''
        """
        return fault_of(certificate, self, path, clearance)

    def has_proven(self, proof: Proof) -> bool:
        """Check whether a proof holds in this world.

        It has to cover every motion, keep the clearance of the world, and be made by a form of this world, in this
        process.

        Raises:
            InputError: If ``proof`` is not a proof.
        """
        require(proof, Proof, "proof", "use world.prove(waypoints)")
        return proof.proven and proof.clearance >= self._settings.required_clearance and self.prover.made(proof)

    def violations(self, waypoints: ArrayLike, *, resolution: float | None = None) -> tuple[Violation, ...]:
        """Check the straight motions between waypoints, shape (k, dof), a second time, independently of planners.

        A motion that is proven free for its whole length (:meth:`prove`) needs no other check. Every other motion is
        sampled so densely that no point of the arm moves more than half of the motion resolution (or ``resolution``
        [m], if given) between two samples, and each sample is checked by :meth:`certify`.

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
        """Return a verdict on a path, its clearance curve and its contacts, as pictures of the path show them.

        ``waypoints`` has shape (k, dof); the motions between them are straight.

        Raises:
            InputError: If a waypoint is no finite row of ``dof`` numbers.
        """
        return judged_path(self.checks, self._rows(waypoints, 2))

    def steps(self, a: ArrayLike, b: ArrayLike, resolution: float | None = None) -> int:
        """Return the number of steps in which a motion is checked.

        It is a bound on the displacement of the arm's points [m], divided by the resolution [m] and rounded up.
        """
        step = self.motion_resolution if resolution is None else positive(resolution, "resolution", "give metres")
        return int(step_counts(self._rows(a, 1), self._rows(b, 1), self.weights, step)[0])

    def contacts(self, q: ArrayLike) -> tuple[Contact, ...]:
        """Return every pair of bodies that touches or is within its margin at q, deepest first; empty if q is free."""
        return self.checks.contacts(self._rows(q, 1)[0])

    def closest(self, q: ArrayLike, *, known_free: bool = False) -> Contact | None:
        """Return the pair of bodies with the least clearance at q, or None if no pair can collide.

        Clearance is the signed distance minus the margin. ``known_free`` skips the check for contacts, where the caller
        has excluded them already.
        """
        row = self._rows(q, 1)[0]
        if known_free is not True and (touching := self.checks.contacts(row)):
            return touching[0]
        return self.checks.closest(row)

    def clearance(self, q: ArrayLike) -> float:
        """Return the least signed distance minus margin at q [m]: negative in collision, +inf without any pairs."""
        nearest = self.closest(q)
        return float("inf") if nearest is None else nearest.clearance

    def distances(
        self,
        q: ArrayLike,
        pairs: Iterable[tuple[str, str]] | None = None,
        *,
        nearest: int | None = None,
        within: float | None = None,
    ) -> Distances:
        """Measure signed distances at one or many configurations, with nearest points and gradients.

        Args:
            q: A configuration, shape (dof,), or several, shape (m, dof).
            pairs: Pairs of names of links, obstacles and attached objects; all that must not touch if None.
            nearest: So many of the smallest distances at each configuration, in order; all if None.
            within: Distances from here on are not measured, and are given as this [m]; all are measured if None.

        Returns:
            The distances, without the first axis for a single configuration; see
            :class:`~rrtik_ompl.model.distances.Distances` for what they mean where objects overlap.

        Raises:
            InputError: If q has the wrong shape or a value that is not finite, or another argument makes no sense.
            UnknownNameError: If there is no object of a name.

        Example:
            >>> post = rrtik.Obstacle("post", rrtik.Box([0.2, 0.2, 0.2]), [2.0, 1.0, 0.0])
            >>> world = rrtik.World(rrtik.load_robot("planar3", parameters={"radius": 0.05}), rrtik.Scene([post]))
            >>> near = world.distances([0.0, 0.0, 0.0], nearest=1)
            >>> near.names[near.which[0]], near.values.round(3), near.gradients.round(3)
            (('link2', 'post'), array([0.85]), array([[-2., -1.,  0.]]))
        """
        from rrtik_ompl.world.distances import Choice  # a plan does not need it

        one = dimensions(q) == 1
        rows = self._rows(q, 1 if one else 2)
        settings = self._settings
        choice = Choice(
            None if pairs is None else _name_pairs(pairs),
            None if nearest is None else whole_number(nearest, "nearest", 1),
            float("inf") if within is None else positive(within, "within"),
        )
        found = self.checks.ruler.distances(rows, choice, settings.clearance + settings.inflation)
        return found.at(0) if one else found

    def too_near(self, q: ArrayLike) -> tuple[Contact, ...]:
        """Return every pair that keeps its margin at q but not the clearance on top of it, nearest first.

        The ``margin`` of such a contact is the sum of the obstacle's margin and the clearance.
        """
        return self.checks.too_near(self._rows(q, 1)[0])

    def explain(self, q: ArrayLike) -> str:
        """Return a line that says why q is not valid; "" if it is.

        The line names the joint outside its limit, the pair that is in collision or nearer than its margin or the
        clearance, or the path constraint that q violates.
        """
        return self.checks.explain(self._rows(q, 1)[0])

    def certify(self, Q: ArrayLike) -> Mask:
        """Return which rows of Q, shape (m, dof), an independent second check calls free, shape (m,).

        It uses none of the checks of planners: it tries to prove each configuration free, and asks coal about the
        others.
        """
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
        """Validate one configuration (``dimensions`` 1) or several (2) and return them as rows, shape (m, dof)."""
        rows = Q if isinstance(Q, np.ndarray) and Q.dtype == np.float64 and Q.size <= MOST_NUMBERS else None
        if rows is None or rows.ndim != dimensions or rows.shape[-1] != self.robot.dof or not np.isfinite(rows).all():
            what = f"configurations of robot '{self.robot.name}'"
            rows = self.robot.configuration(Q) if dimensions == 1 else finite_array(Q, (None, self.robot.dof), what)
        return np.atleast_2d(rows)


def _name_pairs(pairs: Iterable[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Check pairs of names."""
    checked = []
    for pair in listed(pairs, "pairs"):
        if not isinstance(pair, list | tuple) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
            raise InputError(f"pairs: expected pairs of names such as ('link7', 'box'), got {pair!r:.60}")
        checked.append((pair[0], pair[1]))
    return tuple(checked)


def _changed(world: World, **settings: Any) -> World:
    """Return the same world with some settings changed, whose values are checked; the data of the others is shared."""
    return form_of(world, **checked_settings(settings))


def form_of(world: World, **known: Any) -> World:
    """Return the same world with some settings changed, which the caller knows to be valid.

    Nothing is made anew if nothing changes.
    """
    settings = world.settings
    if all(getattr(settings, name) == value for name, value in known.items()):
        return world
    return _world_of(changed(settings, **known))


def _world_of(settings: WorldSettings) -> World:
    """Create a world from valid settings: ``World(...)`` without its checks."""
    return _world_with(checks_of(settings))


def held_elsewhere(world: World, item: AttachedObject) -> World:
    """Return the world with an attached object elsewhere on its link, which takes over tables as :meth:`World.moved`.

    Args:
        world: The world, without contacts.
        item: As it is held now: of the scene's object of its name all but the pose.
    """
    return _world_with(world.checks.held_elsewhere(item))


def _world_with(checks: RowChecks) -> World:
    return restored(World, {"_settings": checks.settings, "checks": checks})


def like(settings: WorldSettings) -> World:
    """Create a world from the settings of an earlier world, without repeating the warnings that were given there."""
    with warnings.catch_warnings():
        for doubt in (MeshWarning, DescriptionWarning):
            warnings.simplefilter("ignore", doubt)
        return World.of(settings)


def check_world(world: World | None, robot: Robot) -> None:
    """Refuse a robot or world of another type, and a world that holds another robot.

    Raises:
        InputError: The message says how to make the object that is needed.
    """
    require(robot, Robot, "robot", "use load_robot(name or file)")
    if world is None:
        return
    require(world, World, "world", "make it with World(robot, scene)")
    if world.robot is not robot:
        raise InputError(f"world: it holds another robot, '{world.robot.name}'; make it with World(robot, scene)")

"""A robot in a scene: which configurations and motions are free, how far from contact, and what touches."""

from __future__ import annotations

import copy
import warnings
from dataclasses import replace
from functools import partial
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.arrays import MOST_NUMBERS, Mask, Matrix, finite_array, in_blocks, not_negative, positive
from rrtik_ompl.choices import Accuracy, one_of
from rrtik_ompl.collision.bodies import by_motion, colliding_pairs, link_bodies, scene_bodies
from rrtik_ompl.collision.certificate import Certificate, fixed_contact
from rrtik_ompl.collision.contacts import Contact as Contact
from rrtik_ompl.collision.contacts import inside, measured
from rrtik_ompl.collision.motion_bound import displacement_weights
from rrtik_ompl.copies import Items, KeptHere, Once, in_notebook, shallow_copy
from rrtik_ompl.errors import InputError, MeshWarning, Renamed, require
from rrtik_ompl.fast import FastWorld
from rrtik_ompl.fast.search.motions.motion_table import FastMotions, motions_of, step_counts
from rrtik_ompl.poses import few_joints
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import Scene
from rrtik_ompl.world.exact_checks import ExactChecker, one_way
from rrtik_ompl.world.proof import Gap as Gap
from rrtik_ompl.world.proof import Proof as Proof
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.rebuild import Rebuilt, hollow_solids

MOTION_RESOLUTION = 0.01  # [m]
ACCURACIES: tuple[Accuracy, ...] = get_args(Accuracy)
FINEST_RESOLUTION = 1e-5  # [m]; a motion across an arm's reach is then some hundred thousand checks


class World(Rebuilt):
    """Exact collision checks of a robot in a scene; several threads may ask one world, each in memory of its own.

    Answers are coal's, on the robot's and the scene's own geometry; kernels give most of them without calling coal
    (:mod:`rrtik_ompl.world.exact_checks`). A conservative world never calls coal and refuses what they cannot prove.

    Motions are straight lines in configuration space, checked at both ends and at equal steps in between, so many that
    no point of the arm moves more than ``motion_resolution`` between two checks. The same configurations are checked
    in both directions.

    What moves of the arm has to stay farther from an obstacle than its margin, and from the arm's other bodies than
    ``self_margin``; the base, which no posture moves, must only not touch an obstacle.

    Attributes:
        robot, scene, motion_resolution, accuracy, self_margin: As given.
        bodies: The solids of the robot and the scene.
        pairs: Numbers of the bodies that must not touch.
        prover: Proves motions free.
        weights: No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,).

    Args:
        robot: The arm.
        scene: Its surroundings; empty if None. Moving obstacles are where they are at time 0.
        motion_resolution: Largest step of any point of the arm between two checked configurations [m].
        accuracy: "exact" or "conservative".
        self_margin: How far links, and what they hold, must stay from each other where they must not touch [m].

    Raises:
        InputError: If the scene names links that do not exist, or a length makes no sense.
        UnknownNameError: If there is no such accuracy.
    """

    def __init__(
        self,
        robot: Robot,
        scene: Scene | None = None,
        *,
        motion_resolution: float = MOTION_RESOLUTION,
        accuracy: Accuracy = "exact",
        self_margin: float = 0.0,
    ) -> None:
        self.robot, self._scene = robot, Scene() if scene is None else scene
        require(robot, Robot, "robot of a world", "use load_robot(name or file)")
        few_joints(robot.model)
        require(self._scene, Scene, "scene of a world", "use Scene(obstacles) or load_scene(file)")
        self._obstacles = Items(self._scene.obstacles)
        self.motion_resolution = float(finite_array(motion_resolution, (), "motion_resolution"))
        if self.motion_resolution < FINEST_RESOLUTION:
            raise InputError(f"motion_resolution must be {FINEST_RESOLUTION:g} metres or more, got {motion_resolution}")
        for doubt in hollow_solids(robot, self.scene):
            warnings.warn(doubt, MeshWarning, stacklevel=2)
        self.self_margin = own = not_negative(self_margin, "self_margin")
        self._bodies = Items(link_bodies(robot, own) + scene_bodies(robot, self.scene.at(0.0), own))
        self.weights = displacement_weights(robot, [b for b in self.bodies if b.kind != "obstacle"])
        self.pairs = pairs = colliding_pairs(robot, self.scene, self.bodies)
        moving, standing = by_motion(self.bodies, pairs)
        self.accuracy = one_of(ACCURACIES, accuracy, "accuracy")
        self._certificate = Once(Certificate, robot, self.bodies, pairs)
        self._motions = KeptHere()
        self._proven_clearance: float | None = None
        self._room = 0.0  # kept on top of the margins of obstacles
        self._checks = ExactChecker(robot, self._bodies, moving, conservative=accuracy == "conservative")
        self._always_colliding = always = fixed_contact(robot, self.bodies, standing) is not None
        self.prover = Prover(robot, self._bodies, moving, self_margin=own, always_colliding=always)

    resolves = True  # kernels compare solids too where outer balls leave a motion in doubt

    def __repr__(self) -> str:
        return f"World({self.robot.name}, {self.scene}, motion_resolution={self.motion_resolution:g} m)"

    @property
    def fast(self) -> FastWorld | None:
        """The world's tables, for planners that run in kernels; None without kernels or where these do not suffice."""
        tables, enough = self._checks.fast, not self._always_colliding and self._proven_clearance is None
        return tables if tables.address and enough else None

    @property
    def motions(self) -> FastMotions | None:
        """How motions are checked, for searches in kernels: one table for all of them. None where ``fast`` is."""
        return motions_of(self, self._motions)

    def with_scene(self, scene: Scene) -> World:
        """A world of the same robot in another scene, made anew with the same settings."""
        lengths = {"motion_resolution": self.motion_resolution, "self_margin": self.self_margin}
        return World(self.robot, scene, accuracy=self.accuracy, **lengths)

    def with_accuracy(self, accuracy: Accuracy) -> World:
        """The same world, "exact" or "conservative"; shares everything else.

        Raises:
            UnknownNameError: If there is no such accuracy.
        """
        other = copy.copy(self)
        other.accuracy = one_of(ACCURACIES, accuracy, "accuracy")
        other._checks = self._checks.as_conservative(accuracy == "conservative")
        return other

    def with_resolution(self, motion_resolution: float) -> World:
        """The same world, its motions checked in steps of another size [m]; shares everything else.

        Raises:
            InputError: If the size is no number greater than 0.
        """
        other = copy.copy(self)
        other.motion_resolution, other._motions = positive(motion_resolution, "motion_resolution"), KeptHere()
        return other

    refined = Renamed("with_resolution")
    __copy__, _repr_html_ = shallow_copy, in_notebook

    def with_clearance(self, clearance: float) -> World:
        """The same world for searches that leave room: its checks keep a distance [m] on top of obstacles' margins.

        :meth:`contacts`, :meth:`certify` and proofs stay as they are.

        Raises:
            InputError: If the clearance is negative or infinite.
        """
        if (wider := not_negative(clearance, "clearance")) == 0.0:
            return self
        other = copy.copy(self)
        wide = tuple(replace(b, margin=b.margin + wider) if b.kind == "obstacle" else b for b in self.bodies)
        other._checks, other._motions, other._room = self._checks.with_bodies(wide), KeptHere(), wider
        return other

    def proving(self, clearance: float = 0.0) -> World:
        """The same world, where motions have to be proven too, with a clearance [m]; searches in kernels cannot.

        Raises:
            InputError: If the clearance is negative or infinite.
        """
        other = copy.copy(self)
        other._proven_clearance = not_negative(clearance, "clearance")
        return other

    def valid(self, q: ArrayLike) -> bool:
        """Whether q, shape (dof,), is inside the limits and free of collision.

        Raises:
            InputError: If q has the wrong length or a value that is not finite.
        """
        return bool(self._free(self._rows(q, 1))[0])

    def valid_batch(self, Q: ArrayLike) -> Mask:
        """Which rows of Q, shape (m, dof), are inside the limits and free of collision. Shape (m,).

        Raises:
            InputError: If Q has the wrong shape or a value that is not finite.
        """
        return in_blocks(self._free, self._rows(Q, 2))

    def motion_valid(self, a: ArrayLike, b: ArrayLike) -> bool:
        """Whether the straight motion from a to b, shape (dof,) each, is valid; the same answer from b to a."""
        return bool(self._motions_free(self._rows(a, 1), self._rows(b, 1))[0])

    def motion_valid_batch(self, A: ArrayLike, B: ArrayLike) -> Mask:
        """Which straight motions A[k] -> B[k], shape (m, dof) each, are valid. Shape (m,)."""
        return in_blocks(self._motions_free, *self._both_ends(A, B))

    def motion_proven(self, a: ArrayLike, b: ArrayLike) -> bool:
        """Whether each configuration of the straight motion from a to b, shape (dof,) each, is proven free."""
        return bool(self.prover.proven(self._rows(a, 1), self._rows(b, 1))[0])

    def motions_proven(self, A: ArrayLike, B: ArrayLike, *, clearance: float = 0.0) -> Mask:
        """Which straight motions A[k] -> B[k], shape (m, dof) each, are proven free as a whole. Shape (m,).

        ``clearance`` [m] is kept from every obstacle on top of its margin. What grazes an obstacle cannot be proven.
        """
        kept = not_negative(clearance, "clearance")
        return in_blocks(partial(self.prover.proven, clearance=kept), *self._both_ends(A, B))

    def prove(
        self, waypoints: ArrayLike, *, clearance: float = 0.0, slack: float = 0.0, seconds: float | None = None
    ) -> Proof:
        """Prove the straight motions between waypoints, shape (k, dof), free for their whole length; after [16].

        Args:
            waypoints: See above; a single one counts as a motion that stands still.
            clearance: To be kept from every obstacle on top of its margin [m].
            slack: To be kept between all bodies on top of that [m]: how far a point may leave the straight motions.
            seconds: When to stop; what was not looked at by then is not proven.

        Raises:
            InputError: If there are no waypoints, one is no finite row of ``dof`` numbers, or a number is out of range.
        """
        kept, spare = not_negative(clearance, "clearance"), not_negative(slack, "slack")
        limit, rows = None if seconds is None else positive(seconds, "seconds"), self._rows(waypoints, 2)
        return self.prover.route(rows, clearance=kept, slack=spare, seconds=limit)

    def steps(self, a: ArrayLike, b: ArrayLike, resolution: float | None = None) -> int:
        """Number of steps in which a motion is checked: the bound on the arm's displacement over the resolution."""
        size = self.motion_resolution if resolution is None else positive(resolution, "resolution", "give metres")
        return int(step_counts(self._rows(a, 1), self._rows(b, 1), self.weights, size)[0])

    def contacts(self, q: ArrayLike) -> tuple[Contact, ...]:
        """Every pair of bodies that touches or is within its margin at q, deepest first; empty if q is free."""
        rows = self._rows(q, 1)
        found = list(measured(self.bodies, self.pairs, self.robot.joint_frames(rows)[0], near_only=True))
        if not found:
            found = [inside(*names) for names in self._certificate().first_pairs(rows) if names is not None]
        return tuple(sorted(found, key=lambda c: c.clearance))

    def closest(self, q: ArrayLike, *, known_free: bool = False) -> Contact | None:
        """The pair of bodies that is nearest to contact or to its margin at q, or deepest in it; None if there is none.

        ``known_free`` leaves out the check for contacts, where they were ruled out before.
        """
        if known_free is not True and (touching := self.contacts(q)):
            return touching[0]
        found = measured(self.bodies, self.pairs, self.robot.joint_frames(self._rows(q, 1))[0], near_only=False)
        return min(found, key=lambda c: c.clearance, default=None)

    def clearance(self, q: ArrayLike) -> float:
        """Smallest signed distance less its margin at q [m]: negative in collision, +inf if nothing can collide."""
        nearest = self.closest(q)
        return float("inf") if nearest is None else nearest.clearance

    def explain(self, q: ArrayLike) -> str:
        """A line that says why q is not valid: the joint outside its limit, or the pair in collision; "" if it is."""
        if fault := self.robot.limit_fault(row := self._rows(q, 1)[0]):
            return fault
        if not (touching := self.contacts(row)):
            return ""
        return f"{touching[0]}" + (f" (and {more} more pair{'s' * (more > 1)})" if (more := len(touching) - 1) else "")

    def certify(self, Q: ArrayLike) -> Mask:
        """A second opinion on rows of Q, (m, dof) -> (m,), not by the checks of planners: proofs first, then coal."""
        mask = self.robot.within_limits(rows := self._rows(Q, 2))
        open_ = mask & ~self.prover.still_proven(rows)
        mask[open_] = self._certificate().free(rows[open_])
        return mask

    def _both_ends(self, A: ArrayLike, B: ArrayLike) -> tuple[Matrix, Matrix]:
        starts, ends = self._rows(A, 2), self._rows(B, 2)
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

    def _free(self, rows: Matrix) -> Mask:
        mask = self.robot.within_limits(rows) & (not self._always_colliding)
        if mask.all():
            return self._checks.free(rows)
        mask[mask] = self._checks.free(rows[mask])
        return mask

    def _motions_free(self, starts: Matrix, ends: Matrix) -> Mask:
        mask = self.robot.within_limits(starts) & self.robot.within_limits(ends) & (not self._always_colliding)
        starts, ends = one_way(starts[mask], ends[mask])
        counts = step_counts(starts, ends, self.weights, self.motion_resolution)
        proving = self._proven_clearance is not None
        mask[mask] = free = self._checks.motions_free(starts, ends, counts, to_be_proven=proving)
        if self._proven_clearance is not None:
            mask[mask] = self.prover.proven(starts[free], ends[free], clearance=self._proven_clearance)
        return mask

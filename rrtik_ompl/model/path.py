"""Paths of configurations: their length and moves, checks by a world, and files."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import (
    Mask,
    Matrix,
    Rows,
    Vector,
    finite_array,
    frozen,
    positive,
    truths,
    usable_waypoints,
)
from rrtik_ompl.base.copies import as_value, changed, in_notebook, in_print
from rrtik_ompl.base.errors import InputError, in_file, listed, name_of, require
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.base.units import joint_units
from rrtik_ompl.files.kinds import read
from rrtik_ompl.files.tables import FORMATS, dumps, loads
from rrtik_ompl.files.text import known_ending, read_text, write_text
from rrtik_ompl.model.judgement import Judge, Played, Violation, require_judge
from rrtik_ompl.model.proof import Proof, certificate_by
from rrtik_ompl.model.robot import Robot, joint_order, require_joints, unnamed_joints
from rrtik_ompl.model.transitions import (
    SAME,
    Move,
    length_of,
    merge_moves,
    moved,
    moves_several,
    part_counts,
    single_joint,
    subdivided,
    transitions,
)


@dataclass(frozen=True, slots=True, eq=False)
class JointPath(Rows):
    """Waypoints joined by straight lines in configuration space.

    A path is used like the array of its waypoints: ``np.asarray(path)``, ``len(path)``, ``path[0]``, ``path[1:]``,
    ``for q in path``. Whatever takes waypoints takes a path.

    Attributes:
        waypoints: Configurations, start first, shape (k, n) [rad, m for prismatic joints], read-only.
        joint_names: Names of the n joints.
        prismatic: Which joints are prismatic, shape (n,).
        robot_name: Name of the robot, or "".
        continuous: Which joints are revolute without limits, shape (n,).
        proof: The proof of its motions, see :meth:`proved`; None if there is none. Changing the waypoints drops it.

    Example:
        >>> path = rrtik.JointPath([[0.0, 0.5], [1.0, 0.5]])
        >>> len(path), path[-1], np.asarray(path).shape
        (2, array([1. , 0.5]), (2, 2))
    """

    waypoints: Matrix
    joint_names: tuple[str, ...]
    prismatic: Mask
    robot_name: str
    continuous: Mask
    proof: Proof | None

    __reduce__ = as_value
    _repr_html_ = in_notebook
    _repr_png_ = in_print

    def __init__(
        self,
        waypoints: ArrayLike,
        joint_names: Iterable[str] | None = None,
        prismatic: ArrayLike | None = None,
        robot_name: str = "",
        continuous: ArrayLike | None = None,
    ) -> None:
        rows = usable_waypoints(finite_array(waypoints, (None, None), "path waypoints"))

        count = rows.shape[1]
        joint_names = unnamed_joints(count) if joint_names is None else joint_names
        names = tuple(name_of(name, "a joint of a path") for name in listed(joint_names, "joint names of a path"))
        given = (np.zeros(count) if mask is None else mask for mask in (prismatic, continuous))
        sliding, endless = (truths(mask, "mask of a path's joints") for mask in given)
        if not len(names) == count == sliding.size == endless.size:
            raise InputError(f"path: waypoints have {count} columns, but {len(names)} joint names were given")

        values: dict[str, Any] = {
            "waypoints": frozen(rows),
            "joint_names": names,
            "prismatic": frozen(sliding, bool),
            "robot_name": robot_name,
            "continuous": frozen(endless, bool),
            "proof": None,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        k, n = self.waypoints.shape
        size = f"{k} waypoints of {n} joints, {self.transitions} transitions"
        return f"JointPath({size}, length {self.length:.3g} {self.unit})"

    @property
    def _rows(self) -> Matrix:
        return self.waypoints

    @staticmethod
    def of(robot: Robot, waypoints: ArrayLike) -> JointPath:
        """Create a path of a robot through ``waypoints``, shape (k, dof).

        Values slightly outside a limit are moved onto it (:meth:`rrtik_ompl.Robot.onto_limits`).

        Raises:
            InputError: If the rows do not have one value per joint of the robot.
        """
        require(robot, Robot, "robot of a path")
        rows = finite_array(waypoints, (None, robot.dof), f"path waypoints of robot '{robot.name}'")
        return path_of(robot, usable_waypoints(robot.onto_limits(rows)))

    def with_waypoints(self, waypoints: ArrayLike) -> JointPath:
        """Return a path of the same joints with other waypoints, shape (k, n), and without a proof.

        Raises:
            InputError: If the waypoints are not finite rows with one column for each joint.
        """
        rows = usable_waypoints(finite_array(waypoints, (None, None), "path waypoints"))
        count = rows.shape[1]
        names = self.joint_names
        if count != len(names):
            raise InputError(f"path: waypoints have {count} columns, but {len(names)} joint names were given")
        return path_through(self, rows)

    @property
    def start(self) -> Vector:
        """First waypoint, shape (n,)."""
        return np.asarray(self.waypoints[0])

    @property
    def end(self) -> Vector:
        """Last waypoint, shape (n,)."""
        return np.asarray(self.waypoints[-1])

    @property
    def length(self) -> float:
        """Sum of the Euclidean lengths of the edges [rad; metres count like radians]."""
        return length_of(self.waypoints)

    @property
    def unit(self) -> str:
        """Unit of the length: "rad", "m", or "rad, m" for a path with both kinds of joints."""
        return ", ".join(name for name, some in (("rad", ~self.prismatic), ("m", self.prismatic)) if some.any())

    @property
    def transitions(self) -> int:
        """Number of moves, where consecutive moves of the same joint count as one (the measure of C-RDT)."""
        return transitions(self.waypoints)

    @property
    def one_joint_at_a_time(self) -> bool:
        """Whether every edge moves exactly one joint, so that :meth:`moves` can list the moves."""
        return not moves_several(self.waypoints) and single_joint(merge_moves(self.waypoints), SAME)

    def moves(self) -> tuple[Move, ...]:
        """Return the single-joint moves of the path; consecutive moves of the same joint are merged.

        Raises:
            InputError: If an edge moves several joints at once;
                :func:`rrtik_ompl.planning.moves.staircase.one_joint_moves` makes a path of single-joint moves from any
                path.
        """
        rows = merge_moves(self.waypoints)
        changes = moved(rows[:-1], rows[1:])
        several = np.flatnonzero(changes.sum(axis=1) != 1)

        if len(several) and len(rows) > 1:
            together = ", ".join(np.array(self.joint_names)[changes[several[0]]])
            edge = int((moved(self.waypoints[:-1], self.waypoints[1:]).sum(axis=1) > 1).argmax())
            raise InputError(
                f"path: motion {edge + 1} moves several joints at once ({together}); it is no list of moves: "
                "convert it with one_joint_moves(path, problem)"
            )

        joints = changes.argmax(axis=1)
        units = joint_units(self.prismatic)
        return tuple(
            Move(self.joint_names[j], float(rows[i, j]), float(rows[i + 1, j]), units[j], bool(self.continuous[j]))
            for i, j in enumerate(joints)
        )

    def resample(self, step: float) -> JointPath:
        """Return the path with additional waypoints, so that none is farther than ``step`` [rad] from the next."""
        counts = part_counts(self.waypoints, positive(step, "resample step"))
        return path_through(self, subdivided(self.waypoints, counts)[0])

    def violations(self, world: Judge, *, resolution: float | None = None) -> tuple[Violation, ...]:
        """Check the path again, independently of the planner that made it: :meth:`rrtik_ompl.World.violations`.

        Returns:
            The first violation of every edge that has one; empty for a valid path.

        Raises:
            InputError: If the path moves other joints than the world's robot, or these in another order, is too long
                for its checks, or ``resolution`` is not positive.
        """
        require_judge(world, "world of a path's check")
        require_joints(world.robot, self.joint_names, "path")
        return world.violations(self.waypoints, resolution=resolution)

    def proved(self, world: Judge, *, clearance: float | None = None, seconds: float | None = None) -> JointPath:
        """Return the same path with a proof of its motions, made by :meth:`rrtik_ompl.World.prove`.

        Raises:
            InputError: If the path is another robot's, ``world`` is not a world, or the clearance is negative or
                infinite.
        """
        require_judge(world, "world of a path's proof")
        require_joints(world.robot, self.joint_names, "path")
        return self.with_proof(world.prove(self.waypoints, clearance=clearance, seconds=seconds))

    def with_proof(self, proof: Proof) -> JointPath:
        """Return the same path with a proof that has been made already."""
        return changed(self, proof=proof)

    def played(self, world: Judge | None) -> Played:
        """Return the path as a picture plays it, with a verdict by :meth:`rrtik_ompl.World.judged`.

        Args:
            world: The world that judges it; None for no verdict.

        Raises:
            InputError: If the path moves other joints than the world's robot, or these in another order.
        """
        if world is None:
            return Played(self.waypoints, None, None)
        require_judge(world, "world of a path to play", "NoneType")
        require_joints(world.robot, self.joint_names, "path")
        return Played(self.waypoints, None, world.judged(self.waypoints))

    @property
    def proven(self) -> bool:
        """Whether its proof covers every motion, in the world that it was made in; False without a proof.

        Copies, pickles and other processes say the same; :meth:`proven_in` asks a world of this process.
        """
        return self.proof is not None and self.proof.proven

    def proven_in(self, world: Judge) -> bool:
        """Check whether the proof of the path holds in a world, see :meth:`rrtik_ompl.World.has_proven`.

        A proof out of a pickle or of another process is not taken on trust: ``path.proved(world)`` makes it anew.
        """
        return self.proof is not None and world.has_proven(self.proof)

    def save(self, file: str | os.PathLike[str], *, proof: bool = False) -> None:
        """Write the path to a file: .json (complete), .csv (a header of joint names), .txt (OMPL's matrix text).

        The file is written completely or not at all.

        Args:
            file: Name of the file.
            proof: Whether a .json file also contains the certificate of the path, for ``rrtik check``.

        Raises:
            InputError: If the file has another ending or cannot be written, or a proof is requested and the path has
                none that covers it.

        Example:
            >>> path = rrtik.plan(rrtik.load_problem("planar3_boxes"), seed=1).path
            >>> path.save("path.json", proof=True)
            >>> rrtik.Certificate.load("path.json").clearance
            0.001
        """
        require(proof, bool, "proof")
        document = self.document()
        ending = known_ending(file, FORMATS, "path")
        if proof:
            known_ending(file, FORMATS[:1], "path with its proof")
            document["certificate"] = certificate_by(self.proof, self.waypoints).document()
        write_text(file, dumps(document, ending))

    @staticmethod
    def load(file: str | os.PathLike[str], robot: Robot | None = None) -> JointPath:
        """Read a path written by :meth:`save` or by OMPL (``printAsMatrix``).

        Args:
            file: A .json, .csv or .txt file.
            robot: If given, the path must fit it and takes over its joint names; columns in another order are sorted
                by name, with a warning.

        Raises:
            InputError: If the file is missing, malformed, or does not fit the robot; the message names file and line.

        Example:
            >>> rrtik.JointPath([[0.0, 0.0], [0.5, 1.0]], ["a", "b"]).save("path.csv")
            >>> rrtik.JointPath.load("path.csv").joint_names
            ('a', 'b')
        """
        return read(JointPath, file, robot)

    def document(self) -> dict[str, Any]:
        """Return the content of a .json file of the path."""
        return {
            "version": 1,
            "kind": "joint_path",
            "robot": self.robot_name,
            "joint_names": list(self.joint_names),
            "units": joint_units(self.prismatic),
            "continuous": [name for name, endless in zip(self.joint_names, self.continuous, strict=True) if endless],
            "length": self.length,
            "transitions": self.transitions,
            "waypoints": (self.waypoints + 0.0).tolist(),  # turns -0.0 into 0.0
        }


def path_through(path: JointPath, rows: Matrix) -> JointPath:
    """Return a path with other waypoints, as :meth:`JointPath.with_waypoints` but without validation."""
    return changed(path, waypoints=frozen(rows), proof=None)


def path_of(robot: Robot, rows: Matrix, proof: Proof | None = None) -> JointPath:
    """Return a path of a robot, as :meth:`JointPath.of` but without validation; rows are within the limits."""
    return changed(_at_zero(robot), waypoints=frozen(rows), proof=proof)


@kept_with
def _at_zero(robot: Robot) -> JointPath:
    """Return a path of a robot from which its other paths are copied."""
    return JointPath(np.zeros((1, robot.dof)), robot.joint_names, robot.prismatic, robot.name, robot.continuous)


def read_path(file: str | os.PathLike[str], robot: Robot | None = None) -> JointPath:
    """Read a path; see :meth:`JointPath.load`.

    Raises:
        InputError: If the file is missing, malformed, or does not fit the robot; the message names file and line.
    """
    require(robot, Robot | None, "robot of a path", "use load_robot(name)")
    ending = known_ending(file, FORMATS, "path")

    try:
        document = loads(read_text(file), ending)
        names = document.get("joint_names")
        name = str(document.get("robot", ""))
        units = document.get("units")
        endless = document.get("continuous")
        sliding = None if units is None else [unit == "m" for unit in units]
        turning = None if names is None or endless is None else [joint in endless for joint in names]
        found = JointPath(document["waypoints"], names, sliding, name, turning)
        if robot is None:
            return found
        return JointPath.of(robot, found.waypoints[:, joint_order(robot, found.joint_names, "path")])
    except InputError as error:
        raise in_file(file, error) from None


def fitted(path: JointPath, robot: Robot) -> JointPath:
    """Return the path as one of a robot, with its waypoints moved onto the limits.

    Raises:
        InputError: If it moves other joints, or names them in another order. Default names fit every robot.
    """
    require_joints(robot, path.joint_names, "path")
    return JointPath.of(robot, path.waypoints)

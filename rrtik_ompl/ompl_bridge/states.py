"""Conversion between arrays and OMPL states, in spaces whose states are rows of numbers.

These are spaces of real coordinates, angles of SO(2), and compounds of both.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ompl_bridge.bindings import ob, og
from rrtik_ompl.ompl_bridge.unrolled import on_circles

WANTED = "needs a RealVectorStateSpace, an SO2StateSpace or a compound of them (one number a coordinate)"


def space_bounds(si: ob.SpaceInformation) -> tuple[Vector, Vector]:
    """Return lower and upper bounds of the coordinates of a space, shapes (n,); for an angle of SO(2) -pi and pi.

    Raises:
        InputError: If a bound is missing: it is not finite, or the lower one is not below the upper one.
    """
    return _checked_bounds(*coordinates_of(si, constrained=True).bounds(si.getStateSpace()))


def _checked_bounds(low: list[float], high: list[float]) -> tuple[Vector, Vector]:
    """Return bounds as arrays, shapes (n,), or raise an InputError if one is missing."""
    lower = frozen(low)
    upper = frozen(high)
    bad = np.flatnonzero(~(np.isfinite(lower) & np.isfinite(upper) & (lower < upper)))
    if len(bad):
        i = int(bad[0])
        raise InputError(
            f"state space: coordinate {i} has the bounds [{lower[i]:g}, {upper[i]:g}]; "
            "set finite bounds, lower below upper, with space.setBounds()"
        )

    return lower, upper


class StateIO:
    """Copies configurations, one at a time, between numpy and states of real coordinates and angles of SO(2).

    OMPL's ``serialize`` writes through a pointer. Given the address of a numpy buffer, in a capsule with the name that
    the bindings expect, it copies a state several times faster than reading its coordinates one by one. The name is an
    internal of the bindings: it is tried once at construction, and if it fails, the coordinates are read one by one. An
    angle is written in [-pi, pi], whatever turn it is in.

    An object is for one thread. It holds the space and no state, so anything that the space does not refer to may keep
    it.

    Attributes:
        dof: Number of coordinates, n.
        turning: Which of them are angles of SO(2), shape (n,).
        turns: Whether any of them is.
        fast: Whether the capsule works.
    """

    def __init__(self, si: ob.SpaceInformation) -> None:
        self._coordinates = coordinates_of(si, constrained=True)
        self._space = si.getStateSpace()
        self.dof = self._coordinates.size
        self.turning = self._coordinates.turning
        self.turns = bool(self.turning.any())
        self._bounds: tuple[object, tuple[Vector, Vector]] | None = None

        self._buffer = np.zeros(self.dof)
        self._capsule = _capsule(self._buffer)
        self.fast = self._capsule is not None and self._capsule_works(si)

    def bounds(self) -> tuple[Vector, Vector]:
        """Return :func:`space_bounds` as they are now; the same arrays as long as the bounds do not change."""
        numbers = self._coordinates.bounds(self._space)
        if self._bounds is None or numbers != self._bounds[0]:
            self._bounds = numbers, _checked_bounds(*numbers)
        return self._bounds[1]

    def read(self, state: ob.State) -> Vector:
        """Return a copy of the coordinates of a state, shape (n,)."""
        if not self.fast:
            return np.array(self._coordinates.read(state), dtype=np.float64)
        self._space.serialize(self._capsule, state)
        return self._buffer.copy()

    def write(self, state: ob.State, q: Vector) -> None:
        """Set the coordinates of a state to q, shape (n,)."""
        q = on_circles(q, self.turning) if self.turns else q
        if not self.fast:
            self._coordinates.write(state, q.tolist())
            return
        self._buffer[:] = q
        self._space.deserialize(state, self._capsule)

    def path(self, si: ob.SpaceInformation, rows: Matrix) -> og.PathGeometric:
        """Return rows, shape (k, n), as an ``ompl.geometric.PathGeometric``."""
        path = og.PathGeometric(si)
        state = si.allocState()
        append = path.append  # append copies the state
        for row in rows:
            self.write(state, row)
            append(state)
        return path

    def rows(self, path: og.PathGeometric) -> Matrix:
        """Return the states of a PathGeometric as rows, shape (k, n)."""
        return np.array([self.read(path.getState(k)) for k in range(path.getStateCount())])

    def _capsule_works(self, si: ob.SpaceInformation) -> bool:
        """Check whether states are read and written through the capsule as they are coordinate by coordinate."""
        state = si.allocState()
        probe = np.arange(1.0, self.dof + 1.0)
        if self._space.getSerializationLength() != self._buffer.nbytes:
            return False

        try:
            self._buffer[:] = probe
            self._space.deserialize(state, self._capsule)
            written = self._coordinates.read(state) == probe.tolist()
            self._coordinates.write(state, (-probe).tolist())
            self._space.serialize(self._capsule, state)
        except (TypeError, RuntimeError):
            return False

        return written and bool((self._buffer == -probe).all())


def _capsule(buffer: Vector) -> object:
    """Return a capsule around the address of ``buffer``, or None if the interpreter cannot make one."""
    try:
        new: Callable[..., object] = ctypes.pythonapi.PyCapsule_New
    except AttributeError:
        return None

    new.restype = ctypes.py_object  # type: ignore[attr-defined]
    new.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]  # type: ignore[attr-defined]
    return new(buffer.ctypes.data, b"nb_handle", None)


@dataclass(frozen=True)
class Coordinates:
    """The coordinates of a state, in the order in which OMPL serializes them.

    Attributes:
        kind: Class of the space: real, SO(2), SE(2), any other compound, or a constrained space. Spaces that
            interpolate differently, such as Dubins' curves, are not among them.
        size: Number of coordinates.
        parts: For a compound the coordinates of its subspaces.
    """

    kind: type[ob.StateSpace]
    size: int
    parts: tuple[Coordinates, ...] = ()

    @cached_property
    def turning(self) -> Mask:
        """Which coordinates are angles of SO(2), shape (size,)."""
        if self.parts:
            return frozen(np.concatenate([part.turning for part in self.parts]), bool)
        return frozen(np.full(self.size, self.kind is ob.SO2StateSpace), bool)

    def read(self, state: ob.State) -> list[float]:
        """Return the coordinates of a state."""
        if self.kind is ob.RealVectorStateSpace:
            return list(state[0 : self.size])
        if self.kind is ob.SO2StateSpace:
            return [state.value]
        if self.kind is ob.SE2StateSpace:
            return [state.getX(), state.getY(), state.getYaw()]
        if self.kind is ob.ConstrainedStateSpace:
            return [state[k] for k in range(self.size)]
        return [number for k, part in enumerate(self.parts) for number in part.read(state[k])]

    def write(self, state: ob.State, numbers: list[float]) -> None:
        """Set the coordinates of a state."""
        if self.kind is ob.RealVectorStateSpace:
            state[0 : self.size] = numbers
        elif self.kind is ob.SO2StateSpace:
            state.value = numbers[0]
        elif self.kind is ob.SE2StateSpace:
            state.setXY(*numbers[:2])
            state.setYaw(numbers[2])
        elif self.kind is ob.ConstrainedStateSpace:
            state.copy(np.array(numbers))
        else:
            for k, part in enumerate(self.parts):
                part.write(state[k], numbers[: part.size])
                numbers = numbers[part.size :]

    def bounds(self, space: ob.StateSpace) -> tuple[list[float], list[float]]:
        """Return lower and upper bounds of a space of this kind, unchecked; for an angle -pi and pi."""
        if self.kind is ob.RealVectorStateSpace:
            bounds = space.getBounds()
            return list(bounds.low), list(bounds.high)
        if self.kind is ob.SO2StateSpace:
            return [-np.pi], [np.pi]
        if self.kind is ob.ConstrainedStateSpace:
            return self.parts[0].bounds(space.getSpace())

        of_parts = [part.bounds(space.getSubspace(k)) for k, part in enumerate(self.parts)]
        lower, upper = ([number for each in of_parts for number in each[side]] for side in (0, 1))
        return lower, upper


def coordinates_of(si: ob.SpaceInformation, *, constrained: bool = False) -> Coordinates:
    """Return the coordinates of the space of a SpaceInformation.

    Args:
        si: The SpaceInformation.
        constrained: Whether the space may be a constrained one of real coordinates, in which motions are not straight.

    Raises:
        InputError: If ``si`` is no SpaceInformation, or its space has other states than rows of numbers, or none.
    """
    if not isinstance(si, ob.SpaceInformation):
        raise InputError(f"planner: expected an ompl.base.SpaceInformation, got {type(si).__name__}")

    space = si.getStateSpace()
    if constrained and isinstance(space, ob.ConstrainedStateSpace):
        ambient = _coordinates(space.getSpace(), " that is constrained")
        return Coordinates(ob.ConstrainedStateSpace, ambient.size, (ambient,))

    found = _coordinates(space, "")
    if found.size == 0:
        raise InputError("planner: needs a space of at least one coordinate, got none")
    return found


def _coordinates(space: ob.StateSpace, inside: str) -> Coordinates:
    """Returns the coordinates of a space and, recursively, of its subspaces.

    `inside` completes the text of an error.
    """
    # OMPL's own class, even if the space is of a class derived from it in Python.
    kind = next(each for each in type(space).__mro__ if each.__module__.startswith("ompl"))
    if kind is ob.RealVectorStateSpace:
        return Coordinates(kind, int(space.getDimension()))
    if kind is ob.SO2StateSpace:
        return Coordinates(kind, 1)
    if kind not in (ob.CompoundStateSpace, ob.SE2StateSpace):
        raise InputError(f"planner: {WANTED}, got a {type(space).__name__}{inside}")

    parts = tuple(_coordinates(space.getSubspace(k), " in a compound") for k in range(space.getSubspaceCount()))
    return Coordinates(kind, sum(part.size for part in parts), parts)

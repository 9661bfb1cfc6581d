"""Arrays to OMPL states and back."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.errors import InputError


def real_vector_space(si: ob.SpaceInformation) -> ob.RealVectorStateSpace:
    """The state space of a SpaceInformation.

    Raises:
        InputError: If ``si`` is no SpaceInformation or its space is not a RealVectorStateSpace.
    """
    if not isinstance(si, ob.SpaceInformation):
        raise InputError(f"planner: expected an ompl.base.SpaceInformation, got {type(si).__name__}")
    space = si.getStateSpace()
    if not isinstance(space, ob.RealVectorStateSpace):
        raise InputError(f"planner: needs a RealVectorStateSpace (one value per joint), got a {type(space).__name__}")
    if space.getDimension() == 0:
        raise InputError("planner: needs a space of at least one coordinate, got none")
    return space


def space_bounds(si: ob.SpaceInformation) -> tuple[Vector, Vector]:
    """Lower and upper bounds of a RealVectorStateSpace, shapes (n,).

    Raises:
        InputError: If a bound is missing: not finite, or the lower one not below the upper one.
    """
    bounds = real_vector_space(si).getBounds()
    lower, upper = np.array(bounds.low, dtype=np.float64), np.array(bounds.high, dtype=np.float64)
    bad = np.flatnonzero(~(np.isfinite(lower) & np.isfinite(upper) & (lower < upper)))
    if len(bad):
        i = int(bad[0])
        raise InputError(
            f"state space: coordinate {i} has the bounds [{lower[i]:g}, {upper[i]:g}]; "
            "set finite bounds, lower below upper, with space.setBounds()"
        )
    return lower, upper


class StateIO:
    """Copies one configuration at a time between numpy and a state of a RealVectorStateSpace.

    OMPL's ``serialize`` writes through a pointer. Handing it the address of a numpy buffer, in a capsule of the name
    that the bindings expect, copies a state several times faster than reading its coordinates one by one. The name is
    an internal of the bindings: it is tried once at construction, and if it fails, slices do the same work.

    For one thread. It holds the space and no state, so whatever a space does not lead to may keep it.
    """

    def __init__(self, si: ob.SpaceInformation) -> None:
        self._space = real_vector_space(si)
        self.dof = int(self._space.getDimension())
        self._buffer = np.zeros(self.dof)
        self._capsule = _capsule(self._buffer)
        self.fast = self._capsule is not None and self._capsule_works(si)

    def bounds(self) -> tuple[list[float], list[float]]:
        """Lower and upper bounds of the space as they are."""
        bounds = self._space.getBounds()
        return list(bounds.low), list(bounds.high)

    def read(self, state: ob.State) -> Vector:
        """A private copy of the coordinates of a state, shape (n,)."""
        if not self.fast:
            return np.array(state[0 : self.dof], dtype=np.float64)
        self._space.serialize(self._capsule, state)
        return self._buffer.copy()

    def write(self, state: ob.State, q: Vector) -> None:
        """Set the coordinates of a state to q, shape (n,)."""
        if not self.fast:
            state[0 : self.dof] = q.tolist()
            return
        self._buffer[:] = q
        self._space.deserialize(state, self._capsule)

    def path(self, si: ob.SpaceInformation, rows: Matrix) -> og.PathGeometric:
        """Rows, shape (k, n), as an ``ompl.geometric.PathGeometric``."""
        path, state = og.PathGeometric(si), si.allocState()
        append = path.append  # copies
        for row in rows:
            self.write(state, row)
            append(state)
        return path

    def rows(self, path: og.PathGeometric) -> Matrix:
        """The states of a PathGeometric as rows, shape (k, n)."""
        return np.array([self.read(path.getState(k)) for k in range(path.getStateCount())])

    def _capsule_works(self, si: ob.SpaceInformation) -> bool:
        state, probe = si.allocState(), np.arange(1.0, self.dof + 1.0)
        if self._space.getSerializationLength() != self._buffer.nbytes:
            return False
        try:
            self._buffer[:] = probe
            self._space.deserialize(state, self._capsule)
            written = state[0 : self.dof] == probe.tolist()
            state[0 : self.dof] = (-probe).tolist()
            self._space.serialize(self._capsule, state)
        except (TypeError, RuntimeError):
            return False
        return written and bool((self._buffer == -probe).all())


def _capsule(buffer: Vector) -> object:
    """A capsule around the address of ``buffer``, or None where the interpreter cannot make one."""
    try:
        new: Callable[..., object] = ctypes.pythonapi.PyCapsule_New
    except AttributeError:
        return None
    new.restype = ctypes.py_object  # type: ignore[attr-defined]
    new.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]  # type: ignore[attr-defined]
    return new(buffer.ctypes.data, b"nb_handle", None)

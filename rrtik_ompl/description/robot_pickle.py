"""Send robots to other processes: their geometry in a compact form, and one object per robot wherever it arrives.

Importing this module registers robots with pickle (and so with multiprocessing, joblib and Dask).
"""

from __future__ import annotations

import copyreg
import pickle
import threading
from collections import OrderedDict
from dataclasses import fields
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.copies import Once, packed, unpacked
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.digest import sha256
from rrtik_ompl.geometry.collision.solids import bvh, is_mesh, mesh_arrays
from rrtik_ompl.model.robot import Robot

if TYPE_CHECKING:
    import coal

LIMITS = tuple(f"{end}{what}Limit" for what in ("Position", "Velocity", "Effort") for end in ("lower", "upper"))
MOST_ROBOTS = 16  # most received robots that are kept, so that further copies become the same object
_known: OrderedDict[bytes, Robot] = OrderedDict()
_lock = threading.Lock()


def reduce_robot(robot: Robot) -> tuple[Any, ...]:
    """Return what pickle stores of a robot: a function and its arguments.

    Raises:
        InputError: If its own inverse kinematics cannot be pickled.
    """
    data = _bytes_of(robot)
    _remember(sha256(data).digest(), robot)
    return robot_from_bytes, (data,)


def robot_from_bytes(data: bytes) -> Robot:
    """Return the robot that :func:`reduce_robot` stored; one object for the same bytes, so that tables are shared."""
    key = sha256(data).digest()
    with _lock:
        if key in _known:
            return _known[key]

    state: dict[str, Any] = {name: unpacked(value) for name, value in pickle.loads(data).items()}
    state["collision"] = _geometry(state["collision"])
    state["looks"] = Once(_geometry, state["looks"])
    state["model"] = _with_limits(*state["model"])
    return _remember(key, Robot(**state))


def _remember(key: bytes, robot: Robot) -> Robot:
    with _lock:
        robot = _known.setdefault(key, robot)
        _known.move_to_end(key)
        if len(_known) > MOST_ROBOTS:
            _known.popitem(last=False)
    return robot


@lru_cache(maxsize=2)  # Many problems of one robot may be sent in a row.
def _bytes_of(robot: Robot) -> bytes:
    state = {field.name: packed(getattr(robot, field.name)) for field in fields(robot)}
    state |= {"collision": _items(robot.collision), "looks": _items(robot.visual)}
    state["model"] = _without_limits(robot.model)
    try:
        return pickle.dumps(state, protocol=5)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise InputError(
            f"robot '{robot.name}' cannot be sent to another process: {error}; define its closed_form in a module"
        ) from None


def _without_limits(model: pin.Model) -> tuple[pin.Model, dict[str, Vector]]:
    """Return a copy of a model without its limits, and the limits.

    Pinocchio 4.0 cannot read the infinite limits that it writes.
    """
    limits = {name: np.array(getattr(model, name)) for name in LIMITS}
    return _with_limits(model.copy(), {name: np.zeros_like(row) for name, row in limits.items()}), limits


def _with_limits(model: pin.Model, limits: dict[str, Vector]) -> pin.Model:
    for name, row in limits.items():
        setattr(model, name, row)
    return model


def _items(geometry: pin.GeometryModel) -> list[tuple[Any, ...]]:
    """Return a geometry model as plain values, with meshes as arrays: coal's own format is ten times as long."""
    return [
        (item.name, item.parentJoint, item.parentFrame, item.placement, *_shape(item.geometry), item.meshPath,
         item.meshScale, item.overrideMaterial, item.meshColor)
        for item in geometry.geometryObjects
    ]  # fmt: skip


def _shape(geometry: coal.CollisionGeometry) -> tuple[Any, Any]:
    return mesh_arrays(geometry) if is_mesh(geometry) else (geometry, None)


def _geometry(items: list[tuple[Any, ...]]) -> pin.GeometryModel:
    model = pin.GeometryModel()
    for name, joint, frame, placement, shape, triangles, *look in items:
        geometry = shape if triangles is None else bvh(shape, triangles)
        model.addGeometryObject(pin.GeometryObject(name, joint, frame, placement, geometry, *look))
    return model


copyreg.pickle(Robot, reduce_robot)

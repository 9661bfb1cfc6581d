"""The scenes that a run has seen, as its record holds them: each shape once, and else only what has changed."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import finite_array, finite_number, whole_number
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.poses import pose, pose_row
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Motion, Obstacle, Scene, TimedPoses, Touching
from rrtik_ompl.model.shapes import SHAPES, Shape
from rrtik_ompl.replanning.feed import Snapshot

Json = dict[str, Any]


def scenes_data(snapshots: Sequence[Snapshot]) -> Json:
    """Shapes and snapshots for JSON; of a snapshot only the obstacles that differ from the one before it."""
    shapes: dict[int, Json] = {}  # by identity: a cloud need not be compared
    numbers: dict[int, int] = {}

    def number_of(shape: Shape) -> int:
        if id(shape) not in numbers:
            numbers[id(shape)] = len(numbers)
            shapes[numbers[id(shape)]] = _shape_data(shape)
        return numbers[id(shape)]

    entries = list[Json]()
    previous_rows = dict[str, Json]()
    allowed: list[list[str]] | None = None
    contacts = list[list[Any]]()
    for snapshot in snapshots:
        entry: Json = {"time": snapshot.time}
        rows = {o.name: _obstacle_data(o, number_of(o.shape)) for o in snapshot.scene.obstacles}
        entry["obstacles"] = [row for name, row in rows.items() if previous_rows.get(name) != row]
        previous_rows = rows

        pairs = [list(pair) for pair in snapshot.scene.allowed_collisions]
        if pairs != allowed:
            entry["allowed_collisions"] = allowed = pairs
        touching = [[each.first, each.second, each.distance] for each in snapshot.scene.contacts]
        if touching != contacts:
            entry["contacts"] = contacts = touching

        if not entries and snapshot.scene.attached:
            entry["attached"] = [_held_data(held, number_of(held.shape)) for held in snapshot.scene.attached]
        entry |= {"unseen": dict(snapshot.unseen)} if snapshot.unseen else {}
        entry |= {"stated": True} if snapshot.stated else {}
        entries.append(entry)

    return {"shapes": list(shapes.values()), "scenes": entries}


def scenes_of(document: Mapping[str, Any]) -> list[Snapshot]:
    """The snapshots of a record; none if it has none.

    Raises:
        InputError: If one is malformed.
    """
    if "scenes" not in document:
        return []
    require(document["scenes"], list, "scenes")
    shapes = [_shape(entry) for entry in document.get("shapes", [])]

    snapshots = list[Snapshot]()
    obstacle_of_name = dict[str, Obstacle]()
    attached: tuple[AttachedObject, ...] = ()
    allowed: list[list[str]] = []
    contacts = list[list[Any]]()

    for entry in document["scenes"]:
        obstacle_of_name |= {o.name: o for o in (_obstacle(row, shapes) for row in entry["obstacles"])}
        allowed = entry.get("allowed_collisions", allowed)
        attached = tuple(_held(row, shapes) for row in entry["attached"]) if "attached" in entry else attached
        contacts = entry.get("contacts", contacts)

        time = finite_number(entry["time"], "time of a scene")
        unseen = {name: finite_number(age, f"unseen of '{name}'") for name, age in entry.get("unseen", {}).items()}
        pairs = tuple((first, second) for first, second in allowed)
        touching = tuple(Touching(*each) for each in contacts)
        scene = Scene(tuple(obstacle_of_name.values()), attached, pairs, touching)

        if snapshots and time <= snapshots[-1].time:
            raise InputError(f"scenes: times go backwards: {time:g} s comes after {snapshots[-1].time:g} s")
        snapshots.append(Snapshot(time, scene, unseen, bool(entry.get("stated", False))))

    return snapshots


@lru_cache
def _arguments(kind: type[Shape]) -> tuple[str, ...]:
    """Names of the numbers that make a shape: attributes that its class is called with."""
    own = {f.name for f in fields(kind)}  # type: ignore[arg-type]
    return tuple(name for name in inspect.signature(kind).parameters if name in own and name != "source")


def _shape_data(shape: Shape) -> Json:
    values = {name: _plain(getattr(shape, name)) for name in _arguments(type(shape))}
    return {"kind": shape.key, **values}


def _plain(value: object) -> object:
    """Numbers as JSON has them; NaN, for a column that is not there, as null."""
    if not isinstance(value, np.ndarray):
        return value
    if np.issubdtype(value.dtype, np.integer) or np.isfinite(value).all():
        return value.tolist()
    numbers = value.astype(object)
    numbers[~np.isfinite(value)] = None
    return numbers.tolist()


def _shape(entry: Mapping[str, Any]) -> Shape:
    kind = SHAPES[one_of(tuple(SHAPES), str(entry["kind"]), "kind of a shape")]
    values = {name: entry[name] for name in _arguments(kind)}
    if "heights" in values:
        values |= {"heights": np.array(values["heights"], dtype=np.float64), "invalid": "drop"}
    return kind(**values)


def _obstacle_data(obstacle: Obstacle, shape: int) -> Json:
    data: Json = {"name": obstacle.name, "shape": shape, "pose": pose_row(obstacle.pose).tolist()}
    data |= {"margin": obstacle.margin} if obstacle.margin else {}
    if isinstance(obstacle.motion, ConstantVelocity):
        data["velocity"] = obstacle.motion.velocity.tolist()
    elif isinstance(obstacle.motion, TimedPoses):
        data["times"] = obstacle.motion.times.tolist()
        data["poses"] = [pose_row(there).tolist() for there in obstacle.motion.poses]
    return data


def _obstacle(row: Mapping[str, Any], shapes: Sequence[Shape]) -> Obstacle:
    name = row["name"]
    motion: Motion | None = None
    if "velocity" in row:
        motion = ConstantVelocity(row["velocity"])
    elif "times" in row:
        motion = TimedPoses(row["times"], [_pose(there, name) for there in row["poses"]])
    return Obstacle(name, _numbered(row, shapes), _pose(row["pose"], name), motion, row.get("margin", 0.0))


def _held_data(item: AttachedObject, shape: int) -> Json:
    data: Json = {"name": item.name, "link": item.link, "shape": shape, "pose": pose_row(item.pose).tolist()}
    return data | {"allow": list(item.allow), "padding": item.padding, "margin": item.margin}


def _held(row: Mapping[str, Any], shapes: Sequence[Shape]) -> AttachedObject:
    name = row["name"]
    place = _pose(row["pose"], name)
    beside = tuple(row["allow"]), row["padding"], row["margin"]
    return AttachedObject(name, row["link"], _numbered(row, shapes), place, *beside)


def _numbered(row: Mapping[str, Any], shapes: Sequence[Shape]) -> Shape:
    number = whole_number(row["shape"], f"shape of '{row['name']}'")
    if number >= len(shapes):
        raise InputError(f"shape of '{row['name']}': there is no shape {number}, only {len(shapes)}")
    return shapes[number]


def _pose(values: ArrayLike, name: str) -> pin.SE3:
    row = finite_array(values, (7,), f"pose of '{name}'")
    return pose(row[:3], row[3:], f"pose of '{name}'")

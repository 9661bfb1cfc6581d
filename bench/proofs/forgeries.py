"""Forges certificates: each function returns what verifiers are given, or None where it finds nothing to forge.

A forgery counts only if it is certain that it must be refused. Some are refused by construction: the file is malformed,
or is about another robot, scene, path or clearance than the one that is asked about. Of the others the judge of
`forgery_judge` finds a witness: the path touches, a plane does not separate, or a pair is shown apart by nothing. What
is still a proof after it was changed is none.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from bench.proofs.forgery_judge import Document, Judge, between, entries_of, outside
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.certificate import Route
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, TimedPoses
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.world.certificates import certificate_for
from rrtik_ompl.world.world import World

PLACES = 20  # of each motion at which frames are looked at
LEAST_EXCESS = 2e-3  # [m] or [rad] that a frame has to be outside of bounds, for a tolerance that it exceeds
SLIGHT = 1e-5  # [rad] or [m] by which numbers are changed that have to be the same
ODD_VALUES: tuple[Any, ...] = (None, True, "0", "NaN", [], {}, -1, 1.5, 2**40, 10**400, 1e308, [[0.0]])
RAW_VALUES = ("NaN", "1e999", "-1e999", "Infinity", "01", "0x1", '"\\ud800"', "1e-999e5")


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A true certificate, and what it is about."""

    world: World
    route: Route
    document: Document
    judge: Judge

    @property
    def waypoints(self) -> Matrix:
        """The waypoints, shape (k, dof)."""
        return self.route.waypoints


@dataclass(frozen=True, slots=True, eq=False)
class Forgery:
    """What both verifiers are given.

    Attributes:
        text: The certificate's file.
        world: The robot and the scene of the asker.
        route: The motion of the asker.
        clearance: What the asker wants to be kept [m].
    """

    text: str
    world: World
    route: Route
    clearance: float = 0.0


Forger = Callable[[Case, np.random.Generator], "Forgery | None"]


def _given(case: Case, document: Document, *, waypoints: Matrix | None = None, **changes: Any) -> Forgery:
    route = case.route if waypoints is None else replace(case.route, waypoints=waypoints)
    return replace(Forgery(json.dumps(document), case.world, route), **changes)


def _pick(rng: np.random.Generator, items: Any) -> Any:
    return items[int(rng.integers(len(items)))]


def _entry(case: Case, rng: np.random.Generator, length: int | None = None) -> tuple[int, int] | None:
    places = [
        (m, k) for m, k in entries_of(case.document) if length is None or len(case.document["motions"][m][k]) == length
    ]
    return _pick(rng, places) if places else None


# --- other paths ---


def moved_waypoint(case: Case, rng: np.random.Generator) -> Forgery:
    """A waypoint of the certificate is moved by a millionth: it is for another path."""
    document = deepcopy(case.document)
    row = _pick(rng, document["waypoints"])
    row[int(rng.integers(len(row)))] += 1e-6
    return _given(case, document)


def moved_path(case: Case, rng: np.random.Generator) -> Forgery:
    """The path is another one than that of the certificate."""
    rows = np.array(case.waypoints)
    rows[int(rng.integers(len(rows))), int(rng.integers(rows.shape[1]))] += 1e-6
    return _given(case, case.document, waypoints=rows)


def reordered_waypoints(case: Case, rng: np.random.Generator) -> Forgery:
    """The waypoints of the certificate are in another order."""
    document = deepcopy(case.document)
    document["waypoints"] = document["waypoints"][::-1]
    return _given(case, document)


def other_columns(case: Case, rng: np.random.Generator) -> Forgery | None:
    """The certificate's joints take the numbers of the waypoints in another order than the path's."""
    order = rng.permutation(case.waypoints.shape[1])
    document = deepcopy(case.document)
    rows = np.array(document["waypoints"])[:, order]
    if np.array_equal(rows, case.waypoints):
        return None
    document["waypoints"] = rows.tolist()
    if "rates" in document:
        document["rates"] = np.array(document["rates"])[:, :, order].tolist()
    for joint in document["joints"]:
        joint["gain"] = [joint["gain"][k] for k in order]
    rates = case.route.rates
    route = replace(case.route, waypoints=rows, rates=None if rates is None else rates[:, :, order])
    return _given(case, document, route=route)


def colliding_path(case: Case, rng: np.random.Generator) -> Forgery | None:
    """Path and certificate lead through a configuration that touches; the rest is kept."""
    lower, upper = case.world.robot.finite_range()
    drawn = rng.uniform(lower, upper, (100, len(lower)))
    colliding = drawn[~case.world.valid_batch(drawn)]
    if len(colliding) == 0:
        return None
    document = deepcopy(case.document)
    rows = np.array(case.waypoints)
    rows[int(rng.integers(len(rows)))] = colliding[0]
    document["waypoints"] = rows.tolist()
    route = replace(case.route, waypoints=rows)
    return _given(case, document, route=route) if case.judge.touches(route) else None


def outside_limits(case: Case, rng: np.random.Generator) -> Forgery:
    """A waypoint of path and certificate is far outside the joints' limits."""
    rows = np.array(case.waypoints)
    column = int(rng.integers(rows.shape[1]))
    rows[int(rng.integers(len(rows))), column] = 50.0 if np.isfinite(case.world.robot.upper[column]) else 2e3
    document = deepcopy(case.document)
    document["waypoints"] = rows.tolist()
    return _given(case, document, waypoints=rows)


# --- entries ---


def _with_entry(case: Case, place: tuple[int, int], entry: list[Any]) -> Document:
    document = deepcopy(case.document)
    document["motions"][place[0]][place[1]] = entry
    return document


def _if_wrong(case: Case, place: tuple[int, int], entry: list[Any]) -> Forgery | None:
    """Return the forgery with an entry changed if its plane is wrong."""
    document = _with_entry(case, place, entry)
    return _given(case, document) if case.judge.wrong_plane(document, place[0], entry) else None


def _if_incomplete(
    case: Case, document: Document, m: int, entry: list[Any], rng: np.random.Generator
) -> Forgery | None:
    i, j = entry[0], entry[2 if len(entry) > 4 else 1]
    return _given(case, document) if case.judge.incomplete(document, m, i, j, rng) else None


def turned_plane(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A plane is turned over."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    entry = case.document["motions"][place[0]][place[1]]
    return _if_wrong(case, place, [*entry[:6], *(-np.array(entry[6:])).tolist()])


def tilted_plane(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A plane has any other normal."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    entry = case.document["motions"][place[0]][place[1]]
    normal = rng.normal(size=3)
    return _if_wrong(case, place, [*entry[:6], *(normal / np.linalg.norm(normal)).tolist()])


def short_normal(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A normal is shorter than 0.5, or zero."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    entry = case.document["motions"][place[0]][place[1]]
    return _given(
        case, _with_entry(case, place, [*entry[:6], *(np.array(entry[6:]) * _pick(rng, (0.0, 0.3, 1e-9))).tolist()])
    )


def other_plane_of_a_half_space(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A link and a half-space are shown apart by another plane than the half-space's, or by a distance."""
    bodies = case.document["bodies"]
    floors = [k for k, body in enumerate(bodies) if "half_space" in body["shape"]]
    links = [k for k, body in enumerate(bodies) if body["kind"] == "link" and body["joint"] > 0]
    if not floors or not links:
        return None
    i, j = _pick(rng, links), _pick(rng, floors)
    document = deepcopy(case.document)
    _pick(rng, document["motions"]).append(_pick(rng, ([i, 0, j, 0, 0, 0, 0.0, 0.0, 1.0], [i, j, 10, 1])))
    return _given(case, document)


def dropped_entry(case: Case, rng: np.random.Generator) -> Forgery | None:
    """An entry is missing."""
    place = _entry(case, rng)
    if place is None:
        return None
    document = deepcopy(case.document)
    entry = document["motions"][place[0]].pop(place[1])
    return _if_incomplete(case, document, place[0], entry, rng)


def dropped_pair(case: Case, rng: np.random.Generator) -> Forgery | None:
    """All entries of a pair are missing in a motion."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    document = deepcopy(case.document)
    entry = document["motions"][place[0]][place[1]]
    same = (entry[0], entry[2])
    document["motions"][place[0]] = [row for row in document["motions"][place[0]] if (row[0], row[2]) != same]
    return _if_incomplete(case, document, place[0], entry, rng)


def dropped_motion(case: Case, rng: np.random.Generator) -> Forgery | None:
    """The entries of a whole motion are missing."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    document = deepcopy(case.document)
    entry = document["motions"][place[0]][place[1]]
    document["motions"][place[0]] = []
    return _if_incomplete(case, document, place[0], entry, rng)


def other_interval(case: Case, rng: np.random.Generator) -> Forgery | None:
    """An entry is about another interval: wider, narrower, the next one."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    entry = list(case.document["motions"][place[0]][place[1]])
    level, number = entry[4:6]
    others = [(max(0, level - 1), number // 2), (0, 0), (level + 1, 2 * number), (level, (number + 1) % 2**level)]
    entry[4:6] = _pick(rng, others)
    if entry[4:6] == [level, number]:
        return None
    document = _with_entry(case, place, entry)
    wrong = case.judge.wrong_plane(document, place[0], entry)
    return _given(case, document) if wrong else _if_incomplete(case, document, place[0], entry, rng)


def other_part(case: Case, rng: np.random.Generator) -> Forgery | None:
    """An entry is about other parts of the same bodies."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    entry = list(case.document["motions"][place[0]][place[1]])
    column = int(_pick(rng, (1, 3)))
    nodes = 1 + 2 * len(case.document["bodies"][entry[column - 1]].get("cuts", []))
    if nodes == 1:
        return None
    entry[column] = int(rng.integers(nodes))
    if entry[column] == case.document["motions"][place[0]][place[1]][column]:
        return None
    document = _with_entry(case, place, entry)
    if len(case.judge.trees(document)[entry[column - 1]].members[entry[column]]) == 0:
        return None
    wrong = case.judge.wrong_plane(document, place[0], entry)
    return _given(case, document) if wrong else _if_incomplete(case, document, place[0], entry, rng)


def no_such_part(case: Case, rng: np.random.Generator) -> Forgery | None:
    """An entry names a part, body, level or interval that does not exist."""
    place = _entry(case, rng)
    if place is None:
        return None
    entry = list(case.document["motions"][place[0]][place[1]])
    k = int(rng.integers(min(6, len(entry))))
    last = len(entry[:6]) - 1
    entry[k] = 2 ** entry[last - 1] if k == last else 31 if k == last - 1 else 10**6
    return _given(case, _with_entry(case, place, entry))


def swapped_bodies(case: Case, rng: np.random.Generator) -> Forgery | None:
    """An entry has its bodies the other way round."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    entry = case.document["motions"][place[0]][place[1]]
    return _given(case, _with_entry(case, place, [entry[2], entry[3], entry[0], entry[1], *entry[4:]]))


def other_count(case: Case, rng: np.random.Generator) -> Forgery:
    """A motion is missing, or there twice."""
    document = deepcopy(case.document)
    if rng.integers(2):
        document["motions"].pop(int(rng.integers(len(document["motions"]))))
    else:
        document["motions"].append(_pick(rng, document["motions"]))
    return _given(case, document)


def other_cut(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A cut divides what is divided, or names a part or an axis that does not exist."""
    document = deepcopy(case.document)
    cuts = [body["cuts"] for body in document["bodies"] if len(body.get("cuts", [])) > 1]
    if not cuts:
        return None
    own = _pick(rng, cuts)
    k = int(rng.integers(1, len(own)))
    own[k] = _pick(rng, ([own[0][0], *own[k][1:]], [2 * k + 1, *own[k][1:]], [own[k][0], 3, own[k][2]], [-1, 0, 0.0]))
    return _given(case, document)


# --- pairs, clearance, margins ---


def left_out_pair(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A pair that has to be compared is declared as one that may touch; its entries are gone."""
    place = _entry(case, rng, 9)
    if place is None:
        return None
    document = deepcopy(case.document)
    entry = document["motions"][place[0]][place[1]]
    i, j = sorted((entry[0], entry[2]))
    reasons = ("adjacent", "allowed by the robot", "allowed by the scene", "always touching")
    document["unchecked"] = sorted([*document["unchecked"], [i, j, _pick(rng, reasons)]])
    document["motions"] = [
        [row for row in rows if sorted((row[0], row[2 if len(row) > 4 else 1])) != [i, j]]
        for rows in document["motions"]
    ]
    return _given(case, document)


def raised_clearance(case: Case, rng: np.random.Generator) -> Forgery | None:
    """More is said to be kept than coal finds along the path."""
    clearance = case.document["clearance"] + float(rng.uniform(0.05, 0.4))
    grown = tuple(replace(each, margin=each.margin + clearance) for each in case.world.scene.obstacles)
    grown_world = case.world.unheld.with_scene(replace(case.world.scene, obstacles=grown))
    if not Judge(grown_world, case.route, obstacles_alone=True).touches(case.route):
        return None
    return _given(case, {**case.document, "clearance": clearance})


def lowered_clearance(case: Case, rng: np.random.Generator) -> Forgery:
    """Less is kept than is asked for."""
    asked = case.document["clearance"]
    return _given(case, {**case.document, "clearance": 0.5 * asked}, clearance=asked)


def other_self_margin(case: Case, rng: np.random.Generator) -> Forgery:
    """Links keep another distance from each other than is asked for."""
    return _given(case, {**case.document, "self_margin": case.document["self_margin"] + SLIGHT})


def other_margin(case: Case, rng: np.random.Generator) -> Forgery:
    """A margin, padding or contact of a body is another one."""
    document = deepcopy(case.document)
    body = _pick(rng, document["bodies"])
    key = _pick(rng, ("margin", "padding", "contacts"))
    body[key] = [[_pick(rng, document["bodies"])["name"], -0.01]] if key == "contacts" else body[key] + SLIGHT
    return _given(case, document)


# --- other robots and scenes ---


def other_joint(case: Case, rng: np.random.Generator) -> Forgery:
    """A joint of the certificate's robot has another frame, axis, parent, gain or name."""
    document = deepcopy(case.document)
    joint = _pick(rng, document["joints"])
    key = _pick(rng, ("pose", "axis", "gain", "offset", "name", "slides"))
    if key in ("pose", "gain"):
        joint[key][int(rng.integers(len(joint[key])))] += SLIGHT
    elif key == "axis":
        joint[key] = [-value for value in joint[key]]
    else:
        joint[key] = {"offset": SLIGHT, "name": "another", "slides": not joint["slides"]}[key]
    return _given(case, document)


def other_body(case: Case, rng: np.random.Generator) -> Forgery:
    """A body of the certificate has another name, kind, pose, joint or shape."""
    document = deepcopy(case.document)
    body = _pick(rng, document["bodies"])
    key = _pick(rng, ("name", "kind", "pose", "joint", "number", "shape"))
    if key == "pose":
        body[key][int(rng.integers(12))] += SLIGHT
    elif key == "shape":
        name = next(name for name in ("extents", *body["shape"]) if name in body["shape"])
        value = body["shape"][name]
        body["shape"][name] = [value[0] + 1e-3, *value[1:]] if isinstance(value, list) else value + 1e-3
    else:
        others = {"name": "another", "kind": "attached", "joint": (body["joint"] + 1) % (1 + len(document["joints"]))}
        body[key] = {**others, "number": body["number"] + 1}[key]
    return _given(case, document)


def moved_base(case: Case, rng: np.random.Generator) -> Forgery:
    """The certificate is of a robot that stands far away from everything, and says so in its `base`."""
    document = deepcopy(case.document)
    document["base"] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, float(rng.uniform(20.0, 90.0))]
    rooted = [joint for joint in document["joints"] if joint["parent"] == 0]
    still = [body for body in document["bodies"] if body["joint"] == 0 and body["kind"] != "obstacle"]
    for each in rooted + still:
        each["pose"][11] += document["base"][11]
    among = range(len(document["bodies"]))
    links = {k for k in among if document["bodies"][k]["kind"] == "link"}
    document["motions"] = [
        [row for row in rows if {row[0], row[2 if len(row) > 4 else 1]} <= links] for rows in document["motions"]
    ]
    return _given(case, document)


def missing_body(case: Case, rng: np.random.Generator) -> Forgery:
    """A body of the certificate is missing, or there twice."""
    document = deepcopy(case.document)
    if rng.integers(2):
        document["bodies"].pop()
    else:
        document["bodies"].append(deepcopy(_pick(rng, document["bodies"])))
    return _given(case, document)


def _in_scene(case: Case, obstacles: tuple[Obstacle, ...]) -> World:
    return case.world.with_scene(replace(case.world.scene, obstacles=obstacles))


def moved_obstacle(case: Case, rng: np.random.Generator) -> Forgery | None:
    """An obstacle of the asker stands elsewhere, by a hundredth of a millimetre or more."""
    obstacles = list(case.world.scene.obstacles)
    k = int(rng.integers(len(obstacles)))
    if isinstance(obstacles[k].motion, TimedPoses):
        return None  # its poses are those of its motion
    pose = obstacles[k].pose.copy()
    pose.translation = pose.translation + np.array([SLIGHT, -SLIGHT, SLIGHT]) * 10 ** rng.uniform(0.0, 4.0)
    obstacles[k] = replace(obstacles[k], pose=pose)
    return _given(case, case.document, world=_in_scene(case, tuple(obstacles)))


def other_obstacles(case: Case, rng: np.random.Generator) -> Forgery:
    """An obstacle of the asker is missing, new, renamed, or has another margin."""
    obstacles = list(case.world.scene.obstacles)
    k = int(rng.integers(len(obstacles)))
    new = replace(obstacles[k], name="another")
    way = int(rng.integers(4))
    if way == 0:
        obstacles.pop(k)
    elif way == 1:
        obstacles.insert(k, new)
    else:
        obstacles[k] = new if way == 2 else replace(obstacles[k], margin=obstacles[k].margin + SLIGHT)
    return _given(case, case.document, world=_in_scene(case, tuple(obstacles)))


def honest_model(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A box stands in the way, and the certificate's model says so; the entries are those of the free path."""
    k = int(rng.integers(len(case.waypoints)))
    tip = case.world.robot.fk_batch(case.waypoints[k][None])[0][:3, 3]
    obstacles = list(case.world.scene.obstacles)
    solid = int(rng.integers(len(obstacles)))
    pose = obstacles[solid].pose.copy()
    pose.translation = tip
    obstacles[solid] = replace(obstacles[solid], shape=Box([0.1, 0.1, 0.1]), pose=pose)
    world = _in_scene(case, tuple(obstacles))
    if not Judge(world, case.route).touches(case.route):
        return None
    still = np.array([row for row in case.waypoints if world.valid(row)][:1])
    model = certificate_for(world.unheld, still, 0.0) if len(still) and not case.route.moving else None
    if model is None:
        return None
    bodies = json.loads(json.dumps(model.document()))["bodies"]
    document = deepcopy(case.document)
    # Cuts are kept where they are of the same shape.
    cuts = {(old["name"], old["number"], json.dumps(old["shape"])): old for old in document["bodies"]}
    document["bodies"] = [cuts.get((new["name"], new["number"], json.dumps(new["shape"])), new) for new in bodies]
    for new, body in zip(bodies, document["bodies"], strict=True):
        body["pose"] = new["pose"]
    return _given(case, document, world=world)


def other_hold(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A thing in the hand of the asker is held otherwise, missing, renamed, or another one."""
    held = list(case.world.scene.attached)
    if not held:
        return None
    k = int(rng.integers(len(held)))
    way = int(rng.integers(4))
    if way == 0:
        held.pop(k)
    elif way == 1:
        held[k] = replace(held[k], name="another")
    elif way == 2:
        held[k] = replace(held[k], margin=held[k].margin + SLIGHT)
    else:
        pose = held[k].pose.copy()
        pose.translation = pose.translation + np.array([SLIGHT, -SLIGHT, SLIGHT]) * 10 ** rng.uniform(0.0, 2.0)
        held[k] = replace(held[k], pose=pose)
    return _given(case, case.document, world=case.world.with_scene(replace(case.world.scene, attached=tuple(held))))


# --- path constraints ---


def other_constraint(case: Case, rng: np.random.Generator) -> Forgery:
    """A path constraint has other numbers than the asker's, is missing or is there twice."""
    document = deepcopy(case.document)
    listed = document.setdefault("constraints", [])
    if not listed:
        listed.append(_loose_constraint(document))
        return _given(case, document)
    each = _pick(rng, listed)
    key = _pick(rng, ("frame", "joint", "pose", "within", "region", "bounds", "tolerances", "missing", "twice"))
    if key == "missing":
        listed.remove(each)
    elif key == "twice":
        listed.append(each)
    elif key == "frame":
        each[key] = "another"
    elif key == "joint":
        each[key] = (each[key] + 1) % (1 + len(document["joints"]))
    elif key == "bounds":
        _pick(rng, each[key])[int(rng.integers(2))] += float(_pick(rng, (-SLIGHT, SLIGHT)))
    else:
        each[key][int(rng.integers(len(each[key])))] += SLIGHT
    return _given(case, document)


def _loose_constraint(document: Document) -> dict[str, Any]:
    """Return a constraint of the base that every motion keeps, and that nobody has asked for."""
    still = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    bounds = [[-1.0, 1.0]] * 3 + [[-np.pi, np.pi]] * 3
    poses = {"pose": still, "within": still, "region": still}
    return {"frame": document["bodies"][0]["name"], "joint": 0, **poses, "bounds": bounds, "tolerances": [0.01, 0.01]}


def left_region(case: Case, rng: np.random.Generator) -> Forgery | None:
    """Asker and certificate have a path constraint with a tolerance that the motion exceeds."""
    regions = list(case.world.settings.constraints)
    if not regions:
        return None
    k = int(rng.integers(len(regions)))
    largest = outside(regions[k], frame_poses(case.world, regions[k].frame, case.route))
    bounded = [np.abs(regions[k].bounds[:3]).min() < 1000.0, True]
    places = [j for j in (0, 1) if bounded[j] and largest[j] > LEAST_EXCESS]
    if not places:
        return None
    j = int(_pick(rng, places))
    tolerance = float(largest[j] * rng.uniform(0.3, 0.95))
    if j == 0:
        regions[k] = replace(regions[k], position_tolerance=tolerance, position_allowance=0.0)
    else:
        regions[k] = replace(regions[k], orientation_tolerance=tolerance, orientation_allowance=0.0)
    document = deepcopy(case.document)
    document["constraints"][k]["tolerances"][j] = tolerance
    world = World.of(replace(case.world.settings, constraints=tuple(regions)))
    return _given(case, document, world=world)


def frame_poses(world: World, frame: str | None, route: Route) -> list[pin.SE3]:
    """Return poses of a link or a thing in the hand at many places of a motion."""
    held = next((each for each in world.scene.attached if each.name == frame), None)
    link = frame if held is None else held.link
    count = max(1, len(route.waypoints) - 1)
    rows = np.concatenate([between(route, m, np.linspace(0.0, 1.0, PLACES)) for m in range(count)])
    poses = map(pin.SE3, world.robot.fk_batch(rows, link))
    return [pose if held is None else pose * held.pose for pose in poses]


# --- motions in time ---


def untimed(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A timed motion is certified, and the path through its waypoints asked about; or the other way round."""
    if case.route.times is None:
        rows = case.waypoints
        times = np.arange(float(len(rows)))
        return _given(case, case.document, route=Route(rows, times, np.diff(rows, axis=0)[:, None]))
    if rng.integers(2):
        return _given(case, case.document, route=Route(case.waypoints))
    return _given(case, {key: case.document[key] for key in case.document if key not in ("times", "rates", "tracks")})


def other_times(case: Case, rng: np.random.Generator) -> Forgery | None:
    """Times differ from those of the motion, do not ascend, or are too few."""
    if case.route.times is None:
        return None
    document = deepcopy(case.document)
    k = int(rng.integers(1, len(document["times"])))
    way = int(rng.integers(3))
    if way == 0:
        document["times"][k] += 1e-9
    elif way == 1:
        document["times"][k] = document["times"][k - 1]
    else:
        document["times"].pop(k)
    return _given(case, document)


def other_rates(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A derivative differs from that of the motion, or is missing."""
    if case.route.rates is None:
        return None
    document = deepcopy(case.document)
    row = _pick(rng, document["rates"])
    if rng.integers(4) == 0:
        row.append([_pick(rng, (0.0, 1e308))] * len(row[0]))
    else:
        _pick(rng, row)[int(rng.integers(len(row[0])))] += 1e-3
    return _given(case, document)


def bulging_motion(case: Case, rng: np.random.Generator) -> Forgery | None:
    """Motion and certificate go aside between two waypoints, and touch something there; the rest is kept."""
    if case.route.rates is None or case.route.times is None:
        return None
    for _ in range(3):
        m = int(rng.integers(len(case.route.rates)))
        h = case.route.times[m + 1] - case.route.times[m]
        rates = np.zeros((len(case.route.rates), 5, case.waypoints.shape[1]))
        rates[:, : case.route.rates.shape[1]] = case.route.rates
        # s^2 (1 - s)^2, which begins and ends with 0
        size = 16.0 * rng.normal(size=rates.shape[2])
        rates[m, 1:4] += np.outer([2.0 / h**2, -12.0 / h**3, 24.0 / h**4], size)
        route = replace(case.route, rates=rates)
        if case.judge.touches(route):
            return _given(case, {**case.document, "rates": rates.tolist()}, route=route)
    return None


def other_track(case: Case, rng: np.random.Generator) -> Forgery | None:
    """An obstacle of the certificate moves otherwise, not at all, or takes another one's way."""
    if not case.route.moving:
        return None
    document = deepcopy(case.document)
    way = int(rng.integers(4))
    carried = [body for body in document["bodies"] if body["joint"] > len(document["joints"])]
    if way == 0:
        _pick(rng, _pick(rng, document["tracks"]))[int(rng.integers(12))] += SLIGHT
    elif way == 1:
        document["tracks"].append(document["tracks"][0])
    elif way == 2:
        _pick(rng, carried)["joint"] = 0
    else:
        body = _pick(rng, document["bodies"])
        body["joint"] = len(document["joints"]) + 1 + int(rng.integers(len(document["tracks"])))
        if body in carried and len(document["tracks"]) == 1:
            body["joint"] += 1
    return None if document == case.document else _given(case, document)


def other_motion(case: Case, rng: np.random.Generator) -> Forgery | None:
    """An obstacle of the asker moves otherwise than that of the certificate."""
    if not case.route.moving:
        return None
    obstacles = list(case.world.scene.obstacles)
    k = int(_pick(rng, [k for k, each in enumerate(obstacles) if each.motion is not None]))
    velocity = np.asarray(rng.normal(size=3)) * 10 ** rng.uniform(-6.0, 0.0)
    obstacles[k] = replace(obstacles[k], motion=_pick(rng, (None, ConstantVelocity(velocity))))
    return _given(case, case.document, world=_in_scene(case, tuple(obstacles)))


# --- malformed files ---


def odd_value(case: Case, rng: np.random.Generator) -> Forgery | None:
    """A number is of another type, negative, too large, or a list."""
    document = deepcopy(case.document)
    place = _entry(case, rng)
    holders: list[tuple[Any, Any]] = [
        (document, "clearance"), (document, "version"), (document, "waypoints"),
        (document["waypoints"][0], 0), (_pick(rng, document["bodies"]), "joint"),
        (_pick(rng, document["joints"]), "parent"), (_pick(rng, document["joints"])["pose"], 0),
        (_pick(rng, document["bodies"])["pose"], 3),
    ]  # fmt: skip
    holders += [(document["times"], 0), (document["rates"][0][0], 0)] if "times" in document else []
    holders += [(document["tracks"][0][0], 3)] if "tracks" in document else []
    if "constraints" in document:
        each = _pick(rng, document["constraints"])
        holders += [
            (each, "joint"),
            (each["region"], 3),
            (each["bounds"], 4),
            (each["tolerances"], 1),
            (each, "within"),
        ]
    if place is not None:
        holders += [(document["motions"][place[0]][place[1]], k) for k in (0, 3)]
    holder, key = _pick(rng, holders)
    old = holder[key]
    holder[key] = _pick(rng, ODD_VALUES)
    return None if holder[key] == old else _given(case, document)


def raw_value(case: Case, rng: np.random.Generator) -> Forgery:
    """The text of a number is none of JSON's, or too large for a double."""
    text = json.dumps({**case.document, "clearance": "HERE"})
    if rng.integers(2):
        document = deepcopy(case.document)
        document["waypoints"][0][0] = "HERE"
        text = json.dumps(document)
    return _given(case, {}, text=text.replace('"HERE"', _pick(rng, RAW_VALUES)))


def twice(case: Case, rng: np.random.Generator) -> Forgery:
    """A key stands there twice, with two values."""
    text = json.dumps(case.document)
    key = _pick(rng, ("clearance", "waypoints", "motions", "unchecked", "bodies"))
    other: Any = 9.0 if key == "clearance" else []
    return _given(case, {}, text=f'{{"{key}": {json.dumps(other)}, {text[1:]}')


def other_field(case: Case, rng: np.random.Generator) -> Forgery:
    """A field is missing, unknown, or of another kind or version of file."""
    document = deepcopy(case.document)
    way = int(rng.integers(4))
    if way == 0:
        document.pop(_pick(rng, [key for key in document if key not in ("held", "base")]))
    elif way == 1:
        document["trust"] = True
    elif way == 2:
        document["version"] = int(_pick(rng, (0, 1, 3)))
    elif "times" in document:
        document.pop(_pick(rng, ("times", "rates")))
    else:
        document["times"] = list(range(len(document["waypoints"])))
    return _given(case, document)


def cut_off(case: Case, rng: np.random.Generator) -> Forgery:
    """The file ends too early, or goes on after its end."""
    text = json.dumps(case.document)
    return _given(case, {}, text=text[: int(rng.integers(len(text)))] if rng.integers(2) else text + "]")


FORGERS: dict[str, Forger] = {
    forger.__name__.replace("_", " "): forger
    for forger in (
        moved_waypoint, moved_path, reordered_waypoints, other_columns, colliding_path, outside_limits,
        turned_plane, tilted_plane, short_normal, other_plane_of_a_half_space,
        dropped_entry, dropped_pair, dropped_motion, other_interval,
        other_part, no_such_part, swapped_bodies, other_count, other_cut,
        left_out_pair, raised_clearance, lowered_clearance, other_self_margin, other_margin,
        other_joint, other_body, moved_base, missing_body, moved_obstacle, other_obstacles, honest_model,
        other_hold, other_constraint, left_region,
        untimed, other_times, other_rates, bulging_motion, other_track, other_motion,
        odd_value, raw_value, twice, other_field, cut_off,
    )
}  # fmt: skip

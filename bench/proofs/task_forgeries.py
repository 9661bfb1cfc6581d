"""Forges certificates of tasks: each function changes plain data so that they prove the task no longer."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np

Document = dict[str, Any]
TaskForger = Callable[[Document, np.random.Generator], "Document | None"]
SLIGHT = 1e-5  # [rad] or [m]


def _pick(rng: np.random.Generator, items: Any) -> Any:
    return items[int(rng.integers(len(items)))]


def dropped_part(document: Document, rng: np.random.Generator) -> Document:
    """A part is missing."""
    document["parts"].pop(int(rng.integers(len(document["parts"]))))
    return document


def doubled_part(document: Document, rng: np.random.Generator) -> Document:
    """A part is there twice."""
    k = int(rng.integers(len(document["parts"])))
    document["parts"].insert(k, deepcopy(document["parts"][k]))
    return document


def swapped_parts(document: Document, rng: np.random.Generator) -> Document:
    """Two parts have changed places."""
    parts = document["parts"]
    k = int(rng.integers(len(parts) - 1))
    parts[k], parts[k + 1] = parts[k + 1], parts[k]
    return document


def jumping_arm(document: Document, rng: np.random.Generator) -> Document:
    """The arm is elsewhere at the end of a part than at the beginning of the next one."""
    row = _pick(rng, document["parts"])["waypoints"][int(_pick(rng, (0, -1)))]
    row[int(rng.integers(len(row)))] += SLIGHT
    return document


def jumping_thing(document: Document, rng: np.random.Generator) -> Document:
    """An obstacle or a held object is elsewhere than it was."""
    things = [body for body in _pick(rng, document["parts"])["bodies"] if body["kind"] != "link"]
    _pick(rng, things)["pose"][int(_pick(rng, (3, 7, 11)))] += SLIGHT
    return document


def vanished_thing(document: Document, rng: np.random.Generator) -> Document:
    """An obstacle or a held object is missing in a part."""
    bodies = _pick(rng, document["parts"])["bodies"]
    bodies.remove(_pick(rng, [body for body in bodies if body["kind"] != "link"]))
    return document


def other_hold(document: Document, rng: np.random.Generator) -> Document | None:
    """What is held is an obstacle, or the other way round."""
    bodies = [body for part in document["parts"] for body in part["bodies"] if body["kind"] != "link"]
    body = _pick(rng, bodies)
    body["kind"] = "obstacle" if body["kind"] == "attached" else "attached"
    return document


def deeper_contact(document: Document, rng: np.random.Generator) -> Document:
    """Two things may overlap by more than they may, or at all."""
    bodies = [body for body in _pick(rng, document["parts"])["bodies"] if body["kind"] != "link"]
    one, other = _pick(rng, bodies), _pick(rng, bodies)
    one["contacts"] = [*one["contacts"], [other["name"], -0.02]]
    return document


def longer_contact(document: Document, rng: np.random.Generator) -> Document | None:
    """A contact that has ended in a part goes on."""
    for one, other in zip(document["parts"], document["parts"][1:], strict=False):
        ended = [k for k, body in enumerate(one["bodies"]) if body["contacts"] and k < len(other["bodies"])]
        if ended and [body["name"] for body in one["bodies"]] == [body["name"] for body in other["bodies"]]:
            for k in ended:
                other["bodies"][k]["contacts"] = one["bodies"][k]["contacts"]
            return document
    return None


def empty_part(document: Document, rng: np.random.Generator) -> Document | None:
    """The entries of a part that has planes are gone."""
    full = [part for part in document["parts"] if any(len(row) == 9 for rows in part["motions"] for row in rows)]
    if not full:
        return None
    part = max(full, key=lambda each: sum(map(len, each["motions"])))
    part["motions"] = [[] for _ in part["motions"]]
    return document


def other_head(document: Document, rng: np.random.Generator) -> Document:
    """The file is of another kind or version, or has no parts or an unknown field."""
    changes = {"kind": "path_certificate", "version": 3, "parts": [], "trust": True}
    key = _pick(rng, list(changes))
    return {**document, key: changes[key]}


TASK_FORGERS: dict[str, TaskForger] = {
    f"task: {forger.__name__.replace('_', ' ')}": forger
    for forger in (
        dropped_part, doubled_part, swapped_parts, jumping_arm, jumping_thing, vanished_thing, other_hold,
        deeper_contact, longer_contact, empty_part, other_head,
    )
}  # fmt: skip

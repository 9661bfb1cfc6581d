"""Geoms of MJCF as solids."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.errors import InputError, MissingFileError, UnknownNameError
from rrtik_ompl.base.poses import turned_z
from rrtik_ompl.description.mjcf.values import MAIN, Settings
from rrtik_ompl.description.package_path import MESH_SUFFIXES
from rrtik_ompl.description.tree import MeshFile, Solid
from rrtik_ompl.description.urdf_read import attribute, numbers
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, Shape, Sphere

OF_THE_SCENE = ("plane", "hfield")
KINDS = ("box", "capsule", "cylinder", "mesh", "sphere")
_COUNTS = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}  # numbers of size


def masks(geom: Element, where: str) -> tuple[int, int]:
    """``contype`` and ``conaffinity``, by which geoms may collide."""
    kind, affinity = (int(numbers(geom, key, 1, (1.0,), where)[0]) for key in ("contype", "conaffinity"))
    return kind, affinity


def solid_of(geom: Element, settings: Settings, meshes: Mapping[str, tuple[MeshFile, Any]], where: str) -> Solid:
    """The solid of a geom that is no plane and no height field.

    Raises:
        InputError: If it is of a kind that cannot be read, or its numbers make no sense.
    """
    kind = geom.get("type", "sphere")
    colour = numbers(geom, "rgba", 4, None, where) if geom.get("rgba") is not None else None
    rgba = None if colour is None else (colour[0], colour[1], colour[2], colour[3])
    if kind not in KINDS:
        raise UnknownNameError("usable type of geom", kind, KINDS, where=where)
    place = settings.placement(geom, where)

    if kind == "mesh":
        name = attribute(geom, "geom", "mesh", where)
        if name not in meshes:
            raise UnknownNameError("mesh", name, meshes, where=where)
        mesh, T_mesh = meshes[name]
        return Solid(mesh, place * T_mesh, rgba)

    if geom.get("mesh") is not None:
        raise InputError(f"{where}: a {kind} fitted to a mesh cannot be read; save the compiled model and load that")

    length = None
    if geom.get("fromto") is not None and kind in ("capsule", "cylinder", "box"):
        ends = np.array(numbers(geom, "fromto", 6, None, where)).reshape(2, 3)
        direction = ends[1] - ends[0]
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise InputError(f"{where}: <geom fromto> is from a point to itself; give two points")
        place = pin.SE3(turned_z(direction / length), ends.mean(axis=0))
    return Solid(_shape(kind, geom, length, where), place, rgba)


def _shape(kind: str, geom: Element, length: float | None, where: str) -> Shape:
    # `fromto` gives the length in the place of a size; a box between two points has one width for both other axes.
    count = _COUNTS[kind] - (length is not None) - (length is not None and kind == "box")
    written = (geom.get("size") or "").split()
    size = numbers(Element("geom", {"size": " ".join(written[:count])}), "size", count, None, where)  # more are unused

    if kind == "sphere":
        return Sphere(size[0])
    if kind == "box":
        return Box([2.0 * size[0], 2.0 * size[0], length] if length is not None else 2.0 * np.array(size))
    full_length = 2.0 * size[1] if length is None else length
    return Capsule(size[0], full_length) if kind == "capsule" else Cylinder(size[0], full_length)


def meshes_of(root: Element, settings: Settings, folder: Path, where: str) -> dict[str, tuple[MeshFile, Any]]:
    """Meshes of ``<asset>`` by name, and the pose of each in its geom.

    Raises:
        InputError: If one cannot be read; a file is looked for only if a geom may use it.
    """
    meshes = {}
    for element in root.findall("asset/mesh"):
        mesh = settings.filled(element, MAIN, where)
        if mesh.get("file") is None:
            raise InputError(f"{where}: mesh '{mesh.get('name', '')}' has no file; save it as STL or OBJ and name that")

        path = folder / settings.meshes / attribute(mesh, "mesh", "file", where)
        x, y, z = numbers(mesh, "scale", 3, (1.0, 1.0, 1.0), where)
        if x * y * z == 0.0:
            raise InputError(f"{where}: mesh {path.name} has a scale of 0; every axis needs another number")
        if path.suffix.lower() not in MESH_SUFFIXES:
            raise InputError(f"{where}: mesh {path.name} is of no kind that can be read; export it as STL or OBJ")
        if not os.path.isfile(path):
            raise MissingFileError(f"{where}: mesh file '{path}' does not exist; check meshdir and the name")

        reference = Element("mesh", {"pos": mesh.get("refpos", "0 0 0"), "quat": mesh.get("refquat", "1 0 0 0")})
        mesh_in_geom = settings.placement(reference, where).inverse()
        meshes[mesh.get("name") or path.stem] = MeshFile(path.resolve(), (x, y, z)), mesh_in_geom
    return meshes

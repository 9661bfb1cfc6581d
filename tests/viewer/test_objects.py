"""What a page is told of solids and nodes: the same as meshcat itself would tell it."""

from __future__ import annotations

from typing import Any

import meshcat
import meshcat.geometry as mg
import numpy as np
import pytest
import umsgpack

from rrtik_ompl.viewer.drawing.nodes import (
    GRAIN,
    BoxGeometry,
    CylinderGeometry,
    Material,
    Recording,
    SphereGeometry,
    TriangleGeometry,
)

RNG = np.random.default_rng(1)
CORNERS, FACES = np.round(RNG.normal(size=(5, 3)) / GRAIN) * GRAIN, np.array([[0, 1, 2], [2, 3, 4]])
GEOMETRIES = {
    "sphere": (SphereGeometry(0.3), mg.Sphere(0.3)),
    "cylinder": (CylinderGeometry(0.5, 0.2, 0.2), mg.Cylinder(0.5, 0.2)),
    "cone": (CylinderGeometry(0.5, 0.0, 0.2), mg.Cylinder(0.5, radiusTop=0.0, radiusBottom=0.2)),
    "box": (BoxGeometry((0.1, 0.2, 0.3)), mg.Box([0.1, 0.2, 0.3])),
    "triangles": (TriangleGeometry(CORNERS, FACES), mg.TriangularMeshGeometry(CORNERS, FACES)),
}
MATERIALS = {
    "plain": (Material(0x112233), mg.MeshPhongMaterial(color=0x112233)),
    "shiny": (Material(0x445566, shininess=40), mg.MeshPhongMaterial(color=0x445566, shininess=40)),
    "glass": (
        Material(0x778899, opacity=0.2, shininess=10, hides=False),
        mg.MeshPhongMaterial(color=0x778899, opacity=0.2, shininess=10, depthWrite=False),
    ),
}


class Window:
    """Keeps what meshcat sends."""

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send(self, command: Any) -> None:
        self.sent.append(umsgpack.unpackb(umsgpack.packb(command.lower())))


def drawn_by_both(geometry, material, matrix):
    own, window = Recording(), Window()
    own.root["robot"]["link 1"].set_object(geometry[0], material[0])
    own.root["robot"].set_transform(matrix)
    visualizer = meshcat.Visualizer(window=window)
    for part, name in ((geometry[1], "geometry"), (material[1], "material")):
        part.uuid = f"/meshcat/robot/link 1/{name}"
    solid = mg.Mesh(geometry[1], material[1])
    solid.uuid = "/meshcat/robot/link 1/object"
    visualizer["robot"]["link 1"].set_object(solid)
    visualizer["robot"].set_transform(matrix)
    return [umsgpack.unpackb(command) for command in own.commands], window.sent


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
@pytest.mark.parametrize("geometry", GEOMETRIES.values(), ids=GEOMETRIES)
def test_commands_say_what_those_of_meshcat_say(geometry, material):
    own, theirs = drawn_by_both(geometry, material, RNG.normal(size=(4, 4)))
    assert own == theirs


def test_a_place_has_one_object_and_one_pose():
    recording = Recording()
    node = recording.root["a"]
    for radius in (1.0, 2.0):
        node.set_object(SphereGeometry(radius), Material(0))
        node.set_transform(radius * np.eye(4))
    solid, pose = map(umsgpack.unpackb, recording.commands)
    assert solid["object"]["geometries"][0]["radius"] == 2.0
    assert pose["matrix"] == (2.0 * np.eye(4)).ravel().tolist()
    assert recording.paths == ("/meshcat/a",)

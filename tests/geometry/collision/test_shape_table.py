"""What a shape says of itself agrees with how it is checked, drawn and written; a new one needs two places."""

import re
import subprocess
import sys
import textwrap
from dataclasses import fields
from pathlib import Path

import coal
import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.shape_table import core_of, pieces, shape_of, sizes_of
from rrtik_ompl.geometry.collision.solids import mesh_arrays
from rrtik_ompl.kernels.covers.spheres import outer_cover, protrusion_bound
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import (
    SHAPES,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    Octree,
    PointCloud,
    Prism,
    Sphere,
    same_shape,
)
from rrtik_ompl.pilot.overlay.rasterizer import surface_of_shape
from rrtik_ompl.problem_files.scene import load_scene
from rrtik_ompl.viewer.drawing.meshes import look_of_margin, look_of_shape

ROOT = Path(__file__).resolve().parents[3]
L_SHAPE = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]]
TETRAHEDRON = Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
PRIMITIVES = [Box([0.2, 0.3, 0.4]), Sphere(0.2), Cylinder(0.2, 0.5), Capsule(0.1, 0.5)]
CLOUD = PointCloud([[0.25, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 1.0]], 0.125)
PILES = [HeightField([[0.1, 0.1, 0.4], [0.1, 0.1, 0.2]], 0.5), Octree([[0.0, 0.0, 0.5], [1.0, 0.0, 0.0]], [0.5, 0.25])]
BOUNDED = [*PRIMITIVES, Prism(L_SHAPE, 0.5), TETRAHEDRON, CLOUD, *PILES]
FLOOR = HalfSpace([0.0, 0.0, 1.0], -0.1)
kinds = pytest.mark.parametrize("shape", BOUNDED, ids=lambda shape: type(shape).__name__)
primitives = pytest.mark.parametrize("shape", PRIMITIVES, ids=lambda shape: type(shape).__name__)


def test_every_kind_is_registered_and_tried_here():
    assert set(SHAPES.values()) == {type(shape) for shape in (*BOUNDED, FLOOR)}
    assert all(key == kind.key for key, kind in SHAPES.items())


@pytest.mark.parametrize("kind", SHAPES.values(), ids=lambda kind: kind.__name__)
def test_measures_are_attributes(kind):
    names = {field.name for field in fields(kind)}
    assert {measure.name for measure in kind.measures} <= names
    assert set(kind.moveit) in (set(), {measure.name for measure in kind.measures})


@kinds
def test_the_surface_lies_within_the_bounding_radius_and_reaches_it(shape):
    vertices, faces = shape.surface()
    farthest = np.linalg.norm(vertices[np.unique(faces)], axis=1).max()
    assert farthest == pytest.approx(shape.bounding_radius, rel=1e-9)


@kinds
def test_coal_checks_what_is_drawn(shape):
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for piece in pieces(shape):
        low = np.minimum(low, piece.placement.translation + piece.geometry.aabb_local.min_)
        high = np.maximum(high, piece.placement.translation + piece.geometry.aabb_local.max_)
    vertices, _ = shape.surface()
    assert np.allclose([vertices.min(axis=0), vertices.max(axis=0)], [low, high], atol=0.01)


@primitives
def test_a_primitive_comes_back_from_coal(shape):
    geometry = pieces(shape)[0].geometry
    assert same_shape(shape_of(geometry), shape)
    assert len(sizes_of(geometry)) == sum(np.size(getattr(shape, measure.name)) for measure in shape.measures)


@primitives
def test_the_surface_is_within_radius_and_disc_of_the_core(shape):
    core = core_of(pieces(shape)[0].geometry)
    reach = core.corners.max(axis=0) + core.radius + np.array([1.0, 1.0, 0.0]) * (core.disc or 0.0)
    assert np.allclose(shape.surface().vertices.max(axis=0), reach, atol=1e-9)


@primitives
def test_shapes_of_the_same_measures_share_their_geometry(shape):
    measured = {measure.name: getattr(shape, measure.name) for measure in type(shape).measures}
    assert pieces(type(shape)(**measured))[0].geometry is pieces(shape)[0].geometry
    other = type(shape)(**{name: 2.0 * value for name, value in measured.items()})
    assert pieces(other)[0].geometry is not pieces(shape)[0].geometry
    assert same_shape(shape_of(pieces(other)[0].geometry), other)


def test_a_core_is_read_only():
    core = core_of(pieces(PRIMITIVES[0])[0].geometry)
    with pytest.raises(ValueError, match="read-only"):
        core.corners[0, 0] = 1.0


def test_a_closed_mesh_and_an_open_one_keep_their_surface():
    hull = pieces(TETRAHEDRON)[0].geometry
    assert core_of(hull) is None
    assert shape_of(hull).closed
    sheet = Mesh(TETRAHEDRON.vertices, TETRAHEDRON.triangles[:3])
    assert len(mesh_arrays(pieces(sheet)[0].geometry)[1]) == 3


@kinds
def test_what_is_within_a_margin_is_larger_all_round(shape):
    grown = shape.grown(0.05)
    if grown is not None:
        vertices = getattr(grown, "vertices", None)
        vertices = grown.surface().vertices if vertices is None else vertices
        low, high = (end(shape.surface().vertices, axis=0) for end in (np.min, np.max))
        assert np.allclose([vertices.min(axis=0), vertices.max(axis=0)], [low - 0.05, high + 0.05], atol=1e-9)
    assert (look_of_margin(shape, 0.05) is None) == (grown is None)


def test_a_half_space_has_no_end():
    assert not FLOOR.bounded
    assert FLOOR.bounding_radius == np.inf
    for draw in (look_of_shape, lambda shape: surface_of_shape(shape, "#ffffff")):
        with pytest.raises(InputError, match="HalfSpace cannot be drawn"):
            draw(FLOOR)


def test_every_kind_with_measures_is_read_as_it_was_written(tmp_path):
    scene = Scene([Obstacle(f"o{k}", s) for k, s in enumerate((*BOUNDED, FLOOR)) if s.measures])
    scene.save(tmp_path / "scene.yaml")
    back = load_scene(tmp_path / "scene.yaml")
    assert all(same_shape(a.shape, b.shape) for a, b in zip(scene.obstacles, back.obstacles, strict=True))


CONE = '''
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import positive
from rrtik_ompl.geometry.collision.shape_table import ShapeRow, add_row
from rrtik_ompl.geometry.collision.solids import hull
from rrtik_ompl.model.shapes import SHAPES, Measure, Shape
from rrtik_ompl.model.shapes.surfaces import Triangles


@dataclass(frozen=True, slots=True)
class Cone(Shape):
    """A cone about z, its tip up, centred between tip and base. ``radius`` of the base and ``length`` in metres."""

    key = "cone"
    measures = (Measure("radius"), Measure("length"))

    radius: float
    length: float

    def __post_init__(self):
        positive(self.radius, "cone radius")
        positive(self.length, "cone length")

    @property
    def bounding_radius(self):
        return float(np.hypot(self.radius, 0.5 * self.length))

    def surface(self):
        turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        half = np.full(24, 0.5 * self.length)
        ring = np.column_stack([self.radius * np.cos(turn), self.radius * np.sin(turn), -half])
        ends = np.array([[0.0, 0.0, half[0]], [0.0, 0.0, -half[0]]])
        k, after = np.arange(24), np.roll(np.arange(24), -1)
        sides, base = np.stack([k, after, np.full(24, 24)], 1), np.stack([after, k, np.full(24, 25)], 1)
        return Triangles(np.concatenate([ring, ends]), np.concatenate([sides, base]))


SHAPES[Cone.key] = Cone
add_row(ShapeRow(Cone, lambda cone: [hull(cone.surface().vertices)]))
'''

TASK = """
version: 1
robot: planar3
scene:
  obstacles:
    - {name: hat, cone: {radius: 0.4, length: 1.0}, pose: {xyz: [2.0, 0.9, 0]}}
start: {joints: [0, 0, 0]}
goal: {joints: [1.5, 0, 0]}
"""

RUN = """
import sys

import numpy as np

import cone
import rrtik_ompl as rrtik
from rrtik_ompl.pilot.overlay.rasterizer import obstacle_surfaces
from rrtik_ompl.viewer.drawing.meshes import look_of_shape

problem = rrtik.load_problem("task.yaml")
hat = problem.world.scene.obstacle("hat")
assert hat.shape == cone.Cone(0.4, 1.0), hat.shape
straight = np.linspace(problem.start, problem.goal.q, 200)
assert not problem.world.valid_batch(straight).all()
found = rrtik.plan(problem, seed=1, seconds=20.0)
assert found.found, found.reason
assert problem.world.valid_batch(found.path.waypoints).all()
problem.save("again.yaml")
assert rrtik.load_problem("again.yaml").world.scene.obstacle("hat").shape == hat.shape
assert look_of_shape(hat.shape).geometry.faces.size == obstacle_surfaces([hat])[0].faces.size == 3 * 48
rrtik.view(problem, found.path, html="page.html")
for text in ("{name: a}", "{name: a, cone: {radius: 1}}", "{name: a, cone: {radius: -1, length: 1}}"):
    with open("bad.yaml", "w") as file:
        file.write("version: 1\\nscene: {obstacles: [%s]}\\n" % text)
    try:
        rrtik.load_scene("bad.yaml")
    except rrtik.InputError as error:
        print(error)
"""


def test_a_shape_of_somebody_else_is_read_checked_planned_around_and_drawn(tmp_path):
    for name, text in (("cone.py", CONE), ("task.yaml", TASK), ("run.py", RUN)):
        (tmp_path / name).write_text(textwrap.dedent(text))
    done = subprocess.run([sys.executable, "run.py"], cwd=tmp_path, capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stderr
    first, second, third = done.stdout.splitlines()[-3:]
    assert (
        "needs exactly one of box, sphere, cylinder, capsule, half_space, polygon, mesh, cloud, heights, octree, cone"
        in first
    )
    assert "cone.length: missing; add this key" in second
    assert "cone.radius: must be 1e-06 or more, found -1" in third
    assert (tmp_path / "page.html").stat().st_size > 10_000


def test_a_solid_that_no_table_knows_is_covered_by_one_ball():
    egg = coal.Ellipsoid(0.1, 0.2, 0.3)
    assert (sizes_of(egg), core_of(egg), shape_of(egg)) == (None, None, None)
    assert len(outer_cover(egg)) == 1
    assert protrusion_bound(egg, outer_cover(egg)) == np.inf


def _says_what_it_is(text, name):
    """Whether a module does more with a shape than to import and to make it."""
    text = re.sub(r"^ *from [^\n]* import (?:\([^)]*\)|[^\n]*)$", "", text, flags=re.M)
    return re.search(rf"\b{name}\b(?!\()|class {name}\(|\bcoal\.{name}\(|\b{name.upper()}", text) is not None


def test_a_shape_with_a_formula_for_the_kernels_touches_six_files():
    library = (ROOT / "rrtik_ompl").rglob("*.py")
    found = {str(p.relative_to(ROOT)) for p in library if _says_what_it_is(p.read_text(), "Capsule")}
    # The first names it for users, the second by the words of MPlib; the third takes what has no formula by triangles.
    others = {"rrtik_ompl/__init__.py", "rrtik_ompl/compat/mplib/fcl.py", "rrtik_ompl/tasks/grasp_points.py"}
    assert found - others == {
        "rrtik_ompl/model/shapes/__init__.py",
        "rrtik_ompl/geometry/collision/shape_table.py",
        "rrtik_ompl/kernels/layout.py",
        "rrtik_ompl/kernels/tables/scene_tables.py",
        "rrtik_ompl/kernels/checks/obstacle_kernels.py",
        "rrtik_ompl/kernels/reference/checks.py",
    }

"""The covers that the package brings are those that this machine would make, and are found without making any."""

import numpy as np
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.files import notice
from rrtik_ompl.files.cache import FOLDER_VARIABLE
from rrtik_ompl.geometry.collision.bodies import link_bodies
from rrtik_ompl.geometry.collision.solids import is_mesh, mesh_arrays
from rrtik_ompl.kernels.covers import cache
from rrtik_ompl.kernels.covers.cache import cached_convex_pieces, cached_inner_spheres, cached_outer_cover
from rrtik_ompl.kernels.covers.mesh_pieces import convex_pieces
from rrtik_ompl.kernels.covers.spheres import inner_spheres, outer_cover, protrusion_bound
from rrtik_ompl.world.world import World
from rrtik_tests.covered_solids import SOLIDS, mesh_solid


@pytest.mark.parametrize("name", ["ur5", "panda", "kinova"])
def test_nothing_of_a_shipped_robot_is_made(name, tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    World(load_robot(name))
    assert {folder.name for folder in tmp_path.iterdir()} <= {"kernels"}  # what is made is kept, in other folders


def test_a_cover_made_anew_is_as_good_as_the_shipped_one():
    """Not the same one: processors round differently, and a search goes on from what is rounded."""
    meshes = [body.geometry for body in link_bodies(load_robot("ur5")) if is_mesh(body.geometry)]
    smallest = min(meshes, key=lambda mesh: len(mesh_arrays(mesh)[1]))
    outer, inner = (cache.shipped_cover(cache.cover_key(smallest, f"{kind} None")) for kind in ("outer", "inner"))

    made = outer_cover(smallest)
    assert abs(len(made) - len(outer)) <= 1
    assert protrusion_bound(smallest, made) == pytest.approx(protrusion_bound(smallest, outer), rel=0.15)
    made = inner_spheres(smallest)
    assert len(made) == len(inner)
    assert made[:, 3].sum() == pytest.approx(inner[:, 3].sum(), rel=0.05)


def test_the_store_gives_back_what_was_written_and_is_always_the_same(tmp_path):
    covers = {"ab" * 32: np.arange(8.0).reshape(2, 4), "01" * 32: np.ones((1, 4)), "cd" * 32: np.zeros((0, 4))}
    for name in ("one.npz", "two.npz"):
        cache.write_store(covers, tmp_path / name)
        covers = dict(reversed(covers.items()))
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    assert cache._stored(tmp_path / "one.npz").keys() == covers.keys()
    assert all(np.array_equal(cache.shipped_cover(key, tmp_path / "one.npz"), covers[key]) for key in covers)


def test_a_missing_or_damaged_store_is_an_empty_one(tmp_path):
    (tmp_path / "cut.npz").write_bytes(cache.STORE.read_bytes()[:1000])
    assert cache._stored(tmp_path / "cut.npz") == cache._stored(tmp_path / "absent.npz") == {}
    keys = np.zeros((1, 32), dtype=np.uint8)
    np.savez(tmp_path / "spoilt.npz", keys=keys, ends=np.array([3]), packed=np.zeros(3, dtype=np.uint8))
    assert cache.shipped_cover("00" * 32, tmp_path / "spoilt.npz") is None


def test_the_store_is_small():
    assert cache.STORE.stat().st_size < 2e6


def test_a_new_mesh_is_told_once(tmp_path, monkeypatch):
    told, torus = [], mesh_solid("torus")
    for made in (outer_cover, inner_spheres, convex_pieces):
        made(torus)  # the kernels are loaded, or making them would be told too
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setattr(notice, "listener", told.append)
    monkeypatch.setattr(notice, "_told", set())
    cached_outer_cover(SOLIDS["box"])
    assert told == []
    for _ in range(2):
        cached_outer_cover(torus)
        cached_inner_spheres(torus)
        cached_convex_pieces(torus)
    assert told == [notice.COVERING]

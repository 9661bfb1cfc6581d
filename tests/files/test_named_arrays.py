"""Files of named arrays: what is broken, no such file, or holds anything but numbers is refused in a line of ours."""

import io
import zipfile

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files import named_arrays
from rrtik_ompl.files.named_arrays import NamedArrays


@pytest.fixture(scope="module")
def world():
    return rrtik.World(rrtik.load_robot("planar3"))


@pytest.fixture(scope="module")
def arrays(world, tmp_path_factory):
    file = tmp_path_factory.mktemp("maps") / "map.npz"
    rrtik.Roadmap(world, vertices=20, seed=1).save(file)
    return dict(np.load(file))


def packed(arrays):
    data = io.BytesIO()
    np.savez_compressed(data, **arrays)
    return data.getvalue()


def lying_header():
    data = io.BytesIO()
    header = str({"descr": "<f8", "fortran_order": False, "shape": (10**15,)}).ljust(117) + "\n"
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("rows.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode())
    return data.getvalue()


BROKEN = {
    "empty": lambda arrays: b"",
    "noise": lambda arrays: bytes(np.random.default_rng(1).bytes(500)),
    "text": lambda arrays: b"no file",
    "cut": lambda arrays: packed(arrays)[:400],
    "one array": lambda arrays: b"\x93NUMPY" + bytes(100),
    "objects": lambda arrays: packed(arrays | {"rows": np.array([{}], dtype=object)}),
    "a size that lies": lambda arrays: lying_header(),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_file_is_named_without_the_advice_of_others(tmp_path, world, arrays, case):
    file = tmp_path / "map.npz"
    file.write_bytes(BROKEN[case](arrays))
    for load in (lambda: rrtik.Roadmap.load(file, world), lambda: rrtik.ik.ReachMap.load(file)):
        with pytest.raises(InputError) as caught:
            load()
        assert str(caught.value).startswith(f"{file}: ")
        assert "save it again" in str(caught.value)


def test_what_is_far_larger_when_unpacked_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(named_arrays, "LARGEST_FILE", 50_000)
    (tmp_path / "map.npz").write_bytes(packed({"zeros": np.zeros(10_000)}))
    with pytest.raises(InputError, match=r"80128.*more than"):
        NamedArrays(tmp_path / "map.npz")


WRONG = {
    "edges of no vertex": ("edges", lambda rows: rows + 1000, "edges make no sense"),
    "half edges": ("edges", lambda rows: rows + 0.5, "edges: expected whole numbers"),
    "no numbers": ("rows", lambda rows: rows * np.nan, "vertices: every number must be finite"),
    "another format": ("format", lambda number: number + 1, "its format is 2, not 1"),
    "a seed of text": ("seed", lambda number: np.array("x"), "seed: expected whole numbers"),
    "many seeds": ("seed", lambda number: np.arange(3), "seed: expected a whole number of at least 0"),
    "no resolution": ("resolution", lambda number: number * np.nan, "resolution: must be a finite number"),
}


@pytest.mark.parametrize("case", WRONG)
def test_arrays_that_make_no_sense_are_named(tmp_path, world, arrays, case):
    name, spoil, said = WRONG[case]
    (tmp_path / "map.npz").write_bytes(packed(arrays | {name: spoil(arrays[name])}))
    with pytest.raises(InputError, match=rf"map\.npz.*'planar3': .*{said}"):
        rrtik.Roadmap.load(tmp_path / "map.npz", world)


def test_an_array_that_is_missing_is_named(tmp_path, world, arrays):
    (tmp_path / "map.npz").write_bytes(packed({k: v for k, v in arrays.items() if k != "states"}))
    with pytest.raises(InputError, match="'states' is missing"):
        rrtik.Roadmap.load(tmp_path / "map.npz", world)

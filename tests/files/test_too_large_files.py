"""Files above what is read are refused by their size, before they are read."""

import os
import resource
import time

import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.files.text import read_bytes

GIGABYTES = 3
LOADERS = {
    "cloud.npy": rrtik.PointCloud.load,
    "cloud.pcd": rrtik.PointCloud.load,
    "cloud.ply": rrtik.PointCloud.load,
    "cloud.xyz": rrtik.PointCloud.load,
    "cloud.bt": rrtik.PointCloud.load,
    "map.bt": rrtik.Octree.load,
    "heights.csv": lambda file: rrtik.HeightField.load(file, 0.1),
    "mesh.stl": rrtik.Mesh.load,
    "mesh.obj": rrtik.Mesh.load,
    "path.json": rrtik.JointPath.load,
    "path.csv": rrtik.JointPath.load,
    "problem.yaml": rrtik.load_problem,
    "arm.urdf": rrtik.load_robot,
    "reach.npz": rrtik.ik.ReachMap.load,
    "motion.csv": rrtik.Trajectory.load,
    "run.json": rrtik.replanning.ReplanRun.load,
    "proof.json": rrtik.Certificate.load,
}


@pytest.mark.parametrize("name", LOADERS)
def test_a_file_of_gigabytes_is_not_read(tmp_path, name):
    file = tmp_path / name
    file.touch()
    os.truncate(file, GIGABYTES << 30)
    before, begin = resource.getrusage(resource.RUSAGE_SELF), time.process_time()
    with pytest.raises(rrtik.InputError, match="MiB, the most that is read") as error:
        LOADERS[name](file)
    used = resource.getrusage(resource.RUSAGE_SELF)
    assert "\n" not in str(error.value)
    assert f"{GIGABYTES * 1024} MiB" in str(error.value)
    assert time.process_time() - begin < 2.0
    assert used.ru_maxrss - before.ru_maxrss < 1 << 20  # kB


def test_what_has_no_size_is_read_up_to_the_limit():
    with pytest.raises(rrtik.InputError, match="larger than 1 MiB"):
        read_bytes("/dev/zero", 1 << 20)


def test_long_tables_of_points_are_read_line_by_line(tmp_path):
    file = tmp_path / "points.xyz"
    file.write_text("# made by hand\n\n0,0,0.5\n 1 2 3\n\n")
    assert rrtik.PointCloud.load(file).points.tolist() == [[0.0, 0.0, 0.5], [1.0, 2.0, 3.0]]
    file.write_text("\n \n")
    with pytest.raises(rrtik.InputError):
        rrtik.PointCloud.load(file)


@pytest.mark.parametrize("name", ["a" * 300 + ".yaml", "b/" * 3000 + "x.yaml"])
def test_names_that_are_too_long_are_said_to_be(name, tmp_path, monkeypatch, capsys):
    from rrtik_ompl.cli import BAD_INPUT
    from rrtik_ompl.cli.app import run

    monkeypatch.chdir(tmp_path)
    for words in (["check", name], ["markers", "sense", name, "--camera-file", name, "--map", name], ["bench", name],
                  ["plan", "planar3_a", "--out", name.replace(".yaml", ".json")]):  # fmt: skip
        assert run(words) == BAD_INPUT
        said = capsys.readouterr().err
        assert said.startswith("rrtik: ")
        assert said.count("\n") == 1
        assert "standard output" not in said

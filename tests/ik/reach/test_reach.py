"""Maps of reach: what counts, what is kept, what is drawn."""

import json

import numpy as np
import pytest

from rrtik_ompl import Obstacle, Scene, World, load_robot
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.cli.app import run
from rrtik_ompl.ik import reach_map
from rrtik_ompl.ik.reach import TURNS, ReachMap
from rrtik_ompl.ik.singularity import manipulability
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.viewer.drawing.marks import cubes, reach_marks
from rrtik_ompl.viewer.plots.reach import plot_slices
from rrtik_robots.titan4.workspace import effective_slices

SAMPLES = 4_000


@pytest.fixture(scope="module")
def found(titan):
    return reach_map(titan, samples=SAMPLES)


def test_every_tip_of_the_arm_lies_in_the_grid_and_most_in_a_reached_cell(titan, found):
    Q = np.random.default_rng(7).uniform(titan.lower, titan.upper, (2_000, 6))
    points = titan.fk_batch(Q)[:, :3, 3]
    high = found.corner + found.size * np.array(found.values.shape)
    assert ((points > found.corner) & (points < high)).all()
    assert (found.value(points) > 0.0).mean() > 0.9
    assert (found.value(points + np.array([9.0, 0.0, 0.0])) == 0.0).all()


def test_a_reached_cell_really_holds_a_tip(titan, found):
    farthest = np.linalg.norm(found.corner + found.size * (np.argwhere(found.reached) + 0.5) - found.base, axis=1).max()
    assert farthest < 1.922 + found.size  # the headline reach of the arm, from its azimuth axis
    assert found.volume == pytest.approx(found.reached.sum() * found.size**3)


def test_planar_arms_point_everywhere_near_their_base_and_outwards_at_full_stretch():
    found = reach_map(load_robot("planar3"), samples=20_000, cell=0.2)
    assert found.values.shape[2] == 1
    assert found.volume == 0.0
    assert 0.8 * np.pi * 9.0 < found.area < 1.1 * np.pi * 9.0  # three links of 1 m
    assert found.value([[0.5, 0.5, found.centres(2)[0]]])[0] > 0.95
    assert 0.0 < found.value([[2.75, 0.0, found.centres(2)[0]]])[0] < 0.4
    assert len(found.slices()) == 1


def test_the_turns_of_the_first_joint_give_what_forward_kinematics_gives(titan):
    many = reach_map(titan, samples=SAMPLES, measure="samples")
    assert many.samples == SAMPLES * TURNS == many.values.sum()
    Q = np.random.default_rng(0).uniform(titan.lower, titan.upper, (SAMPLES * TURNS, 6))
    edges = [many.corner[k] + many.size * np.arange(many.values.shape[k] + 1) for k in range(3)]
    plain, _ = np.histogramdd(titan.fk_batch(Q)[:, :3, 3], bins=edges)
    shares = many.values / many.samples - plain / len(Q)
    assert np.abs(shares.sum(axis=(0, 1))).max() < 0.01  # by height
    assert np.abs(shares.sum(axis=2)).max() < 0.005  # seen from above


def test_manipulability_is_the_largest_of_the_postures_in_a_cell(titan):
    found = reach_map(titan, samples=SAMPLES, measure="manipulability")
    Q = np.random.default_rng(0).uniform(titan.lower, titan.upper, (SAMPLES, 6))  # the first turn of each
    assert (found.value(titan.fk_batch(Q)[:, :3, 3]) >= manipulability(titan, Q) - 1e-9).all()


def test_postures_in_collision_do_not_count(titan):
    wall = Scene([Obstacle("wall", Box([0.1, 6.0, 6.0]), pose([0.9, 0.0, 0.0]))])
    free = reach_map(titan, samples=SAMPLES, world=World(titan, wall), cell=0.1)
    x = free.centres(0)
    assert free.reached[x < 0.7].any()
    assert not free.reached[x > 1.0].any()
    with pytest.raises(InputError, match="another robot"):
        reach_map(titan, world=World(load_robot("puma560"), Scene()))


def test_a_map_is_the_same_for_the_same_seed_and_survives_its_file(titan, found, tmp_path):
    again = reach_map(titan, samples=SAMPLES)
    np.testing.assert_array_equal(again.values, found.values)
    assert not np.array_equal(reach_map(titan, samples=SAMPLES, seed=1).values, found.values)
    found.save(tmp_path / "map.npz")
    read = ReachMap.load(tmp_path / "map.npz")
    np.testing.assert_array_equal(read.values, found.values)
    assert (read.robot, read.measure, read.samples) == ("titan4", "orientations", found.samples)
    found.save(tmp_path / "map.csv")
    rows = np.loadtxt(tmp_path / "map.csv", delimiter=",", skiprows=1)
    assert len(rows) == found.reached.sum()
    np.testing.assert_allclose(found.value(rows[:, :3]), rows[:, 3], rtol=1e-5)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"cell": 0.0}, "cell: must be greater than 0"),
        ({"cell": 1e-3}, "at most 4000000"),
        ({"cell": 5e-324}, "at most 4000000"),
        ({"samples": 0}, "samples must be a whole number of at least 1"),
        ({"samples": 1e4}, "samples must be a whole number"),
        ({"axis": "w"}, "axis must be x, y or z"),
    ],
)
def test_arguments_that_make_no_sense_are_refused(titan, options, said):
    with pytest.raises(InputError, match=said):
        reach_map(titan, **options)
    with pytest.raises(UnknownNameError, match="did you mean 'samples'"):
        reach_map(titan, measure="sample")


@pytest.mark.parametrize("content", [b"", b"no map"])
def test_a_file_that_is_no_map_is_refused(tmp_path, content):
    file = tmp_path / "map.npz"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"map\.npz.*save it again"):
        ReachMap.load(file)


def test_cubes_have_no_faces_between_two_cells():
    inside = np.zeros((3, 3, 3), dtype=bool)
    inside[1, 1, 1] = True
    one = cubes("one", "#000000", inside, [0.0, 0.0, 0.0], 0.5)
    assert len(one.faces) == 12
    np.testing.assert_allclose([one.vertices.min(axis=0), one.vertices.max(axis=0)], [[0.5] * 3, [1.0] * 3])
    inside[2, 1, 1] = True
    two = cubes("two", "#000000", inside, [0.0, 0.0, 0.0], 0.5)
    assert len(two.faces) == 20
    corners = two.vertices[two.faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert area.sum() == pytest.approx(10 * 0.25)


def test_the_classes_of_a_map_are_all_its_cells_but_the_quarter_that_is_cut_away(found):
    whole = reach_marks(found, cut=False)
    steps = ["0 to 0.2", "0.2 to 0.4", "0.4 to 0.6", "0.6 to 0.8", "0.8 to 1"]
    assert [mark.name for mark in whole] == [f"{step} of all directions" for step in steps]
    cut = np.concatenate([mark.vertices for mark in reach_marks(found) if len(mark.faces)]) - found.base
    assert not ((cut[:, 0] > 1.5 * found.size) & (cut[:, 1] < -1.5 * found.size)).any()
    full = np.concatenate([mark.vertices for mark in whole if len(mark.faces)]) - found.base
    assert ((full[:, 0] > 1.5 * found.size) & (full[:, 1] < -1.5 * found.size)).any()


def test_the_effective_workspace_is_part_of_the_reach_and_never_in_the_vehicle(tmp_path):
    side, top = effective_slices(cell=0.1)
    for each in (side, top):
        assert set(np.unique(each.values)) == {0.0, 1.0, 3.0}
        ((left, low, right, high),) = each.boxes
        x, y = np.meshgrid(each.x, each.y)
        inside = (x > left) & (x < right) & (y > low) & (y < high)
        assert not (each.values[inside] == 3.0).any() or each is top  # the top view passes below the vehicle
    plot_slices([side, top], tmp_path / "workspace.svg", title="titan4")
    drawn = (tmp_path / "workspace.svg").read_text()
    assert all(words in drawn for words in ("straight ahead", "in reach", "vehicle", "camera", "base of the arm"))


def test_the_command_writes_a_map_a_picture_and_a_page(capsys, tmp_path):
    files = {name: str(tmp_path / f"reach.{name}") for name in ("csv", "png", "html")}
    options = ["--out", files["csv"], "--plot", files["png"], "--html", files["html"], "--samples", "2000"]
    assert run(["reach", "planar3", "--cell", "0.2", *options]) == 0
    out = capsys.readouterr().out
    assert "share of 64 directions" in out
    assert " m2, by " in out
    assert "planar3: orientations in reach" in (tmp_path / "reach.html").read_text()
    assert (tmp_path / "reach.png").read_bytes().startswith(b"\x89PNG")
    assert run(["reach", "titan4", "--free", "--samples", "500", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert 0 < told["samples"] < 500
    assert told["volume"] == pytest.approx(told["cells"] * told["cell"] ** 3)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["titan4", "--measure", "samles"], "did you mean 'samples'"),
        (["titan4", "--out", "map.png"], "unknown ending '.png'"),
        (["titan4", "--effective", "--json"], "--effective draws slices"),
        (["panda", "--effective"], "no effective workspace of robot 'panda'"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(capsys, arguments, said):
    assert run(["reach", *arguments]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1

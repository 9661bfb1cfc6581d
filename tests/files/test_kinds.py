"""Every kind of file: its value saves itself, and is read by its class and by `load`; other kinds are told apart."""

import inspect
import json

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.lazy import public_values
from rrtik_ompl.cli.app import COMMANDS
from rrtik_ompl.files.kinds import KINDS, found, kind_of
from rrtik_tests.marker_files import CAMERA, MAP

BOX = rrtik.Obstacle("post", rrtik.Box([0.1, 0.1, 0.1]), [2.0, 2.0, 0.0])
URDF = """<robot name="arm"><link name="base"/><link name="hand"/><joint name="turn" type="revolute">
<parent link="base"/><child link="hand"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/>
</joint></robot>"""

STL = "solid part\n" + "".join(
    f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"
    for corners in (
        "".join(f"vertex {x} {y} {z}\n" for x, y, z in face)
        for face in (
            [(0, 0, 0), (0, 1, 0), (1, 0, 0)],
            [(0, 0, 0), (1, 0, 0), (0, 0, 1)],
            [(1, 0, 0), (0, 1, 0), (0, 0, 1)],
            [(0, 1, 0), (0, 0, 0), (0, 0, 1)],
        )
    )
) + "endsolid\n"  # fmt: skip


def robot():
    return rrtik.load_robot("planar3")


def world():
    return rrtik.World(robot(), rrtik.Scene([BOX]))


def problem():
    return rrtik.Problem(world(), [0.0, 0.0, 0.0], [0.5, 0.0, 0.0])


def path():
    return rrtik.JointPath.of(robot(), [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])


def task():
    return rrtik.Task([rrtik.MoveTo([0.5, 0.0, 0.0])], world(), [0.0, 0.0, 0.0])


def saved(value):
    """A maker of a file by `save` of a value."""
    return lambda file: value().save(file)


def written(text):
    return lambda file: file.write_text(text)


def scenario(file):
    problem().save(file)
    file.write_text(file.read_text() + "run: {step: 0.05, rate: 20}\n")


# Of each kind: the names that its files have, and what makes them.
FILES = {
    "Robot": {"arm.urdf": written(URDF)},
    "Problem": {"problem.yaml": saved(problem)},
    "Scenario": {"scenario.yaml": scenario},
    "Scene": {"scene.yaml": saved(lambda: rrtik.Scene([BOX]))},
    "JointPath": {f"path{ending}": saved(path) for ending in (".json", ".csv", ".txt")},
    "Trajectory": {
        f"motion{ending}": saved(lambda: rrtik.time_parameterize(path(), rrtik.RateLimits(1.0, 4.0)))
        for ending in (".json", ".csv", ".yaml", ".ros.json")
    },
    "Certificate": {"proof.json": saved(lambda: world().certificate(path()))},
    "ReplanRun": {"run.json": saved(lambda: rrtik.replan(problem(), step=0.1, rate=10.0, seconds=0.5, seed=1))},
    "TaskCertificate": {"task_proof.json": saved(lambda: task().plan(seed=1).certificate())},
    "Task": {"task.yaml": saved(task)},
    "TaskPlan": {"plan.json": saved(lambda: task().plan(seed=1))},
    "Roadmap": {"map.npz": saved(lambda: rrtik.Roadmap(world(), vertices=5, seed=1))},
    "ReachMap": {"reach.npz": saved(lambda: rrtik.ik.reach_map(robot(), samples=500, seed=1))},
    "PointCloud": {f"scan{ending}": saved(lambda: rrtik.PointCloud(np.eye(3))) for ending in (".ply", ".npy")},
    "Octree": {},
    "Mesh": {"solid.stl": written(STL)},
    "Camera": {"camera.yaml": saved(lambda: CAMERA)},
    "Rig": {
        "rig.yaml": saved(lambda: rrtik.sensing.Rig((CAMERA, CAMERA), (rrtik.pose([0, 0, 0]), rrtik.pose([1, 0, 0]))))
    },
    "MarkerMap": {"map.yaml": written(MAP)},
    "HeightField": {"ground.csv": written("0.1,0.1\n0.2,0.1\n")},
}
NEEDS = {"Roadmap": lambda: {"world": world()}, "HeightField": lambda: {"cell": 0.5}}
EACH = [(kind, name) for kind, names in FILES.items() for name in names]
TOLD = [(kind, name) for kind, name in EACH if kind not in NEEDS]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A function from a kind and a name to a file of it, which is made once."""
    folder = tmp_path_factory.mktemp("files")

    def file_of(kind, name):
        if not (folder / name).exists():
            FILES[kind][name](folder / name)
        return folder / name

    return file_of


def test_the_table_of_files_has_every_kind():
    assert FILES.keys() == KINDS.keys()


@pytest.mark.parametrize("kind", KINDS)
def test_load_of_a_class_has_the_arguments_of_its_reader(kind):
    load, read = (found(each) for each in (KINDS[kind].value, KINDS[kind].reader))
    declared, own = (
        [(each.name, each.default, each.kind) for each in inspect.signature(function).parameters.values()][1:]
        for function in (load.load, read)
    )
    assert declared == own
    assert load.__name__ == kind
    assert inspect.getdoc(load.load)


def test_every_public_class_with_a_file_is_in_the_table():
    public = {
        name.split(".")[-1] for name, value in public_values(rrtik).items() if inspect.isclass(value)
        if hasattr(value, "load")
    }  # fmt: skip
    assert public == KINDS.keys()


@pytest.mark.parametrize(("kind", "name"), EACH)
def test_what_is_loaded_by_its_class_and_saved_again_is_the_same_file(kind, name, made, tmp_path):
    file = made(kind, name)
    value = found(KINDS[kind].value).load(file, **NEEDS.get(kind, dict)())
    assert type(value).__name__ == kind
    if hasattr(value, "save"):
        value.save(tmp_path / name)
        assert (tmp_path / name).read_bytes() == file.read_bytes()


@pytest.mark.parametrize(("kind", "name"), TOLD)
def test_what_is_saved_is_loaded_without_its_class(kind, name, made):
    value = rrtik.load(made(kind, name))
    assert type(value).__name__ == kind
    assert repr(value) == repr(found(KINDS[kind].value).load(made(kind, name)))


@pytest.mark.parametrize(("kind", "name"), [("Roadmap", "map.npz"), ("HeightField", "ground.tif")])
def test_a_file_that_needs_more_says_what(kind, name, tmp_path):
    FILES[kind].get(name, written(""))(tmp_path / name)
    with pytest.raises(rrtik.InputError, match=rf"{kind}\.load\(file, {KINDS[kind].needs[:4]}"):
        rrtik.load(tmp_path / name)


@pytest.mark.parametrize(("kind", "name"), TOLD)
@pytest.mark.parametrize("other", KINDS)
def test_a_file_of_another_kind_says_in_one_line_what_it_is(kind, name, other, made):
    file = made(kind, name)
    if other in (kind, *KINDS[kind].also):
        return
    with pytest.raises(rrtik.InputError) as error:
        found(KINDS[other].value).load(file, **NEEDS.get(other, dict)())
    assert str(error.value).startswith(f"{file}: {KINDS[kind].what}, not {KINDS[other].what}; use {kind}.load(file)")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if kind.command])
def test_the_command_that_takes_a_kind_of_file_exists(name):
    program, command, *_ = KINDS[name].command.split()
    assert program == "rrtik"
    assert command in COMMANDS


def test_a_robot_in_the_place_of_a_problem_is_named_with_the_command_that_takes_it(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(URDF)
    with pytest.raises(rrtik.InputError, match=r"a robot, not a problem; .* or rrtik show arm\.urdf"):
        rrtik.load_problem(file)


@pytest.mark.parametrize("load", [rrtik.load_problem, rrtik.load_scene, rrtik.load_robot])
def test_loaders_of_the_face_say_it_too(load, tmp_path):
    path().save(tmp_path / "path.json")
    with pytest.raises(rrtik.InputError, match=r"a path, not a .*; use JointPath\.load\(file\)"):
        load(tmp_path / "path.json")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.json", "{}", r"is none of Certificate, .*; name its class, such as JointPath\.load\(file\)"),
        ("a.json", '{"kind": "vehicle"}', "is none of"),
        ("a.json", "[1, 2]", "is none of"),
        ("a.json", "{", "line 1: not JSON"),
        ("a.yaml", "a: [", "not valid YAML"),
        ("a.yaml", "problems: [planar3_a]", "is none of"),
        ("a.dat", "", "is none of"),
        ("a.npz", "", "not a whole .npz file"),
        ("a", "", "is none of"),
    ],
)
def test_what_cannot_be_told_is_said_in_one_line(name, text, said, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(rrtik.InputError, match=said) as error:
        rrtik.load(tmp_path / name)
    assert "\n" not in str(error.value)


def test_a_name_that_is_shipped_is_no_file():
    with pytest.raises(rrtik.InputError, match="no such file"):
        rrtik.load("panda")
    with pytest.raises(rrtik.InputError, match="no such file"):
        rrtik.load("absent.json")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("odd", [None, 3, b"a.json", ["a"]])
def test_what_is_no_name_of_a_file_is_refused(kind, odd):
    with pytest.raises(rrtik.InputError, match="name of a file"):
        found(KINDS[kind].value).load(odd, **NEEDS.get(kind, dict)())
    with pytest.raises(rrtik.InputError, match="name of a file"):
        rrtik.load(odd)


def test_a_folder_is_a_configuration_of_moveit(tmp_path):
    assert kind_of(tmp_path) == "Robot"


def test_a_path_with_its_proof_is_a_path_and_holds_a_certificate(tmp_path):
    found_path = rrtik.plan(rrtik.load_problem("planar3_a"), seed=1).path
    found_path.save(tmp_path / "path.json", proof=True)
    assert isinstance(rrtik.load(tmp_path / "path.json"), rrtik.JointPath)
    assert rrtik.Certificate.load(tmp_path / "path.json").clearance >= 0.0


def test_a_fault_inside_a_file_of_the_right_kind_is_what_is_said(tmp_path):
    path().save(tmp_path / "path.json")
    document = json.loads((tmp_path / "path.json").read_text())
    (tmp_path / "path.json").write_text(json.dumps(document | {"waypoints": [[0.0], [0.0, 1.0]]}))
    with pytest.raises(rrtik.InputError, match="waypoints"):
        rrtik.load(tmp_path / "path.json")


def test_a_task_of_a_file_has_its_world_and_start_and_others_say_what_is_missing():
    assert rrtik.Task.load("titan4_drawer").world.robot.name == "titan4"
    with pytest.raises(rrtik.InputError, match="no world of its own; give plan"):
        rrtik.Task([rrtik.MoveTo([0.5, 0.0, 0.0])]).plan()
    with pytest.raises(rrtik.InputError, match="no start of its own; give plan"):
        rrtik.Task([rrtik.MoveTo([0.5, 0.0, 0.0])], world()).plan()

"""From files and options to a session: scenarios, cameras that are lost, records that are played again, bad input."""

import itertools
import json
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from rrtik_ompl import load_problem
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.cli.app import run
from rrtik_ompl.description.catalog import find_problem
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.camera_feed import Feed
from rrtik_ompl.pilot.devices.line_arm import LineServer
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, RED
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.sensing.cameras.pictures import CameraLostError, Picture
from rrtik_tests.waiting import until

FOLDER = find_problem("titan4_sdu").parent / "pilot"


CAMERA, MAP = (str(FOLDER / name) for name in ("camera_640.yaml", "titan4_panel_markers.yaml"))


def grey(number=0):
    return Picture(np.full((480, 640, 3), 128, dtype=np.uint8), str(number), float(number))


def test_the_shipped_scenario_has_every_color_of_lamp_and_places_the_object_well():
    opened = open_session(SessionOptions("titan4_sdu"))
    engine = opened.engine
    for count in range(5):
        engine.update(count / 30)
    place = load_vehicle(find_vehicle("titan4_sdu")).places["valve"]
    seen = engine.session.surroundings.named("valve")
    assert np.linalg.norm(seen.T_base_object.translation - place.translation) < 0.002
    assert {lamp.color for lamp in engine.session.lamps()} == {GREEN, AMBER, RED}
    opened.close()


def rig_of_one_place(tmp_path):
    """A rig whose two cameras are the same one, so that its photographs do for both."""
    file = tmp_path / "rig.yaml"
    cameras = f"- file: {CAMERA}\n- {{file: {CAMERA}, pose: {{xyz: [0, 0, 0]}}}}\n"
    file.write_text(f"version: 1\ncameras:\n{cameras}position_sigma: 0.0005\n")
    return file


def test_two_cameras_are_sensed_together_and_the_second_is_shown(tmp_path):
    photographs = FOLDER / "photographs"
    wanted = SessionOptions(
        "titan4_sdu", source=photographs, second=photographs, rig=rig_of_one_place(tmp_path), map_file=Path(MAP)
    )
    alone = SessionOptions("titan4_sdu", source=photographs, camera_file=Path(CAMERA), map_file=Path(MAP))
    places = []
    sigmas = []
    for options in (wanted, alone):
        opened = open_session(options)
        engine = opened.engine
        engine.update(0.0)
        seen = engine.session.surroundings.named("valve")
        places.append(seen.T_base_object.translation)
        sigmas.append(seen.position_sigma)
        if options is wanted:
            engine.execute({"name": "preset", "view": "second"}, 0.1)
            assert "second" in engine.state()["views"]
            assert np.array_equal(engine.perception.others[0], engine.perception.picture)
            assert engine.outside_picture()[:2] == b"\xff\xd8"
        opened.close()
    assert np.linalg.norm(places[0] - places[1]) < 1e-3
    assert sigmas[0] < sigmas[1]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({}, "second by --second"),
        ({"second": FOLDER / "photographs", "camera_file": Path(CAMERA)}, "no --camera-file"),
        ({"source": None}, "not simulated"),
    ],
)
def test_a_rig_without_its_two_sources_is_refused_in_one_line(tmp_path, more, said):
    given = {"source": FOLDER / "photographs", "map_file": Path(MAP), "rig": rig_of_one_place(tmp_path)} | more
    with pytest.raises(InputError, match=said) as refused:
        open_session(SessionOptions("titan4_sdu", **given))
    assert "\n" not in str(refused.value)


def test_the_outside_view_is_drawn_only_when_it_changed():
    opened = open_session(SessionOptions("titan4_sdu"))
    engine = opened.engine
    engine.update(0.0)
    first = engine.outside_picture()
    assert first is not None
    assert engine.outside_picture() is None
    assert engine.outside_picture(anew=True) == first
    engine.execute({"name": "preset", "view": "top"}, 0.1)
    assert engine.outside_picture() not in (None, first)
    engine.execute({"name": "preset", "view": "nowhere"}, 0.2)
    assert "top" in engine.state()["message"]
    opened.close()


def test_a_camera_that_is_lost_is_said_and_the_last_state_stays_until_it_is_back():
    opened = open_session(SessionOptions("titan4_sdu"))
    engine = opened.engine
    for count in range(3):
        engine.update(count / 30)
    before = engine.state()
    latest = engine.perception.source.latest

    def gone():
        raise CameraLostError("camera 0 gives no more pictures")

    engine.perception.source.latest = gone
    engine.update(1.0)
    state = engine.state()
    assert "no more pictures" in state["camera_lost"]
    assert state["stale"]
    assert (state["objects"], state["lamps"]) == (before["objects"], before["lamps"])
    assert engine.camera_picture()[:2] == b"\xff\xd8"
    engine.perception.source.latest = latest
    engine.update(1.1)
    assert engine.state()["camera_lost"] == ""
    assert not engine.state()["stale"]
    opened.close()


def test_a_feed_gives_the_newest_picture_and_opens_a_lost_camera_again(monkeypatch):
    monkeypatch.setattr("rrtik_ompl.pilot.devices.camera_feed.RETRY_SECONDS", 0.05)
    attempts = itertools.count()

    def camera():
        if next(attempts) == 1:
            raise CameraLostError("unplugged")
        yield from (grey(number) for number in range(5))
        raise CameraLostError("unplugged")

    def lost():
        try:
            feed.latest()
        except CameraLostError:
            return True
        return False

    feed = Feed(camera)
    until(lost)
    until(lambda: next(attempts) > 2)
    feed.close()


def test_pictures_of_the_past_come_as_far_apart_as_they_were_taken():
    feed = Feed(lambda: iter([Picture(grey().pixels, str(k), 0.2 * k) for k in range(3)]), paced=True)
    begin = time.monotonic()
    names = []
    while len(names) < 3:
        picture = feed.latest()
        if picture is not None:
            names.append(picture.name)
        time.sleep(0.005)
    assert names[0] == "0"
    assert time.monotonic() - begin > 0.3
    with pytest.raises(CameraLostError, match="the last one stays"):
        until(lambda: feed.latest() is not None, 2.0)
    feed.close()


def test_a_simulated_picture_follows_the_arm_and_the_objects_and_is_never_without_noise():
    engine = open_session(SessionOptions("titan4_sdu")).engine
    camera = engine.perception.source.camera
    start = np.array(load_problem("titan4_sdu").start)
    still = camera.picture(start, 0.0).pixels.astype(int)
    assert 1.0 < np.abs(camera.picture(start, 1.0 / 30.0).pixels - still).mean() < 3.0
    moved = start.copy()
    moved[0] += 0.2
    assert (np.abs(camera.picture(moved, 0.0).pixels - still) > 20).any(axis=2).sum() > 1000
    assert np.array_equal(camera.picture(start, 0.0).pixels, still)
    camera.places["valve"] = camera.places["valve"] * pose([0.0, 0.1, 0.0])
    assert (np.abs(camera.picture(start, 0.0).pixels - still) > 20).any(axis=2).sum() > 1000


def test_a_folder_of_images_drives_a_session(tmp_path):
    simulated = open_session(SessionOptions("titan4_sdu")).engine
    simulated.update(0.0)
    cv2.imwrite(str(tmp_path / "a.png"), simulated.perception.picture)
    files = {"camera_file": FOLDER / "camera_640.yaml", "map_file": FOLDER / "titan4_panel_markers.yaml"}
    opened = open_session(SessionOptions("titan4_sdu", source=tmp_path, **files))
    opened.engine.update(0.0)
    assert [each["name"] for each in opened.engine.state()["objects"]] == ["valve"]
    until(lambda: opened.engine.update(1.0) or opened.engine.state()["pictures_ended"])
    assert opened.engine.state()["objects"][0]["unseen"] == 0.0
    opened.close()
    with pytest.raises(InputError, match="--map"):
        open_session(SessionOptions("titan4_sdu", source=tmp_path, camera_file=files["camera_file"]))
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match="no images"):
        open_session(SessionOptions("titan4_sdu", source=tmp_path / "none", **files))


@pytest.mark.parametrize(("spoil", "said"), [
    (lambda file: file.write_bytes(b""), "b.png: is not an image that can be read"),
    (lambda file: cv2.imwrite(str(file), np.zeros((240, 320, 3), dtype=np.uint8)), "b.png: 320 x 240 pixels"),
])  # fmt: skip
def test_an_arm_stands_still_after_a_picture_that_cannot_be_used(tmp_path, spoil, said):
    simulated = open_session(SessionOptions("titan4_sdu")).engine
    simulated.update(0.0)
    cv2.imwrite(str(tmp_path / "a.png"), simulated.perception.picture)
    spoil(tmp_path / "b.png")
    files = {"camera_file": FOLDER / "camera_640.yaml", "map_file": FOLDER / "titan4_panel_markers.yaml"}
    opened = open_session(SessionOptions("titan4_sdu", source=tmp_path, **files))
    engine = opened.engine
    session = opened.engine.session
    engine.update(0.0)

    engine.execute({"name": "jog", "direction": 1.0, "press": 1}, 0.01)
    assert session.driving

    until(lambda: engine.update(0.02) or said in session.state.pictures.unusable)
    engine.update(0.03)
    assert not session.driving
    assert said in session.message

    before = session.arm.read()
    engine.execute({"name": "jog", "direction": 1.0, "press": 2}, 0.04)
    engine.update(0.5)
    assert said in session.message
    assert "\n" not in session.message
    assert np.array_equal(session.arm.read(), before)
    opened.close()


def test_pictures_that_the_camera_cannot_have_taken_are_refused_before_anything_is_shown(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((240, 320, 3), dtype=np.uint8))
    with pytest.raises(InputError, match="320 x 240 pixels"):
        open_session(SessionOptions("titan4_sdu", source=tmp_path, camera_file=CAMERA, map_file=MAP))


def test_an_object_that_is_out_of_view_is_said_and_costs_no_search_for_other_markers(monkeypatch):
    searched = []
    monkeypatch.setattr("rrtik_ompl.sensing.sensor.dictionaries_seen", lambda gray: searched.append(gray) or ())
    engine = open_session(SessionOptions("titan4_sdu")).engine
    camera = engine.perception.source.camera
    there = camera.places
    camera.places = {}
    for k in range(10):
        engine.update(0.1 * k)
    assert "no marker in view" in engine.state()["hint"]
    assert len(searched) == 1
    camera.places = there
    engine.update(1.0)
    assert (engine.state()["hint"], engine.state()["objects"][0]["unseen"]) == ("", 0.0)
    camera.places = {}
    engine.update(9.0)
    assert engine.state()["objects"][0]["unseen"] == 8.0
    assert len(searched) == 1


def test_a_record_of_a_real_camera_is_shown_with_that_cameras_file_and_map(tmp_path):
    simulated = open_session(SessionOptions("titan4_sdu")).engine
    simulated.update(0.0)
    cv2.imwrite(str(tmp_path / "a.png"), simulated.perception.picture)
    record = tmp_path / "r.jsonl"
    given = {"camera_file": Path(CAMERA), "map_file": Path(MAP)}
    opened = open_session(SessionOptions("titan4_sdu", source=tmp_path, record=record, **given))
    opened.engine.update(0.0)
    opened.close()
    for map_text in (Path(MAP).read_text(), _with_a_base_marker(Path(MAP).read_text())):
        given["map_file"] = tmp_path / "map.yaml"
        given["map_file"].write_text(map_text)
        again = open_session(SessionOptions("titan4_sdu", replay=record, **given)).engine
        again.update(1.0)
        assert [each["name"] for each in again.state()["objects"]] == ["valve"]
        assert again.camera_picture()


def _with_a_base_marker(text):
    lines = [line for line in text.splitlines() if not line.startswith("camera_pose")]
    return "\n".join([*lines, "  - {name: mount, role: base, markers: [{id: 1, side: 0.08}]}", ""])


def test_a_record_is_played_again_to_the_same_end(tmp_path):
    file = tmp_path / "a.jsonl"
    opened = open_session(SessionOptions("titan4_sdu", record=file, seed=4))
    engine = opened.engine
    engine.update(0.0)

    commands = [
        {"name": "grasp", "type": "aslant", "level": 2},
        {"name": "plan"},
        {"name": "accept"},
        {"name": "next", "press": 1},
    ]
    for number, command in enumerate(commands):
        engine.execute(command, 0.1 + 0.1 * number)
    for number in range(30):
        engine.update(0.5 + number / 30)
        engine.execute({"name": "next", "press": 1}, 0.5 + number / 30)
    joint = engine.session.state.selected
    assert engine.session.q[joint] != engine.session.means.problem.start[joint]

    route = engine.session.route
    q = engine.session.q
    opened.close()

    again = open_session(SessionOptions("titan4_sdu", replay=file)).engine
    again.update(0.15)
    assert again.session.route is None
    again.update(5.0)
    assert again.session.route.path.waypoints == pytest.approx(route.path.waypoints)
    assert again.session.q == pytest.approx(q)
    assert again.session.mode == "following"
    assert "ends" in again.state()["camera_lost"]


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ({"kind": "joints", "q": [1, 2]}, "joints"),
        ({"kind": "seen", "objects": [{"name": "ship", "xyz": [0, 0, 0], "rotation": np.eye(3).tolist()}]}, "ship"),
        ({"kind": "command", "name": "plan"}, "arguments"),
        ({"kind": "command", "name": [], "arguments": {}}, "a word"),
        ({"kind": "command", "name": None, "arguments": {}}, "a word"),
        ({"kind": "begin", "problem": "env_e", "q": [0] * 6}, "env_e"),
        ({"kind": "answer", "text": "no beginning"}, "holds no line 'begin'"),
    ],
)
def test_a_record_that_does_not_fit_is_refused_before_anything_is_shown(tmp_path, line, word):
    file = tmp_path / "bad.jsonl"
    file.write_text(json.dumps({"time": 0.0, **line}) + "\n")
    with pytest.raises(InputError, match=word) as caught:
        open_session(SessionOptions("titan4_sdu", replay=file))
    assert "bad.jsonl" in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ([], "--camera"),
        (["--simulated", "--camera", "0"], "--camera, --simulated"),
        (["--simulated", "--arm", "nowhere"], "HOST:PORT"),
        (["--simulated", "--arm", "127.0.0.1:99999"], "HOST:PORT"),
        (["--simulated", "--host", "192.0.2.1"], "--token"),
        (["--simulated", "--map", "m.yaml"], "--vehicle"),
        (["--replay", "missing.jsonl"], "missing.jsonl"),
        (["--simulated", "--replay", "x", "--record", "y"], "--record"),
        (["--video", "missing.mp4"], "--camera-file"),
        (["--camera", "99", "--camera-file", CAMERA, "--map", MAP], "camera 99 cannot be opened"),
        (["--simulated", "--record", "/nowhere/r.jsonl"], "cannot be written"),
        (["--vehicle", "missing.yaml"], "missing.yaml"),
    ],
)
def test_bad_options_are_said_in_one_line(arguments, word, capsys):
    assert run(["pilot", "titan4_sdu", "--no-browser", *arguments]) == 2
    error = capsys.readouterr().err
    assert word in error
    assert error.count("\n") == 1


def test_a_problem_without_a_scenario_is_named(tmp_path, capsys):
    assert run(["pilot", "env_e", "--no-browser", "--simulated"]) == 2
    assert "--vehicle" in capsys.readouterr().err
    for name in ("camera_640.yaml", "titan4_panel_markers.yaml"):
        (tmp_path / name).write_text((FOLDER / name).read_text())
    text = (FOLDER / "titan4_sdu.yaml").read_text().replace("name: valve", "name: ship")
    file = Path(tmp_path / "s.yaml")
    file.write_text(text)
    with pytest.raises(InputError, match=r"s\.yaml:\d+.*ship"):
        load_vehicle(file)


def test_an_arm_whose_line_is_cut_is_said_on_the_page_and_its_joints_stay():
    problem = load_problem("titan4_sdu")
    with LineServer(SimulatedArm(problem.robot, problem.start)) as server:
        opened = open_session(SessionOptions("titan4_sdu", arm=f"127.0.0.1:{server.port}"))
        engine = opened.engine
        engine.update(0.0)
        before = engine.state()
        assert before["arm_lost"] == ""
    until(lambda: engine.session.arm.lost)
    engine.update(1.0)
    state = engine.state()
    assert "connection to the arm is lost" in state["arm_lost"]
    assert [joint["value"] for joint in state["joints"]] == [joint["value"] for joint in before["joints"]]
    assert not state["stale"]
    opened.close()

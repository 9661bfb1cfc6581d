"""What helps where one picture has no depth: distances of edges, further cameras; pictures that are recorded."""

import json

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.record import SUFFIX
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.views import Aids
from rrtik_ompl.world.world import World
from rrtik_tests.pilot_session import PROBLEM, follow, session


def test_what_is_nearest_is_what_the_world_says():
    made, _ = session()
    found = Aids(made).distances()
    obstacles = {each.name for each in made.surroundings.world.scene.obstacles}
    alone = World(PROBLEM.robot, made.surroundings.world.scene)
    assert {found.nearest.first, found.nearest.second} & obstacles
    assert found.nearest.distance >= alone.closest(made.q).distance - 1e-6
    gap = np.linalg.norm(found.nearest.point_first - found.nearest.point_second)
    assert gap == pytest.approx(found.nearest.distance, abs=1e-4)


def test_edges_meet_at_a_grasp():
    made, arm = session()
    aids = Aids(made)
    far = aids.distances().to_target.distance
    made.command("grasp", 0.0, type="front", level=0)
    made.command("plan", 0.0)
    made.command("accept", 0.0)
    follow(made, arm, 0.0)
    assert aids.distances().to_target.distance < 0.02 < far


def test_further_cameras_are_looked_through_by_name():
    opened = open_session(SessionOptions("titan4_sdu"))
    engine = opened.engine
    engine.update(0.0)
    assert engine.state()["views"][-2:] == ["wrist", "second"]
    pictures = {}
    for time, view in enumerate(("wrist", "second", "corner"), start=1):
        engine.execute({"name": "preset", "view": view}, 0.1 * time)
        pictures[view] = engine.outside_picture()
    assert len(set(pictures.values())) == 3
    assert engine.state()["view"] == ""
    opened.close()


def test_pictures_are_recorded_with_their_times_and_shown_again(tmp_path):
    file = tmp_path / "session.jsonl"
    opened = open_session(SessionOptions("titan4_sdu", record=file, record_pictures=True))
    taken = {}
    for count in range(4):
        opened.engine.update(0.1 * count)
        taken[round(0.1 * count, 6)] = opened.engine.perception.picture
    opened.close()
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert [each["time"] for each in lines if each["kind"] == "picture"] == list(taken)
    again = open_session(SessionOptions("titan4_sdu", replay=file))
    for time, picture in taken.items():
        again.engine.update(time)
        assert np.abs(again.engine.perception.picture.astype(int) - picture).mean() < 4.0  # JPEG
    again.close()
    (tmp_path / f"session.jsonl{SUFFIX}").write_bytes(b"")  # cut off: what was seen is shown as it was before
    lame = open_session(SessionOptions("titan4_sdu", replay=file))
    lame.engine.update(0.2)
    lame.close()


def test_pictures_need_a_record_and_a_new_file(tmp_path):
    with pytest.raises(InputError, match="needs --record"):
        open_session(SessionOptions("titan4_sdu", record_pictures=True))
    (tmp_path / f"r.jsonl{SUFFIX}").write_bytes(b"x")
    with pytest.raises(InputError, match="is there already"):
        open_session(SessionOptions("titan4_sdu", record=tmp_path / "r.jsonl", record_pictures=True))

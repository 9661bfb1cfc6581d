"""The page's checker: what it accepts is free, by arithmetic of a plane; what is no proof it refuses."""

import json
import math
import re
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from rrtik_ompl.viewer.checker import checker_page
from rrtik_tests.browser import planning_page
from rrtik_tests.checker_script import in_script
from rrtik_tests.command_line import rrtik
from rrtik_tests.programs import needs_chromium

LENGTH, RADIUS, BALL = 0.5, 0.05, 0.1
STILL = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]
CHECK = "data.map((file) => checkCertificate(file, {}))"


def certificate(centre=(2.0, 0.0), ends=(0.0, 0.5), clearance=0.0, entries=()):
    """An arm of one capsule that turns about z beside a ball in its plane; the model is all that there is of them."""
    along = [0, 0, 1, LENGTH / 2, 0, 1, 0, 0, -1, 0, 0, 0]  # the capsule's z along x
    joint = {"name": "turn", "parent": 0, "pose": STILL, "axis": [0, 0, 1], "slides": False, "gain": [1], "offset": 0}
    common = {"number": 0, "margin": 0, "padding": 0, "contacts": []}
    link = {"name": "arm", "kind": "link", "joint": 1, "pose": along, "shape": {"capsule": [RADIUS, LENGTH]}, **common}
    place = [*STILL[:3], centre[0], *STILL[4:7], centre[1], *STILL[8:]]
    ball = {"name": "ball", "kind": "obstacle", "joint": 0, "pose": place, "shape": {"sphere": BALL}, **common}
    return {
        "kind": "path_certificate", "version": 2, "robot": "one", "joints": [joint], "bodies": [link, ball],
        "unchecked": [],
        "clearance": clearance, "self_margin": 0, "waypoints": [[end] for end in ends], "motions": [list(entries)],
    }  # fmt: skip


def least_distance(centre, ends):
    """Between capsule and ball, along the motion [m]."""
    shares = np.linspace(*ends, 2001)
    x = np.cos(shares) * centre[0] + np.sin(shares) * centre[1]
    y = np.cos(shares) * centre[1] - np.sin(shares) * centre[0]
    return float((np.hypot(x - np.clip(x, 0.0, LENGTH), y) - RADIUS - BALL).min())


def test_what_is_accepted_is_free_and_what_is_far_is_accepted():
    rng = np.random.default_rng(0)
    drawn = [(rng.uniform(-1.0, 1.0, 2).tolist(), sorted(rng.uniform(-1.5, 1.5, 2).tolist())) for _ in range(300)]
    distances = np.array([least_distance(*each) for each in drawn])
    holds = np.array([found["holds"] for found in in_script(CHECK, [certificate(*each) for each in drawn])])
    assert 30 < np.count_nonzero(holds) < 270
    assert distances[holds].min() > 0.0
    # What balls can show: the ball around the whole arm is clear of the obstacle.
    far = [math.hypot(*centre) > LENGTH + 2 * RADIUS + BALL + 0.5 for centre, _ in drawn]
    assert holds[far].all()


def test_a_plane_proves_a_pair_that_balls_leave_open():
    # Beside the arm, at rest: balls overlap, the plane y = 0.12 separates.
    beside = certificate(centre=(0.25, 0.2), ends=(0.0, -0.02))
    cases = [deepcopy(beside) for _ in range(8)]
    plane = [0, 0, 1, 0, 0, 0, 0.0, -1.0, 0.0]
    entries = [
        [plane], [], [[*plane[:7], 1.0, 0.0]], [[*plane[:7], -0.4, 0.0]], [[*plane[:4], 1, 0, *plane[6:]]], [plane[:6]],
        [[1, 0, 0, 0, *plane[4:]]], [[0, 0, 1, 0, 11, 0, *plane[6:]]],
    ]  # fmt: skip
    for case, own in zip(cases, entries, strict=True):
        case["motions"] = [own]
    found = [each["holds"] for each in in_script(CHECK, cases)]
    assert found == [True] + 7 * [False]


def test_a_body_deep_in_a_box_is_no_slight_contact():
    touching = certificate(centre=(0.25, 0.0), ends=(0.0, 0.0))
    touching["bodies"][1]["shape"] = {"box": [2.0, 2.0, 2.0]}
    for body, other in zip(touching["bodies"], ("ball", "arm"), strict=True):
        body["contacts"] = [[other, -0.4]]
    assert not in_script(CHECK, [touching])[0]["holds"]


def through_the_ball(**changes):
    """Certificates of an arm that goes through the ball, whose file says that this does not matter."""
    file = certificate(centre=(0.25, 0.0), ends=(0.0, 0.0))
    file["bodies"][1] |= changes
    return file


def test_a_name_of_two_things_hides_nothing():
    found = in_script(CHECK, [through_the_ball(), through_the_ball(name="arm"), through_the_ball(name="arm", number=1)])
    assert "not shown apart" in found[0]["fault"]
    assert all("is the name of another thing" in each["fault"] for each in found[1:])


def test_links_are_in_no_contact():
    file = through_the_ball(kind="link")
    for body, other in zip(file["bodies"], ("ball", "arm"), strict=True):
        body["contacts"] = [[other, -9.0]]
    [found] = in_script(CHECK, [file])
    assert found["fault"] == "contacts: 'arm' and 'ball' are links"


def test_contacts_are_those_of_the_scene_even_if_the_robot_is_the_file_s():
    # The ball is in contact with the table, and the file says that it is in contact with the arm too.
    obstacles = [{"name": "ball", "pose": {"xyz": [0.25, 0, 0]}, "sphere": BALL}, {"name": "table", "sphere": 0.1}]
    obstacles[1]["pose"] = {"xyz": [5, 0, 0]}
    contacts = [{"pair": ["ball", "table"], "distance": -0.01}]
    scene = {"version": 1, "scene": {"obstacles": obstacles, "contacts": contacts}}
    file = through_the_ball(contacts=[["table", -0.01]])
    table = {**file["bodies"][1], "name": "table", "contacts": [["ball", -0.01]]}
    table["pose"] = [*STILL[:3], 5, *STILL[4:]]
    file["bodies"].append(table)
    file["bodies"][0]["contacts"] = [["ball", -9.0]]
    [found] = in_script(
        f"data.map((file) => checkCertificate(file, {{ scene: sceneOf({json.dumps(scene)}, '') }}))", [file]
    )
    assert "'arm' and 'ball', from 0 to 1 of it: not shown apart" in found["fault"]


CHANGES = {
    "clearance": [0.5, -1, None, "0", True], "version": [1, 3, "2"], "kind": ["joint_path"],
    "waypoints": [[], [[0, 1], [0]], [[1e4], [0]]], "motions": [[], [[], []], [[[0, 0, 1, 0, 0]]]],
    "joints": [[], None], "bodies": [None, [{}]], "times": [[0, 1]], "trust": [1],
    "unchecked": [[[0, 1]], [[1, 0, "a"]], [[0, 7, "a"]]],
    "constraints": [[], {}, [{}], [{"frame": "arm", "joint": 1, "pose": STILL, "within": STILL, "region": STILL,
                                    "bounds": [[0, 1]] * 5, "tolerances": [0, 0]}]],
}  # fmt: skip


def test_malformed_files_are_refused_without_an_error():
    near = certificate(centre=(0.95, 0.0))
    files = [{**near, key: value} for key, values in CHANGES.items() for value in values]
    files += [{key: value for key, value in near.items() if key != left_out} for left_out in near]
    found = in_script(CHECK, [near, *files])
    assert found[0]["holds"]
    assert [file for file, each in zip(files, found[1:], strict=True) if each["holds"] or not each["fault"]] == []


def test_a_timed_motion_bends_and_may_swing_beyond_its_ends():
    # From 0 back to 0 in 1 s, by way of -1: the ball is where the arm swings, far from both ends.
    swing = {"times": [0, 1], "rates": [[[-4.0], [8.0], [0.0]]]}
    free = certificate(centre=(1.2, 0.0), ends=(0.0, 0.0)) | swing
    there = certificate(centre=(0.5 * math.cos(1), -0.5 * math.sin(1)), ends=(0.0, 0.0)) | swing
    jumps = certificate(centre=(1.2, 0.0), ends=(0.0, 0.1)) | swing
    straight = certificate(centre=(0.5 * math.cos(1), -0.5 * math.sin(1)), ends=(0.0, 0.0))
    assert [each["holds"] for each in in_script(CHECK, [free, there, jumps, straight])] == [True, False, False, True]


def task(*parts):
    return {"kind": "task_certificate", "version": 2, "parts": list(parts)}


ARM = f"""<robot name="one"><link name="base"/>
<link name="arm"><collision><origin xyz="{LENGTH / 2} 0 0" rpy="0 {math.pi / 2!r} 0"/>
<geometry><capsule radius="{RADIUS}" length="{LENGTH}"/></geometry></collision></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint></robot>"""


@pytest.mark.parametrize("padding", [0.0, 0.01])
def test_links_are_as_thick_as_the_plan_of_a_task_says(padding):
    file = certificate()
    scene = {"obstacles": [{"name": "ball", "pose": {"xyz": [2, 0, 0]}, "sphere": BALL}]}
    motion = {"robot": {"padding": {"arm": padding}}, "scene": scene, "waypoints": file["waypoints"]}
    own = "{ scene: null, waypoints: null, robot: readUrdf(data[1], ''), parts: partsOfPlan(data[2], '') }"
    found = in_script(f"checkAnyCertificate(data[0], {own})", [task(file), ARM, {"motions": [motion]}])
    other = f"part 1: it is for another robot: 'arm' has a padding of 0 m there, {padding} m here"
    assert found["fault"] == (other if padding else "")


def test_what_moves_in_a_task_is_where_the_part_before_has_left_it():
    passing = certificate() | {"times": [0, 1], "rates": [[[0.5]]], "tracks": [[STILL, [*STILL[:11], 0.5]]]}
    passing["bodies"][1]["joint"] = 2
    back = deepcopy(passing) | {"waypoints": [[0.5], [0.0]], "rates": [[[-0.5]]]}
    there = [back["tracks"][0][1], STILL]
    found = in_script(
        "data.map((file) => checkAnyCertificate(file, { scene: null, waypoints: null }).fault)",
        [task(passing, back | {"tracks": [there]}), task(passing, back)],
    )
    assert found == ["", "from part 1 to the next: a thing jumps: ball 0"]


def test_the_command_writes_a_page_that_asks_nobody(tmp_path, capsys):
    code, said, _ = rrtik(capsys, "checker", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert code == 0
    assert "page.html" in said
    assert text == checker_page()
    assert "default-src &#x27;none&#x27;" in text or "default-src 'none'" in text
    assert re.findall(r"\b(fetch\(|XMLHttpRequest|WebSocket|import\(|eval\(|src=|https?:)", text) == []
    assert rrtik(capsys, "checker", tmp_path / "page.txt")[0] == 2


@pytest.mark.slow
@needs_chromium
def test_the_page_says_what_the_checker_says(tmp_path):
    with planning_page(checker_page(), Path(tmp_path), "globalThis.checkerPage !== undefined") as browser:
        for file, expected in (
            (certificate((1.2, 0.0)), "holds: 1 motion"),
            (certificate((0.4, 0.1)), "does not hold: motion 1: 'arm' and 'ball'"),
            (task(*[certificate((1.2, 0.0), ends=(0.0, 0.0))] * 2), "holds: 2 motions"),
        ):
            text = json.dumps(json.dumps(file))
            browser.ask("document.getElementById('again').click()")
            browser.ask(f"checkerPage.takeFiles([new File([{text}], 'certificate.json')])")
            browser.wait("!document.getElementById('verdict').textContent.startsWith('Drop')")
            assert browser.text("verdict").startswith(expected)
            assert browser.ask("checkerPage.state.shown.solids.length") == 2

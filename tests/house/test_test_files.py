"""The files of the tests themselves: short, and each in the folder of its room."""

from rrtik_tests.places import ROOT

TESTS = ROOT / "tests"
MOST_LINES = 400


def test_no_file_of_tests_is_too_long():
    lines = {file.relative_to(TESTS): len(file.read_text().splitlines()) for file in TESTS.rglob("*.py")}
    assert {str(file): count for file, count in lines.items() if count > MOST_LINES} == {}


def test_every_test_file_lies_in_a_folder():
    assert [file.name for file in TESTS.glob("*.py")] == ["conftest.py"]
    assert [str(file) for file in (TESTS / "helpers").rglob("test_*.py")] == []

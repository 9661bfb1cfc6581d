"""A small suite, and the folder of a campaign that ran it, for all tests of this folder."""

import pytest

from rrtik_ompl.cli.app import run
from rrtik_tests.campaigns import SUITE


@pytest.fixture(scope="session")
def suite(tmp_path_factory):
    file = tmp_path_factory.mktemp("suite") / "two.yaml"
    file.write_text(SUITE)
    return file


@pytest.fixture(scope="session")
def campaign(suite, tmp_path_factory):
    """Folder of a campaign that was run two at a time."""
    folder = tmp_path_factory.mktemp("campaign")
    assert run(["bench", str(suite), "--jobs", "2", "--out", str(folder), "--views", "1"]) == 0
    return folder

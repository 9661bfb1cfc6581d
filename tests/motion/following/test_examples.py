"""The examples for arms run to their end against their stubs."""

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


@pytest.mark.parametrize("name", ["follow_ur_rtde", "follow_libfranka"])
def test_an_example_follows_its_motion_on_a_stub(monkeypatch, capsys, name):
    monkeypatch.setattr(sys, "argv", [name])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    told = capsys.readouterr().out
    assert ended.value.code == 0, told
    assert "within all limits" in told
    assert told.rstrip().endswith("arrived")

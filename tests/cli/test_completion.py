"""Shells complete commands and names: what bash, zsh and fish get is on standard output."""

import sys

import pytest

from rrtik_ompl.cli.app import run

SHELLS = {
    "bash": lambda words: {"COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))},
    "zsh": lambda words: {"_TYPER_COMPLETE_ARGS": words},
    "fish": lambda words: {"_TYPER_COMPLETE_ARGS": words, "_TYPER_COMPLETE_FISH_ACTION": "get-args"},
}


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize(
    ("words", "offered", "other"),
    [
        ("rrtik pl", "play", "show"),
        ("rrtik plan panda_s", "panda_shelf", "ur5_table"),
        ("rrtik show xa", "xarm7", "panda"),
    ],
)
def test_commands_and_names_are_completed(shell, words, offered, other, monkeypatch, capsys):
    for name, value in {"_RRTIK_COMPLETE": f"complete_{shell}", **SHELLS[shell](words)}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "argv", ["rrtik"])
    assert run() == 0
    said = capsys.readouterr()
    assert offered in said.out
    assert other not in said.out
    assert said.err == ""

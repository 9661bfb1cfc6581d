"""Strict YAML: no key twice, no tags, no bombs; every value knows its line, every error says FILE:LINE: key: remedy."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from rrtik_ompl.base.errors import InputError, RrtikError
from rrtik_ompl.files.text import file_name, read_text, write_text
from rrtik_ompl.files.yaml_values import MAX_DEPTH, Builder, Group, plain_value
from rrtik_ompl.files.yaml_values import Location as Location
from rrtik_ompl.files.yaml_values import key_path as key_path

_STYLE: dict[str, Any] = {"default_flow_style": None, "allow_unicode": True}  # innermost lists and groups on one line


@dataclass(frozen=True, slots=True, eq=False)
class YamlDocument:
    """A YAML file that was read: its values and where each of them is.

    Attributes:
        path: The file, as it was named by the caller.
        data: The top-level mapping.
        top: Where its groups begin.
    """

    path: Path
    data: dict[str, Any]
    top: Group

    @property
    def lines(self) -> Mapping[Location, int]:
        """Line number (from 1) of each location."""
        return {(): self.top.line, **dict(self.top.located())}

    def place(self, location: Location) -> str:
        """``FILE:LINE: key.path`` of a location (of its nearest parent that is in the file, for the line)."""
        known = location
        lines = self.lines
        while known not in lines:
            known = known[:-1]
        where = f"{self.path}:{lines[known]}"
        return f"{where}: {key_path(location)}" if location else where

    def error(self, location: Location, message: str) -> InputError:
        """An error about the value at a location."""
        return InputError(f"{self.place(location)}: {message}")

    @contextmanager
    def at(self, location: Location) -> Iterator[None]:
        """Put file, line and key in front of whatever error of ours is raised inside the ``with`` block."""
        try:
            yield
        except RrtikError as error:
            if not str(error).startswith(f"{self.path}:"):
                said = str(error).removeprefix(f"{location[-1]}: " if location else "")
                error.args = (f"{self.place(location)}: {said}",)  # keeps the class and its data
            raise


def read_yaml(path: str | os.PathLike[str]) -> YamlDocument:
    """Read a YAML file whose top level is a mapping.

    Raises:
        InputError: If the file cannot be read, is not valid YAML, is empty, is not a mapping, holds a key twice, uses
            tags, is nested deeper than 40 levels, or unfolds to more than a million values.
    """
    file = file_name(path)
    text = read_text(path)
    builder = Builder(file)

    try:
        builder.read(text)
    except yaml.MarkedYAMLError as error:
        if "nesting depth" in (error.problem or ""):  # libyaml's own limit, met before its events reach ours
            raise InputError(f"{path}: nested deeper than {MAX_DEPTH} levels") from error
        raise InputError(_syntax(file, text, error)) from error
    except yaml.YAMLError as error:  # a control character, most often
        raise InputError(f"{path}: not valid YAML: {str(error).splitlines()[0]}; is it a text file?") from error

    if not builder.documents or builder.top is None:
        raise InputError(f"{path}: the file is empty; it must hold 'key: value' lines")
    if builder.group is None or not isinstance(builder.top, dict):
        raise InputError(f"{path}:1: the top level must be 'key: value' lines, found {describe(builder.top)}")

    return YamlDocument(file, builder.top, builder.group)


def write_yaml(path: str | os.PathLike[str], data: Mapping[str, Any]) -> None:
    """Write a mapping of plain values as YAML, whole or not at all; every number reads back bit for bit.

    Raises:
        InputError: If the file cannot be written.
    """
    write_text(path, yaml.dump(dict(data), Dumper=_Dumper, sort_keys=False, width=110, **_STYLE))


def describe(value: object) -> str:
    """What was found, for an error message: ``text 'abc'``, ``a list of 3``, ``nothing``."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"text '{value if len(value) <= 40 else value[:37] + '...'}'"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "a group of keys (" + ", ".join(list(value)[:6]) + ")" if value else "an empty group of keys"
    if isinstance(value, int) and abs(value) >= 10**20:
        return "a whole number of more than 20 digits"
    return repr(value)


def _syntax(path: Path, text: str, error: yaml.MarkedYAMLError) -> str:
    unclosed = "end of stream" in (error.problem or "") and error.context_mark is not None
    mark = error.context_mark if unclosed else error.problem_mark or error.context_mark

    if mark is None:
        return f"{path}: not valid YAML: {error.problem}"

    rows = text.splitlines()
    row = rows[mark.line] if mark.line < len(rows) else ""
    if "\t" in row[: len(row) - len(row.lstrip())]:
        return f"{path}:{mark.line + 1}: a tab stands at the start of the line; indent YAML with blanks only"

    what = ": ".join(part for part in (error.context, error.problem) if part)
    return f"{path}:{mark.line + 1}: not valid YAML ({what}); check indentation, colons, quotes and brackets"


class _Dumper(yaml.SafeDumper):
    """Quotes every text that this module would otherwise read back as a number or a word."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _represent_text(dumper: _Dumper, text: str) -> yaml.ScalarNode:
    style = None if isinstance(plain_value(text), str) else "'"
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _represent_text)

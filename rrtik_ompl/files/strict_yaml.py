"""Strict YAML: no key twice, no tags, no bombs; every value knows its line, every error says FILE:LINE: key: remedy.

Plain scalars are read as in YAML 1.2 (``1e-3`` is a number, ``yes`` and ``12:30`` are text).
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, cast

import yaml

from rrtik_ompl.errors import InputError, RrtikError
from rrtik_ompl.files.text import file_name, read_text, write_text

Location: TypeAlias = tuple[str | int, ...]  # keys and list numbers from the top: ("start", "joints", 2)

MAX_DEPTH = 40
MAX_VALUES = 1_000_000  # after aliases are followed
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_STYLE: dict[str, Any] = {"default_flow_style": None, "allow_unicode": True}  # innermost lists and groups on one line
_INTEGER = re.compile(r"[-+]?[0-9]{1,4000}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_WORDS: dict[str, bool | float | None] = {"": None, "~": None}
_WORDS |= {form: value for word, value in {"null": None, "true": True, "false": False}.items()
           for form in (word, word.capitalize(), word.upper())}  # fmt: skip
_WORDS |= {form: float(form.replace(".", "")) for form in (".nan", ".NaN", ".NAN")}
_WORDS |= {sign + form: float(sign + "inf") for form in (".inf", ".Inf", ".INF") for sign in ("", "+", "-")}


@dataclass(frozen=True, slots=True, eq=False)
class YamlDocument:
    """A YAML file that was read: its values and where each of them is.

    Attributes:
        path: The file, as it was named by the caller.
        data: The top-level mapping.
        lines: Line number (from 1) of each location.
    """

    path: Path
    data: dict[str, Any]
    lines: Mapping[Location, int]

    def place(self, location: Location) -> str:
        """``FILE:LINE: key.path`` of a location (of its nearest parent that is in the file, for the line)."""
        known = location
        while known and known not in self.lines:
            known = known[:-1]
        where = f"{self.path}:{self.lines.get(known, 1)}"
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


def key_path(location: Location) -> str:
    """``("obstacles", 3, "box")`` as a person writes it: ``obstacles[3].box``."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return text.removeprefix(".")


def read_yaml(path: str | os.PathLike[str]) -> YamlDocument:
    """Read a YAML file whose top level is a mapping.

    Raises:
        InputError: If the file cannot be read, is not valid YAML, is empty, is not a mapping, holds a key twice, uses
            tags, is nested deeper than 40 levels, or unfolds to more than a million values.
    """
    file = file_name(path)
    text = read_text(path)
    builder = _Builder(file)
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            builder.take(event)
    except yaml.MarkedYAMLError as error:
        raise InputError(_syntax(file, text, error)) from error
    except yaml.YAMLError as error:  # a control character, most often
        raise InputError(f"{path}: not valid YAML: {str(error).splitlines()[0]}; is it a text file?") from error
    if not builder.documents or builder.top is None:
        raise InputError(f"{path}: the file is empty; it must hold 'key: value' lines")
    if not isinstance(builder.top, dict):
        raise InputError(f"{path}:1: the top level must be 'key: value' lines, found {describe(builder.top)}")
    return YamlDocument(file, builder.top, builder.lines)


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


@dataclass(slots=True)
class _Open:
    """A list or mapping whose end has not been reached yet."""

    value: Any
    location: Location
    anchor: str | None
    key: str | None = None
    size: int = 1
    height: int = 1


@dataclass(slots=True)
class _Builder:
    """Builds values from parser events with its own stack: the parser's composer overflows on deep nesting."""

    path: Path
    top: Any = None
    documents: int = 0
    lines: dict[Location, int] = field(default_factory=dict)
    _stack: list[_Open] = field(default_factory=list)
    _anchors: dict[str, tuple[Any, int, int]] = field(default_factory=dict)  # value, size, height

    def take(self, event: yaml.Event) -> None:
        """Digest the next event of the parser."""
        if isinstance(event, yaml.DocumentStartEvent):
            self.documents += 1
            if self.documents > 1:
                raise self._error(event, "a second document starts here ('---'); put one in a file")
        if isinstance(event, yaml.NodeEvent):
            tag = getattr(event, "tag", None)
            if tag is not None:
                raise self._error(event, f"tag '{tag}' cannot be used; write the value alone")
            if self._wants_key():
                self._take_key(event)
            else:
                self._take_value(event)
        elif isinstance(event, yaml.CollectionEndEvent):
            done = self._stack.pop()
            self._add(done.value, done.size, done.height, done.anchor, event)

    def _wants_key(self) -> bool:
        return bool(self._stack) and isinstance(self._stack[-1].value, dict) and self._stack[-1].key is None

    def _take_key(self, event: yaml.Event) -> None:
        parent = self._stack[-1]
        if not isinstance(event, yaml.ScalarEvent):
            raise self._error(event, "a key must be a word, found a list or a group")
        if event.value in parent.value:
            first = self.lines[(*parent.location, event.value)]
            raise self._error(event, f"key '{event.value}' stands here twice (first in line {first}); delete one")
        parent.key = event.value
        self.lines[(*parent.location, event.value)] = _line(event)

    def _take_value(self, event: yaml.Event) -> None:
        location = self._location()
        self.lines.setdefault(location, _line(event))
        if isinstance(event, yaml.CollectionStartEvent):
            group: Any = {} if isinstance(event, yaml.MappingStartEvent) else []
            self._stack.append(_Open(group, location, event.anchor))
            self._check_depth(event, 0)
        elif isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                raise self._error(event, f"alias '*{event.anchor}' stands for nothing that ended before it")
            self._add(*self._anchors[event.anchor], None, event)
        else:
            scalar = cast(yaml.ScalarEvent, event)
            value = plain_value(scalar.value) if scalar.implicit[0] else scalar.value
            self._add(value, 1, 1, scalar.anchor, event)

    def _add(self, value: Any, size: int, height: int, anchor: str | None, event: yaml.Event) -> None:
        """Put a finished value where it belongs and keep count of what the file unfolds to."""
        if anchor is not None:
            self._anchors[anchor] = (value, size, height)
        if not self._stack:
            self.top = value
            return
        parent = self._stack[-1]
        if parent.key is None:
            parent.value.append(value)
        else:
            parent.value[parent.key] = value
            parent.key = None
        parent.size += size
        parent.height = max(parent.height, height + 1)
        self._check_depth(event, height)
        if parent.size > MAX_VALUES:
            raise self._error(event, f"the file unfolds to more than {MAX_VALUES} values; use fewer aliases")

    def _check_depth(self, event: yaml.Event, below: int) -> None:
        if len(self._stack) + below > MAX_DEPTH:
            raise self._error(event, f"nested deeper than {MAX_DEPTH} levels")

    def _location(self) -> Location:
        if not self._stack:
            return ()
        parent = self._stack[-1]
        if isinstance(parent.value, list):
            return (*parent.location, len(parent.value))
        return parent.location if parent.key is None else (*parent.location, parent.key)

    def _error(self, event: yaml.Event, message: str) -> InputError:
        location = key_path(self._location()[:6])
        return InputError(f"{self.path}:{_line(event)}: {location + ': ' if location else ''}{message}")


def _line(event: yaml.Event) -> int:
    return 1 if event.start_mark is None else int(event.start_mark.line) + 1


def plain_value(text: str) -> Any:
    """Value of an unquoted scalar: nothing, true/false, whole number, number, else text."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


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

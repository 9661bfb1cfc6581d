"""A strict YAML reader: no duplicate keys, no tags, limited size; errors name file, line, key and remedy.

Files of ROS are read as ROS reads them: of a key that stands there twice the last one counts, with a warning, and
``!degrees 90`` is an angle.

Plain scalars are read as in YAML 1.2 (``1e-3`` is a number, ``yes`` and ``12:30`` are text). Events come from libyaml
if PyYAML has it. Locations of values are only computed when an error needs them.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from rrtik_ompl.base.errors import DescriptionWarning, InputError, RrtikError, few
from rrtik_ompl.files.text import file_name, read_text, write_text

Location: TypeAlias = tuple[str | int, ...]  # keys and list indices from the top: ("start", "joints", 2)

MAX_DEPTH = 40
MAX_VALUES = 1_000_000  # largest number of values with all aliases expanded
# The innermost lists and mappings are written on one line.
_STYLE: dict[str, Any] = {"default_flow_style": None, "allow_unicode": True}
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INTEGER = re.compile(r"[-+]?[0-9]{1,4000}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NUMBER_STARTS = frozenset("+-.0123456789")
ANGLES = {"!degrees": math.pi / 180.0, "!radians": 1.0}  # tags of ROS, and how many radians one of them is
_WORDS: dict[str, bool | float | None] = {"": None, "~": None}
_WORDS |= {form: value for word, value in {"null": None, "true": True, "false": False}.items()
           for form in (word, word.capitalize(), word.upper())}  # fmt: skip
_WORDS |= {form: float(form.replace(".", "")) for form in (".nan", ".NaN", ".NAN")}
_WORDS |= {sign + form: float(sign + "inf") for form in (".inf", ".Inf", ".INF") for sign in ("", "+", "-")}


def key_path(location: Location) -> str:
    """Return a location as people write it: ``obstacles[3].box`` for ``("obstacles", 3, "box")``."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return text.removeprefix(".")


def plain_value(text: str) -> bool | float | str | None:
    """Return the value of an unquoted scalar: None, true or false, an integer, a number, or otherwise text."""
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in _NUMBER_STARTS:
        return text
    if _INTEGER.fullmatch(text):
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


@dataclass(slots=True)
class Group:
    """A list or mapping of the file while it is read.

    Attributes:
        value: The list or mapping.
        line: Line where it begins, from 1.
        anchor: Its name for aliases.
        key: In a mapping, the key whose value comes next.
        size, height: Number of values and of levels when aliases are expanded.
        lines: The line of each entry, by its key or index.
        groups: Those of its entries that are lists or mappings, by key or index.
    """

    value: Any
    line: int
    anchor: str | None
    key: str | None = None
    size: int = 1
    height: int = 1
    lines: dict[str | int, int] = field(default_factory=dict)
    groups: dict[str | int, Group] = field(default_factory=dict)

    @property
    def place(self) -> str | int | None:
        """Key or index of the entry that comes next; None where a mapping expects a key."""
        return len(self.value) if type(self.value) is list else self.key

    def located(self, location: Location = ()) -> Iterator[tuple[Location, int]]:
        """Yield the location and line of each value in the group."""
        for place, line in self.lines.items():
            yield (*location, place), line
        for place, group in self.groups.items():
            yield from group.located((*location, place))


@dataclass(slots=True)
class Builder:
    """Builds values from parser events with its own stack, as the parser's composer overflows on deep nesting.

    Attributes:
        path: The file, for errors.
        ros: Whether it is a file of ROS.
        doubled: What is to be said of keys that stand there twice.
        top: The value of the document.
        group: The group of ``top`` if it is a list or mapping.
        documents: Number of documents that have begun.
    """

    path: Path
    ros: bool = False
    doubled: list[str] = field(default_factory=list)
    top: Any = None
    group: Group | None = None
    documents: int = 0
    _stack: list[Group] = field(default_factory=list)
    _anchors: dict[str, tuple[Any, int, int]] = field(default_factory=dict)  # value, size, height

    def read(self, text: str) -> None:
        """Read a whole file into ``top`` and ``group``.

        Raises:
            InputError: If the file breaks one of the rules.
            yaml.YAMLError: If it is not YAML.
        """
        next_event = _LOADER(text).get_event
        while (event := next_event()) is not None:
            kind = type(event)
            if kind is yaml.ScalarEvent:
                self._scalar(event)
            elif kind is yaml.SequenceStartEvent:
                self._open(event, [])
            elif kind is yaml.MappingStartEvent:
                self._open(event, {})
            elif kind is yaml.SequenceEndEvent or kind is yaml.MappingEndEvent:
                done = self._stack.pop()
                self._add(done.value, done.size, done.height, done.anchor, event)
            elif kind is yaml.AliasEvent:
                self._alias(event)
            elif kind is yaml.DocumentStartEvent:
                self.documents += 1
                if self.documents > 1:
                    raise self._error(event, "a second document starts here ('---'); put one in a file")

    def _scalar(self, event: yaml.ScalarEvent) -> None:
        # A scalar is a key where a mapping expects one, otherwise a value.
        parent = self._stack[-1] if self._stack else None
        text = event.value
        if parent is not None and parent.key is None and type(parent.value) is dict:
            self._check_untagged(event)
            if text in parent.lines:
                said = f"key '{text}' stands here twice (first in line {parent.lines[text]})"
                if not self.ros:
                    raise self._error(event, f"{said}; delete one")
                self.doubled.append(f"{self.path}:{_line(event)}: {said}; the last one counts")
                parent.groups.pop(text, None)
            parent.key = text
            parent.lines[text] = _line(event)
        else:
            self._add(self._value(event), 1, 1, event.anchor, event)

    def _value(self, event: yaml.ScalarEvent) -> object:
        """Return the value of a scalar: an angle [rad] if ROS's tag says so."""
        if not self.ros or event.tag not in ANGLES:
            self._check_untagged(event)
            return plain_value(event.value) if event.implicit[0] else event.value

        angle = plain_value(event.value)
        if isinstance(angle, bool) or not isinstance(angle, (int, float)):
            raise self._error(event, f"{event.tag} needs a number, found {describe(angle)}")
        return angle * ANGLES[event.tag]

    def _check_untagged(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent) -> None:
        if event.tag is not None:
            raise self._error(event, f"tag '{event.tag}' cannot be used; write the value alone")

    def _open(self, event: yaml.CollectionStartEvent, value: object) -> None:
        # Push a list or mapping that begins; it is added to its parent when it ends.
        self._check_untagged(event)
        parent = self._stack[-1] if self._stack else None
        group = Group(value, _line(event), event.anchor)
        if parent is None:
            self.group = group
        else:
            place = self._place(parent, event)
            parent.lines.setdefault(place, group.line)
            parent.groups[place] = group

        self._stack.append(group)
        if len(self._stack) > MAX_DEPTH:
            raise self._too_deep(event)

    def _alias(self, event: yaml.AliasEvent) -> None:
        if self._stack:
            self._place(self._stack[-1], event)
        if event.anchor not in self._anchors:
            raise self._error(event, f"alias '*{event.anchor}' stands for nothing that ended before it")
        self._add(*self._anchors[event.anchor], None, event)

    def _place(self, parent: Group, event: yaml.Event) -> str | int:
        """Return the key or index of the next value of a group."""
        if (place := parent.place) is None:
            raise self._error(event, "a key must be a word, found a list or a group")
        return place

    def _add(self, value: object, size: int, height: int, anchor: str | None, event: yaml.Event) -> None:
        """Store a finished value in its parent and update the parent's size and height with aliases expanded.

        Args:
            value: The value.
            size: Number of values in it.
            height: Number of levels in it.
            anchor: Its name for aliases, or None.
            event: The event that ended it, for the line in errors.
        """
        if anchor is not None:
            self._anchors[anchor] = (value, size, height)

        if not self._stack:
            self.top = value
            return

        parent = self._stack[-1]
        if parent.key is None:
            parent.lines.setdefault(len(parent.value), _line(event))
            parent.value.append(value)
        else:
            parent.value[parent.key] = value
            parent.key = None

        parent.size += size
        if height >= parent.height:
            parent.height = height + 1

        if len(self._stack) + height > MAX_DEPTH:
            raise self._too_deep(event)
        if parent.size > MAX_VALUES:
            raise self._error(event, f"the file unfolds to more than {MAX_VALUES} values; use fewer aliases")

    def _too_deep(self, event: yaml.Event) -> InputError:
        return self._error(event, f"nested deeper than {MAX_DEPTH} levels")

    def _error(self, event: yaml.Event, message: str) -> InputError:
        places = [group.place for group in self._stack[:6]]
        location = key_path(tuple(place for place in places if place is not None))
        return InputError(f"{self.path}:{_line(event)}: {location + ': ' if location else ''}{message}")


def _line(event: yaml.Event) -> int:
    return event.start_mark.line + 1  # type: ignore[union-attr]  # every event of a parser has a mark


@dataclass(frozen=True, slots=True, eq=False)
class YamlDocument:
    """A YAML file that was read: its values and their locations.

    Attributes:
        path: The file, as it was named by the caller.
        data: The top-level mapping.
        top: The lines of all its values.
    """

    path: Path
    data: dict[str, Any]
    top: Group

    @property
    def lines(self) -> Mapping[Location, int]:
        """Line number (from 1) of each location."""
        return {(): self.top.line, **dict(self.top.located())}

    def place(self, location: Location) -> str:
        """Return ``FILE:LINE: key.path`` of a location; the line is that of its nearest parent in the file."""
        known = location
        lines = self.lines
        while known not in lines:
            known = known[:-1]
        where = f"{self.path}:{lines[known]}"
        return f"{where}: {key_path(location)}" if location else where

    def error(self, location: Location, message: str) -> InputError:
        """Return an error about the value at a location."""
        return InputError(f"{self.place(location)}: {message}")

    @contextmanager
    def at(self, location: Location) -> Iterator[None]:
        """Prepend file, line and key to errors of this library that are raised inside the ``with`` block."""
        try:
            yield
        except RrtikError as error:
            if not str(error).startswith(f"{self.path}:"):
                said = str(error).removeprefix(f"{location[-1]}: " if location else "")
                error.args = (f"{self.place(location)}: {said}",)  # keeps the class and its data
            raise


def read_yaml(path: str | os.PathLike[str], *, ros: bool = False) -> YamlDocument:
    """Read a YAML file whose top level is a mapping.

    Args:
        path: The file.
        ros: Whether it is a file of ROS: ``!degrees`` and ``!radians`` are angles in it, and of a key that stands there
            twice the last one counts.

    Warns:
        DescriptionWarning: If a key stands in a file of ROS twice.

    Raises:
        InputError: If the file cannot be read, is not valid YAML, is empty, is not a mapping, holds a key twice, uses
            tags, is nested deeper than 40 levels, or unfolds to more than a million values.
    """
    file = file_name(path)
    text = read_text(path)
    builder = Builder(file, ros)

    try:
        builder.read(text)
    except yaml.MarkedYAMLError as error:
        if "nesting depth" in (error.problem or ""):  # libyaml has a limit of its own
            raise InputError(f"{path}: nested deeper than {MAX_DEPTH} levels") from error
        raise InputError(_syntax(file, text, error)) from error
    except yaml.YAMLError as error:  # most often because of a control character
        raise InputError(f"{path}: not valid YAML: {str(error).splitlines()[0]}; is it a text file?") from error

    if not builder.documents or builder.top is None:
        raise InputError(f"{path}: the file is empty; it must hold 'key: value' lines")
    if builder.group is None or not isinstance(builder.top, dict):
        raise InputError(f"{path}:1: the top level must be 'key: value' lines, found {describe(builder.top)}")

    if builder.doubled:
        warnings.warn(DescriptionWarning(few(builder.doubled, 2)), stacklevel=2)
    return YamlDocument(file, builder.top, builder.group)


def write_yaml(path: str | os.PathLike[str], data: Mapping[str, Any]) -> None:
    """Write a mapping of plain values as YAML, completely or not at all; numbers read back bit for bit.

    Raises:
        InputError: If the file cannot be written.
    """
    write_text(path, yaml.dump(dict(data), Dumper=_Dumper, sort_keys=False, width=110, **_STYLE))


def describe(value: object) -> str:
    """Describe a value for an error message: ``text 'abc'``, ``a list of 3``, ``nothing``."""
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
    """Describe a syntax error with the line where it is, or where an unclosed quote or bracket begins."""
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

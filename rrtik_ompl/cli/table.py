"""Text that fits a terminal: lines that fold at words, and tables that fold at columns."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Collection, Iterable, Sequence
from itertools import takewhile
from typing import NamedTuple, TextIO, TypeAlias
from unicodedata import east_asian_width

USUAL_WIDTH = 80  # width of a table where no terminal and no COLUMNS says how much room there is
LEAST_WIDTH = 20  # narrower terminals are treated as if they were this wide
NOTHING, HEADS, TEXTS = range(3)  # what is broken at words: nothing, headings, or also the cells of columns of text
WHOLE = ((3, NOTHING), (2, NOTHING), (2, HEADS), (1, HEADS), (2, TEXTS), (1, TEXTS))  # gap, and what is broken
BLOCK = ((2, NOTHING), (2, HEADS), (2, TEXTS))  # the same for the blocks of a folded table
INDENT = "  "  # of the second and further lines of a folded text


def columns_of(stream: TextIO) -> int | None:
    """Return how many columns a person sees of a stream: those of COLUMNS, or of its terminal; None without both."""
    told = os.environ.get("COLUMNS", "")
    if told.isdecimal() and int(told) > 0:
        return max(int(told), LEAST_WIDTH)

    try:
        found = os.get_terminal_size(stream.fileno()).columns
    except (AttributeError, OSError, ValueError):
        return None
    return max(found, LEAST_WIDTH) if found else None


def folded(text: str, columns: int | None) -> str:
    """Fold the lines of a text at blanks, with an indent; longer words, such as names of files, stay whole.

    Without a number of columns, each line stays one line, for whoever reads it by program.
    """
    if columns is None:
        return text

    lines = []
    for line in text.split("\n"):
        indent = " " * (len(line) - len(line.lstrip()))
        first, *others = _wrapped(re.findall(r"\S+\s*", line), columns - len(indent), len(INDENT)) or [""]
        lines += [indent + first, *(indent + INDENT + each for each in others)]
    return "\n".join(lines)


def short_names(names: Sequence[str]) -> tuple[str, list[str]]:
    """Return what names have in common, and the names without it.

    Example:
        >>> short_names(["panda_joint1", "panda_joint2"])
        ('panda_*', ['joint1', 'joint2'])
        >>> short_names(["azimuth", "elbow_pitch"])
        ('joint', ['azimuth', 'elbow_pitch'])
    """
    before = _beginning(names)
    after = _beginning([name[len(before) :][::-1] for name in names])[::-1]

    starts = [k for k in range(len(before), 0, -1) if not before[k - 1].isalnum()]
    ends = [k for k in range(len(after) + 1) if not after[k : k + 1].isalnum()]
    begin = next((k for k in starts if all(name[k : k + 1].isalpha() for name in names)), 0)
    end = len(after) - ends[0]

    short = [name[begin : len(name) - end] for name in names]
    if len(names) < 2 or not begin + end or not all(short):
        return "joint", list(names)
    return f"{before[:begin]}*{after[len(after) - end :]}", short


Choices: TypeAlias = Sequence[tuple[int, int]]


def _beginning(names: Sequence[str]) -> str:
    """Return the letters with which all names begin."""
    return "".join(letters[0] for letters in takewhile(lambda each: len(set(each)) == 1, zip(*names, strict=False)))


def joint_labels(names: Sequence[str], prismatic: Iterable[bool]) -> tuple[str, list[str]]:
    """Return the heading of a column of joints, and their short names; the unit stands once if all have the same."""
    from rrtik_ompl.base.units import shown_unit  # loads numpy, which not every command needs

    title, short = short_names(names)
    units = [shown_unit(slides)[1] for slides in prismatic]
    if len(set(units)) == 1:
        return f"{title} [{units[0]}]", short
    return title, [f"{name} [{unit}]" for name, unit in zip(short, units, strict=True)]


class Table:
    """A table of text that is as wide as its contents, or as the terminal.

    Where the terminal is narrower, gaps shrink, then headings are broken at words, then columns of text, and then the
    table is folded into blocks of columns, each with the first ones.

    Args:
        heads: Headings of the columns.
        right: Numbers of the columns of figures: these are aligned to the right, and never broken.
        keys: How many first columns tell what a row is: each block of a folded table has them.
    """

    def __init__(self, *heads: str, right: Collection[int] = (), keys: int = 1) -> None:
        self._heads = heads
        self._keys = keys
        self._rows: list[tuple[str, ...]] = []
        self._right = right

    def add_row(self, *cells: str) -> None:
        """Append a row."""
        self._rows.append(cells)

    def __str__(self) -> str:
        return self.fitted(columns_of(sys.stdout) or USUAL_WIDTH)

    def fitted(self, width: int) -> str:
        """Return the table as lines of at most ``width`` letters, between two empty lines."""
        cells = zip(*self._rows, strict=True) if self._rows else [()] * len(self._heads)
        columns = [
            _Column(head, tuple(column), number in self._right)
            for number, (head, column) in enumerate(zip(self._heads, cells, strict=True))
        ]

        keys = columns[: self._keys]
        rest = columns[self._keys :]
        if _layout(columns, width, WHOLE) is not None or not rest:
            return "\n".join(["", *_drawn(columns, width, WHOLE), ""])

        lines = [""]
        while rest:
            count = len(rest)
            while count > 1 and _layout([*keys, *rest[:count]], width, BLOCK) is None:
                count -= 1
            lines += [*_drawn([*keys, *rest[:count]], width, BLOCK), ""]
            rest = rest[count:]
        return "\n".join(lines)


class _Column(NamedTuple):
    """A column of a table."""

    head: str
    cells: tuple[str, ...]
    right: bool

    def least(self, broken: int) -> int:
        """Return the smallest width, if NOTHING, HEADS or TEXTS may be broken."""
        head = [self.head] if broken == NOTHING else _pieces_of_head(self.head)
        words = broken == TEXTS and not self.right
        cells = [word for cell in self.cells for word in cell.split()] if words else self.cells
        return max((_width(each.rstrip()) for each in (*head, *cells)), default=0)

    def lines_of_head(self, width: int) -> list[str]:
        """Return the heading as lines."""
        return _wrapped(_pieces_of_head(self.head), width)

    def lines_of_cell(self, row: int, width: int) -> list[str]:
        """Return a cell as lines."""
        cell = self.cells[row]
        return [cell] if _width(cell) <= width else _wrapped(re.findall(r"\S+\s*", cell), width)

    def padded(self, text: str, width: int) -> str:
        """Return a line of a cell with blanks before or after it."""
        blanks = " " * (width - _width(text))
        return blanks + text if self.right else text + blanks


def _layout(columns: Sequence[_Column], width: int, choices: Choices) -> tuple[list[int], int] | None:
    """Return widths of the columns and the gap between them, by the first choice that fits; None if none does."""
    for gap, broken in choices:
        widths = [column.least(NOTHING) for column in columns]
        least = [column.least(broken) for column in columns]
        room = width - 1 - gap * (len(columns) - 1)
        if sum(least) > room:
            continue

        while sum(widths) > room:  # the widest column of those that can be narrower gives way
            widest = max((k for k in range(len(widths)) if widths[k] > least[k]), key=widths.__getitem__)
            widths[widest] -= 1
        return widths, gap
    return None


def _drawn(columns: Sequence[_Column], width: int, choices: Choices) -> list[str]:
    """Return the lines of a table or of a block of it; too wide ones if it does not fit."""
    widths, gap = _layout(columns, width, choices) or ([column.least(TEXTS) for column in columns], choices[-1][0])

    def lines(cells: list[list[str]], *, below: bool = False) -> list[str]:
        height = max(map(len, cells))
        filled = [[""] * (height - len(each)) + each if below else each + [""] * (height - len(each)) for each in cells]
        rows = [map(_Column.padded, columns, row, widths) for row in zip(*filled, strict=True)]
        return [f" {(' ' * gap).join(row)}".rstrip() for row in rows]

    rule = "\u2500" if (sys.stdout.encoding or "").lower().startswith("utf") else "-"
    drawn = lines(list(map(_Column.lines_of_head, columns, widths)), below=True)
    drawn.append(f" {rule * (sum(widths) + gap * (len(widths) - 1))}")

    for row in range(len(columns[0].cells)):
        drawn += lines([column.lines_of_cell(row, each) for column, each in zip(columns, widths, strict=True)])
    return drawn


def _pieces_of_head(head: str) -> list[str]:
    """Return the parts between which a heading may be broken: names of joints also after an underline."""
    return re.findall(r"[^\s_]*[\s_]+|[^\s_]+", head)


def _wrapped(pieces: Sequence[str], width: int, indent: int = 0) -> list[str]:
    """Join pieces, each with the blanks after it, to lines of at most ``width`` letters.

    Lines after the first are shorter by ``indent``. A piece that is longer than a line is a line of its own.
    """
    lines: list[str] = []
    for piece in pieces:
        room = width - (indent if len(lines) > 1 else 0)
        if lines and _width((lines[-1] + piece).rstrip()) <= room:
            lines[-1] += piece
        else:
            lines.append(piece)
    return [line.rstrip() for line in lines] or [""]


def _width(text: str) -> int:
    """Return the number of terminal columns that a text occupies."""
    return sum(2 if east_asian_width(letter) in "WF" else 1 for letter in text)

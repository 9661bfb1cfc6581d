"""Figures of the house: rooms and their modules, imports between rooms, circles, complexity, untyped values.

    python bench/house.py [--json]

Prints what is measured beside its bound; exit code 1 if a bound is broken. ``tests/house`` holds the same bounds.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import sys
import textwrap
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from house_imports import (
    LIBRARY,
    REPOSITORY,
    knots,
    module_graph,
    module_name,
    place,
    room_arrows,
    room_of,
    sources,
    tree_of,
)

KERNEL_DECORATORS = {"kernel", "entry", "inlined", "intrinsic", "overload", "type_callable", "lower_builtin"}
INTRINSICS = tuple(f"rrtik_ompl/kernels/simd/{name}.py" for name in ("lanes", "wide_lanes", "access"))  # kernels' words
COMMANDS = REPOSITORY / LIBRARY / "cli"  # each option of a command is a parameter, and the caller is typer
BOUNDS = {
    "cyclomatic complexity": 15,
    "positional parameters": 8,
    "circles of imports": 0,
    "repeated runs of logic": 0,
    "files with private sources": 0,
    "signatures with bare Any": 116,  # a third of those of version 0.1
}
REPEATED_LINES = 6  # of statements in a row, the same but for layout and comments
BRANCHES = (ast.If, ast.For, ast.While, ast.ExceptHandler, ast.IfExp, ast.Assert, ast.match_case, ast.comprehension)
TEXTS = (".py", ".md", ".yaml", ".js", ".html")
WORDS = (  # names of sources that no reader can look up; REFERENCES.md has them by number
    *("C-RDT paper", "GA-REB paper", "IKURT paper", "DRRT-Con paper", "MB-RRT paper", "post-processing paper"),
    *("shared-control tool", "the specification", "kinematics specification", "Post-processing page", "test plan"),
)


@dataclass(frozen=True, slots=True)
class Finding:
    """One measured value: which of ``BOUNDS``, where, how much."""

    what: str
    where: str
    value: int

    @property
    def broken(self) -> bool:
        """Whether it is beyond its bound."""
        return self.value > BOUNDS[self.what]


def functions(file: Path) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    """Every function of a file, with its place."""
    for node in ast.walk(tree_of(file)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield f"{place(file)}:{node.lineno} {node.name}", node


def decorators(node: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    """Names of a function's decorators, without what stands before the last dot."""
    calls = [item.func if isinstance(item, ast.Call) else item for item in node.decorator_list]
    return {item.attr if isinstance(item, ast.Attribute) else getattr(item, "id", "") for item in calls}


def complexity(node: ast.AST) -> int:
    """Cyclomatic complexity: one more than the places where control or a condition branches."""
    count = 1
    for inner in ast.walk(node):
        if isinstance(inner, ast.BoolOp):
            count += len(inner.values) - 1
        elif isinstance(inner, BRANCHES):
            count += 1 + (len(inner.ifs) - 1 if isinstance(inner, ast.comprehension) else 0)
    return count


def complexities() -> Iterator[Finding]:
    """Cyclomatic complexity of every function."""
    for file in sources():
        for where, node in functions(file):
            yield Finding("cyclomatic complexity", where, complexity(node))


def parameters() -> Iterator[Finding]:
    """Parameters that are not keyword-only, ``self`` not counted, outside kernels and commands."""
    for file in sources():
        for where, node in functions(file):
            if not decorators(node) & KERNEL_DECORATORS and file.parent != COMMANDS:
                names = [item.arg for item in node.args.posonlyargs + node.args.args]
                yield Finding("positional parameters", where, len(names) - (names[:1] in (["self"], ["cls"])))


def bare_any() -> Finding:
    """Signatures outside kernels in which a parameter or the result is ``Any`` itself."""
    rooms: Counter[str] = Counter()
    for file in (file for file in sources() if place(file) not in INTRINSICS):
        for _, node in functions(file):
            own = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            annotations = [item.annotation for item in own] + [node.returns]
            if not decorators(node) & KERNEL_DECORATORS and any(is_any(item) for item in annotations):
                rooms[room_of(module_name(file)).removeprefix(f"{LIBRARY}.")] += 1
    where = ", ".join(f"{room} {count}" for room, count in rooms.most_common())
    return Finding("signatures with bare Any", where, rooms.total())


def is_any(annotation: ast.expr | None) -> bool:
    """Whether an annotation is ``Any`` itself, or ``Any`` or something else."""
    if isinstance(annotation, ast.BinOp):
        return is_any(annotation.left) or is_any(annotation.right)
    return isinstance(annotation, ast.Name) and annotation.id == "Any"


def circles() -> Finding:
    """Groups of modules that import each other."""
    groups = knots(module_graph())
    return Finding("circles of imports", " · ".join(" <-> ".join(group) for group in groups), len(groups))


def repeated_runs() -> Finding:
    """Runs of statements that stand in two places, the same but for layout and comments."""
    places: dict[str, list[tuple[str, int]]] = defaultdict(list)
    for file in sources():
        for node in ast.walk(tree_of(file)):
            for body in (getattr(node, name, None) for name in ("body", "orelse", "finalbody")):
                if isinstance(body, list) and not isinstance(node, ast.Module | ast.ClassDef):
                    _add_runs(places, place(file), body)
    twice = sorted(
        {" = ".join(f"{file}:{line}" for file, line in found) for found in places.values() if len(found) > 1}
    )
    return Finding("repeated runs of logic", " · ".join(twice), len(twice))


def _add_runs(places: dict[str, list[tuple[str, int]]], file: str, body: list[ast.stmt]) -> None:
    plain = [item for item in body if not _is_text(item) and not isinstance(item, ast.Import | ast.ImportFrom)]
    texts = [ast.unparse(item).splitlines() for item in plain]
    for first, item in enumerate(plain):
        lines: list[str] = []
        for text in texts[first:]:
            lines += text
            if len(lines) >= REPEATED_LINES:
                places["\n".join(lines)].append((file, item.lineno))
                break


def _is_text(item: ast.stmt) -> bool:
    return isinstance(item, ast.Expr) and isinstance(item.value, ast.Constant)


def words() -> Finding:
    """Words that name a source which no reader can look up."""
    folders = [LIBRARY, "planners", "robots", "tests", "bench", "docs"]
    inside = [file for folder in folders for file in (REPOSITORY / folder).rglob("*") if file.suffix in TEXTS]
    files = [*REPOSITORY.glob("*.md"), *(file for file in inside if file != Path(__file__))]
    found = [
        place(file) for file in files if re.search("|".join(WORDS), " ".join(file.read_text().split()), re.IGNORECASE)
    ]
    return Finding("files with private sources", " ".join(found), len(found))


def findings() -> list[Finding]:
    """Everything that is measured."""
    return [
        *complexities(),
        *parameters(),
        bare_any(),
        circles(),
        repeated_runs(),
        words(),
    ]


def report(found: list[Finding]) -> str:
    """The largest value of each kind beside its bound, and everything that is beyond it."""
    lines = []
    for what, bound in BOUNDS.items():
        mine = [item for item in found if item.what == what]
        worst = max(mine, key=lambda item: item.value)
        lines.append(f"{what:28} {worst.value:6} of {bound:4}   {worst.where if worst.value else ''}")
        lines += [f"    beyond: {item.value:5}   {item.where}" for item in mine if item.broken and item is not worst]
    return "\n".join(lines)


def rooms() -> str:
    """Modules of each room, and the imports that lead from it to others."""
    counts = Counter(room_of(module_name(file)) for file in sources())
    arrows = {room: sorted(targets.items()) for room, targets in room_arrows().items()}
    lines = []
    for room, count in sorted(counts.items()):
        targets = ", ".join(f"{target.removeprefix(f'{LIBRARY}.')} {number}" for target, number in arrows.get(room, []))
        lines += textwrap.wrap(f"{room:28}{count:4}   {targets}", 120, subsequent_indent=" " * 35)
    return "\n".join(["room                     modules   imports of other rooms", *lines])


def main() -> int:
    """Print the figures, rooms and arrows; 1 if a bound is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="all findings, for machines")
    options = parser.parse_args()
    found = findings()
    if options.json:
        print(json.dumps([{"what": item.what, "where": item.where, "value": item.value} for item in found]))
    else:
        print(f"{report(found)}\n\n{rooms()}")
    return int(any(item.broken for item in found))


if __name__ == "__main__":
    sys.exit(main())

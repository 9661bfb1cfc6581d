"""Which module imports which: at its top, in a function, by its name as text, through the face of the library."""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
SOURCE_ROOTS = ("rrtik_ompl", "planners/rrtik_planners", "robots/rrtik_robots", "bench/rrtik_bench")
LIBRARY = "rrtik_ompl"


@cache
def tree_of(file: Path) -> ast.Module:
    """The syntax tree of a source file."""
    return ast.parse(file.read_text(encoding="utf-8"))


def sources() -> list[Path]:
    """All source files of library, planners, robots and tables."""
    return sorted(file for root in SOURCE_ROOTS for file in (REPOSITORY / root).rglob("*.py"))


def module_name(file: Path) -> str:
    """The dotted name of a source file's module."""
    for root in SOURCE_ROOTS:
        folder = REPOSITORY / root
        if file.is_relative_to(folder):
            parts = (folder.name, *file.relative_to(folder).with_suffix("").parts)
            return ".".join(parts).removesuffix(".__init__")
    raise ValueError(f"{file} is in no source root")


def place(path: Path) -> str:
    """A path as seen from the repository."""
    return path.relative_to(REPOSITORY).as_posix()


@cache
def face_homes() -> dict[str, str]:
    """The module behind each name of the library's face."""
    homes = {}
    for node in ast.walk(tree_of(REPOSITORY / LIBRARY / "__init__.py")):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{LIBRARY}."):
            homes |= {alias.asname or alias.name: node.module for alias in node.names}
    return homes


@cache
def module_names() -> frozenset[str]:
    """Names of all modules."""
    return frozenset(module_name(file) for file in sources())


def imports(file: Path) -> set[str]:
    """Modules of ours that a file imports: at its top, in a function, by its name as text, through the face."""
    found: set[str] = set()
    faces = {"rrtik"}
    for node in ast.walk(tree_of(file)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
            faces |= {alias.asname or alias.name for alias in node.names if alias.name == LIBRARY}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {_home(node.module, alias.name) for alias in node.names}
        elif isinstance(node, ast.Call) and _called(node) in ("import_module", "__import__", "files"):
            found |= {_text(argument) for argument in node.args[:1]}
    for node in ast.walk(tree_of(file)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in faces:
            found |= {face_homes()[node.attr]} if node.attr in face_homes() else set()
    own = module_name(file)
    return {name for name in map(_known, found) if name and name != own}


def _home(module: str, name: str) -> str:
    """The module that an imported name comes from."""
    if module == LIBRARY and name in face_homes():
        return face_homes()[name]
    inner = f"{module}.{name}"
    return inner if inner in module_names() else module


def _called(node: ast.Call) -> str:
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _text(node: ast.expr) -> str:
    """A text as far as it is constant: an f-string up to its first value."""
    if isinstance(node, ast.JoinedStr):
        first = node.values[0]
        return str(first.value).rstrip(".") if isinstance(first, ast.Constant) else ""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def _known(name: str) -> str:
    """The longest part of a dotted name that is a module of ours, or nothing."""
    parts = name.split(".")
    found = (".".join(parts[:count]) for count in range(len(parts), 0, -1))
    return next((part for part in found if part in module_names()), "")


@cache
def arrows() -> dict[str, frozenset[str]]:
    """For each module the modules of ours that it imports, wherever it does."""
    return {module_name(file): frozenset(imports(file)) for file in sources()}


def room_of(module: str) -> str:
    """The room of a module: the folder below the library, the module itself in its root, else its source root."""
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] == LIBRARY else parts[0]


def room_arrows() -> dict[str, Counter[str]]:
    """For each room how many imports lead to each other room."""
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for module, targets in arrows().items():
        for target in targets:
            if room_of(module) != room_of(target):
                found[room_of(module)][room_of(target)] += 1
    return dict(found)


def module_graph() -> dict[str, set[str]]:
    """The arrows between modules, the face of the library left out."""
    return {module: {t for t in targets if t != LIBRARY} for module, targets in arrows().items() if module != LIBRARY}


def knots(graph: dict[str, set[str]]) -> list[list[str]]:
    """Groups of nodes that reach each other (strongly connected components of more than one node)."""
    reach = {node: _reached(graph, node) for node in graph}
    groups = {frozenset(other for other in reach[node] if node in reach.get(other, ())) for node in graph}
    return sorted(sorted(group) for group in groups if len(group) > 1)


def _reached(graph: dict[str, set[str]], start: str) -> set[str]:
    seen: set[str] = set()
    open_ = [start]
    while open_:
        fresh = graph.get(open_.pop(), set()) - seen
        seen |= fresh
        open_ += fresh
    return seen

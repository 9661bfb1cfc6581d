"""Which module imports which: at its top, in a function, by its name as text, through the face of the library."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
SOURCE_ROOTS = ("rrtik_ompl", "planners/rrtik_planners", "robots/rrtik_robots", "bench/rrtik_bench")
LIBRARY, SHORT_NAME = "rrtik_ompl", "rrtik"
KERNELS = f"{LIBRARY}.fast"
LADDER_MARKS = "<!-- ladder", "<!-- end of ladder -->"
FLOOR = re.compile(r"^\| *\d+ *\| *([^|]+?) *\|", re.MULTILINE)
ROOT_ROW = re.compile(r"^\| *`[^|]*` *\| *`(rrtik_\w+)`[^|]*\|[^|]*\| *([^|]+?) *\|", re.MULTILINE)


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
def module_names() -> frozenset[str]:
    """Names of all modules."""
    return frozenset(module_name(file) for file in sources())


@cache
def face_homes() -> dict[str, dict[str, str]]:
    """For each face the module behind each of its names; a face is an ``__init__`` that only looks its names up."""
    homes: dict[str, dict[str, str]] = {}
    for file in sources():
        if file.name == "__init__.py" and any(_defines_getattr(node) for node in ast.walk(tree_of(file))):
            package = module_name(file)
            homes[package] = {}
            for node in ast.walk(tree_of(file)):
                if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{package}."):
                    homes[package] |= {alias.asname or alias.name: node.module for alias in node.names}
    return homes


def _defines_getattr(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef) and node.name == "__getattr__"


def imports(file: Path) -> set[str]:
    """Modules of ours that a file imports: at its top, in a function, by its name as text, through a face."""
    own = module_name(file)
    nodes = list(ast.walk(tree_of(file)))
    found: set[str] = set()
    for node in nodes:
        found |= _imported(node, own)
    faces = _names_of_faces(nodes)
    for node in nodes:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in faces:
            found.add(face_homes()[faces[node.value.id]].get(node.attr, ""))
    return {name for name in map(_known, found) if name and name != own}


def _imported(node: ast.AST, own: str) -> set[str]:
    """What one statement or call imports, as dotted names."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names if alias.name not in face_homes()}
    if isinstance(node, ast.ImportFrom):
        module = _absolute(node, own)
        return {_home(module, alias.name) for alias in node.names}
    if not isinstance(node, ast.Call):
        return set()
    called, texts = _called(node), [_text(argument) for argument in node.args[:1]]
    if called in ("import_module", "__import__"):
        return set(texts)
    if called == "files":  # a package's data; its own are no import
        return {text for text in texts if not f"{own}.".startswith(f"{text}.")}
    if called == "library":  # a library of kernels, named from the folder of kernels
        return {f"{KERNELS}.{text}" for text in texts if f"{KERNELS}.{text}" in module_names()}
    return set()


def _names_of_faces(nodes: list[ast.AST]) -> dict[str, str]:
    """Names by which a file calls faces, such as ``rrtik`` after ``import rrtik_ompl as rrtik``."""
    names = {}
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                face = LIBRARY if alias.name == SHORT_NAME else alias.name
                if face in face_homes():
                    names[alias.asname or alias.name] = face
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name: module for name, module in inner.items() if module in face_homes()}
    return names


def _absolute(node: ast.ImportFrom, own: str) -> str:
    """The module of a ``from`` import, also of one with leading dots."""
    if not node.level:
        return LIBRARY if node.module == SHORT_NAME else node.module or ""
    package = own.split(".")[: len(own.split(".")) - node.level]
    return ".".join([*package, *([node.module] if node.module else [])])


def _home(module: str, name: str) -> str:
    """The module that an imported name comes from."""
    inner = f"{module}.{name}"
    return inner if inner in module_names() else face_homes().get(module, {}).get(name, module)


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
    """The arrows between modules, faces left out."""
    faces = face_homes()
    inner = {module: targets for module, targets in arrows().items() if module not in faces}
    return {module: {target for target in targets if target not in faces} for module, targets in inner.items()}


def floors() -> list[list[str]]:
    """Modules and rooms of the library, floor by floor from below, as ARCHITECTURE.md lists them."""
    return [[name.strip() for name in row.split(",")] for row in FLOOR.findall(_architecture(*LADDER_MARKS))]


def floor_of_root() -> dict[str, str]:
    """What each source root may import of the library, in the words of ARCHITECTURE.md, by its package."""
    return dict(ROOT_ROW.findall(_architecture("## Source roots", "##")))


def _architecture(begin: str, end: str) -> str:
    text = (REPOSITORY / "ARCHITECTURE.md").read_text(encoding="utf-8")
    return text.partition(begin)[2].partition(end)[0]


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

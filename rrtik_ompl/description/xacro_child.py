"""Expand macros in a separate process, which evaluates only what is on a list and reads only certain files.

It is started as a script, reads its job as JSON from standard input, and writes its answer as JSON to standard output.
"""

from __future__ import annotations

import builtins
import html
import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

TRUST = "if you trust whoever wrote it, give trust_xacro=True (--trust-xacro)"
Package: TypeAlias = Any  # xacro, which has no types
Value: TypeAlias = Any  # value of an expression
# Kinds of files that may be read in folders above the robot's that are not packages.
READABLE = (".xacro", ".urdf", ".srdf", ".xml", ".yaml", ".yml")
MACRO_FUNCTIONS = (
    "abs_filename", "arg", "dotify", "error", "fatal", "load_yaml", "message", "print_location", "tokenize", "warning",
)  # fmt: skip
UNDEFINED = re.compile(r"Undefined substitution argument (\w+)")  # xacro's words for an argument without a value
FORBIDDEN = re.compile(
    r"os\.(exec|fork|forkpty|posix_spawn|spawn|startfile|system|kill|remove|rename|rmdir|mkdir|link|symlink|truncate"
    r"|chmod|chown|putenv)|subprocess\.|shutil\.|socket\.|ctypes\.|pty\.|webbrowser\.|urllib\.|ftplib\."
)  # audit events of Python that are not allowed


class Places:
    """Knows which files macros may read, where packages are, and where in the files an expression is.

    Macros may read files in the robot's package, in the packages given or found, and visible ones below the file's
    folder; and descriptions (``READABLE``) up to two folders above, but not in all of the user's home or disk.
    """

    def __init__(self, file: str, packages: Iterable[str]) -> None:
        from rrtik_ompl.description.package_path import Packages

        resolved = Path(file).resolve()
        own_package = _package_of(resolved)
        self.folder = resolved.parent
        given = [Path(folder) for folder in packages]
        self.packages = Packages(given, self.folder)
        self.roots = given if own_package is None else [own_package, *given]
        self.folders_of_file = [self.folder, Path(file).absolute().parent]

        home = own_package or self.folder
        home_folder = Path.home()  # A folder that contains the home folder is too wide to be a robot's.
        self.folders_above = [
            folder for folder in (home, *list(home.parents)[:2]) if not home_folder.is_relative_to(folder)
        ]
        self.read: list[str] = []

    def find(self, name: str, usual: Callable[[str], Any]) -> str:
        """Return the folder of a package, for ``$(find NAME)``; ``usual`` is xacro's own search, the last resort."""
        plain = re.fullmatch(r"\w[\w.-]*", name) is not None
        found = self.packages.find(name) if plain else None

        if found is None:
            try:
                found = Path(str(usual(name)))
            except ImportError:
                raise LookupError(f"package '{name}' is not found; give packages=[the folder that holds it]") from None
            self.roots.append(found)
        elif (found / "package.xml").is_file():
            self.roots.append(found)
        return str(found)

    def check(self, path: str) -> None:
        """Raise an error for a file outside the allowed folders; missing files are left to whoever opens them."""
        from rrtik_ompl.description.xacro_expression import Refused

        if not os.path.exists(path) or self._is_readable(path):
            return
        raise Refused(f"'{path}' is outside the folders of the robot; give packages=[its package], or {TRUST}")

    def _is_readable(self, path: str) -> bool:
        """Check whether a file is in a folder that macros may read."""
        resolved = Path(path).resolve()
        if any(resolved.is_relative_to(root.resolve()) for root in self.roots):
            return True
        if any(_visible_below(resolved, folder) for folder in self.folders_of_file):
            return True
        if resolved.suffix.lower() in READABLE and any(
            _visible_below(resolved, folder) for folder in self.folders_above
        ):
            return True

        # Installed packages of ROS may be symbolic links to their sources, which are packages as well.
        written = Path(os.path.abspath(path))
        in_written_root = any(written.is_relative_to(root.absolute()) for root in [*self.roots, *self.folders_of_file])
        return in_written_root and _package_of(resolved) is not None

    def line_of(self, text: str, files: Iterable[str | None]) -> str:
        """Return ``FILE:LINE`` of a text in the first file that contains it; just the first file if none does."""
        pattern = re.compile(r"\s+".join(re.escape(word) for word in text.split()))
        candidates = [file for file in dict.fromkeys([*files, *self.read]) if file]
        for file in candidates:
            try:
                content = html.unescape(Path(file).read_text("utf-8", "replace"))
            except OSError:
                continue
            if text.strip() and (found := pattern.search(content)):
                return f"{file}:{content.count(chr(10), 0, found.start()) + 1}"
        return candidates[0] if candidates else ""


def _visible_below(file: Path, folder: Path) -> bool:
    """Check whether a file lies below a folder, with no hidden folder or file on the way."""
    if not file.is_relative_to(folder):
        return False
    return not any(part.startswith(".") for part in file.relative_to(folder).parts)


def _package_of(file: Path) -> Path | None:
    return next((folder for folder in file.parents if (folder / "package.xml").is_file()), None)


def expand(job: Mapping[str, Any]) -> dict[str, Any]:
    """Do the job: return ``{"text": .., "files": [..]}``, or ``{"error": .., "where": ..}``."""
    import xacro
    from xacro import substitution_args

    places = Places(job["file"], job["packages"])
    usual = substitution_args._eval_find
    substitution_args._eval_find = substitution_args._eval_dict["find"] = lambda name: places.find(name, usual)

    if not job["trust"]:
        _restrict(xacro, substitution_args, places)
    _note_places(xacro, places)

    try:
        text = xacro.process_file(job["file"], mappings=dict(job["arguments"])).toxml()
    except (Exception, SystemExit) as error:  # Macros may raise anything.
        return _error_answer(error, job)

    if len(text) > job["longest"]:
        return {"error": f"expands to more than {job['longest'] // 2**20} MiB"}
    return {"text": text, "files": [job["file"], *xacro.all_includes]}


def _restrict(xacro: Package, substitution_args: Package, places: Places) -> None:
    """Make xacro evaluate expressions by our evaluator only, and open only allowed files.

    Functions of xacro's modules are replaced, and Python's eval, exec and compile are blocked in them.
    """
    from rrtik_ompl.description.xacro_expression import FUNCTIONS, MATHEMATICS, Evaluator, Refused

    symbols = xacro._global_symbols
    for space, names in ((symbols, ("range", "sorted")), (symbols["python"], ("range", "type"))):
        for name in names:
            dict.__setitem__(space, name, FUNCTIONS[name])

    allowed_functions = [
        space[name] for space in (symbols, symbols["xacro"]) for name in MACRO_FUNCTIONS if name in space
    ]

    def argument(name: str) -> Value:
        given = xacro.substitution_args_context["arg"]
        return substitution_args.convert_value(substitution_args._eval_arg(name, given), "auto")

    words = {name: substitution_args._eval_dict[name] for name in ("env", "optenv", "find", "true", "false")}
    words |= {"arg": argument, **MATHEMATICS}
    allowed_functions += [word for word in words.values() if callable(word)]
    evaluator = Evaluator(allowed_functions, spaces=(xacro.NameSpace,), records=(xacro.YamlDictWrapper,))

    def evaluated(expression: str, symbols: Value, local: object = None) -> Value:
        return evaluator.value(expression, symbols.__getitem__)

    def substituted(expression: str, context: Mapping[str, Any]) -> str:
        def lookup(name: str) -> Value:
            if name in words:
                return words[name]
            if name in context["arg"]:
                return substitution_args.convert_value(context["arg"][name], "auto")
            return FUNCTIONS[name]

        return str(evaluator.value(expression, lookup))

    def opened(path: str, *mode: str) -> Value:
        places.check(path)
        places.read.append(path)
        return builtins.open(path)

    def refused(*_: object, **__: object) -> Value:
        raise Refused("this version of the package xacro evaluates by itself; pip install xacro==2.1.1")

    xacro.safe_eval = evaluated
    substitution_args._eval = substituted
    for module in (xacro, substitution_args):
        module.open = opened
        module.eval = module.exec = module.compile = refused

    sys.addaudithook(_forbid)


def _forbid(event: str, arguments: tuple[Any, ...]) -> None:
    """Block, as an audit hook, what starts programs, sends or writes: the last defence behind the evaluator."""
    writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
    if writes or FORBIDDEN.match(event):
        raise PermissionError(f"macros may not do this: {event}")


def _note_places(xacro: Package, places: Places) -> None:
    """Wrap functions of xacro so that errors carry the expression, and the place in the file, that caused them."""

    def noting(function: Callable[..., Any], text_of: Callable[[Any], str]) -> Callable[..., Any]:
        def noted(subject: Value, *others: Value) -> Value:
            before = xacro.filestack[-1]
            try:
                return function(subject, *others)
            except Exception as error:
                if not hasattr(error, "place"):
                    macros = [macro.history[-1][-1] for macro in reversed(xacro.macrostack)]
                    error.place = places.line_of(text_of(subject), [before, *macros])  # type: ignore[attr-defined]
                    error.expression = text_of(subject)  # type: ignore[attr-defined]
                raise

        return noted

    xacro.safe_eval = noting(xacro.safe_eval, str)
    xacro.eval_extension = noting(xacro.eval_extension, str)
    xacro.process_include = noting(xacro.process_include, lambda element: element.getAttribute("filename"))


def _error_answer(error: BaseException, job: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answer for an error: the message of the innermost error, and where it happened."""
    from rrtik_ompl.description.xacro_expression import Refused, shown

    chain = [error]
    while (inner := getattr(chain[-1], "exc", None)) is not None and inner not in chain:
        chain.append(inner)

    placed_errors = [raised for raised in chain if hasattr(raised, "place")]
    location = placed_errors[-1].place if placed_errors else ""
    innermost = chain[-1]

    if isinstance(innermost, MemoryError):
        return {"where": location, "error": f"needs more than {job['bytes'] / 1e9:g} GB of memory; {job['more']}"}
    if isinstance(innermost, RecursionError):
        return {"where": location, "error": "macros or expressions are nested too deeply; does one call itself?"}
    if isinstance(innermost, Refused):
        message = str(innermost)
        if "trust_xacro" not in message:
            expression = placed_errors[-1].expression  # type: ignore[attr-defined]
            message = f"expression '{shown(expression)}': {message}; write it otherwise, or {TRUST}"
        return {"where": location, "error": message}

    # Xacro says a LookupError twice, of which it is the cause.
    message = " ".join(str(innermost if type(innermost) is LookupError else error).split()) or type(error).__name__
    if lacking := UNDEFINED.search(message):
        message += f'; give xacro_args={{"{lacking[1]}": ...}}'
    return {"where": location, "error": message}


def _limit(seconds: float, memory: float) -> None:
    """Limit the processor time and the memory of this process by the operating system; Windows has no such limits."""
    try:
        import resource
    except ImportError:
        return

    whole_seconds = int(seconds) + 1
    for kind, wanted in (
        (resource.RLIMIT_CPU, whole_seconds),
        (resource.RLIMIT_AS, int(memory)),
        (resource.RLIMIT_CORE, 0),
    ):
        _, highest = resource.getrlimit(kind)
        granted = wanted if highest == resource.RLIM_INFINITY else min(wanted, highest)
        try:
            resource.setrlimit(kind, (granted, highest))
        except (OSError, ValueError):  # macOS supports no limit of memory.
            continue


def main() -> None:
    """Read the job, do it, and write the answer."""
    job = json.load(sys.stdin)
    sys.path[:] = job["path"]
    _limit(job["seconds"], job["bytes"])

    answer_to = os.fdopen(os.dup(1), "w")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):  # Output of macros must not mix with the answer.
        os.dup2(nowhere, number)

    try:
        answer = expand(job)
    except MemoryError:
        answer = {"error": f"needs more than {job['bytes'] / 1e9:g} GB of memory; {job['more']}"}

    json.dump(answer, answer_to)
    answer_to.close()


if __name__ == "__main__":
    main()

"""Evaluate expressions of macros by walking their syntax trees: what is not implemented here cannot be executed.

Supported are arithmetic, comparisons, conditions, text, lists, tuples, dictionaries, sets, indices, slices,
comprehensions, and calls of functions and methods that are listed here or passed in. Nothing is compiled or run by
Python itself. Numbers, texts and lists are bounded, so that a short expression cannot fill the memory.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from string import Formatter
from types import BuiltinMethodType
from typing import Any, TypeAlias

MOST_ITEMS = 1_000_000  # most items of a list or a range, and letters of a text made by one operation
MOST_BITS = 10_000  # most bits of a whole number
MOST_WIDTH = 1_000  # largest width to which a number is padded
MOST_SHOWN = 120  # most letters of an expression in a message

Value: TypeAlias = Any  # value of an expression: a number, text, list, function, ..
Lookup: TypeAlias = Callable[[str], Value]

METHODS: Mapping[type, frozenset[str]] = {
    str: frozenset([
        "capitalize", "count", "endswith", "find", "format", "index", "isalnum", "isalpha", "isdecimal", "isdigit",
        "islower", "isnumeric", "isspace", "isupper", "join", "lower", "lstrip", "partition", "removeprefix",
        "removesuffix", "replace", "rfind", "rindex", "rpartition", "rsplit", "rstrip", "split", "splitlines",
        "startswith", "strip", "swapcase", "title", "upper", "zfill",
    ]),
    list: frozenset(["append", "copy", "count", "extend", "index", "insert", "pop", "remove", "reverse", "sort"]),
    tuple: frozenset(["count", "index"]),
    dict: frozenset(["copy", "get", "items", "keys", "pop", "setdefault", "update", "values"]),
    set: frozenset([
        "copy", "difference", "intersection", "isdisjoint", "issubset", "issuperset", "symmetric_difference", "union",
        "add",
    ]),
    frozenset: frozenset(["copy", "difference", "intersection", "isdisjoint", "issubset", "issuperset", "union"]),
    float: frozenset(["is_integer"]),
    int: frozenset(["bit_length"]),
}  # fmt: skip
ARITHMETIC: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
SIGNS: Mapping[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
    ast.Invert: operator.invert,
}
COMPARISONS: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda item, group: item in group,
    ast.NotIn: lambda item, group: item not in group,
}


class Refused(Exception):
    """An expression contains something that is not on the list."""


def bounded_range(*ends: int) -> range:
    """Return a ``range`` of at most a million numbers.

    Raises:
        Refused: If it has more.
    """
    numbers = range(*ends)
    if len(numbers[: MOST_ITEMS + 1]) > MOST_ITEMS:  # len() of a huge range would overflow.
        raise Refused(f"a range of more than {MOST_ITEMS} numbers")
    return numbers


def type_of(value: object) -> type:
    """Return the type of a value: ``type`` without its other form, which makes new types."""
    return type(value)


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **{
        function.__name__: function
        for function in (
            abs, all, any, bool, complex, dict, divmod, enumerate, filter, float, frozenset, hash, int, isinstance,
            issubclass, len, list, map, max, min, ord, repr, reversed, round, set, slice, sorted, str, sum, tuple, zip,
        )
    },
    "range": bounded_range,
    "type": type_of,
}  # fmt: skip
"""Functions of Python that expressions may call, by name."""
MATHEMATICS: Mapping[str, Any] = {name: value for name, value in vars(math).items() if not name.startswith("_")}
"""Functions and numbers of the module ``math``."""


class Evaluator:
    """Evaluates expressions.

    Args:
        functions: Functions that may be called besides `FUNCTIONS`, `MATHEMATICS` and the methods of values.
        spaces: Types whose attributes are their entries and nothing else: ``math.pi`` is ``math["pi"]``.
        records: Dictionaries whose attributes are their entries too, in addition to the methods of dictionaries.
    """

    def __init__(
        self,
        functions: Iterable[Callable[..., Any]] = (),
        spaces: tuple[type, ...] = (),
        records: tuple[type, ...] = (),
    ) -> None:
        callables = [*FUNCTIONS.values(), *(value for value in MATHEMATICS.values() if callable(value)), *functions]
        self._callable_by_id = {
            id(function): function for function in callables
        }  # The functions are kept alive, so that no other object can get the same id.
        self._spaces = spaces
        self._records = records

    def value(self, expression: str, lookup: Lookup) -> Value:
        """Return the value of an expression.

        Args:
            expression: One line in the syntax of Python.
            lookup: Returns the value of a name, or raises KeyError.

        Raises:
            Refused: If it contains something that is not on the list.
            Exception: Whatever the operations raise: NameError, SyntaxError, ZeroDivisionError, ..
        """
        return self._evaluate(ast.parse(expression.strip(), "<expression>", "eval").body, lookup)

    def _evaluate(self, node: ast.expr, lookup: Lookup) -> Value:
        """Evaluate a node by the method for its kind; refuse forbidden functions and values that are too large."""
        evaluate = getattr(self, f"_{type(node).__name__}", None)
        if evaluate is None:
            raise Refused(f"{_named(node)} is not on the list")
        value = evaluate(node, lookup)
        if callable(value) and not self._may_be_called(value):
            raise Refused(f"'{ast.unparse(node)}' is not one of the functions on the list")
        if isinstance(value, (str, list, tuple)):
            _check_size(len(value))
        return value

    def _may_be_called(self, function: Value) -> bool:
        """Check whether a function is allowed: a checked or listed method of a value, or a listed function."""
        if isinstance(function, partial):
            return function.func in CHECKED.values()
        if isinstance(function, BuiltinMethodType):
            kind = next((kind for kind in METHODS if isinstance(function.__self__, kind)), None)
            if kind is not None:
                called: str = function.__name__
                return called in METHODS[kind]
        return id(function) in self._callable_by_id

    # --- One method for each kind of node; all other kinds are refused. ------------------------------------------

    def _Constant(self, node: ast.Constant, lookup: Lookup) -> Value:
        if not isinstance(node.value, (str, int, float, complex, type(None))):
            raise Refused(f"{node.value!r} is no number or text")
        return node.value

    def _Name(self, node: ast.Name, lookup: Lookup) -> Value:
        _check_name(node.id)
        try:
            return lookup(node.id)
        except KeyError:
            raise NameError(f"name '{node.id}' is not defined") from None

    def _Attribute(self, node: ast.Attribute, lookup: Lookup) -> Value:
        """Return an attribute: an entry of a namespace, a listed method of a value, or an entry of a record."""
        _check_name(node.attr)
        holder: Any = self._evaluate(node.value, lookup)
        if type(holder) in self._spaces:
            try:
                return holder[node.attr]
            except KeyError:
                raise NameError(f"name '{node.attr}' is not defined") from None

        if isinstance(holder, str) and node.attr in CHECKED:
            return partial(CHECKED[node.attr], holder)
        methods = next((METHODS[kind] for kind in METHODS if isinstance(holder, kind)), frozenset())
        if node.attr in methods:
            return getattr(holder, node.attr)
        if isinstance(holder, self._records) and not hasattr(dict, node.attr):
            return getattr(holder, node.attr)
        raise Refused(f"'.{node.attr}' of a {type(holder).__name__} is not on the list")

    def _Subscript(self, node: ast.Subscript, lookup: Lookup) -> Value:
        holder = self._evaluate(node.value, lookup)
        return holder[self._evaluate(node.slice, lookup)]

    def _Slice(self, node: ast.Slice, lookup: Lookup) -> Value:
        return slice(
            *(None if end is None else self._evaluate(end, lookup) for end in (node.lower, node.upper, node.step))
        )

    def _UnaryOp(self, node: ast.UnaryOp, lookup: Lookup) -> Value:
        return SIGNS[type(node.op)](self._evaluate(node.operand, lookup))

    def _BinOp(self, node: ast.BinOp, lookup: Lookup) -> Value:
        operation = ARITHMETIC.get(type(node.op))
        if operation is None:
            raise Refused(f"{_named(node.op)} is not on the list")
        left = self._evaluate(node.left, lookup)
        right = self._evaluate(node.right, lookup)
        _check_growth(node.op, left, right)
        return operation(left, right)

    def _BoolOp(self, node: ast.BoolOp, lookup: Lookup) -> Value:
        decides = isinstance(node.op, ast.Or)
        value = decides
        for each in node.values:
            value = self._evaluate(each, lookup)
            if bool(value) is decides:
                break
        return value

    def _Compare(self, node: ast.Compare, lookup: Lookup) -> Value:
        left = self._evaluate(node.left, lookup)
        answer: Any = True
        for comparison, other in zip(node.ops, node.comparators, strict=True):
            right = self._evaluate(other, lookup)
            answer = COMPARISONS[type(comparison)](left, right)
            if not answer:
                break
            left = right
        return answer

    def _IfExp(self, node: ast.IfExp, lookup: Lookup) -> Value:
        return self._evaluate(node.body if self._evaluate(node.test, lookup) else node.orelse, lookup)

    def _List(self, node: ast.List, lookup: Lookup) -> list[Any]:
        return self._items(node.elts, lookup)

    def _Tuple(self, node: ast.Tuple, lookup: Lookup) -> tuple[Any, ...]:
        return tuple(self._items(node.elts, lookup))

    def _Set(self, node: ast.Set, lookup: Lookup) -> set[Any]:
        return set(self._items(node.elts, lookup))

    def _Dict(self, node: ast.Dict, lookup: Lookup) -> dict[Any, Any]:
        pairs: dict[Any, Any] = {}
        for key, value in zip(node.keys, node.values, strict=True):
            if key is None:
                pairs.update(self._evaluate(value, lookup))
            else:
                pairs[self._evaluate(key, lookup)] = self._evaluate(value, lookup)
        return pairs

    def _Call(self, node: ast.Call, lookup: Lookup) -> Value:
        function = self._evaluate(node.func, lookup)
        arguments = self._items(node.args, lookup)
        keyword_arguments: dict[str, Any] = {}
        for keyword in node.keywords:
            _check_name(keyword.arg or "")
            value = self._evaluate(keyword.value, lookup)
            keyword_arguments.update(value if keyword.arg is None else {keyword.arg: value})
        return function(*arguments, **keyword_arguments)

    def _ListComp(self, node: ast.ListComp, lookup: Lookup) -> list[Any]:
        return [self._evaluate(node.elt, scope) for scope in self._scopes(node.generators, lookup)]

    def _SetComp(self, node: ast.SetComp, lookup: Lookup) -> set[Any]:
        return {self._evaluate(node.elt, scope) for scope in self._scopes(node.generators, lookup)}

    def _GeneratorExp(self, node: ast.GeneratorExp, lookup: Lookup) -> Value:
        return iter([self._evaluate(node.elt, scope) for scope in self._scopes(node.generators, lookup)])

    def _DictComp(self, node: ast.DictComp, lookup: Lookup) -> dict[Any, Any]:
        scopes = self._scopes(node.generators, lookup)
        return {self._evaluate(node.key, scope): self._evaluate(node.value, scope) for scope in scopes}

    def _scopes(self, loops: list[ast.comprehension], lookup: Lookup) -> Iterable[Lookup]:
        """Yield the names at each iteration of the loops of a comprehension."""
        if not loops:
            yield lookup
            return
        loop = loops[0]
        for item in self._evaluate(loop.iter, lookup):
            names = dict(_bound(loop.target, item))
            inner = _inner(names, lookup)
            if all(self._evaluate(condition, inner) for condition in loop.ifs):
                yield from self._scopes(loops[1:], inner)

    def _items(self, nodes: list[ast.expr], lookup: Lookup) -> list[Any]:
        items: list[Any] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                items.extend(self._evaluate(node.value, lookup))
            else:
                items.append(self._evaluate(node, lookup))
        return items


def _inner(names: Mapping[str, Any], outer: Lookup) -> Lookup:
    return lambda name: names[name] if name in names else outer(name)


def _bound(target: ast.expr, item: Value) -> Iterable[tuple[str, Any]]:
    """Yield the names of a loop's target with their values for an item."""
    if isinstance(target, ast.Name):
        _check_name(target.id)
        yield target.id, item
    elif isinstance(target, (ast.Tuple, ast.List)):
        items = list(item)
        if len(items) != len(target.elts):
            raise ValueError(f"expected {len(target.elts)} values to unpack, got {len(items)}")
        for each, value in zip(target.elts, items, strict=True):
            yield from _bound(each, value)
    else:
        raise Refused(f"{_named(target)} is not on the list")


def _check_name(name: str) -> None:
    if name.startswith("__"):
        raise Refused(f"the name '{name}' begins with two underscores")


def _check_growth(operation: ast.operator, left: Value, right: Value) -> None:
    """Raise an error if an operation would make a number, text or list too large."""
    if isinstance(left, int) and isinstance(right, int):
        if _bits_after(operation, left, right) > MOST_BITS:
            raise Refused(f"a whole number of more than {MOST_BITS} bits")
    elif isinstance(operation, ast.Mult):
        for group, times in ((left, right), (right, left)):
            if isinstance(group, (str, list, tuple)) and isinstance(times, int):
                _check_size(len(group) * times)
    elif isinstance(operation, ast.Mod) and isinstance(left, str):
        for width in re.findall(r"%(?:\([^)]*\))?([^a-zA-Z%]*)", left):
            _check_widths(width)


def _bits_after(operation: ast.operator, left: int, right: int) -> int:
    """Return an upper bound on the bits of a result; 0 for operations that do not make numbers much larger."""
    if isinstance(operation, ast.Pow):
        return left.bit_length() * max(right, 0) if abs(left) > 1 else 0
    if isinstance(operation, ast.LShift):
        return left.bit_length() + max(right, 0)
    if isinstance(operation, ast.Mult):
        return left.bit_length() + right.bit_length()
    return 0


def _check_size(size: int) -> None:
    if size > MOST_ITEMS:
        raise Refused(f"a text or list of more than {MOST_ITEMS} letters or items")


def _check_widths(specification: str) -> None:
    """Raise an error if a format specification contains a large width, or one that is not written as a number."""
    if "{" in specification or "*" in specification:
        raise Refused(f"a width '{specification}' that is not written out")
    if any(len(number) > 9 or int(number) > MOST_WIDTH for number in re.findall(r"\d+", specification)):
        raise Refused(f"a width of more than {MOST_WIDTH} letters")


def _format(text: str, *values: Value, **named: Value) -> str:
    """Format text like ``str.format``, but only with plain fields: ``{}``, ``{0}``, ``{name:.3f}``."""
    for _, field, specification, _ in Formatter().parse(text):
        if field is not None and not re.fullmatch(r"\w*", field):
            raise Refused(f"the field '{field}' of a format looks into its value; only plain fields are on the list")
        _check_widths(specification or "")
    return text.format(*values, **named)


def _join(text: str, parts: Iterable[str]) -> str:
    parts = list(parts)
    _check_size(len(text) * len(parts) + sum(len(part) for part in parts))
    return text.join(parts)


def _replace(text: str, old: str, new: str, count: int = -1) -> str:
    _check_size(len(text) + text.count(old) * len(new))
    return text.replace(old, new, count)


def _zfill(text: str, width: int) -> str:
    _check_size(width)
    return text.zfill(width)


CHECKED: Mapping[str, Callable[..., str]] = {"format": _format, "join": _join, "replace": _replace, "zfill": _zfill}
"""Methods of texts in the place of Python's own, which have no bounds or reach into values."""


def shown(expression: str) -> str:
    """Return an expression as messages show it, shortened to about a line."""
    text = " ".join(expression.split())
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}.."


def _named(node: ast.AST) -> str:
    """Return a description of a node of an expression."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(node).__name__).lower()
    if words in ("lambda", "yield", "await"):
        return f"a {words}"
    return f"{words} '{shown(ast.unparse(node))}'" if isinstance(node, ast.expr) else words

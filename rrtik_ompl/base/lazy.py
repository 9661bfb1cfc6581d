"""Public names of a package that are imported when they are first used, so that importing the package costs little.

Constructors of public classes say how they are called, see :func:`guided`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from importlib import import_module
from inspect import Signature, getattr_static, signature
from types import FunctionType, ModuleType
from typing import Any

from rrtik_ompl.base.collector import collector_waits
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.floors import DependencyError, fitting_packages, name_old_packages

MAKERS = classmethod, staticmethod


def lazy_names(
    package: str, homes: Mapping[str, Iterable[str]], modules: Iterable[str] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package.

    Args:
        package: Its ``__name__``.
        homes: Public names by the module that defines them, without ``rrtik_ompl.``.
        modules: Public modules of the package.

    Example:
        >>> __getattr__, __dir__, __all__ = lazy_names("rrtik_ompl", {"base.poses": ("pose",)}, ("ik",))
        >>> __all__
        ['ik', 'pose']
    """
    home_of = {name: home for home, names in homes.items() for name in names}
    public = sorted([*home_of, *modules])

    def get(name: str) -> Any:  # noqa: ANN401 - whatever has that name
        if name not in public:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        home = home_of.get(name)
        with fitting_packages(), collector_waits():
            module = import_module(f"{package}.{name}" if home is None else f"rrtik_ompl.{home}")
            value = module if home is None else getattr(module, name)  # which may load more
        name_old_packages()
        if isinstance(value, type):
            guided(value)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        return [*public, *(name for name in vars(sys.modules[package]) if name.startswith("__"))]

    return get, names, public


def guided(kind: type) -> None:
    """Have the constructor of a class answer a wrong number or name of arguments with the call that is meant.

    Python's own message counts ``self`` and does not name what is wanted.

    Example:
        >>> class Ball:
        ...     def __init__(self, radius: float, margin: float = 0.0) -> None: ...
        >>> guided(Ball)
        >>> Ball(diameter=0.1)
        Traceback (most recent call last):
        rrtik_ompl.base.errors.InputError: Ball: there is no argument 'diameter'; write Ball(radius, margin=0.0)
    """
    made = vars(kind).get("__init__")
    if not isinstance(made, FunctionType) or hasattr(made, "__wrapped__"):
        return

    @wraps(made)
    def of_protocol(self: object, *args: Any, **options: Any) -> None:
        if type(self) is kind:
            raise InputError(f"{kind.__name__} is a protocol: write a class with its methods")
        super(kind, self).__init__(*args, **options)  # type: ignore[arg-type]  # of other bases

    @wraps(made)
    def constructor(self: object, *args: Any, **options: Any) -> None:
        try:
            made(self, *args, **options)
        except TypeError as error:
            within = error.__traceback__
            if within is None or within.tb_next is not None:  # raised inside of the constructor
                raise
            raise InputError(_wrong_call(kind, args, options)) from None

    kind.__init__ = of_protocol if getattr(kind, "_is_protocol", False) else constructor  # type: ignore[misc]


def _wrong_call(kind: type, args: tuple[Any, ...], options: dict[str, Any]) -> str:
    """Return what is wrong with the arguments of a constructor and which are meant, in one line."""
    unknown = [name for name in options if name not in signature(kind).parameters]
    fault = f"there is no argument '{unknown[0]}'" if unknown else "wrong arguments"
    try:
        signature(kind).bind(*args, **options)
    except TypeError as error:
        fault = fault if unknown else str(error)
    if "positional" in fault:
        fault += f" ({', '.join(type(each).__name__ for each in args)})"

    whole = "missing" not in fault
    forms = [getattr(kind, "call", "") or _form(kind, kind.__name__, whole=whole)]
    others = (name for name in ("of", "load") if isinstance(getattr_static(kind, name, None), MAKERS))
    forms += [_form(getattr(kind, name), f"{kind.__name__}.{name}", whole=False) for name in others]
    return f"{kind.__name__}: {fault}; write {' or '.join(forms)}"


def _form(call: Callable[..., Any], name: str, *, whole: bool) -> str:
    """Return a call as one writes it; only ``whole`` with arguments that are given by name alone."""
    named = [each.replace(annotation=each.empty) for each in signature(call).parameters.values()]
    return name + str(Signature([each for each in named if whole or each.kind is not each.KEYWORD_ONLY]))


def public_values(package: ModuleType) -> dict[str, Any]:
    """Return all public names of a package and of its public modules, such as "plan" and "tip.straight".

    What needs a package that is not installed, as OMPL on Python 3.14, is left out.
    """
    found: dict[str, Any] = {}
    for name in vars(package)["__all__"]:
        try:
            value = getattr(package, name)
        except DependencyError:
            continue
        if isinstance(value, ModuleType) and "__all__" in vars(value):
            found |= {f"{name}.{inner}": member for inner, member in public_values(value).items()}
        else:
            found[name] = value
    return found

"""Public names of a package that are imported when they are first used, so that importing the package costs little."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any


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
        value = (
            import_module(f"{package}.{name}") if home is None else getattr(import_module(f"rrtik_ompl.{home}"), name)
        )
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        return [*public, *(name for name in vars(sys.modules[package]) if name.startswith("__"))]

    return get, names, public


def public_values(package: ModuleType) -> dict[str, Any]:
    """Return all public names of a package and of its public modules, such as "plan" and "tip.straight"."""
    found: dict[str, Any] = {}
    for name in vars(package)["__all__"]:
        value = getattr(package, name)
        if isinstance(value, ModuleType) and "__all__" in vars(value):
            found |= {f"{name}.{inner}": member for inner, member in public_values(value).items()}
        else:
            found[name] = value
    return found

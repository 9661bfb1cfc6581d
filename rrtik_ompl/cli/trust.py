"""The option `--trust-xacro` of the commands that open robots."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

import typer

TrustXacro = Annotated[
    bool, typer.Option("--trust-xacro", help="Let macros of .xacro files run anything: only for files that you trust.")
]


def with_trust(command: Callable[..., int]) -> Callable[..., int]:
    """Return a command with the additional option `--trust-xacro`, which applies to all files that it opens."""

    @wraps(command)
    def run(*, trust_xacro: bool = False, **given: Any) -> int:
        from rrtik_ompl.description.xacro_text import expanding

        with expanding(trusted=trust_xacro):
            return command(**given)

    option = inspect.Parameter("trust_xacro", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=TrustXacro)

    # Annotations are evaluated here, because typer would look names up in the wrapper's module.
    signature = inspect.signature(command, eval_str=True)
    shown = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in signature.parameters.values()]
    run.__signature__ = signature.replace(parameters=[*shown, option])  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in (*shown, option)}
    run.__annotations__["return"] = signature.return_annotation
    return run

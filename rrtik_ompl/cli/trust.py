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
    """A command that takes one option more; all that it opens is then trusted."""

    @wraps(command)
    def run(*, trust_xacro: bool = False, **given: Any) -> int:
        from rrtik_ompl.description.xacro_text import expanding

        with expanding(trusted=trust_xacro):
            return command(**given)

    option = inspect.Parameter("trust_xacro", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=TrustXacro)

    signature = inspect.signature(command, eval_str=True)  # typer looks names up where the wrapper is, not the command
    shown = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in signature.parameters.values()]
    run.__signature__ = signature.replace(parameters=[*shown, option])  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in (*shown, option)}
    run.__annotations__["return"] = signature.return_annotation
    return run

"""What mkdocstrings is told about our docstrings: examples of one call are examples too, and names are names."""

from __future__ import annotations

import re
from typing import Any

import griffe

ROLE = re.compile(r":(?:func|class|meth|attr|mod|data):`~?(?:[\w.]+\.)?(\w+)`")


class Docstrings(griffe.Extension):
    """Rewrites the docstrings as they are read."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        """Called for each object of the library."""
        if obj.docstring is not None:
            text = re.sub(r"^Example:$", "Examples:", obj.docstring.value, flags=re.MULTILINE)
            obj.docstring.value = ROLE.sub(r"`\1`", text).replace("``", "`")

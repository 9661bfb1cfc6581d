"""What a search for a route returns when there is none."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class NoRoute:
    """There is no route.

    Attributes:
        reason: Why, in words for a person.
        stage: The part of the route that cannot be made; "" for the whole route.
    """

    reason: str
    stage: str = ""

    def __str__(self) -> str:
        return f"{self.stage}: {self.reason}" if self.stage else self.reason

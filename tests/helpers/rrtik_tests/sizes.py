"""How much of a sweep a run of the tests does: a part, or all of it with ``RRTIK_TESTS=all`` in the environment."""

import os


def how_many(everything: int, part: int) -> int:
    """The number that this run takes."""
    return everything if os.environ.get("RRTIK_TESTS") == "all" else part

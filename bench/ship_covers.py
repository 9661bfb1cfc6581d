"""Write the covers of all robots that come along into the package.

What the machine's cache holds is taken from there. The same covers always make the same file.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from typing import Annotated
from unittest.mock import patch

import coal
from typer import Option

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.description.catalog import list_robots, load_robot
from rrtik_ompl.files.cache import FOLDER_VARIABLE
from rrtik_ompl.kernels.covers import cache
from rrtik_ompl.world.world import World


def covers_of_robots() -> dict[str, Matrix]:
    """All covers that the worlds of the robots ask for, by their hashes."""
    found: dict[str, Matrix] = {}
    cached = cache._cached

    def noted(geometry: coal.CollisionGeometry, parameters: str, make: Callable[[], Matrix]) -> Matrix:
        rows, key = cached(geometry, parameters, make), cache.cover_key(geometry, parameters)
        if key is not None:
            found[key] = rows
        return rows

    with patch.object(cache, "_cached", noted), patch.object(cache, "shipped_cover", lambda key: None):
        for name in list_robots():
            World(load_robot(name))
            print(f"{name}: {len(found)} covers so far", flush=True)
    return found


def main(anew: Annotated[bool, Option(help="Make every cover, whatever the cache holds: minutes.")] = False) -> None:
    """Write the file."""
    with tempfile.TemporaryDirectory() as empty, patch.dict(os.environ, {FOLDER_VARIABLE: empty} if anew else {}):
        cache.write_store(covers_of_robots())
    print(f"{cache.STORE}: {cache.STORE.stat().st_size / 1e6:.2f} MB")

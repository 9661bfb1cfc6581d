"""The double axis cut as far as it comes in the time that is left."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.shortening.axis import double_axis_cut
from rrtik_ompl.shortening.questions import OutOfTime, Questions


def timely_cut(route: Matrix, ask: Questions, axes: Sequence[int] | None = None) -> Matrix:
    """The double axis cut of a free route of single-joint moves, shape (k, n).

    When it is time to stop, nothing else counts as free, so what has been cut by then stays cut. Runs of one joint
    that became one move have been asked about in pieces.
    """
    late = False

    def free(a: Vector, b: Vector) -> bool:
        nonlocal late
        with suppress(OutOfTime):
            if not late:
                return bool(ask(a[None], b[None])[0])
        late = True
        return False

    return double_axis_cut(route, free, axes=axes)

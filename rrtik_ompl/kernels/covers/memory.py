"""Arrays that kernels of covers work on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rrtik_ompl.kernels.layout import ALIGNMENT


def room(count: int, dtype: DTypeLike = np.float32) -> NDArray[Any]:
    """An array of so many numbers, not yet set, that lanes can be read from."""
    size = count * np.dtype(dtype).itemsize
    memory = np.empty(size + ALIGNMENT, dtype=np.uint8)
    begin = -memory.ctypes.data % ALIGNMENT
    return memory[begin : begin + size].view(dtype)


def called(kernel: Callable[..., int], *arguments: NDArray[Any] | int) -> int:
    """Call a kernel with whole numbers and with the addresses of contiguous arrays."""
    return kernel(*(argument if isinstance(argument, int) else argument.ctypes.data for argument in arguments))

"""Array types and the validation of arrays from outside: shape, finiteness, a private read-only copy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from typing import Any, SupportsIndex, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rrtik_ompl.base.errors import InputError, at_most

Vector: TypeAlias = NDArray[np.float64]  # shape (n,)
Matrix: TypeAlias = NDArray[np.float64]  # shape (m, n)
Mask: TypeAlias = NDArray[np.bool_]  # shape (m,)

TAU = 2.0 * np.pi  # [rad] a full turn
MOST_NUMBERS = 100_000_000  # largest size of one array, 0.8 GB
BLOCK_ROWS = 16_384  # number of rows that are computed at a time
MOST_ROWS = 1_000_000  # largest number of waypoints of a path, or of times of a motion
_HASH_FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)  # odd
_LISTS = frozenset((list, tuple))
QUIET_PRODUCT = 262_144  # multiplications; for more, OpenBLAS wakes threads, which then spin for longer than they work
LARGEST = 1e6  # [m] or [rad]; larger numbers are mistakes, and too large for the kernels' float32


class Rows:
    """A value that is used like the array of its rows: by ``np.asarray``, ``len``, an index, a slice and a loop.

    It has at least one row, so it is always true. The rows are read-only.
    """

    __slots__ = ()

    @property
    def _rows(self) -> Matrix:
        """The rows, shape (k, n)."""
        raise NotImplementedError

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self._rows, dtype=dtype, copy=copy)

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, number: SupportsIndex) -> Vector: ...
    @overload
    def __getitem__(self, number: slice) -> Matrix: ...
    def __getitem__(self, number: SupportsIndex | slice) -> NDArray[np.float64]:
        if not isinstance(number, SupportsIndex | slice):
            raise TypeError(
                f"index of a {type(self).__name__}: expected a whole number or a slice, got {type(number).__name__}; "
                "np.asarray(...) of it takes every index of numpy"
            )
        row: NDArray[np.float64] = self._rows[number]
        return row

    def __iter__(self) -> Iterator[Vector]:
        return iter(self._rows)


def in_blocks(work: Callable[..., NDArray[Any]], *rows: NDArray[Any]) -> NDArray[Any]:
    """Compute a function of many rows block by block, so that it needs little memory in addition to its result.

    Args:
        work: Computes one row of the result for each row of its arguments.
        rows: Arrays of equal length, the arguments of ``work``.

    Returns:
        The result for all rows, as if ``work`` had been called once.
    """
    count = len(rows[0])
    if count <= BLOCK_ROWS:
        return work(*rows)
    answer: NDArray[Any] | None = None
    for begin in range(0, count, BLOCK_ROWS):
        part = work(*(each[begin : begin + BLOCK_ROWS] for each in rows))
        answer = allocated((count, *part.shape[1:]), part.dtype) if answer is None else answer
        answer[begin : begin + BLOCK_ROWS] = part

    assert answer is not None
    return answer


def allocated(shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Allocate an uninitialised array for a result.

    Raises:
        InputError: If there is not enough memory.
    """
    try:
        return np.empty(shape, dtype)
    except MemoryError:
        size = np.dtype(dtype).itemsize * float(np.prod([float(n) for n in shape])) / 1e9
        raise InputError(f"the answer takes {size:.1f} GB, more than this machine has left; ask in parts") from None


def frozen(values: ArrayLike, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Return a read-only, contiguous private copy of ``values``."""
    array = np.array(values, dtype=dtype, order="C", copy=True)
    array.setflags(write=False)
    return array


def sealed(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array that nobody else has, read-only from now on."""
    array.setflags(write=False)
    return array


def distinct(values: ArrayLike) -> NDArray[Any]:
    """Return the distinct numbers in ascending order, as ``numpy.unique`` does, but faster for few numbers.

    It also avoids the time that numpy takes to load its function.
    """
    ordered = np.sort(np.asarray(values), axis=None)
    first = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


def products(points: Matrix, vectors: Matrix) -> Matrix:
    """Return the dot product of each point with each vector, shape (n, k), in one thread.

    Args:
        points: Shape (n, 3).
        vectors: Shape (k, 3).

    Example:
        >>> products(np.eye(3), np.array([[1.0, 2.0, 3.0]])).ravel().tolist()
        [1.0, 2.0, 3.0]
    """
    found = np.empty((len(points), len(vectors)), dtype=points.dtype)
    rows = max(QUIET_PRODUCT // max(vectors.size, 1), 1)
    for begin in range(0, len(points), rows):
        np.matmul(points[begin : begin + rows], vectors.T, out=found[begin : begin + rows])
    return found


def box_of(points: NDArray[np.float64]) -> tuple[Vector, Vector]:
    """Return the lowest and the highest coordinates of points, shape (n, 3); many times faster than along their axis.

    Example:
        >>> low, high = box_of(np.array([[0.0, 1.0, 2.0], [3.0, 0.0, 2.0]]))
        >>> low.tolist(), high.tolist()
        ([0.0, 0.0, 2.0], [3.0, 1.0, 2.0])
    """
    columns = np.ascontiguousarray(points.T)
    return np.asarray(columns.min(axis=1)), np.asarray(columns.max(axis=1))


def bounds_of(triangles: NDArray[np.float64]) -> tuple[Matrix, Matrix]:
    """Return the lowest and highest coordinates of triangles, shape (m, 3, 3), quicker than along their axis.

    Example:
        >>> low, high = bounds_of(np.arange(9.0).reshape(1, 3, 3))
        >>> low.tolist(), high.tolist()
        ([[0.0, 1.0, 2.0]], [[6.0, 7.0, 8.0]])
    """
    a, b, c = (triangles[:, k] for k in range(3))
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def welded(points: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find points at the same place, many times faster than ``numpy.unique`` along an axis.

    Args:
        points: Shape (n, 3), of numbers of 64 bits.

    Returns:
        The index of the first point at each place, shape (k,), and for each point the number of its place in these,
        shape (n,).

    Example:
        >>> first, place = welded(np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 0.0], [-0.0, 0.0, 1.0]]))
        >>> points = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 0.0]])
        >>> sorted(first.tolist()), bool(place[0] == place[2] != place[1])
        ([0, 1], True)
    """
    plain = np.ascontiguousarray(points + 0)  # -0.0 becomes 0.0
    bits = plain.view(np.uint64)
    keys = np.zeros(len(plain), dtype=np.uint64)
    for column, factor in zip(bits.T, _HASH_FACTORS, strict=True):
        keys = (keys ^ column) * factor
        keys ^= keys >> np.uint64(29)

    if not len(keys):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    order = np.argsort(keys)
    is_new = np.ones(len(order), dtype=bool)
    np.not_equal(keys[order[1:]], keys[order[:-1]], out=is_new[1:])
    first = np.minimum.reduceat(order, np.flatnonzero(is_new))
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.cumsum(is_new) - 1

    if not (plain[first[place]] == plain).all():  # two places with one key, or what is not a number
        _, first, place = np.unique(plain, axis=0, return_index=True, return_inverse=True)
    return first, np.asarray(place).ravel()


def finite_array(values: ArrayLike, shape: tuple[int | None, ...], what: str) -> NDArray[np.float64]:
    """Check an array given by a user and return it as float64.

    Args:
        values: Anything numpy can turn into numbers.
        shape: Wanted shape; ``None`` stands for any length in that place.
        what: Name of the value, used in the error message.

    Raises:
        InputError: If the values are not numbers, have another shape, or are not all finite.
    """
    # Most arguments are float arrays already; testing for other types takes longer than all other checks.
    array = values if type(values) is np.ndarray and values.dtype == np.float64 else _as_floats(values, what)

    if array.size > MOST_NUMBERS:
        raise too_many(array.size, what)
    if array.shape != shape and not _has_shape(array, shape):
        wanted = ", ".join("any" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "")
        raise InputError(f"{what}: expected an array of shape ({wanted}), got shape {array.shape}")

    if not np.isfinite(array).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        if not place:
            raise InputError(f"{what}: must be a finite number, got {array}")
        raise InputError(f"{what}: every number must be finite, but entry {list(place)} is {array[place]}")
    return array


def _as_floats(values: ArrayLike, what: str) -> NDArray[np.float64]:
    """Convert numbers given by a user to float64. This is the only place that decides what counts as a number.

    Raises:
        InputError: If the values are not numbers (booleans, text and complex numbers are not), or too many.
    """
    try:
        if (count := _count(values)) > MOST_NUMBERS:
            raise too_many(count, what)
        array = np.asarray(values)
        if array.dtype.kind not in "fiuO" or (isinstance(values, list | tuple) and _has_truths(values)):
            raise TypeError("not numbers")
        return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what}: expected numbers, got {_short(values)}") from error
    except MemoryError:
        raise InputError(f"{what}: too many numbers for the memory of this machine; give them in parts") from None


def _count(values: object) -> int:
    """Return the length of a value given by a user before it is copied; 0 if it has none."""
    if isinstance(values, np.ndarray):
        return values.size
    try:
        return len(values)  # type: ignore[arg-type]
    except (TypeError, OverflowError):
        return MOST_NUMBERS + 1 if isinstance(values, range) else 0


def _has_truths(values: Iterable[Any]) -> bool:
    """Check whether nested lists contain True or False, which numpy would convert to 1 and 0, level by level."""
    while True:
        kinds = set(map(type, values))
        if bool in kinds or np.bool_ in kinds:
            return True
        if np.ndarray in kinds and any(type(each) is np.ndarray and each.dtype == np.bool_ for each in values):
            return True
        if kinds.isdisjoint(_LISTS):
            return False
        values = list(chain.from_iterable(each for each in values if type(each) in _LISTS))


def _has_shape(array: NDArray[np.float64], shape: tuple[int | None, ...]) -> bool:
    return array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))


def too_many(count: int, what: str) -> InputError:
    """Return the error for more numbers than a call accepts."""
    return InputError(f"{what}: {count} are more numbers than the {MOST_NUMBERS} of one call; give them in parts")


def dimensions(values: object) -> int:
    """Return the number of dimensions of a value given by a user; 0 for nested lists that do not form an array."""
    if not isinstance(values, np.ndarray) and _count(values) > MOST_NUMBERS:
        return 0
    try:
        return np.ndim(values)  # type: ignore[arg-type]
    except (ValueError, MemoryError):
        return 0


def bounded_array(values: ArrayLike, shape: tuple[int | None, ...], what: str) -> NDArray[np.float64]:
    """Validate an array as :func:`finite_array`, and that no number exceeds ``LARGEST``, the range of the kernels.

    Raises:
        InputError: As :func:`finite_array`, or if a number is larger.
    """
    array = finite_array(values, shape, what)
    if (largest := np.abs(array).max(initial=0.0)) > LARGEST:
        raise InputError(f"{what}: found {largest:g}, more than {LARGEST:g}; check units: metres, radians")
    return array


def usable_waypoints(rows: Matrix) -> Matrix:
    """Validate the number and range of finite waypoints of a path, shape (k, n), and return them.

    Raises:
        InputError: If there are none or too many, or a number is larger than ``LARGEST``.
    """
    if rows.size == 0:
        raise InputError("path waypoints: a path needs at least one configuration of at least one joint")
    at_most(len(rows), MOST_ROWS, "path waypoints")
    if (most := np.abs(rows).max()) > LARGEST:
        raise InputError(f"path waypoints: found {most:g}, more than {LARGEST:g} rad or m; check units")
    return rows


def number_rows(values: ArrayLike, what: str) -> NDArray[np.float64]:
    """Convert numbers given by a user to rows, one or several, which need not be finite.

    Raises:
        InputError: If they are not numbers, or too many.
    """
    array = values if type(values) is np.ndarray and values.dtype == np.float64 else _as_floats(values, what)
    if array.size > MOST_NUMBERS:
        raise too_many(array.size, what)
    return array if array.ndim >= 2 else array.reshape(1, -1)


def rows_of(values: ArrayLike, columns: int, what: str) -> Matrix:
    """Convert numbers given by a user to rows with a given number of columns, shape (k, columns).

    As :func:`number_rows`, they need not be finite.

    Raises:
        InputError: If they do not form such rows.
    """
    rows = number_rows(values, what)
    if rows.shape[1:] != (columns,):
        raise InputError(f"{what}: expected shape (any, {columns}), got {rows.shape}")
    return rows


def filled_rows(values: ArrayLike, columns: int, what: str) -> Matrix:
    """Validate at least one finite row, shape (k, columns), as :func:`finite_array`.

    Raises:
        InputError: If they do not form such rows, or a number is not finite.
    """
    rows = finite_array(values, (None, columns), what)
    if len(rows) == 0:
        raise InputError(f"{what}: at least one row is needed")
    return rows


def truths(values: ArrayLike, what: str) -> Mask:
    """Convert booleans given by a user, or 0 and 1, to a mask, shape (n,).

    Raises:
        InputError: If they are anything else.
    """
    array = np.asarray(values) if isinstance(values, list | tuple | np.ndarray) and dimensions(values) else None
    if array is None or array.dtype != np.bool_:
        array = number_rows(values, what)
        if not np.isin(array, (0.0, 1.0)).all():
            raise InputError(f"{what}: must be true or false, or 1 or 0, each")
    mask: Mask = array.reshape(-1).astype(bool)
    return mask


def finite_number(value: ArrayLike, what: str) -> float:
    """Validate a finite number given by a user and return it as float.

    Raises:
        InputError: If it is not a finite number.
    """
    if type(value) is float and -np.inf < value < np.inf:
        return value
    return float(finite_array(value, (), what))


def positive(value: ArrayLike, what: str, remedy: str = "") -> float:
    """Validate a finite number greater than 0 given by a user.

    Args:
        value: The value.
        what: Name of the value, with which the error message begins.
        remedy: Advice on what to give instead, with which the error message ends.

    Raises:
        InputError: If it is not such a number.
    """
    number = finite_number(value, what)
    if number <= 0.0:
        raise InputError(f"{what}: must be greater than 0, got {number:g}" + (f"; {remedy}" if remedy else ""))
    return number


def length(value: ArrayLike, what: str) -> float:
    """Validate a length of a solid [m] given by a user: greater than 0, at most ``LARGEST``.

    Raises:
        InputError: If it is not such a number.
    """
    return positive(bounded_array(value, (), what), what)


def not_negative(value: ArrayLike, what: str) -> float:
    """Validate a finite number of at least 0 given by a user.

    Raises:
        InputError: If it is not such a number.
    """
    number = finite_number(value, what)
    if number < 0.0:
        raise InputError(f"{what} must not be negative, got {number:g}")
    return number


def whole_number(value: object, what: str, least: int = 0) -> int:
    """Validate a whole number of at least ``least`` given by a user, such as a seed.

    Raises:
        InputError: If it is not a whole number, or less than ``least``.
    """
    if type(value) is int and value >= least:
        return value
    odd = isinstance(value, bool | np.timedelta64)  # these are subclasses of integer types
    if odd or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{what} must be a whole number of at least {least}, got {value!r}")
    return int(value)


def seed_of(seed: object) -> int:
    """Validate the seed of random numbers given by a user; None draws one.

    Raises:
        InputError: If it is neither None nor a whole number of at least 0.
    """
    if seed is None:
        return int(np.random.default_rng().integers(2**31))
    return whole_number(seed, "seed")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

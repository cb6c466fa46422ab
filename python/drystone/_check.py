"""Checks of arguments. A refusal is one line with the argument, its value and the valid values."""

from __future__ import annotations

import difflib
import operator
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Kind = TypeVar("Kind")
# The largest count of Rust's signed integers.
MAX_WHOLE = 2**63 - 1


def whole(name: str, value: Any, least: int = 0) -> int:
    """A whole number from `least` to 2^63 - 1."""
    try:
        number = operator.index(value)
    except TypeError:
        raise ValueError(f"{name} = {value!r}: must be a whole number") from None
    if number < least:
        raise ValueError(f"{name} = {number}: must be {least} or more")
    if number > MAX_WHOLE:
        raise ValueError(f"{name} = {number}: must be at most 2^63 - 1")
    return number


def number(name: str, value: Any) -> float:
    """A finite number."""
    try:
        if np.iscomplexobj(value):
            raise TypeError
        result = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {value!r}: must be a number") from None
    except OverflowError:
        raise ValueError(f"{name} = {value!r}: must be finite") from None
    if not np.isfinite(result):
        raise ValueError(f"{name} = {result}: must be finite")
    return result


def numbers(
    name: str,
    value: ArrayLike,
    shape: tuple[int, ...],
    absent: Callable[[], NDArray[np.bool_]] | None = None,
) -> NDArray[np.float32]:
    """Finite numbers in a new array of single precision. A length of -1 in the shape can be any length. Numbers of
    absent bodies or drives (`absent`) may be NaN.
    """
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} has rows of several lengths: must have shape {wanted(shape)}") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name} has dtype {array.dtype}: must be numbers")
    fits = array.ndim == len(shape) and all(w in (-1, n) for w, n in zip(shape, array.shape, strict=True))
    if not fits:
        raise ValueError(f"{name} has shape {array.shape}: must be {wanted(shape)}")
    with np.errstate(over="ignore"):
        single = np.array(array, np.float32, order="C")
    is_bad = ~np.isfinite(single)
    if is_bad.any() and absent is not None:
        is_bad &= ~(absent() & np.isnan(single))
    bad = np.argwhere(is_bad)
    if len(bad):
        place = tuple(int(i) for i in bad[0])
        at = "" if not place else str(list(place))
        raise ValueError(f"{name}{at} = {array[place]}: must be finite")
    return single


def rows_within(name: str, rows: NDArray[np.float32], is_within: NDArray[np.bool_], words: str) -> None:
    """Numbers or rows of numbers that hold a condition."""
    bad = np.argwhere(~is_within)
    if len(bad):
        place = tuple(int(i) for i in bad[0])
        raise ValueError(f"{name}{list(place)} = {rows[place].tolist()}: must {words}")


def output(name: str, array: Any, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """An array that a call can fill."""
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{name} is {type(array).__name__}: must be ndarray")
    if array.dtype != dtype:
        raise ValueError(f"{name} has dtype {array.dtype}: must be {dtype}")
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}: must be {shape}")
    if not array.flags.c_contiguous:
        raise ValueError(f"{name} is not contiguous: must be in C order")
    if not array.flags.writeable:
        raise ValueError(f"{name} is read-only: must be writable")


def wanted(shape: tuple[int, ...]) -> str:
    """A shape in words."""
    words = ["any" if n == -1 else str(n) for n in shape]
    return f"({', '.join(words)}{',' if len(words) == 1 else ''})"


def worlds(value: Any, count: int, name: str = "worlds") -> NDArray[np.int64]:
    """Worlds from a mask, from ascending indices or from one index."""
    if value is None:
        return np.arange(count)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} has rows of several lengths: must have one axis") from None
    if array.size == 0 and array.dtype.kind == "f":
        array = array.astype(np.int64)
    if array.dtype == bool:
        if array.shape != (count,):
            raise ValueError(f"{name} is a mask of shape {array.shape}: must be ({count},)")
        return np.flatnonzero(array)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name} has dtype {array.dtype}: must be a mask of bools or whole numbers")
    array = np.atleast_1d(array).astype(np.int64)
    if array.ndim != 1:
        raise ValueError(f"{name} has shape {array.shape}: must have one axis")
    outside = array[(array < 0) | (array >= count)]
    if len(outside):
        raise ValueError(f"{name} has {outside[0]}: must be 0 to {count - 1}")
    if np.any(np.diff(array) <= 0):
        raise ValueError(f"{name} = {array.tolist()}: must ascend")
    return array


def kind_of(name: str, value: Any, kind: type[Kind]) -> Kind:
    """A value of a type."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} is {type(value).__name__}: must be {kind.__name__}")
    return value


def path(name: str, value: Any) -> str:
    """The path of a file."""
    if not isinstance(value, (str, os.PathLike)) or not isinstance(text := os.fspath(value), str):
        raise ValueError(f"{name} is {type(value).__name__}: must be a path")
    return text


def vector(name: str, value: Any, length: int = 3) -> list[float]:
    """A list of finite numbers."""
    if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
        raise ValueError(f"{name} = {value!r}: must be {length} numbers")
    result = [number(name, one) for one in value]
    if len(result) != length:
        raise ValueError(f"{name} has {len(result)} numbers: must have {length}")
    return result


def words(name: str, value: Any, known: Iterable[str] | None = None) -> list[str]:
    """One word or several, each a known one."""
    if isinstance(value, str):
        value = [value]
    if isinstance(value, (bytes, Mapping)) or not isinstance(value, Iterable):
        raise ValueError(f"{name} = {value!r}: must be a word or a list of words")
    found = list(value)
    known = None if known is None else list(known)
    for word in found:
        if known is not None:
            one_of(name, word, known)
        elif not isinstance(word, str):
            raise ValueError(f"{name} has {word!r}: must be words")
    return found


def one_of(name: str, value: str, known: Iterable[str]) -> str:
    """One of some words."""
    known = list(known)
    if not isinstance(value, str) or value not in known:
        raise ValueError(f"{name} = {value!r}: {hint(str(value), known)}")
    return value


def hint(word: str, known: Iterable[str]) -> str:
    """A suggestion for a misspelled word."""
    known = list(known)
    near = difflib.get_close_matches(word, known, 1)
    return f"did you mean {near[0]!r}?" if near else f"must be one of {', '.join(known)}"

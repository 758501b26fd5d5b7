"""The rows of a PLY's elements as columns of numbers, text or binary, whatever the lengths of their lists."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.source.numbers import parse_numbers, whole
from meshsimp_pymoo.reprs import brief


@dataclass(frozen=True)
class PlyProperty:
    """A number of each row, or a list of them."""

    name: str
    dtype: np.dtype[Any]
    count_dtype: np.dtype[Any] | None  # of the number that starts a list; None for a single value


@dataclass(frozen=True)
class PlyElement:
    """What the rows of one kind consist of."""

    name: str
    count: int
    properties: list[PlyProperty]


@brief
@dataclass(frozen=True)
class Ragged:
    """A list property whose lists differ in length: all values in a row, and the length of each list."""

    values: AnyArray
    counts: IntArray


def _truncated(name: str, element: PlyElement, size: int, unit: str) -> ModelError:
    return ModelError(
        f"{name}: truncated: the {element.count} rows of {element.name!r} end after the file's last {unit} ({size} "
        f"after the header); copy or export the file again"
    )


def binary_columns(data: bytes, start: int, elements: list[PlyElement], name: str) -> dict[str, dict[str, Any]]:
    """Return the columns of each element by name, from a binary body that begins at this byte."""
    body = np.frombuffer(data, np.uint8, offset=start)
    at = 0
    result = {}
    for element in elements:
        lengths = _first_lengths(body, at, element)
        row = np.dtype(_row_fields(element, lengths))
        columns: dict[str, Any] = {}
        if at + element.count * row.itemsize <= len(body):
            table = np.frombuffer(body, row, count=element.count, offset=at)
            if all((table[f"#{key}"] == length).all() for key, length in lengths.items()):
                for item in element.properties:
                    columns[item.name] = table[item.name].astype(item.dtype.newbyteorder("="))
                result[element.name] = columns
                at += element.count * row.itemsize
                continue
        if not lengths:
            raise _truncated(name, element, len(body), "bytes")
        columns, at = _scan_binary_element(body, at, element, name)
        result[element.name] = columns
    return result


def _first_lengths(body: npt.NDArray[np.uint8], at: int, element: PlyElement) -> dict[str, int]:
    """Return the length of each list in the element's first row (0 where the file has ended)."""
    lengths = {}
    for item in element.properties:
        if item.count_dtype is None:
            at += item.dtype.itemsize
            continue
        raw = body[at : at + item.count_dtype.itemsize].tobytes()
        enough = element.count > 0 and len(raw) == item.count_dtype.itemsize
        length = int(np.frombuffer(raw, item.count_dtype)[0]) if enough else 0
        lengths[item.name] = length if 0 <= length < 1 << 16 else 0  # else scanned row by row
        at += item.count_dtype.itemsize + lengths[item.name] * item.dtype.itemsize
    return lengths


def _row_fields(element: PlyElement, lengths: dict[str, int]) -> list[Any]:
    fields: list[Any] = []
    for item in element.properties:
        if item.count_dtype is None:
            fields.append((item.name, item.dtype))
        else:
            fields.append((f"#{item.name}", item.count_dtype))
            fields.append((item.name, item.dtype, (lengths[item.name],)))
    return fields


def _scan_binary_element(
    body: npt.NDArray[np.uint8], at: int, element: PlyElement, name: str
) -> tuple[dict[str, Any], int]:
    """Read an element whose lists differ in length from row to row."""
    items = element.properties
    count_sizes = np.array([0 if item.count_dtype is None else item.count_dtype.itemsize for item in items])
    item_sizes = np.array([item.dtype.itemsize for item in items])
    big = any((item.count_dtype or item.dtype).str[0] == ">" for item in items)
    starts, counts, end = _scan_bytes(body, at, element.count, count_sizes, item_sizes, big)
    if end < 0:
        raise _truncated(name, element, len(body), "bytes")
    columns: dict[str, Any] = {}
    for k, item in enumerate(element.properties):
        sizes = counts[:, k] * item.dtype.itemsize
        first = np.cumsum(sizes) - sizes
        index = np.arange(sizes.sum()) + np.repeat(starts[:, k] - first, sizes)
        values = body[index].view(item.dtype).astype(item.dtype.newbyteorder("="))
        columns[item.name] = values if item.count_dtype is None else _even(values, counts[:, k])
    return columns, int(end)


@entry
def _scan_bytes(
    body: np.ndarray, at: int, n_rows: int, count_sizes: np.ndarray, item_sizes: np.ndarray, big: bool
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return where each property of each row starts, its number of values, and the end (-1: too short)."""
    n = len(count_sizes)
    starts = np.zeros((n_rows, n), np.int64)
    counts = np.zeros((n_rows, n), np.int64)
    for row in range(n_rows):
        for k in range(n):
            count = 1
            if count_sizes[k] > 0:
                if at + count_sizes[k] > len(body):
                    return starts, counts, -1
                count = 0
                for b in range(count_sizes[k]):
                    place = b if big else count_sizes[k] - 1 - b
                    count = (count << 8) | np.int64(body[at + place])
                at += count_sizes[k]
            if count < 0 or count > len(body) or at + count * item_sizes[k] > len(body):
                return starts, counts, -1
            starts[row, k] = at
            counts[row, k] = count
            at += count * item_sizes[k]
    return starts, counts, at


def _even(values: AnyArray, counts: IntArray) -> AnyArray | Ragged:
    if len(counts) and (counts == counts[0]).all():
        return values.reshape(len(counts), int(counts[0]))
    return Ragged(values, counts)


def text_columns(data: bytes, start: int, elements: list[PlyElement], name: str) -> dict[str, dict[str, Any]]:
    """Return the columns of each element by name, from a body of text that begins at this byte."""
    numbers = parse_numbers(data[start:].decode("ascii", errors="replace"), name)
    at = 0
    result = {}
    for element in elements:
        is_list = np.array([item.count_dtype is not None for item in element.properties], dtype=np.bool_)
        starts, counts, end = _scan_numbers(numbers, at, element.count, is_list)
        if end < 0:
            raise _truncated(name, element, len(numbers), "numbers")
        at = int(end)
        columns: dict[str, Any] = {}
        for k, item in enumerate(element.properties):
            first = np.cumsum(counts[:, k]) - counts[:, k]
            index = np.arange(counts[:, k].sum()) + np.repeat(starts[:, k] - first, counts[:, k])
            values = _as_declared(numbers[index], item, name)
            columns[item.name] = _even(values, counts[:, k]) if is_list[k] else values
        result[element.name] = columns
    return result


def _as_declared(values: FloatArray, item: PlyProperty, name: str) -> AnyArray:
    dtype = item.dtype.newbyteorder("=")
    if dtype.kind != "f":
        exact = whole(values, name, f"the property {item.name!r} with the value")
        limits = np.iinfo(dtype)
        if len(exact) and (exact.min() < limits.min or exact.max() > limits.max):
            raise ModelError(
                f"{name}: the property {item.name!r} leaves the range of its type {dtype}; export it again"
            )
        return exact.astype(dtype)
    with np.errstate(over="ignore"):  # becomes infinite, which build_source reports with its row
        return values.astype(dtype)


@entry
def _scan_numbers(numbers: np.ndarray, at: int, n_rows: int, is_list: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Return where each property of each row starts, its number of values, and the end (-1: too short)."""
    n = len(is_list)
    starts = np.zeros((n_rows, n), np.int64)
    counts = np.ones((n_rows, n), np.int64)
    for row in range(n_rows):
        for k in range(n):
            if is_list[k]:
                if at >= len(numbers) or not 0 <= numbers[at] <= len(numbers):
                    return starts, counts, -1
                counts[row, k] = np.int64(numbers[at])
                at += 1
            starts[row, k] = at
            at += counts[row, k]
            if at > len(numbers):
                return starts, counts, -1
    return starts, counts, at

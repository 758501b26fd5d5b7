"""At which crossings of rows and columns there are samples: a bit for each, and numbers for those that there are.

A crossing's number is ``row * columns + column``; the *rank* of a sample is how many come before it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, BoolArray, IntArray
from meshsimp_pymoo.plane.footprint import Footprint, lattice_footprint
from meshsimp_pymoo.reprs import brief

# Crossings that are counted together, whole bytes.
BLOCK = 256
BYTES = BLOCK // 8
# Bits in each byte; and of a block those before each of its crossings.
COUNT = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1).sum(axis=1).astype(np.uint16)
BEFORE = np.packbits(np.tri(BLOCK, BLOCK, -1, bool), axis=1, bitorder="little")
# Numbers that are looked up together, and crossings that are unpacked together: some megabytes.
AT_ONCE = 1 << 15
UNPACKED = 1 << 22


@brief
@dataclass(frozen=True, eq=False)
class Lattice:
    """R rows and C columns, and which of their crossings have a sample.

    Attributes
    ----------
    bits : (R, B) uint8 array
        Packed from the lowest bit on; whole blocks.
    columns : int
        C.

    Examples
    --------
    >>> lattice = Lattice.of(np.array([[True, False, True], [False, True, True]]))
    >>> lattice.count, lattice.numbers(np.arange(4)).tolist(), lattice.ranks(np.array([2, 5])).tolist()
    (4, [0, 2, 4, 5], [1, 3])
    """

    bits: AnyArray
    columns: int

    @classmethod
    def empty(cls, rows: int, columns: int) -> Lattice:
        """Return one without samples."""
        return cls(np.zeros((rows, -(-columns // BLOCK) * BYTES), np.uint8), columns)

    @classmethod
    def of(cls, there: BoolArray) -> Lattice:
        """Return one with samples where they are said (R, C) to be."""
        lattice = cls.empty(*there.shape)
        lattice.enter(0, there)
        return lattice

    def enter(self, first: int, there: BoolArray) -> None:
        """Note which samples the rows from ``first`` on have."""
        packed = np.packbits(there, axis=1, bitorder="little")
        self.bits[first : first + len(there), : packed.shape[1]] = packed

    def rows(self, first: int, end: int) -> BoolArray:
        """Return which samples the rows from ``first`` to before ``end`` have."""
        return np.unpackbits(self.bits[first:end], axis=1, count=self.columns, bitorder="little").astype(bool)

    def bands(self, *, more: int = 0) -> list[tuple[int, int]]:
        """Return first and last row, exclusive, of bands that can be unpacked; each has ``more`` rows of the next."""
        n, step = len(self.bits), max(1, UNPACKED // self.columns)
        return [(first, min(first + step + more, n)) for first in range(0, max(n - more, 1), step)]

    def at(self, rows: IntArray, columns: IntArray) -> BoolArray:
        """Return which of these crossings have a sample; the arrays are broadcast together."""
        there: BoolArray = (self.bits[rows, columns >> 3] >> (columns & 7).astype(np.uint8)) & 1 != 0
        return there

    @cached_property
    def _before(self) -> IntArray:
        """How many samples there are before each block, and all."""
        counts = COUNT[self.bits].reshape(-1, BYTES).sum(axis=1, dtype=np.int64)
        return np.concatenate([[0], np.cumsum(counts)])

    @property
    def count(self) -> int:
        """How many samples there are."""
        return int(self._before[-1])

    def ranks(self, numbers: IntArray) -> IntArray:
        """Return the ranks of crossings that have a sample, by their numbers."""
        numbers = np.asarray(numbers, np.int64)
        found = np.empty(len(numbers), np.int64)
        blocks = self.bits.reshape(-1, BYTES)
        for first in range(0, len(numbers), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            row, column = np.divmod(numbers[part], self.columns)
            block = row * (self.bits.shape[1] // BYTES) + column // BLOCK
            before = blocks[block] & BEFORE[column % BLOCK]
            found[part] = self._before[block] + COUNT[before].sum(axis=1, dtype=np.int64)
        return found

    def numbers(self, ranks: IntArray) -> IntArray:
        """Return the numbers of samples by their ranks; the inverse of :meth:`ranks`."""
        ranks = np.asarray(ranks, np.int64)
        found = np.empty(len(ranks), np.int64)
        blocks = self.bits.reshape(-1, BYTES)
        for first in range(0, len(ranks), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            block = np.searchsorted(self._before, ranks[part], side="right") - 1
            there = np.unpackbits(blocks[block], axis=1, bitorder="little").cumsum(axis=1, dtype=np.uint16)
            within = (there <= (ranks[part] - self._before[block])[:, None]).sum(axis=1)
            row, at = np.divmod(block, self.bits.shape[1] // BYTES)
            found[part] = row * self.columns + at * BLOCK + within
        return found

    def has_any(self, top: int, bottom: int, left: int, right: int) -> bool:
        """Tell whether there are samples between these rows and columns, inclusive; now and then also by one beside."""
        return bool(self.bits[top : bottom + 1, left >> 3 : (right >> 3) + 1].any())

    def count_in(self, top: int, bottom: int, left: int, right: int) -> int:
        """Return how many samples there are between these rows and columns, inclusive."""
        step = max(1, UNPACKED // self.columns)
        bands = ((first, min(first + step, bottom + 1)) for first in range(top, bottom + 1, step))
        return sum(int(self.rows(first, end)[:, left : right + 1].sum()) for first, end in bands)

    def without_singles(self) -> Lattice:
        """Return the samples that belong to a face: a cell of four rows and columns has one if it has three samples."""
        found = Lattice.empty(len(self.bits), self.columns)
        before = np.zeros(self.columns, bool)
        for first, end in self.bands(more=1):
            there = self.rows(first, end)
            solid = cells(there) > 0
            used = np.zeros_like(there)
            used[0] = before
            for row in (slice(None, -1), slice(1, None)):
                for column in (slice(None, -1), slice(1, None)):
                    used[row, column] |= solid
            used &= there
            found.enter(first, used)
            before = used[-1]
        return found

    def ends(self) -> tuple[IntArray, IntArray, IntArray]:
        """Return the rows that have samples, and the first and last columns of these in each."""
        first, last = np.zeros((2, len(self.bits)), np.int64)
        some = np.zeros(len(self.bits), bool)
        for top, end in self.bands():
            there = self.rows(top, end)
            some[top:end] = there.any(axis=1)
            first[top:end] = there.argmax(axis=1)
            last[top:end] = self.columns - 1 - there[:, ::-1].argmax(axis=1)
        rows = np.flatnonzero(some)
        return rows, first[rows], last[rows]

    def footprint(self, x: AnyArray, y: AnyArray, box: tuple[int, int, int, int] | None = None) -> Footprint:
        """Return where its faces are, or those of a part and a little more.

        Parameters
        ----------
        x, y : (C,), (R,) float arrays
            Where its columns and rows are in the unit square.
        box : (int, int, int, int), optional
            First and last row, first and last column of the part.
        """
        if box is None:
            return lattice_footprint(self.bits, x, y)
        top, bottom, left, right = box
        first, end = left >> 3, (right >> 3) + 1
        bits = self.bits[top : bottom + 1, first:end]
        return lattice_footprint(bits, x[8 * first : 8 * end], y[top : bottom + 1])


def cells(there: BoolArray) -> IntArray:
    """Return how many faces each cell (R - 1, C - 1) between samples (R, C) has: two of four samples, one of three."""
    wide = there.astype(np.int8)
    corners = wide[:-1, :-1] + wide[:-1, 1:] + wide[1:, :-1] + wide[1:, 1:]
    found: IntArray = np.maximum(corners - 2, 0)
    return found

"""Bits of samples at crossings: their numbers and ranks, single ones, and what belongs to a face."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meshsimp_pymoo.plane import lattice as lattice_module
from meshsimp_pymoo.plane.lattice import BLOCK, Lattice, cells

shapes = st.tuples(st.integers(2, 6), st.sampled_from([2, 3, 9, BLOCK - 1, BLOCK, BLOCK + 3]))
maps = shapes.flatmap(lambda shape: arrays(np.bool_, shape))


@given(there=maps)
def test_ranks_and_numbers_are_inverse_and_count_what_is_before(there):
    lattice, numbers = Lattice.of(there), np.flatnonzero(there)
    assert lattice.count == len(numbers)
    np.testing.assert_array_equal(lattice.rows(0, len(there)), there)
    np.testing.assert_array_equal(lattice.numbers(np.arange(len(numbers))), numbers)
    np.testing.assert_array_equal(lattice.ranks(numbers), np.arange(len(numbers)))
    np.testing.assert_array_equal(lattice.at(*np.divmod(np.arange(there.size), there.shape[1])), there.ravel())
    rows, first, last = lattice.ends()
    ends = [(i, np.flatnonzero(row)[0], np.flatnonzero(row)[-1]) for i, row in enumerate(there) if row.any()]
    assert list(zip(rows.tolist(), first.tolist(), last.tolist(), strict=True)) == ends


@given(there=maps, at_once=st.sampled_from([1, 2 * BLOCK, 10**6]))
def test_samples_of_no_cell_with_three_are_singles_however_many_rows_are_looked_at_together(there, at_once):
    wanted = np.zeros_like(there)
    for i, j in np.ndindex(there.shape[0] - 1, there.shape[1] - 1):
        cell = there[i : i + 2, j : j + 2]
        assert cells(there)[i, j] == max(int(cell.sum()) - 2, 0)
        if cell.sum() >= 3:
            wanted[i : i + 2, j : j + 2] |= cell
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lattice_module, "UNPACKED", at_once)
        np.testing.assert_array_equal(Lattice.of(there).without_singles().rows(0, len(there)), wanted)

"""What the mutations that search on the live triangulation refuse."""

from __future__ import annotations

import pytest

from meshsimp_pymoo.search.operators import Relocation, SizeStep


@pytest.mark.parametrize("mutation", [Relocation, SizeStep])
def test_impossible_probabilities_are_refused(mutation: type) -> None:
    with pytest.raises(ValueError, match=r"prob = 1\.2 is not a probability"):
        mutation(prob=1.2)

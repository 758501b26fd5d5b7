from __future__ import annotations

import pytest
from samples import surface

from meshsimp_pymoo.surface.rules import Rules


def test_unknown_words_are_refused_where_rules_are_made():
    for make in (Rules, lambda **rules: surface("plane:5", **rules)):
        with pytest.raises(ValueError, match="footprint='bbox' is unknown; choose one of 'model', 'hull'"):
            make(footprint="bbox")
        with pytest.raises(ValueError, match="outside='drop' is unknown; choose one of 'nearest', 'ignore'"):
            make(outside="drop")
        with pytest.raises(ValueError, match="measure='l2' is unknown; choose one of 'error'"):
            make(measure="l2")

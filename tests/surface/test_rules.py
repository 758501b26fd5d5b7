from __future__ import annotations

import pytest
from samples import surface

from meshsimp_pymoo.errors import InputError
from meshsimp_pymoo.surface.rules import Rules


def test_unknown_words_are_refused_where_rules_are_made():
    for make in (Rules, lambda **rules: surface("plane:5", **rules)):
        with pytest.raises(InputError, match="footprint is 'bbox': expected one of model, hull"):
            make(footprint="bbox")
        with pytest.raises(InputError, match="outside is 'drop': expected one of nearest, ignore"):
            make(outside="drop")
        with pytest.raises(InputError, match="measure is 'l2': expected one of error"):
            make(measure="l2")

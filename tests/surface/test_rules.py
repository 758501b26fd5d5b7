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


def test_lines_need_a_tolerance_and_a_tolerance_needs_lines():
    with pytest.raises(InputError, match=r"need line_tolerance=L \(--line-tolerance L\): how far they may move"):
        Rules(break_lines="kerbs.geojson")
    with pytest.raises(InputError, match=r"^break lines need line_tolerance=L"):
        Rules(break_lines=[[[0, 0], [1, 1]]])
    with pytest.raises(InputError, match=r"a file named 'outlin' \(did you mean 'outline'\?\) need line_tolerance"):
        Rules(break_lines="outlin")
    with pytest.raises(InputError, match=r"line_tolerance=0.5 \(--line-tolerance 0.5\) is for break lines, and there"):
        Rules(line_tolerance=0.5)
    assert Rules(break_lines="outline").line_tolerance is Rules(break_lines="sharp:20").line_tolerance is None
    with pytest.raises(InputError, match="line_tolerance is -1: expected a number of at least 0"):
        Rules(break_lines="outline", line_tolerance=-1)


def test_rules_say_their_lines_in_words():
    named = Rules(break_lines="kerbs.geojson", line_tolerance=0.25)
    assert named.in_words == "break lines of kerbs.geojson within 0.25"
    assert Rules(break_lines="outline").in_words == "break lines of outline"
    assert Rules(break_lines=[[[0, 0], [1, 1]]], line_tolerance=1).in_words == "break lines within 1"
    assert named.of_the_model == Rules()

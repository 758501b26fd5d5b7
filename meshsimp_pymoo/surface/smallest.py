"""The smallest mesh that break lines allow, and how far they would have to move for a smaller one."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.measures import LENGTH, TRIANGLES
from meshsimp_pymoo.surface.surface import Surface
from meshsimp_pymoo.surface.units import in_unit

# The tolerance is doubled until it is large enough, and that interval halved so often.
HALVINGS = 7
# Digits of the tolerance that is found.
DIGITS = 2


def smallest_mesh(surface: Surface) -> int:
    """Return how many triangles the mesh of the pinned vertices alone has, those of break lines among them.

    Of a closed surface with what each part needs besides.
    """
    triangles = int(surface.evaluate(surface.spanning(surface.pinned)[None])[0, TRIANGLES])
    # the pole of a single part alone spans nothing
    return surface.least_triangles if triangles == 0 and isinstance(surface, ClosedSurface) else triangles


def facts_of_lines(surface: Surface, lines: ModelLines) -> dict[str, Any]:
    """Return what break lines of a surface were, what is left of them, and what they ask of every mesh, by name."""
    found = dict(lines.found)
    return {
        "tolerance": lines.tolerance,
        # of lines that were stored nobody knows more than what is left of them
        "lines": int(found.pop("lines", len(lines.names))),
        "vertices": int(found.pop("line_vertices", sum(map(len, lines.originals)))),
        "thinned": len(lines.vertices),
        "forced_edges": len(lines.segments),
        "smallest": smallest_mesh(surface),
        "found": {name: int(count) for name, count in found.items()},
    }


def lines_in_words(facts: Mapping[str, Any], unit: str = LENGTH) -> str:
    """Return what break lines are and ask of every mesh, by what is recorded of them.

    >>> facts = {"lines": 4, "vertices": 804, "thinned": 243, "tolerance": 0.3, "forced_edges": 239, "smallest": 500}
    >>> print(lines_in_words(facts, "m"))
    4 lines, 804 vertices thinned to 243 within 0.3 m; every mesh keeps their 239 edges, the smallest has 500 triangles
    """
    lines, edges, smallest = facts["lines"], facts["forced_edges"], facts["smallest"]
    within = f"{facts['tolerance']:.4g}{in_unit(unit)}"
    return (
        f"{lines:,} line{'s' * (lines != 1)}, {facts['vertices']:,} vertices thinned to {facts['thinned']:,} within "
        f"{within}; every mesh keeps their {edges:,} edge{'s' * (edges != 1)}, the smallest has {smallest:,} "
        f"triangle{'s' * (smallest != 1)}"
    )


def tolerance_for(surface: HeightSurface | ClosedSurface, triangles: int) -> float | None:
    """Return about the least tolerance of the break lines that allows a mesh of at most so many triangles.

    Each tolerance that is tried takes a thinning of the lines and one evaluation.

    Parameters
    ----------
    surface : HeightSurface or ClosedSurface
        A model whose rules name break lines.
    triangles : int
        The most triangles.

    Returns
    -------
    float or None
        In two digits [model units]; None if even lines of which only the ends are left allow none.

    Examples
    --------
    >>> from meshsimp_pymoo.datasets import load
    >>> from meshsimp_pymoo.surface.model import build_model
    >>> from meshsimp_pymoo.surface.rules import Rules
    >>> zigzag = [[[-1, -0.5], [-0.5, 0], [0, -0.5], [0.5, 0], [1, -0.5]]]
    >>> fine = HeightSurface(build_model(load("plane:9")), Rules(break_lines=zigzag, line_tolerance=0.1))
    >>> smallest_mesh(fine), tolerance_for(fine, 4)
    (10, 0.56)
    """
    model: Any = surface.model.without_lines()
    rules = surface.rules

    def allows(tolerance: float) -> bool:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)  # they were said of the tolerance that was asked for
            try:
                tried = type(surface)(model, replace(rules, weights=None, line_tolerance=tolerance))
            except ModelError:  # nothing of a line is left
                return False
        return 0 < smallest_mesh(tried) <= triangles

    assert surface.model.lines is not None
    high = max(surface.model.lines.tolerance, 1e-6 * model.diagonal)
    while not allows(high):
        if high > model.diagonal:
            return None
        high *= 2.0
    low = high / 2.0
    for _ in range(HALVINGS):
        middle = (low * high) ** 0.5
        low, high = (low, middle) if allows(middle) else (middle, high)
    short = float(f"{high:.{DIGITS - 1}e}")
    return short if short >= high or allows(short) else high

"""The smallest mesh that break lines allow, and how far they would have to move for a smaller one."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.measures import TRIANGLES
from meshsimp_pymoo.surface.surface import Surface

# The tolerance is doubled until it is large enough, and that interval halved so often.
HALVINGS = 7
# Digits of the tolerance that is found.
DIGITS = 2


def smallest_mesh(surface: Surface) -> int:
    """Return how many triangles the mesh of the pinned vertices alone has, those of break lines among them."""
    return int(surface.evaluate(surface.pinned[None])[0, TRIANGLES])


def facts_of_lines(surface: Surface, lines: ModelLines) -> dict[str, Any]:
    """Return what break lines of a surface were, what is left of them, and what they ask of every mesh, by name."""
    return {
        "tolerance": lines.tolerance,
        "lines": len(lines.originals),
        "vertices": sum(map(len, lines.originals)),
        "thinned": len(lines.vertices),
        "forced_edges": len(lines.segments),
        "smallest": smallest_mesh(surface),
        "found": {name: int(count) for name, count in lines.found.items()},
    }


def tolerance_for(surface: HeightSurface, triangles: int) -> float | None:
    """Return about the least tolerance of the break lines that allows a mesh of at most so many triangles.

    Each tolerance that is tried takes a thinning of the lines and one evaluation.

    Parameters
    ----------
    surface : HeightSurface
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
    >>> zigzag = [[[0, 0, 0], [3, 1, 0], [6, 0, 0], [9, 1, 0], [12, 0, 0]]]
    >>> fine = HeightSurface(build_model(load("plane:13")), Rules(break_lines=zigzag, line_tolerance=0.1))
    >>> smallest_mesh(fine) > 4, tolerance_for(fine, 4)
    (True, 1.0)
    """
    model, rules = surface.model.without_lines(), surface.rules

    def allows(tolerance: float) -> bool:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)  # they were said of the tolerance that was asked for
            try:
                tried = HeightSurface(model, replace(rules, weights=None, line_tolerance=tolerance))
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

"""How lines become break lines of a closed surface: found in it or located on it, thinned once, forced in the plane."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from meshsimp_pymoo.errors import InputError, ModelError
from meshsimp_pymoo.plane.segments import enclosed_points, points_on
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.given_lines import lines_of_word
from meshsimp_pymoo.surface.line_thinning import Chords, thinned_runs
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.lining import USUAL_TOLERANCE
from meshsimp_pymoo.surface.polylines import Runs, cut_into_runs, farthest_between
from meshsimp_pymoo.surface.rules import is_word_for_lines

# An image so near to a chord may be on it: a few times what images are rounded to.
ON = 2.0**-50


def lined_closed_model(model: ClosedModel, break_lines: Any, tolerance: float | None) -> ClosedModel:
    """Return the model with break lines: what every mesh must hold."""
    if tolerance is None:
        tolerance = USUAL_TOLERANCE * model.diagonal
    if not 0.0 <= tolerance < np.inf:
        raise InputError(f"line_tolerance is {tolerance}; give how far break lines may move in space, 0 or more")
    if not is_word_for_lines(break_lines):
        raise ModelError(f"{model.name}: is a closed surface, whose break lines are 'sharp:DEGREES' or 'outline'")
    lines = lines_of_word(model, break_lines)
    runs = cut_into_runs(lines, model.poles.ravel())
    kept, n_back = thinned_runs(
        runs, model.xy, model.points, float(tolerance), farthest_in=model.xy, also=partial(_astray, model, runs)
    )
    chains = tuple(runs.joined(kept))
    found = {
        "lines": len(lines),
        "line_vertices": sum(map(len, lines)),
        "kept_line_vertices": len(np.unique(np.concatenate(chains))),
        "put_back_line_vertices": n_back,
    }
    made = ModelLines(
        originals=tuple(model.points[line] for line in lines),
        chains=chains,
        names=tuple(f"line {k + 1}" for k in range(len(lines))),
        tolerance=float(tolerance),
        added=np.empty(0, np.int64),
        found={what: n for what, n in found.items() if n},
    )
    return replace(model, lines=made)


def _astray(model: ClosedModel, runs: Runs, chords: Chords) -> set[tuple[int, int]]:
    """Return what is put back so that no vertex of the model is on the wrong side of a chord, or on it by chance."""
    longer = np.flatnonzero(chords.high - chords.low > 1)
    rings = [chords.between(runs, s) for s in longer.tolist()]
    if not rings:
        return set()
    wrong = set(enclosed_points(model.xy, np.arange(model.n_vertices), rings)[:, 1].tolist())
    on = points_on(model.xy, chords.ends[longer], ON)
    wrong |= {k for p, k in on.tolist() if p not in rings[k]}
    return {
        (int(chords.run[s]), int(chords.low[s]) + farthest_between(model.xy[ring], 0, len(ring) - 1)[0])
        for k, (s, ring) in enumerate(zip(longer, rings, strict=True))
        if k in wrong
    }

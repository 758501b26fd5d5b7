"""Two methods compared in one function, by the paper's procedure, beside what the study does in several steps."""

from __future__ import annotations

from meshsimp_pymoo.comparison.analysis import (
    Comparison,
    coverage_table,
    dominance_rates,
    epsilon_table,
    unary_scores,
)
from meshsimp_pymoo.comparison.statistics import rank_sum

INDICATORS = ("hvr", "cardinality", "epsilon", "coverage")


def compared(runs, a, b, indicator, optimal=None):
    """Compare two methods by an indicator of a run, or by which share of the other's runs each run dominates."""
    if indicator in ("hvr", "cardinality"):
        scores = unary_scores(runs, optimal)
        x, y = (getattr(scores[method], indicator).astype(float) for method in (a, b))
    else:
        table = (epsilon_table if indicator == "epsilon" else coverage_table)(runs)
        forth, back = table.values[a, b], table.values[b, a]
        x, y = dominance_rates(forth, back, indicator), dominance_rates(back, forth, indicator)
    test = rank_sum(x, y)
    return Comparison(indicator, a, b, x, y, test.p, test.p, test.a12, note=test.note)

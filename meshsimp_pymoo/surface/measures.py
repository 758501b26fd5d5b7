"""What is said of a simplified mesh: one row for each measure, from which everything else knows it.

A measure is a field of `Quality`; its row (`Measure`) says how it comes from the numbers that evaluation adds up, what
it is called, and what it can be used for. The columns of ``front.csv``, the attributes of a front's solutions, the
wishes of the shell command, the objectives of a problem and the rows of the page follow from the table. A new measure
is a new field here and, if it needs a number that the columns below do not hold, a new one of these, which all
who make such rows fill (``CONTRIBUTING.md`` lists them).

Some measures are of the mesh, not of a row: searches, which only ask for rows, do not know them and need not pay for
them; who makes a mesh measures them too. Where nobody has, they are NaN.

Nothing heavy is imported here: the shell command's ``--help`` is made of the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

# Columns of the table that evaluation fills, one row a subset.
ERROR, TRIANGLES, VERTICES, SQUARES, MAXIMUM, UNCOVERED = range(6)
# Columns from this one on, where asked for: the error by region, equal runs of the vector, which are patches in space.
REGIONS = 6


class Measure(NamedTuple):
    """A row of the table.

    Attributes
    ----------
    of : callable, optional
        Its value for rows (..., 6) of the table that evaluation fills and the total weight of the vertices; None: it is
        one of the mesh.
    label : str
        What people call it.
    meaning : str
        What it is, in a few words.
    unit : str
        Its unit; empty for a number of things.
    minimised : str
        What ``--measure`` calls it, if it can be an objective.
    power : int
        Of an objective: moves of vertices lower the sum of the deviations to this power, weighted. That of the eighth
        powers stands for the maximum: the largest outweigh all others.
    is_sum : bool
        Whether its order is that of this sum; thinning goes by the maximum itself where it is not.
    wish : str
        What ``--NAME`` asks for, if a mesh can be chosen by it.
    searched : str
        Of a wish for an error: the objective of the same order, which is lowered for it.
    more_is_better : bool
        Whether nobody wants at most so much of it.
    is_share : bool
        Whether people read it in per cent.
    of_lines : bool
        Whether only models with break lines have it.
    of_borders : bool
        Whether only surfaces with a border have it: of a closed one without holes it is 0.
    of_closed : str
        What it is of a closed surface, if that differs.
    """

    of: Callable[[Any, float], Any] | None
    label: str
    meaning: str
    unit: str = ""
    minimised: str = ""
    power: int = 1
    is_sum: bool = False
    wish: str = ""
    searched: str = ""
    more_is_better: bool = False
    is_share: bool = False
    of_lines: bool = False
    of_borders: bool = False
    of_closed: str = ""

    @property
    def is_error(self) -> bool:
        """Whether it is a deviation, a length."""
        return self.unit == LENGTH


def _measure(of: Callable[[Any, float], Any], **facts: Any) -> Any:
    return field(metadata={"measure": Measure(of, **facts)})


def _measure_of_mesh(**facts: Any) -> Any:
    return field(default=math.nan, metadata={"measure": Measure(None, **facts)})


def _root(values: Any) -> Any:
    import numpy as np

    return np.sqrt(values)


LENGTH = "model units"


@dataclass(frozen=True)
class Quality:
    """What is said of a simplified mesh.

    Attributes
    ----------
    error : float
        Sum of w_p d_p over all N original vertices p: weight times deviation. All w_p are 1 unless the model has
        weights [model units].
    triangles : int
        Number of triangles of the mesh.
    vertices : int
        Number of vertices its triangles use.
    mean_error : float
        Mean of d_p over all N original vertices, weighted by w [model units].
    rms_error : float
        Root mean square of d_p over all N original vertices, weighted by w [model units].
    max_error : float
        Maximum of d_p over the original vertices whose weight is not 0 [model units].
    uncovered : int
        Number of original vertices that no triangle covers; of a closed surface those whose image is in none.
    surface_error : float
        Mean of the deviation from the original surface between its vertices: at the centroids of the original faces,
        weighted by their area in the plane. Faces without one are left out; uncovered centroids cost what uncovered
        vertices do. Of a closed surface: their distance in space to all of the mesh, weighted by their area there.
        Weights of vertices change nothing [model units].
    min_angle_median : float
        Median over the triangles of the least angle of each, in the plane; of a closed surface in space [degrees].
    below_5_degrees : float
        Share of the triangles whose least angle, measured so, is below 5 degrees.
    line_max_error : float
        Largest vertical distance of the mesh from a vertex of a break line as it was given; of a closed surface in
        space. Only where the model has break lines [model units].
    line_mean_error : float
        Mean of that distance, weighted by the length of the lines. Only where the model has break lines [model units].
    """

    error: float = _measure(
        lambda table, weight: table[..., ERROR],
        label="error",
        meaning="sum over all original vertices",
        unit=LENGTH,
        minimised="l1",
        is_sum=True,
    )
    triangles: int = _measure(
        lambda table, weight: table[..., TRIANGLES],
        label="triangles",
        meaning="",
        wish="the most accurate of at most N triangles",
    )
    vertices: int = _measure(lambda table, weight: table[..., VERTICES], label="vertices", meaning="")
    mean_error: float = _measure(
        lambda table, weight: table[..., ERROR] / weight,
        label="mean error",
        meaning="mean over all original vertices",
        unit=LENGTH,
        wish="the smallest with a mean deviation of at most E [model units]",
        searched="error",
    )
    rms_error: float = _measure(
        lambda table, weight: _root(table[..., SQUARES] / weight),
        label="RMS error",
        meaning="root mean square",
        unit=LENGTH,
        minimised="rms",
        is_sum=True,
        power=2,
        wish="the smallest with a root mean square deviation of at most E [model units]",
        searched="rms_error",
    )
    max_error: float = _measure(
        lambda table, weight: table[..., MAXIMUM],
        label="max error",
        meaning="the largest at any original vertex",
        unit=LENGTH,
        minimised="max",
        power=8,
        wish="the smallest that deviates nowhere by more than E [model units]",
        searched="max_error",
    )
    uncovered: int = _measure(
        lambda table, weight: table[..., UNCOVERED],
        label="uncovered",
        meaning="original vertices that no triangle covers",
        of_borders=True,
    )
    surface_error: float = _measure_of_mesh(
        label="surface error",
        meaning="mean between the original vertices",
        unit=LENGTH,
    )
    min_angle_median: float = _measure_of_mesh(
        label="least angle",
        meaning="median over the triangles, in the plane",
        of_closed="median over the triangles",
        unit="degrees",
        more_is_better=True,
    )
    below_5_degrees: float = _measure_of_mesh(
        label="thin triangles",
        meaning="share whose least angle is below 5 degrees",
        is_share=True,
    )
    line_max_error: float = _measure_of_mesh(
        label="line max error",
        meaning="the largest at any vertex of a break line",
        unit=LENGTH,
        of_lines=True,
    )
    line_mean_error: float = _measure_of_mesh(
        label="line mean error",
        meaning="mean along the break lines",
        unit=LENGTH,
        of_lines=True,
    )

    def __reduce__(self) -> Any:  # so that one that comes from another process is equal, numbers that are not known too
        return quality_of, ([(item.name, getattr(self, item.name)) for item in fields(self)],)

    @property
    def in_words(self) -> str:
        """What a mesh is told apart by."""
        return (
            f"{self.triangles:,} triangle{'s' * (self.triangles != 1)}, error {self.error:.6g}, "
            f"mean {self.mean_error:.4g}, max {self.max_error:.4g}"
        )


MEASURES: dict[str, Measure] = {item.name: item.metadata["measure"] for item in fields(Quality)}
# Those that can be minimised beside the triangles.
OBJECTIVES: dict[str, Measure] = {name: measure for name, measure in MEASURES.items() if measure.minimised}
COUNTED = tuple(item.name for item in fields(Quality) if item.type == "int")
# Those that rows do not say, of any model; and of models with break lines alone.
OF_MESH = tuple(name for name, measure in MEASURES.items() if measure.of is None and not measure.of_lines)
OF_LINES = tuple(name for name, measure in MEASURES.items() if measure.of_lines)


def quality_of(values: Iterable[tuple[str, Any]]) -> Quality:
    """Return the quality with these (name, value) pairs, whole numbers as such."""
    numbers: dict[str, Any] = {}
    for name, value in values:
        # one and the same NaN, so that qualities without a number are equal
        numbers[name] = int(value) if name in COUNTED else math.nan if math.isnan(value) else float(value)
    return Quality(**numbers)


def as_quality(row: Any, total_weight: float, **of_mesh: float) -> Quality:
    """Name the columns of one row (6,) that evaluation filled, and what is known of its mesh beside.

    ``total_weight`` is that of the model, N without any.
    """
    named = ((name, measure.of(row, total_weight)) for name, measure in MEASURES.items() if measure.of is not None)
    return quality_of([*named, *of_mesh.items()])


def measured(table: Any, measure: str, total_weight: float) -> Any:
    """Return an objective's measure for each row (..., 6) that evaluation filled; the numbers of :func:`as_quality`.

    Examples
    --------
    >>> import numpy as np
    >>> measured(np.array([[6.0, 2, 4, 20, 4, 0]]), "rms_error", 5.0)
    array([2.])
    """
    require_measure(measure)
    of: Any = MEASURES[measure].of
    return of(table, total_weight)


def checked_objectives(objectives: Sequence[str]) -> tuple[str, ...]:
    """Return the objectives as a tuple, or raise a ValueError that says what they must be."""
    names = (objectives,) if isinstance(objectives, str) else tuple(objectives)
    measures = names[:-1]
    if names[-1:] != ("triangles",) or not measures or set(measures) - set(OBJECTIVES) or len(set(names)) < len(names):
        raise ValueError(
            f"objectives={names!r} cannot be minimised; name one or more of {', '.join(map(repr, OBJECTIVES))}, each "
            "once, and 'triangles' last, as in ('error', 'triangles')"
        )
    return names


def require_measure(measure: str) -> None:
    """Raise a ValueError if this is no objective's measure."""
    if measure not in OBJECTIVES:
        raise ValueError(f"measure={measure!r} is unknown; choose one of {', '.join(map(repr, OBJECTIVES))}")

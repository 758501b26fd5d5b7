"""What every operator asks of its arguments and of the problem, with errors that name the way out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshsimp_pymoo import arrays
from meshsimp_pymoo.surface.surface import Surface


def pinned_vertices(problem: Any, operator: object) -> NDArray[np.bool_]:
    """Return ``problem.pinned``, the (N,) bool array of the vertices that every solution keeps.

    Raises
    ------
    TypeError
        If the problem has no such array: it is not a ``MeshProblem`` (or a wrapper that shows its
        ``pinned``).
    """
    try:
        pinned = problem.pinned
    except AttributeError:
        raise TypeError(_not_a_mesh_problem(problem, operator, "pinned")) from None
    return np.asarray(pinned)


def surface_of(problem: Any, operator: object) -> Surface:
    """Return ``problem.surface``: what a chromosome means, with the model's neighbours and places.

    Raises
    ------
    TypeError
        If the problem has none: it is not a ``MeshProblem`` (or a wrapper that shows its ``surface``).
    """
    try:
        surface: Surface = problem.surface
    except AttributeError:
        raise TypeError(_not_a_mesh_problem(problem, operator, "surface")) from None
    return surface


def require_bool(X: NDArray[Any], operator: object) -> None:
    """Refuse chromosomes that are not bool.

    Raises
    ------
    TypeError
        If ``X`` has any other dtype.
    """
    arrays.require_bool(
        X,
        f"{type(operator).__name__} works on bool chromosomes (True: the vertex is kept)",
        "pass sampling=RandomSubset() to the algorithm, or start from a bool array",
    )


def require_probability(name: str, value: float) -> float:
    """Return ``value`` if it is a probability.

    Raises
    ------
    ValueError
        If it is not in [0, 1].
    """
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"{name} = {value} is not a probability; give a number from 0 to 1")
    return float(value)


def _not_a_mesh_problem(problem: Any, operator: object, attribute: str) -> str:
    return (
        f"{type(operator).__name__} reads problem.{attribute}, which {type(problem).__name__} does not have; "
        "use it on a MeshProblem (or give your problem wrapper that attribute)"
    )

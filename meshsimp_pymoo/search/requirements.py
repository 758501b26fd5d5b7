"""What every operator asks of its arguments and of the problem, with errors that name the way out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


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


def mesh_neighbours(problem: Any, operator: object) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Return ``problem.model.neighbours``: the one-rings as CSR arrays ``indptr`` (N + 1,) and ``indices``.

    Raises
    ------
    TypeError
        If the problem has no mesh model.
    """
    try:
        indptr, indices = problem.model.neighbours
    except AttributeError:
        raise TypeError(_not_a_mesh_problem(problem, operator, "model.neighbours")) from None
    return indptr, indices


def plane_coordinates(problem: Any, operator: object) -> NDArray[np.float64]:
    """Return ``problem.model.xy``, the (N, 2) positions of the vertices in the plane.

    Raises
    ------
    TypeError
        If the problem has no mesh model.
    """
    pinned_vertices(problem, operator)
    try:
        xy: NDArray[np.float64] = problem.model.xy
    except AttributeError:
        raise TypeError(_not_a_mesh_problem(problem, operator, "model.xy")) from None
    return xy


def summed_measure(problem: Any) -> str:
    """Return the first objective's measure, which local search and thinning lower: "error" or "rms_error".

    Raises
    ------
    ValueError
        If it is the maximum, which is no sum over the vertices.
    """
    measure = str(problem.objectives[0])
    if measure == "max_error":
        raise ValueError(
            "thinning and relocation lower a sum over the vertices, and the first objective is the maximum, "
            "'max_error'; use objectives=('error', ...) or ('rms_error', ...), or operators that only evaluate, "
            "as in nsga2_v1() and nsga2_v2()"
        )
    return measure


def require_bool(X: NDArray[Any], operator: object) -> None:
    """Refuse chromosomes that are not bool.

    Raises
    ------
    TypeError
        If ``X`` has any other dtype.
    """
    if X.dtype != np.bool_:
        raise TypeError(
            f"{type(operator).__name__} works on bool chromosomes (True: the vertex is kept), not {X.dtype}; "
            "pass sampling=RandomSubset() to the algorithm, or start from a bool array"
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

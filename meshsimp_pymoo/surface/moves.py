"""What the compiled loops of the search ask of a surface: one name for each question, one answer for each record.

Thinning, insertion and annealing are compiled loops over a surface's *ground* (a NamedTuple: what does not change) and
its *books* (a NamedTuple: the triangulation of a subset that is being changed). They call the functions below, which
have no body: a surface says with `answers` which compiled function is meant where the ground is of its class, and the
compiler chooses by that class when it compiles the loop. It costs nothing when the loop runs. Both records are handed
on as pointers (:mod:`~meshsimp_pymoo.plane.borrow`): their members are read by name.

A vertex that is in the triangulation is a *site*. Costs are sums over the vertices, in the measure of the rules; moves
are of one site v to one vertex w, where -1 for either means none: so removals and insertions are moves too. *Cells*,
the triangles of a height surface, are what insertion looks through for its next vertex; their numbers are below
2 N + 8.

Examples
--------
>>> from typing import NamedTuple
>>> from numba import njit
>>> class Fixed(NamedTuple):
...     cost: float
>>> @answers(total_cost, Fixed)
... @njit
... def fixed_cost(ground, books):
...     return ground.cost
>>> @njit
... def twice(ground, books):
...     return 2.0 * total_cost(ground, books)
>>> twice(Fixed(1.5), 0)
3.0
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any, TypeVar

import numpy as np
from numba.extending import overload

from meshsimp_pymoo.compiling.functions import ANSWER_OPTIONS, entry
from meshsimp_pymoo.plane.borrow import borrowed

Function = TypeVar("Function", bound=Callable[..., Any])

# The files of this package with answers.
ANSWERING = tuple(f"meshsimp_pymoo.surface.{name}" for name in ("live", "free", "closed.live", "closed.free"))


class Answers:
    """The answers to one question; to look at them is to look at all of this package, and at no others.

    They decide by what the machine code of a loop is known on disk. Code for the records of others is not kept there.
    """

    def __init__(self) -> None:
        self._found: list[Any] = []

    def add(self, answer: Any) -> None:
        """Take one more."""
        self._found.append(answer)

    def __iter__(self) -> Iterator[Any]:
        for name in ANSWERING:
            import_module(name)
        own = [answer for answer in self._found if answer.__module__ in ANSWERING]
        return iter(sorted(own, key=lambda answer: (answer.__module__, answer.__name__)))  # whoever came first


def answers(question: Callable[..., Any], record: type) -> Callable[[Function], Function]:
    """Return a decorator: the compiled function below it answers one of this module's questions for a class of ground.

    Parameters
    ----------
    question : callable
        A function of this module.
    record : type
        The NamedTuple class of the ground.
    """
    arity = len(inspect.signature(question).parameters)

    def register(function: Function) -> Function:
        called = {
            2: lambda ground, books: function(ground, books),
            3: lambda ground, books, v: function(ground, books, v),
            4: lambda ground, books, v, w: function(ground, books, v, w),
            5: lambda ground, books, v, w, limit: function(ground, books, v, w, limit),
            6: lambda ground, books, v, most, limit, state: function(ground, books, v, most, limit, state),
            8: lambda ground, books, v, most, limit, first, share, state: function(
                ground, books, v, most, limit, first, share, state
            ),
        }[arity]

        def choose(ground: Any, *_: Any) -> Any:
            return called if getattr(ground, "instance_class", None) is record else None

        # inlined: a call of a call
        overload(question, strict=False, jit_options=ANSWER_OPTIONS)(choose)
        question.__dict__["parts"].add(function)
        return function

    return register


def question(function: Function) -> Function:
    """Make a question of a function: it has answers."""
    function.__dict__["parts"] = Answers()
    return function


def _unanswered() -> Any:
    raise TypeError("a surface answers this inside compiled functions only; ask in a function compiled with numba.njit")


@question
def total_cost(ground: Any, books: Any) -> float:
    """Return the sum of the costs; infinite where there is no mesh."""
    return float(_unanswered())


@question
def error_now(ground: Any, books: Any) -> float:
    """Return what the measure says: the sum of the costs, or the largest deviation; infinite where there is no mesh."""
    return float(_unanswered())


@question
def ranked(ground: Any, books: Any, change: float) -> tuple[float, float]:
    """Return the rank of a removal whose `try_exchange`, the last one, has found this change: lowest first, and ties.

    The change where the measure is a sum; the largest deviation among the vertices that the removal concerns, then the
    change, where it is the maximum; the change, then that deviation, where costs are what deviations exceed a bound by.
    """
    return _unanswered()


@question
def n_triangles(ground: Any, books: Any) -> int:
    """Return the number of triangles of the mesh."""
    return int(_unanswered())


@question
def n_sites(ground: Any, books: Any) -> int:
    """Return the number of sites."""
    return int(_unanswered())


@question
def is_site(ground: Any, books: Any, v: int) -> bool:
    """Tell whether vertex v is a site."""
    return bool(_unanswered())


@question
def is_taken(ground: Any, books: Any, w: int) -> bool:
    """Tell whether there is a site at the place of vertex w, so that w cannot come."""
    return bool(_unanswered())


@question
def urgency(ground: Any, books: Any, v: int) -> float:
    """Return the cost of the cell in which vertex v, no site, lies, or its own where none covers it."""
    return float(_unanswered())


@question
def try_exchange(ground: Any, books: Any, v: int, w: int, limit: float) -> tuple[float, int]:
    """Return the change of cost and of the number of triangles if site v went and vertex w came.

    Infinite where v cannot go, and where the change is found to exceed ``limit`` before it is known.
    """
    return _unanswered()


@question
def exchange(ground: Any, books: Any, v: int, w: int) -> bool:
    """Let site v go and vertex w come; return False, with nothing changed, where v cannot go."""
    return bool(_unanswered())


@question
def sites_around(ground: Any, books: Any, v: int, found: np.ndarray) -> int:
    """List the sites whose removal may cost something else once site v is gone; return their number."""
    return int(_unanswered())


@question
def effort(ground: Any, books: Any) -> int:
    """Return how many cells at site v the last `try_exchange` has found: what trying it again takes."""
    return int(_unanswered())


@question
def n_cells(ground: Any, books: Any) -> int:
    """Return the number of cells there have been: all numbers are below."""
    return int(_unanswered())


@question
def worst_in(ground: Any, books: Any, cell: int) -> tuple[int, float, float]:
    """Return the vertex of a cell that costs most and could come (-1: none costs anything), its cost, the cell's."""
    return _unanswered()


@question
def cells_around(ground: Any, books: Any, v: int, found: np.ndarray) -> int:
    """List the cells at site v, which has just come; return their number."""
    return int(_unanswered())


# Of free meshes, whose edges are searched too (see `surface.free`); ``state`` is that of the random numbers.


@question
def flip(ground: Any, books: Any, h: int, most: int, limit: float, state: np.ndarray) -> bool:
    """Flip the edge of halfedge h, if that costs no more than ``limit`` and makes no more than ``most`` triangles."""
    return bool(_unanswered())


@question
def shift(ground: Any, books: Any, v: int, most: int, limit: float, state: np.ndarray) -> int:
    """Move site v to a vertex inside its star, with these limits; return that vertex, -1 where v stays."""
    return int(_unanswered())


@question
def swap(
    ground: Any, books: Any, v: int, most: int, limit: float, first: float, share: float, state: np.ndarray
) -> int:
    """Let site v collapse and a vertex come where the cost is large; return that vertex, -1: nothing changed.

    That place is drawn from a window on the triangles' records (see `surface.free.drawn`). Where there is room for two
    triangles more, v stays.
    """
    return int(_unanswered())


@question
def settle(ground: Any, books: Any) -> None:
    """Take sums that have been carried on through many moves again."""
    _unanswered()


@question
def take_numbers(ground: Any, books: Any, share: np.ndarray, row: np.ndarray) -> None:
    """Fill a row (7,) with what is said of the mesh: the columns of `measures`, then its surface error.

    ``share`` is the share in the area of each sample behind the vertices, whose deviations make the last; without any
    it is not a number.
    """
    _unanswered()


@entry
def snapshot(ground: Any, books: Any, n: int) -> tuple[np.ndarray, float, int]:
    """Return which of n vertices are sites, as a bool array (n,), the sum of the costs and the number of triangles."""
    g = borrowed(ground)
    live = borrowed(books)
    mask = np.empty(n, np.bool_)
    for v in range(n):
        mask[v] = is_site(g, live, v)
    return mask, total_cost(g, live), n_triangles(g, live)

"""The pymoo problem: which vertices to keep, so that error and size are both small."""

from __future__ import annotations

import copy
import hashlib
import inspect
import os
from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt
from pymoo.core.problem import ElementwiseEvaluationFunction, ElementwiseProblem, Problem

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, require_bool
from meshsimp_pymoo.errors import meant
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.scenes import textured
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.settings import by_name, documentation, settings_of, taken
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.kinds import Model, surface_of
from meshsimp_pymoo.surface.measures import (
    ERROR,
    MAXIMUM,
    MEASURES,
    OBJECTIVES,
    REGIONS,
    SQUARES,
    TRIANGLES,
    UNCOVERED,
    VERTICES,
    Quality,
    as_quality,
    checked_objectives,
)
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.surface import Simplified, Surface, mesh_arrays, mesh_lines

if TYPE_CHECKING:
    import trimesh

# Entries of subsets that are looked at together.
ENTRIES_AT_ONCE = 1 << 24
# Chromosomes whose numbers are remembered; each takes about 200 bytes.
MEMO_SIZE = 100_000
# Regions in which the error may be kept with each solution and each chromosome remembered.
MOST_REGIONS = 4096
# Numbers of each solution that pymoo keeps beside its objectives.
REPORTED = tuple(name for name, measure in MEASURES.items() if name != "triangles" and measure.of is not None)


# What pymoo asks of an evaluation; there are no equality constraints.
VALUES = frozenset(("F", "G", "H"))

# The constraints: an argument of MeshProblem each, and which objective it limits (the first, the last).
CONSTRAINTS = {"max_triangles": -1, "max_objective": 0}


class ThreadRunner:
    """Evaluate a population of a :class:`MeshProblem` on several threads; the kernel runs without Python's lock.

    It holds no threads of its own, so it pickles and deep-copies as a number.

    Parameters
    ----------
    n_threads : int, optional
        Threads to use; all cores by default. The results do not depend on it.
    """

    def __init__(self, n_threads: int | None = None) -> None:
        if n_threads is not None and n_threads < 1:
            raise ValueError(f"n_threads={n_threads} is no number of threads; give 1 or more")
        self.n_threads = n_threads or os.cpu_count() or 1

    __repr__ = as_made

    def __call__(self, f: Any, X: npt.NDArray[Any]) -> list[dict[str, Any]]:
        """Return what ``f`` gives for every row of X, the rows evaluated together."""
        problem: MeshProblem = f.problem
        table = problem.evaluate_subsets(X, n_threads=self.n_threads)
        return [problem.outcome(row) for row in table]


class MeshProblem(ElementwiseProblem):
    """Choose the vertices of a mesh to keep: minimise (error, triangles), or other measures of the error.

    A solution is a bool vector over the vertices in vector order (see :class:`OpenModel`); its mesh is what the
    problem's surface makes of it: of an open model the Delaunay triangulation of the kept vertices in the plane, of
    each part of a closed one the convex hull of their images on a sphere, without what lies in holes. Pinned vertices
    belong to every mesh, whether or not the chromosome says so; with ``repair=PinnedCorners()`` it does, which keeps
    duplicates recognisable.

    Parameters
    ----------
    model : path, built-in name, trimesh.Trimesh, SourceMesh, OpenModel, ClosedModel or Surface
        The original mesh. A surface has its rules already.
    SETTINGS
    options : Options, optional
        How the model is read, in one object; the settings given by name replace its own.
    rules : Rules, optional
        What counts, in one object; the settings given by name replace its own.
    objectives : tuple of str, optional
        What is minimised: one or more of OBJECTIVES (see
        :class:`~meshsimp_pymoo.surface.measures.Quality`), then "triangles". All come from the same evaluation. By
        default the measure of the rules, "error" unless they say otherwise, and "triangles".
    max_triangles : int, optional
        Largest number of triangles, as a pymoo constraint.
    max_objective : float, optional
        Largest value of the first objective, as a pymoo constraint [model units].
    n_threads : int, optional
        Threads of the default runner; all cores by default.
    memo : int
        Number of chromosomes whose numbers are remembered, so that they are not triangulated again; 0: none.
    regions : int
        In how many regions, runs of the vector of equal length, the error is kept with each solution as well, for
        :class:`~meshsimp_pymoo.search.operators.RegionCrossover`; none by default.
    elementwise_runner : callable, optional
        Any pymoo runner in place of the threads.
    **kwargs
        Passed on to pymoo's ``ElementwiseProblem``.

    Attributes
    ----------
    surface : Surface
        What a chromosome means: the model with its rules.
    model : OpenModel or ClosedModel
        The original mesh; it holds the weights.
    options : Options
        How it was read.
    objectives : tuple of str
        Names of the columns of F.
    regions : int
        In how many regions the error is known; at most N.
    pinned : (N,) bool array
        Vertices that every mesh keeps.

    Notes
    -----
    Whatever the objectives, ``out`` also holds
    REPORTED,
    so that ``result.opt.get("max_error")`` works; with ``regions`` also their errors, ``region_error``. A subset that
    emits no triangle is no mesh; it gets the worst objectives, N times the diagonal and 2 N triangles, which any mesh
    dominates.

    Examples
    --------
    >>> problem = MeshProblem("roof:3")
    >>> problem.evaluate(problem.pinned)             # the four corners alone: the ridge falls by 1 at three vertices
    array([3., 2.])
    """

    @by_name(Options, Rules)
    def __init__(
        self,
        model: str | Path | trimesh.Trimesh | SourceMesh | Model | Surface,
        *,
        options: Options | None = None,
        rules: Rules | None = None,
        objectives: Sequence[str] | None = None,
        max_triangles: int | None = None,
        max_objective: float | None = None,
        n_threads: int | None = None,
        memo: int = MEMO_SIZE,
        regions: int = 0,
        elementwise_runner: Callable[..., Any] | None = None,
        **kwargs: Any,
    ) -> None:
        """Open the model; ``help(MeshProblem)`` says what each argument means."""
        self.options = taken(Options, options, kwargs)
        own = [name for name, known in settings_of(Rules).items() if name in kwargs and not known.derived]
        named = {name: kwargs.pop(name) for name in own}
        _refuse_unknown(kwargs)
        if max_triangles is not None and max_triangles < 1:
            raise ValueError(f"max_triangles={max_triangles} leaves no mesh; give 1 or more")
        if max_objective is not None and not max_objective >= 0:
            raise ValueError(f"max_objective={max_objective} is no error; give 0 or more")
        if not 0 <= regions <= MOST_REGIONS:
            raise ValueError(f"regions={regions} is no number of regions; give 0 to {MOST_REGIONS}")
        if hasattr(model, "rules"):
            if named or rules is not None or self.options != Options():
                raise TypeError(
                    f"a {type(model).__name__} is a model that was read, with its rules; make another one, or give the "
                    "model and leave the surface out"
                )
            self.surface: Surface = cast("Surface", model)
            names = objectives if objectives is not None else (self.surface.rules.measure, "triangles")
            self.objectives = checked_objectives(names)
            if self.objectives[0] != self.surface.rules.measure:
                raise ValueError(
                    f"the first objective is {self.objectives[0]!r}, and the surface's rules measure "
                    f"{self.surface.rules.measure!r}; make the surface with Rules(measure={self.objectives[0]!r})"
                )
        else:
            measure = (rules or Rules()).measure
            self.objectives = checked_objectives(objectives if objectives is not None else (measure, "triangles"))
            rules = taken(Rules, rules, named | {"measure": self.objectives[0]})
            self.surface = surface_of(open_model(model, self.options), rules)
        if isinstance(self.surface, ClosedSurface):
            self.surface.refuse_regions(regions)
        self.max_triangles = max_triangles
        self.max_objective = max_objective
        self._memo: OrderedDict[bytes, FloatArray] = OrderedDict()
        self._memo_size = memo
        self.regions = min(regions, self.surface.n_vertices)
        super().__init__(
            n_var=self.surface.n_vertices,
            n_obj=len(self.objectives),
            n_ieq_constr=sum(getattr(self, name) is not None for name in CONSTRAINTS),
            xl=0,
            xu=1,
            vtype=bool,
            elementwise_runner=elementwise_runner if elementwise_runner is not None else ThreadRunner(n_threads),
            **kwargs,
        )

    def minimising(self, measure: str) -> MeshProblem:
        """Return this problem of two objectives with another measure of the error, or itself; all else is as here."""
        if measure == self.objectives[0]:
            return self
        other = copy.copy(self)
        other.surface = self.surface.measuring(measure)
        other.objectives = checked_objectives((measure, "triangles"))
        other._memo = OrderedDict()
        return other

    @property
    def model(self) -> Any:
        """The original mesh."""
        return self.surface.model

    @property
    def pinned(self) -> BoolArray:
        """Vertices that every mesh keeps, (N,)."""
        return self.surface.pinned

    def evaluate(self, X: npt.NDArray[Any], *args: Any, **kwargs: Any) -> Any:
        """Evaluate one chromosome (N,) or many (P, N) as any pymoo problem does; float genomes are refused.

        So are algorithms of one objective, where there are more: pymoo's evaluator tells which one asks.
        """
        algorithm = kwargs.get("algorithm")
        if algorithm is not None and self.n_obj > 1 and minimises_one_number(algorithm):
            name = type(algorithm).__name__
            raise TypeError(
                f"{name} minimises one number, and this problem has {self.n_obj} objectives; give {name} "
                "WeightedSum(problem, w), or use weighted_ga_v1(w) or an algorithm for several objectives, as NSGA2"
            )
        _require_bool(X)
        wanted = kwargs.get("return_values_of") or ("F",)
        if kwargs.get("return_as_dictionary") and np.shape(X) == (self.n_var,) and self._is_evaluated_plainly(wanted):
            # for algorithms that make one solution after the other: the same by way of pymoo takes thrice the time
            out = {name: () for name in wanted} | self.outcome(self.evaluate_subsets(X[None])[0])
            return {name: np.array(value, dtype=float)[()] for name, value in out.items()}
        return super().evaluate(X, *args, **kwargs)

    def _is_evaluated_plainly(self, wanted: Sequence[str]) -> bool:
        """Whether nobody else takes part: no runner but our own, no callback, nothing asked but what there is."""
        return (
            VALUES.issuperset(wanted)
            and type(self.elementwise_runner) is ThreadRunner
            and self.elementwise_func is ElementwiseEvaluationFunction
            and self.callback is None
            and self.replace_nan_values_by is None
        )

    def _evaluate(self, x: BoolArray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out.update(self.outcome(self.evaluate_subsets(x[None, :], n_threads=1)[0]))

    def evaluate_subsets(self, X: npt.NDArray[Any], *, n_threads: int = 1) -> FloatArray:
        """Evaluate chromosomes (P, N) together, each different one once; return the table (P, 6 + regions).

        See `meshsimp_pymoo.surface.measures` for its columns. Pinned vertices are added first.
        """
        _require_bool(X)
        X = np.asarray(X)
        at_once = max(8 * n_threads, ENTRIES_AT_ONCE // self.n_var)
        if len(X) > at_once:  # without a copy of all of them
            parts = [X[k : k + at_once] for k in range(0, len(X), at_once)]
            return np.vstack([self.evaluate_subsets(part, n_threads=n_threads) for part in parts])
        X = X | self.pinned
        if not self._memo_size:
            return self._kernel(X, n_threads)
        packed = np.packbits(X, axis=1)
        keys = [hashlib.blake2b(row, digest_size=16).digest() for row in packed]
        memo = self._memo
        found: dict[bytes, FloatArray] = {}
        missing: dict[bytes, int] = {}
        for i, key in enumerate(keys):
            row = memo.get(key)
            if row is None:
                missing.setdefault(key, i)
            else:
                found[key] = row
                memo.move_to_end(key)
        if missing:
            rows = list(missing.values())
            fresh = self._kernel(X if len(rows) == len(X) else X[rows], n_threads)
            for key, row in zip(missing, fresh, strict=True):
                found[key] = memo[key] = row
            while len(memo) > self._memo_size:
                memo.popitem(last=False)
        return np.array([found[key] for key in keys])

    def _kernel(self, X: BoolArray, n_threads: int) -> FloatArray:
        return self.surface.evaluate(X, threads=n_threads, regions=self.regions)

    def outcome(self, row: FloatArray) -> dict[str, Any]:
        """Turn one row of :meth:`evaluate_subsets` into pymoo's ``out``."""
        quality = self.as_quality(row if row[TRIANGLES] else self._worst_row())
        out: dict[str, Any] = {name: getattr(quality, name) for name in REPORTED}
        F = [float(getattr(quality, name)) for name in self.objectives]
        out["F"] = F
        if self.n_ieq_constr:
            limits = ((column, getattr(self, name)) for name, column in CONSTRAINTS.items())
            out["G"] = [F[column] - limit for column, limit in limits if limit is not None]
        if self.regions:
            # No mesh: its error, that of the worst one, is spread evenly.
            known = np.isfinite(row[REGIONS:])
            out["region_error"] = np.where(known, row[REGIONS:], quality.error / self.regions)
        return out

    def as_quality(self, row: FloatArray) -> Quality:
        """Name the columns of one row of :meth:`evaluate_subsets`."""
        return as_quality(row, self.surface.total_weight)

    def _worst_row(self) -> FloatArray:
        """Return the numbers of a mesh that every other one dominates."""
        surface, row = self.surface, np.full(REGIONS, np.nan)
        row[ERROR] = surface.total_weight * surface.diagonal
        row[SQUARES] = surface.total_weight * surface.diagonal**2
        row[MAXIMUM] = surface.diagonal
        row[TRIANGLES], row[VERTICES], row[UNCOVERED] = 2 * surface.n_vertices, 0, surface.n_vertices
        return row

    @property
    def worst(self) -> tuple[float, ...]:
        """Objectives that every mesh dominates, given to subsets that emit no triangle.

        By default (N times the diagonal, 2 N); the mean and the maximum of the error are at worst the diagonal.
        """
        nothing = np.zeros(REGIONS)
        return tuple(self.outcome(nothing)["F"])

    def simplify(self, kept: npt.NDArray[Any]) -> Simplified:
        """Return the triangles, the quality and the deviation at every vertex of one chromosome (N,)."""
        _require_bool(kept)
        if np.shape(kept) != (self.n_var,):
            raise ValueError(f"a subset has shape ({self.n_var},), one entry a vertex, not {np.shape(kept)}")
        return self.surface.simplify(np.asarray(kept) | self.pinned)

    def quality(self, kept: npt.NDArray[Any]) -> Quality:
        """Return all quality numbers of one chromosome (N,)."""
        return self.simplify(kept).quality

    def mesh(self, kept: npt.NDArray[Any]) -> trimesh.Trimesh:
        """Return the simplified mesh of one chromosome (N,) in the frame of the file, with its looks and attributes.

        Its vertices are original ones, in double precision, in vector order; none is without a face. With break lines
        its ``metadata`` hold them: ``break_lines`` are chains of rows of its vertices, ``break_line_names`` what each
        is called.
        """
        return mesh_of(self.surface, self.simplify(kept).faces)

    def __repr__(self) -> str:
        surface = self.surface
        limits = [(name, getattr(self, name), column) for name, column in CONSTRAINTS.items()]
        said = [f"{self.objectives[column]} at most {limit:,g}" for _, limit, column in limits if limit is not None]
        said.append(surface.rules.in_words)
        if self.regions:
            said.append(f"error in {self.regions:,} regions")
        besides = ", ".join(filter(None, said))  # rules of which nothing is said have no words
        objectives = f"{', '.join(self.objectives[:-1])} and {self.objectives[-1]}"
        return (
            f"<{type(self).__name__} {self.model.name}: {self.n_var:,} vertices, minimise {objectives}"
            f"{'; ' if besides else ''}{besides}>"
        )

    def name(self) -> str:
        """Return the model's name."""
        return f"MeshProblem({self.model.name})"

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_memo": OrderedDict()}

    def __deepcopy__(self, memo: dict[int, Any]) -> MeshProblem:
        # Nothing of it changes during a run but what it remembers, so copies may share it (save_history makes many).
        return self


def mesh_of(surface: Surface, faces: IntArray) -> trimesh.Trimesh:
    """Return triangles (M, 3) of a surface's vertices as a mesh in the frame of the file; see `MeshProblem.mesh`."""
    import trimesh

    model = surface.model
    vertices, compact, attributes = mesh_arrays(model, faces)
    mesh = trimesh.Trimesh(vertices=vertices, faces=compact, process=False, validate=False)
    if "color" in attributes:
        mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=attributes["color"])
    if model.material is not None and "uv" in attributes:
        mesh.visual = textured(attributes, model.material, mesh.visual)
    looks = {"color"} | ({"uv"} if mesh.visual.kind == "texture" else set())
    mesh.vertex_attributes.update({name: values for name, values in attributes.items() if name not in looks})
    chains, names = mesh_lines(surface, faces)
    if chains:
        used, _ = used_rows(np.asarray(faces))
        mesh.metadata["break_lines"] = [np.searchsorted(used, chain) for chain in chains]
        mesh.metadata["break_line_names"] = list(names)
    return mesh


def _doc() -> str:
    """Return the documentation of MeshProblem with what the tables know."""
    doc = (inspect.getdoc(MeshProblem) or "").replace("SETTINGS", documentation(Options, Rules))
    doc = doc.replace("OBJECTIVES", ", ".join(f'"{name}"' for name in OBJECTIVES))
    return doc.replace("REPORTED", ", ".join(f"``{name}``" for name in REPORTED))


MeshProblem.__doc__ = _doc()


def _refuse_unknown(kwargs: dict[str, Any]) -> None:
    unknown = sorted(set(kwargs) - set(inspect.signature(Problem).parameters))
    if "max_error" in unknown:
        raise TypeError(
            "MeshProblem has no argument 'max_error'; max_objective= bounds the first objective, simplify_to(model, "
            "max_error=E) finds the smallest mesh that deviates nowhere by more than E"
        )
    if unknown:
        names = [*inspect.signature(MeshProblem).parameters, *inspect.signature(Problem).parameters]
        raise TypeError(f"MeshProblem has no argument {unknown[0]!r}{meant(unknown[0], names)}")


def minimises_one_number(algorithm: Any) -> bool:
    """Tell whether an algorithm of pymoo is for one objective alone, by what it prints of a run.

    pymoo marks them in no other way. `WeightedGA` prints something else, and `RandomSearch` keeps fronts all the same.
    """
    from pymoo.algorithms.soo.nonconvex.random_search import RandomSearch
    from pymoo.util.display.single import SingleObjectiveOutput

    return isinstance(getattr(algorithm, "output", None), SingleObjectiveOutput) and not isinstance(
        algorithm, RandomSearch
    )


def _require_bool(X: Any) -> None:
    require_bool(
        X,
        "chromosomes are bool vectors, one entry a vertex",
        "pass sampling=RandomSubset(), crossover=SubsetUniformCrossover() or OAX(), mutation=NeighbourShift() and "
        "repair=PinnedCorners() to the algorithm, since pymoo's defaults make real numbers",
    )

"""A front as a sequence of solutions: look at it, pick one of them, take its mesh.

It comes from a pymoo result or from a folder that was written before, and shows itself in a notebook::

    front = Front.from_result(minimize(MeshProblem("face.ply"), nsga2_v1(), seed=1))
    front = Front.load("out")                       # of tiles too
    front.best(triangles=500).mesh.export("small.ply")
    front.knee().error, front[3].triangles, len(front)
    front.save("out")
"""

from __future__ import annotations

import base64
import inspect
import io
import operator
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache, cached_property
from pathlib import Path, PurePath
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias, overload

import numpy as np
import numpy.typing as npt
from pymoo.optimize import minimize

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import Missed, ModelError, ResultError, warn_of, way_to_install
from meshsimp_pymoo.files import claim_file, draw_into, new_file
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import written_suffixes
from meshsimp_pymoo.indicators import knee, non_dominated
from meshsimp_pymoo.opening import applicable, open_grid, open_model
from meshsimp_pymoo.problem import MeshProblem, mesh_of
from meshsimp_pymoo.reprs import in_short
from meshsimp_pymoo.search.budgets import Moves, moves_of, seconds_given
from meshsimp_pymoo.search.coarse import of_size, slope_of
from meshsimp_pymoo.search.free import MEASURED_SHARE, FreeLadder, guarding, in_turn, rungs_of
from meshsimp_pymoo.search.operators.nested_subsets import NestedSubsets
from meshsimp_pymoo.search.starting import at_hand, begun
from meshsimp_pymoo.search.targeted import TargetedSearch, require_for_a_wish, targeted
from meshsimp_pymoo.search.wishes import USUAL_BUDGET, beside, checked_limits, measure_for, require_numbers, shortfall
from meshsimp_pymoo.settings import plain, read_back
from meshsimp_pymoo.storage import (
    MESHES_BY_DEFAULT,
    PICTURES,
    STATEMENT,
    even_selection,
    read_front,
    write_front,
    write_solution,
)
from meshsimp_pymoo.surface.accuracy import Compared, compare, compare_subset
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.kinds import Model, as_stored, stored_arrays, surface_of
from meshsimp_pymoo.surface.measures import (
    ERROR,
    LENGTH,
    MAXIMUM,
    MEASURES,
    OF_LINES,
    REGIONS,
    SQUARES,
    TRIANGLES,
    UNCOVERED,
    VERTICES,
    Measure,
    Quality,
    quality_of,
)
from meshsimp_pymoo.surface.nested import Chromosomes, Nested
from meshsimp_pymoo.surface.rules import USUAL_RATIO, Rules, is_file_of_lines
from meshsimp_pymoo.surface.solid import Solid, as_solid
from meshsimp_pymoo.surface.surface import (
    FreeMesh,
    Refitted,
    Simplified,
    Surface,
    free_faces,
    freedom_of,
    measured_meshes,
    mesh_lines,
)
from meshsimp_pymoo.surface.units import in_unit, length_unit, reference_system
from meshsimp_pymoo.surface.weld import pieces

if TYPE_CHECKING:
    import pandas
    import trimesh
    from matplotlib.axes import Axes

    from meshsimp_pymoo.report.document import Framed
    from meshsimp_pymoo.report.statement import QualityStatement

__all__ = ["Front", "FrontSolution", "simplify_to", "starting_front"]

# Rows of the table that a notebook shows.
SHOWN_ROWS = 12
# What a page in a notebook may take, which is saved with it.
NOTEBOOK_BYTES = 4_000_000
# What the front that a search started from is called, and how many of its thousands of points are drawn.
START = "adaptive thinning (start)"
START_POINTS = 200
# Between two solutions of a nested front the smallest within a limit is looked for to this share of its triangles.
HALVED = 0.01
# A level of detail has at most so much fewer triangles than the finer one before it; fewer than so many make none: to
# draw them takes no less time.
LEVEL_FACTOR, FEWEST_TRIANGLES = 4, 32
# Of larger models what is said of the quality of a mesh beside its front leaves distances in space out, and of the
# largest nothing is said: these take seconds for each million vertices.
SPACE_VERTICES, STATED_VERTICES = 600_000, 4_000_000
# What the best solution can be asked for by.
LIMITS = tuple(name for name, measure in MEASURES.items() if not measure.more_is_better)


if TYPE_CHECKING:
    _Numbers: TypeAlias = Quality  # so that type checkers and editors know the properties that are set below
else:
    _Numbers = object


class FrontSolution(_Numbers):
    """One solution of a front: its numbers, and its mesh when it is asked for.

    Attributes
    ----------
    front : Front
        Where it belongs.
    solution : int
        Its number in the front, from 0; the column ``solution`` of ``front.csv``.
    quality : Quality
        All its numbers; each of them is an attribute of the solution too (``error``, ``triangles``, ...).
    """

    def __init__(self, front: Front, solution: int) -> None:
        self.front = front
        self.solution = solution
        self.quality: Quality = front.quality[solution]

    @cached_property
    def kept(self) -> BoolArray:
        """The vertices that stay (N,), in vector order; of a free mesh those of its triangles, and the pinned ones."""
        kept: BoolArray = self.front.kept[self.solution]
        return kept

    @property
    def free(self) -> bool:
        """Whether its edges are chosen for the error, and not by the Delaunay rule."""
        return self.front.faces[self.solution] is not None

    @cached_property
    def simplified(self) -> Simplified:
        """Triangles, deviation and cover of the original vertices, computed when first used."""
        surface, own = self.front.surface, self.front.faces[self.solution]
        return surface.simplify(self.kept | surface.pinned) if own is None else surface.of_faces(own)

    @cached_property
    def refitted(self) -> Refitted:
        """The same triangles with vertices where their error is least, computed when first used."""
        return self.refit()

    def refit(self, *, until: float | None = None) -> Refitted:
        """Return the same triangles with vertices where their error is least, as far as ``perf_counter() = until``."""
        return self.front.surface.refit(self.simplified, until=until)

    def accuracy(self, *, refitted: bool = False) -> QualityStatement:
        """Measure the mesh in the words of surveyors: LE90, bias, NMAD, coverage, distances in space and more.

        ``solution.accuracy().save("quality")`` writes the statement as data, as a page, and of a raster its residuals.

        Parameters
        ----------
        refitted : bool
            Measure the mesh with its vertices where their error is least instead.

        Returns
        -------
        QualityStatement
            All numbers are attributes; see :class:`~meshsimp_pymoo.surface.accuracy.Accuracy`.
        """
        from meshsimp_pymoo.report.statement import stated

        return stated(self._compared(refitted=refitted), mesh=self._called(refitted=refitted))

    def _quick_statement(self) -> QualityStatement:
        """Return the statement of the mesh without what would take more than some seconds, of which it says so."""
        from meshsimp_pymoo.report.statement import stated

        if self.front.surface.n_vertices <= SPACE_VERTICES:
            return self.accuracy()
        left_out = "Distances in space are left out here, so that nobody had to wait; meshsimp quality takes them."
        return stated(self._compared(), mesh=self._called(), space_samples=0, left_out=(left_out,))

    def _compared(self, *, refitted: bool = False) -> Compared:
        """Return the mesh beside its original; that of tiles is not held at once."""
        surface = self.front.surface
        if isinstance(surface, GridSurface) and not refitted:
            return compare_subset(surface, self.kept | surface.pinned)
        return compare(surface, self.refitted if refitted else self.simplified)

    def _called(self, *, refitted: bool = False) -> dict[str, Any]:
        """Return what a statement of quality calls the mesh."""
        name = f"{PurePath(self.front.name).name}, solution {self.solution}"
        return {"name": name, "solution": self.solution, "free": self.free, "refitted": refitted}

    @property
    def points(self) -> FloatArray:
        """The model's vertices (N, 3), as pictures show them; ``faces`` are rows of them."""
        return self.front.surface.points

    @cached_property
    def faces(self) -> IntArray:
        """The triangles (M, 3) as rows of the model's vertices."""
        surface, own = self.front.surface, self.front.faces[self.solution]
        return surface.triangles(self.kept | surface.pinned) if own is None else own

    @cached_property
    def lines(self) -> tuple[IntArray, ...]:
        """The break lines of its mesh, chains of its edges, as rows of the model's vertices; none without lines."""
        return mesh_lines(self.front.surface, self.faces)[0]

    @property
    def attributes(self) -> dict[str, npt.NDArray[Any]]:
        """Colours and other attributes of the model's vertices."""
        return self.front.model.attributes

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The simplified mesh in the frame of the model's file, with its colours and attributes."""
        return mesh_of(self.front.surface, self.faces)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False, solid: float | None = None) -> Path:
        """Write the mesh in the format of the path's suffix; see :func:`meshsimp_pymoo.formats.table.write_mesh`.

        A mesh that the front's folder holds in this format is copied, unless it names files beside it.

        Parameters
        ----------
        path : path
            The file.
        overwrite : bool
            Replace a file that exists.
        solid : float, optional
            Close the mesh of a height surface for printing: by walls along its outline and holes, and a flat base so
            far below its lowest point [file units].

        Raises
        ------
        ResultError
            If the file exists (and ``overwrite`` is not given), its suffix is no mesh format, it cannot be written, or
            the surface cannot be made solid: it is closed already, or its coordinates are no lengths.
        """
        path = claim_file(path, written_suffixes(), overwrite=overwrite)
        suffix = path.suffix.lower()
        stored = self.front.stored_mesh(self.solution) if solid is None else None
        with new_file(path) as unfinished:
            if stored is not None and stored.suffix == suffix and not self.front.has_material:
                shutil.copyfile(stored, unfinished)
            else:
                write_solution(unfinished, self.front.surface, self.faces, solid=solid)
        return path

    def save_compressed(
        self, path: str | os.PathLike[str], *, overwrite: bool = False, solid: float | None = None
    ) -> float:
        """Write the mesh compressed, as GLB can be (extra ``draco``); return how far its vertices moved at most [m].

        That is no more than a twentieth of its mean error, as far as single precision lets it.

        Raises
        ------
        ResultError
            As :meth:`save` does, or if the format is not compressed, or the library is missing.
        """
        path = claim_file(path, written_suffixes(), overwrite=overwrite)
        with new_file(path) as unfinished:
            written = write_solution(
                unfinished, self.front.surface, self.faces, solid=solid, compressed_by=self.mean_error
            )
        assert written.packed is not None
        return written.packed.shift

    def solid(self, thickness: float) -> Solid:
        """Return the mesh closed by walls and a flat base, so far below its lowest point [file units].

        See :mod:`meshsimp_pymoo.surface.solid`.

        Raises
        ------
        ResultError
            If the surface is closed already, or its coordinates are no lengths.
        """
        return as_solid(self.front.surface, self.faces, thickness)

    def plot(self, ax: Axes | None = None, **kwargs: Any) -> Axes:
        """Draw the mesh; see :func:`meshsimp_pymoo.report.figures.plot_mesh`."""
        from meshsimp_pymoo.report.figures import plot_mesh

        return plot_mesh(self, ax, **{"exaggeration": self.front.surface.view.exaggeration} | kwargs)

    def plot_error(self, ax: Axes | None = None, **kwargs: Any) -> Axes:
        """Draw the deviation at every original vertex; see :func:`meshsimp_pymoo.report.figures.plot_error`."""
        from meshsimp_pymoo.report.figures import plot_error

        found = self.simplified
        return plot_error(self.front.surface, found.deviation, ax, **{"covered": found.covered} | kwargs)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, FrontSolution):
            return NotImplemented
        return self.front is other.front and self.solution == other.solution

    def __hash__(self) -> int:
        return hash((id(self.front), self.solution))

    def __repr__(self) -> str:
        free = ", free" if self.free else ""
        return f"<solution {self.solution} of {len(self.front)}{free}: {self.quality.in_words}>"

    def _repr_png_(self) -> bytes:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(5.0, 4.2), dpi=90, layout="constrained")
        self.plot(figure.subplots()).set_title(
            f"solution {self.solution}: {self.triangles:,} triangles, mean error {self.mean_error:.3g}"
            + in_unit(self.front.unit),
            fontsize=10,
        )
        return _png(figure)


def _number(name: str, measure: Measure) -> property:
    """Return the property of a solution that is one of its numbers."""

    def value(solution: FrontSolution) -> Any:
        return getattr(solution.quality, name)

    meaning, unit = (f": {measure.meaning}" if measure.meaning else ""), (f" [{measure.unit}]" if measure.unit else "")
    return property(value, doc=f"{measure.label[0].upper()}{measure.label[1:]}{meaning}{unit}.")


for _name, _measure in MEASURES.items():
    setattr(FrontSolution, _name, _number(_name, _measure))


class Front(Sequence[FrontSolution]):
    """The solutions of a search that no other solution beats, sorted by triangles.

    Make one with :meth:`from_result`, :meth:`from_population`, :meth:`from_subsets` or :meth:`load`. It is a sequence:
    ``len(front)``, ``front[3]``, ``front[-1]``, ``for solution in front``; a slice is a front too.

    Parameters
    ----------
    quality : sequence of Quality, length S
        The numbers of each solution, sorted by triangles, then error.
    kept : (S, N) bool array, or Nested
        The solutions in vector order; or by rows of the file, as tiles find them, and then made one at a time. Of a
        free mesh the vertices that its triangles use, and the pinned ones.
    faces : sequence of (M, 3) int array or None, length S, optional
        The triangles of each solution that is a free mesh, as rows of the model's vertices; None where it is the
        Delaunay mesh of ``kept``, as all are by default.
    problem : MeshProblem, optional
        What they are solutions of; by default it is read again from what ``run`` says of it when it is needed.
    surface : Surface, optional
        The same without a problem.
    run : mapping, optional
        The record of the run; see ``run.json``.
    folder : Path, optional
        Where the front is stored.
    meshes : sequence of str, optional
        Path of each stored mesh relative to the folder; empty where there is none.
    series : mapping of str to (n, 2) array, optional
        Other fronts to compare with: the error that was minimised [model units] and triangles, by name. They are
        drawn faintly behind this one and stored with it; more can be added to the attribute ``series``.

    Examples
    --------
    The whole front of a roof: without its ridge, with one end of it, and exact:

    >>> import itertools
    >>> problem = MeshProblem("roof:3")
    >>> subsets = [np.array(bits, dtype=bool) for bits in itertools.product([False, True], repeat=9)]
    >>> front = Front.from_subsets(problem, subsets)
    >>> front.F.tolist()
    [[3.0, 2.0], [1.5, 3.0], [0.0, 4.0]]
    >>> front.best(triangles=3)
    <solution 1 of 3: 3 triangles, error 1.5, mean 0.1667, max 1>
    """

    def __init__(
        self,
        quality: Sequence[Quality],
        kept: npt.ArrayLike | Nested,
        *,
        faces: Sequence[npt.ArrayLike | None] = (),
        problem: MeshProblem | None = None,
        surface: Surface | None = None,
        run: Mapping[str, Any] | None = None,
        folder: Path | None = None,
        meshes: Sequence[str] = (),
        series: Mapping[str, npt.ArrayLike] | None = None,
    ) -> None:
        self.quality = tuple(quality)
        self._kept = kept if isinstance(kept, Nested) else np.asarray(kept, dtype=bool)
        self.run = dict(run or {})
        self.folder = folder
        self.series: dict[str, npt.ArrayLike] = dict(series or {})
        self._meshes = tuple(meshes) or ("",) * len(self.quality)
        self._problem = problem
        self._surface = problem.surface if problem is not None else surface
        #: Of a stored front of a closed surface: the images that its chromosomes are of, see `surface.kinds`.
        self._images: Mapping[str, npt.NDArray[Any]] = {}
        if not self.quality:
            raise ValueError("a front has at least one solution; this one has none")
        shape = (len(self._kept), 1) if isinstance(self._kept, Nested) else self._kept.shape
        if len(shape) != 2 or not shape[0] == len(self.quality) == len(self._meshes):
            raise ValueError(f"{len(self.quality)} solutions cannot have kept of the shape {shape}")
        self.faces: tuple[IntArray | None, ...] = self._checked(faces)

    def _checked(self, faces: Sequence[npt.ArrayLike | None]) -> tuple[IntArray | None, ...]:
        """Return the triangles of free meshes in their one spelling, if they fit the numbers and ``kept``."""
        found: list[IntArray | None] = [None] * len(self.quality)
        if len(faces) not in (0, len(found)):
            raise ValueError(f"{len(found)} solutions cannot have faces for {len(faces)}; give None for Delaunay ones")
        for row, own in enumerate(faces):
            if own is None:
                continue
            if isinstance(self._kept, Nested):
                raise ValueError("solutions by rows of the file, as of tiles, are Delaunay meshes; give no faces")
            try:
                said = self.quality[row]
                found[row] = free_faces(own, self._kept[row], triangles=said.triangles, vertices=said.vertices)
            except ValueError as problem:
                raise ValueError(f"solution {row}: {problem}") from None
        return tuple(found)

    # ---------------------------------------------------------------------------------------------- where it comes from

    @classmethod
    def from_subsets(
        cls,
        problem: MeshProblem,
        kept: npt.ArrayLike,
        *,
        ends: bool = False,
        wish: Mapping[str, float] | None = None,
        until: float | None = None,
    ) -> Front:
        """Evaluate chromosomes and keep those that no other one beats, each once, and that meet the constraints.

        All meshes are Delaunay; :meth:`from_population` knows the free ones that a search made. Those of the front are
        measured whole: between the vertices too, and their angles.

        Parameters
        ----------
        problem : MeshProblem
            What they are chromosomes of.
        kept : (P, N) bool array
            The vertices that stay, in vector order; pinned ones are added.
        ends : bool
            Add what is known without a search: all vertices, and the pinned ones alone.
        wish : mapping of str to float, optional
            Limits, by measure. Where any solution holds all of them, those are left out that miss one which is neither
            of the triangles nor of what is minimised: they would beat it.
        until : float, optional
            Meshes that are not begun by ``perf_counter() = until`` are not measured; the numbers are NaN.

        Raises
        ------
        LookupError
            If none of them is a mesh that meets the constraints.
        """
        return cls._of(problem, np.atleast_2d(np.asarray(kept)), [], ends=ends, wish=wish, until=until)

    @classmethod
    def from_population(
        cls,
        problem: MeshProblem,
        population: Any,
        *,
        ends: bool = False,
        wish: Mapping[str, float] | None = None,
        until: float | None = None,
    ) -> Front:
        """Take over a population: its chromosomes, as :meth:`from_subsets` does, and the free meshes beside them.

        An individual can carry a free mesh, ``individual.get("free")``, a
        :class:`~meshsimp_pymoo.surface.surface.FreeMesh`. It is taken where it is better than the mesh of the
        individual's subset: its first objective is lower, with no more triangles. Then all meshes are compared, and
        limits and constraints are those of what is taken.

        Parameters
        ----------
        problem : MeshProblem
            What its individuals are chromosomes of.
        population : pymoo Population
            Such as ``algorithm.opt``.
        ends, wish, until
            As in :meth:`from_subsets`.

        Raises
        ------
        LookupError
            If there is no mesh that meets the constraints.
        """
        rows, free = population.get("X", "free", to_numpy=False)
        for number, mesh in enumerate(free):
            if not isinstance(mesh, FreeMesh | None):
                raise TypeError(
                    f"individual {number} has a {type(mesh).__name__} as free; set a FreeMesh(kept, faces, quality)"
                )
        return cls._of(problem, np.array(rows), free, ends=ends, wish=wish, until=until)

    @classmethod
    def _of(
        cls,
        problem: MeshProblem,
        rows: BoolArray,
        free: Sequence[FreeMesh | None],
        *,
        ends: bool,
        wish: Mapping[str, float] | None,
        until: float | None,
    ) -> Front:
        """Return the front of chromosomes (P, N) and of the free mesh beside each, if there is one."""
        known = [np.ones((1, problem.n_var), dtype=bool), problem.pinned[None]] if ends else []
        threads = getattr(problem.elementwise_runner, "n_threads", 1)
        table = np.vstack([problem.evaluate_subsets(some, n_threads=threads) for some in (rows, *known)])
        quality = [problem.as_quality(row) for row in table]
        n_subsets, measure = len(table), problem.objectives[0]
        meshes = [
            mesh
            for mesh, own in zip(free, quality, strict=False)
            if mesh is not None
            and mesh.quality.triangles <= own.triangles
            and getattr(mesh.quality, measure) < getattr(own, measure)
        ]
        quality += [mesh.quality for mesh in meshes]
        table = np.vstack([table, *(_row_of(problem, mesh.quality) for mesh in meshes)])
        usable = np.flatnonzero([_is_feasible(problem, row) for row in table])
        if not len(usable):
            raise LookupError(
                f"{problem.model.name}: none of {len(table)} subsets of its vertices is a mesh that meets the "
                "constraints; search longer, or loosen max_triangles and max_objective"
            )
        quality = [quality[row] for row in usable]
        others = beside(wish or {}, problem.objectives[0])
        if others and any(shortfall(asdict(q), wish or {}) == 0.0 for q in quality):
            holding = [k for k, q in enumerate(quality) if shortfall(asdict(q), others) == 0.0]
            usable, quality = usable[holding], [quality[k] for k in holding]
        table = table[usable]
        F = _objectives(quality, problem.objectives)
        if others:  # where none holds all, by how much the others are missed counts beside
            F = np.column_stack([F, [float(shortfall(asdict(q), others)) for q in quality]])
        chosen = _best_rows(F, quality)
        subsets = [*rows, *(row for some in known for row in some), *(mesh.kept for mesh in meshes)]
        solutions = np.empty((len(chosen), problem.n_var), dtype=bool)
        for solution, row in zip(solutions, usable[chosen], strict=True):
            np.logical_or(subsets[row], problem.pinned, out=solution)
        faces = [meshes[row - n_subsets].faces if row >= n_subsets else None for row in usable[chosen]]
        found = [quality[row] for row in chosen]
        whole = measured_meshes(problem.surface, solutions, found, faces=faces, n_threads=threads, until=until)
        return cls(whole, solutions, faces=faces, problem=problem)

    @classmethod
    def from_result(cls, result: Any, *, ends: bool = True) -> Front:
        """Take over what a search found.

        Parameters
        ----------
        result : pymoo Result, or anything with ``X`` and ``problem``
            Of ``minimize(MeshProblem(...), ...)`` with any algorithm. Of a Result, whose ``opt`` is the population of
            ``X``, free meshes are taken too, see :meth:`from_population`.
        ends : bool
            Add both ends of the front, which are known without a search: all vertices, and the pinned ones alone.

        Raises
        ------
        LookupError
            If the search found nothing that meets its constraints.
        TypeError
            If it was not one of a MeshProblem.
        """
        problem = result.problem
        if not isinstance(problem, MeshProblem):  # one that weighs the two objectives
            problem = getattr(problem, "problem", problem)
        if not isinstance(problem, MeshProblem):
            raise TypeError(f"the result is of a {type(problem).__name__}; a Front holds solutions of a MeshProblem")
        if result.X is None:
            raise LookupError(
                f"{problem.model.name}: the search found no solution that meets its constraints; search longer, or "
                "loosen max_triangles and max_objective"
            )
        algorithm = getattr(result, "algorithm", None)
        wish = algorithm.limits if isinstance(algorithm, TargetedSearch) else None
        found = getattr(result, "opt", None)
        if found is None:
            front = cls.from_subsets(problem, np.atleast_2d(result.X), ends=ends, wish=wish)
        else:
            front = cls.from_population(problem, found, ends=ends, wish=wish)
        front.series |= starting_front(problem, algorithm)
        facts = {
            "algorithm": type(algorithm).__name__ if algorithm is not None else None,
            "seed": getattr(algorithm, "seed", None),
            "generations": getattr(algorithm, "n_iter", 1) - 1,
            "evaluations": getattr(getattr(algorithm, "evaluator", None), "n_eval", None),
            "moves": moves_of(algorithm),
            "wish": wish,
            "seconds": getattr(result, "exec_time", None),
        }
        front.run |= {key: value for key, value in facts.items() if value is not None}
        return front

    @classmethod
    def load(cls, folder: str | os.PathLike[str], model: Any = None) -> Front:
        """Read a front that ``save`` or ``meshsimp simplify`` wrote.

        Its numbers are there at once; the model is read when a mesh is asked for, and must be the very same.

        Parameters
        ----------
        folder : path
            The folder.
        model : path, built-in name, trimesh.Trimesh, OpenModel, ClosedModel or Surface, optional
            The original mesh, if it is no longer where the record says; of a front made by tiles what
            :func:`~meshsimp_pymoo.opening.open_grid` takes, or its surface.

        Raises
        ------
        ResultError
            If a file is missing or damaged, or ``model`` is another one.
        """
        stored = read_front(folder)
        known = [name for name in MEASURES if name in stored.quality]
        columns = [stored.quality[name].tolist() for name in known]
        quality = [quality_of(zip(known, row, strict=True)) for row in zip(*columns, strict=True)]
        front = cls(
            quality,
            stored.kept,
            faces=stored.faces,
            run=stored.run,
            folder=stored.folder,
            meshes=stored.meshes,
            series=stored.series,
        )
        if stored.images is not None:
            front._images = {"source_index": stored.source_index, "xy": stored.images}
        if model is not None:
            front._surface = front._surface_of(model)
        return front

    # ---------------------------------------------------------------------------------------------------- as a sequence

    def __len__(self) -> int:
        return len(self.quality)

    @overload
    def __getitem__(self, item: int) -> FrontSolution: ...
    @overload
    def __getitem__(self, item: slice) -> Front: ...
    def __getitem__(self, item: int | slice) -> FrontSolution | Front:
        if isinstance(item, slice):
            rows = range(len(self))[item]
            if not rows:
                raise IndexError(f"{item} leaves nothing of a front of {len(self)} solutions")
            rows = range(len(self))[min(rows) : max(rows) + 1 : abs(item.step or 1)]  # sorted by triangles, always
            part = Front(
                [self.quality[row] for row in rows],
                self._kept.take(rows) if isinstance(self._kept, Nested) else self._kept[list(rows)],
                faces=[self.faces[row] for row in rows],
                problem=self._problem,
                surface=self._surface,
                run=self.run,
                folder=self.folder,
                meshes=[self._meshes[row] for row in rows],
                series=self.series,
            )
            part._images = self._images
            return part
        row = operator.index(item)
        if not -len(self) <= row < len(self):
            raise IndexError(f"the front has the solutions 0 to {len(self) - 1}; there is no {row}")
        return FrontSolution(self, row % len(self))

    @cached_property
    def kept(self) -> BoolArray | Chromosomes:
        """The vertices that stay (S, N), in vector order; of a front made by tiles one row is made at a time."""
        return Chromosomes(self._kept, self.model) if isinstance(self._kept, Nested) else self._kept

    @property
    def n_free(self) -> int:
        """How many of the solutions are free meshes."""
        return sum(own is not None for own in self.faces)

    @property
    def objectives(self) -> tuple[str, ...]:
        """What was minimised; (error, triangles) unless the problem says otherwise."""
        if self._problem is not None:
            return self._problem.objectives
        return self._recorded()[2]

    @property
    def F(self) -> FloatArray:
        """The objectives (S, 2): error [model units] and triangles, or what else was minimised."""
        return _objectives(self.quality, self.objectives)

    @cached_property
    def surface(self) -> Surface:
        """The original mesh and what counted; of a stored front, read again when it is needed.

        Raises
        ------
        ResultError
            If the model is not where the record says, or has changed.
        """
        return self._surface if self._surface is not None else self._surface_of(None)

    @cached_property
    def problem(self) -> MeshProblem:
        """What these are solutions of; a ResultError as of :attr:`surface`."""
        if self._problem is not None:
            return self._problem
        problem = MeshProblem(self.surface, objectives=self.objectives)
        problem.options = self._recorded()[0]  # a surface is given as it is, but was read so
        return problem

    @property
    def model(self) -> Any:
        """The original mesh: an OpenModel, a ClosedModel, or the HeightGrid of tiles."""
        return self.surface.model

    @property
    def georeference(self) -> Mapping[str, Any]:
        """Where on Earth the model is, as far as its file says."""
        recorded = self.run.get("model")
        return (recorded.get("georeference") or {}) if recorded else self.model.georeference

    @property
    def has_material(self) -> bool:
        """Whether its meshes may name files beside them: a library of materials, an image."""
        recorded = self.run.get("model")
        return bool(recorded.get("material")) if recorded else self.model.material is not None

    @property
    def has_lines(self) -> bool:
        """Whether the model has break lines."""
        recorded = self.run.get("model")
        if recorded:
            return bool(recorded.get("lines"))
        return getattr(self.model, "lines", None) is not None

    @property
    def unit(self) -> str:
        """The unit of the errors, such as "m"; "model units" where nobody says."""
        return length_unit(self.georeference)

    @property
    def name(self) -> str:
        """What the model is called."""
        recorded = (self.run.get("model") or {}).get("name")
        return str(recorded or self.model.name)

    # ------------------------------------------------------------------------------------------------------ free meshes

    def free(
        self,
        *,
        time: float | None = None,
        moves: int | None = None,
        seed: int = 1,
        min_height: float = USUAL_RATIO,
        centroids: bool = True,
    ) -> Front:
        """Return the front with free meshes, whose edges are chosen for the error, where these are better.

        Forty of the solutions at most are annealed freely at their number of triangles, each from its vertices, and
        thinned down to the next smaller one; see :mod:`~meshsimp_pymoo.search.free`. A solution is replaced by a free
        mesh that is no larger if what was minimised first is lower and nothing else that was minimised is higher, nor
        the surface error where ``centroids`` count, nor the number of uncovered vertices where these cost nothing. The
        smallest of them all, or the most accurate, that holds what the front was searched for
        (:func:`~meshsimp_pymoo.targeted`) comes along; its surface error may be higher where an error was wished for,
        or the wish was not met before.

        Parameters
        ----------
        time : float, optional
            Seconds to search for; what is found then depends on the machine.
        moves : int, optional
            Moves to try instead; by default thirty million, more for large models: a million take half a second or so
            of one core.
        seed : int
            Of the random moves.
        min_height : float
            Least height of the triangles that come, as a share of their longest edge; 0: any.
        centroids : bool
            Whether the centroids of the original's faces count beside its vertices; otherwise the meshes fit the
            vertices and may be wrong between them.

        Raises
        ------
        ValueError
            If an argument makes no sense, or the surface has no free meshes, as that of tiles.
        TypeError
            If both budgets are given.

        Examples
        --------
        >>> from meshsimp_pymoo import memetic
        >>> front = Front.from_result(minimize(MeshProblem("face:200"), memetic(12), Moves(20_000), seed=1))
        >>> freed = front.free(moves=100_000)
        >>> freed.n_free > 0, freed.best(triangles=60).error < front.best(triangles=60).error
        (True, True)
        """
        budget = budget_of(time, moves)
        ladder = FreeLadder(min_height=min_height, centroids=centroids)
        freeing = Freeing(self, ladder, moves=budget, timed=time is not None, seed=seed, wish=self.run.get("wish"))
        limit = None if time is None else perf_counter() + (1.0 - MEASURED_SHARE) * time
        while freeing.go_on(None if limit is None else limit - perf_counter()):
            pass
        return freeing.front()

    # --------------------------------------------------------------------------------------------------------- choosing

    def best(self, **limit: float | None) -> FrontSolution:
        """Return the best solution within one or more limits, all of which hold.

        Parameters
        ----------
        triangles : int
            The most accurate solution of at most that many triangles, as far as the other limits let it. Tiles leave
            a mesh of nearly any size, so that the solution of one of their fronts may be a new one: then its ``front``
            is this one with it.
        LIMITS : float
            Without ``triangles`` the smallest solution with at most that much of a measure; see
            :class:`~meshsimp_pymoo.surface.measures.Quality`.

        Raises
        ------
        Missed
            A LookupError, if no solution meets the limits; the message says how near the front comes, and its
            ``nearest`` is the solution that comes nearest.
        TypeError
            If no limit is given, or it is none of these.
        """
        limits = {name: value for name, value in limit.items() if value is not None}
        if unknown := [name for name in limits if name not in LIMITS]:
            raise TypeError(f"best() knows no limit {unknown[0]!r}; it takes {', '.join(LIMITS)}")
        if not limits:
            raise TypeError("best() takes limits, such as triangles=500 or max_error=0.1; none is given")
        require_numbers(limits)
        missed = shortfall({name: np.array([getattr(q, name) for q in self.quality]) for name in limits}, limits)
        fitting = np.flatnonzero(missed == 0.0)
        if "triangles" in limits:
            most = min(self.quality[-1].triangles, limits["triangles"])
            between = None if most < 2 else self._between(int(most))
            if between is not None and shortfall(asdict(between.quality), limits) > 0.0:
                between = None
            best = self[int(fitting[np.argmin(self.F[fitting, 0])])] if len(fitting) else between
            if best is not None:
                return best if between is None or between.error >= best.error else between
        elif len(fitting):
            return self._smaller(int(fitting[0]), limits)
        near = self._nearest(limits)
        raise Missed(self._how_near(limits, near), near)

    def _smaller(self, row: int, limits: Mapping[str, float]) -> FrontSolution:
        """Return the smallest solution within limits between one that is and the next smaller one, if there are any."""
        best = self[row]
        if not isinstance(self._kept, Nested) or row == 0:
            return best
        low = self.quality[row - 1].triangles
        while best.triangles - low > max(1, HALVED * best.triangles):
            size = (low + best.triangles) // 2
            between = self._between(size)
            if between is None or not low < between.triangles <= size:
                low = size
            elif shortfall(asdict(between.quality), limits) == 0.0:
                best = between
            else:
                low = size
        return best

    def _nearest(self, limits: Mapping[str, float]) -> FrontSolution:
        """Return the solution that comes nearest to limits: small enough if any is, then with the least errors."""
        errors = {name: most for name, most in limits.items() if name != "triangles"}
        missed = np.nan_to_num([float(shortfall(asdict(q), errors)) for q in self.quality], nan=np.inf)
        too_large = [q.triangles > limits.get("triangles", np.inf) for q in self.quality]
        return self[min(range(len(self)), key=lambda k: (too_large[k], missed[k], k))]

    def _how_near(self, limits: Mapping[str, float], near: FrontSolution) -> str:
        """Say how near the solutions come to limits that none of them meets."""
        if len(limits) == 1:
            ((name, most),) = limits.items()
            label, values = MEASURES[name].label, [getattr(q, name) for q in self.quality]
            known = [value for value in values if not np.isnan(value)]
            if not known:
                return f"the {label} of the solutions of {self.name} was not measured; ask for something else"
            if MEASURES[name].is_error:
                return f"the least {label} of a solution of {self.name} is {min(known):.6g}, and {most:g} was asked for"
            return f"no solution of {self.name} has at most {most:g} {label}; the least is {min(known)}"
        errors = {name: most for name, most in limits.items() if name != "triangles"}
        reached = " and ".join(f"{MEASURES[name].label} {getattr(near, name):.6g}" for name in errors)
        said = f"no solution of {self.name} holds all of what is asked for: {reached} at {near.triangles:,} triangles"
        if "triangles" not in limits:
            return said
        asked = " and ".join(f"{MEASURES[name].label} {most:g}" for name, most in errors.items())
        holding = [q.triangles for q in self.quality if shortfall(asdict(q), errors) == 0.0]
        return f"{said}; " + (
            f"with {asked} the smallest found has {min(holding):,}" if holding else f"none has {asked}"
        )

    def knee(self) -> FrontSolution:
        """Return the best compromise; see :func:`meshsimp_pymoo.indicators.knee`."""
        return self[knee(self.F)]

    def levels(
        self,
        count: int | None = None,
        *,
        triangles: Sequence[int] | None = None,
        max_error: Sequence[float] | None = None,
    ) -> tuple[FrontSolution, ...]:
        """Return a ladder of levels of detail: some of the solutions, the finest first, each mesh once.

        They need not be nested: each has the vertices that are best for it. :func:`~meshsimp_pymoo.save_levels` writes
        them.

        Parameters
        ----------
        count : int, optional
            The most levels. Without limits the first one is the most accurate solution, or the one that the front was
            searched for; each other one is the best of at most a quarter of the triangles of the one before. By
            default the ladder ends where that would be fewer than 32.
        triangles, max_error : sequence of numbers, optional
            Limits instead, one for each level, as :meth:`best` takes them.

        Raises
        ------
        Missed
            If no solution meets one of the limits.
        TypeError
            If more than one of these is given.
        ValueError
            If ``count`` is less than 1, or a limit makes no sense.

        Examples
        --------
        >>> from meshsimp_pymoo import memetic
        >>> front = Front.from_result(minimize(MeshProblem("face:200"), memetic(12), Moves(20_000), seed=1))
        >>> [level.triangles for level in front.levels()][:2]
        [350, 86]
        """
        given = {"count": count, "triangles": triangles, "max_error": max_error}
        said = [name for name, value in given.items() if value is not None]
        if len(said) > 1:
            raise TypeError(f"{said[0]} does not go with {said[1]}: each says which levels there are; leave one out")
        if count is not None and count < 1:
            raise ValueError(f"count is {count}; a ladder has 1 level or more")
        if triangles is not None or max_error is not None:
            name = said[0]
            found = [self.best(**{name: limit}) for limit in given[name]]  # type: ignore[union-attr]
            once = {(level.triangles, level.error): level for level in found}
            return tuple(sorted(once.values(), key=lambda level: (-level.triangles, level.error)))
        ladder = [self._sought()]
        while count is None or len(ladder) < count:
            most = ladder[-1].triangles // LEVEL_FACTOR
            if most < (FEWEST_TRIANGLES if count is None else 1):
                break
            try:
                ladder.append(self.best(triangles=most))
            except Missed:
                break
        return tuple(ladder)

    def _sought(self) -> FrontSolution:
        """Return the solution that the front was searched for, or the most accurate one of a whole front."""
        if not self.run.get("wish"):
            return self[-1]
        try:
            return self.best(**self.run["wish"])
        except Missed as missed:
            nearest: FrontSolution = missed.nearest
            return nearest

    def _between(self, triangles: int) -> FrontSolution | None:
        """Return a solution of a nested front of at most so many triangles, which it may not have had so far."""
        if not isinstance(self._kept, Nested):
            return None
        nested, surface = self._kept, self.surface
        assert isinstance(surface, GridSurface)
        slope = slope_of(surface, nested, triangles)
        if slope in nested.slope:
            return self[nested.slope.tolist().index(slope)]
        at = int(np.searchsorted(-nested.slope, -slope))
        sizes = [q.triangles for q in self.quality]
        room = (sizes[at - 1] if at else 0, sizes[at] if at < len(self) else np.inf)
        moved, quality = of_size(surface, nested, slope, triangles, room=room)
        front = Front(
            [*self.quality[:at], quality, *self.quality[at:]],
            nested.with_subset(at, slope, moved),
            surface=surface,
            run=self.run,
            folder=self.folder,
            meshes=[*self._meshes[:at], "", *self._meshes[at:]],
            series=self.series,
        )
        return front[at]

    # ------------------------------------------------------------------------------------------- showing and writing it

    def plot(self, ax: Axes | None = None, **kwargs: Any) -> Axes:
        """Draw the front, its knee marked; see :func:`meshsimp_pymoo.report.figures.plot_front`."""
        from meshsimp_pymoo.report.figures import plot_front

        F = self.F
        look: dict[str, Any] = {"knee": knee(F), "measure": self.objectives[0], "series": self.series}
        look["unit"] = self.unit
        return plot_front(F[:, [0, -1]], ax, **look | kwargs)

    def save(
        self,
        folder: str | os.PathLike[str],
        *,
        overwrite: bool = False,
        meshes: int | None = MESHES_BY_DEFAULT,
        mesh_format: str = "ply",
        chosen: int | FrontSolution | None = None,
        piece: int | None = None,
        refit: bool | Mapping[int, Refitted] = False,
        solid: float | None = None,
        pictures: bool = True,
        page: bool = True,
        run: Mapping[str, Any] | None = None,
        until: float | None = None,
    ) -> Path:
        """Write the front as ``meshsimp simplify`` does: numbers, the record and meshes; then pictures and the page.

        Parameters
        ----------
        folder : path
            The folder to make.
        overwrite : bool
            Replace results that exist.
        meshes : int or None
            The most meshes to write, an even selection of a longer front; None writes all, 0 none.
        mesh_format : str
            A name out of :func:`~meshsimp_pymoo.formats.table.written_formats`, such as "ply" or "landxml".
        chosen : int or FrontSolution, optional
            The solution to write as ``chosen.<mesh_format>`` too.
        piece : int, optional
            Write the chosen mesh of a height grid in pieces of about so many samples a side, in the folder ``chosen``.
        refit : bool or mapping
            Write each of the meshes once more refitted, and their error to ``front.csv``: with its best heights, see
            :func:`~meshsimp_pymoo.surface.height.refit_heights`, or of a closed surface its best vertices. Or only
            those of these solutions, found already.
        solid : float, optional
            Close the chosen mesh for printing, by walls and a flat base so far below its lowest point [file units]; all
            other meshes stay surfaces.
        pictures : bool
            Go on to :meth:`draw`, once all else is in place.
        page : bool
            With the page on which to look at the solutions and choose one.
        run : mapping, optional
            What else to record in run.json.
        until : float, optional
            Meshes that would not be written by ``perf_counter() = until`` are left out.

        Raises
        ------
        ResultError
            If the folder cannot be written.
        """
        surface = self.surface
        row = chosen.solution if isinstance(chosen, FrontSolution) else chosen

        def fitted(solution: int) -> Refitted | None:
            return self[solution].refitted if refit is True else refit.get(solution) if refit else None

        record = self.run | dict(run or {})
        if self._problem is not None:
            record["options"] = plain(self._problem.options)
        record |= {"rules": plain(surface.rules), "objectives": list(self.objectives)}
        path = write_front(
            folder,
            surface,
            self.quality,
            self._kept,
            faces=lambda solution: self[solution].faces,
            free=self.faces,
            meshes=meshes,
            mesh_format=mesh_format.lower(),
            chosen=row,
            cut=None if piece is None else lambda faces: pieces(self.model, faces, piece),
            refit=fitted if refit is not False else None,
            solid=solid,
            series=self.series,
            run=record,
            overwrite=overwrite,
            until=until,
        )
        if pictures:
            Front.load(folder, model=surface).draw(page=page)
        return path

    def draw(self, *, page: bool = True, missing: bool = False) -> None:
        """Make the picture ``front.png`` and the page ``report.html`` of a stored front anew, each whole or not at all.

        And what is said of the quality of the chosen mesh, ``quality.json`` and ``quality.html``, if there is one and
        the model has no more than STATED_VERTICES vertices.

        Parameters
        ----------
        page : bool
            Whether the page is made too.
        missing : bool
            Make only what is not there.

        Raises
        ------
        ResultError
            If the front is not stored, or its model is not where the record says.

        Warns
        -----
        PictureWarning
            If one of them cannot be made.
        """
        stored = self.folder
        if stored is None:
            raise ResultError("the front is not stored; save() it, which draws it too")
        surface, F, chosen = self.surface, self.F, self.run.get("chosen")

        def draw_front(path: Path) -> None:
            from meshsimp_pymoo.report.figures import front_figure, panel_rows

            figure = front_figure(
                surface,
                F[:, [0, -1]],
                [(row, self[row].faces) for row in panel_rows([q.triangles for q in self.quality], chosen, knee(F))],
                knee=knee(F),
                chosen=chosen,
                measure=self.objectives[0],
                series=self.series,
            )
            figure.savefig(path)

        def draw_page(path: Path) -> None:
            from meshsimp_pymoo.report.page import simplification_page

            content = simplification_page(
                read_front(stored), surface, self.kept, measure=self.objectives[0], folder=stored, knee=knee(F)
            )
            path.write_bytes(content.encode("utf-8"))

        drawings: dict[str, Callable[[Path], object]] = {PICTURES[0]: draw_front}
        if chosen is not None and surface.n_vertices <= STATED_VERTICES:
            statement = cache(self[chosen]._quick_statement)
            write = (lambda path: statement().write_data(path), lambda path: statement().write_page(path))
            drawings |= zip(STATEMENT, write, strict=True)
        drawings[PICTURES[1]] = draw_page  # which links to the others
        wanted = [name for name in drawings if page or name not in (PICTURES[1], STATEMENT[1])]
        draw_into(stored, {name: drawings[name] for name in wanted if not (missing and (stored / name).is_file())})

    def show(self, *, height: int = 1000, limit: int = NOTEBOOK_BYTES) -> Framed:
        """Return the page of the front for a notebook: every mesh beside the original, to turn, compare and take home.

        It is the page that :meth:`draw` writes, inside the output of the cell: it needs no widget, no kernel once it is
        there, no file and no network.

        Parameters
        ----------
        height : int
            Of its frame [pixels].
        limit : int
            Size that is not exceeded if it can be helped, by leaving out meshes [bytes]; notebooks keep what they show.

        Returns
        -------
        Framed
            What a notebook shows as the last value of a cell.

        Raises
        ------
        ResultError
            If the model of a stored front is not where its record says.
        """
        from tempfile import TemporaryDirectory

        from meshsimp_pymoo.report.document import Framed
        from meshsimp_pymoo.report.page import simplification_page

        with TemporaryDirectory() as unstored:
            folder = self.folder or self.save(Path(unstored) / "front", meshes=0, pictures=False)
            content = simplification_page(
                read_front(folder),
                self.surface,
                self.kept,
                measure=self.objectives[0],
                folder=None,
                knee=knee(self.F),
                limit=limit,
            )
        return Framed(content, height)

    def stored_mesh(self, solution: int) -> Path | None:
        """Return the file of a solution's mesh in the front's folder; None if it was not written."""
        path = self._meshes[solution]
        if self.folder is None or not path or not (self.folder / path).is_file():
            return None
        return self.folder / path

    def to_frame(self) -> pandas.DataFrame:
        """Return the numbers as a table of pandas: one row a solution, the columns of ``front.csv``.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError(f"to_frame() needs pandas: {way_to_install('pandas')}") from None
        frame = pandas.DataFrame([asdict(q) for q in self.quality])
        if not self.has_lines:
            frame = frame.drop(columns=list(OF_LINES))
        frame["free"] = [int(own is not None) for own in self.faces]
        return frame.rename_axis(index="solution")

    def __repr__(self) -> str:
        few, many = self.quality[0], self.quality[-1]
        free = f", {self.n_free} of {len(self)} free" if self.n_free else ""
        return (
            f"<front of {self.name}: {len(self)} solutions{free}, {few.triangles:,} to {many.triangles:,} triangles, "
            f"error {few.error:.6g} to {many.error:.6g}>"
        )

    def _repr_png_(self) -> bytes:
        from matplotlib.figure import Figure

        from meshsimp_pymoo.report.figures import short_name

        figure = Figure(figsize=(6.0, 4.2), dpi=90, layout="constrained")
        self.plot(figure.subplots()).set_title(short_name(self.name), loc="left", fontsize=10)
        return _png(figure)

    def _repr_html_(self) -> str:
        import html

        at = knee(self.F)
        rows = sorted({*even_selection(len(self), SHOWN_ROWS), at})
        picture = base64.b64encode(self._repr_png_()).decode()
        # what a mesh consists of, its error at the vertices and between them, and what it can be chosen by
        also = ("error", "surface_error", "line_max_error")
        shown = [name for name, known in MEASURES.items() if not known.meaning or known.wish or name in also]
        shown = [name for name in shown if not all(np.isnan(getattr(q, name)) for q in self.quality)]
        names = sorted(shown, key=lambda name: MEASURES[name].is_error)
        unit = "" if self.unit == LENGTH else f" [{html.escape(self.unit)}]"
        labels = [MEASURES[name].label + unit * MEASURES[name].is_error for name in names]
        header = "".join(f"<th>{label}</th>" for label in ("solution", *labels))
        body = []
        for row in rows:
            cells = [f"{row}{' (knee)' if row == at else ''}"]
            values = [getattr(self.quality[row], name) for name in names]
            cells += ["" if np.isnan(value) else f"{value:.6g}" for value in values]
            body.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
        left_out = "" if len(rows) == len(self) else f"<p>{len(self) - len(rows)} more solutions are not listed.</p>"
        return (
            f'<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
            f'<img alt="{html.escape(repr(self)[1:-1])}" src="data:image/png;base64,{picture}">'
            f"<div><table><tr>{header}</tr>{''.join(body)}</table>{left_out}</div></div>"
        )

    # -------------------------------------------------------------------------------------------- the model, read again

    def _recorded(self) -> tuple[Options, Rules, tuple[str, ...]]:
        """Return how the model was read, what counted and what was minimised, as the record has it."""
        try:
            options = read_back(Options, self.run.get("options") or {})
            rules = read_back(Rules, self.run.get("rules") or {})
            return options, rules, tuple(self.run.get("objectives") or (rules.measure, "triangles"))
        except (TypeError, ValueError) as problem:
            raise ResultError(f"{self.folder or 'the front'}: its record cannot be used: {problem}") from None

    def _surface_of(self, model: Any) -> Surface:
        """Make the surface again from the record, and check that the model is the same."""
        facts = self.run.get("model") or {}
        where = self.folder if self.folder is not None else "the front"
        way_out = "pass the original (Front.load(folder, model=...), --model FILE) or simplify it again"
        source: Any = model if model is not None else self._model_file()
        try:
            options, rules, _ = self._recorded()
            if hasattr(source, "rules"):
                mine, stored = plain(source.rules), plain(rules)
                if is_file_of_lines(source.rules.break_lines) and is_file_of_lines(rules.break_lines):
                    mine["break_lines"] = stored["break_lines"]  # by what is in it
                if mine != stored:
                    differ = ", ".join(
                        f"{name}={in_short(stored[name])}" for name in stored if stored[name] != mine[name]
                    )
                    kind = type(source).__name__
                    raise ResultError(f"{where}: has other rules than this {kind}: {differ}; {way_out}")
                surface: Surface = source
            elif isinstance(self._kept, Nested):
                surface = GridSurface(open_grid(source, applicable(source, options)), rules)
            else:
                found = open_model(source, applicable(source, options))
                surface = self._with_lines(found, rules, where)
            surface = self._with_images(surface, where, way_out)
        except ModelError as trouble:
            if model is not None:
                raise
            raise ResultError(f"{where}: its model cannot be read ({trouble}); {way_out}") from None
        if surface.model.hash != facts.get("hash"):
            with_lines = f" with the break lines of {in_short(rules.break_lines)}" if self.has_lines else ""
            raise ResultError(
                f"{where}: is the front of another model than {surface.model.name}{with_lines} is now"
                + ("" if model is not None else f" ({'a' if with_lines else 'the'} file has changed since)")
                + f", of {facts.get('vertices')} vertices, not {surface.n_vertices}"
                * (facts.get("vertices") != surface.n_vertices)
                + f"; {way_out}"
            )
        self._warn_of_another_frame(surface.model, where)
        return surface

    def _warn_of_another_frame(self, model: Any, where: Any) -> None:
        """Say where the same coordinates are said to be in another unit or reference system than they were."""
        was, now = ((length_unit(facts), reference_system(facts)) for facts in (self.georeference, model.georeference))
        if any(known and other and known != other for known, other in zip(was, now, strict=True)):
            then, today = (", ".join(filter(None, said)) for said in (was, now))
            warn_of(
                f"{model.name}: says {today}, and said {then} when {where} was made; what is written now says {today}"
            )

    def _with_images(self, surface: Surface, where: Any, way_out: str) -> Surface:
        """Return the surface with the images of its vertices that the chromosomes are of, if it has any."""
        if not stored_arrays(surface):
            return surface
        if not self._images:
            raise ResultError(f"{where}: holds no images of the vertices (xy of front.npz); {way_out}")
        try:
            return as_stored(surface, self._images)
        except ModelError as trouble:
            if surface.model.hash != (self.run.get("model") or {}).get("hash"):
                return surface  # which is what is wrong
            raise ResultError(f"{where}: its front.npz cannot be used ({trouble}); write the front again") from None

    def _with_lines(self, model: Model, rules: Rules, where: Any) -> Surface:
        """Make the surface of a model; a file of break lines is looked for beside the results first."""
        file = ((self.run.get("model") or {}).get("lines") or {}).get("file")
        if is_file_of_lines(rules.break_lines) and self.folder is not None and isinstance(file, str):
            beside = (self.folder / file).resolve()
            if beside.is_file():
                rules = replace(rules, break_lines=str(beside))
        try:
            return surface_of(model, rules)
        except ModelError as trouble:
            if rules.break_lines is None:
                raise
            raise ResultError(
                f"{where}: its break lines cannot be used ({trouble}); put them back to where they were, or simplify "
                "the model again"
            ) from None

    def _model_file(self) -> Path | str:
        """Return where the record says the model is: beside the results, as it was called, or built in."""
        facts = self.run.get("model") or {}
        if self.folder is not None and facts.get("file"):
            beside = self.folder.resolve() / facts["file"]
            if beside.is_file():
                return beside
        return self.name


class Freeing:
    """Makes free meshes for a front, some sizes at a time; see :meth:`Front.free`.

    Parameters
    ----------
    front : Front
        The front.
    ladder : FreeLadder
        What finds them.
    moves : int, optional
        How many there are; by default as many as are usual.
    timed : bool
        Whether time ends them.
    seed : int
        Of the random moves.
    wish : mapping of str to float, optional
        What the front was searched for: most of the time goes to that, and the limits that held hold then.
    """

    def __init__(
        self,
        front: Front,
        ladder: FreeLadder,
        *,
        moves: int | None = None,
        timed: bool = False,
        seed: int = 1,
        wish: Mapping[str, float] | None = None,
    ) -> None:
        self.before = front
        self.ladder = ladder
        self.wish = dict(wish or {})
        self.seed = seed
        #: The solution that holds the wish, if any does, and the one that holds it or comes nearest.
        self.held: int | None = None
        self.answer: int | None = None
        surface = front.surface
        freedom_of(surface, "free meshes", centroids=ladder.centroids)
        if self.wish:
            try:
                self.answer = self.held = front.best(**self.wish).solution
            except Missed as missed:
                self.answer = missed.nearest.solution
        sizes, shares, offered = rungs_of(front.F[:, [0, -1]], self.wish, self.answer)
        generator = np.random.default_rng(seed)
        ladder.begin(surface, sizes, offered, generator, shares=shares, moves=moves, timed=timed)

    def go_on(self, seconds: float | None = None, finished: Callable[[], None] | None = None) -> bool:
        """Anneal the next sizes, with so many seconds for all that are left; return whether any are left then.

        ``finished`` is called for each of them, by the thread that finishes it.
        """
        front, ladder = self.before, self.ladder
        n_left, F = len(ladder.todo), front.F

        def subset_of(rung: int) -> BoolArray:
            fits = np.flatnonzero(F[:, -1] <= ladder.sizes[rung])
            kept: BoolArray = front.kept[fits[np.argmin(F[fits, 0])]] | front.surface.pinned
            return kept

        if n_left and (seconds is None or seconds > 0.0):
            ladder.go_on(front.surface, subset_of, seconds=seconds, n_threads=self._threads, finished=finished)
        return 0 < len(ladder.todo) < n_left

    @property
    def _threads(self) -> int | None:
        """The threads of the problem that was searched, if it is known."""
        return getattr(getattr(self.before._problem, "elementwise_runner", None), "n_threads", None)

    def front(self, *, until: float | None = None) -> Front:
        """Return the front with what was found so far.

        Of meshes that are not measured whole by ``perf_counter() = until``, but for a few, the surface error is not
        compared, and a warning says how many they are.
        """
        before, ladder, surface = self.before, self.ladder, self.before.surface
        objectives, kept, quality = before.objectives[:-1], np.asarray(before.kept), list(before.quality)
        F, others = _objectives(quality, before.objectives), beside(self.wish, objectives[0])
        # what was wished for beside that may rise as far as its limit
        within = [np.maximum([getattr(q, name) for q in quality], most) for name, most in others.items()]
        guarded = guarding(surface)
        names = (*objectives, *others, *guarded)
        errors = np.column_stack([F[:, :-1], *within, _objectives(quality, guarded)])
        triangles = F[:, -1].astype(np.int64)
        rows = list(range(len(before)))
        if self.held is not None and "triangles" in self.wish:  # one more is looked for that may have as many
            rows.append(self.held)
            triangles = np.append(triangles, int(self.wish["triangles"]))

        def measure(place: int) -> None:
            row = rows[place]
            own = slice(row, row + 1)
            (quality[row],) = measured_meshes(surface, kept[own], quality[own], faces=before.faces[own])

        between = None
        if ladder.centroids:
            in_turn(ladder.by_gain(surface, names, triangles, errors[rows]), measure, until, self._threads)
            between = np.array([quality[row].surface_error for row in rows])
        meshes = ladder.best_of(surface, names, triangles, errors[rows], between, n_threads=self._threads)
        if self.answer is not None and len(rows) == len(before):
            most = before.quality[self.answer].uncovered if guarded else np.inf
            meshes.append(ladder.wished(surface, objectives[0], self.wish, uncovered=most))
        found: list[tuple[Quality, BoolArray, IntArray | None]] = []
        found += [(mesh.quality, mesh.kept, mesh.faces) for mesh in meshes if mesh is not None]
        found += [(quality[row], kept[row], before.faces[row]) for row in range(len(before)) if meshes[row] is None]
        F = _objectives([q for q, _, _ in found], before.objectives)
        missed = [float(shortfall(asdict(q), others)) for q, _, _ in found]
        best = _best_rows(np.column_stack([F, missed]), [q for q, _, _ in found])
        qualities, subsets, faces = zip(*(found[row] for row in best), strict=True)
        facts = {"seed": self.seed, "moves": ladder.moves, "min_height": ladder.min_height}
        return Front(
            measured_meshes(surface, np.array(subsets), qualities, faces=faces, n_threads=self._threads, until=until),
            np.array(subsets),
            faces=faces,
            problem=before._problem,
            surface=surface,
            run=before.run | {"freeing": facts | {"centroids": ladder.centroids}},
            series=before.series,
        )


def budget_of(time: float | None, moves: int | None) -> int | None:
    """Return the moves that are asked for, if any are, and not time.

    Raises
    ------
    TypeError
        If both are given.
    ValueError
        If one makes no sense.
    """
    if time is not None and moves is not None:
        raise TypeError(f"time={time} does not go with moves={moves}: each says how long to search; leave one out")
    if time is not None and not time > 0:
        raise ValueError(f"time={time} is no time to search for; give seconds")
    return None if moves is None else Moves(moves).n_max_moves


def _say_limits() -> None:
    """Let the signature and the documentation of ``best`` name every measure."""
    own = inspect.signature(Front.best)
    limits = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None) for name in LIMITS]
    Front.best.__signature__ = own.replace(parameters=[own.parameters["self"], *limits])  # type: ignore[attr-defined]
    others = ", ".join(name for name in LIMITS if name != "triangles")
    Front.best.__doc__ = (Front.best.__doc__ or "").replace("LIMITS", others)


_say_limits()


def starting_front(problem: MeshProblem, algorithm: Any, *, interrupted: bool = False) -> dict[str, FloatArray]:
    """Return the front that a search started from, by name, if its first population is one of adaptive thinning.

    Parameters
    ----------
    problem : MeshProblem
        What was searched, with two objectives.
    algorithm : pymoo Algorithm, or None
        The search.
    interrupted : bool
        Whether only what is known of it already is wanted.

    Returns
    -------
    dict of str to (n, 2) float array
        Error and triangles of at most START_POINTS of its solutions, spread over the logarithm of the size; empty where
        the search started otherwise.
    """
    sampling = getattr(getattr(algorithm, "initialization", None), "sampling", None)
    if not isinstance(sampling, NestedSubsets) or problem.n_obj != 2:
        return {}
    start = begun(problem.surface) if interrupted else at_hand(problem.surface, seconds_given(algorithm))
    if start is None:
        return {}
    F = np.column_stack([start.error, start.triangles])
    F = non_dominated(F[F[:, 1] > 0])
    F = F[np.argsort(F[:, 1])]
    wanted = np.geomspace(F[0, 1], F[-1, 1], START_POINTS)
    rows = np.searchsorted(F[:, 1], wanted, side="right") - 1
    return {START: F[np.unique(np.maximum(rows, 0))]}


def simplify_to(
    problem: MeshProblem | Any,
    *,
    triangles: int | None = None,
    max_error: float | None = None,
    mean_error: float | None = None,
    rms_error: float | None = None,
    time: float | None = None,
    moves: int | None = None,
    seed: int = 1,
) -> FrontSolution:
    """Return the mesh that is wished for: the best of so many triangles, or the smallest that is accurate enough.

    It is found at once and then improved; see :func:`~meshsimp_pymoo.targeted`. Without a budget ten million moves are
    made, which is some ten seconds; the same moves and seed give the same mesh.

    Parameters
    ----------
    problem : MeshProblem, or what it takes as its model
        What is simplified. A wish for an error lowers that error, so of a problem of another measure a copy is
        searched that minimises it; one whose measure was chosen, which "error" counts as none, is refused.
    triangles : int, optional
        The most triangles: then the most accurate such mesh by the problem's measure, or by the mean or root mean
        square that is wished for too.
    max_error, mean_error, rms_error : float, optional
        The most that any original vertex may deviate by, the mean of these, and their root mean square [model units].
        Where several limits are given all of them hold.
    time : float, optional
        Seconds to search for; what is found then depends on the machine.
    moves : int, optional
        Moves of vertices to try instead.
    seed : int
        Of the random moves.

    Returns
    -------
    FrontSolution
        Its ``mesh`` is the mesh, its ``front`` the others that were found around it.

    Raises
    ------
    Missed
        A LookupError, if none is good enough; ``nearest`` is what comes nearest.
    TypeError
        If nothing is wished for.
    ValueError
        If a limit makes no sense, or the problem minimises another measure than is wished for, has three objectives
        or constraints.

    Examples
    --------
    >>> simplify_to("roof:9", triangles=4, moves=1000)
    <solution 2 of 3: 4 triangles, error 0, mean 0, max 0>
    >>> simplify_to("roof:9", max_error=0.1, moves=1000).triangles
    4
    """
    limits = checked_limits(
        {"triangles": triangles, "max_error": max_error, "mean_error": mean_error, "rms_error": rms_error}
    )
    budget_of(time, moves)
    if not isinstance(problem, MeshProblem):
        problem = MeshProblem(problem)
    require_for_a_wish(problem)
    measure = problem.objectives[0]
    # nobody need have asked for what is minimised unless told otherwise
    problem = problem.minimising(measure_for(limits, None if measure == Rules().measure else measure))
    budget = ("time", time) if time is not None else Moves(USUAL_BUDGET if moves is None else moves)
    result = minimize(problem, targeted(**limits), budget, seed=seed)  # type: ignore[arg-type]
    return Front.from_result(result).best(**limits)


def _row_of(problem: MeshProblem, quality: Quality) -> FloatArray:
    """Return the row of the table of :meth:`MeshProblem.evaluate_subsets` that says these numbers of a mesh.

    The errors of regions are not known of it.
    """
    row = np.full(REGIONS + problem.regions, np.inf)
    row[[ERROR, TRIANGLES, VERTICES]] = quality.error, quality.triangles, quality.vertices
    row[[MAXIMUM, UNCOVERED]] = quality.max_error, quality.uncovered
    row[SQUARES] = quality.rms_error**2 * problem.surface.total_weight
    return row


def _is_feasible(problem: MeshProblem, row: FloatArray) -> bool:
    if row[TRIANGLES] == 0:
        return False
    return all(value <= 0 for value in problem.outcome(row).get("G", ()))


def _objectives(quality: Sequence[Quality], names: Sequence[str]) -> FloatArray:
    return np.array([[getattr(q, name) for name in names] for q in quality], dtype=np.float64)


def _best_rows(F: FloatArray, quality: Sequence[Quality]) -> list[int]:
    """Return which rows no other one beats, each once, sorted by triangles, then error."""
    best = {row.tobytes() for row in non_dominated(F)}
    first: dict[bytes, int] = {}
    for row in np.lexsort(([q.error for q in quality], [q.triangles for q in quality])):
        key = (F[row] + 0.0).tobytes()
        if key in best:
            first.setdefault(key, int(row))
    return list(first.values())


def _png(figure: Any) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png")
    return content.getvalue()

"""A search from the shell: from a request to a folder of results, with checkpoints, progress and Ctrl-C."""

from __future__ import annotations

import gc
import re
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.population import Population
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.termination.max_gen import MaximumGenerationTermination
from pymoo.termination.max_time import TimeBasedTermination

from meshsimp_pymoo.arrays import spread
from meshsimp_pymoo.cli.preparing import compiling
from meshsimp_pymoo.cli.requests import Output, Request, Search, Wish, refuse
from meshsimp_pymoo.cli.results import WAIT_SECONDS, hand_over, hand_over_stored, lacks_pictures
from meshsimp_pymoo.cli.terminal import (
    BAD_INPUT,
    INTERRUPTED,
    WRITING,
    Stages,
    answering,
    front_in_words,
    is_interrupted,
    say,
    stop_if_interrupted,
)
from meshsimp_pymoo.cli.tiling import refuse_alone, simplify_tiled, wants_tiles
from meshsimp_pymoo.errors import ModelError, NoHeightGrid, ResultError, UsageError
from meshsimp_pymoo.files import locked, put_back
from meshsimp_pymoo.formats.table import format_to_write, listed
from meshsimp_pymoo.front import Freeing, Front, FrontSolution, starting_front
from meshsimp_pymoo.memory import check_one_piece
from meshsimp_pymoo.opening import count_samples
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.search.budgets import Moves, WholeGenerations, moves_of
from meshsimp_pymoo.search.checkpoint import (
    CheckpointError,
    Checkpoints,
    NotResumable,
    Stored,
    difference,
    read_checkpoint,
    restore,
)
from meshsimp_pymoo.search.free import MEASURED_SHARE as MEASURED_SHARE_OF_FREE
from meshsimp_pymoo.search.free import SUBSETS_SHARE, FreeLadder
from meshsimp_pymoo.search.memetic import SECONDS_A_VERTEX, MemeticSearch, sweep_generations
from meshsimp_pymoo.search.operators import NestedSubsets
from meshsimp_pymoo.search.presets import DEFAULT_GENERATIONS, PRESETS
from meshsimp_pymoo.search.starting import Start, begun
from meshsimp_pymoo.search.targeted import TargetedSearch, rungs, targeted
from meshsimp_pymoo.search.wishes import USUAL_BUDGET
from meshsimp_pymoo.settings import plain
from meshsimp_pymoo.storage import (
    CHECKPOINT,
    claim_output,
    even_selection,
    is_unfinished,
    now,
    package_versions,
)
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.kinds import OfModel, as_stored, stored_arrays
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.measures import MEASURES
from meshsimp_pymoo.surface.smallest import tolerance_for
from meshsimp_pymoo.surface.solid import check_solid
from meshsimp_pymoo.surface.surface import Refitted
from meshsimp_pymoo.tiles.front import TILE
from meshsimp_pymoo.warming import (
    CLOSED_FREE,
    CLOSED_LINED,
    CLOSED_SEARCH,
    CLOSED_WISH,
    FREE,
    LINED,
    SEARCH,
    STATED,
    WISH,
    missing,
)

# Seconds that freeing a front is thought to take where nobody says how long.
FREEING_SECONDS = 15.0
# Of the time that is given, the share kept for refitting the meshes.
REFIT_SHARE = 0.3
# Of that time, the share for measuring what a search was to start from.
MEASURED_SHARE = 0.4
# The share of what whoever interrupts a search waits, until when the meshes of the front are measured whole.
WHOLE_SHARE = 0.7
# Of that time, the share for measuring what free meshes are to be better than.
FREE_SHARE = 0.2
# What measuring takes for each triangle of a mesh, beside what it takes for each vertex of the model [s].
SECONDS_A_TRIANGLE = 5e-7
# What writing takes about: for any model, and times the root of its vertices [s].
WRITING_SECONDS = (1.4, 0.02)


def simplify(request: Request, shown: Stages) -> int:
    """Search the front of a model and write it to a new folder, which is held meanwhile; return the exit code."""
    folder = request.output.folder
    with locked(folder):
        put_back(folder)
        return _simplify(request, shown)


def _simplify(request: Request, shown: Stages) -> int:
    search, output = request.search, request.output
    if wants_tiles(request):
        try:
            return simplify_tiled(request, shown)
        except NoHeightGrid as reason:
            if request.tiling.tile is not None:
                raise
            # nobody asked for tiles
            if not output.quiet:
                why = re.split("; only|, (?:and|as) tiles", str(reason))[0]
                say(f"{why}; so it is not cut into tiles but searched in one piece")
    else:
        refuse_alone(request.tiling)
    _check_budget(request)
    what = {"settings": request.recorded | budget(request), "seed": search.seed, "interrupted": False}
    is_drawn_only = lacks_pictures(output, what)
    if not is_drawn_only:
        _claim(output, search)
    with compiling(_parts(_guessed(request)), shown) as compiled:
        with shown.stage("reading", f"reading {Path(request.model).name}"):
            problem = MeshProblem(request.model, options=request.options, rules=request.rules, n_threads=search.threads)
            as_found = _of_kind(request, "closed" if isinstance(problem.model, ClosedModel) else "height")
            refuse(as_found)
            format_to_write(output.format).check(problem.model)
            if output.solid is not None:
                check_solid(problem.surface, output.solid)
            check_one_piece(problem.n_var, problem.model.name, _smaller(request.model, problem.model))
        read_seconds = shown.seconds["reading"] - compiled.seconds
        compiled.finish(_parts(as_found))
        request = replace(request, wish=request.wish.among(lambda: len(problem.model.faces)))
        _refuse_impossible(problem, request.wish, quiet=output.quiet)
    if search.time is not None:
        seconds = _search_seconds(request, search.time)
        shown.expect("freeing", (1.0 - SUBSETS_SHARE) * seconds if request.is_freed else 0.0)
        shown.expect("searching", SUBSETS_SHARE * seconds if request.is_freed else seconds)
    shown.expect("writing", WRITING_SECONDS[0] + WRITING_SECONDS[1] * problem.n_var**0.5)
    keeper = Keeper(problem, request, {"read_seconds": read_seconds, "compile_seconds": compiled.seconds})
    if is_drawn_only:
        return hand_over_stored(request, problem.surface, shown)
    with answering(*WRITING):
        found = _search(keeper, shown)
        if found is None:
            say("interrupted before the first generation was complete; nothing is written")
            return INTERRUPTED
        ended, surface = _write(found, keeper, shown), keeper.problem.surface
        # its subsets, and with the checkpoints those of the search, whose objects refer to each other, take more memory
        # than the model
        del found, keeper
        gc.collect()
        return hand_over(request, surface, shown) if ended is None else ended


def _smaller(path: str, model: Any) -> str:
    """Return how to come to a model that fits into the memory."""
    if "points" in model.georeference:
        return "take one class of points (--classes 2), or thin the cloud before (PDAL: filters.sample)"
    if count_samples(path) is not None:
        return f"take tiles (--tile {TILE}), or a part of it (--window COLUMN,ROW,COLUMNS,ROWS)"
    return "take a part of it, or free some"


def _of_kind(request: Request, kind: str) -> Request:
    """Return a request of a model that is of this kind."""
    return replace(request, options=replace(request.options, surface=kind))


def _guessed(request: Request) -> Request:
    """Return a request with what the model is taken for until it is read, while a second process compiles already.

    That is a kind of which nothing has to be compiled, so that nothing is begun in vain again and again.
    """
    if request.options.surface != "auto":
        return request
    kinds = [_of_kind(request, kind) for kind in ("height", "closed")]
    return next((one for one in kinds if not missing(_parts(one))), kinds[0])


def _parts(request: Request) -> list[str]:
    """Return what has to be compiled for a request of a model of a kind that is known."""
    lined = request.rules.break_lines is not None
    if request.options.surface == "closed":
        parts = [*(CLOSED_WISH if request.is_targeted else CLOSED_SEARCH), *(CLOSED_LINED if lined else ())]
        return [*parts, *(CLOSED_FREE if request.free.free else ())]
    parts = [*(WISH if request.is_targeted else SEARCH), *(FREE if request.free.free else ())]
    if request.output.refit or request.free.no_centroids:
        parts.append("scores")
    if request.wish.chooses:
        parts.extend(STATED)
    if lined:
        parts.extend(LINED)
    return parts


def _claim(output: Output, search: Search) -> None:
    """Check the folder to make: a new one, one with a checkpoint, or with ``--overwrite`` one with old results."""
    goes_on = search.checkpoint is not None or not (output.folder / CHECKPOINT).exists()
    if not (is_unfinished(output.folder) and goes_on):
        claim_output(output.folder, overwrite=output.overwrite)


def _check_budget(request: Request) -> None:
    """Refuse moves for an algorithm that makes none; warn where evaluations do not measure what is done."""
    search = request.search
    measured_by = PRESETS[search.algorithm].measured_by
    if search.moves is not None and "moves" not in measured_by:
        movers = [name for name, preset in PRESETS.items() if "moves" in preset.measured_by]
        raise UsageError(
            f"--moves is for --algorithm {' or '.join(movers)}, whose annealing makes them; give {search.algorithm} "
            f"{listed((f'--{kind}' for kind in (*measured_by, 'time')), 'or')}"
        )
    if search.evaluations is not None and "evaluations" not in measured_by:
        way_out = listed((f"--{kind}" for kind in (*measured_by, "time")), "or")
        say(f"warning: evaluations do not measure {request.algorithm}, whose children cost any work; use {way_out}")


def _refuse_impossible(problem: MeshProblem, wish: Wish, *, quiet: bool) -> None:
    """Stop before the search if no subset of the vertices is a mesh, or none can meet the target; say if none may."""
    table = problem.evaluate_subsets(np.array([np.ones(problem.n_var, dtype=bool), problem.pinned]))
    whole, bare = (problem.as_quality(row) for row in table)
    if whole.triangles == 0:
        raise UsageError(
            f"{problem.model.name}: has no triangle with an area as seen from "
            f"{problem.surface.view.rotation[2].tolist()}; choose another viewing side with --up"
        )
    # With open bays, more vertices can mean fewer triangles, but never none.
    bays = problem.surface.rules.footprint == "model"
    if _lines_of(problem) is not None and wish.triangles is not None and wish.triangles < bare.triangles:
        said = _below_lines(problem, wish.triangles, bare.triangles)
        if not bays or problem.model.footprint.side == 0:
            raise UsageError(said)
        if not quiet:
            say(f"{said}; looking for one all the same, as open bays may allow it")
    surface = problem.surface
    least = max(1, min(bare.triangles, 2)) if bays else bare.triangles
    least = surface.least_triangles if isinstance(surface, ClosedSurface) else least
    if wish.triangles is not None and wish.triangles < least:
        raise UsageError(
            f"--triangles {wish.triangles} is impossible: {problem.model.name} has {least} to "
            f"{whole.triangles} triangles with its pinned vertices"
        )
    values = asdict(whole)
    missed = [name for name, most in wish.limits.items() if name != "triangles" and values[name] > most]
    if missed and not quiet:
        # some lie one above the other, or their mesh leaves some uncovered: another subset may be more accurate
        said = listed([f"{MEASURES[name].label} {values[name]:.4g}" for name in missed], "and")
        say(f"even all {problem.n_var:,} vertices together have {said}; looking for what comes nearest")


def _below_lines(problem: MeshProblem, wished: int, smallest: int) -> str:
    """Return that a mesh is wished for that is smaller than break lines allow, and which tolerance would allow it."""
    surface, lines = problem.surface, _lines_of(problem)
    assert isinstance(surface, OfModel)
    assert lines is not None
    tolerance = tolerance_for(surface, wished) if surface.rules.break_lines is not None else None
    way_out = f"no tolerance allows {wished:,}: leave some of the lines out"
    if tolerance is not None:
        way_out = f"--line-tolerance {tolerance:g} would allow {wished:,}"
    return (
        f"--triangles {wished}: with break lines within {lines.tolerance:g} the smallest mesh of "
        f"{problem.model.name} has {smallest:,} triangles; {way_out}"
    )


def _lines_of(problem: MeshProblem) -> ModelLines | None:
    """Return the break lines, which surfaces of a mesh can have."""
    surface = problem.surface
    return surface.model.lines if isinstance(surface, OfModel) else None


# ----------------------------------------------------------------------------------------------------------- the search


@dataclass
class _Found:
    """What a search came back with."""

    front: Front
    generations: int
    evaluations: int
    moves: int | None
    seconds: float
    #: When it was interrupted, until when whoever did that is to wait, by ``time.perf_counter``.
    until: float | None


def budget(request: Request) -> dict[str, float]:
    """Return the budget of a search by kind; where none is given, what is usual for its algorithm."""
    search = request.search
    given: dict[str, float | None] = {
        "time": search.time, "evaluations": search.evaluations, "generations": search.generations,
        "moves": search.moves,
    }  # fmt: skip
    found = {kind: amount for kind, amount in given.items() if amount is not None}
    if found:
        return found
    if request.is_targeted:
        return {"moves": USUAL_BUDGET}
    if PRESETS[search.algorithm].sweeps:
        return {"generations": sweep_generations(search.population, free=request.free.free)}
    return {"generations": DEFAULT_GENERATIONS}


def _set_up(problem: MeshProblem, request: Request) -> Any:
    """Return the algorithm before its first generation."""
    search, preset = request.search, PRESETS[request.search.algorithm]
    terminations = {
        # sweeps end in time by themselves
        "time": TimeBasedTermination if preset.sweeps else WholeGenerations,
        "evaluations": MaximumFunctionCallTermination,
        "generations": MaximumGenerationTermination,
        "moves": Moves,
    }
    ((kind, amount),) = budget(request).items()
    if kind == "time":
        amount = _search_seconds(request, amount)
    if request.is_freed:
        if kind == "time":
            amount *= SUBSETS_SHARE
        elif search.moves is not None:
            amount -= _free_moves(amount)
    if request.is_targeted:
        algorithm: Any = targeted(pop_size=search.population, **request.wish.limits)
    elif request.free.free and preset.frees:
        algorithm = preset.function(pop_size=search.population, triangulation="free", **request.free.how)
    else:
        algorithm = preset.function(pop_size=search.population)
    return algorithm.setup(problem, termination=terminations[kind](amount), seed=search.seed)


def _search_seconds(request: Request, seconds: float) -> float:
    """Return what is left of the time without that for refitting."""
    return seconds * (1.0 - REFIT_SHARE) if request.output.refit else seconds


def _free_moves(moves: float) -> int:
    """Return how many of the moves a front is freed by; at least one is for the search."""
    return int((1.0 - SUBSETS_SHARE) * (moves - 1))


def _search(keeper: Keeper, shown: Stages) -> _Found | None:
    """Run the algorithm to its budget or to Ctrl-C; None if there is no front yet."""
    timed = keeper.request.search.time is not None
    found, generations, interrupted = None, 0, False
    until = None
    try:
        with answering("stopping: the front so far is written next"), shown.stage("searching", "searching") as show:
            algorithm, before = keeper.begin()
            problem = keeper.problem
            start = time.perf_counter()
            found, generations = algorithm.opt, (algorithm.n_iter or 1) - 1
            while algorithm.has_next():
                stop_if_interrupted()
                algorithm.next()
                if keeper.request.is_targeted:
                    words = _answer_in_words(algorithm, first=found is None)
                    if found is None and not keeper.output.quiet:
                        say(words)
                else:
                    words = front_in_words(problem.model, algorithm.evaluator.n_eval, algorithm.opt.get("F"))
                    words += _freed_in_words(getattr(algorithm, "free", None))
                found, generations = algorithm.opt, algorithm.n_iter - 1
                show(0.0 if timed else algorithm.termination.perc, words)  # the clock knows better
                keeper.keep()
            keeper.keep(last=True)
            stop_if_interrupted()
    except KeyboardInterrupt:
        interrupted, until = True, time.perf_counter() + WAIT_SECONDS
        if found is None and (starts := _begun(problem, algorithm)):
            say(f"the search had not begun yet; the front is of {' and '.join(map(str, starts))}, of its start")
    measured_until = None if until is None else until - (1.0 - WHOLE_SHARE) * WAIT_SECONDS
    if interrupted and found is not None and isinstance(algorithm, MemeticSearch):  # what is finished of free meshes
        algorithm.take_free(found, until=time.perf_counter() + FREE_SHARE * WAIT_SECONDS)
    if found is None:
        X = _subsets_begun(problem, algorithm)
        if X is None:
            return None
        found = Population.new(X=X)
    seconds = before + time.perf_counter() - start
    try:
        # Both ends of what is possible are known without a search: all vertices, and the pinned ones alone.
        front = Front.from_population(
            problem,
            found,
            ends=True,
            wish=keeper.request.wish.limits if keeper.request.is_targeted else None,
            until=measured_until,
        )
    except LookupError:
        raise UsageError(
            f"{problem.model.name}: none of {algorithm.evaluator.n_eval} subsets of its vertices spans a triangle "
            "inside its outline; search longer, or pass --footprint hull"
        ) from None
    front.series |= starting_front(problem, algorithm, interrupted=interrupted)
    result = _Found(front, generations, algorithm.evaluator.n_eval, moves_of(algorithm), seconds, until)
    if keeper.request.is_freed and not interrupted:
        _free(result, keeper.request, shown, time.perf_counter() - start + before)
    return result


def _free(found: _Found, request: Request, shown: Stages, seconds: float) -> None:
    """Free the front that a search came back with, in the time that is left of it; ``seconds`` are gone."""
    search, moves = request.search, request.search.moves
    whole = None if search.time is None else _search_seconds(request, search.time)
    ladder, freeing = FreeLadder(**request.free.how), None
    begun = time.perf_counter()
    until = None if whole is None else begun + (whole - seconds) * (1.0 - MEASURED_SHARE_OF_FREE)
    if until is None:
        shown.expect("freeing", FREEING_SECONDS)
    try:
        stop_if_interrupted()  # while the front was measured
        with answering("stopping: the front so far is written next"), shown.stage("freeing", "freeing") as show:
            freeing = Freeing(
                found.front,
                ladder,
                moves=None if moves is None else _free_moves(moves),
                timed=whole is not None,
                seed=search.seed,
                wish=request.wish.limits,
            )

            def tell() -> None:
                share = 0.0 if until is not None else len(ladder.fronts) / len(ladder.sizes)  # the clock knows better
                show(share, _freed_in_words(ladder)[2:])

            more = True
            while more:
                stop_if_interrupted()
                more = freeing.go_on(None if until is None else until - time.perf_counter(), tell)
            stop_if_interrupted()
    except KeyboardInterrupt:
        found.until = time.perf_counter() + WAIT_SECONDS
    found.seconds = seconds + time.perf_counter() - begun
    if freeing is None:
        say("interrupted before any size was annealed freely: all meshes are Delaunay")
        return
    if ladder.todo:
        say(
            f"{len(ladder.todo)} of {len(ladder.sizes)} sizes are not annealed freely in the time; the meshes there "
            "are those of other sizes, thinned, or Delaunay"
        )
    found.front = freeing.front(until=None if found.until is None else found.until - (1 - WHOLE_SHARE) * WAIT_SECONDS)
    found.seconds = seconds + time.perf_counter() - begun


def _freed_in_words(ladder: FreeLadder | None) -> str:
    """Return how far free meshes are, behind what else is said."""
    if ladder is None or not len(ladder.sizes):
        return ""
    return f", free meshes of {len(ladder.fronts)} of {len(ladder.sizes)} sizes"


def _answer_in_words(algorithm: Any, *, first: bool) -> str:
    """Return what comes nearest to a wish so far, for the line of its progress."""
    answer, errors = algorithm.answer, [name for name in algorithm.limits if name != "triangles"]
    searched = {"error": "mean_error"}.get(algorithm.problem.objectives[0], algorithm.problem.objectives[0])
    said = [f"{int(answer.F[-1]):,} triangles"]
    said += [f"{MEASURES[name].label} {float(answer.get(name)):.4g}" for name in errors or [searched]]
    if len(answer.X) == int(answer.X.sum()):
        said.append("which takes all vertices")
    if algorithm.missed:
        said.append("which misses the wish")
    return f"{'first answer' if first else 'best so far'}: {', '.join(said)}"


def _begun(problem: MeshProblem, algorithm: Any) -> list[Start]:
    """Return what there is of a search's start."""
    if isinstance(algorithm, TargetedSearch):
        return algorithm.begun
    start = begun(problem.surface) if isinstance(_sampling(algorithm), NestedSubsets) else None
    return [] if start is None else [start]


def _sampling(algorithm: Any) -> Any:
    return getattr(getattr(algorithm, "initialization", None), "sampling", None)


def _subsets_begun(problem: MeshProblem, algorithm: Any) -> NDArray[np.bool_] | None:
    """Return subsets of what there is of a search's start, as many as can be measured soon; None if there is none."""
    starts = _begun(problem, algorithm)
    if not starts:
        return None
    if isinstance(algorithm, TargetedSearch):
        n = -(-algorithm.pop_size // len(starts))
        rows = [(start, k) for start in starts for k in rungs(start, n)]
    else:
        rows = [(starts[0], int(k)) for k in np.unique(_sampling(algorithm).rows(starts[0], algorithm.pop_size))]
    triangles = np.array([start.triangles[k] for start, k in rows])
    seconds = SECONDS_A_VERTEX * problem.n_var + SECONDS_A_TRIANGLE * triangles
    order = spread(len(rows))
    in_time = np.cumsum(seconds[order]) <= MEASURED_SHARE * WAIT_SECONDS
    chosen = [row for row, fits in zip(order, in_time, strict=True) if fits] or [0]
    return np.array([rows[row][0].kept(rows[row][1]) for row in sorted(chosen)])


class Keeper:
    """The checkpoints of a search, in the folder of its results.

    Parameters
    ----------
    problem : MeshProblem
        What is searched; after :meth:`begin`, with the images that its checkpoint has of a closed surface.
    request : Request
        How, where the results go, and whether old ones give way.
    before : mapping
        What was done before, and how long it took [s].
    """

    def __init__(self, problem: MeshProblem, request: Request, before: Mapping[str, float]) -> None:
        self.problem = problem
        self.request = request
        self.search = request.search
        self.output = request.output
        self.before = before
        self.path = self.output.folder / CHECKPOINT
        #: When the search was begun, perhaps by another process.
        self.begun = now()
        self._checkpoints: Checkpoints | None = None
        self._warned = False

    @property
    def is_kept(self) -> bool:
        """Whether the folder holds a checkpoint of this search: any other was refused, or is replaced.

        Asked of the folder: a signal may come when the file is there and nobody has noted it yet.
        """
        return self.search.checkpoint is not None and self.path.exists()

    @property
    def what(self) -> dict[str, Any]:
        """What the search is: all that decides its results."""
        search, versions, lines = self.search, package_versions(), _lines_of(self.problem)
        return {
            # the lines, of which the model's hash says only that it is another
            **plain(self.problem.surface.rules),
            **({} if lines is None else {"break lines": lines.hash}),
            "model": self.problem.model.hash,
            "algorithm": self.request.algorithm,
            **(self.request.wish.limits if self.request.is_targeted else {}),
            "population": search.population,
            "seed": search.seed,
            **budget(self.request),
            **(asdict(self.request.free) if self.request.free.free else {}),
            **({"refit": True} if self.output.refit and search.time is not None else {}),  # takes a share of the time
            **{name: versions.get(name) for name in ("meshsimp-pymoo", "pymoo", "numpy")},
        }

    def begin(self) -> tuple[Any, float]:
        """Return the algorithm, where its checkpoint left it if there is one, and the seconds it took before."""
        algorithm, before, interval, problem = None, 0.0, self.search.checkpoint, self.problem
        if interval is not None and self.path.exists():
            try:
                algorithm, before = self._go_on()
            except CheckpointError as trouble:
                if not self.output.overwrite:
                    raise ResultError(
                        f"{trouble}; name another folder, or allow overwriting (--overwrite) to begin anew"
                    ) from None
                algorithm, self.problem = None, problem
        if algorithm is None:
            algorithm = _set_up(self.problem, self.request)
        if interval is None:
            return algorithm, before
        arrays = stored_arrays(self.problem.surface)
        try:
            self._checkpoints = Checkpoints(
                self.path, algorithm, self.what, interval=interval, before=before, arrays=arrays
            )
        except NotResumable as trouble:
            self._warn(trouble)
        return algorithm, before

    def _go_on(self) -> tuple[Any, float]:
        """Return the algorithm where the checkpoint left it, and the seconds that took."""
        stored = read_checkpoint(self.path)
        reason = self._take_images(stored)
        if other := difference(stored.what, self.what) or reason:
            raise CheckpointError(f"{self.path}: belongs to another search ({other})")
        algorithm = _set_up(self.problem, self.request)
        restore(stored, algorithm)
        self.begun = stored.facts.get("begun", self.begun)
        if not self.output.quiet:
            say(
                f"{self.output.folder} holds a search that was stopped after {algorithm.n_iter - 1} generations, "
                f"{algorithm.evaluator.n_eval:,} evaluations, {stored.seconds:.0f} s; going on from there"
            )
        return algorithm, stored.seconds

    def _take_images(self, stored: Stored) -> str:
        """Give the problem the images that a checkpoint has of a closed surface; return why not, if they are others."""
        try:
            surface = as_stored(self.problem.surface, stored.arrays)
        except KeyError as name:
            return f"it holds no {name}"
        except ModelError as trouble:
            return str(trouble)
        if surface is not self.problem.surface:
            options, objectives = self.problem.options, self.problem.objectives
            self.problem = MeshProblem(surface, objectives=objectives, n_threads=self.search.threads)
            self.problem.options = options  # a surface is given as it is, but was read so
        return ""

    def keep(self, *, last: bool = False) -> None:
        """Save the state if it is time; at the end of the search, if it was long enough to be worth it."""
        checkpoints = self._checkpoints
        if checkpoints is None or not (checkpoints.due() or (last and self.is_kept)):
            return
        try:
            checkpoints.save(begun=self.begun)
        except (CheckpointError, NotResumable, OSError) as problem:
            self._warn(problem)

    def _warn(self, problem: Exception) -> None:
        """Say once what is wrong with the checkpoints; the search is worth more."""
        if not self._warned:
            say(f"warning: {problem}; the search goes on without a checkpoint")
        self._warned = True


# ---------------------------------------------------------------------------------------------------------- the results


def _write(found: _Found, keeper: Keeper, shown: Stages) -> int | None:
    """Write what was found; return the exit code if it could not be, and the checkpoint is in place."""
    request, search, output = keeper.request, keeper.search, keeper.output
    folder, front = output.folder, found.front
    chosen, _ = request.wish.of(front)
    try:
        fitted = _refit(found, chosen, request, shown) if output.refit else None
        run = {
            "settings": request.recorded | budget(request),
            "seed": search.seed,
            "generations": found.generations,
            "evaluations": found.evaluations,
            **({} if found.moves is None else {"moves": found.moves}),
            **({"wish": request.wish.limits} if request.is_targeted else {}),
            "begun": keeper.begun,
            "seconds": round(found.seconds, 3),
            **{name: round(seconds, 3) for name, seconds in keeper.before.items()},
            **({"free_seconds": round(shown.seconds["freeing"], 3)} if "freeing" in shown.seconds else {}),
            **({} if fitted is None else {"refit_seconds": round(shown.seconds["refitting"], 3)}),
            "interrupted": found.until is not None,
        }
        with shown.stage("writing", "writing"):
            front.save(
                folder,
                # the folder of our own checkpoint gives way to the results
                overwrite=output.overwrite or keeper.is_kept or (is_unfinished(folder) and not keeper.path.exists()),
                meshes=output.meshes,
                mesh_format=output.format,
                chosen=chosen,
                refit=False if fitted is None else fitted,
                solid=output.solid,
                pictures=False,
                run=run,
                until=found.until,
            )
    except (ResultError, KeyboardInterrupt) as stop:
        if not keeper.is_kept:
            raise
        reason = "interrupted while the results were written" if isinstance(stop, KeyboardInterrupt) else str(stop)
        say(f"{reason}; the same command goes on from the checkpoint in {folder}")
        return INTERRUPTED if isinstance(stop, KeyboardInterrupt) else BAD_INPUT
    return None


def _refit(found: _Found, chosen: FrontSolution | None, request: Request, shown: Stages) -> dict[int, Refitted]:
    """Return the meshes to be written with their best vertices, as many as the time allows, the chosen one first.

    A mesh of which these raise an error that is wished for keeps its own.
    """
    wished = [name for name in request.wish.limits if MEASURES[name].unit]
    front, limit = found.front, request.search.time
    rows = even_selection(len(front), request.output.meshes)
    order = [rows[k] for k in spread(len(rows))]
    if chosen is not None:
        order = [chosen.solution, *(row for row in order if row != chosen.solution)]
    until, begun_at = None, time.perf_counter()
    if found.until is not None:  # who interrupts a search does not want to wait
        until = begun_at + REFIT_SHARE * max(found.until - begun_at, 0.0)
    elif limit is not None:
        until = begun_at + limit - found.seconds
    fitted: dict[int, Refitted] = {}
    done, longest = 0, 0.0
    with shown.stage("refitting", "refitting") as show:
        for row in order:
            begun = time.perf_counter()
            if until is not None and done and begun + longest > until:
                break
            if is_interrupted() and done:
                break
            refitted = front[row].refit(until=until)
            if not _raises(front[row], refitted, wished):
                fitted[row] = refitted
            done += 1
            longest = max(longest, time.perf_counter() - begun)
            show(done / len(order), f"refitted {done} of {len(order)} meshes")
    if done < len(order):
        say(
            f"{done} of {len(order)} meshes are refitted in the time given; for more search longer (--time) or "
            "write fewer (--meshes)"
        )
    if len(fitted) < done:
        raised = listed([MEASURES[name].label for name in wished], "or")
        say(
            f"{done - len(fitted)} of {done} meshes are not refitted: vertices moved for less error in all raise their "
            f"{raised}"
        )
    return fitted


def _raises(solution: FrontSolution, refitted: Refitted, wished: list[str]) -> bool:
    """Tell whether moved vertices raise one of these measures of a mesh, by more than rounding."""
    others = [name for name in wished if name != "mean_error"]  # which they lower
    if not others:
        return False
    surface = solution.front.surface
    found = surface.score(refitted.vertices, np.searchsorted(refitted.rows, refitted.faces)).quality
    return any(getattr(found, name) > (1.0 + 1e-9) * getattr(solution, name) for name in others)

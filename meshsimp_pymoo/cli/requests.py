"""What a command line of ``meshsimp simplify`` asks for, as objects: how to search, what to choose, what to write."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from meshsimp_pymoo.cli.arguments import Share, in_numbers_of, option, settings_from, wishes_of
from meshsimp_pymoo.errors import UsageError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import listed, written_formats
from meshsimp_pymoo.search.presets import DEFAULT, PRESETS
from meshsimp_pymoo.search.wishes import SEARCHED, measure_for
from meshsimp_pymoo.surface.measures import MEASURES, OBJECTIVES
from meshsimp_pymoo.surface.rules import USUAL_RATIO, Rules

Part = TypeVar("Part")

# What says so, or what the model turned out to be.
CLOSED = "a closed surface (--surface closed)"
# From this many samples on, a grid is thinned tile by tile without being asked.
TILED_FROM = 2_000_000


@dataclass(frozen=True)
class Search:
    """How to search; of the four budgets at most one is given."""

    algorithm: str = DEFAULT
    population: int = 100
    seed: int = 1
    time: float | None = None
    evaluations: int | None = None
    generations: int | None = None
    moves: int | None = None
    threads: int | None = None
    checkpoint: float | None = 60.0


@dataclass(frozen=True)
class Wish:
    """Which solution is wanted as the chosen mesh: within limits, by measure, or the knee; none if nothing is said."""

    limits: dict[str, Any] = field(default_factory=dict)
    knee: bool = False

    @property
    def triangles(self) -> int | None:
        """The most triangles that are wanted; None too where they are a share and the original is not known yet."""
        found = self.limits.get("triangles")
        return None if found is None or isinstance(found, Share) else int(found)

    @property
    def chooses(self) -> bool:
        """Whether a mesh is wanted."""
        return bool(self.limits) or self.knee

    def among(self, original: Callable[[], int]) -> Wish:
        """Return what is wanted of an original with so many triangles."""
        return replace(self, limits=in_numbers_of(self.limits, original))

    @property
    def options(self) -> str:
        """The limits as the command line names them."""
        return listed([option(name) for name in self.limits], "and") if self.limits else ""

    @property
    def spelled(self) -> str:
        """All of it as the command line of ``meshsimp simplify`` says it."""
        said = [f"{option(name)} {limit:.15g}" for name, limit in self.limits.items()]
        return " ".join(said + ["--pick knee"] * self.knee)

    def choices(self, number: int | None) -> list[str]:
        """Return the option that chooses a mesh, in a list: limits, the knee or the number of a solution; or none.

        Raises
        ------
        UsageError
            If there are two of them.
        """
        choices = {self.options: self.limits, "--knee": self.knee, "--solution": number is not None}
        said = [choice for choice, is_said in choices.items() if is_said]
        if len(said) > 1:
            raise UsageError(f"{said[0]} does not go with {said[1]}: each chooses a mesh; leave one of them out")
        return said

    def of(self, front: Any) -> tuple[Any | None, str]:
        """Return the solution of a front that is wanted, if one is, and why there is none, if so."""
        if self.knee:
            return front.knee(), ""
        if not self.limits:
            return None, ""
        try:
            return front.best(**self.limits), ""
        except LookupError as problem:
            return None, str(problem)


@dataclass(frozen=True)
class Free:
    """Whether edges are chosen for the error too, and how."""

    free: bool = False
    free_height: float = USUAL_RATIO
    no_centroids: bool = False

    @property
    def how(self) -> dict[str, Any]:
        """What free meshes are to be, as Python calls it."""
        return {"min_height": self.free_height, "centroids": not self.no_centroids}


@dataclass(frozen=True)
class Output:
    """What to write where, and what to show."""

    folder: Path
    overwrite: bool = False
    format: str = "ply"
    meshes: int | None = 100
    refit: bool = False
    solid: float | None = None
    page: bool = True
    quiet: bool = False
    json: bool = False


@dataclass(frozen=True)
class Tiling:
    """How to work by tiles: samples along one side (None: as is best, 0: not), and where the tiles are thinned."""

    tile: int | None = None
    pieces: bool = False
    jobs: int | None = None
    dask: str | None = None


@dataclass(frozen=True)
class Request:
    """All that a command line of ``meshsimp simplify`` asks for."""

    model: str
    options: Options
    rules: Rules
    search: Search
    wish: Wish
    free: Free
    output: Output
    tiling: Tiling
    #: What is minimised, if the command line says so; ``rules`` have what a wish makes of it.
    measure: str | None = None

    @property
    def is_targeted(self) -> bool:
        """Whether the search is for the mesh that is wished for; other algorithms than the default find a front."""
        return bool(self.wish.limits) and self.search.algorithm == DEFAULT

    @property
    def algorithm(self) -> str:
        """What searches."""
        return "targeted" if self.is_targeted else self.search.algorithm

    @property
    def is_freed(self) -> bool:
        """Whether the front is freed when the search is done, which does not do it itself."""
        return self.free.free and (self.is_targeted or not PRESETS[self.search.algorithm].frees)

    @property
    def wanted(self) -> dict[str, Any]:
        """What of it is worth a place in the record of any results: which mesh was wanted, how meshes are written."""
        shown = {name: getattr(self.output, name) for name in ("format", "meshes")}
        return self.wish.limits | ({"pick": "knee"} if self.wish.knee else {}) | shown

    @property
    def recorded(self) -> dict[str, Any]:
        """What of it is worth a place in the record of what was searched, beside options and rules."""
        search = {name: value for name, value in asdict(self.search).items() if name not in ("seed", "checkpoint")}
        free = asdict(self.free) if self.free.free else {"free": False}
        solid = {} if self.output.solid is None else {"solid": self.output.solid}
        return search | {"algorithm": self.algorithm} | free | self.wanted | {"refit": self.output.refit} | solid


def request_of(args: argparse.Namespace) -> Request:
    """Return what a command line of ``meshsimp simplify`` asks for; from here on no namespace travels."""
    if args.output is not None:
        _refuse_file(args.output)
    folder = args.output or f"{re.sub(r'[^A-Za-z0-9._-]+', '_', Path(args.model).stem)}_front"
    measure = next((name for name, known in OBJECTIVES.items() if known.minimised == args.measure), None)
    request = Request(
        model=args.model,
        options=settings_from(args, Options),
        rules=settings_from(args, Rules, measure=measure or Rules().measure),
        search=_part(Search, args),
        wish=Wish(wishes_of(args), args.pick == "knee"),
        free=_part(Free, args),
        output=_part(Output, args, folder=Path(folder)),
        tiling=_part(Tiling, args),
        measure=measure,
    )
    refuse(request)
    if not request.is_targeted:
        return request
    return replace(request, rules=replace(request.rules, measure=measure_for(request.wish.limits, measure)))


def refuse(request: Request) -> None:
    """Refuse what does not go with each other; once more when ``request.options.surface`` is what the model is."""
    for (one, other), (meets, why) in REFUSED.items():
        if meets(request):
            do = "do" if one == "{wish}" and len(request.wish.limits) > 1 else "does"
            raise UsageError(
                f"{_filled(one, request)} {do} not go with {_filled(other, request)}: {_filled(why, request)}"
            )


def _refuse_file(folder: str) -> None:
    """Refuse what looks like a mesh file for the folder to make."""
    from meshsimp_pymoo.files import as_argument

    path = Path(folder)
    kind = next((kind for kind in written_formats().values() if path.suffix.lower() in kind.suffixes), None)
    if kind is not None and not path.is_dir():
        instead = f"-o {as_argument(path.with_suffix(''))} --format {kind.name}"
        raise UsageError(f"{folder}: -o names a folder, for the front and the mesh you want; say {instead}")


def _lowers_another(request: Request) -> bool:
    """Tell whether a measure is named that is not the one that is wished for."""
    try:
        measure_for(request.wish.limits, request.measure)
    except ValueError:
        return request.is_targeted
    return False


def _is_free_alone(name: str) -> Callable[[Request], bool]:
    """Return what tells whether something is said of free meshes where there are none."""
    return lambda request: not request.free.free and getattr(request.free, name) != getattr(Free(), name)


def _is_closed_and(meets: Callable[[Request], bool]) -> Callable[[Request], bool]:
    """Return what tells whether something is said of a closed surface."""
    return lambda request: request.options.surface == "closed" and meets(request)


# What does not go with what, whatever the model is: two options, when that is so, and why, with the way out. What tiles
# do not know is said in cli/tiling.py; rules and options that describe height surfaces a closed one refuses itself.
REFUSED: dict[tuple[str, str], tuple[Callable[[Request], bool], str]] = {
    ("{wish}", "--pick knee"): (
        lambda request: bool(request.wish.limits) and request.wish.knee,
        "each chooses a mesh, and there is one chosen mesh; leave one of them out",
    ),
    ("{wish}", "--measure {measure}"): (
        _lowers_another,
        "a wish for an error lowers that error, as --measure {wished} does; leave --measure out, or take the mesh out "
        "of a front that was searched by it (meshsimp pick)",
    ),
    **{
        (option(name), "Delaunay meshes"): (
            _is_free_alone(name),
            "it is of free ones; leave it out, or add --free",
        )
        for name in ("free_height", "no_centroids")
    },
    ("--solid", "a front alone"): (
        lambda request: request.output.solid is not None and not (request.wish.limits or request.wish.knee),
        "it is for the chosen mesh; say which is wanted (--triangles N, --pick knee), or make it later (meshsimp pick)",
    ),
    ("--solid", "--format {format}"): (
        lambda request: request.output.solid is not None and written_formats()[request.output.format].one_height,
        "{title} holds surfaces with one height at each place, and a solid has two; write another format, such as stl",
    ),
    ("--solid", CLOSED): (
        _is_closed_and(lambda request: request.output.solid is not None),
        "it needs no base; leave --solid out",
    ),
    ("--format {format}", CLOSED): (
        _is_closed_and(lambda request: written_formats()[request.output.format].one_height),
        "{title} holds surfaces with one height at each place; write another format, such as ply",
    ),
}


def _filled(words: str, request: Request) -> str:
    spelled = MEASURES[request.measure].minimised if request.measure else ""
    wished = [OBJECTIVES[SEARCHED[name]].minimised for name in request.wish.limits if name in SEARCHED]
    kind = written_formats()[request.output.format]
    return words.format(
        wish=request.wish.options,
        measure=spelled,
        wished=listed(wished, "or") if wished else "",
        format=kind.name,
        title=kind.title,
    )


def _part(kind: type[Part], args: argparse.Namespace, **others: Any) -> Part:
    """Return a part of a request with what the command line says."""
    names = {item.name for item in fields(kind)} - set(others)  # type: ignore[arg-type]
    return kind(**{name: getattr(args, name) for name in names} | others)

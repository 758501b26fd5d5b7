"""What a command line of ``meshsimp simplify`` asks for, as objects: how to search, what to choose, what to write."""

from __future__ import annotations

import argparse
import re
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

from meshsimp_pymoo.cli.arguments import settings_from, wishes_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.search.presets import DEFAULT
from meshsimp_pymoo.surface.measures import OBJECTIVES
from meshsimp_pymoo.surface.rules import Rules

Part = TypeVar("Part")

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

    limits: dict[str, float] = field(default_factory=dict)
    knee: bool = False

    @property
    def triangles(self) -> int | None:
        """The most triangles that are wanted."""
        found = self.limits.get("triangles")
        return None if found is None else int(found)

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
class Output:
    """What to write where, and what to show."""

    folder: Path
    overwrite: bool = False
    format: str = "ply"
    meshes: int | None = 100
    refit: bool = False
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
    output: Output
    tiling: Tiling

    @property
    def wanted(self) -> dict[str, Any]:
        """What of it is worth a place in the record of any results: which mesh was wanted, how meshes are written."""
        shown = {name: getattr(self.output, name) for name in ("format", "meshes")}
        return self.wish.limits | ({"pick": "knee"} if self.wish.knee else {}) | shown

    @property
    def recorded(self) -> dict[str, Any]:
        """What of it is worth a place in the record of what was searched, beside options and rules."""
        search = {name: value for name, value in asdict(self.search).items() if name not in ("seed", "checkpoint")}
        return search | self.wanted | {"refit": self.output.refit}


def request_of(args: argparse.Namespace) -> Request:
    """Return what a command line of ``meshsimp simplify`` asks for; from here on no namespace travels."""
    folder = args.output or f"{re.sub(r'[^A-Za-z0-9._-]+', '_', Path(args.model).stem)}_front"
    measure = next(name for name, known in OBJECTIVES.items() if known.minimised == args.measure)
    return Request(
        model=args.model,
        options=settings_from(args, Options),
        rules=settings_from(args, Rules, measure=measure),
        search=_part(Search, args),
        wish=Wish(wishes_of(args), args.pick == "knee"),
        output=_part(Output, args, folder=Path(folder)),
        tiling=_part(Tiling, args),
    )


def _part(kind: type[Part], args: argparse.Namespace, **others: Any) -> Part:
    """Return a part of a request with what the command line says."""
    names = {item.name for item in fields(kind)} - set(others)  # type: ignore[arg-type]
    return kind(**{name: getattr(args, name) for name in names} | others)

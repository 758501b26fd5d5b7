"""What a command line of ``meshsimp simplify`` asks for, as objects: how to search, what to choose, what to write."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

from meshsimp_pymoo.search.presets import DEFAULT

Request = TypeVar("Request")


@dataclass(frozen=True)
class Search:
    """How to search; of the three budgets at most one is given."""

    algorithm: str = DEFAULT
    population: int = 100
    seed: int = 1
    time: float | None = None
    evaluations: int | None = None
    generations: int | None = None
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


def requested(kind: type[Request], args: Any, **others: Any) -> Request:
    """Return an object of one of these classes with what the command line says."""
    names = {item.name for item in fields(kind)} - set(others)  # type: ignore[arg-type]
    return kind(**{name: getattr(args, name) for name in names if hasattr(args, name)} | others)


def recorded(search: Search, wish: Wish, output: Output) -> dict[str, Any]:
    """Return what of a request is worth a place in the record of its results."""
    kept = {name: value for name, value in asdict(search).items() if name not in ("seed", "checkpoint")}
    shown = {name: getattr(output, name) for name in ("format", "meshes", "refit")}
    return kept | wish.limits | ({"pick": "knee"} if wish.knee else {}) | shown

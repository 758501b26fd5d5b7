"""What has to be compiled once on a machine, and the doing of it: in two processes where two cores are free.

Functions are compiled when they are called for the first time, so each part of this table calls those of one subject on
a mesh of a few vertices, in the way in which the package calls them. What Python calls is in one part each.
"""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from meshsimp_pymoo.compiling.store import has_code, place

PACKAGE = __name__.partition(".")[0]


class Part(NamedTuple):
    """Functions that are compiled together."""

    name: str
    #: What Python calls, as file:function.
    entries: tuple[str, ...]
    #: Calls them all.
    work: Callable[[], Any]
    #: What that takes, about, on one core at 2.6 GHz [s].
    seconds: float
    #: Whether the second process does it, where there is one: what stands on the moves of the live triangulation.
    beside: bool
    #: For surfaces of which kind, as file:class of their ground, where the entries are for several.
    ground: str | None = None


# ------------------------------------------------------------------------------------------------------------ the calls


def _reading() -> None:
    from meshsimp_pymoo.datasets import load
    from meshsimp_pymoo.surface.model import build_model

    # a scan with bays: its order, the look for folds, the cells of its footprint
    _ = build_model(load("horseshoe:60")).footprint


def _square() -> Any:
    """Return the surface of a grid of 3 x 3 samples, put together without anything that is compiled."""
    import numpy as np

    from meshsimp_pymoo.surface.height import HeightSurface
    from meshsimp_pymoo.surface.model import placed_model
    from meshsimp_pymoo.surface.rules import Rules

    x, y = np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0])
    points = np.column_stack([x.ravel(), y.ravel(), [0.0, 0.1, 0.3, 0.2, 0.9, 0.1, 0.4, 0.2, 0.0]])
    a = np.array([0, 1, 3, 4])
    faces = np.concatenate([np.column_stack([a, a + 1, a + 4]), np.column_stack([a, a + 4, a + 3])])
    corners, rows = np.array([0, 2, 6, 8]), np.arange(9)
    model = placed_model("square", points, faces, corners, xy=points[:, :2], unit=1.0, source_index=rows)
    return HeightSurface(model, Rules(footprint="hull", outside="nearest"))


def _evaluation() -> None:
    surface = _square()
    surface.evaluate(surface.pinned[None])
    surface.simplify(surface.pinned)


def _compile_for(function: Any, *arguments: Any) -> None:
    """Compile a function for arguments like these, without calling it."""
    from numba import typeof

    function.compile(tuple(map(typeof, arguments)))


def _body() -> Any:
    """Return the surface of a tetrahedron with a vertex on one of its edges, seen from within the face opposite."""
    import numpy as np

    from meshsimp_pymoo.surface.closed.model import ClosedModel
    from meshsimp_pymoo.surface.closed.surface import ClosedSurface

    points = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, 4], [0.6, 0.5, 2]])
    faces = np.array([[0, 2, 1], [0, 1, 4], [1, 3, 4], [1, 2, 3], [0, 4, 2], [4, 3, 2]], np.int32)
    xy = np.array([[0.0, 0.0], [0.75, 0.0], [0.0, 0.75], [0.25, 0.25], [0.125, 0.125]])
    rows, same = np.arange(5), np.eye(3)
    model = ClosedModel("body", points, faces, xy, np.array([[0, 2, 1]]), rows, points, {}, same, np.zeros(3))
    return ClosedSurface(model)


def _records(surface: Any) -> tuple[Any, Any]:
    from meshsimp_pymoo.surface import books
    from meshsimp_pymoo.surface.closed import books as closed_books
    from meshsimp_pymoo.surface.ground import Ground

    ground = surface.ground()
    make = books.make_live if isinstance(ground, Ground) else closed_books.make_live
    return ground, make(surface.n_vertices)


def _building(make: Callable[[], Any] = _square) -> None:
    from meshsimp_pymoo.surface.moves import snapshot

    surface = make()
    with surface.books(surface.pinned) as books:
        snapshot(surface.ground(), books, surface.n_vertices)


def _thinning(make: Callable[[], Any] = _square) -> None:
    import numpy as np

    from meshsimp_pymoo.search.greedy import thin

    surface = make()
    n, rows, numbers = surface.n_vertices, np.zeros(9, np.int32), np.zeros(9)
    _compile_for(
        thin, *_records(surface), n, surface.pinned, 0, np.inf, np.inf, np.zeros(1, np.bool_), rows, numbers, rows
    )


def _moves(make: Callable[[], Any] = _square) -> None:
    import numpy as np

    from meshsimp_pymoo.search.local_search import USUAL_MOVES, anneal, fit_size

    surface = make()
    records, n, rows, state = _records(surface), surface.n_vertices, np.zeros(9, np.int64), np.zeros(1, np.uint64)
    graph, shares, stop = (surface.border, *surface.neighbours), tuple(map(float, USUAL_MOVES)), np.zeros(1, np.bool_)
    flags = surface.pinned
    _compile_for(anneal, *records, n, flags, rows, *graph, 1, 0.1, 0.1, 8, shares, state, stop, rows, flags, rows)
    _compile_for(fit_size, *records, n, surface.pinned, True, 8, state, stop)


def _insertion(make: Callable[[], Any] = _square) -> None:
    from meshsimp_pymoo.search.greedy import greedy_insertion

    greedy_insertion(make())


def _closed() -> None:
    from meshsimp_pymoo.plane.hilbert import hilbert_keys
    from meshsimp_pymoo.surface.closed.embedding import faults

    surface = _body()
    model = surface.model
    faults(model.xy, model.faces, model.poles)
    hilbert_keys(model.xy)
    surface.evaluate(surface.pinned[None])
    surface.score(surface.points, surface.faces)


def _single_moves() -> None:
    from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation

    surface = _square()
    live = LiveTriangulation(surface, surface.pinned)
    live.try_insert(4)
    live.insert(4)


def _tiles() -> None:
    import numpy as np

    from meshsimp_pymoo.opening import open_grid
    from meshsimp_pymoo.tiles.front import LEAST_TILE, tiled_front

    side = np.arange(2.0 * LEAST_TILE)
    tiled_front(open_grid(np.add.outer(side, side**2 % 7)), tile=LEAST_TILE)


def _gaps() -> None:
    import numpy as np

    from meshsimp_pymoo.opening import open_grid
    from meshsimp_pymoo.tiles.front import LEAST_TILE, tiled_front

    heights = np.add.outer(np.arange(2.0 * LEAST_TILE), np.arange(6.0) ** 2 % 7)
    heights[2:-2, 2:4] = np.nan
    tiled_front(open_grid(heights), tile=LEAST_TILE)


def _free(make: Callable[[], Any] = _square) -> None:
    from meshsimp_pymoo.search.free import FreeLadder

    surface = make()
    FreeLadder().compile_for(surface, surface.pinned)


def _scores() -> None:
    surface = _square()
    surface.score(surface.points, surface.faces[:2])


def _distances() -> None:
    from meshsimp_pymoo.surface.closed.nearest import distances_to_mesh

    surface = _square()
    distances_to_mesh(surface.points, surface.points, surface.faces)


def _lining() -> None:
    from meshsimp_pymoo.surface.height import HeightSurface
    from meshsimp_pymoo.surface.lining import lined_model

    # a line without heights that turns, so that it is cut, draped and thinned around another, which is met
    bent = [[-0.5, 0.1], [0.3, 0.6], [0.4, 0.6], [0.9, 0.1]]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # says what is cut off
        lined = lined_model(_square().model, [bent, [[0.35, 0.3], [0.35, 0.5]]], 0.5)
    HeightSurface(lined).ground()


def _folds() -> None:
    import numpy as np

    from meshsimp_pymoo.formats.source import build_source
    from meshsimp_pymoo.surface.orient import front_patch
    from meshsimp_pymoo.surface.overlap import hidden_faces

    # a sheet that turns back over itself: it has a front and a back, and hides a part
    x, z = np.array([0.0, 2.0, 3.0, 2.0, 0.5]), np.array([0.0, 0.0, 0.5, 1.0, 1.0])
    points = np.array([[px, py, pz] for px, pz in zip(x, z, strict=True) for py in (0.0, 1.0)])
    faces = np.array([[2 * k + i for i in corner] for k in range(4) for corner in ((0, 2, 1), (1, 2, 3))], np.int32)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # says what is left out
        front_patch(build_source(points, faces, name="sheet"), up="z")
    hidden_faces(points, np.concatenate([faces[:4], faces[4:, ::-1]]))


def _files() -> None:
    import numpy as np

    from meshsimp_pymoo.formats.source import rows

    corners = rows.PlyProperty("corners", np.dtype("i4"), np.dtype("u1"))
    element = rows.PlyElement("face", 2, [corners])
    rows.text_columns(b"1 0 2 0 0", 0, [element], "two faces")
    rows.binary_columns(b"\x01" + bytes(4) + b"\x02" + bytes(8), 0, [element], "two faces")


# ------------------------------------------------------------------------------------------------------------ the table

#: Grounds, as file:class.
HEIGHT, CLOSED = "surface.ground:Ground", "surface.closed.ground:ClosedGround"
FREEDOM, CLOSED_FREEDOM = "surface.fans:Freedom", "surface.closed.free:ClosedFreedom"

PARTS = (
    Part(
        "reading",
        (
            "plane.hilbert:hilbert_keys", "plane.footprint:_mark_outline", "plane.footprint:_face_cells",
        ),
        _reading, 2.0, False,
    ),
    Part(
        "evaluation", ("surface.evaluate:_evaluate", "surface.evaluate:measure_between"), _evaluation, 6.2, False
    ),
    Part("building", ("surface.live:_build", "surface.moves:snapshot"), _building, 6.6, False, HEIGHT),
    Part("thinning", ("search.greedy:thin",), _thinning, 16.6, True, HEIGHT),
    Part("moves", ("search.local_search:anneal", "search.local_search:fit_size"), _moves, 5.9, True, HEIGHT),
    Part(
        "free meshes", ("surface.free:_open", "surface.free:anneal_freely", "search.free:_thin"), _free, 12.0, False,
        FREEDOM,
    ),
    Part("insertion", ("search.greedy:_grow",), _insertion, 4.5, False, HEIGHT),
    Part("single moves", ("surface.live:exchange_once", "surface.live:try_exchange_once"), _single_moves, 3.4, True),
    Part(
        "tiles",
        (
            "plane.triangulation:triangulate_once", "search.raster:_insert_worst", "tiles.thin:_hull_levels",
            "tiles.thin:_find_foreign",
            "surface.weld:_measure_rows", "surface.weld:_measure_cells",
        ),
        _tiles, 2.5, False,
    ),
    Part(
        "gaps in grids",
        (
            "surface.gaps:_emit", "surface.gaps:_outline", "surface.gaps:_find_starts",
            "surface.gaps:_measure_rows_with_gaps", "surface.gaps:_measure_cells_with_gaps",
            "tiles.gaps:_find_beside_gaps",
        ),
        _gaps, 5.8, False,
    ),
    Part("scores", ("surface.score:_cover", "surface.score:_measure_outside"), _scores, 1.5, False),
    Part("distances", ("surface.closed.nearest:_nearest_triangles",), _distances, 1.0, False),
    Part(
        "break lines",
        (
            "plane.segments:_in_faces", "plane.segments:_sweep", "plane.segments:_near", "plane.segments:_meeting",
            "plane.segments:_enclosed", "plane.constraints:_vertices_on", "plane.constraints:_lean_left",
            "surface.polylines:_thin",
        ),
        _lining, 4.0, False,
    ),
    Part(
        "closed surfaces",
        ("surface.closed.embedding:_n_flipped", "surface.closed.evaluate:_evaluate"), _closed, 2.7, False,
    ),
    Part(
        "their meshes", ("surface.closed.live:_build_closed", "surface.moves:snapshot"),
        partial(_building, _body), 1.5, False, CLOSED,
    ),
    Part("their thinning", ("search.greedy:thin",), partial(_thinning, _body), 5.3, True, CLOSED),
    Part(
        "their moves", ("search.local_search:anneal", "search.local_search:fit_size"),
        partial(_moves, _body), 2.8, True, CLOSED,
    ),
    Part("their insertion", ("search.greedy:_grow",), partial(_insertion, _body), 1.5, False, CLOSED),
    Part(
        "their free meshes", ("surface.free:anneal_freely", "search.free:_thin"),
        partial(_free, _body), 8.0, False, CLOSED_FREEDOM,
    ),
    Part("folded scans", ("surface.overlap:_mark_hidden", "surface.orient:_seen_sides"), _folds, 3.0, False),
    Part("files", ("formats.source.rows:_scan_bytes", "formats.source.rows:_scan_numbers"), _files, 1.0, False),
)  # fmt: skip

#: What a search with the default algorithm needs: of a height surface, and of a closed one.
SEARCH = ("reading", "evaluation", "building", "thinning", "moves")
CLOSED_SEARCH = ("distances", "closed surfaces", "their meshes", "their thinning", "their moves")
#: What a statement of quality of the chosen mesh needs besides.
STATED = ("scores", "distances")
#: What free meshes need besides.
FREE = ("free meshes",)
CLOSED_FREE = ("their free meshes",)
#: What break lines need besides: their errors are measured as scores are, of a closed surface as its own are.
LINED = ("break lines", "scores")
CLOSED_LINED = ("break lines",)
#: What a search for one mesh needs: its first answer is inserted.
WISH = (*SEARCH, "insertion")
CLOSED_WISH = (*CLOSED_SEARCH, "their insertion")


def missing(names: Iterable[str] | None = None) -> list[Part]:
    """Return those parts, of all, that have functions without machine code on this machine."""
    wanted = {part.name for part in PARTS} if names is None else set(names)
    return [part for part in PARTS if part.name in wanted and not _has_code(part)]


def _has_code(part: Part) -> bool:
    record = None if part.ground is None else _item(part.ground)
    return all(has_code(_item(entry), record) for entry in part.entries)


def _item(named: str) -> Any:
    file, _, name = named.partition(":")
    return getattr(import_module(f"{PACKAGE}.{file}"), name)


class Warming:
    """Compiles what is missing, in two processes if there are cores and a place for two.

    The second process begins when this is entered, so that a model can be read meanwhile; :meth:`finish` does the rest.
    What the second process has compiled is read from disk where it is needed.

    Parameters
    ----------
    names : iterable of str
        Of parts.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.parts = missing(names)
        self._beside: subprocess.Popen[bytes] | None = None

    @property
    def expected(self) -> float:
        """About how long it takes [s]."""
        return max(sum(part.seconds for part in share) for share in self._shares()) if self.parts else 0.0

    def _shares(self) -> list[list[Part]]:
        """Divide the parts among one or two processes: this one's first."""
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        shares = [[part for part in self.parts if part.beside == beside] for beside in (False, True)]
        return [list(self.parts)] if cores < 2 or place().folder is None or not all(shares) else shares

    def __enter__(self) -> Warming:
        _, *others = self._shares()
        if others:
            code = f"from {__name__} import compile_here; compile_here({[part.name for part in others[0]]!r})"
            paths = [str(Path(__file__).parent.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
            with suppress(OSError):  # it is all done in this process then
                self._beside = subprocess.Popen(
                    [sys.executable, "-c", code],
                    env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
        return self

    def finish(self) -> None:
        """Compile the rest, and what the other process could not do: here it fails with a reason, if it must."""
        compile_here(part.name for part in self._shares()[0])
        if self._beside is not None:
            self._beside.wait()
        compile_here(part.name for part in missing(part.name for part in self.parts))

    def __exit__(self, *_: object) -> None:
        if self._beside is not None:
            self._beside.kill()
            self._beside.wait()


def compile_here(names: Iterable[str]) -> None:
    """Call all functions of these parts in this process."""
    wanted = set(names)
    for part in PARTS:
        if part.name in wanted:
            part.work()

"""The page of a simplification: one file in which to move along the front, look at each mesh and take one home.

The page holds the vertices of the original once, and for each solution its triangles and the size of the deviation
at every vertex, in 8 bits. What would make it larger than PAGE_BYTES is thinned, and the page says so: the meshes (all
numbers stay in the chart, an even selection keeps its meshes), and
above DRAWN_VERTICES the picture of the original.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, Rows
from meshsimp_pymoo.errors import ResultError, printable
from meshsimp_pymoo.files import as_argument
from meshsimp_pymoo.formats.table import listed
from meshsimp_pymoo.report.colours import SCALE_QUANTILE, embedded_image, hypsometric, magma
from meshsimp_pymoo.report.document import embedded_array, embedded_faces, html_document, slug
from meshsimp_pymoo.report.downloads import downloads
from meshsimp_pymoo.report.figures import INSIDE, RIM, UNCOVERED, VIEWS, original_mesh, winding
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.wishes import in_words
from meshsimp_pymoo.settings import settings_of
from meshsimp_pymoo.storage import STATEMENT, StoredFront
from meshsimp_pymoo.surface.measures import ERROR, LENGTH, MEASURES, REGIONS, Measure
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.smallest import lines_in_words
from meshsimp_pymoo.surface.surface import mesh_lines
from meshsimp_pymoo.surface.units import in_unit, length_unit, reference_system

if TYPE_CHECKING:
    from meshsimp_pymoo.surface.nested import Chromosomes
    from meshsimp_pymoo.surface.surface import Original, Simplified, Surface

__all__ = ["PAGE_BYTES", "simplification_page"]


SCRIPTS = (
    "vendor/three.min.js", "vendor/d3.min.js", "codec.js", "meshfile.js", "chart.js", "painter.js", "viewer.js",
    "body.js", "windows.js", "simplification.js",
)  # fmt: skip
# Where closed meshes are shown.
OF_BODIES = "body.js"
PAGE_BYTES = 15_000_000
# The libraries, the texts and the numbers of the solutions.
FIXED_BYTES = 730_000
# What one triangle, one deviation and one vertex take, embedded; measured on scans and terrain. Too low an estimate is
# put right afterwards, too high a one leaves out meshes that would have fitted.
TRIANGLE_BYTES, DEVIATION_BYTES, VERTEX_BYTES, UV_BYTES = 4.0, 1.2, 26.0, 9
# A deviation d is embedded as the level 254 sqrt(d / largest), which keeps small ones apart.
LEVELS, UNCOVERED_LEVEL = 254, 255
# Of break lines with more vertices than these together, what thinning left of them is drawn on the original.
DRAWN_LINE_VERTICES = 10_000
# How the meshes can be coloured, as the page calls it; the first ones only where the model has them.
COLOURS = {"texture": "texture", "own": "own colours", "plain": "plain", "height": "heights", "error": "error"}
# A surface that is longer than so many times its breadth is seen in high windows.
BROAD = 1.15
# The slider of the heights reaches from a tenth of the lower of their usual factor and 1 to ten times the higher one.
HEIGHT_DECADES = 1.0
# Parts of a run's record that the page repeats; the seconds are not among them, they are never the same twice.
RECORDED = ("algorithm", "seed", "generations", "evaluations", "moves", "interrupted")
# A setting of more values than these (one weight a vertex) is counted on the page, not listed.
MOST_LISTED = 100


@brief
@dataclass(frozen=True)
class _Embedded:
    """What the page holds of the meshes.

    Attributes
    ----------
    vertices : (V,) int array
        Rows of the model that are in the page, ascending.
    faces : (M, 3) int array
        The triangles of the drawn original, as rows of ``vertices``.
    line_names : tuple of str
        What the break lines are called that chains name by their number.
    original : dict
        The same, embedded.
    solutions : list
        Of each solution its triangles, the deviations at the vertices of the drawn original, ascending, the largest
        of these, and its break lines, chains of rows of ``vertices``, if it has any; None where it is left out.
    scale_end : float
        End of the error's colours [model units].
    drawn : int
        Vertices of the drawn original.
    """

    vertices: IntArray
    faces: IntArray
    line_names: tuple[str, ...]
    original: dict[str, str]
    solutions: list[dict[str, Any] | None]
    scale_end: float
    drawn: int


def simplification_page(
    front: StoredFront,
    surface: Surface,
    kept: BoolArray | Chromosomes,
    *,
    measure: str,
    folder: str | os.PathLike[str] | None,
    knee: int,
    limit: int = PAGE_BYTES,
) -> str:
    """Return the page of a front.

    Parameters
    ----------
    front : StoredFront
        The front as it was written. Its record (``run.json``) says which solution was chosen; the page opens with that
        one, else with the knee. Its ``series`` are drawn faintly behind it.
    surface : Surface
        What the solutions are solutions of; their meshes are made anew from it.
    kept : (S, N) bool array, or Chromosomes
        The solutions, in vector order.
    measure : str
        What was minimised beside the triangles.
    folder : path or None
        The folder of the front, as a shell command shall name it; None: the page is in a notebook, where Python
        writes the meshes.
    knee : int
        The row of the best compromise.
    limit : int
        Size of the page that is not exceeded if it can be helped, by leaving out meshes [bytes].

    Returns
    -------
    str
        The page; the same for the same front and folder.

    Raises
    ------
    ResultError
        If the numbers are not those of the surface's meshes: then it is another model, or has other settings.
    """
    chosen, count = front.run.get("chosen"), len(kept)
    model, view = surface.model, surface.view
    has_border = not view.is_closed or len(surface.border) > 0
    original = original_mesh(surface)
    whole = bool(original[0].all())  # else the largest mesh would take the place of many
    order = _by_importance(count, [row for row in (chosen, knee, 0, count - 1 if whole else None) if row is not None])
    lines = _original_lines(surface)
    uv, texture, word = model.attributes.get("uv"), None, ""
    if uv is not None and model.material is not None and model.material.image:
        texture, word = embedded_image(model.material)
    taken = len(lines["data"]) if lines else 0
    taken += len(texture["image"]) + UV_BYTES * int(original[0].sum()) if texture else 0
    held = _embedded(surface, kept, front, original, order, knee, limit - taken)
    missing = sum(solution is None for solution in held.solutions)
    numbers = dict(front.quality)
    if front.refitted_error is not None:
        numbers["refitted_error"] = front.refitted_error
    # what is not known is null
    columns = {name: [None if np.isnan(one) else one for one in found.tolist()] for name, found in numbers.items()}
    paint = model.attributes["color"][held.vertices] if "color" in model.attributes else None
    ramps = {"error": magma()} if view.is_closed else {"height": hypsometric(), "error": magma()}
    colours = [name for name, is_there in {"texture": texture, "own": paint is not None}.items() if is_there]
    own, colours = colours[0] if colours else "plain", [*colours, "plain", *ramps]
    points = model.file_points[held.vertices].astype(np.float64)
    names, is_textured = held.line_names, texture is not None
    files = downloads(surface, points, held.faces, names, front.folder, is_textured=is_textured)
    unit, system = length_unit(model.georeference), reference_system(model.georeference)
    first_error = _same_order(measure)[-1]
    source = printable(front.run["model"]["name"])  # as it was called when the front was made
    data = {
        "stem": slug(PurePath(source).stem),
        "folder": None if folder is None else printable(as_argument(folder)),
        "closed": _closed_look(surface) if view.is_closed else None,
        "unit": in_unit(unit),  # behind a number
        "measures": [
            {"name": name, **spoken(measure, unit, closed=view.is_closed)}
            for name, measure in MEASURES.items()
            if name in columns and (has_border or not measure.of_borders)
        ],
        "columns": columns,
        "meshes": _mesh_files(front, chosen),
        "refitted_meshes": front.refitted_meshes,
        "knee": knee,
        "chosen": chosen,
        "searched": _same_order(measure),
        "series": [
            {"name": name, "x": F[:, 1].tolist(), "y": _known_errors(F[:, 0], measure, surface.total_weight)}
            for name, F in front.series.items()
        ],
        "model": {
            "vertices": model.n_vertices,
            "triangles": len(model.faces),
            "diagonal": surface.diagonal,
            "relief": float(view.extent[2] / view.extent[:2].max()),
            "pivot": view.pivot.tolist(),
            "rotation": view.rotation.tolist(),
            "scale": view.scale.tolist(),
        },
        "points": embedded_array(points),
        "files": files.templates,
        "paint": None if paint is None else embedded_array(paint) | {"channels": paint.shape[1]},
        "faces": held.original,
        "lines": lines,
        "solutions": held.solutions,
        "texture": texture
        and texture | {"uv": embedded_array(np.asarray(uv)[held.vertices].astype(np.float32).astype(float))},
        "colours": ramps,
        "uncovered_colour": [int(UNCOVERED[k : k + 2], 16) for k in (1, 3, 5)],
        "scale_end": held.scale_end,
        "scale_quantile": SCALE_QUANTILE,
    }
    return html_document(
        "simplification.html",
        [name for name in SCRIPTS if name != OF_BODIES or view.is_closed],
        data,
        title=f"{PurePath(source).name}, simplified",
        model={"vertices": model.n_vertices, "triangles": len(model.faces)},
        solutions=count,
        unit=unit if unit != LENGTH else "the units of the file",
        system=printable(system),
        thinned=[
            *_what_was_searched(front.run, unit),
            *_what_is_thinned(model, held, missing),
            *([word] if word else []),
        ],
        heights=None if view.is_closed else _heights(view.exaggeration),
        colours={name: COLOURS[name] for name in colours},
        own_colours=own,
        known_unit=unit != LENGTH,
        broad=not view.is_closed and _is_broad(view.extent),
        examples={
            "triangles": columns["triangles"][count // 2 if chosen is None else chosen],
            "error": f"{columns[first_error][count // 2 if chosen is None else chosen]:.3g}",
        },
        painted=paint is not None,
        is_stored=folder is not None,
        files=files.titles,
        refused="" if view.is_closed else printable(" ".join(files.refused)),
        covering=has_border,
        holes=view.is_closed and has_border,
        lines=lines_in_words(front.run["model"]["lines"], unit) if lines else "",
        further=printable(listed(further)) if (further := sorted(set(model.attributes) - {"color"})) else "",
        errors={name: label for name, label in _errors().items() if any(v is not None for v in columns.get(name, ()))},
        first_error=first_error,
        unit_sign="" if unit == LENGTH else unit,
        libraries="three.js (MIT licence) and parts of D3 (ISC licence)",
        settings=_settings(front.run),
        quality=STATEMENT[1] if folder is not None and (front.folder / STATEMENT[1]).is_file() else "",
    )


def _closed_look(surface: Surface) -> dict[str, Any]:
    """Return how a body is looked at: from where it is in the pictures, as azimuth and elevation [degrees].

    And where it has holes, the colours of its inside and of their rims, and how its faces are wound.
    """
    elevation, turn = VIEWS["front"]
    found: dict[str, Any] = {"front": [-turn, elevation], "open": None}
    if len(surface.border):
        colours = {"inside": f"rgb({', '.join(f'{round(255 * value)}' for value in INSIDE)})", "rim": RIM}
        found["open"] = colours | {"winding": winding(np.asarray(surface.points), np.asarray(surface.faces))}
    return found


def _heights(exaggeration: float) -> dict[str, str]:
    """Return the ends of the slider of the heights and where it stands: logarithms of the factor."""
    usual = math.log10(exaggeration)
    least, most = min(0.0, usual) - HEIGHT_DECADES, max(0.0, usual) + HEIGHT_DECADES
    return {name: f"{round(value, 2):g}" for name, value in {"least": least, "most": most, "usual": usual}.items()}


def _is_broad(extent: FloatArray) -> bool:
    """Return whether a surface is seen broader than high: then its windows are no higher than broad.

    >>> _is_broad(np.array([30.0, 20.0, 1.0])), _is_broad(np.array([20.0, 30.0, 1.0]))
    (True, False)
    """
    return bool(extent[1] <= BROAD * extent[0])


def _errors() -> dict[str, str]:
    """Return the columns of errors with what they are called: what a mesh is usually chosen by first, the sum last."""
    errors = [name for name, measure in MEASURES.items() if measure.is_error]
    errors.sort(key=lambda name: (not MEASURES[name].wish, name == "error"))
    labels = {name: MEASURES[name].label for name in errors}
    return labels | {"refitted_error": "refitted error (sum)", "error": f"{labels['error']} (sum)"}


def _same_order(measure: str) -> list[str]:
    """Return the measures by which meshes stand in the order of an objective: itself, and its mean if it is the sum."""
    return [measure] + [
        name for name, other in MEASURES.items() if other.is_error and other.searched == measure != name
    ]


def _known_errors(objective: FloatArray, measure: str, total_weight: float) -> dict[str, list[float]]:
    """Return what is known of the errors of meshes by their objective alone, by measure."""
    if measure != "error":
        return {measure: objective.tolist()}
    table = np.zeros((len(objective), REGIONS))
    table[:, ERROR] = objective
    of: dict[str, Any] = {name: MEASURES[name].of for name in _same_order(measure)}
    return {name: of[name](table, total_weight).tolist() for name in of}


def spoken(measure: Measure, unit: str = LENGTH, *, closed: bool = False) -> dict[str, str]:
    """Return what the page says of a measure, where lengths have this unit."""
    meaning = (closed and measure.of_closed) or measure.meaning
    return {"label": measure.label, "meaning": meaning, "unit": unit if measure.is_error else measure.unit}


def _embedded(
    surface: Surface,
    kept: BoolArray | Chromosomes,
    front: StoredFront,
    drawn_mesh: tuple[BoolArray, IntArray],
    order: Sequence[int],
    knee: int,
    limit: int,
) -> _Embedded:
    """Make the meshes that fit into the page beside the drawn original, the most important ones first."""
    drawn, original = drawn_mesh
    measured = np.unique(original)  # the others carry no colour
    n_drawn = len(measured)
    room = limit - FIXED_BYTES - TRIANGLE_BYTES * len(original) - VERTEX_BYTES * n_drawn
    rows = []
    used = drawn.copy()
    for row in order:
        cost = TRIANGLE_BYTES * front.quality["triangles"][row] + DEVIATION_BYTES * n_drawn
        if cost > room:
            continue
        more = kept[row] & ~used
        cost += VERTEX_BYTES * more.sum()
        if cost <= room:
            room -= cost
            rows.append(row)
            used |= more
    found = {row: _checked(surface, kept, front, row, measured) for row in rows}
    used = drawn.copy()
    for mesh in found.values():
        used[mesh.faces.ravel()] = True
    vertices = np.flatnonzero(used)
    solutions: list[dict[str, Any] | None] = [None] * len(kept)
    sizes: dict[int, int] = {}
    known: Any = getattr(surface.model, "lines", None)  # which a surface of another kind need not have
    line_names = () if known is None else tuple(dict.fromkeys(known.names))
    for row, mesh in found.items():
        largest = float(mesh.deviation.max())
        levels = np.rint(LEVELS * np.sqrt(mesh.deviation / (largest or 1.0))).astype(np.uint8)
        levels[~mesh.covered] = UNCOVERED_LEVEL
        triangles, deviation = embedded_faces(np.searchsorted(vertices, mesh.faces)), embedded_array(levels)
        held: dict[str, Any] = {"faces": triangles, "deviation": deviation, "largest": largest}
        sizes[row] = len(triangles["data"]) + len(deviation["data"])
        chains, names = mesh_lines(surface, mesh.faces)
        if chains:
            held["lines"] = _embedded_lines([np.searchsorted(vertices, chain) for chain in chains], names, line_names)
            sizes[row] += sum(len(part["data"]) for part in held["lines"].values())
        solutions[row] = held
    original = np.searchsorted(vertices, original)
    faces = embedded_faces(original)
    room = limit - FIXED_BYTES - len(faces["data"]) - VERTEX_BYTES * len(vertices)
    while sizes and sum(sizes.values()) > room:
        dropped = next(row for row in reversed(rows) if row in sizes)
        solutions[dropped] = None
        del sizes[dropped]
    at_knee = found[knee] if knee in found else _checked(surface, kept, front, knee, measured)
    end = float(np.quantile(at_knee.deviation, SCALE_QUANTILE)) or float(front.quality["max_error"].max()) or 1.0
    return _Embedded(vertices, original, line_names, faces, solutions, end, n_drawn)


def _embedded_lines(chains: Sequence[IntArray], names: Sequence[str], known: Sequence[str]) -> dict[str, Any]:
    """Return break lines as the browser unpacks them: the vertices of all, how many each has, their names."""
    place = {name: k for k, name in enumerate(known)}
    columns = {
        "rows": np.concatenate(chains),
        "sizes": [len(chain) for chain in chains],
        "names": [place[name] for name in names],
    }
    return {name: embedded_array(np.asarray(values, np.uint32)) for name, values in columns.items()}


def _original_lines(surface: Surface) -> dict[str, str] | None:
    """Return the break lines as they were given, as pairs of ends in the frame that the page draws in."""
    model: Any = surface.model
    lines = getattr(model, "lines", None)  # which a surface of another kind need not have
    if lines is None:
        return None
    parts = lines.originals
    if sum(map(len, parts)) > DRAWN_LINE_VERTICES:
        parts = [model.points[chain] for chain in lines.chains]
    pairs = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in parts])
    return embedded_array(pairs + model.offset)


def _checked(
    surface: Surface, kept: BoolArray | Chromosomes, front: StoredFront, row: int, measured: IntArray
) -> Simplified:
    """Return the mesh of a solution, its deviation at some vertices, if it has the numbers that are said of it."""
    own = front.faces[row]
    if own is None:
        mesh = surface.simplify(kept[row] | surface.pinned, rows=measured)
    else:
        mesh = surface.of_faces(own, rows=measured)
    triangles, error, found = front.quality["triangles"][row], front.quality["error"][row], mesh.quality
    if found.triangles != triangles or not np.isclose(found.error, error, rtol=1e-6, atol=1e-12 * surface.diagonal):
        raise ResultError(
            f"{front.folder}: solution {row} is said to have {triangles} triangles and the error {error:.9g}, but its "
            f"mesh on {surface.model.name} has {found.triangles} and {found.error:.9g}; the front is one of another "
            "model, or was made with other settings"
        )
    return mesh


def _by_importance(count: int, first: Sequence[int]) -> list[int]:
    """Return all rows, those given first, then so that every beginning of the list is spread evenly over all.

    >>> _by_importance(6, [4, 0])
    [4, 0, 2, 1, 3, 5]
    """
    order = dict.fromkeys(first)
    pieces = 2
    while len(order) < count:
        order |= dict.fromkeys(round(k * (count - 1) / pieces) for k in range(1, pieces, 2))
        pieces *= 2
        if pieces > 2 * count:
            order |= dict.fromkeys(range(count))
    return list(order)


def _mesh_files(front: StoredFront, chosen: int | None) -> list[str]:
    """Return the file of each mesh, relative to the folder; the chosen one may have no other than ``chosen.ply``."""
    files = list(front.meshes)
    if chosen is not None and not files[chosen]:
        files[chosen] = next((path.name for path in sorted(front.folder.glob("chosen.*"))), "")
    return files


def _what_was_searched(run: Mapping[str, Any], unit: str) -> Iterator[str]:
    if run.get("wish"):
        yield (
            f"What was searched is the mesh with {in_words(run['wish'], unit)}. The others came along: a search for "
            "the whole front would find better ones far from it."
        )


def _what_is_thinned(model: Original, held: _Embedded, missing: int) -> Iterator[str]:
    if missing:
        yield (
            f"To keep this page small, {len(held.solutions) - missing} of {len(held.solutions)} meshes are in it, an "
            "even selection; the others are hollow points in the chart, with all their numbers."
        )
    # vertices that break lines added are in no face of the original; a grid read by windows has none, and is not held
    faces: Any = model.faces
    n_seen = model.n_vertices if isinstance(faces, Rows) else len(np.unique(faces))
    if held.drawn < n_seen:
        yield (
            f"The original has {n_seen:,} vertices; it is drawn here from an even selection of "
            f"{held.drawn:,} of them. All numbers, and the meshes to download, are those of the full model."
        )


def _settings(run: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what is known of how the front was made, as rows of a table."""
    rows = [("model", run["model"]["name"]), ("hash of the model", run["model"]["hash"])]
    rows += [(key, str(run[key])) for key in RECORDED if run.get(key) is not None]
    derived = [name for name, known in settings_of(Rules).items() if known.derived]
    said = [part for name in ("options", "rules", "settings") for part in (run.get(name) or {}).items()]
    said = [(key, value) for key, value in said if key not in (*run, *derived, "threads")]  # which change no result
    for key, value in [*said, ("objectives", run.get("objectives"))]:
        if value not in (None, False):
            rows.append((key.replace("_", " "), _in_words(value)))
    version = (run.get("versions") or {}).get("meshsimp-pymoo")
    return rows + ([("meshsimp-pymoo", version)] if version else [])


def _in_words(value: Any) -> str:
    if not isinstance(value, list):
        return str(value)
    return ", ".join(map(str, value)) if len(value) <= MOST_LISTED else f"{len(value)} values"

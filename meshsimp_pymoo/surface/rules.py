"""What counts: the frozen settings of a surface that decide numbers, in one record."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from meshsimp_pymoo.errors import InputError, meant
from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.settings import Choice, Lines, Pins, Real, Weights, documented, setting, settle
from meshsimp_pymoo.surface.measures import OBJECTIVES

FOOTPRINTS = ("model", "hull")
OUTSIDES = ("nearest", "ignore")
PINS = ("corners", "hull", "border")
# What height surfaces alone know, and what holds there where nothing is said.
OF_HEIGHTS = {"footprint": "model", "outside": "nearest"}
# What names break lines that are found in the original: its outline, or (with an angle behind it) its sharp edges.
OUTLINE, SHARP = "outline", "sharp:"
# Least height of the triangles that free meshes come to have, as a share of their longest edge, where nothing is said;
# and the most that can be asked for: no triangle of a square cut in two is higher.
USUAL_RATIO, MOST_RATIO = 0.1, 0.5


@documented
@dataclass(frozen=True)
class Rules:
    """What counts. Made once, passed whole, stored whole; the fields are arguments of ``MeshProblem``, options of the
    shell and keys of YAML files (``measure`` is the first of the ``objectives`` there).

    Parameters
    ----------
    SETTINGS

    Raises
    ------
    InputError
        If a value is none that the setting takes.
    """  # noqa: D205

    footprint: str | None = setting(
        None,
        kind=Choice(FOOTPRINTS),
        accepts='{"model", "hull"}, optional',
        doc="Of a height surface: emit only the triangles whose centroid lies inside the original mesh's projection, "
        "as by default, or all of them (the paper).",
        help="of height surfaces: model (default): bays and holes stay open; hull: all of the convex hull is covered",
    )
    outside: str | None = setting(
        None,
        kind=Choice(OUTSIDES),
        accepts='{"nearest", "ignore"}, optional',
        doc="Of a height surface: what a vertex costs that no triangle covers: its distance to the nearest point of "
        "the mesh, as by default, or nothing (the paper).",
        help="of height surfaces: what a vertex that no triangle covers costs: its distance to the mesh (default), or "
        "nothing",
    )
    pin: Any = setting(
        None,
        kind=Pins(PINS),
        accepts='"corners", "hull", "border", file rows, positions, or a list of these',
        doc="Vertices that every mesh keeps, besides the four corners, or of each part of a closed surface the three "
        "of one face: whole numbers for rows of the file, or an array of positions (K, 3) in the file's frame; of a "
        'height surface ``"hull"`` for all on the convex hull, ``"border"`` for all on the outline and around the '
        "holes, so that tiles still fit together, or positions (K, 2) in the upright plane, too.",
        help="vertices that every mesh keeps beside the corners: rows of the file, from 0, or of height surfaces the "
        "convex hull, or the outline and the holes' rims",
        metavar="hull|border|I,J,...",
    )
    weights: Any = setting(
        None,
        kind=Weights(),
        accepts="str or array, optional",
        doc='How much each vertex counts in the error: ``"area"`` for the area around it, one number for each row of '
        "the file, or the name of one of its per-vertex attributes; see "
        ":meth:`~meshsimp_pymoo.surface.model.OpenModel.with_weights`. 1 by default.",
        help="how much each vertex counts in the error: the area around it, or what a per-vertex attribute of the file "
        "says (default: all alike)",
        metavar="area|NAME",
    )
    break_lines: Any = setting(
        None,
        kind=Lines(),
        accepts='path, "sharp:DEGREES", "outline", or a list of (n, 2) or (n, 3) arrays, optional',
        doc="Polylines that are chains of edges of every mesh, in the frame of the model's file: a file of them, or "
        "arrays. Those with heights (x, y, z) bring their own, those without (x, y) take the surface's; of a closed "
        "surface all have x, y and z. "
        '``"sharp:30"`` takes the edges where two faces of the original meet at more than 30 degrees, ``"outline"`` '
        "its outline and the rims of its holes.",
        help="polylines that are chains of edges of every mesh: a file of them, or the edges where faces meet at more "
        "than so many degrees, or the outline and the rims of holes",
        metavar="FILE|sharp:DEGREES|outline",
    )
    line_tolerance: float | None = setting(
        None,
        kind=Real(0),
        accepts="float, optional",
        doc="How far a vertex of a break line may be from the line that is left of it, in space [model units]: each "
        'line is thinned once, by Douglas-Peucker. Needed with a file or arrays; for ``"sharp:"`` and ``"outline"`` '
        "1e-3 of the diagonal where nothing is said.",
        help="how far break lines may move, in space [model units]: each is thinned once by that much; needed with a "
        "file (default for sharp: and outline: 1e-3 of the diagonal)",
        metavar="L",
    )
    measure: str = setting(
        "error",
        kind=Choice(tuple(OBJECTIVES)),
        accepts=f"{{{', '.join(OBJECTIVES)}}}",
        doc="What thinning, insertion and moves of vertices lower.",
        help="error that is made small beside the triangles",
        derived=True,
    )

    def __post_init__(self) -> None:
        settle(self)
        if self.break_lines is None and self.line_tolerance is not None:
            raise InputError(
                f"line_tolerance={self.line_tolerance:g} (--line-tolerance {self.line_tolerance:g}) is for break "
                "lines, and there are none; name them by break_lines=FILE (--break-lines FILE)"
            )
        if self.break_lines is not None and self.line_tolerance is None and not is_word_for_lines(self.break_lines):
            near = meant_word_for_lines(self.break_lines)
            raise InputError(
                f"break lines{f' of a file named {self.break_lines!r}' if near else ''}{near} need line_tolerance=L "
                "(--line-tolerance L): how far they may move in space [model units], such as the accuracy that they "
                "were surveyed with; 0 keeps every vertex that is not between two others on a straight line"
            )

    __repr__ = as_made

    @property
    def in_words(self) -> str:
        """What people are told beside a model: what of it differs from the usual, and where the error counts."""
        said = [f"{name} {value}" for name in OF_HEIGHTS if (value := getattr(self, name)) is not None]
        if self.pin is not None:
            said.append(f"pinned {self.pin}" if isinstance(self.pin, str) else "some vertices pinned")
        if self.weights is not None:
            said.append(f"weighted by {self.weights}" if isinstance(self.weights, str) else "weighted")
        if self.break_lines is not None:
            named = f" of {self.break_lines}" if isinstance(self.break_lines, str) else ""
            within = "" if self.line_tolerance is None else f" within {self.line_tolerance:g}"
            said.append(f"break lines{named}{within}")
        return ", ".join(said)

    @property
    def spares_uncovered(self) -> bool:
        """Whether a vertex that no triangle covers costs nothing; of a closed surface it costs its distance."""
        return self.outside == "ignore"

    @property
    def of_heights(self) -> Rules:
        """These rules for a height surface: what is not said is what is usual there."""
        unsaid: dict[str, Any] = {name: usual for name, usual in OF_HEIGHTS.items() if getattr(self, name) is None}
        return replace(self, **unsaid)

    @property
    def of_the_model(self) -> Rules:
        """What is left of these rules for a model that holds their weights and break lines already."""
        return replace(self, weights=None, break_lines=None, line_tolerance=None)


def is_word_for_lines(text: Any) -> bool:
    """Tell whether break lines are named by a word, which finds them in the original, and not by a file."""
    return isinstance(text, str) and (text == OUTLINE or text.startswith(SHARP))


def is_file_of_lines(given: Any) -> bool:
    """Tell whether break lines are those of a file."""
    return isinstance(given, str) and not is_word_for_lines(given)


def meant_word_for_lines(text: Any) -> str:
    """Return a question for behind a name that is no file's; empty if no word for break lines is near.

    >>> meant_word_for_lines("outlin"), meant_word_for_lines("sharp30"), meant_word_for_lines("outlines.geojson")
    (" (did you mean 'outline'?)", " (did you mean 'sharp:30'?)", '')
    """
    is_bare = isinstance(text, str) and not set(text) & set("./\\")
    return meant(text, (OUTLINE, f"{SHARP}30")) if is_bare else ""


DEFAULT = Rules()

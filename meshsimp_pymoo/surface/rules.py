"""What counts: the frozen settings of a surface that decide numbers, in one record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.settings import Choice, Pins, Weights, documented, setting, settle
from meshsimp_pymoo.surface.measures import OBJECTIVES

FOOTPRINTS = ("model", "hull")
OUTSIDES = ("nearest", "ignore")
PINS = ("corners", "hull", "border")
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

    footprint: str = setting(
        "model",
        kind=Choice(FOOTPRINTS),
        accepts='{"model", "hull"}',
        doc="Emit only the triangles whose centroid lies inside the original mesh's projection, or all of them (the "
        "paper).",
        help="model: bays and holes stay open; hull: all of the convex hull is covered",
    )
    outside: str = setting(
        "nearest",
        kind=Choice(OUTSIDES),
        accepts='{"nearest", "ignore"}',
        doc="What a vertex costs that no triangle covers: its distance to the nearest point of the mesh, or nothing "
        "(the paper).",
        help="what a vertex that no triangle covers costs: its distance to the mesh, or nothing",
    )
    pin: Any = setting(
        None,
        kind=Pins(PINS),
        accepts='"corners", "hull", "border", file rows, positions, or a list of these',
        doc='Vertices that every mesh keeps, besides the four corners: ``"hull"`` for all on the convex hull, '
        '``"border"`` for all on the outline and around the holes, so that tiles still fit together, whole '
        "numbers for rows of the file, or an array of positions (K, 2) in the upright plane or (K, 3) in the file's "
        "frame.",
        help="vertices that every mesh keeps beside the corners: the convex hull, the outline and the holes' rims, or "
        "rows of the file, from 0",
        metavar="hull|border|I,J,...",
    )
    weights: Any = setting(
        None,
        kind=Weights(),
        accepts="str or array, optional",
        doc="How much each vertex counts in the error: one number for each row of the file, or the name of one of its "
        "per-vertex attributes; see :meth:`~meshsimp_pymoo.surface.model.OpenModel.with_weights`. 1 by default.",
        help="per-vertex attribute of the file that says how much each vertex counts in the error (default: all alike)",
        metavar="NAME",
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

    __repr__ = as_made

    @property
    def in_words(self) -> str:
        """What people are told beside a model: what of it differs from the usual, and where the error counts."""
        said = [f"footprint {self.footprint}", f"outside {self.outside}"]
        if self.pin is not None:
            said.append(f"pinned {self.pin}" if isinstance(self.pin, str) else "some vertices pinned")
        if self.weights is not None:
            said.append(f"weighted by {self.weights}" if isinstance(self.weights, str) else "weighted")
        return ", ".join(said)


DEFAULT = Rules()

"""The statement of quality of one mesh: its numbers with what they are of, as a file of data, a page and a raster.

::

    FOLDER/quality.json   all numbers, with units, definitions and what was measured against what; see `as_data`
    FOLDER/quality.html   the same as a page to read, to print and to sign
    FOLDER/residuals.tif  original minus mesh at every sample, where the original is a raster
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from importlib.metadata import version
from pathlib import Path, PurePath
from typing import Any

from meshsimp_pymoo.errors import ModelError, NoHeightGrid, printable, warn_of
from meshsimp_pymoo.files import new_folder
from meshsimp_pymoo.formats.outmesh import metres_of
from meshsimp_pymoo.report.colours import SCALE_QUANTILE
from meshsimp_pymoo.report.document import html_document
from meshsimp_pymoo.report.residuals import write_residuals
from meshsimp_pymoo.storage import STATEMENT, claim_output
from meshsimp_pymoo.surface.accuracy import (
    MOST_FACES,
    NORMAL_90,
    NORMAL_95,
    NORMAL_MAD,
    Accuracy,
    Compared,
    accuracy_of,
)
from meshsimp_pymoo.surface.measures import LENGTH
from meshsimp_pymoo.surface.units import in_unit, system_name

__all__ = ["DATA", "PAGE", "RESIDUALS", "QualityStatement", "stated"]

(DATA, PAGE), RESIDUALS = STATEMENT, "residuals.tif"
# Of the keys of quality.json: it rises where one changes its meaning or goes, not where one comes.
SCHEMA = 1
NOT_INDEPENDENT = "check points are the samples the mesh was made from, not independent ground truth"
# What check points do that no triangle covers, by what is outside; of closed surfaces the rules do not say it.
COSTS = {"nearest": "count with their distance to the mesh", "ignore": "count as 0"}
COSTS[""] = COSTS["nearest"]
# Where the numbers of the table come from, by name.
SOURCES = {
    "le90": "percentile of the absolute residuals, as counted, whatever their distribution",
    "le95": "percentile of the absolute residuals, as counted: VVA of ASPRS, Positional Accuracy Standards for Digital "
    "Geospatial Data, edition 1, 2014",
    "le90_normal": f"{NORMAL_90:.4f} x RMSE, which bounds 90 % of normal errors without bias: NMAS by "
    "FGDC-STD-007.3-1998 (NSSDA)",
    "le95_normal": f"{NORMAL_95:.4f} x RMSE, which bounds 95 % of normal errors without bias: FGDC-STD-007.3-1998 "
    "(NSSDA); NVA of ASPRS 2014",
    "nmad": f"{NORMAL_MAD} x median absolute deviation from the median: Höhle and Höhle, ISPRS J. 64, 2009",
}


@dataclass(frozen=True)
class QualityStatement(Accuracy):
    """The accuracy of one mesh, and what :meth:`save` needs to state it.

    Its numbers are those of :class:`~meshsimp_pymoo.surface.accuracy.Accuracy`.

    Attributes
    ----------
    compared : Compared
        The mesh beside its original.
    mesh : dict
        What the mesh is, as far as is known: "name", "solution", "free", "refitted".
    left_out : tuple of str
        What was not measured, and how to have it.
    """

    compared: Compared = field(repr=False, compare=False)
    mesh: dict[str, Any] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    @property
    def numbers(self) -> Accuracy:
        """The numbers alone."""
        return Accuracy(**{item.name: getattr(self, item.name) for item in fields(Accuracy)})

    @property
    def original(self) -> dict[str, Any]:
        """What the mesh was measured against."""
        model = self.compared.surface.model
        facts = model.georeference
        return {
            "name": PurePath(model.name).name,
            "sha256": model.hash,
            "vertices": self.original_vertices,
            "triangles": self.original_triangles,
            "unit": None if self.unit == LENGTH else self.unit,
            "metres_per_unit": metres_of(self.unit),
            "system": self.system or None,
            **{name: facts.get(name) for name in ("epsg", "crs", "scale")},
            "box": model.file_box.tolist(),
        }

    @property
    def sentence(self) -> str:
        """What a surveyor signs."""
        count, source = f"{self.check_points:,}", printable(self.original["name"])
        what = "distance from the original surface" if self.closed else "vertical accuracy"
        said = f"Tested {self.le90:.4g} {self.unit} {what} at 90 % (LE90, as counted)"
        said += f" against {count} samples of {source}"
        if self.uncovered:
            said += f"; {self.uncovered:,} of them, which no triangle covers, {COSTS[self.outside]}"
        return f"{said}."

    @property
    def in_words(self) -> str:
        """The other numbers that people ask for first, in one line."""
        known = {
            "RMSE": self.rms_error,
            "mean absolute": self.mean_error,
            "bias": self.bias,
            "LE95": self.le95,
            "max": self.max_error,
            "Hausdorff": self.space.hausdorff if self.space else math.nan,
        }
        said = [f"{name} {spelled(value, self.unit)}" for name, value in known.items() if not math.isnan(value)]
        if not math.isnan(self.coverage):
            said.append(f"coverage {in_per_cent(self.coverage)}")
        return ", ".join([*said, f"{self.triangles:,} triangles ({in_per_cent(abs(self.reduction))} {_fewer(self)})"])

    def as_data(self) -> dict[str, Any]:
        """Return the content of quality.json: plain data, lengths in ``original.unit``."""
        return {
            "schema": SCHEMA,
            "made_by": f"meshsimp_pymoo {version('meshsimp-pymoo')}",
            "statement": self.sentence,
            "remark": NOT_INDEPENDENT,
            "original": self.original,
            "mesh": self.mesh,
            "accuracy": self.numbers.plain,
            "sources": SOURCES,
            "left_out": list(self.left_out),
        }

    def write_data(self, path: Path) -> None:
        """Write quality.json."""
        text = json.dumps(self.as_data(), indent=2, allow_nan=False, ensure_ascii=False)
        path.write_text(text + "\n", encoding="utf-8")

    def write_page(self, path: Path) -> None:
        """Write quality.html; the same for the same mesh."""
        path.write_bytes(_page(self).encode("utf-8"))

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False, residuals: bool = True) -> Path:
        """Write quality.json, quality.html and, of a raster, residuals.tif to a new folder, all or nothing.

        Parameters
        ----------
        folder : path
            The folder to make.
        overwrite : bool
            Replace a folder that holds nothing but such files.
        residuals : bool
            Whether a raster of the residuals is written where there can be one.

        Raises
        ------
        ResultError
            If the folder exists, or cannot be written.

        Warns
        -----
        ModelWarning
            If rasterio is not installed, or the rows and columns of a raster are not even: then there is no
            residuals.tif.
        """
        folder = Path(folder)
        claim_folder(folder, overwrite=overwrite)
        with new_folder(folder, replace=overwrite) as partial:
            self.write_data(partial / DATA)
            self.write_page(partial / PAGE)
            if residuals and self.compared.signed:
                self._write_residuals(partial / RESIDUALS)
        return folder

    def _write_residuals(self, path: Path) -> None:
        try:
            write_residuals(path, self.compared)
        except NoHeightGrid:  # nobody would expect one
            return
        except ModelError as trouble:
            reason = str(trouble).removeprefix(f"{path}: ")
            warn_of(f"{RESIDUALS} is left out: {reason}")


# ------------------------------------------------------------------------------------------------------------- the page

Rows = list[tuple[str, str, str]]


def _page(stated: QualityStatement) -> str:
    """Return the page of a statement."""
    from meshsimp_pymoo.report.statement_figures import pictures

    unit, mesh = stated.unit, printable(str(stated.mesh.get("name", "mesh")))
    numbers = stated.numbers
    scale_end = f"The colours end where {in_per_cent(SCALE_QUANTILE)} of the residuals are below."
    if stated.closed:
        map_said = f"Distances of the original's vertices from the mesh [{unit}]. {scale_end}"
    else:
        sides = "red where the original is above the mesh, blue where it is below, grey where there is no sample"
        map_said = f"Residuals at the samples [{unit}]: {sides}. {scale_end}"
    return html_document(
        "quality.html",
        (),
        stated.as_data(),
        title=f"Statement of quality: {PurePath(mesh).name}",
        libraries="",
        sentence=stated.sentence,
        remark=NOT_INDEPENDENT,
        left_out=stated.left_out,
        closed=stated.closed,
        unit=unit,
        subjects=_subjects(stated, mesh),
        accuracy=_accuracy_rows(stated),
        shape=_shape_rows(stated),
        method=_method(stated),
        pictures=pictures(stated.compared, numbers),
        map_said=map_said,
        spread_said=f"Histogram of the residuals [{unit}], {sum(numbers.histogram.counts):,} check points.",
        angles_said=f"Histogram of the least angles of {stated.triangles:,} triangles, in degrees.",
    )


def _subjects(stated: QualityStatement, mesh: str) -> list[tuple[str, str]]:
    original = stated.original
    kinds = [name for name in ("free", "refitted") if stated.mesh.get(name)]
    low, high = original["box"]
    box = "; ".join(f"{axis} {a:.10g} to {b:.10g}" for axis, a, b in zip("xyz", low, high, strict=True))
    return [
        (
            "Mesh",
            f"{mesh}{''.join(f', {kind}' for kind in kinds)}: {stated.triangles:,} triangles, {stated.vertices:,} "
            f"vertices, {in_per_cent(abs(stated.reduction))} {_fewer(stated)} triangles than the original",
        ),
        (
            "Original",
            f"{printable(original['name'])}: {stated.original_vertices:,} vertices, "
            f"{stated.original_triangles:,} triangles",
        ),
        ("SHA-256 of the original", original["sha256"]),
        ("Reference system", _system(stated)),
        ("Unit of lengths", _unit_in_words(original)),
        ("Extent in the file", box),
        ("Made by", f"meshsimp_pymoo {version('meshsimp-pymoo')}"),
    ]


def _fewer(stated: Accuracy) -> str:
    return "fewer" if stated.reduction >= 0.0 else "more"


def _system(stated: QualityStatement) -> str:
    name = printable(system_name(stated.compared.surface.model.georeference))
    said = [printable(stated.system), *([name] if name not in stated.system else [])]
    return "; ".join(filter(None, said)) or "not stated by the file"


def _unit_in_words(original: Mapping[str, Any]) -> str:
    if original["unit"] is None:
        return "not stated by the file: model units"
    metres = original["metres_per_unit"]
    return str(original["unit"]) + (f" (1 = {metres:.10g} m)" if metres not in (None, 1.0) else "")


def _accuracy_rows(stated: QualityStatement) -> Rows:
    """Return the rows of the table of lengths: label, number, meaning."""

    def length(value: float) -> str:
        return spelled(value, stated.unit)

    points = f"{stated.check_points:,}"
    left_out = f"; {stated.weightless:,} of weight 0 are left out" if stated.weightless else ""
    weighed = "counted by their weights" if stated.weighted else "all count alike"
    rows: Rows = [("Check points", points, f"vertices of the original, {weighed}{left_out}")]
    if not stated.closed:
        rows.append(("Not covered", f"{stated.uncovered:,}", f"they {COSTS[stated.outside]}" * bool(stated.uncovered)))
    if not math.isnan(stated.coverage):
        rows.append(("Coverage", in_per_cent(stated.coverage), "of the original's area in the plane"))
    rows += [
        ("LE90, as counted", length(stated.le90), "90 % of the check points are no farther off"),
        ("LE95, as counted", length(stated.le95), "95 % are no farther off (VVA of ASPRS 2014)"),
        ("LE90 by RMSE", length(stated.le90_normal), f"{NORMAL_90:.4f} RMSE: normal errors without bias (NMAS)"),
        ("LE95 by RMSE", length(stated.le95_normal), f"{NORMAL_95:.4f} RMSE: the same (NSSDA, FGDC-STD-007.3-1998)"),
        ("RMSE", length(stated.rms_error), "root mean square"),
        ("Mean absolute error", length(stated.mean_error), ""),
    ]
    if not math.isnan(stated.bias):
        rows += [
            ("Bias", length(stated.bias), "mean of original minus mesh, where it is covered"),
            ("Standard deviation", length(stated.standard_deviation), "about the bias"),
            ("Median, NMAD", f"{length(stated.median)}, {length(stated.nmad)}", "of original minus mesh; robust"),
        ]
    place = ", ".join(f"{value:.10g}" for value in stated.max_at)
    rows.append(("Maximum", length(stated.max_error), f"at {place} (x, y, z of the file)"))
    between = "mean at the middles of the original's faces"
    rows.append(("Between the samples", length(stated.surface_error), between))
    if stated.space is not None:
        to, back = stated.space.to_mesh, stated.space.to_original
        both = f"{length(to.maximum)} to the mesh, {length(back.maximum)} back"
        rows.append(("Hausdorff distance", length(stated.space.hausdorff), f"in space: {both}"))
        both = f"{length(to.mean)} to the mesh, {length(back.mean)} back"
        rows.append(("Mean distance", length(stated.space.mean), f"in space: {both}"))
    if not math.isnan(stated.line_max_error):
        rows.append(("Break lines", length(stated.line_max_error), f"largest; mean {length(stated.line_mean_error)}"))
    return rows


def _shape_rows(stated: QualityStatement) -> Rows:
    angles = stated.angles
    rows = [("Least angle", f"{angles.minimum:.3g}°", "of all triangles" + (" in the plane" * (not stated.closed)))]
    rows += [
        (f"Below {limit:g}°", in_per_cent(share), "of the triangles have a smaller angle")
        for limit, share in angles.below.items()
    ]
    return [*rows, ("Median", f"{angles.percentiles[50]:.3g}°", "of the least angles")]


def _method(stated: QualityStatement) -> list[str]:
    """Return how the numbers came about, sentence by sentence."""
    if stated.closed:
        how = "A residual is the distance in space of a vertex of the original from the mesh; it has no sign."
    else:
        how = (
            "A residual is the height of a vertex of the original minus that of the mesh above or below it; positive "
            "where the original is above the mesh. Where no triangle covers it there is no sign, and bias, standard "
            f"deviation, median and NMAD are without it. NMAD is {NORMAL_MAD} times the median absolute deviation from "
            "the median (Höhle and Höhle 2009)."
        )
    exact = "Percentiles are exact, by linear interpolation between the check points"
    if stated.resolution > 0.0:
        exact = f"Percentiles are taken from bins of {spelled(stated.resolution, stated.unit)}, as there are many"
    said = [
        how,
        f"{exact}. LE90 and LE95 are stated twice: as counted, whatever the distribution, and as {NORMAL_90:.4f} and "
        f"{NORMAL_95:.4f} times the RMSE, which hold for normal errors without bias.",
    ]
    if not stated.closed:
        said.append("Coverage is the share of the area of those faces of the original whose middles the mesh covers.")
    if stated.space is not None:
        to, back = stated.space.to_mesh.points, stated.space.to_original.points
        said.append(
            f"Distances in space are from {to:,} points of the original to the mesh and from {back:,} points of the "
            "mesh to the original: points spread evenly over both surfaces, and for the largest distance all vertices."
        )
    if "to a" in stated.system:
        said.append("Coordinates are angles: the plane was scaled to lengths as the reference system says above.")
    return said


def stated(
    compared: Compared,
    *,
    mesh: Mapping[str, Any] | None = None,
    space_samples: int | None = None,
    left_out: tuple[str, ...] = (),
) -> QualityStatement:
    """Measure a mesh beside its original and state what was found.

    Parameters
    ----------
    compared : Compared
        See :func:`~meshsimp_pymoo.surface.accuracy.compare`.
    mesh : mapping, optional
        What the mesh is called.
    space_samples : int, optional
        See :func:`~meshsimp_pymoo.surface.accuracy.accuracy_of`.
    left_out : tuple of str
        What is said to be left out. Distances in space of an original that is too large for them are said so too.
    """
    numbers = accuracy_of(compared, space_samples=space_samples)
    if numbers.space is None and space_samples != 0:
        size = f"{numbers.original_triangles:,} triangles, more than {MOST_FACES:,}"
        left_out = (*left_out, f"Distances in space are left out: the original has {size}.")
    known = {item.name: getattr(numbers, item.name) for item in fields(Accuracy)}
    return QualityStatement(**known, compared=compared, mesh=dict(mesh or {}), left_out=left_out)


def spelled(value: float, unit: str) -> str:
    """Return a length in four digits, with its unit if that is known.

    >>> spelled(0.42, "m"), spelled(1234.5678, "model units")
    ('0.42 m', '1235')
    """
    return f"{value:.4g}{in_unit(unit)}"


def in_per_cent(share: float) -> str:
    """Return a share in per cent, in two digits of what is left to all or to nothing, so that it is rounded to neither.

    >>> in_per_cent(1.0), in_per_cent(0.999963), in_per_cent(0.5), in_per_cent(0.00002)
    ('100 %', '99.9963 %', '50 %', '0.002 %')
    """
    percent = 100.0 * share
    left = min(percent, 100.0 - percent)
    digits = min(1 - math.floor(math.log10(left)), 9) if left > 0.0 else 0
    return f"{round(percent, max(digits, 0)):.10g} %"


def claim_folder(folder: Path, *, overwrite: bool) -> None:
    """Check, before any work, that a statement can be written there.

    Raises
    ------
    ResultError
        If the folder exists (or, with ``overwrite``, holds something else), or cannot be made.
    """
    claim_output(folder, overwrite=overwrite, is_own=(DATA, PAGE, RESIDUALS).__contains__)

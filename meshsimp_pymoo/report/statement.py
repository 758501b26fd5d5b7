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

from meshsimp_pymoo.errors import ModelError, NoHeightGrid, ResultError, printable, warn_of
from meshsimp_pymoo.files import new_folder
from meshsimp_pymoo.formats.outmesh import metres_of
from meshsimp_pymoo.report.residuals import write_residuals
from meshsimp_pymoo.surface.accuracy import (
    NORMAL_90,
    NORMAL_95,
    SPACE_SAMPLES,
    Accuracy,
    Compared,
    accuracy_of,
)
from meshsimp_pymoo.surface.measures import LENGTH

__all__ = ["DATA", "PAGE", "RESIDUALS", "QualityStatement", "stated"]

DATA, PAGE, RESIDUALS = "quality.json", "quality.html", "residuals.tif"
# Of the keys of quality.json: it rises where one changes its meaning or goes, not where one comes.
SCHEMA = 1
NOT_INDEPENDENT = "check points are the samples the mesh was made from, not independent ground truth"
# Where the numbers of the table come from, by name.
SOURCES = {
    "le90": "percentile of the absolute residuals, as counted, whatever their distribution",
    "le95": "percentile of the absolute residuals, as counted: VVA of ASPRS, Positional Accuracy Standards for Digital "
    "Geospatial Data, edition 1, 2014",
    "le90_normal": f"{NORMAL_90:.4f} x RMSE, which bounds 90 % of normal errors without bias: NMAS by "
    "FGDC-STD-007.3-1998 (NSSDA)",
    "le95_normal": f"{NORMAL_95:.4f} x RMSE, which bounds 95 % of normal errors without bias: FGDC-STD-007.3-1998 "
    "(NSSDA); NVA of ASPRS 2014",
    "nmad": "1.4826 x median absolute deviation from the median: Höhle and Höhle, ISPRS J. 64, 2009",
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
    mesh: Mapping[str, Any] = field(default_factory=dict)
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
        metres = None if self.unit == LENGTH else metres_of("metre" if self.unit == "m" else self.unit)
        return {
            "name": PurePath(model.name).name,
            "sha256": model.hash,
            "vertices": self.original_vertices,
            "triangles": self.original_triangles,
            "unit": None if self.unit == LENGTH else self.unit,
            "metres_per_unit": metres,
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
        if self.uncovered and self.outside == "ignore":
            said += f"; {self.uncovered:,} of them, which no triangle covers, count as 0"
        elif self.uncovered:
            said += f"; {self.uncovered:,} of them, which no triangle covers, count with their distance to the mesh"
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
        return ", ".join([*said, f"{self.triangles:,} triangles ({in_per_cent(self.reduction)} fewer)"])

    def as_data(self) -> dict[str, Any]:
        """Return the content of quality.json: plain data, lengths in ``original.unit``."""
        return {
            "schema": SCHEMA,
            "made_by": f"meshsimp_pymoo {version('meshsimp-pymoo')}",
            "statement": self.sentence,
            "remark": NOT_INDEPENDENT,
            "original": self.original,
            "mesh": dict(self.mesh),
            "accuracy": self.numbers.plain,
            "sources": SOURCES,
            "left_out": list(self.left_out),
        }

    def write_data(self, path: Path) -> None:
        """Write quality.json."""
        text = json.dumps(self.as_data(), indent=2, allow_nan=False, ensure_ascii=False)
        path.write_text(text + "\n", encoding="utf-8")

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


def stated(
    compared: Compared,
    *,
    mesh: Mapping[str, Any] | None = None,
    space_samples: int = SPACE_SAMPLES,
    left_out: tuple[str, ...] = (),
) -> QualityStatement:
    """Measure a mesh beside its original and state what was found.

    Parameters
    ----------
    compared : Compared
        See :func:`~meshsimp_pymoo.surface.accuracy.compare`.
    mesh : mapping, optional
        What the mesh is called.
    space_samples : int
        See :func:`~meshsimp_pymoo.surface.accuracy.accuracy_of`.
    left_out : tuple of str
        What is said to be left out.
    """
    numbers = accuracy_of(compared, space_samples=space_samples)
    known = {item.name: getattr(numbers, item.name) for item in fields(Accuracy)}
    return QualityStatement(**known, compared=compared, mesh=dict(mesh or {}), left_out=left_out)


def spelled(value: float, unit: str) -> str:
    """Return a length in four digits, with its unit if that is known.

    >>> spelled(0.42, "m"), spelled(1234.5678, "model units")
    ('0.42 m', '1235')
    """
    return f"{value:.4g}" + f" {unit}" * (unit != LENGTH)


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
        If the folder exists (or, with ``overwrite``, holds something else).
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise ResultError(f"{folder}: is a file; name a new folder")
    if not overwrite:
        raise ResultError(f"{folder}: exists already; name another folder or allow overwriting (--overwrite)")
    foreign = sorted(entry.name for entry in folder.iterdir() if entry.name not in (DATA, PAGE, RESIDUALS))
    if foreign:
        raise ResultError(
            f"{folder}: holds {foreign[0]}, which is no part of a statement of quality, and would be deleted with the "
            "rest; name another folder"
        )

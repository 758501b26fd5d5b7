"""What an experiment leaves on disk: finished runs, written whole, read back with every number checked.

::

    OUT/experiment.json       the resolved configuration, and the key of every run that it asks for
    OUT/models/NAME.KEY.npz   the models as they were searched
    OUT/runs/NAME.KEY.json    the record of a run: description, evaluations, seconds, versions, environment, checksums
    OUT/runs/NAME.KEY.npz     its arrays; no pickles
    OUT/.checkpoints/KEY.npz  the state of a run that is not finished; see `meshsimp_pymoo.search.checkpoint`

KEY is the hash of what the run is (model, problem, algorithm with all settings, seed, budget), so that a run
is found again whatever it is called, and never mistaken for another. NAME is for people only.

A run exists if both its files are whole: the record holds a checksum of the arrays and of itself. The arrays
are written first, each file to a hidden one that is then renamed. A process that is killed at any moment
leaves nothing that could be taken for a finished run. Nothing is flushed to the disk by force: what a power
failure cuts off has the wrong checksum, and is computed again.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.errors import ModelError, ResultError, reason_of
from meshsimp_pymoo.files import new_file, put_text, read_npz, stays_inside
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.kinds import Model
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.model import OpenModel

Arrays = Mapping[str, npt.NDArray[Any]]

EXPERIMENT_FILE = "experiment.json"
# Of the records; another number wherever what they hold is spelled otherwise. 5: what meshes are between the vertices.
FORMAT = 5
WAY_OUT = "mend that, and the same command does what is missing"

# Hexadecimal digits of a key: 64 bits, where a study has some thousand runs.
KEY_DIGITS = 16

# What is not stored of a model: results can be shown without its colours and the checks it passed.
NOT_STORED = ("attributes", "facts", "georeference", "found", "material", "raster")
# Break lines are stored as arrays whose names begin so.
LINES = "lines_"
# What closed models alone have.
OF_CLOSED = "poles"
# What a model need not have.
OPTIONAL = ("weights", "scale")


@brief
@dataclass(frozen=True, eq=False)
class StoredRun:
    """A finished run.

    Attributes
    ----------
    path : Path
        Its record.
    record : dict
        The content of the record. Of an evolutionary run also how far it went (``generations``, ``evaluations``,
        ``moves``; None where the algorithm makes none), what that took (``seconds``; ``cpu_seconds`` of all threads:
        an annealing uses all cores, all else one), and where: ``begun``, ``versions`` and ``environment`` with the
        ``jobs`` that went on at once.
    arrays : dict of str to array
        For an evolutionary run ``F`` (S, 2), ``kept`` (S, ceil(N / 8)) packed bits, and one value per
        solution of ``error_nearest`` (the error when uncovered vertices cost their distance) and of every
        measure but "error" and "triangles" (see `meshsimp_pymoo.surface.measures`); and how it converged, at K
        moments, the last of them its end: ``trace_generations`` (K,), ``trace_evaluations`` (K,), and the front at
        moment k, error as searched and triangles, sorted by triangles, as the rows ``trace_start[k]`` to
        ``trace_start[k + 1]`` of ``trace_F``; ``trace_start`` is (K + 1,). The record has the K
        ``trace_seconds``, which are never the same twice. ``F`` and all that is compared is of the Delaunay meshes of
        ``kept``. Where the search found free meshes that are better, those K of its front are there besides:
        ``free_F`` (K, 2), and the triangles ``free_faces`` (M, 3), rows of the stored model, of which mesh k has those
        from ``free_face_start[k]`` to ``free_face_start[k + 1]``. See the runner for what baselines have.
    """

    path: Path
    record: dict[str, Any]
    arrays: dict[str, npt.NDArray[Any]]


def canonical(value: Any) -> str:
    """Return the one JSON spelling of a value: sorted keys, no blanks, no NaN.

    Examples
    --------
    >>> canonical({"b": 1, "a": [1.5, None]})
    '{"a":[1.5,null],"b":1}'
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def fingerprint(description: Mapping[str, Any]) -> str:
    """Return the key of what is described: the first digits of the SHA-256 of its canonical spelling."""
    return hashlib.sha256(canonical(description).encode()).hexdigest()[:KEY_DIGITS]


def claim_experiment(out: str | os.PathLike[str]) -> Path:
    """Check that a folder is new, empty or an experiment's, and make it.

    Raises
    ------
    ResultError
        If it holds anything else, or cannot be made.
    """
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise ResultError(f"{folder}: is a file; name a folder")
    if folder.is_dir() and not (folder / EXPERIMENT_FILE).exists():
        # a process killed at its very beginning leaves the two folders, and perhaps models
        own, begun = (folder / "runs", folder / "models"), list((folder / "models").glob("*.npz"))
        entries = [*folder.iterdir(), *(path for part in own if part.is_dir() for path in part.iterdir())]
        foreign = sorted({path for path in entries if not path.name.startswith(".")} - {*own, *begun})
        if foreign:
            raise ResultError(
                f"{folder}: holds {foreign[0].relative_to(folder)} and is no experiment's folder; name another one "
                "or a new one"
            )
    try:
        for name in ("runs", "models"):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise ResultError(f"{folder}: cannot be made ({reason_of(problem)}); name another folder") from None
    return folder


def write_experiment(out: Path, content: Mapping[str, Any]) -> None:
    """Write the description of the experiment; in place of an earlier one, whole or not at all."""
    record = {"format": FORMAT} | dict(content)
    put_text(out / EXPERIMENT_FILE, json.dumps(record, indent=1, allow_nan=False) + "\n", way_out=WAY_OUT)


def read_experiment(out: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the description of the experiment.

    Raises
    ------
    ResultError
        If there is none.
    """
    path = Path(out) / EXPERIMENT_FILE
    if not path.is_file():
        raise ResultError(f"{out}: no experiment is stored there ({EXPERIMENT_FILE} is missing)")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as problem:
        raise ResultError(f"{path}: cannot be read ({reason_of(problem)}); `meshsimp run` writes it anew") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ResultError(f"{path}: is not of the format {FORMAT} that this version reads; run it again")
    return content


def write_run(
    folder: Path, label: str, description: Mapping[str, Any], arrays: Arrays, facts: Mapping[str, Any]
) -> Path:
    """Write a finished run.

    Parameters
    ----------
    folder : Path
        The experiment's folder of runs.
    label : str
        What people call the run.
    description : mapping
        What the run is; its fingerprint is the key.
    arrays : mapping of str to array
        The results.
    facts : mapping
        What else is known: evaluations, seconds, versions.

    Returns
    -------
    Path
        The record.
    """
    stem = f"{_file_name(label)}.{fingerprint(description)}"
    content = io.BytesIO()
    contiguous: dict[str, Any] = {name: np.ascontiguousarray(values) for name, values in arrays.items()}
    np.savez_compressed(content, **contiguous)
    record = dict(facts) | {
        "format": FORMAT,
        "label": label,
        "description": dict(description),
        "arrays_sha256": hashlib.sha256(content.getvalue()).hexdigest(),
    }
    record["checksum"] = hashlib.sha256(canonical(record).encode()).hexdigest()
    _put(folder / f"{stem}.npz", content.getvalue())
    path = folder / f"{stem}.json"
    put_text(path, json.dumps(record, indent=1, allow_nan=False) + "\n", way_out=WAY_OUT)
    return path


def read_run(path: Path) -> StoredRun:
    """Read a finished run, and check that it is whole and the one it says it is.

    Raises
    ------
    ResultError
        If a file is missing, cut off or changed; the message names the file.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        checksum = record.pop("checksum")
        whole = hashlib.sha256(canonical(record).encode()).hexdigest() == checksum
    except (OSError, ValueError, AttributeError, KeyError, TypeError, RecursionError) as problem:
        raise ResultError(f"{path}: is damaged ({reason_of(problem)})") from None
    if not whole:
        raise ResultError(f"{path}: is damaged (its content does not have its checksum)")
    if record.get("format") != FORMAT:
        raise ResultError(f"{path}: is not of the format {FORMAT} that this version reads")
    if fingerprint(record["description"]) != _key(path):
        raise ResultError(f"{path}: is not the run that its name says")
    npz = path.with_suffix(".npz")
    try:
        content = npz.read_bytes()
    except OSError as problem:
        raise ResultError(f"{npz}: is damaged ({reason_of(problem)})") from None
    if hashlib.sha256(content).hexdigest() != record["arrays_sha256"]:
        raise ResultError(f"{npz}: is damaged (its content does not have the checksum in {path.name})")
    return StoredRun(path, record, _arrays(content, npz))


def classic_mesh(run: StoredRun, row: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """Return a stored mesh of a tool: vertices (V, 3) in the file's frame, faces (M, 3)."""
    v, f = run.arrays["vertex_start"], run.arrays["face_start"]
    return run.arrays["mesh_vertices"][v[row] : v[row + 1]], run.arrays["mesh_faces"][f[row] : f[row + 1]]


class RunStore:
    """The finished runs of an experiment by key; damaged ones are named, and do not exist.

    Parameters
    ----------
    out : Path
        The experiment's folder.

    Attributes
    ----------
    damaged : list of str
        What is wrong with the damaged runs met so far.
    """

    def __init__(self, out: Path) -> None:
        self.folder = out / "runs"
        self.damaged: list[str] = []
        self._paths = {_key(path): path for path in sorted(self.folder.glob("*.json")) if _key(path)}

    @property
    def paths(self) -> dict[str, Path]:
        """The record of every run that has one, whole or not."""
        return dict(self._paths)

    def get(self, key: str) -> StoredRun | None:
        """Return a run; None if there is none or it is damaged."""
        path = self._paths.get(key)
        if path is None:
            return None
        try:
            return read_run(path)
        except ResultError as problem:
            self.damaged.append(str(problem))
            return None

    def add(self, path: Path) -> None:
        """Take note of a run that was just written, in place of what was damaged under its key."""
        old = self._paths.get(_key(path))
        if old is not None and old != path:
            old.unlink(missing_ok=True)
            old.with_suffix(".npz").unlink(missing_ok=True)
        self._paths[_key(path)] = path

    def clean(self) -> None:
        """Remove what killed processes left behind."""
        out = self.folder.parent
        for folder in (out, out / "runs", out / "models"):
            for leftover in folder.glob(".*.partial*"):
                if leftover.is_file():
                    leftover.unlink(missing_ok=True)


def write_model(out: Path, model: Model) -> str:
    """Store a model, unless it is stored already; return its path inside the folder."""
    relative = _place_of(model)
    with contextlib.suppress(ResultError):
        read_model(out, relative, model.hash)
        return relative
    content = io.BytesIO()
    parts = {name: getattr(model, name) for name in _stored_fields(type(model))}
    stored: dict[str, Any] = {name: np.asarray(part) for name, part in parts.items() if part is not None}
    if model.lines is not None:
        stored |= {LINES + name: part for name, part in model.lines.arrays().items()}
    np.savez_compressed(content, **stored)
    _put(out / relative, content.getvalue())
    return relative


def as_begun(out: Path, model: Model) -> Model:
    """Return a model in the vector order of the runs in a folder: of a closed surface, with the images stored there.

    Their last bits depend on versions of libraries, and its hash does not know them.
    """
    if isinstance(model, ClosedModel):
        with contextlib.suppress(ResultError):
            stored = read_model(out, _place_of(model), model.hash)
            assert isinstance(stored, ClosedModel)
            return model.with_images(stored.xy, stored.source_index)
    return model


def _place_of(model: Model) -> str:
    """Return where a model is stored, inside the folder."""
    return f"models/{_file_name(Path(model.name).stem)}.{model.hash[:KEY_DIGITS]}.npz"


def read_model(out: Path, relative: object, expected: str) -> Model:
    """Read a stored model.

    Parameters
    ----------
    out : Path
        The experiment's folder.
    relative : str
        The model's path inside it.
    expected : str
        The hash that the model must have.

    Raises
    ------
    ResultError
        If it is missing or damaged.
    """
    if not isinstance(relative, str) or not stays_inside(out, relative):
        raise ResultError(f"{out}: names a model {relative!r} outside the folder; run the experiment again")
    path = out / relative
    try:
        arrays = _arrays(path.read_bytes(), path)
        kind = ClosedModel if OF_CLOSED in arrays else OpenModel
        names = [name for name in _stored_fields(kind) if name not in OPTIONAL or name in arrays]
        stored: dict[str, Any] = {name: arrays[name] for name in names}
        plain = {name: values.item() for name, values in stored.items() if values.ndim == 0}
        lines = {name.removeprefix(LINES): part for name, part in arrays.items() if name.startswith(LINES)}
        whole: dict[str, Any] = stored | plain | {"attributes": {}}
        if lines:
            whole["lines"] = ModelLines.of_arrays(lines)
        model = kind(**whole)
    except (OSError, KeyError, ValueError, TypeError) as problem:
        raise ResultError(f"{path}: is damaged ({reason_of(problem)}); run the experiment again") from None
    if model.hash != expected:
        raise ResultError(f"{path}: is not the model that was searched; run the experiment again")
    return model


def _stored_fields(kind: type[Model]) -> list[str]:
    """Return the parts of a model of a kind that are stored: arrays, texts and numbers."""
    return [part.name for part in fields(kind) if part.name not in (*NOT_STORED, "lines")]


def _put(path: Path, content: bytes) -> None:
    with new_file(path, way_out=WAY_OUT, flush=False) as partial:
        partial.write_bytes(content)


def _arrays(content: bytes, path: Path) -> dict[str, npt.NDArray[Any]]:
    try:
        return read_npz(io.BytesIO(content), path.name)
    except (ModelError, MemoryError) as problem:
        raise ResultError(f"{path}: is damaged ({reason_of(problem)})") from None


def _key(path: Path) -> str:
    """Return the key in the name of a run's file; empty if there is none."""
    match = re.search(rf"\.([0-9a-f]{{{KEY_DIGITS}}})\.[a-z]+$", path.name)
    return match[1] if match else ""


def _file_name(label: str) -> str:
    """Return a label as a part of a file name that every system takes.

    >>> _file_name("M1 / GA v1 / w=0.1")
    'M1_GA-v1_w-0.1'
    """
    spelled = label.replace(" / ", "_")
    return re.sub(r"[^A-Za-z0-9_.]+", "-", spelled).strip("-.")[:100] or "run"

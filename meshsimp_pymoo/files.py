"""Files and folders that are there whole or not at all; locks; arrays in archives without pickles. Knows no front."""

from __future__ import annotations

import csv
import glob
import io
import math
import os
import secrets
import shlex
import shutil
import warnings
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO, Any, NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import AnyArray
from meshsimp_pymoo.errors import ModelError, PictureWarning, ResultError, raise_if_memory, reason_of
from meshsimp_pymoo.memory import check_free

# Deflate cannot shrink data by more than 1032:1, so a .npz member that claims more is a forgery.
DEFLATE_LIMIT = 1100
# What an archive or a packed raster may unpack to, all in all; what is larger is to be read by windows.
UNPACKED_LIMIT = 8 << 30


# ------------------------------------------------------------------------------------------------- whole or not at all


@contextmanager
def new_file(path: Path, *, way_out: str = "name another file", flush: bool = True) -> Iterator[Path]:
    """Yield a hidden name beside ``path`` to write to; afterwards it takes that place, or is removed on an error.

    Parameters
    ----------
    path : Path
        The file to be; one of that name is replaced.
    way_out : str
        What the message of an error ends with.
    flush : bool
        Whether the file is to be on the disk before it takes its place; a power failure then costs nothing.

    Raises
    ------
    ResultError
        If it cannot be written.
    """
    partial = _hidden(path, f"partial{path.suffix}", path.stem)
    try:
        yield partial
        if flush:
            _flush(partial)
        partial.replace(path)
    except OSError as problem:
        raise ResultError(f"{path}: cannot be written ({reason_of(problem)}); {way_out}") from None
    finally:
        with suppress(OSError):  # whatever stands in the way of that was said already
            partial.unlink(missing_ok=True)


@contextmanager
def new_folder(
    folder: str | os.PathLike[str],
    *,
    replace: bool = False,
    flush: bool = True,
    way_out: str = "make room, or name another folder",
) -> Iterator[Path]:
    """Yield a hidden folder beside ``folder`` to fill; afterwards it takes that place, or is removed on an error.

    Parameters
    ----------
    folder : path
        The folder to be; missing parents are made.
    replace : bool
        Whether a folder of that name gives way, in one step.
    flush : bool
        Whether all of it is to be on the disk before it takes its place.
    way_out : str
        What the message of an error ends with.

    Raises
    ------
    ResultError
        If it cannot be written.
    """
    target = Path(folder).resolve()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = partial_folder(target)
    except OSError as problem:
        raise ResultError(f"{folder}: cannot be made ({reason_of(problem)}); {way_out}") from None
    try:
        yield partial
        for path in [*partial.rglob("*"), partial] if flush else ():
            _flush(path)
        _put_in_place(partial, target, folder, replace)
    except BaseException as problem:
        shutil.rmtree(partial, ignore_errors=True)
        if isinstance(problem, OSError):
            raise ResultError(f"{folder}: cannot be written ({reason_of(problem)}); {way_out}") from None
        raise


def partial_folder(target: Path) -> Path:
    """Make a hidden folder beside the target, with the permissions that the user's folders usually get."""
    partial = _hidden(target, "partial", target.name)
    partial.mkdir()
    return partial


def _put_in_place(partial: Path, target: Path, folder: str | os.PathLike[str], replace: bool) -> None:
    old = None
    if replace and target.exists():
        old = _hidden(target, "old", target.name)
        target.rename(old)
    try:
        partial.rename(target)
    except OSError as problem:
        if old is not None:
            old.rename(target)
        raise ResultError(f"{folder}: cannot be put in place ({reason_of(problem)}); name another folder") from None
    _flush(target.parent)
    if old is not None:
        shutil.rmtree(old)


def put_back(folder: str | os.PathLike[str], *, tidy: bool = False, replaced: bool = False) -> None:
    """Mend what a process left that was killed while it put a folder in place.

    Parameters
    ----------
    folder : path
        The folder. If it is gone, and what it held before stands aside, that becomes the folder again.
    tidy : bool
        Remove unfinished folders beside it too; only for who holds the folder.
    replaced : bool
        Remove what still stands aside, too; only where all that it held is made anew.
    """
    target = Path(folder).resolve()
    if not target.exists() and (old := left_beside(target, "old")):
        old[0].rename(target)
    for kind, unwanted in (("partial", tidy), ("old", replaced)):
        for left in left_beside(target, kind) if unwanted else ():
            shutil.rmtree(left, ignore_errors=True)


def left_beside(target: Path, kind: str) -> list[Path]:
    """Return the hidden folders, "partial" or "old", that killed processes left beside a folder."""
    return sorted(target.parent.glob(f".{glob.escape(target.name)}.{'[0-9a-f]' * 8}.{kind}"))


def put_text(path: Path, text: str, *, way_out: str = "name another file", flush: bool = False) -> None:
    """Write a text file whole or not at all."""
    with new_file(path, way_out=way_out, flush=flush) as partial:
        partial.write_bytes(text.encode("utf-8"))


def _hidden(path: Path, kind: str, stem: str) -> Path:
    return path.with_name(f".{stem}.{secrets.token_hex(4)}.{kind}")


def _flush(path: Path) -> None:
    if path.is_dir() and os.name == "nt":  # Windows cannot open folders
        return
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the folder for this process alone, as far as the system can do that.

    The lock ends with the process, however it ends.

    Raises
    ------
    ResultError
        If another process holds it.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    with (folder / ".lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ResultError(
                f"{folder}: another process is at work there; wait for it or name another folder"
            ) from None
        except OSError:  # a file system without locks
            pass
        yield


# --------------------------------------------------------------------------------------------------------------- names


def is_there(path: Path) -> bool:
    """Tell whether there is something of this name; a name that no system takes is none."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def claim_file(path: str | os.PathLike[str], suffixes: Sequence[str], *, overwrite: bool = False) -> Path:
    """Check, before any work, that a file of this name can be written.

    Parameters
    ----------
    path : path
        The file to be written; upper case in its suffix is as good as lower case.
    suffixes : sequence of str
        The suffixes that it may have, with the dot.
    overwrite : bool
        Whether a file that exists may be replaced.

    Raises
    ------
    ResultError
        If its suffix is another, it exists, or its folder does not.
    """
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        known = ", ".join(suffixes)
        raise ResultError(f"{path}: the suffix {path.suffix!r} says no format that can be written; use one of {known}")
    if path.is_dir():
        raise ResultError(f"{path}: is a folder; name a file")
    if path.exists() and not overwrite:
        raise ResultError(f"{path}: exists already; name another file or allow overwriting (--overwrite)")
    if not path.parent.is_dir():
        raise ResultError(f"{path}: there is no folder {path.parent}; make it first")
    return path


def path_from(folder: Path, name: str) -> str | None:
    """Return the path of a file relative to a folder, so that both can move together; None: no file."""
    if not Path(name).is_file():
        return None
    try:
        return PurePosixPath(*Path(os.path.relpath(Path(name).resolve(), folder)).parts).as_posix()
    except ValueError:  # on another drive of Windows
        return str(Path(name).resolve())


def stays_inside(folder: Path, name: str) -> bool:
    """Tell whether a stored name leads to a place inside the folder, by any system's rules and through any link."""
    if "\0" in name or any(
        bool(path.anchor) or ".." in path.parts for path in (PurePosixPath(name), PureWindowsPath(name))
    ):
        return False
    try:
        return (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError):  # a link that leads to itself
        return False


# ---------------------------------------------------------------------------------------------- tables and archives


def as_argument(path: str | os.PathLike[str]) -> str:
    """Return a path as a shell takes it for one: quoted, and no option.

    >>> as_argument("a b"), as_argument("-o")
    ("'a b'", './-o')
    """
    text = os.fspath(path)
    return shlex.quote(f".{os.sep}{text}" if text.startswith("-") else text)


def write_csv(path: Path, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Write a heading and rows of cells that are text already."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)


def draw_into(folder: Path, drawings: Mapping[str, Callable[[Path], object]]) -> None:
    """Make pictures and pages in a folder of results; what fails is a warning and costs none of the results."""
    for name, draw in drawings.items():
        try:
            draw(folder / name)
        except Exception as problem:  # whatever a library may not like about a name, a font or the memory
            with suppress(OSError):
                (folder / name).unlink(missing_ok=True)
            warnings.warn(
                f"{name} could not be made ({reason_of(problem)}); the rest of the results is complete",
                PictureWarning,
                stacklevel=3,
            )


def write_npz(path: Path, **arrays: AnyArray) -> None:
    """Write arrays as .npz without the time of writing, so that equal arrays give equal bytes."""
    with zipfile.ZipFile(path, "w") as file:
        for name, array in arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(content, np.ascontiguousarray(array), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            file.writestr(entry, content.getvalue())


def read_npz(stream: IO[bytes], name: str, *, wanted: Collection[str] | None = None) -> dict[str, AnyArray]:
    """Read the arrays of a .npz, without pickles, after comparing what it declares with what it can hold.

    Parameters
    ----------
    stream : binary file
        The archive.
    name : str
        What messages call it.
    wanted : collection of str, optional
        The arrays to read; by default all.

    Raises
    ------
    ModelError
        If it is no whole archive, or declares more than its bytes can unpack to, than UNPACKED_LIMIT or than fits into
        memory.
    """
    arrays = {}
    unpacked = 0
    with _archive(stream, name) as archive:
        for info, key, label in _members(archive, name):
            if wanted is not None and key not in wanted:
                continue
            unpacked += info.file_size
            if unpacked > UNPACKED_LIMIT:
                raise ModelError(
                    f"{label} makes it unpack to more than {UNPACKED_LIMIT >> 30} GiB; save the heights as .npy"
                )
            check_free(unpacked, f"{label}: {unpacked} bytes unpacked", "save the heights alone, as .npy")
            with archive.open(info) as member:
                arrays[key] = read_npy(member, info.file_size, label)
    return arrays


def npz_headers(stream: IO[bytes], name: str) -> dict[str, NpyHeader]:
    """Return what the arrays of a .npz are, after the same comparison, without reading them.

    Raises
    ------
    ModelError
        As of :func:`read_npz`.
    """
    found = {}
    with _archive(stream, name) as archive:
        for info, key, label in _members(archive, name):
            with archive.open(info) as member:
                found[key] = read_npy_header(member, info.file_size, label)
    return found


@contextmanager
def _archive(stream: IO[bytes], name: str) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(stream) as archive:
            yield archive
    except (ModelError, MemoryError):
        raise
    except Exception as error:  # its directory and its packed data may be damaged in any way
        raise_if_memory(error)
        raise ModelError(f"{name}: is not a complete .npz file ({reason_of(error)}); copy or save it again") from error


def _members(archive: zipfile.ZipFile, name: str) -> Iterator[tuple[zipfile.ZipInfo, str, str]]:
    """Yield (member, name of its array, what messages call it) of an archive."""
    for info in archive.infolist():
        if not info.filename.endswith(".npy"):
            continue
        label = f"{name}: {info.filename}"
        if info.file_size > DEFLATE_LIMIT * max(info.compress_size, 1):
            raise ModelError(f"{label} declares {info.file_size} bytes packed into {info.compress_size}; save it again")
        yield info, info.filename[:-4], label


class NpyHeader(NamedTuple):
    """What a .npy array is: its shape, whether its first index runs fastest, and its type."""

    shape: tuple[int, ...]
    fortran: bool
    dtype: np.dtype[Any]


def read_npy_header(stream: IO[bytes], size: int, name: str) -> NpyHeader:
    """Read the header of a .npy array, after which its numbers begin, and compare it with the bytes there are.

    Raises
    ------
    ModelError
        If it is no such array, holds objects, or is cut off.
    """
    with _npy(name):
        version = np.lib.format.read_magic(stream)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about the header's spelling: Python 2's, or backslashes
            header = NpyHeader(*read_header(stream))
        if header.dtype.hasobject:
            raise ModelError(f"{name}: holds Python objects, which are never unpickled; save numbers")
        needed = math.prod(header.shape) * header.dtype.itemsize
        if needed > size - stream.tell():
            raise ModelError(
                f"{name}: truncated: declares {header.shape} of {header.dtype}, {needed} bytes, but "
                f"{size - stream.tell()} follow; copy or save it again"
            )
        return header


def read_npy(stream: IO[bytes], size: int, name: str) -> AnyArray:
    """Read one .npy array, as far as its header can be believed.

    Raises
    ------
    ModelError
        As of :func:`read_npy_header`.
    """
    read_npy_header(stream, size, name)
    with _npy(name):
        stream.seek(0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            array = np.lib.format.read_array(stream, allow_pickle=False)
        stream.read(1)  # reaching the end makes an archive compare its checksum
        return array


@contextmanager
def _npy(name: str) -> Iterator[None]:
    try:
        yield
    except (ModelError, OSError, MemoryError):
        raise
    except Exception as error:  # its header is Python text and its data may be packed: anything may break
        raise ModelError(f"{name}: is not a NumPy array file ({reason_of(error)}); check the suffix") from error

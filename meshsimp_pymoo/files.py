"""Files and folders that are there whole or not at all; locks; arrays in archives without pickles. Knows no front."""

from __future__ import annotations

import csv
import glob
import io
import math
import os
import re
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

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

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
    partial = _hidden(path, "partial")
    alive = -1
    try:
        alive = _mark_alive(partial, os.O_CREAT | os.O_RDWR)
        yield partial
        if flush:
            _flush(partial)
        partial.replace(path)
    except OSError as problem:
        raise ResultError(f"{path}: cannot be written ({reason_of(problem)}); {way_out}") from None
    finally:
        if alive >= 0:
            os.close(alive)
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
    alive = -1
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = partial_folder(target)
        alive = _mark_alive(partial, os.O_RDONLY)
    except OSError as problem:
        raise ResultError(f"{folder}: cannot be made ({reason_of(problem)}); {way_out}") from None
    try:
        yield partial
        for path in [*partial.rglob("*"), partial] if flush else ():
            _flush(path)
        _put_in_place(partial, target, folder, replace)
    except OSError as problem:
        raise ResultError(f"{folder}: cannot be written ({reason_of(problem)}); {way_out}") from None
    finally:
        if alive >= 0:
            os.close(alive)
        if not _turned(partial, "old").exists():
            shutil.rmtree(partial, ignore_errors=True)
        put_back(target)


def partial_folder(target: Path) -> Path:
    """Make a hidden folder beside the target, with the permissions that the user's folders usually get."""
    partial = _hidden(target, "partial")
    partial.mkdir()
    return partial


def _put_in_place(partial: Path, target: Path, folder: str | os.PathLike[str], replace: bool) -> None:
    """Give a folder its name, in place of an old one, which has that of the partial one until it is removed."""
    old = _turned(partial, "old")
    try:
        if replace and target.exists():
            target.rename(old)
        partial.rename(target)
    except BaseException as problem:  # also what comes between the two
        if old.exists() and not target.exists():
            old.rename(target)
        if isinstance(problem, OSError):
            raise ResultError(f"{folder}: cannot be put in place ({reason_of(problem)}); name another folder") from None
        raise
    _flush(target.parent)


def put_back(path: str | os.PathLike[str]) -> None:
    """Mend what processes left that were killed while they wrote this file, or put this folder in place.

    A folder that was replaced stands aside as *old* for a moment, under the mark of the one that was to come. If there
    is nothing in its place, it is put back. If there is, and no *partial* one of its mark, then that one has taken the
    place, and the old one is removed. *Partial* ones are removed where no living process is at work in them.
    """
    target = Path(path).resolve()
    with suppress(OSError):  # whoever writes there will say what is wrong
        for old in left_beside(target, "old"):
            if not target.exists():
                old.rename(target)
            elif not _turned(old, "partial").exists():
                shutil.rmtree(old, ignore_errors=True)
        for partial in left_beside(target, "partial"):
            if not _turned(partial, "old").exists() and _is_abandoned(partial):
                shutil.rmtree(partial, ignore_errors=True) if partial.is_dir() else partial.unlink(missing_ok=True)


def left_beside(target: Path, kind: str) -> list[Path]:
    """Return the hidden files or folders, "partial" or "old", that were not removed beside a file or folder."""
    any_mark = "[0-9a-f]" * 8
    return sorted(target.parent.glob(f".{glob.escape(target.stem)}.{any_mark}.{kind}{glob.escape(target.suffix)}"))


def put_text(path: Path, text: str, *, way_out: str = "name another file", flush: bool = False) -> None:
    """Write a text file whole or not at all."""
    with new_file(path, way_out=way_out, flush=flush) as partial:
        partial.write_bytes(text.encode("utf-8"))


def _hidden(path: Path, kind: str) -> Path:
    return path.with_name(f".{path.stem}.{secrets.token_hex(4)}.{kind}{path.suffix}")


def _turned(hidden: Path, kind: str) -> Path:
    """Return the name of the other kind with the same mark."""
    # behind the mark: the name itself may hold either word
    return hidden.with_name(re.sub(r"(.*\.[0-9a-f]{8}\.)(?:partial|old)", rf"\g<1>{kind}", hidden.name, count=1))


def _flush(path: Path) -> None:
    if path.is_dir() and os.name == "nt":  # Windows cannot open folders
        return
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


# --------------------------------------------------------------------------------------------------------------- locks


def _mark_alive(partial: Path, flags: int) -> int:
    """Open and lock what is being written, as a sign of life that ends with the process; -1 where there is no such."""
    if fcntl is None:
        return -1
    handle = os.open(partial, flags, 0o666)
    with suppress(OSError):  # a file system without locks
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return handle


def _is_abandoned(partial: Path) -> bool:
    """Tell whether what was being written has no process any more, where that can be known."""
    if fcntl is None:
        return False
    try:
        handle = os.open(partial, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    else:
        return True
    finally:
        os.close(handle)


@contextmanager
def locked(folder: str | os.PathLike[str], *, inside: bool = False) -> Iterator[None]:
    """Hold the folder for this process alone, as far as the system can do that.

    The lock is a hidden file beside the folder, or inside, which is removed at the end, with parents of the folder that
    were made for it and are empty. It ends with the process, however it ends; what is left of it then holds nobody up.

    Parameters
    ----------
    folder : path
        The folder, which need not be there.
    inside : bool
        Whether the folder is there to stay, and what is beside it perhaps somebody else's.

    Raises
    ------
    ResultError
        If another process holds it.
    """
    target = Path(folder).resolve()
    inside = inside or not target.name  # nothing is beside a root
    path = target / ".lock" if inside else target.with_name(f".{target.name}.lock")
    made = [parent for parent in path.parents if not is_there(parent)]
    handle = None
    try:
        with suppress(OSError):  # whoever writes there will say what is wrong
            path.parent.mkdir(parents=True, exist_ok=True)
            handle = _only_holder(path, folder)
        yield
    finally:
        with suppress(OSError):
            if handle is not None:
                path.unlink()  # while it is held: whoever opens it from now on makes another
                os.close(handle)
            for parent in made:
                parent.rmdir()


def _only_holder(path: Path, folder: str | os.PathLike[str]) -> int | None:
    """Open and lock a file; None where there are no locks."""
    if fcntl is None:
        return None
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), path.stat()):
                    return handle
            os.close(handle)  # its holder removed it before it was locked here
        except BlockingIOError:
            os.close(handle)
            raise ResultError(
                f"{folder}: another process is at work there; wait for it or name another folder"
            ) from None
        except OSError:  # a file system without locks
            return handle


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
    put_back(path)
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
    """Make pictures and pages in a folder of results, each whole; what fails is a warning, and costs no results."""
    for name, draw in drawings.items():
        put_back(folder / name)
        try:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            with new_file(folder / name, flush=False) as partial:
                draw(partial)
        except Exception as problem:  # whatever a library may not like about a name, a font or the memory
            if _was_interrupted(problem):
                raise KeyboardInterrupt from problem
            cause = problem.__context__ if isinstance(problem.__context__, OSError) else problem
            warnings.warn(
                f"{name} could not be made ({reason_of(cause)}); the rest of the results is complete",
                PictureWarning,
                stacklevel=3,
            )


def _was_interrupted(problem: BaseException | None) -> bool:
    """Tell whether Ctrl-C is what a library made an error of its own of."""
    while problem is not None and not isinstance(problem, KeyboardInterrupt):
        problem = problem.__cause__ or problem.__context__
    return problem is not None


def write_npz(path: Path, **arrays: AnyArray | Sequence[AnyArray]) -> None:
    """Write arrays as .npz without the time of writing, so that equal arrays give equal bytes.

    A sequence of arrays of one type is written as one, joined along the first axis, but is not joined in memory.
    """
    with zipfile.ZipFile(path, "w") as file:
        for name, array in arrays.items():
            parts = [array] if isinstance(array, np.ndarray) else array
            first = parts[0]
            shape = (sum(map(len, parts)), *first.shape[1:])
            header = io.BytesIO()
            described = {"descr": np.lib.format.dtype_to_descr(first.dtype), "fortran_order": False, "shape": shape}
            np.lib.format.write_array_header_1_0(header, described)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.file_size = len(header.getvalue()) + sum(part.nbytes for part in parts)  # beyond 2 GiB it is marked
            with file.open(entry, "w") as member:
                member.write(header.getvalue())
                for part in parts:
                    member.write(np.ascontiguousarray(part).data)


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
        if version not in ((1, 0), (2, 0), (3, 0)):
            raise ValueError(f"there is no version {version[0]}.{version[1]} of its header")
        if version != (1, 0):  # it may be as long as it likes, and room is made for it before it is read
            length = int.from_bytes(stream.read(4), "little")
            if length > size:
                raise ModelError(f"{name}: truncated: declares a header of {length} bytes; copy or save it again")
            stream.seek(-4, os.SEEK_CUR)
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

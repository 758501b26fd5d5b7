"""Files and folders appear whole or not at all, and what a killed process leaves is put back."""

from __future__ import annotations

import errno
import itertools
import os
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

from meshsimp_pymoo import files
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.files import (
    _turned,
    left_beside,
    locked,
    new_file,
    new_folder,
    partial_folder,
    put_back,
    put_text,
    read_npz,
    write_npz,
)


def entries(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def write(manager, trouble=None):
    """Write something to what a context manager gives, and have trouble then."""
    with manager as partial:
        if partial.is_dir():
            (partial / "new").touch()
        else:
            partial.write_text("new")
        if trouble is not None:
            raise trouble


def full():
    """Return the error of a full disk."""
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


needs_locks = pytest.mark.skipif(sys.platform == "win32", reason="no locks, by which a dead process is known")
TROUBLES = [ValueError("no"), KeyboardInterrupt(), SystemExit(1)]


# --------------------------------------------------------------------------------------------------------- files


@pytest.mark.parametrize("flush", [True, False])
def test_a_file_takes_its_place_when_it_is_whole(tmp_path, flush):
    path = tmp_path / "mesh.ply"
    path.write_text("old")
    with new_file(path, flush=flush) as partial:
        assert partial.parent == tmp_path
        assert partial.name.startswith(".mesh.")
        assert partial.suffix == ".ply"  # whoever writes it may ask for that
        partial.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert entries(tmp_path) == ["mesh.ply"]


@pytest.mark.parametrize("trouble", TROUBLES, ids=repr)
def test_a_file_that_is_not_finished_leaves_nothing_and_the_error_is_the_writer_s(tmp_path, trouble):
    path = tmp_path / "mesh.ply"
    path.write_text("old")
    with pytest.raises(type(trouble)) as raised:
        write(new_file(path), trouble)
    assert raised.value is trouble
    assert path.read_text() == "old"
    assert entries(tmp_path) == ["mesh.ply"]


def test_a_file_that_cannot_be_written_is_one_line_with_the_way_out(tmp_path):
    path = tmp_path / "mesh.ply"
    with pytest.raises(ResultError, match=r"mesh\.ply: cannot be written \([^\n]*\); name another file$"):
        write(new_file(path), full())
    with pytest.raises(ResultError, match=r"cannot be written \(.*\); make room$"), new_file(path, way_out="make room"):
        raise full()
    with pytest.raises(ResultError, match=r"no/mesh\.ply: cannot be written"):
        write(new_file(tmp_path / "no" / "mesh.ply"))
    (tmp_path / "folder").mkdir()
    with pytest.raises(ResultError, match="folder: cannot be written"):
        write(new_file(tmp_path / "folder"))
    assert entries(tmp_path) == ["folder"]


def test_a_text_is_written_in_bytes_as_it_is(tmp_path):
    put_text(tmp_path / "a.txt", "\u00e9\n", flush=True)
    assert (tmp_path / "a.txt").read_bytes() == b"\xc3\xa9\n"


# ------------------------------------------------------------------------------------------------------- folders


@pytest.mark.parametrize("flush", [True, False])
def test_a_folder_takes_its_place_when_it_is_whole_and_parents_are_made(tmp_path, flush):
    out = tmp_path / "results" / "one"
    with new_folder(out, flush=flush) as partial:
        (partial / "meshes").mkdir()
        (partial / "meshes" / "a.ply").write_text("a")
        assert not out.exists()
    assert entries(tmp_path) == ["results", "results/one", "results/one/meshes", "results/one/meshes/a.ply"]


def test_a_folder_gives_way_in_one_step_and_only_if_it_may(tmp_path):
    out = tmp_path / "out"
    for content in ("old", "new"):
        with new_folder(out, replace=True) as partial:
            (partial / content).touch()
            assert out.exists() == (content == "new")
    assert entries(tmp_path) == ["out", "out/new"]
    with pytest.raises(ResultError, match=r"out: cannot be put in place \(.*\); name another folder$"):
        write(new_folder(out))
    assert entries(tmp_path) == ["out", "out/new"]


@pytest.mark.parametrize("trouble", TROUBLES, ids=repr)
def test_a_folder_that_is_not_finished_leaves_the_old_one(tmp_path, trouble):
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").touch()
    with pytest.raises(type(trouble)) as raised:
        write(new_folder(out, replace=True), trouble)
    assert raised.value is trouble
    assert entries(tmp_path) == ["out", "out/old"]


def test_a_folder_that_cannot_be_written_or_made_is_one_line_with_the_way_out(tmp_path):
    out = tmp_path / "out"
    way_out = "make room, or name another folder"
    with pytest.raises(ResultError, match=rf"out: cannot be written \([^\n]*\); {way_out}$"):
        write(new_folder(out), full())
    assert entries(tmp_path) == []
    (tmp_path / "file").touch()
    with (
        pytest.raises(ResultError, match=rf"below: cannot be made \(.*\); {way_out}$"),
        new_folder(tmp_path / "file" / "below"),
    ):
        pass
    assert entries(tmp_path) == ["file"]


def test_a_failed_change_of_places_puts_the_old_folder_back(tmp_path, monkeypatch):
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").touch()
    rename = type(out).rename

    def fails(path, target):
        if path.suffix == ".partial":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return rename(path, target)

    monkeypatch.setattr(type(out), "rename", fails)
    with pytest.raises(ResultError, match="cannot be put in place"):
        write(new_folder(out, replace=True))
    assert entries(tmp_path) == ["out", "out/old"]


# ---------------------------------------------------------------------------------------------- after a killed process


def test_the_old_folder_comes_back_where_a_process_was_killed_between_two_renames(tmp_path):
    (tmp_path / ".out.0123abcd.old").mkdir()
    (tmp_path / ".out.0123abcd.old" / "front.csv").touch()
    (tmp_path / ".out.0123abcd.partial").mkdir()
    put_back(tmp_path / "out")
    assert entries(tmp_path) == ["out", "out/front.csv"]
    put_back(tmp_path / "other")  # nothing to do
    assert entries(tmp_path) == ["out", "out/front.csv"]


def test_an_old_folder_is_removed_where_the_new_one_took_its_place_and_there_alone(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").touch()
    (tmp_path / ".out.0123abcd.old").mkdir()
    (tmp_path / ".out.0123abcd.partial").mkdir()
    put_back(tmp_path / "out")  # somebody made that folder meanwhile
    assert entries(tmp_path) == [".out.0123abcd.old", ".out.0123abcd.partial", "out", "out/mine"]
    (tmp_path / ".out.0123abcd.partial").rmdir()
    put_back(tmp_path / "out")
    assert entries(tmp_path) == ["out", "out/mine"]


@pytest.mark.parametrize("name", ["out", "out.v1", "mesh.ply"])
@needs_locks
def test_what_dead_processes_left_is_removed_and_what_living_ones_write_is_not(tmp_path, name):
    new, path = (new_file, tmp_path / name) if name.endswith("ply") else (new_folder, tmp_path / name)
    with new(path) as partial:
        if new is new_file:
            partial.write_text("new")
        dead = partial.with_name(partial.name.replace(partial.name.split(".")[2], "0123abcd"))
        assert dead != partial
        dead.mkdir() if new is new_folder else dead.touch()
        assert sorted(left_beside(path, "partial")) == sorted([partial, dead])
        put_back(path)
        assert left_beside(path, "partial") == [partial]
    assert entries(tmp_path) == [name]


DIE = """
import os, signal, sys
from pathlib import Path
from meshsimp_pymoo import files
out, number, calls, rename = Path(sys.argv[1]), int(sys.argv[2]), [], os.rename
def act(kind):
    def acted(*args, **kwargs):
        calls.append(kind)
        if len(calls) == number:
            os.kill(os.getpid(), getattr(signal, sys.argv[3]))
        return kind(*args, **kwargs)
    return acted
for place, name in ((Path, "rename"), (files, "_flush"), (files.shutil, "rmtree"), (Path, "replace"), (Path, "unlink")):
    setattr(place, name, act(getattr(place, name)))
with files.new_folder(out, replace=True) as partial:
    (partial / "new").touch()
with files.new_file(out / "text") as partial:
    partial.write_text("new")
"""


@needs_locks
@pytest.mark.parametrize("kind", ["SIGKILL", "SIGINT"])
def test_whatever_moment_a_process_is_killed_at_there_is_a_whole_folder_and_then_nothing_beside(tmp_path, kind):
    found = set()
    for number in range(1, 30):
        out = tmp_path / str(number) / "out"
        out.mkdir(parents=True)
        (out / "old").touch()
        done = subprocess.run([sys.executable, "-c", DIE, out, str(number), kind], stderr=subprocess.DEVNULL)
        if kind == "SIGINT":
            assert out.is_dir()  # it could put back what was there
        put_back(out)
        put_back(out / "text")
        assert [path.name for path in out.parent.iterdir()] == ["out"]
        found.add(tuple(entries(out)))
        if done.returncode == 0:
            break
    assert done.returncode == 0
    assert found == {("old",), ("new",), ("new", "text")}


@pytest.mark.parametrize("inside", [False, True])
def test_a_lock_ends_with_its_process_and_is_not_left(tmp_path, inside):
    out = tmp_path / "results" / "out"
    if inside:
        out.mkdir(parents=True)
    before = entries(tmp_path)
    with locked(out, inside=inside):
        if sys.platform != "win32":
            assert len([name for name in entries(tmp_path) if name.endswith(".lock")]) == 1
            with (
                pytest.raises(ResultError, match="out: another process is at work there; wait for it"),
                locked(out, inside=inside),
            ):
                pass
    assert entries(tmp_path) == before
    (out if inside else out.parent).mkdir(parents=True, exist_ok=True)
    left = out / ".lock" if inside else out.with_name(".out.lock")
    left.touch()  # of a killed process
    with locked(out, inside=inside):
        pass
    assert not left.exists()


@needs_locks
def test_a_lock_that_its_holder_removed_before_it_was_held_is_none(tmp_path, monkeypatch):
    flock, left = files.fcntl.flock, [tmp_path / ".out.lock"]

    def late(*args):
        if left:
            left.pop().unlink()  # its holder has ended
        flock(*args)

    monkeypatch.setattr(files.fcntl, "flock", late)
    with locked(tmp_path / "out"):
        assert (tmp_path / ".out.lock").exists()
        with pytest.raises(ResultError, match="another process"), locked(tmp_path / "out"):
            pass
    assert entries(tmp_path) == []


def test_only_a_folder_s_own_remains_are_touched(tmp_path):
    others = [".out.2.0123abcd.partial", ".outer.0123abcd.partial", ".out.0123abc.partial", ".out.0123abcg.partial"]
    for name in others:
        (tmp_path / name).mkdir()
    put_back(tmp_path / "out")
    assert entries(tmp_path) == sorted(others)
    (tmp_path / ".[ab].0123abcd.old").mkdir()
    put_back(tmp_path / "a")  # the name is no pattern
    put_back(tmp_path / "[ab]")
    assert entries(tmp_path) == sorted([*others, "[ab]"])


@pytest.mark.parametrize("name", ["out", "out.v1", "out.partial", "out.old", "out.0123abcd.old"])
def test_whatever_a_folder_is_called_what_stood_aside_when_a_process_was_killed_is_put_back(tmp_path, name):
    target = tmp_path / name
    partial = partial_folder(target)
    _turned(partial, "old").mkdir()
    (_turned(partial, "old") / "results").write_text("hours")
    put_back(target)
    assert (target / "results").read_text() == "hours"
    assert list(tmp_path.iterdir()) == [target]


def test_an_interruption_of_which_a_library_makes_an_error_stays_one(tmp_path):
    def draw(path):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as problem:
            raise SystemError("returned a result with an exception set") from problem

    with pytest.raises(KeyboardInterrupt):
        files.draw_into(tmp_path, {"front.png": draw})
    assert list(tmp_path.iterdir()) == []


def test_a_sequence_of_arrays_is_written_as_one_that_is_never_joined_in_memory(tmp_path):
    rng = np.random.default_rng(1)
    whole = rng.integers(0, 1000, (500_000, 3)).astype(np.int32)
    cuts = [0, 0, 1, *range(25_000, 500_001, 25_000), 500_000]
    parts = [whole[a:b] for a, b in itertools.pairwise(cuts)]
    tracemalloc.start()
    write_npz(tmp_path / "a.npz", joined=parts, beside=np.arange(3))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < whole.nbytes / 4
    write_npz(tmp_path / "b.npz", joined=parts, beside=np.arange(3))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with (tmp_path / "a.npz").open("rb") as stream:
        found = read_npz(stream, "a.npz")
    np.testing.assert_array_equal(found["joined"], whole)
    assert (found["joined"].dtype, found["beside"].tolist()) == (np.int32, [0, 1, 2])
    write_npz(tmp_path / "c.npz", none=[np.empty((0, 3), np.int32)] * 2)
    with np.load(tmp_path / "c.npz") as arrays:
        assert arrays["none"].shape == (0, 3)

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

import meshsimp_pymoo
from meshsimp_pymoo.compiling import store
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.compiling.store import made_from, place
from meshsimp_pymoo.errors import CodeWarning
from meshsimp_pymoo.search.greedy import thin
from meshsimp_pymoo.surface import trial

# ------------------------------------------------------------------------------------------------------------ the place


@pytest.fixture
def fresh_place(monkeypatch):
    """Have the place looked for again, and forgotten afterwards."""
    place.cache_clear()
    yield monkeypatch
    place.cache_clear()


def refuse(monkeypatch, n):
    """Make the first n folders that are tried such that they cannot be written."""
    tried = []

    def prepare(folder):
        tried.append(folder)
        if len(tried) <= n:
            raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(store, "_prepare", prepare)
    return tried


def test_the_places_are_the_package_the_user_s_cache_and_the_temporary_folder(fresh_place):
    fresh_place.setattr(store.config, "CACHE_DIR", "")
    tried = refuse(fresh_place, 3)
    found = place()
    assert found.folder is None
    assert tried == [
        Path(meshsimp_pymoo.__file__).resolve().parent / "__pycache__",
        *(folder for folder in tried[1:] if "meshsimp_pymoo" in str(folder)),
    ]
    assert len(found.refused) == 3
    assert all(line.endswith(": Permission denied") for line in found.refused)
    assert str(tried[2]).startswith(tempfile.gettempdir())


@pytest.mark.parametrize("n", [0, 1, 2])
def test_the_first_place_that_can_be_written_is_taken(fresh_place, n):
    fresh_place.setattr(store.config, "CACHE_DIR", "")
    tried = refuse(fresh_place, n)
    assert place().folder == tried[n]
    assert len(place().refused) == n


def test_a_folder_that_is_named_is_the_only_one(fresh_place, tmp_path):
    fresh_place.setattr(store.config, "CACHE_DIR", str(tmp_path / "named"))
    folder = tmp_path / "named" / "meshsimp_pymoo"
    assert place() == (folder, (folder,), ())
    assert place().folder.is_dir()
    place.cache_clear()
    (tmp_path / "file").write_text("")
    fresh_place.setattr(store.config, "CACHE_DIR", str(tmp_path / "file"))
    assert place().folder is None


def test_who_has_no_home_gets_no_folder_named_so(fresh_place):
    fresh_place.setattr(store.config, "CACHE_DIR", "")
    fresh_place.setattr(store.platformdirs, "user_cache_dir", lambda *_, **__: "~/.cache/meshsimp_pymoo")
    assert all(folder.is_absolute() for folder in store._candidates())


def test_without_a_folder_for_temporary_files_there_is_one_place_less(fresh_place):
    def none():
        raise FileNotFoundError(2, "No usable temporary directory found")

    fresh_place.setattr(store.config, "CACHE_DIR", "")
    fresh_place.setattr(tempfile, "gettempdir", none)
    assert len(store._candidates()) == 2


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no owners here")
def test_a_temporary_folder_of_somebody_else_is_refused(fresh_place, tmp_path):
    """What is in it would be run."""
    fresh_place.setattr(tempfile, "tempdir", str(tmp_path))
    uid = os.getuid()
    fresh_place.setattr(os, "getuid", lambda: uid + 1)
    with pytest.raises(PermissionError, match="belongs to somebody else"):
        store._prepare(tmp_path / "meshsimp_pymoo-1" / "abc")


BEGIN = """\
import tempfile
tempfile.tempdir = {temporary!r}
from meshsimp_pymoo.cli import main
raise SystemExit(main())
"""
PLACES = {"user's cache": 1, "temporary folder": 2, "nowhere": 3}


def run_where_nothing_can_be_written(tmp_path, n, *command):
    """Run a command of a copy of the package whose first n places cannot be made, not even by root."""
    package = tmp_path / "site" / "meshsimp_pymoo"
    shutil.copytree(Path(meshsimp_pymoo.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "__pycache__").write_text("no folder")
    good, bad = tmp_path / "good", tmp_path / "file"
    good.mkdir()
    bad.write_text("no folder")
    home, temporary = (bad / "home" if n >= 2 else good), (bad if n >= 3 else good)
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "XDG_"))}
    environment |= {"HOME": str(home), "PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    called = [sys.executable, "-c", BEGIN.format(temporary=str(temporary)), *command]
    return subprocess.run(called, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300)


def assert_said(done, n):
    assert done.returncode == 0, done.stderr
    # that it is compiling, and where that is kept; matplotlib, which has no place either, says so and may draw nothing
    own = [line for line in done.stderr.splitlines() if line.startswith("meshsimp: ")]
    assert len([line for line in own if "could not be made" not in line]) == 2
    assert ("compiled code can be kept nowhere" if n == 3 else "compiled code is kept in ") in done.stderr
    assert ("NUMBA_CACHE_DIR" in done.stderr) == (n == 3)


@pytest.mark.skipif(sys.platform == "win32", reason="HOME is another there")
@pytest.mark.parametrize(
    "n", [pytest.param(n, id=name, marks=[pytest.mark.slow] * (n < 3)) for name, n in PLACES.items()]
)
def test_info_works_where_the_package_cannot_be_written(tmp_path, n):
    # two faces that touch in a vertex alone: whether they overlap takes compiled code
    corners = "0 0 0\n1 1 0\n0 1 0\n1 -1 0\n0 -1 0"
    (tmp_path / "bow.off").write_text(f"OFF\n5 2 0\n{corners}\n3 0 1 2\n3 0 4 3\n")
    done = run_where_nothing_can_be_written(tmp_path, n, "info", "bow.off")
    assert_said(done, n)
    assert "usable: an open height field" in done.stdout
    kept = list((tmp_path / "good").rglob("*.nbi"))
    assert bool(kept) == (n < 3)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="HOME is another there")
@pytest.mark.parametrize("n", PLACES.values(), ids=PLACES)
def test_simplify_works_where_the_package_cannot_be_written(tmp_path, n):
    command = ("simplify", "roof:5", "-o", "out", "--generations", "2", "--population", "8")
    assert_said(run_where_nothing_can_be_written(tmp_path, n, *command), n)
    assert (tmp_path / "out" / "front.csv").is_file()


# -------------------------------------------------------------------------------------------------- what it is made of


def make(constant, step):
    @inner
    def less(a: float) -> float:
        return a - step

    @entry
    def least(a: float) -> float:
        return max(less(a), constant)

    return least


def test_code_is_known_by_all_it_is_made_from():
    known = made_from(make(1.0, 0.5).py_func)
    assert made_from(make(1.0, 0.5).py_func) == known
    assert made_from(make(2.0, 0.5).py_func) != known
    assert made_from(make(1.0, 0.25).py_func) != known


def test_code_of_a_loop_is_made_from_the_answers_of_the_surfaces(monkeypatch):
    """They are in another file, which Numba's own time stamps do not see."""
    known = made_from(thin.py_func)
    monkeypatch.setattr(trial, "MOST_TOUCHED", trial.MOST_TOUCHED + 1)
    assert made_from(thin.py_func) != known


def test_code_is_made_from_what_it_calls_by_the_name_of_a_module():
    """Not only from what was imported by its own name."""

    def calling(constant):
        tools = ModuleType("tools")
        tools.limit, tools.other = constant, constant

        @entry
        def most(a: float) -> float:
            return min(a, tools.limit)

        return most.py_func

    assert made_from(calling(1.0)) == made_from(calling(1.0))
    assert made_from(calling(2.0)) != made_from(calling(1.0))


def test_code_is_made_from_how_it_is_made(monkeypatch):
    known, texts = made_from(thin.py_func), {module: store._text(module) for module in store.HOW}
    for module, text in texts.items():
        assert "numba" in text
        with monkeypatch.context() as patched:
            patched.setattr(store, "_text", (texts | {module: "another"}).__getitem__)
            assert made_from(thin.py_func) != known


def test_code_for_a_record_is_found_by_the_order_of_its_members(kept):
    """Compiled code knows them by their places; their types may be the same in another order."""

    class One(NamedTuple):
        x: float
        y: float

    class Other(NamedTuple):
        y: float
        x: float

    function = kept()
    loaded(function)
    files, codegen = function._cache.files[-1], function.targetctx.codegen()
    one, other = (files._index_key((numba.typeof(record(1.0, 2.0)),), codegen)[-1] for record in (One, Other))
    assert (one, other) == ((("x", "y"),), (("y", "x"),))


# ------------------------------------------------------------------------------------------------------- bad days


@pytest.fixture
def kept(fresh_place, tmp_path):
    """Return a function that makes a small entry, whose code is kept in a folder of its own."""
    fresh_place.setattr(store.config, "CACHE_DIR", str(tmp_path))
    fresh_place.setattr(store, "_warned", set())

    def twice(values: np.ndarray) -> float:
        return 2.0 * values[0]

    return lambda: entry(twice)


def loaded(function):
    """Call it and tell whether its code was read and not made."""
    made = []
    with store.told_of_compiling(lambda _, seconds: made.append(seconds)):
        assert function(np.ones(1)) == 2.0
    assert len(made) in (0, 2)
    return not made


def test_code_is_made_once_and_then_read(kept, tmp_path):
    assert not store.has_code(kept())
    assert not loaded(kept())
    assert store.has_code(kept())
    assert loaded(kept())


def test_code_that_an_image_brings_along_is_read_by_who_cannot_write_it(kept, tmp_path, monkeypatch):
    """It was compiled by root, say, beside the package; whoever runs it has another folder."""
    image, own = tmp_path / "site" / "__pycache__", tmp_path / "own"

    def prepare(folder):
        if folder == image:
            raise PermissionError(13, "Permission denied")
        folder.mkdir()

    monkeypatch.setattr(store, "HERE", image.parent)
    monkeypatch.setattr(store, "_candidates", lambda: [image, own])
    assert not loaded(kept())
    place.cache_clear()
    monkeypatch.setattr(store, "_prepare", prepare)
    assert place().folder == own
    assert loaded(kept())
    assert list(own.iterdir()) == []


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_damaged_code_is_made_again_with_a_word(kept, tmp_path, suffix):
    loaded(kept())
    (path,) = tmp_path.rglob(f"*.{suffix}")
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.warns(CodeWarning, match="cannot be read"):
        assert not loaded(kept())


def test_a_full_disk_costs_a_word_and_nothing_else(kept, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "save", full)
    with pytest.warns(CodeWarning, match=r"cannot be kept in .* \(No space left on device\)"):
        assert not loaded(kept())
    assert not loaded(kept())  # and no second word


def test_the_level_of_optimisation_is_ours_and_levels_are_kept_apart_where_it_is_not(kept, monkeypatch):
    for is_ours in (True, False):
        monkeypatch.setattr(store, "is_known", lambda is_ours=is_ours: is_ours)
        monkeypatch.setattr(store.config, "OPT", 3)
        loaded(kept())
        monkeypatch.setattr(store.config, "OPT", 2)
        assert store.has_code(kept()) == is_ours

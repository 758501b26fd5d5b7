"""The bad days of a tiled simplification: whatever breaks, finished tiles stay and the same command ends the same.

==============================================  ====================================================================
what happens                                    what comes of it
==============================================  ====================================================================
a worker is killed in the middle of a tile      another one does the tile; the same bytes
the process is killed, at random moments        the same command goes on and ends with the same bytes
... while the finished folder is put in place   the next call puts it right; no tile is done again
the disk is full or read-only                   one line, exit code 2; what is finished stays, the same call goes on
the output folder is gone, or is another        one line, exit code 2; what is there instead is not touched
a stored tile is cut off or has a flipped bit   that tile is done again; the same bytes
the record beside the tiles is damaged          one line, exit code 2; --overwrite begins anew
the memory is too small                         one line, exit code 2, with the tile that fits, before any work
==============================================  ====================================================================
"""

import errno
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.opening import open_grid
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.tiles import memory
from meshsimp_pymoo.tiles.front import Folder, identity, tiled_front
from meshsimp_pymoo.tiles.thin import thin_tile
from meshsimp_pymoo.workers import Processes

pytestmark = pytest.mark.usefixtures("sketched", "few_moves")

# What depends on nothing but the model and the settings: all files but run.json, which has the seconds.
SAME = ("front.csv", "front.npz", "chosen.ply", "front.png")


HEIGHTS = open_grid(build_model(load("jacksboro:2"))).heights[:16, :150].astype(np.float32)  # two tiles


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("grid") / "relief.npy"
    np.save(path, HEIGHTS)
    return path


def command(path, out):
    call = ["simplify", str(path), "-o", str(out), "--tile", "64", "--triangles", "300", "--meshes", "3"]
    return [*call, "--jobs", "1", "--threads", "1", "--quiet", "--no-page"]


@pytest.fixture(scope="module")
def whole(path, few_moves, sketched, tmp_path_factory):
    """Return the bytes of a run that nothing happened to."""
    out = tmp_path_factory.mktemp("whole") / "out"
    assert main(command(path, out)) == 0
    return contents(out)


def contents(out, *, drawn=True):
    files = {
        str(file.relative_to(out)): file.read_bytes()
        for file in out.rglob("*")
        if file.is_file() and not file.name.startswith(".")
    }
    assert set(SAME if drawn else SAME[:-1]) < set(files)
    files.pop("run.json")
    files.pop("report.html", None)  # which names the folder
    return files


def refused(capsys, *words):
    """Check that one line was said, without a traceback."""
    said = capsys.readouterr().err
    assert said.startswith("meshsimp: ")
    assert said.count("\n") == 1
    for word in words:
        assert word in said


def pieces(out):
    return {file.name: file.read_bytes() for file in (out / "tiles").glob("*.npz")}


def at_call(number, action):
    """Return a stand-in for thin_tile that lets something happen before a tile."""
    calls = []

    def thin(tile):
        calls.append(tile.name)
        if len(calls) == number:
            action()
        return thin_tile(tile)

    return thin


# ---------------------------------------------------------------------------------------------------- what is killed


@pytest.mark.usefixtures("all_moves")
def test_a_worker_killed_in_the_middle_of_a_tile_changes_no_byte():
    grid = open_grid(HEIGHTS)
    expected = tiled_front(grid, tile=64)
    killed = []
    with Processes(1) as engine:  # how several share what one left is shown in test_workers.py

        def kill(share, what):
            if what.startswith("tile 2 of") and not killed:
                killed.append(next(iter(engine._pool._processes)))
                os.kill(killed[-1], signal.SIGKILL)

        found = tiled_front(grid, tile=64, engine=engine, progress=kill)
    assert killed
    assert found.quality == expected.quality
    one, other = found._kept.arrays(), expected._kept.arrays()
    assert all(np.array_equal(one[name], other[name]) for name in one)


KILLER = """
import os, random, shutil, signal, sys, time
from pathlib import Path
import matplotlib.backends.backend_agg, matplotlib.figure  # all that a call imports, before it is forked
import meshsimp_pymoo.cli.searching, meshsimp_pymoo.report.figures
from meshsimp_pymoo.cli import main

folder, seed, moments, call = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4:]

def start(out):
    pid = os.fork()
    if pid == 0:
        os._exit(main([word.replace("OUT", str(out)) for word in call]))
    return pid

def seconds():
    begin = time.perf_counter()
    assert os.waitpid(start(folder / "warm" / "out"), 0)[1] == 0
    shutil.rmtree(folder / "warm")
    return time.perf_counter() - begin

rng = random.Random(seed)
length = min(seconds(), seconds())
number, killed = 0, 0
while killed < moments:
    out = folder / str(number) / "out"
    pid = start(out)
    time.sleep(rng.random() * length)
    os.kill(pid, signal.SIGKILL)
    killed += os.WIFSIGNALED(os.waitpid(pid, 0)[1])
    finished = (out / "front.png").exists()
    print(number, "killed", len(list((out / "tiles").glob("*.npz"))))
    if finished or killed == moments:
        # a finished folder is not made anew, but cleared up beside
        print(number, "ended", os.waitstatus_to_exitcode(os.waitpid(start(out), 0)[1]) - 2 * finished)
        number += 1
"""


@pytest.mark.slow
def test_killed_at_random_moments_the_same_command_ends_with_the_same_bytes(path, tmp_path):
    kills = 100
    subprocess.run([sys.executable, "-m", "meshsimp_pymoo", *command(path, tmp_path / "whole")], check=True)
    whole = contents(tmp_path / "whole")
    call = [sys.executable, "-c", KILLER, str(tmp_path), "1", str(kills), *command(path, "OUT")]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said = [line.split() for line in done.stdout.splitlines()]
    assert len([line for line in said if line[1] == "killed"]) >= kills
    assert sum(int(line[2]) > 0 for line in said if line[1] == "killed") >= kills // 5
    ends = [line for line in said if line[1] == "ended"]
    assert len(ends) >= 1
    for number, _, code in ends:
        assert int(code) == 0
        assert contents(tmp_path / number / "out") == whole
        assert [entry.name for entry in (tmp_path / number).iterdir()] == ["out"]


def in_fork(call):
    """Run a command in a forked process, and return its code, or minus the signal that ended it."""
    child = os.fork()
    if child == 0:
        os._exit(main(call))
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("moment", ["files.shutil.rmtree", "report.figures.front_figure"])
def test_killed_when_the_new_folder_is_there_the_next_call_clears_up_and_draws(
    path, whole, tmp_path, monkeypatch, moment
):
    out = tmp_path / "out"
    import meshsimp_pymoo.report.figures  # noqa: F401

    with monkeypatch.context() as patch:
        patch.setattr(f"meshsimp_pymoo.{moment}", lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL))
        assert in_fork(command(path, out)) == -signal.SIGKILL
    undrawn = {name: data for name, data in whole.items() if name not in ("front.png", "quality.json")}
    assert contents(out, drawn=False) == undrawn
    monkeypatch.setattr("meshsimp_pymoo.tiles.front.thin_tile", None)
    assert main(command(path, out)) == 0
    assert contents(out) == whole
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]
    (out / "front.png").unlink()
    assert main(["report", str(out), "--quiet"]) == 0
    assert contents(out) == whole
    (out / "front.png").unlink()
    assert main([*command(path, out), "--seed", "1", "--triangles", "200"]) == 2  # of another call


def test_killed_between_taking_the_old_folder_away_and_putting_the_new_one_there_nothing_is_lost(
    path, whole, tmp_path, monkeypatch
):
    out = tmp_path / "out"
    rename = Path.rename

    def killed(self, target):
        if self.suffix == ".partial":
            os.kill(os.getpid(), signal.SIGKILL)
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", killed)
    assert in_fork(command(path, out)) == -signal.SIGKILL
    monkeypatch.undo()
    left = sorted(entry.suffix for entry in tmp_path.iterdir())
    assert left == [".lock", ".old", ".partial"]
    calls = []
    monkeypatch.setattr("meshsimp_pymoo.tiles.front.thin_tile", calls.append)
    assert main(command(path, out)) == 0
    assert not calls
    assert contents(out) == whole
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


# ------------------------------------------------------------------------------------------- what cannot be written


@pytest.mark.parametrize(("number", "kind"), [(1, errno.EROFS), (4, errno.ENOSPC), (9, errno.EROFS)])
def test_a_disk_that_is_full_or_read_only_is_named_and_what_was_finished_stays(
    path, whole, tmp_path, capsys, monkeypatch, number, kind
):
    out, savez, calls = tmp_path / "out", np.savez, []

    def full(file, **arrays):
        calls.append(file)
        if len(calls) >= number:
            Path(file).write_bytes(b"half of it")
            raise OSError(kind, os.strerror(kind))
        savez(file, **arrays)

    monkeypatch.setattr("meshsimp_pymoo.tiles.front.np.savez", full)
    assert main(command(path, out)) == 2
    refused(capsys, str(out), os.strerror(kind))
    monkeypatch.undo()
    if number == 1:
        assert not out.exists()
    else:
        assert len(pieces(out)) >= 1
        assert not list((out / "tiles").glob(".*"))
    assert main(command(path, out)) == 0
    assert contents(out) == whole


@pytest.mark.parametrize(
    "name",
    ["storage.write_mesh", "storage.write_csv", "storage.write_npz", "files._put_in_place"],
)
def test_a_disk_that_is_full_when_the_result_is_written_leaves_all_tiles(
    path, whole, tmp_path, capsys, monkeypatch, name
):
    out = tmp_path / "out"

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(f"meshsimp_pymoo.{name}", full)
    assert main(command(path, out)) == 2
    refused(capsys, str(out), "No space left on device", "the same command goes on")
    monkeypatch.undo()
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]
    before = pieces(out)
    assert "finish.npz" in before
    calls = []
    monkeypatch.setattr("meshsimp_pymoo.tiles.front.thin_tile", calls.append)
    assert main(command(path, out)) == 0
    assert not calls
    assert contents(out) == whole


@pytest.fixture
def small_disk(tmp_path):
    """Return a folder on a file system of its own, and what changes its size."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mounted(options):
        call = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
        return shutil.which("mount") is not None and subprocess.run(call, capture_output=True).returncode == 0

    if not mounted("size=64k"):
        pytest.skip("a small file system needs the right to mount one")
    yield folder, lambda kilobytes: mounted(f"remount,size={kilobytes}k")
    subprocess.run(["umount", str(folder)], check=True)


def test_on_a_small_disk_each_call_gets_as_far_as_there_is_room(path, whole, small_disk, capsys):
    folder, resize = small_disk
    out, finished = folder / "out", []
    for kilobytes in (32, 64, 128, 256, 512):
        assert resize(kilobytes)
        code = main(command(path, out))
        if code == 0:
            break
        refused(capsys, "No space left on device")
        finished.append(pieces(out))
    assert code == 0
    assert len(finished) >= 2
    assert finished[-1]
    assert contents(out) == whole


# ------------------------------------------------------------------------------------------ what somebody else does


@pytest.mark.parametrize("instead", ["nothing", "a file", "a folder", "a link"])
def test_an_output_folder_that_goes_away_meanwhile_is_named_and_what_is_there_instead_stays(
    path, whole, tmp_path, capsys, monkeypatch, instead
):
    out, aside = tmp_path / "out", tmp_path / "aside"

    def replace():
        out.rename(aside)
        if instead == "a file":
            out.write_text("mine")
        elif instead == "a folder":
            out.mkdir()
            (out / "mine.txt").write_text("mine")
        elif instead == "a link":
            (tmp_path / "mine").mkdir()
            (tmp_path / "mine" / "mine.txt").write_text("mine")
            out.symlink_to(tmp_path / "mine")

    monkeypatch.setattr("meshsimp_pymoo.tiles.front.thin_tile", at_call(5, replace))
    assert main(command(path, out)) == 2
    refused(capsys, str(out))
    monkeypatch.undo()
    if instead == "a file":
        assert out.read_text() == "mine"
        out.unlink()
    elif instead != "nothing":
        assert (out / "mine.txt").read_text() == "mine"
        (shutil.rmtree if instead == "a folder" else Path.unlink)(out)
    aside.rename(out)
    assert len(pieces(out)) >= 2
    assert main(command(path, out)) == 0
    assert contents(out) == whole


def test_a_folder_put_there_when_all_is_thinned_is_not_replaced(path, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    monkeypatch.setattr(
        "meshsimp_pymoo.cli.tiling.tiled_front",
        lambda *args, **kwargs: (tiled_front(*args, **kwargs), (out / "mine.txt").write_text("mine"))[0],
    )
    assert main(command(path, out)) == 2
    refused(capsys, "exists already")
    assert (out / "mine.txt").read_text() == "mine"


# ------------------------------------------------------------------------------------------------ what is damaged


def test_a_stored_tile_is_itself_or_nothing_whatever_bit_of_it_is_flipped(tmp_path):
    rng = np.random.default_rng(1)
    store = Folder(tmp_path, {"grid": "any"})
    arrays = {"removed": rng.integers(0, 1000, 40).astype(np.uint16), "level": rng.random(40).astype(np.float32)}
    store.put("piece", **arrays)
    file = tmp_path / "piece.npz"
    data = file.read_bytes()
    n_refused = 0
    for bit in rng.choice(8 * len(data), 800, replace=False):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << (bit % 8)
        file.write_bytes(damaged)
        found = store.get("piece")
        n_refused += found is None
        if found is not None:
            assert {key: values.tobytes() for key, values in found.items()} == {
                key: values.tobytes() for key, values in arrays.items()
            }
    assert n_refused > 400
    for end in range(0, len(data), 17):
        file.write_bytes(data[:end])
        assert store.get("piece") is None


def test_an_interrupted_run_with_damaged_tiles_ends_with_the_same_bytes(path, whole, tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"

    def interrupt():
        raise KeyboardInterrupt

    monkeypatch.setattr("meshsimp_pymoo.tiles.front.thin_tile", at_call(8, interrupt))
    assert main(command(path, out)) == 130
    monkeypatch.undo()
    stored = sorted((out / "tiles").glob("*.npz"))
    assert len(stored) >= 2
    for k, file in enumerate(stored):
        data = bytearray(file.read_bytes())
        data[len(data) // 3] ^= 4
        file.write_bytes(b"" if k == 0 else data[: len(data) // 2] if k % 2 else data)
    assert main(command(path, out)) == 0
    assert contents(out) == whole
    capsys.readouterr()


def test_a_damaged_record_of_what_the_tiles_belong_to_is_named(path, whole, tmp_path, capsys):
    out = tmp_path / "out"
    grid = open_grid(path)
    Folder(out / "tiles", identity(grid, tile=64))
    for damage in (b"", b"\xff\xfe", b"{}"):
        (out / "tiles" / "what.json").write_bytes(damage)
        assert main(command(path, out)) == 2
        refused(capsys, "unfinished tiles of another model or of other settings")
    assert main([*command(path, out), "--overwrite"]) == 0
    assert contents(out) == whole


# ------------------------------------------------------------------------------------------------ too little memory


LIMITED = """
import mmap, resource, sys  # numpy imports mmap when it maps a file, which is after the limit is set
from pathlib import Path
import meshsimp_pymoo.cli.searching
from meshsimp_pymoo.cli import main
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
limit = used + (int(sys.argv[1]) << 20)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="how much memory is taken is said in /proc")
@pytest.mark.parametrize(("megabytes", "jobs"), [(10, 1), (300, 2)])
def test_too_little_memory_is_said_in_one_line_with_the_way_out(tmp_path, megabytes, jobs):
    path, out = tmp_path / "big.npy", tmp_path / "out"
    np.save(path, np.zeros((1200, 1300), np.float32))
    call = ["simplify", str(path), "-o", str(out), "--tile", "512", "--jobs", str(jobs), "--quiet"]
    done = subprocess.run([sys.executable, "-c", LIMITED, str(megabytes), *call], capture_output=True, text=True)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("meshsimp: ")
    assert done.stderr.count("\n") == 1
    assert "--tile" in done.stderr
    assert not out.exists()


def test_with_half_the_tile_it_fits_as_the_message_says(monkeypatch):
    grid = open_grid(np.zeros((4000, 4000), np.float32))
    monkeypatch.setattr(memory, "free_memory", lambda: (1000 << 20, float("inf")))
    memory.check_memory(grid, tile=256, most=200_000, jobs=2)
    with pytest.raises(ModelError, match=r"tiles of 512 samples .* 2 at a time, .* use --tile 256"):
        memory.check_memory(grid, tile=512, most=200_000, jobs=2)
    memory.check_memory(grid, tile=512, most=200_000, jobs=1)
    memory.check_memory(grid, tile=512, most=200_000, jobs=2, remote=True)
    with pytest.raises(ModelError, match=r"use --jobs 1, fewer triangles or a --window"):
        memory.check_memory(grid, tile=512, most=4_000_000, jobs=2)


def test_a_tile_that_does_not_fit_after_all_is_said_in_one_line(path, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"

    def full():
        raise MemoryError

    monkeypatch.setattr("meshsimp_pymoo.tiles.front.thin_tile", at_call(5, full))
    assert main(command(path, out)) == 2
    refused(capsys, "does not fit into memory", "smaller tiles")
    assert len(pieces(out)) >= 2

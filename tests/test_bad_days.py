"""What surrounds a search may be in any state: names, streams, signals, pictures. Its results are there even so."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import meshsimp_pymoo.report.figures
import meshsimp_pymoo.report.page
from meshsimp_pymoo import Front, LiveTriangulation, MeshProblem, greedy_insertion, memory, thinning
from meshsimp_pymoo.cli import main, tiling
from meshsimp_pymoo.comparison.tables import Table
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, PictureWarning
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import write_mesh
from meshsimp_pymoo.search import starting
from meshsimp_pymoo.storage import CHECKPOINT, read_front

PROGRAM = (sys.executable, "-m", "meshsimp_pymoo")
# The same with sketches in place of pictures: half of its time.
SKETCHING = (
    sys.executable, "-c",
    f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); from sketching import sketch; "
    "from meshsimp_pymoo import cli; from meshsimp_pymoo.report import figures; figures.front_figure = sketch; "
    "cli.program()",
)  # fmt: skip
QUICK = ("--generations", "2", "--population", "8", "--algorithm", "nsga2_v1")
pytestmark = pytest.mark.usefixtures("sketched")
needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="file names, streams and signals are others there")


@pytest.fixture
def roof(tmp_path):
    path = tmp_path / "roof.ply"
    mesh = load("roof:5")
    write_mesh(path, mesh.points, mesh.faces)
    return path


# ------------------------------------------------------------------------------------------------ pictures


@pytest.mark.parametrize(("module", "function", "file"), [
    (meshsimp_pymoo.report.figures, "front_figure", "front.png"),
    (meshsimp_pymoo.report.page, "simplification_page", "report.html"),
])  # fmt: skip
@pytest.mark.parametrize("problem", [ValueError("no such\nfont"), MemoryError(), OSError(28, "No space left")])
def test_a_picture_that_fails_costs_a_line_and_none_of_the_results(
    tmp_path, monkeypatch, capsys, module, function, file, problem
):
    def fail(*_, **__):
        raise problem

    monkeypatch.setattr(module, function, fail)
    assert main(["simplify", "roof:5", "-o", str(tmp_path / "out"), *QUICK]) == 0
    said = capsys.readouterr()
    assert said.err.startswith(f"meshsimp: warning: {file} could not be made (")
    assert said.err.count("\n") == 1
    (written,) = (line for line in said.out.splitlines() if line.startswith("written: "))
    assert file not in written
    assert "front.csv" in written
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"front.png", "report.html"} - names == {file}
    assert len(Front.load(tmp_path / "out")) > 1
    assert any((tmp_path / "out" / "meshes").iterdir())


def test_in_python_it_is_a_warning(tmp_path, monkeypatch):
    front = Front.from_subsets(problem := MeshProblem("roof:5"), np.ones((1, problem.n_var), bool), ends=True)
    monkeypatch.setattr(meshsimp_pymoo.report.figures, "front_figure", None)
    with pytest.warns(PictureWarning, match=r"front\.png could not be made"):
        front.save(tmp_path / "out")
    assert read_front(tmp_path / "out").F.shape == front.F.shape


# ------------------------------------------------------------------------------------------------ names


@needs_posix
def test_a_name_that_is_not_unicode_costs_nothing(tmp_path, roof):
    name = os.fsencode(tmp_path) + b"/b\xe4d.ply"
    shutil.copy(roof, name)
    command = [*SKETCHING, "simplify", name, "-o", str(tmp_path / "out"), *QUICK]
    done = subprocess.run(command, capture_output=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"b\\udce4d.ply: 25 vertices" in done.stdout
    assert {"front.csv", "front.png", "report.html"} <= {path.name for path in (tmp_path / "out").iterdir()}
    assert b"b\\udce4d.ply" in (tmp_path / "out" / "report.html").read_bytes()
    assert len(Front.load(tmp_path / "out")[0].faces) > 0  # the model is found again


@needs_posix
def test_any_name_can_be_shown_in_the_c_locale(tmp_path, roof):
    path = roof.with_name("Gelände 中.ply")
    roof.rename(path)
    environment = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [*SKETCHING, "simplify", os.fsencode(path), "-o", str(tmp_path / "out"), *QUICK]
    done = subprocess.run(command, capture_output=True, env=environment, timeout=120)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "report.html").is_file()


@needs_posix
def test_a_terminal_obeys_no_name(tmp_path, roof, capsys):
    path = roof.with_name("a\x1b[31m\x07.ply")
    roof.rename(path)
    assert main(["simplify", str(path), "-o", str(tmp_path / "out"), *QUICK]) == 0
    assert main(["info", str(path)]) == 0
    assert main(["simplify", str(path) + "\x1b]0;x\x07", *QUICK]) == 2
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err
    assert r"a\x1b[31m\x07.ply" in said.out
    assert "\x1b" not in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_folder_that_looks_like_an_option_is_named_as_a_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["simplify", "roof:5", "--output=-o", *QUICK]) == 0
    hint = capsys.readouterr().out.splitlines()[-1]
    assert hint.startswith("take one of them: meshsimp pick ./-o --triangles ")
    assert main(hint.partition("meshsimp ")[2].split()) == 0


def test_no_cell_of_a_table_is_a_formula():
    table = Table("t", "t", ("name", "x"), (("=1+1", -2.0), ("@SUM(1)", 1), ("-2+3", None), ("plain", -0.5), ("", 0)))
    assert table.csv().splitlines() == ["name,x", "'=1+1,-2.0", "'@SUM(1),1", "'-2+3,", "plain,-0.5", ",0"]


# ------------------------------------------------------------------------------------------------ streams


@needs_posix
@pytest.mark.parametrize(
    ("streams", "code"),
    [*(pytest.param(one, 0, marks=pytest.mark.slow) for one in (">&-", "2>&-")), (">&- 2>&-", 0), (">/dev/full", 2)],
)
def test_results_do_not_depend_on_the_standard_streams(tmp_path, streams, code):
    if "full" in streams and not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full here")
    command = f"exec {shlex.join([*SKETCHING, 'simplify', 'roof:5', '-o', 'out', *QUICK])} {streams}"
    done = subprocess.run(["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "out" / "report.html").is_file()
    if code:
        assert done.stderr.startswith("meshsimp: the results are in place, but cannot be printed (")


# ------------------------------------------------------------------------------------------------ a bare container


@pytest.mark.usefixtures("drawn")
def test_in_a_container_where_nothing_but_the_results_folder_can_be_written(tmp_path, roof):
    """All is read-only but one folder: no home, no temporary files, no cache; closed streams; the C locale."""
    work = tmp_path / "work"
    work.mkdir()
    read_only = 'mount --bind "$0" "$0" && mount -o remount,ro,bind / && cd / && exec "$@"'
    jail = ["unshare", "--user", "--map-root-user", "--mount", "bash", "-c", read_only, str(work)]
    if shutil.which("unshare") is None or subprocess.run([*jail, "true"], capture_output=True).returncode:
        pytest.skip("needs the right to make what is mounted read-only")
    environment = {"PATH": os.environ["PATH"], "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    environment |= {"HOME": "/nowhere", "TMPDIR": "/nowhere"}

    def run(*args, streams=""):
        command = f"exec '{sys.executable}' -m meshsimp_pymoo {shlex.join(map(str, args))} {streams}"
        call = [*jail, "bash", "-c", command]
        return subprocess.run(call, capture_output=True, text=True, env=environment, timeout=120)

    path = roof.with_name("roofs = 1.ply")
    roof.rename(path)
    told = run("info", path, streams="<&-")
    assert (told.returncode, told.stderr) == (0, "")
    assert "usable: an open height field" in told.stdout
    done = run("simplify", path, "-o", work / "out", *QUICK, streams="<&- >&-")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("\n") <= 1, done.stderr
    assert main(["simplify", str(path), "-o", str(tmp_path / "usual"), *QUICK, "--quiet"]) == 0
    for name in ("front.csv", "front.npz", "front.png"):
        assert (work / "out" / name).read_bytes() == (tmp_path / "usual" / name).read_bytes()
    assert (work / "out" / "report.html").is_file()
    assert [entry.name for entry in work.iterdir()] == ["out"]
    assert not [entry for entry in (work / "out").iterdir() if entry.name.startswith(".")]


# ------------------------------------------------------------------------------------------------ signals


@needs_posix
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_while_compiling_is_answered_at_once_and_leaves_nothing(tmp_path, number, code):
    command = [*PROGRAM, "simplify", "roof:5", "-o", str(tmp_path / "out")]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    how = {"stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    with subprocess.Popen(command, env=environment, **how) as process:
        assert process.stderr.readline().startswith("meshsimp: compiling once for this machine")
        time.sleep(0.5)
        process.send_signal(number)
        assert process.stderr.readline() == "meshsimp: stopping\n"
        assert process.stderr.read() == "meshsimp: interrupted; nothing is written\n"
    assert process.returncode == code
    with pytest.raises(ProcessLookupError):  # the second process, which compiles too, has ended
        os.killpg(process.pid, 0)
    assert [entry.name for entry in tmp_path.iterdir()] == ["cache"]


@needs_posix
def test_ctrl_c_while_the_start_is_thinned_hands_over_the_large_meshes_and_some_small_ones(
    tmp_path, monkeypatch, capsys
):
    np.save(tmp_path / "rough.npy", np.random.default_rng(1).random((60, 60)))
    real = starting.thinning

    def interrupted(surface, *, stop, kept=None):
        if kept is not None:
            return real(surface, kept=kept, stop=stop)
        time.sleep(0.1)  # until the main thread waits
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        while not stop[0]:
            time.sleep(0.001)
        return real(surface, least=6_000)

    monkeypatch.setattr(starting, "thinning", interrupted)
    out = tmp_path / "out"
    assert (
        main(["simplify", str(tmp_path / "rough.npy"), "-o", str(out), "--no-page", "--quiet", "--meshes", "9"]) == 130
    )
    said = capsys.readouterr().err
    assert "stopping: the front so far is written next" in said
    assert "of its start" in said
    front = Front.load(out)
    sizes = [solution.triangles for solution in front]
    assert front.run["interrupted"]
    assert front.run["generations"] == 0
    assert sizes[0] == 2
    assert sizes[-1] == 2 * 59 * 59
    assert any(6_000 <= size < sizes[-1] for size in sizes)
    assert sum(2 < size < 6_000 for size in sizes) >= 4


@needs_posix
@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.5, 3.0])
def test_ctrl_c_in_a_search_of_200_000_vertices_is_answered_by_results_within_five_seconds(tmp_path, seconds):
    np.save(tmp_path / "rough.npy", np.random.default_rng(1).random((450, 450)))
    out = tmp_path / "out"
    command = [*PROGRAM, "simplify", str(tmp_path / "rough.npy"), "-o", str(out), "--tile", "none", "--time", "1h"]
    subprocess.run([*command[:-4], "--tile", "none", "--time", "1s", "--overwrite"], check=True)  # compiled
    with subprocess.Popen([*command, "--overwrite"], stderr=subprocess.PIPE, text=True) as process:
        before = (out / "run.json").read_bytes()
        time.sleep(4.0 + seconds)  # in the search
        process.send_signal(signal.SIGINT)
        begun = time.perf_counter()
        while (out / "run.json").read_bytes() == before and process.poll() is None:
            time.sleep(0.05)
        took = time.perf_counter() - begun
        process.communicate()
    assert process.returncode == 130
    assert took < 5.0
    assert len(Front.load(out)) > 5


@needs_posix
@pytest.mark.slow
def test_a_vertex_of_a_large_model_takes_little_memory(tmp_path):
    """What the program has without a model left out; large arrays are 1.2 kB a vertex at most."""
    code = """
import resource, sys
from meshsimp_pymoo import cli
from meshsimp_pymoo.memory import give_back_at_once
give_back_at_once()
code = cli.main(sys.argv[1:])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024, file=sys.stderr)
sys.exit(code)
"""
    peaks = []
    for side in (20, 600):
        name = tmp_path / f"{side}.npy"
        np.save(name, np.random.default_rng(1).random((side, side)))
        how = ["--tile", "none", "--time", "10s", "--meshes", "5", "--quiet", "-o", str(tmp_path / str(side))]
        done = subprocess.run([sys.executable, "-c", code, "simplify", str(name), *how], capture_output=True, text=True)
        assert done.returncode == 0
        peaks.append(int(done.stderr.split()[-1]))
    assert peaks[1] - peaks[0] < 1200 * 600**2


@pytest.mark.parametrize("interrupted", [False, True])
def test_what_a_signal_stops_halfway_in_a_library_says_nothing(interrupted):
    """Libraries free in ``__del__`` what they had not made whole yet; that a search is interrupted is said already."""
    code = f"""
import signal, sys
from meshsimp_pymoo import cli

class Half:
    def __del__(self):
        raise AttributeError("no such part")

def main(argv=None, half=None):
    with cli.interruptible():
        if {interrupted}:
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                pass
    kept.append(Half())
    return 130

kept = []
cli.main = main
cli.program()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 130
    assert ("no such part" in done.stderr) is not interrupted


@needs_posix
@pytest.mark.parametrize(
    ("number", "code"), [pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow), (signal.SIGINT, 130)]
)
def test_a_signal_ends_a_search_with_the_front_so_far(tmp_path, number, code):
    command = [*PROGRAM, "simplify", "jacksboro:20", "--time", "10min", "--threads", "1", "--json"]
    command += ["--checkpoint", "0.2s", "--no-page", "-o", str(tmp_path / "out")]
    deadline = time.monotonic() + 60
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        while not (tmp_path / "out" / CHECKPOINT).exists():
            assert time.monotonic() < deadline
            time.sleep(0.02)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    assert err.startswith("meshsimp: stopping: the front so far is written next\nmeshsimp: interrupted after ")
    assert json.loads(out)["solutions"] == len(read_front(tmp_path / "out").F) > 10
    assert json.loads((tmp_path / "out" / "run.json").read_text())["interrupted"]


# ------------------------------------------------------------------------------------------------ numbers


def test_no_error_is_negative_on_grids_of_whole_numbers_with_holes(tmp_path):
    rng = np.random.default_rng(7)
    for _ in range(12):
        heights = rng.integers(0, 40, rng.integers(4, 14, 2)).astype(float)
        heights[: rng.integers(1, 3), : rng.integers(1, 3)] = np.nan
        np.save(tmp_path / "grid.npy", heights)
        problem = MeshProblem(tmp_path / "grid.npy", outside=("nearest", "ignore")[int(rng.integers(2))])
        surface = problem.surface
        for front in (thinning(surface), greedy_insertion(surface)):
            assert (front.error >= 0).all()
        live = LiveTriangulation(surface, np.ones(problem.n_var, bool))
        for vertex in rng.permutation(np.flatnonzero(~problem.pinned))[:10]:
            live.remove(int(vertex))
            live.insert(int(vertex))
            assert live.error >= 0


def test_weights_whose_total_is_no_number_are_refused_before_the_search():
    with pytest.raises(ModelError, match=r"weights add up to 9e\+307, beyond 1e\+100; divide them all by one number"):
        MeshProblem("roof:3", weights=np.full(9, 1e307))


@pytest.mark.parametrize(
    ("name", "way_out"),
    [
        ("cloud.xyz", "take one class of points (--classes 2), or thin the cloud before (PDAL: filters.sample)"),
        ("grid.npy", "take tiles (--tile 256), or a part of it (--window COLUMN,ROW,COLUMNS,ROWS)"),
        ("mesh.ply", "take a part of it, or free some"),
    ],
)
def test_a_model_whose_search_does_not_fit_is_refused_with_the_number_that_does(
    tmp_path, monkeypatch, capsys, name, way_out
):
    heights = np.random.default_rng(1).normal(size=(10, 12))
    points = np.column_stack([np.arange(120) % 12, np.arange(120) // 12, heights.ravel()])
    path = tmp_path / name
    if name == "grid.npy":
        np.save(path, heights)
    elif name == "cloud.xyz":
        np.savetxt(path, points)
    else:
        write_mesh(path, points, grid_source(heights).faces)
    monkeypatch.setattr(memory, "free_memory", lambda: (float("inf"), 100.0 * memory.VERTEX_BYTES))
    monkeypatch.setattr(tiling, "fits_in_one_piece", lambda _: True)
    assert main(["simplify", str(path), "-o", str(tmp_path / "out"), "--quiet"]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said == (
        f"meshsimp: {path}: a search of 120 vertices in one piece does not fit into memory: it takes about 0 MiB, and "
        f"0 MiB are free, enough for some 100; {way_out}"
    )
    assert not (tmp_path / "out").exists()

"""Bad days of ``meshsimp simplify`` and ``meshsimp run``: whatever breaks, what was there stays, and a rerun completes.

================================== =====================================================================================
what happens                       what follows
================================== =====================================================================================
killed at random moments           the same command goes on, to the same bytes (simplify, run)
killed while results are written   the same command goes on from the end of the search; nothing is left besides
killed while they are drawn        the results are in place; the same command draws what is missing
SIGTERM, Ctrl-C at random moments  answered at once; the same command ends with the same bytes; no process is left
disk full                          one warning, the search goes on; where results do not fit: one line, exit code 2, the
                                   checkpoint stays, the same command completes
folder gone in mid-run             it is made again
folder replaced, or not writable   one line, exit code 2; the rerun completes
checkpoint damaged                 simplify: one line, exit code 2, ``--overwrite`` begins anew; run: a warning, that
                                   search begins anew
memory limit hit                   one line, exit code 2
Ctrl-C                             the front so far, whole; no checkpoint left
================================== =====================================================================================
"""

from __future__ import annotations

import contextlib
import json
import random
import re
import resource
import select
import shutil
import signal
import subprocess
import sys
import time
import weakref
from itertools import cycle, islice
from pathlib import Path

import numpy as np
import pytest
from counts import tried
from pymoo.algorithms.moo.nsga2 import NSGA2
from samples import freed

from meshsimp_pymoo.cli import main
from meshsimp_pymoo.cli.terminal import answering, interrupted_code, interruptible, is_interrupted
from meshsimp_pymoo.comparison import runner
from meshsimp_pymoo.comparison.config import read_experiment_file
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.files import locked, put_back
from meshsimp_pymoo.opening import open_grid
from meshsimp_pymoo.search import checkpoint
from meshsimp_pymoo.search.targeted import TargetedSearch
from meshsimp_pymoo.storage import CHECKPOINT, PICTURES, read_front
from meshsimp_pymoo.surface.model import build_model

sys.path.insert(0, str(Path(__file__).parent))
from forker import Forker

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and limits"),
    pytest.mark.usefixtures("sketched"),
]

SEARCH = ("face:150", "--algorithm", "nsga2_v1", "--population", "20", "--threads", "1")
PLAIN = ("--quiet", "--no-page", "--meshes", "none")
BUDGET = ("--evaluations", "400")
OFTEN = ("--checkpoint", "0.0001s")
CONFIG = """
problems: [{name: Face, model: "face:150"}]
algorithms:
  - {name: N1, preset: nsga2_v1, parameters: {pop_size: 20}}
  - {name: M, preset: moead, parameters: {pop_size: 20}}
seeds: [1, 2]
budgets: [{generations: 4}, {generations: 20}]
"""
# one budget: half of the report
SMALL = CONFIG.replace("{generations: 4}, ", "")


class Killed(BaseException):
    """Ends a process as SIGKILL does, as far as the code under test can tell: it is caught nowhere."""


def run(*args):
    return main([str(arg) for arg in args])


def simplify(out, *options):
    return run("simplify", *SEARCH, *PLAIN, *(BUDGET if "--evaluations" not in options else ()), "-o", out, *options)


def reproducible(folder):
    """Return what must be the same bytes."""
    return {name: (folder / name).read_bytes() for name in ("front.csv", "front.npz", "front.png")}


def one_line(capsys):
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert err.startswith("meshsimp: ")
    return err


def with_free_meshes(monkeypatch, number):
    """Let NSGA-II have free meshes beside some solutions of that generation, as long as these live."""
    set_optimum = NSGA2._set_optimum

    def and_free(self):
        set_optimum(self)
        if self.n_iter == number:
            for one in self.opt[np.argsort(self.opt.get("F")[:, 1])[1:6]]:
                one.set("free", freed(self.problem.surface, one.X))

    monkeypatch.setattr(NSGA2, "_set_optimum", and_free)


def at_generation(monkeypatch, number, act):
    """Let something happen before a generation of NSGA-II, once."""
    step, done = NSGA2.next, []

    def next_with_fault(self):
        done.append(1)
        if len(done) == number:
            act()
        step(self)

    monkeypatch.setattr(NSGA2, "next", next_with_fault)


def stop(kind):
    def act():
        raise kind

    return act


def stopped(out, monkeypatch, generation=6, *options):
    """Leave the folder of a search that was killed."""
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        at_generation(patch, generation, stop(Killed))
        with pytest.raises(Killed):
            simplify(out, *OFTEN, *options)
    assert CHECKPOINT in {entry.name for entry in out.iterdir()}
    return out


@contextlib.contextmanager
def small_files(size):
    """Let no file become longer than this: what a full disk does to whoever writes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the results of a search that nothing disturbed."""
    out = tmp_path_factory.mktemp("whole") / "out"
    assert simplify(out, "--checkpoint", "none") == 0
    return reproducible(out)


@pytest.fixture(scope="module")
def forker():
    server = Forker()
    yield server
    server.close()


@pytest.fixture(scope="module")
def whole_drawn(tmp_path_factory, forker):
    """Return the same results with the picture that another process draws."""
    out = tmp_path_factory.mktemp("drawn") / "out"
    assert forker.run("simplify", *SEARCH, *PLAIN, *BUDGET, "--checkpoint", "none", "-o", out).code == 0
    return reproducible(out)


# ----------------------------------------------------------------------------------------------------- killed: simplify


def test_a_killed_search_goes_on_and_says_so(tmp_path, whole, monkeypatch, capsys):
    out = stopped(tmp_path / "out", monkeypatch)
    begun = []
    step = NSGA2._initialize_infill
    monkeypatch.setattr(NSGA2, "_initialize_infill", lambda self: begun.append(1) or step(self))
    assert run("simplify", *SEARCH, *BUDGET, "-o", out, "--no-page", "--meshes", "none") == 0
    said = r"out holds a search that was stopped after 5 generations, 100 evaluations, \d+ s; going on"
    assert re.search(said, one_line(capsys))
    assert begun == []
    assert reproducible(out) == whole
    assert sorted(entry.name for entry in out.iterdir()) == ["front.csv", "front.npz", "front.png", "run.json"]
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]
    assert "checkpoint" not in json.loads((out / "run.json").read_text())["settings"]


@pytest.mark.parametrize("algorithm", ["memetic", "moead", "nsga2_v2"])
def test_a_killed_search_of_every_preset_ends_with_the_same_bytes(tmp_path, monkeypatch, algorithm):
    from meshsimp_pymoo.search.presets import PRESETS

    kind = type(PRESETS[algorithm].function(pop_size=8))
    options = ("simplify", "face:60", "--algorithm", algorithm, "--population", "8", "--generations", "5", *PLAIN)
    assert run(*options, "-o", tmp_path / "whole") == 0
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        step, done = kind.next, []

        def next_or_die(self):
            done.append(1)
            if len(done) == 4:
                raise Killed
            step(self)

        patch.setattr(kind, "next", next_or_die)
        with pytest.raises(Killed):
            run(*options, *OFTEN, "-o", tmp_path / "out")
    assert run(*options, "-o", tmp_path / "out") == 0
    assert reproducible(tmp_path / "out") == reproducible(tmp_path / "whole")


@tried("most", 3)
def test_kills_at_random_moments_change_no_byte(tmp_path, forker, most):
    options = ("simplify", "face:200", "--algorithm", "nsga2_v1", "--population", "20", "--evaluations", "3000", *PLAIN)
    options += ("--threads", "1", "--checkpoint", "0.02s")
    undisturbed = forker.run(*options, "-o", tmp_path / "whole")
    assert undisturbed.code == 0, undisturbed.stderr
    out, kills, continued = tmp_path / "out", 0, 0
    moments = random.Random(6)
    while kills < most:
        found = (out / CHECKPOINT).exists() or (out / "front.csv").exists()
        ended = forker.run(*options, "-o", out, kill_after=moments.uniform(0.03, 0.6) * undisturbed.seconds)
        assert ended.code in (0, -9), ended.stderr
        kills += ended.code == -9
        continued += found
        if ended.code == 0 or (out / "front.png").exists():  # it was quicker, at least with all that it writes
            assert reproducible(out) == reproducible(tmp_path / "whole")
            shutil.rmtree(out)
    last = forker.run(*options, "-o", out)
    assert last.code == 0, last.stderr
    assert continued >= most // 3
    assert reproducible(out) == reproducible(tmp_path / "whole")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out", "whole"]


@pytest.mark.parametrize("place", ["report.figures.front_figure", "files._put_in_place", "files._flush"])
def test_killed_while_the_results_are_written(tmp_path, forker, whole_drawn, monkeypatch, place):
    out = stopped(tmp_path / "out", monkeypatch)
    options = ("simplify", *SEARCH, *PLAIN, *BUDGET, "-o", out)
    dead = forker.run(*options, die_in=f"meshsimp_pymoo.{place}")
    assert dead.code == -9, dead.stderr
    assert (out / "front.csv").exists() == ("figure" in place)  # results come before pictures
    assert (out / CHECKPOINT).exists() != ("figure" in place)
    assert forker.run(*options).code == 0
    assert reproducible(out) == whole_drawn
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("results", [False, True])
def test_killed_between_moving_the_old_folder_away_and_the_new_one_in(tmp_path, whole, monkeypatch, results):
    out = tmp_path / "out"
    if results:
        assert simplify(out, "--seed", "2") == 0
    options = ("--overwrite",) if results else ()
    stopped(out, monkeypatch, 6, *options)
    out.rename(tmp_path / ".out.0123abcd.old")
    (tmp_path / ".out.0123abcd.partial").mkdir()
    assert simplify(out, *options) == 0
    assert reproducible(out) == whole
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


def test_free_meshes_found_before_a_kill_are_in_the_front_of_the_search_that_goes_on(tmp_path, monkeypatch):
    with_free_meshes(monkeypatch, 18)
    assert simplify(tmp_path / "undisturbed") == 0
    assert simplify(stopped(tmp_path / "out", monkeypatch, 19)) == 0
    assert reproducible(tmp_path / "out") == reproducible(tmp_path / "undisturbed")
    assert read_front(tmp_path / "out").quality["free"].any()


def test_a_folder_that_is_there_is_not_replaced_by_what_stands_aside(tmp_path):
    for name in ("out", ".out.0123abcd.old", ".out.0123abcd.partial"):
        (tmp_path / name).mkdir()
    put_back(tmp_path / "out")
    assert len(list(tmp_path.iterdir())) == 3


def test_old_results_stay_until_the_new_ones_are_there(tmp_path, whole, monkeypatch, capsys):
    out = tmp_path / "out"
    assert simplify(out, "--seed", "2") == 0
    old = reproducible(out)
    stopped(out, monkeypatch, 6, "--overwrite")
    assert reproducible(out) == old
    assert len(read_front(out).F) > 1
    capsys.readouterr()
    assert simplify(out) == 2
    assert "exists already" in one_line(capsys)
    assert simplify(out, "--overwrite") == 0
    assert reproducible(out) == whole


def test_a_search_with_other_settings_does_not_go_on_from_it(tmp_path, whole, monkeypatch, capsys):
    out = stopped(tmp_path / "out", monkeypatch)
    before = (out / CHECKPOINT).read_bytes()
    for options, words in [
        (("--seed", "7"), "seed 1, not 7"),
        (("--evaluations", "500"), "evaluations 400, not 500"),
        (("--pin", "3"), "pin None, not [3]"),
        (("--footprint", "hull"), "footprint model, not hull"),
    ]:
        assert simplify(out, *options) == 2
        said = one_line(capsys)
        assert f"belongs to another search ({words}" in said
        assert "--overwrite" in said
    assert run("simplify", "peaks:9", *SEARCH[1:], *PLAIN, *BUDGET, "-o", out) == 2
    assert "another search (model" in one_line(capsys)
    assert (out / CHECKPOINT).read_bytes() == before
    assert simplify(out, "--seed", "7", "--overwrite") == 0
    assert reproducible(out) != whole
    assert simplify(stopped(tmp_path / "b", monkeypatch), "--threads", "2", "--format", "obj") == 0
    assert reproducible(tmp_path / "b") == whole


def test_a_search_with_other_break_lines_says_which(tmp_path, monkeypatch, capsys):
    lines = ("--break-lines", "outline")
    out = stopped(tmp_path / "out", monkeypatch, 3, *lines)
    capsys.readouterr()
    for options, words in [
        ((), "break_lines outline, not None"),
        ((*lines, "--line-tolerance", "2"), "line_tolerance"),
    ]:
        assert simplify(out, *options) == 2
        assert f"belongs to another search ({words}" in one_line(capsys)
    assert simplify(out, *lines) == 0


def test_a_search_for_a_wish_goes_on_to_the_same_bytes_and_for_another_one_not(tmp_path, monkeypatch, capsys):
    def search(out, *options):
        return run("simplify", "jacksboro:20", "--moves", "4000", *PLAIN, *OFTEN, *options, "-o", out)

    wish = ("--max-error", "40", "--mean-error", "9")
    assert search(tmp_path / "whole", *wish) == 0
    step, count = TargetedSearch.next, []
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        patch.setattr(
            TargetedSearch, "next", lambda self: stop(Killed)() if len(count) == 3 else (count.append(1), step(self))
        )
        with pytest.raises(Killed):
            search(tmp_path / "out", *wish)
    assert (tmp_path / "out" / CHECKPOINT).exists()
    capsys.readouterr()
    assert search(tmp_path / "out", "--max-error", "41", "--mean-error", "9") == 2
    assert "belongs to another search (max_error 40.0, not 41.0)" in one_line(capsys)
    assert search(tmp_path / "out", *wish) == 0
    assert reproducible(tmp_path / "out") == reproducible(tmp_path / "whole")


def test_without_checkpoints_none_is_written_or_used(tmp_path, whole, monkeypatch, capsys):
    with monkeypatch.context() as patch:
        at_generation(patch, 6, stop(Killed))
        with pytest.raises(Killed):
            simplify(tmp_path / "out", "--checkpoint", "none")
    assert list(tmp_path.iterdir()) == []
    out = stopped(tmp_path / "out", monkeypatch)
    assert simplify(out, "--checkpoint", "none") == 2
    assert "exists already" in one_line(capsys)


def test_two_processes_do_not_share_a_folder(tmp_path, monkeypatch, capsys):
    out = stopped(tmp_path / "out", monkeypatch)
    with locked(out):
        assert simplify(out) == 2
    assert "another process is at work there" in one_line(capsys)
    assert (out / CHECKPOINT).exists()


def test_ctrl_c_leaves_the_front_so_far_and_no_checkpoint(tmp_path, monkeypatch, capsys):
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        at_generation(patch, 6, stop(KeyboardInterrupt))
        assert simplify(tmp_path / "out", *OFTEN) == 130
    assert "interrupted after 5 generations" in one_line(capsys)
    assert read_front(tmp_path / "out").run["interrupted"] is True
    assert sorted(e.name for e in (tmp_path / "out").iterdir()) == ["front.csv", "front.npz", "front.png", "run.json"]


def test_ctrl_c_while_writing_keeps_the_search(tmp_path, whole, monkeypatch, capsys):
    out = stopped(tmp_path / "out", monkeypatch)
    with monkeypatch.context() as patch:
        patch.setattr("meshsimp_pymoo.files._put_in_place", lambda *_: stop(KeyboardInterrupt)())
        assert simplify(out) == 130
    assert "the same command goes on from the checkpoint" in one_line(capsys)
    assert simplify(out) == 0
    assert reproducible(out) == whole


# ------------------------------------------------------------------------------------------------ signals at any moment

GRID = ("--tile", "64", "--triangles", "200", "--meshes", "2", "--jobs", "1", "--threads", "1", "--quiet")
ENDINGS = {
    "terminated": [signal.SIGTERM],
    "interrupted": [signal.SIGINT],
    "interrupted twice": [signal.SIGINT, signal.SIGINT],
    "killed": [signal.SIGKILL],
}


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    """Return what is done at random moments, each small, by name: the arguments but for the folder."""
    folder = tmp_path_factory.mktemp("models")
    heights = open_grid(build_model(load("jacksboro:2"))).heights[:20, :100].astype(np.float32)
    np.save(folder / "relief.npy", heights)
    (folder / "tiny.yaml").write_text(SMALL.replace("seeds: [1, 2]", "seeds: [1]"), encoding="utf-8")
    often = ("--checkpoint", "0.02s")
    return {
        "simplify": ("simplify", *SEARCH, *PLAIN, "--evaluations", "2000", *often),
        "tiles": ("simplify", folder / "relief.npy", *GRID),
        "run": ("run", folder / "tiny.yaml", "--quiet", "--jobs", "1", *often),
    }


def same_bytes(folder):
    """Return what does not depend on the time that anything took."""
    found = {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}
    varies = ("run.json", "times.csv", "times.md", "report.html", "convergence_seconds.png")
    kept = {name: path.read_bytes() for name, path in found.items() if path.name not in varies}
    for name in [name for name in kept if name.startswith("runs/") and name.endswith(".json")]:
        record = json.loads(kept[name])
        kept[name] = tuple(record[key] for key in ("generations", "evaluations", "arrays_sha256", "description"))
    return kept


@tried("trials", 4)
@pytest.mark.parametrize("name", ["simplify", "tiles", "run"])
def test_signals_at_random_moments_change_no_byte_and_leave_nothing(tmp_path, forker, commands, name, trials):
    command, moments = commands[name], random.Random(13)
    whole, out = tmp_path / "whole", tmp_path / "out"
    how = {"drawn": trials > len(ENDINGS)}
    undisturbed = forker.run(*command, "-o", whole, **how)
    assert undisturbed.code == 0, undisturbed.stderr
    for kind in islice(cycle(ENDINGS), trials):
        moment = moments.uniform(0.0, 1.0) * undisturbed.seconds
        signals = [(moment + moments.uniform(0.0, 0.2) * k, number) for k, number in enumerate(ENDINGS[kind])]
        before = {entry.name for entry in tmp_path.iterdir()}  # what was killed may have left something
        ended = forker.run(*command, "-o", out, signals=signals, **how)
        expected = {"killed": -9, "terminated": 143}.get(kind, 130)
        assert ended.code in (0, expected, -signals[0][1]), (kind, ended)  # it may be over, or not have begun
        assert "Traceback" not in ended.stderr
        assert ended.left == 0
        if kind != "killed":
            assert {entry.name for entry in tmp_path.iterdir()} <= {"out", *before}
        if name == "simplify" and (out / "run.json").exists() and kind != "killed":
            if read_front(out).run["interrupted"]:  # a front so far: whole, of another budget
                assert ended.code != 0
                shutil.rmtree(out)
            else:  # interrupted while it was drawn, if at all; an earlier call may have been killed while it drew
                shown = {entry: found for entry, found in same_bytes(out).items() if not entry.startswith(".")}
                assert shown.items() <= same_bytes(whole).items()
        # all may be done before the signal was heard; then the folder is whole, and no other call begins in it
        drawn = [picture for picture in PICTURES if (whole / picture).exists()]
        is_whole = name != "run" and ended.code != 2 and all((out / picture).exists() for picture in drawn)
        if ended.code == 0 or is_whole:
            assert same_bytes(out) == same_bytes(whole)
            shutil.rmtree(out)
    last = forker.run(*command, "-o", out, **how)
    assert last.code == 0, last.stderr
    assert same_bytes(out) == same_bytes(whole)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out", "whole"]


@pytest.mark.parametrize("kind", ["terminated", "killed"])
def test_an_experiment_that_is_ended_leaves_no_process(tmp_path, forker, kind):
    config = tmp_path / "long.yaml"
    config.write_text(CONFIG.replace("generations: 20", "generations: 20000"), encoding="utf-8")
    command = ("run", config, "--quiet", "--jobs", "2")
    ended = forker.run(*command, "-o", tmp_path / "out", signals=[(2.0, number) for number in ENDINGS[kind]])
    assert ended.code == {"terminated": 143, "killed": -9}[kind], ended.stderr
    assert ended.left == 0
    if kind == "terminated":
        assert ended.stderr.startswith("meshsimp: stopping")


@pytest.mark.parametrize("name", ["simplify", "tiles"])
def test_a_second_search_for_a_folder_is_refused_before_it_begins(tmp_path, commands, capsys, monkeypatch, name):
    monkeypatch.setattr("meshsimp_pymoo.cli.searching.MeshProblem", None)
    monkeypatch.setattr("meshsimp_pymoo.cli.tiling.open_grid", None)
    with locked(tmp_path / "deep" / "out"):
        assert run(*commands[name], "-o", tmp_path / "deep" / "out") == 2
    said = one_line(capsys)
    assert "out: another process is at work there; wait for it or name another folder" in said
    assert list(tmp_path.iterdir()) == []


def test_the_root_of_all_folders_is_refused_in_a_line(tmp_path, commands, capsys):
    for command in commands.values():
        assert run(*command, "-o", tmp_path.root) == 2
        assert one_line(capsys).startswith("meshsimp: /: ")


def test_a_signal_is_answered_while_a_kernel_runs(tmp_path):
    """The word comes at once, from another thread; what it asks for comes when the kernel is done."""
    code = """if True:
        import os, signal, threading, time
        import numba
        import numpy as np
        from meshsimp_pymoo.cli.terminal import answering, interruptible
        from meshsimp_pymoo.compiling.functions import OPTIONS

        @numba.njit(**OPTIONS)
        def kernel(number, state):
            for k in range(number):
                state[0] = (state[0] * 6364136223846793005 + k) % 1000003
        kernel(1, np.ones(1, np.int64))
        state = np.ones(1, np.int64)
        try:
            with interruptible(), answering("stopping soon"):
                threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGTERM)).start()
                kernel(200_000_000, state)
                time.sleep(0)
        except KeyboardInterrupt:
            print("stopped", flush=True)
    """
    call = [sys.executable, "-c", code]
    with subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        assert process.stderr.readline() == "meshsimp: stopping soon\n"
        assert select.select([process.stdout], [], [], 0.0)[0] == []  # the kernel is still at work
        assert process.stdout.readline() == "stopped\n"


def test_a_signal_that_meets_a_place_that_can_raise_nothing_is_raised_after_it(capsys):
    class Thing:
        pass

    thing = Thing()
    _held = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
    with interruptible():
        del thing
        with pytest.raises(KeyboardInterrupt):
            time.sleep(20.0)
        assert interrupted_code() == 130
    assert capsys.readouterr().err == "meshsimp: stopping\n"


def test_signals_are_answered_in_turn_and_the_last_answer_stops(monkeypatch):
    # a shell starts what runs behind with Ctrl-C ignored
    monkeypatch.setattr(signal, "default_int_handler", signal.getsignal(signal.SIGINT))
    with interruptible():
        with answering("first", "second", "stop"):
            for _ in range(2):
                signal.raise_signal(signal.SIGINT)
            assert is_interrupted()
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGTERM)  # what ends can end
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
        assert not is_interrupted()
        assert interrupted_code() == 130
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_signal_gets_the_word_of_the_part_that_it_stops_though_that_is_past(capsys):
    with interruptible(), answering("first", "second", "third"):
        for _ in range(20):
            with pytest.raises(KeyboardInterrupt), answering("stopping the part"):
                signal.raise_signal(signal.SIGINT)
    assert capsys.readouterr().err == 20 * "meshsimp: stopping the part\n"


def test_a_signal_that_a_library_has_swallowed_is_raised_where_the_next_part_begins():
    with interruptible(), answering("first", "second"):
        signal.raise_signal(signal.SIGINT)  # only answered
        with answering("stopping"):
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            with pytest.raises(KeyboardInterrupt), answering("too late"):
                raise AssertionError("the part was begun")
        with answering("another part"):
            assert not is_interrupted()


# -------------------------------------------------------------------------------------------- disk and folder: simplify


def test_disk_full_in_mid_search_is_a_warning_and_the_search_goes_on(tmp_path, whole, monkeypatch, capsys):
    monkeypatch.setattr(checkpoint, "PAUSE", 0.0)
    out = tmp_path / "out"
    limits = contextlib.ExitStack()
    at_generation(monkeypatch, 3, lambda: limits.enter_context(small_files(2000)))
    end = NSGA2.finalize
    monkeypatch.setattr(NSGA2, "finalize", lambda self: limits.close() or end(self))
    with limits:
        assert simplify(out, *OFTEN) == 0
    said = one_line(capsys)
    assert f"warning: {out / CHECKPOINT}: cannot be written (File too large); the search goes on" in said
    assert reproducible(out) == whole


def test_disk_full_while_writing_is_one_line_and_the_rerun_completes(tmp_path, whole, monkeypatch, capsys):
    out = stopped(tmp_path / "out", monkeypatch)

    def full(*_, **__):
        raise OSError(27, "File too large")

    with monkeypatch.context() as patched:
        patched.setattr("meshsimp_pymoo.storage.write_npz", full)
        assert simplify(out) == 2
    said = one_line(capsys)
    assert "out: cannot be written (File too large); make room" in said
    assert "the same command goes on from the checkpoint" in said
    assert [entry.name for entry in out.iterdir()] == [CHECKPOINT]
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]
    assert simplify(out) == 0
    assert reproducible(out) == whole


@pytest.mark.usefixtures("drawn")
def test_disk_full_while_drawing_costs_the_picture_alone(tmp_path, monkeypatch, capsys):
    out = stopped(tmp_path / "out", monkeypatch)
    capsys.readouterr()
    with small_files(20_000):  # all fits but the figure
        assert simplify(out) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("meshsimp: warning: front.png could not be made (File too large); ")
    assert not (out / "front.png").exists()
    assert len(read_front(out).F) > 1


@pytest.fixture
def small_disk(tmp_path):
    """Return a folder on a file system of 64 KiB; only who may mount can have one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = shutil.which("mount")
    command = [mount or "mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    if mount is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("no file system can be mounted here; the same is simulated by a limit on the size of files")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_really_full_disk(small_disk, whole, monkeypatch, capsys):
    out = stopped(small_disk / "out", monkeypatch)
    room = shutil.disk_usage(small_disk).free - (8 << 10)
    (small_disk / "film.avi").write_bytes(bytes(room))
    assert simplify(out) == 2  # numbers and meshes do not fit
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2  # the last checkpoint does not fit either: the one before stays
    assert "checkpoint.npz: cannot be written (No space left on device); the search goes on" in lines[0]
    assert "out: cannot be written (No space left on device); make room" in lines[1]
    assert sorted(entry.name for entry in small_disk.iterdir()) == ["film.avi", "out"]
    moved = small_disk.parent / "out"
    shutil.copytree(out, moved)
    assert simplify(moved) == 0
    assert reproducible(moved) == whole


def test_a_folder_that_vanishes_in_mid_run_is_made_again(tmp_path, whole, monkeypatch, capsys):
    monkeypatch.setattr(checkpoint, "PAUSE", 0.0)
    out = tmp_path / "deep" / "out"
    at_generation(monkeypatch, 6, lambda: shutil.rmtree(tmp_path / "deep"))
    assert simplify(out, *OFTEN) == 0
    assert capsys.readouterr().err == ""
    assert reproducible(out) == whole


@pytest.mark.parametrize("which", ["out", "parent"])
def test_a_folder_replaced_by_a_file_is_one_line_and_the_rerun_completes(tmp_path, whole, monkeypatch, capsys, which):
    out = tmp_path / "deep" / "out"
    target = out if which == "out" else out.parent

    def replaced():
        shutil.rmtree(target)
        target.write_text("not yours")

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        at_generation(patch, 6, replaced)
        assert simplify(out, *OFTEN) == 2
    err = capsys.readouterr().err
    assert "Traceback" not in err
    assert err.splitlines()[0].startswith(f"meshsimp: warning: {out / CHECKPOINT}: cannot be written (")
    assert err.splitlines()[-1].startswith(f"meshsimp: {out}: ")
    assert target.read_text() == "not yours"
    target.unlink()
    assert simplify(out) == 0
    assert reproducible(out) == whole


def test_a_folder_that_turns_read_only_keeps_the_checkpoint_that_it_has(tmp_path, whole, monkeypatch, capsys):
    """As root nothing is read-only, so the system's answer is given in its place."""
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        write, make = Path.write_bytes, Path.mkdir
        read_only = []

        def refused(self):
            if read_only and tmp_path in self.parents:
                raise OSError(30, "Read-only file system", str(self))

        patch.setattr(Path, "write_bytes", lambda self, content: refused(self) or write(self, content))
        patch.setattr(Path, "mkdir", lambda self, *args, **kwargs: refused(self) or make(self, *args, **kwargs))
        at_generation(patch, 6, lambda: read_only.append(1))
        assert simplify(out, *OFTEN) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert lines[0].endswith("cannot be written (Read-only file system); the search goes on without a checkpoint")
    assert "(Read-only file system)" in lines[1]
    assert simplify(out) == 0
    assert reproducible(out) == whole


# ----------------------------------------------------------------------------------------- damaged checkpoint: simplify


def truncated(path):
    path.write_bytes(path.read_bytes()[:-200])


def flipped(path):
    content = bytearray(path.read_bytes())
    content[content.index(b"PCG64")] ^= 4
    path.write_bytes(content)


def foreign(path):
    np.savez(path, state=np.array([{"a": 1}], dtype=object))


def emptied(path):
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [truncated, flipped, foreign, emptied])
def test_a_damaged_checkpoint_stops_the_command_and_is_replaced_only_when_asked(
    tmp_path, whole, monkeypatch, capsys, damage
):
    out = stopped(tmp_path / "out", monkeypatch)
    damage(out / CHECKPOINT)
    before = (out / CHECKPOINT).read_bytes()
    assert simplify(out) == 2
    said = one_line(capsys)
    assert f"{out / CHECKPOINT}: is no checkpoint, or a damaged one (" in said
    assert "allow overwriting (--overwrite) to begin anew" in said
    assert (out / CHECKPOINT).read_bytes() == before
    assert simplify(out, "--overwrite") == 0
    assert capsys.readouterr().err == ""
    assert reproducible(out) == whole


# ----------------------------------------------------------------------------------------------------- memory: simplify


@pytest.mark.parametrize("algorithm", ["nsga2_v1", "memetic"])
def test_a_memory_limit_is_one_line(tmp_path, forker, algorithm):
    options = ("simplify", "jacksboro:4", "--population", "200000", "--algorithm", algorithm, *PLAIN)
    ended = forker.run(*options, "-o", tmp_path / "out", memory=300 << 20)
    assert ended.code == 2, ended.stderr
    assert ended.stderr.count("\n") == 1
    assert "does not fit into memory" in ended.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_thread_that_cannot_be_started_is_a_memory_limit_too(tmp_path, monkeypatch, capsys):
    def no_thread(*_):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("threading.Thread.start", no_thread)
    monkeypatch.setattr("meshsimp_pymoo.workers._executors", {})
    assert run("simplify", "face:150", "--population", "20", *PLAIN, "-o", tmp_path / "out") == 2
    assert "does not fit into memory" in one_line(capsys)


def test_a_memory_limit_in_mid_search_keeps_the_checkpoint(tmp_path, whole, monkeypatch, capsys):
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        at_generation(patch, 6, stop(MemoryError))
        assert simplify(out, *OFTEN) == 2
    assert "does not fit into memory" in one_line(capsys)
    assert simplify(out) == 0
    assert reproducible(out) == whole


# ------------------------------------------------------------------------------------------------------------------ run


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(CONFIG, encoding="utf-8")
    return path


def read(config):
    """Return what is to be done: reading it tries each algorithm out, which is not to be counted."""
    return read_experiment_file(config)


def experiment(config, out, **kwargs):
    return runner.run_experiment(config, out, **{"checkpoint": 0.0} | kwargs)


def runs(out):
    """Return the arrays of all runs, which must be the same bytes, and their counts."""
    found = {path.name: path.read_bytes() for path in sorted((out / "runs").glob("*.npz"))}
    for path in sorted((out / "runs").glob("*.json")):
        record = json.loads(path.read_text())
        found[path.name] = (record["generations"], record["evaluations"])
    assert [entry.name for entry in out.iterdir() if entry.name.startswith(".")] in ([".lock"], [])
    return found


@pytest.fixture(scope="module")
def all_runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("experiment")
    (folder / "tiny.yaml").write_text(CONFIG, encoding="utf-8")
    experiment(folder / "tiny.yaml", folder / "out", checkpoint=None)
    found = runs(folder / "out")
    assert len(found) == 2 * 8
    return found


def stopped_run(config, out, monkeypatch, generation):
    config = read(config)
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        at_generation(patch, generation, stop(Killed))
        with pytest.raises(Killed):
            experiment(config, out)
    (saved,) = (out / runner.CHECKPOINTS).glob("*.npz")
    return saved


@pytest.mark.parametrize("generation", [3, 12, 20])
def test_a_killed_run_goes_on_within_the_run(config, tmp_path, all_runs, monkeypatch, generation):
    out = tmp_path / "out"
    stopped_run(config, out, monkeypatch, generation)
    config, done = read(config), []
    step = NSGA2.next
    monkeypatch.setattr(NSGA2, "next", lambda self: done.append(1) or step(self))
    experiment(config, out)
    assert runs(out) == all_runs
    assert len(done) == 2 * 20 - (generation - 1)  # two seeds of twenty generations each, but for those done before


def test_killed_runs_of_moead_go_on_too(config, tmp_path, all_runs, monkeypatch):
    from meshsimp_pymoo.search.moead import TchebycheffMOEAD

    begin, count = TchebycheffMOEAD._begin_generation, []
    config = read(config)

    def begin_or_die(self):
        count.append(1)
        if len(count) == 10:
            raise Killed
        begin(self)

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        patch.setattr(TchebycheffMOEAD, "_begin_generation", begin_or_die)
        with pytest.raises(Killed):
            experiment(config, tmp_path / "out")
    begun = len(count)
    monkeypatch.setattr(TchebycheffMOEAD, "_begin_generation", lambda self: count.append(1) or begin(self))
    experiment(config, tmp_path / "out")
    assert runs(tmp_path / "out") == all_runs
    assert len(count) - begun == 2 * 19 - 9


def test_a_checkpoint_past_a_run_that_is_missing_is_not_used(config, tmp_path, all_runs, monkeypatch):
    out = tmp_path / "out"
    stopped_run(config, out, monkeypatch, 12)
    for path in (out / "runs").glob("*4-generations*"):
        path.unlink()
    experiment(config, out)
    assert runs(out) == all_runs


@pytest.mark.parametrize("damage", [truncated, flipped, foreign, emptied])
def test_a_damaged_checkpoint_of_a_run_is_named_and_that_search_begins_anew(
    config, tmp_path, all_runs, monkeypatch, damage
):
    out = tmp_path / "out"
    saved = stopped_run(config, out, monkeypatch, 12)
    damage(saved)
    with pytest.warns(runner.ExperimentWarning, match="damaged one .*; its search begins anew") as said:
        experiment(config, out)
    assert len(said) == 1
    assert runs(out) == all_runs


def test_a_checkpoint_of_other_versions_is_not_used(config, tmp_path, all_runs, monkeypatch):
    out = tmp_path / "out"
    stopped_run(config, out, monkeypatch, 12)
    versions = runner.package_versions()
    monkeypatch.setattr(runner, "package_versions", lambda: versions | {"pymoo": "0.0.1"})
    with pytest.warns(runner.ExperimentWarning, match=r"belongs to another search \(pymoo .*, not 0\.0\.1\)"):
        experiment(config, out)
    assert runs(out) == all_runs


@tried("most", 2)
def test_kills_of_an_experiment_at_random_moments_change_no_byte(tmp_path, forker, most):
    path = tmp_path / "tiny.yaml"
    text = SMALL.replace("generations: 20", "generations: 100").replace("seeds: [1, 2]", "seeds: [1]")
    path.write_text(text, encoding="utf-8")
    options = ("run", path, "--quiet", "--jobs", "1", "--checkpoint", "0.02s")
    undisturbed = forker.run(*options, "-o", tmp_path / "whole")
    assert undisturbed.code == 0, undisturbed.stderr
    out, kills = tmp_path / "out", 0
    moments = random.Random(7)
    while kills < most:
        # reading takes some of the time, and so does the report
        ended = forker.run(*options, "-o", out, kill_after=moments.uniform(0.1, 0.6) * undisturbed.seconds)
        assert ended.code in (0, -9), ended.stderr
        kills += ended.code == -9
        if ended.code == 0:
            assert runs(out) == runs(tmp_path / "whole")
            shutil.rmtree(out)
    last = forker.run(*options, "-o", out)
    assert (last.code, last.stderr) == (0, "")  # nothing is damaged by being killed, so that nothing is named
    assert runs(out) == runs(tmp_path / "whole")
    assert not list(out.glob("**/.*.partial"))
    for table in (tmp_path / "whole" / "tables").rglob("*.csv"):
        assert (out / table.relative_to(tmp_path / "whole")).read_bytes() == table.read_bytes()


def test_a_full_disk_ends_an_experiment_in_one_line_and_the_rerun_completes(config, tmp_path, all_runs, capsys):
    out = tmp_path / "out"
    with small_files(1500):
        assert run("run", config, "-o", out, "--jobs", "1", "--quiet") == 2
    assert "cannot be written (File too large); mend that, and the same command" in one_line(capsys)
    experiment(config, out)
    assert runs(out) == all_runs


def test_finished_runs_outlive_a_disk_that_fills_up(config, tmp_path, all_runs, monkeypatch, capsys):
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "PAUSE", 0.0)
        limits = contextlib.ExitStack()
        at_generation(patch, 10, lambda: limits.enter_context(small_files(900)))
        with limits:
            assert run("run", config, "-o", out, "--jobs", "1", "--quiet", "--checkpoint", "0.0001s") == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("meshsimp: warning: ")
    assert lines[0].endswith("cannot be written (File too large); the search goes on without it")
    finished = list((out / "runs").glob("*.json"))
    assert len(finished) == 1
    done = experiment(config, out)
    assert done.reused == 1
    assert runs(out) == all_runs


def test_a_folder_of_runs_that_vanishes_is_one_line_and_the_rerun_completes(
    config, tmp_path, all_runs, monkeypatch, capsys
):
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        at_generation(patch, 10, lambda: shutil.rmtree(out))
        assert run("run", config, "-o", out, "--jobs", "1", "--quiet") == 2
    assert "cannot be written (No such file or directory); mend that" in one_line(capsys)
    experiment(config, out)
    assert runs(out) == all_runs


def test_a_memory_limit_ends_an_experiment_in_one_line(config, tmp_path, forker, all_runs):
    big = tmp_path / "big.yaml"
    text = CONFIG.replace("face:150", "jacksboro:2").replace("pop_size: 20", "pop_size: 5000")
    big.write_text(text, encoding="utf-8")
    ended = forker.run("run", big, "-o", tmp_path / "out", "--jobs", "1", "--quiet", memory=150 << 20)
    assert ended.code == 2, ended.stderr
    assert ended.stderr.count("\n") == 1
    assert "does not fit into memory" in ended.stderr
    experiment(config, tmp_path / "out")
    assert runs(tmp_path / "out") == all_runs


def test_without_checkpoints_a_killed_run_begins_anew(config, tmp_path, all_runs, monkeypatch):
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        at_generation(patch, 12, stop(Killed))
        with pytest.raises(Killed):
            experiment(config, out, checkpoint=None)
    assert not (out / runner.CHECKPOINTS).exists()
    experiment(config, out, checkpoint=None)
    assert runs(out) == all_runs

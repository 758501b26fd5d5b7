from __future__ import annotations

import json
import os
import pkgutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import meshsimp_pymoo
from meshsimp_pymoo import warming
from meshsimp_pymoo.cli import preparing
from meshsimp_pymoo.compiling.store import Stored
from meshsimp_pymoo.surface.moves import ANSWERING
from meshsimp_pymoo.warming import PARTS, SEARCH, STATED, WISH, Warming

# The specialisations that the first search compiles; how many is what it costs. If it has to be more, say why here.
# 145 until changes at an outline were costed without doing them (surface/bare.py, surface/trial.py, plane/stars.py) and
# a search could begin with insertion: functions of their own, none of them twice. 190 until the meshes of a front were
# measured between the vertices (surface/evaluate.py) and thinning was cut into parts that free meshes go on with. 205
# until edges could be forced (plane/constraints.py): asked of records and of addresses of records. 225 until footprints
# could be bits (plane/footprint.py) and moves went along the vector by windows (search/local_search.py). 228 until they
# could be what lies within no rim (plane/footprint.py), which closed surfaces with holes ask.
MOST_SPECIALISATIONS = 229


def test_what_python_calls_is_in_one_part_each():
    found = set()
    for module in pkgutil.walk_packages(meshsimp_pymoo.__path__, "meshsimp_pymoo."):
        if module.name == "meshsimp_pymoo.__main__":
            continue
        for name, item in vars(import_module(module.name)).items():
            if isinstance(getattr(item, "_cache", None), Stored) and item.__module__ == module.name:
                found.add(f"{module.name.partition('.')[2]}:{name}")
    named = [(name, part.ground) for part in PARTS for name in part.entries]
    assert len(set(named)) == len(named)
    assert {name for name, _ in named} == found
    assert set(SEARCH) < set(WISH) <= {part.name for part in PARTS}


def test_all_files_with_answers_are_known():
    """What is missing in the table is no part of what code is made from until somebody happens to import it."""
    package = Path(meshsimp_pymoo.__file__).parent
    found = {path for path in package.rglob("*.py") if "\n@answers(" in path.read_text("utf-8")}
    assert found == {package.parent.joinpath(*name.split(".")).with_suffix(".py") for name in ANSWERING}


def test_a_process_that_begins_by_looking_for_it_finds_what_others_have_compiled():
    code = f"from meshsimp_pymoo.warming import missing\nprint([part.name for part in missing({SEARCH})])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


FIRST_CALL = """
import json, os, sys
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # one core: all is compiled in this process
from meshsimp_pymoo import cli

facts = {"compiled": 0, "entries": [], "late": []}

def watch():
    from numba.core import event
    from meshsimp_pymoo import warming
    from meshsimp_pymoo.cli import searching
    from meshsimp_pymoo.compiling import store

    class Counter(event.Listener):
        def on_start(self, event):
            facts["compiled"] += 1

        def on_end(self, event):
            pass

    event.register("numba:compile", Counter())
    store._listeners.append(lambda function, seconds: facts[where].append(function.__name__))
    search = searching._search

    def begun(*arguments):
        global where
        where = "late"
        return search(*arguments)

    searching._search = begun

where = "entries"
watch()
facts["code"] = cli.main(sys.argv[1:])
by_first, where = facts["compiled"], "entries"
# a wish needs more, and finds it compiled too
wish = ["--triangles", "20", "--moves", "2000", "--no-page", "-q", "-o", sys.argv[sys.argv.index("-o") + 1] + "-wish"]
facts["code"] = facts["code"] or cli.main([*sys.argv[1:3], *wish])
print(json.dumps(facts | {"compiled": by_first}))
"""


@pytest.fixture(scope="module")
def first_call(tmp_path_factory):
    """Return what was compiled and said when a search was called on a machine that had compiled nothing."""
    folder = tmp_path_factory.mktemp("first")
    out = folder / "out"
    command = ["simplify", "horseshoe:80", "-o", str(out), "--generations", "2", "--population", "8", "--refit"]
    done = subprocess.run(
        [sys.executable, "-c", FIRST_CALL, *command],
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    *said, facts = done.stdout.splitlines()
    run = json.loads((out / "run.json").read_text())
    return done.stderr, said, json.loads(facts), run


@pytest.mark.slow
def test_the_first_call_says_that_it_compiles_and_keeps_it_apart(first_call):
    err, said, facts, run = first_call
    assert facts["code"] == 0
    assert err.startswith("meshsimp: compiling once for this machine, about ")
    assert run["compile_seconds"] > 1
    assert run["seconds"] < 5
    assert any(line.startswith("compiled once for this machine: ") for line in said)


def test_the_message_names_what_is_compiled_besides(monkeypatch):
    monkeypatch.setattr(warming, "missing", lambda names: [part for part in PARTS if part.name in names])
    monkeypatch.setattr(Warming, "expected", 13.4)
    once = "compiling once for this machine"
    assert preparing._once(Warming([*SEARCH, "scores"])) == f"{once}, about 13 s"
    assert preparing._once(Warming(["free meshes", "scores"])) == f"{once}: free meshes and scores, about 13 s"


@pytest.mark.slow
def test_a_search_finds_everything_compiled(first_call):
    _, _, facts, _ = first_call
    assert facts["late"] == []
    parts = (*WISH, *STATED)
    names = {name.partition(":")[2] for part in PARTS if part.name in parts for name in part.entries}
    assert set(facts["entries"]) == names


@pytest.mark.slow
def test_the_specialisations_do_not_grow(first_call):
    _, _, facts, _ = first_call
    assert facts["compiled"] <= MOST_SPECIALISATIONS


@pytest.mark.slow
def test_two_processes_compile_where_there_are_two_cores(tmp_path, monkeypatch):
    code = "from meshsimp_pymoo import warming\nparts = ['files', 'folded scans']\n"
    code += "warming.PARTS = [part._replace(beside=part.name == parts[1]) for part in warming.PARTS]\n"
    code += "with warming.Warming(parts) as found:\n    print(found._beside is not None)\n    found.finish()\n"
    code += "print([part.name for part in warming.missing(parts)])"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    if not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2:
        pytest.skip("this process may use one core only")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.split("\n")[:2] == ["True", "[]"]


def test_where_no_second_process_can_be_started_all_is_compiled_in_this_one(monkeypatch):
    done = []
    parts = [part._replace(work=lambda name=part.name: done.append(name)) for part in PARTS]
    monkeypatch.setattr(warming, "PARTS", parts)
    monkeypatch.setattr(warming, "_has_code", lambda part: part.name in done)

    def fail(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(warming.subprocess, "Popen", fail)
    with Warming(SEARCH) as found:
        found.finish()
    assert sorted(done) == sorted(SEARCH)

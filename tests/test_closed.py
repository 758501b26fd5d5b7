"""Closed surfaces from end to end: what the shell writes, reads back, resumes, says and refuses."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, nsga2_v1
from meshsimp_pymoo.cli import main, preparing, searching
from meshsimp_pymoo.cli.requests import Free, Output, Request, Search, Tiling, Wish
from meshsimp_pymoo.cli.terminal import Stages
from meshsimp_pymoo.compiling.store import told_of_compiling
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.files import read_npz
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import write_mesh, written_formats
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.search.checkpoint import read_checkpoint
from meshsimp_pymoo.surface.closed import embedding, model
from meshsimp_pymoo.surface.height import HeightSurface, refit_heights
from meshsimp_pymoo.surface.kinds import as_stored, stored_arrays, surface_of
from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.warming import CLOSED_FREE, CLOSED_SEARCH, CLOSED_WISH, SEARCH, Warming

pytestmark = [
    pytest.mark.usefixtures("sketched"),
    pytest.mark.filterwarnings("ignore:.*is no height field but a closed surface"),
]

QUICK = ("--generations", "3", "--population", "10", "--algorithm", "nsga2_v1")


@pytest.fixture(scope="module", autouse=True)
def _compiled_closed():
    with Warming(CLOSED_WISH) as warming:
        warming.finish()


def run(*arguments):
    return main([str(argument) for argument in arguments])


def bumpy(subdivisions=2):
    """Return a ball with bumps, of no symmetry, away from the origin."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    x, y, z = mesh.vertices.T
    mesh.vertices *= (1.0 + 0.2 * np.sin(5.0 * x + 1.0) * np.cos(4.0 * y + z))[:, None]
    mesh.vertices += [10.0, 20.0, 30.0]
    return mesh


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a file of the ball, and of a ring."""
    place = tmp_path_factory.mktemp("closed")
    ball = bumpy()
    write_mesh(place / "ball.ply", ball.vertices, ball.faces)
    ring = trimesh.creation.annulus(1.0, 2.0, 1.0, sections=8)
    write_mesh(place / "ring.ply", ring.vertices, ring.faces)
    return place


@pytest.fixture(scope="module")
def ball(folder):
    return folder / "ball.ply"


@pytest.fixture(scope="module")
def written(folder, ball, sketched):
    """Return the folder of a front that was searched for a wish and refitted."""
    out = folder / "written"
    wish = ("--triangles", "20%", "--moves", "1000", "--refit", "--meshes", "6", "--quiet")
    assert run("simplify", ball, "-o", out, *wish) == 0
    return out


@pytest.fixture
def front(ball):
    return Front.from_result(minimize(MeshProblem(ball, surface="closed"), nsga2_v1(10), ("n_gen", 2), seed=1))


def rows_of(folder):
    """Return the rows of a front's table."""
    return list(csv.DictReader((folder / "front.csv").read_text().splitlines()))


def as_trimesh(path):
    return trimesh.load(path, force="mesh", process=False)


def is_like(mesh, original, volume):
    """Tell whether a mesh is closed, of genus 0, wound outwards, and about as large."""
    mesh.merge_vertices()  # formats without rows of vertices have three for each triangle
    whole = mesh.is_watertight and mesh.is_winding_consistent and mesh.euler_number == 2
    return whole and abs(mesh.volume / original.volume - 1.0) < volume


# ------------------------------------------------------------------------------------------ what is written and read


def test_a_closed_surface_is_simplified_for_a_wish_and_all_its_files_are_whole(written):
    rows = rows_of(written)
    assert {row["uncovered"] for row in rows} == {"0"}
    assert all(int(row["triangles"]) == 2 * int(row["vertices"]) - 4 for row in rows)
    record = json.loads((written / "run.json").read_text())
    assert record["rules"]["footprint"] is record["rules"]["outside"] is None
    assert record["chosen"] is not None
    paths = [written / "chosen.ply", written / "chosen_refitted.ply"]
    paths += sorted(written.glob("meshes/*.ply")) + sorted(written.glob("refitted/*.ply"))
    assert len(paths) == 2 + 2 * 6
    for path in paths:
        assert is_like(as_trimesh(path), bumpy(), 1.0)
    assert is_like(as_trimesh(written / "chosen_refitted.ply"), bumpy(), 0.05)
    assert len(as_trimesh(written / "chosen.ply").faces) <= 64
    assert (written / "report.html").is_file()


def test_a_refitted_mesh_has_the_error_that_the_front_says(written, ball, capsys):
    row = rows_of(written)[Front.load(written).run["chosen"]]
    assert float(row["refitted_error"]) < float(row["error"])
    assert run("score", ball, written / "chosen_refitted.ply", "--json") == 0
    assert json.loads(capsys.readouterr().out)["error"] == pytest.approx(float(row["refitted_error"]), rel=1e-6)


def test_the_summary_of_a_closed_surface_is_json(ball, tmp_path, capsys):
    assert run("simplify", ball, "-o", tmp_path / "out", "--json", "--pick", "knee", "--surface", "closed", *QUICK) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["chosen"]["uncovered"] == 0
    assert said["most_accurate"] == {**said["most_accurate"], "error": 0.0, "triangles": 320}


@pytest.mark.parametrize("name", [kind.name for kind in written_formats().values() if kind.read])
def test_every_format_holds_a_closed_mesh_watertight_and_wound_as_the_original(front, tmp_path, name):
    solution = front.best(triangles=250)
    path = tmp_path / f"small{written_formats()[name].suffix}"
    solution.save(path)
    assert is_like(as_trimesh(path), bumpy(), 0.2)


def test_a_stored_front_is_read_picked_from_drawn_and_sliced(written, ball, tmp_path, capsys):
    front = Front.load(written)
    assert [solution.triangles for solution in front[2:4]] == [q.triangles for q in front.quality[2:4]]
    inner = front[3:-1][1]
    assert inner.simplified.quality.error == front[4].error
    assert inner.refitted.error <= inner.error
    assert run("pick", written, "--solution", "3", "-o", tmp_path / "three.obj") == 0
    assert len(as_trimesh(tmp_path / "three.obj").faces) == front[3].triangles
    assert run("report", written) == 0
    ring = ball.parent / "ring.ply"
    capsys.readouterr()
    assert run("pick", written, "--solution", "3", "-o", tmp_path / "no.obj", "--model", ring) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", ["sphere.ply", "roof"])
def test_a_front_of_a_closed_surface_is_of_no_other_model(written, tmp_path, name):
    other = trimesh.creation.icosphere(subdivisions=2)
    write_mesh(tmp_path / "sphere.ply", other.vertices, other.faces)
    with pytest.raises(ResultError, match="is the front of another model"):
        Front.load(written, model=tmp_path / name if name.endswith("ply") else name)


def test_saved_twice_a_front_is_the_same_bytes(front, tmp_path):
    front.save(tmp_path / "once", pictures=False)
    Front.load(tmp_path / "once").save(tmp_path / "twice", pictures=False)
    for name in ("front.csv", "front.npz", *(f"meshes/{path.name}" for path in (tmp_path / "once/meshes").iterdir())):
        assert (tmp_path / "once" / name).read_bytes() == (tmp_path / "twice" / name).read_bytes()


# ------------------------------------------------------------------------------------------- images of another version


def last_bits(points, faces, part):
    """Flatten as usual, and move images in their last bits as other libraries would."""
    found = embedding.embed(points, faces, part)
    moved = found.xy + 2.0**-52 * np.random.default_rng(1).integers(-3, 4, found.xy.shape)
    moved[found.poles] = found.xy[found.poles]
    return found._replace(xy=moved)


def another_pole(points, faces, part):
    """Flatten from within another face, as where several are equally near to the middle but for rounding."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(embedding, "_trunk_face", lambda *_: 7)
        return embedding.embed(points, faces, part)


OTHERS = [last_bits, another_pole]


@pytest.mark.parametrize("other", OTHERS)
def test_a_front_made_with_other_images_is_read_back_as_it_was_made(ball, tmp_path, monkeypatch, other):
    rules = Rules(weights="area")  # which add up in vector order
    with monkeypatch.context() as patch:
        patch.setattr(model, "embed", other)
        problem = MeshProblem(ball, rules=rules)
        made = Front.from_result(minimize(problem, nsga2_v1(10), ("n_gen", 2), seed=1))
        made.save(tmp_path / "out", pictures=False)
    usual = MeshProblem(ball, rules=rules).model
    assert not np.array_equal(usual.xy, problem.model.xy)
    assert usual.hash == problem.model.hash
    for given in (None, ball, usual, surface_of(usual, made.surface.rules)):
        read = Front.load(tmp_path / "out", model=given)
        for name in ("xy", "poles", "faces", "points", "source_index", "weights"):
            assert np.array_equal(getattr(read.model, name), getattr(problem.model, name)), name
        for one, same in zip(made, read, strict=True):
            assert np.array_equal(one.faces, same.faces)
            assert same.simplified.quality == one.simplified.quality


@pytest.mark.parametrize("other", OTHERS)
def test_a_search_goes_on_with_the_images_of_its_checkpoint(ball, tmp_path, monkeypatch, other):
    command = ("simplify", ball, *QUICK, "--quiet", "--no-page", "--checkpoint", "1s")

    class Killed(Exception):
        pass

    def keep_and_die(self, *, last=False):
        self._checkpoints.save(begun=self.begun)
        raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(model, "embed", other)
        assert run(*command, "-o", tmp_path / "undisturbed") == 0
        patch.setattr(searching.Keeper, "keep", keep_and_die)
        with pytest.raises(Killed):
            run(*command, "-o", tmp_path / "out")
    arrays = read_checkpoint(tmp_path / "out" / "checkpoint.npz").arrays
    with (tmp_path / "undisturbed" / "front.npz").open("rb") as stream:
        assert np.array_equal(arrays["xy"], read_npz(stream, "front")["xy"])
    assert run(*command, "-o", tmp_path / "out") == 0
    for path in (tmp_path / "undisturbed").rglob("*"):
        if path.is_file() and path.name not in ("run.json", "report.html"):
            there = tmp_path / "out" / path.relative_to(tmp_path / "undisturbed")
            assert path.read_bytes() == there.read_bytes(), path.name


def test_a_checkpoint_of_another_model_is_refused_by_name(ball, tmp_path, monkeypatch, capsys):
    (tmp_path / "out").mkdir()

    def keep_and_die(self, *, last=False):
        self._checkpoints.save(begun=self.begun)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(searching.Keeper, "keep", keep_and_die)
        patch.setattr(searching, "_write", lambda *_: 130)
        assert run("simplify", ball, "-o", tmp_path / "out", *QUICK) == 130
    other = trimesh.creation.icosphere(subdivisions=2)
    write_mesh(tmp_path / "sphere.ply", other.vertices, other.faces)
    capsys.readouterr()
    assert run("simplify", tmp_path / "sphere.ply", "-o", tmp_path / "out", *QUICK) == 2
    assert "belongs to another search (model " in capsys.readouterr().err


@pytest.mark.parametrize(
    "spoil",
    [
        lambda xy: xy[::-1].copy(),
        lambda xy: np.where(xy == xy.max(), np.nan, xy),
        lambda xy: 0.3 * xy,
        lambda xy: 2.0 * xy,
    ],
)
def test_damaged_images_are_refused_in_one_line(front, tmp_path, spoil):
    front.save(tmp_path / "out", pictures=False)
    with (tmp_path / "out" / "front.npz").open("rb") as stream:
        arrays = read_npz(stream, "front")
    np.savez(tmp_path / "out" / "front.npz", **arrays | {"xy": spoil(arrays["xy"])})
    with pytest.raises(ResultError, match=r"front\.npz cannot be used .*write the front again") as refused:
        _ = Front.load(tmp_path / "out").surface
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("change", "match"), [({}, "holds no images"), ({"xy": np.zeros((5, 2))}, "xy has the shape")])
def test_images_that_are_missing_or_too_few_are_refused(front, tmp_path, change, match):
    front.save(tmp_path / "out", pictures=False)
    with (tmp_path / "out" / "front.npz").open("rb") as stream:
        arrays = read_npz(stream, "front")
    del arrays["xy"]
    np.savez(tmp_path / "out" / "front.npz", **arrays | change)
    with pytest.raises(ResultError, match=match):
        _ = Front.load(tmp_path / "out").surface


def test_a_surface_with_its_own_images_is_itself_and_heights_have_none(ball):
    surface = MeshProblem(ball).surface
    assert as_stored(surface, stored_arrays(surface)) is surface
    roof = MeshProblem("roof:3").surface
    assert stored_arrays(roof) == {}
    assert as_stored(roof, {}) is roof
    assert isinstance(roof, HeightSurface)


# ---------------------------------------------------------------------------------------------------- what is refused

CLOSED = ("--surface", "closed")
# What does not go with a closed surface, and what the line names beside it.
PAIRS = {
    ("--footprint", "model"): r"--footprint model .* closed",
    ("--outside", "ignore"): r"--outside ignore .* closed",
    ("--pin", "corners"): r"pin='corners' .* closed",
    ("--pin", "hull"): r"pin='hull' .* closed",
    ("--pin", "border"): r"pin='border' .* closed",
    ("--break-lines", "outline"): r"no outline and no holes .*--break-lines outline",
    **{
        ("--format", kind.name): rf"--format {kind.name} .*--surface closed.*: {kind.title} holds"
        for kind in written_formats().values()
        if kind.one_height
    },
    ("--max-edge", "3"): r"max_edge .*point clouds",
    ("--tile", "64", *CLOSED): r"--surface does not go with tiles",
    ("--tile", "64"): r"closed surface.*tiles",
    ("--up", "z", *CLOSED): r"--up z .*--surface closed",
    ("--patch", "front", *CLOSED): r"--patch front .*--surface closed",
    ("--up", "z"): r"--patch front.* leave --up z out",
    ("--surface", "height"): r"--patch front.* leave --surface height out",
    ("--triangles", "3"): r"--triangles 3 is impossible: .* 4 to 320 triangles",
}


@pytest.mark.parametrize("options", PAIRS, ids=" ".join)
def test_what_does_not_go_with_a_closed_surface_is_refused_in_one_line_before_any_search(
    ball, tmp_path, capsys, monkeypatch, options
):
    monkeypatch.setattr(searching, "_search", lambda *_: pytest.fail("searched"))
    assert run("simplify", ball, "-o", tmp_path / "out", *options) == 2
    *warnings, line = capsys.readouterr().err.splitlines()
    assert all("is no height field but a closed surface" in text or "compiling" in text for text in warnings)
    assert re.search(PAIRS[options], line), line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("refused", "match"),
    [
        (
            lambda problem: LiveTriangulation(problem.surface, problem.pinned),
            "live triangulations are of height surfaces",
        ),
        (
            lambda problem: MeshProblem(problem.surface, regions=4),
            "regions=4.*RegionCrossover",
        ),
        (lambda problem: refit_heights(problem.surface, ~problem.pinned), "a ClosedSurface has no heights"),
        (lambda problem: MeshProblem(problem.model, pin=[[10.0, 20.0]]), r"give \[x, y, z\]"),
    ],
)
def test_what_describes_height_surfaces_is_refused_in_python_too(ball, refused, match):
    with pytest.raises((ValueError, TypeError), match=match) as told:
        refused(MeshProblem(ball))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("options", [(), CLOSED], ids=["auto", "closed"])
def test_a_ring_is_refused_by_its_handle(folder, tmp_path, capsys, options):
    assert run("simplify", folder / "ring.ply", "-o", tmp_path / "out", *options) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "has genus 1 (1 handle, as a ring has one)" in line
    assert "--patch front" in line


@pytest.mark.filterwarnings("ignore:.*left out of the front patch")
def test_one_side_of_a_closed_mesh_is_a_height_field_still(ball, tmp_path):
    assert run("simplify", ball, "-o", tmp_path / "out", "--up", "z", "--patch", "front", "--quiet", *QUICK) == 0
    assert isinstance(Front.load(tmp_path / "out").surface, HeightSurface)


def test_what_goes_with_a_closed_surface_is_searched(ball, tmp_path):
    rules = ("--pin", "3,5", "--weights", "area", "--measure", "rms", *CLOSED)
    assert run("simplify", ball, "-o", tmp_path / "out", *rules, *QUICK, "--quiet") == 0
    front = Front.load(tmp_path / "out")
    assert front.objectives == ("rms_error", "triangles")
    problem = front.problem
    assert np.isin(np.array([3, 5]), problem.model.source_index[problem.pinned]).all()
    assert problem.model.weights is not None
    assert front[1].simplified.quality.rms_error == pytest.approx(front[1].rms_error, rel=1e-12)


# ------------------------------------------------------------------------------------------------------- score and info


def test_score_measures_the_mesh_of_the_front_as_it_does_the_other(written, ball, capsys):
    front = Front.load(written)
    row = next(k for k in range(1, len(front)) if front.stored_mesh(k) is not None)
    path = front.stored_mesh(row)
    assert run("score", ball, path, "--front", written, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["outside"] is None
    assert said["uncovered"] == 0
    assert said["front"]["solution"] == row
    assert said["front"]["error_ratio"] == pytest.approx(1.0, rel=1e-9)
    assert said["front"]["triangles_for_this_error"] == front[row].triangles
    assert said["error"] <= front[row].error * (1.0 + 1e-12)


def test_info_says_what_a_closed_model_is(ball, folder, capsys):
    assert run("info", ball) == 0
    out = capsys.readouterr().out
    for label, text in {"surface": "closed", "genus": "0", "parts": "1", "holes": "0"}.items():
        assert re.search(rf"^  {label} +{text}$", out, re.MULTILINE)
    assert out.endswith("  verdict         usable: a closed surface of genus 0\n")
    assert re.search(r"^  no height field it has no border$", out, re.MULTILINE)
    assert run("info", ball, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    known = {"surface": "closed", "components": 1, "genus": 0, "loops": 0, "rim_edges": 0, "caps": 0, "refusal": None}
    assert {name: said[name] for name in known} == known
    assert (said["copied"], said["small_parts_left_out"]) == (0, 0)
    model = open_model(ball)
    ends = model.xy[model.faces[:, [0, 1, 2, 0]]]
    assert said["least_image_edge"] == pytest.approx(np.linalg.norm(np.diff(ends, axis=1), axis=2).min(), rel=1e-12)
    assert said["not_height"] == "has no border"
    assert said["not_closed"] is None


def test_info_says_why_a_model_is_neither_or_could_be_the_other(ball, folder, capsys):
    assert run("info", folder / "ring.ply", "--json") == 2
    said = json.loads(capsys.readouterr().out)
    assert (said["surface"], said["genus"], said["caps"]) == (None, 1, None)
    assert said["not_closed"].startswith("has genus 1")
    assert "has genus 1" in said["refusal"]
    assert run("info", ball, "--up", "z") == 2
    out = capsys.readouterr().out
    assert re.search(r"^  surface +none$", out, re.MULTILINE)
    assert "it could be taken as a closed surface (--surface closed)" in out
    assert run("info", "roof:3", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["surface"], said["components"], said["genus"], said["not_closed"]) == ("height", 1, None, "is a grid")
    assert run("info", ball, "--patch", "front", *CLOSED) == 2


# ---------------------------------------------------------------------------------------------------------- compiling


def request_for(surface, **wish):
    options, output = Options(surface=surface), Output(folder=Path())
    return Request("m.ply", options, Rules(), Search(), Wish(wish), Free(), output, Tiling())


def test_what_is_compiled_is_of_the_kind_of_the_model(monkeypatch):
    assert searching._parts(request_for("closed")) == list(CLOSED_SEARCH)
    assert searching._parts(request_for("closed", triangles=10)) == list(CLOSED_WISH)
    freed = replace(request_for("closed"), free=Free(free=True))
    assert searching._parts(freed) == [*CLOSED_SEARCH, *CLOSED_FREE]
    assert searching._parts(request_for("height")) == list(SEARCH)
    for lacking, guessed in (
        ((), "height"),
        (CLOSED_SEARCH, "height"),
        (SEARCH, "closed"),
        (SEARCH + CLOSED_SEARCH, "height"),
    ):
        monkeypatch.setattr(searching, "missing", lambda names, lacking=lacking: [n for n in names if n in lacking])
        assert searching._guessed(request_for("auto")).options.surface == guessed
        assert searching._guessed(request_for("closed")).options.surface == "closed"


def test_what_was_begun_in_vain_is_left_and_the_right_parts_are_compiled(monkeypatch):
    told = []

    class Recorded:
        expected = 1.0

        def __init__(self, names):
            self.names = sorted(names)
            self.parts = [SimpleNamespace(name=name) for name in self.names]

        def __enter__(self):
            told.append(("begun", self.names))

        def finish(self):
            told.append(("finished", self.names))

        def __exit__(self, *_):
            told.append(("left", self.names))

    monkeypatch.setattr(preparing, "Warming", Recorded)
    with Stages(True, "m", {"compiling": 0.0}) as shown, preparing.compiling(["a"], shown) as compiled:
        compiled.finish(["b", "c"])
    assert told == [
        ("begun", ["a"]), ("left", ["a"]), ("begun", ["b", "c"]), ("finished", ["b", "c"]), ("left", ["b", "c"]),
    ]  # fmt: skip


def test_a_search_of_a_closed_surface_compiles_nothing_more(ball, tmp_path, monkeypatch):
    compiled = []
    search = searching._search

    def watched(*args):
        with told_of_compiling(lambda function, seconds: compiled.append(function)):
            return search(*args)

    monkeypatch.setattr(searching, "_search", watched)
    finished = []
    finish = preparing.Compiling.finish
    monkeypatch.setattr(preparing.Compiling, "finish", lambda own, names: (finished.append(names), finish(own, names)))
    assert run("simplify", ball, "-o", tmp_path / "out", "--moves", "2000", "--quiet", "--no-page") == 0
    assert compiled == []
    assert finished == [list(CLOSED_SEARCH)]


def test_levels_of_a_closed_model_are_closed_too(front, tmp_path):
    front.save(tmp_path / "out", meshes=0, pictures=False)
    levels = front.levels(3)
    for options in ((), ("--refit",)):
        out = tmp_path / f"levels{len(options)}"
        assert run("levels", tmp_path / "out", "-o", out, "--levels", 3, "--format", "glb", "-q", *options) == 0
        record = json.loads((out / "levels.json").read_text())
        assert record["geometric_error"].startswith("the largest distance")
        for said, solution in zip(record["levels"], levels, strict=True):
            mesh = as_trimesh(out / said["file"])
            assert mesh.is_watertight
            assert mesh.volume > 0.0, "not inside out"
            assert options or mesh.volume == pytest.approx(solution.mesh.volume, rel=1e-5)
            assert (said["mean_error"] < solution.mean_error) == (bool(options) and solution.mean_error > 0.0)

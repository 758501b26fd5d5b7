"""Surfaces with holes, folds, parts and what scanners leave: what they are taken for, what is said, what comes back."""

from __future__ import annotations

import json
import re
import warnings

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_array_equal
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, nsga2_v1
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.table import write_mesh
from meshsimp_pymoo.opening import judge, open_model
from meshsimp_pymoo.surface.closed import model as models
from meshsimp_pymoo.surface.closed.model import ClosedModel, topology
from meshsimp_pymoo.surface.model import OpenModel

BALL = load("sphere:60")
CLOSED = Options(surface="closed")


def joined(name, *meshes):
    """Return meshes (points, faces) as the parts of one."""
    begins = np.cumsum([0, *(len(points) for points, _ in meshes)])
    faces = [begin + np.asarray(faces) for begin, (_, faces) in zip(begins, meshes, strict=False)]
    return SourceMesh(np.concatenate([points for points, _ in meshes]), np.concatenate(faces), {}, name)


def without(source, faces, name="holes"):
    """Return a mesh without some faces, and without the vertices that no face uses any longer."""
    used, left = np.unique(np.delete(source.faces, faces, axis=0), return_inverse=True)
    return SourceMesh(source.points[used], left.reshape(-1, 3), {}, name)


def scan(holes=3):
    """Return a blob with so many holes, the first of them large, away from each other."""
    blob = load("blob:300")
    centres = blob.points[blob.faces].mean(axis=1)
    gone, away = [], np.full(len(centres), np.inf)
    at = 0
    for k in range(holes):
        distance = np.linalg.norm(centres - centres[at], axis=1)
        gone.append(np.argsort(distance)[: 40 if k == 0 else 6])
        away = np.minimum(away, distance)
        at = int(np.argmax(away))
    return without(blob, np.concatenate(gone), "scan")


def pair():
    """Return two blobs beside each other, one of them with a hole."""
    one, other = load("blob:150"), scan(1)
    return joined("pair", (one.points, one.faces), (0.5 * other.points + [4.0, 0.0, 0.0], other.faces))


def ties():
    """Return a ball in which two fans of faces meet in each of five vertices."""
    ball = load("sphere:200")
    gone = []
    for vertex in range(0, 200, 40):
        around = np.flatnonzero((ball.faces == vertex).any(axis=1))
        apart = ~np.isin(ball.faces[around], np.setdiff1d(ball.faces[around[0]], vertex)).any(axis=1)
        gone += [around[0], around[apart][0]]
    return without(ball, gone, "ties")


def torus():
    ring = trimesh.creation.torus(1.0, 0.3, major_sections=12, minor_sections=8)
    return np.array(ring.vertices), np.array(ring.faces, np.int64)


def strip_of_one_side(n=40):
    """Return Moebius' strip."""
    turn = 2.0 * np.pi * np.arange(n) / n
    sides = [
        np.column_stack(
            [
                (1.0 + s * np.cos(turn / 2)) * np.cos(turn),
                (1.0 + s * np.cos(turn / 2)) * np.sin(turn),
                s * np.sin(turn / 2),
            ]
        )
        for s in (-0.3, 0.3)
    ]
    k = np.arange(n)
    after, beside = np.append(k[1:], n), np.append(k[1:] + n, 0)
    faces = np.concatenate([np.column_stack([k, after, k + n]), np.column_stack([k + n, after, beside])])
    return SourceMesh(np.concatenate(sides), faces, {}, "strip")


def said_of(source, **options):
    """Return the model and what was said when it was opened."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        model = open_model(source, Options(**options))
    return model, [str(warning.message) for warning in told]


# ------------------------------------------------------------------------------------------------- what it is taken for


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: without(BALL, [0], "one"),
            r"one: is no height field but a closed surface with 1 hole \(3 edges at rims\)",
        ),
        (
            scan,
            r"scan: .* closed surface with 3 holes \(\d+ edges at rims\), and is taken as one, since it has at least",
        ),
        (pair, r"pair: .* closed surface of 2 parts with 1 hole \(\d+ edges at rims\), and is taken as one, since "),
        (
            lambda: joined("two", (BALL.points, BALL.faces), (BALL.points + 5.0, BALL.faces)),
            r"two: is no height field but a closed surface of 2 parts, and is taken as one \(--surface closed",
        ),
        (
            lambda: joined("same", (BALL.points, BALL.faces), (BALL.points, BALL.faces)),
            r"same: .* closed surface of 2 parts, ",
        ),
        (
            lambda: joined("inside", (BALL.points, BALL.faces), (0.5 * BALL.points, BALL.faces[:, ::-1])),
            r"inside: .* closed surface of 2 parts, ",
        ),
    ],
)
def test_what_is_no_height_field_is_a_closed_surface_in_one_line_that_says_what_it_has(make, words):
    model, (line,) = said_of(make())
    assert isinstance(model, ClosedModel)
    assert re.match(words, line), line
    assert "--surface closed (surface='closed') says so" in line
    assert "--patch front (patch='front') takes one side of it" in line
    assert "\n" not in line
    again, told = said_of(make(), surface="closed")
    assert again.hash == model.hash
    assert told == []


def test_a_sheet_with_a_hole_is_a_height_field_first_and_what_has_no_border_is_not_tried_as_one(monkeypatch):
    from meshsimp_pymoo import opening

    model, told = said_of(load("ring:120"))
    assert isinstance(model, OpenModel)
    assert told == []
    monkeypatch.setattr(opening, "topology", lambda *_: pytest.fail("looked at as a closed surface"))
    assert judge(load("ring:120")).kind == "height"
    monkeypatch.setattr(opening, "seen_upright", lambda *_: pytest.fail("looked at as a height field"))
    assert judge(joined("ring", torus())).kind == "closed"
    assert judge(BALL, Options(surface="closed")).kind == "closed"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: joined("ring", torus()), r"ring: has genus 1 \(1 handle, as a ring has one\), first at \("),
        (
            lambda: joined("ring", (torus()[0], torus()[1][3:])),
            r"ring: .* folded over.*--patch front .*; as a closed surface it is refused too: it has genus 1 ",
        ),
        (
            lambda: joined("both", (BALL.points + 4.0, BALL.faces), torus()),
            r"both: has genus 1 \(1 handle in 1 of 2 parts, as a ring has one\), first at \(1\.3, 0, 0\)",
        ),
        (
            strip_of_one_side,
            r"strip: .* folded over.*; as a closed surface it is refused too: it is not wound alike, or",
        ),
    ],
)
def test_what_is_neither_is_refused_in_one_line_with_both_reasons(make, words):
    with pytest.raises(ModelError) as refused:
        open_model(make())
    assert re.match(words, str(refused.value)), refused.value
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"surface": "height"}, r"; or leave --surface height \(surface='height'\) out to have all of it, as a closed"),
        ({"up": "z"}, r"; or leave --up z \(up='z'\) out to have all of it, as a closed surface$"),
        (
            {"up": "z", "surface": "height"},
            r"; or leave --surface height .* and --up z \(up='z'\) out to have all of it",
        ),
    ],
)
def test_what_stands_in_the_way_of_a_closed_surface_is_named(options, words):
    with pytest.raises(ModelError, match=words):
        open_model(scan(), Options(**options))


def test_a_limb_too_long_in_an_open_scan_is_refused_with_both_reasons(monkeypatch):
    def refused(*_):
        raise ModelError("too long")

    monkeypatch.setattr(models, "_refuse_faults", refused)
    with pytest.raises(ModelError, match=r"too long; nor is it a height field, since it has at least .* folded over"):
        open_model(scan())


# ---------------------------------------------------------------------------------------------- what scanners leave


@pytest.mark.filterwarnings("ignore:.*several fans of faces meet")
def test_vertices_in_which_fans_meet_are_one_for_each_fan_that_counts_once():
    source = ties()
    what = topology(source.faces)
    model, told = said_of(source)
    n_copies = model.n_vertices - len(source.points)
    assert what.refusal is None
    assert what.touching == n_copies == len(model.copies) == model.found["copied"] == 5
    assert any(
        re.search(rf"several fans of faces meet in \d+ vertices; .* \({n_copies} copies\)", line) for line in told
    )
    assert topology(model.faces).touching == 0
    assert len(np.unique(model.source_index)) == model.n_vertices
    assert_array_equal(source.points[model.file_rows], model.file_points)
    assert model.total_weight == len(source.points)
    assert_array_equal(np.sort(model.source_index[model.weightless]), model.copies[:, 0])
    again = open_model(SourceMesh(source.points, np.roll(source.faces[::-1], 1, axis=1), {}, "again"), CLOSED)
    assert_array_equal(again.xy, model.xy)
    assert_array_equal(again.source_index, model.source_index)
    # whatever rows they have in the file
    listed = np.random.default_rng(1).permutation(len(source.points))
    other = open_model(SourceMesh(source.points[listed], np.argsort(listed)[source.faces], {}, "other"), CLOSED)
    assert_array_equal(other.xy, model.xy)
    assert_array_equal(other.faces, model.faces)
    assert_array_equal(listed[other.file_rows], model.file_rows)


@pytest.mark.filterwarnings("ignore:.*several fans of faces meet")
def test_weights_and_pins_of_a_vertex_with_copies_are_given_by_its_row():
    source = ties()
    model = open_model(source, CLOSED)
    weights = np.arange(1.0, len(source.points) + 1)
    weighed = model.with_weights(weights)
    assert weighed.total_weight == weights.sum()
    assert model.area_shares.sum() == pytest.approx(model.n_vertices)
    assert not model.area_shares[model.weightless].any()
    by_area = model.with_weights("area")
    assert by_area.total_weight == pytest.approx(model.n_vertices)
    assert (by_area.weights[model.weightless] == 0.0).all()
    row = int(model.copies[0, 1])
    for pin in ([row], [source.points[row]]):
        pinned = MeshProblem(model, pin=pin).surface.pinned
        assert pinned[model.file_rows == row].all()
        assert (model.file_rows == row).sum() > 1


def test_parts_too_small_for_a_mesh_are_left_out_with_their_count():
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    triangles = [(corners + np.array([5.0, 3.0 * k, 0.0]), [[0, 1, 2]]) for k in range(3)]
    model, told = said_of(joined("crumbs", (BALL.points, BALL.faces), *triangles))
    assert told[0].endswith("left out what is too small to be simplified: 3 parts of fewer than 4 vertices (3 faces)")
    assert model.found == {"small_parts_left_out": 3}
    assert (model.n_vertices, model.n_parts) == (60, 1)
    with pytest.raises(ModelError, match="all of its 3 parts have fewer than 4 vertices"):
        open_model(joined("crumbs", *triangles), CLOSED)


@pytest.mark.parametrize(
    "make",
    [
        lambda: joined("flat", (BALL.points, BALL.faces), (flat_square(), [[0, 1, 2], [0, 2, 3]])),
        lambda: without(
            load("blob:300"), np.flatnonzero(load("blob:300").points[load("blob:300").faces][..., 2].max(1) > -0.4)
        ),
        lambda: joined("rims", tube_of_two_rims()),
        lambda: without(BALL, np.flatnonzero(first_of_each_vertex(BALL.faces))),
        lambda: SourceMesh(1e70 * scan().points, scan().faces, {}, "huge"),
        lambda: SourceMesh(1e-50 * scan().points, scan().faces, {}, "tiny"),
        lambda: SourceMesh(1e-3 * scan().points + [5e5, 4e6, 100.0], scan().faces, {}, "far"),
    ],
    ids=["a flat part", "a bowl", "all vertices at rims", "holes of 3 edges", "huge", "tiny", "far away"],
)
@pytest.mark.filterwarnings("ignore")
def test_odd_open_surfaces_are_flattened_and_all_of_their_vertices_make_a_mesh_without_error(make):
    source = make()
    problem = MeshProblem(source, surface="closed")
    everything = problem.surface.simplify(np.ones(problem.n_var, bool))
    assert everything.quality.error <= 1e-9 * problem.model.diagonal * problem.n_var
    assert everything.quality.triangles == len(source.faces)
    assert everything.quality.uncovered == 0


def flat_square():
    return np.array([[3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 1.0, 0.0], [3.0, 1.0, 0.0]])


def tube_of_two_rims(n=20):
    turn = 2.0 * np.pi * np.arange(n) / n
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate([np.column_stack([k, after, k + n]), np.column_stack([after, after + n, k + n])])
    return np.concatenate([ring, ring + np.array([0.0, 0.0, 1.0])]), faces


def first_of_each_vertex(faces):
    """Tell which faces share no vertex with one of these before."""
    used, chosen = set(), []
    for face in faces.tolist():
        chosen.append(used.isdisjoint(face))
        if chosen[-1]:
            used.update(face)
    return np.array(chosen)


def test_the_least_mesh_is_known_with_holes_and_without():
    two = joined("two", (BALL.points, BALL.faces), (BALL.points + 5.0, BALL.faces))
    assert MeshProblem(two, surface="closed").surface.least_triangles == 8
    pinned = MeshProblem(two, surface="closed", pin=list(range(10))).surface
    kept = pinned.pinned.copy()
    other = np.flatnonzero(pinned.model.part != pinned.model.part[np.argmax(pinned.model.source_index < 10)])
    kept[other[~kept[other]][:1]] = True  # the part without pins has one vertex beside its pole
    assert pinned.least_triangles == pinned.simplify(kept).quality.triangles > 8
    assert MeshProblem(scan(), surface="closed").surface.least_triangles == 1
    problem = MeshProblem(pair(), surface="closed")
    some = np.random.default_rng(1).random((200, problem.n_var)) < 0.02
    found = problem.surface.evaluate(some | problem.surface.pinned)[:, 1]
    assert found[found > 0].min() >= problem.surface.least_triangles == 2


# ------------------------------------------------------------------------------------------------------------- info


def test_info_says_holes_rims_parts_and_what_is_left_out(tmp_path, capsys):
    crumb = (np.array([[9.0, 0.0, 0.0], [9.0, 1.0, 0.0], [9.0, 0.0, 1.0]]), [[0, 1, 2]])
    source = joined("crumbs", (scan().points, scan().faces), crumb)
    write_mesh(tmp_path / "scan.ply", source.points, source.faces)
    assert main(["info", str(tmp_path / "scan.ply"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    n_edges = len(open_model(scan(), CLOSED).rim)
    known = {"surface": "closed", "components": 2, "loops": 4, "rim_edges": n_edges + 3, "caps": 3, "genus": 0}
    assert {name: said[name] for name in known} == known
    assert (said["copied"], said["small_parts_left_out"]) == (0, 1)
    assert said["not_height"].startswith("has at least")
    assert main(["info", str(tmp_path / "scan.ply")]) == 0
    out = capsys.readouterr().out
    for text in (
        r"parts +2 \(1 of fewer than 4 vertices left out\)",
        rf"holes +4 \({n_edges + 3} edges at rims\)",
        r"no height field +it has at least [\d.]+% of its faces folded over from any side tried",
        r"surface +closed",
    ):
        assert re.search(rf"^  {text}$", out, re.MULTILINE), text
    assert main(["info", str(tmp_path / "scan.ply"), "--surface", "height"]) == 2
    assert re.search(r"^  closed too +it could be taken as a closed surface", capsys.readouterr().out, re.MULTILINE)


def test_info_tells_of_a_sheet_with_a_hole_that_it_could_be_closed(capsys):
    assert main(["info", "ring:120"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^  surface +height$", out, re.MULTILINE)
    assert re.search(r"^  closed too +it could be taken as a closed surface \(--surface closed\)$", out, re.MULTILINE)


# ---------------------------------------------------------------------------------------------------- stored and read


@pytest.mark.parametrize("make", [scan, pair, ties], ids=["holes", "parts", "fans"])
@pytest.mark.filterwarnings("ignore")
def test_a_front_of_an_open_surface_is_read_back_as_it_was_made(make, tmp_path):
    source = make()
    write_mesh(tmp_path / "m.ply", source.points, source.faces)
    problem = MeshProblem(tmp_path / "m.ply", surface="closed", weights="area")
    made = Front.from_result(minimize(problem, nsga2_v1(10), ("n_gen", 2), seed=1))
    made.save(tmp_path / "out", pictures=False)
    read = Front.load(tmp_path / "out")
    assert read.model.hash == problem.model.hash
    for name in ("xy", "poles", "faces", "points", "source_index", "weights", "rim", "part", "copies"):
        assert_array_equal(getattr(read.model, name), getattr(problem.model, name), name)
    for one, same in zip(made, read, strict=True):
        assert_array_equal(one.faces, same.faces)
        assert same.simplified.quality == one.simplified.quality
    chosen = read.best(triangles=len(source.faces) // 2)
    chosen.save(tmp_path / "chosen.ply")
    written = trimesh.load(tmp_path / "chosen.ply", process=False)
    assert len(written.faces) == chosen.triangles
    # no vertex that closes a hole while it is flattened is in any file
    assert set(map(tuple, written.vertices.tolist())) <= set(map(tuple, source.points.tolist()))

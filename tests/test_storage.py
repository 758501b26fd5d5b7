"""What is written is whole, exact and the same again; what is read is checked."""

from __future__ import annotations

import dataclasses
import json
import os
import platform
import shutil
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from samples import freed, random_solutions, write_solutions

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.formats.material import IMAGES, Material
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.table import write_mesh
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.storage import FRONT_COLUMNS, claim_output, read_front, write_front
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import MEASURES, OF_LINES
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.surface import mesh_arrays


@pytest.fixture(scope="module")
def model():
    return open_model("face:200")


@pytest.fixture(scope="module")
def solutions(model):
    return random_solutions(model)


@pytest.fixture(scope="module")
def freed_solutions(model, solutions):
    """The same, with the free meshes of three of them: triangles or None."""
    kept, simplified = (list(part) for part in solutions)
    free = [None] * len(kept)
    for row in (2, 5, 9):
        mesh = freed(HeightSurface(model), kept[row])
        kept[row], simplified[row], free[row] = mesh.kept, mesh, mesh.faces
    return (np.array(kept), simplified), free


def files(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(Path(folder).rglob("*")) if p.is_file()}


def test_a_front_reads_back_as_it_was_written(tmp_path, model, solutions):
    kept, simplified = solutions
    stored = read_front(write_solutions(tmp_path / "deep" / "out", model, solutions, chosen=4))
    order = np.lexsort(([s.quality.error for s in simplified], [s.quality.triangles for s in simplified]))
    assert np.array_equal(stored.kept, kept[order])
    assert set(stored.quality) == {*MEASURES, "solution", "free"} - {*OF_LINES}
    for column in set(MEASURES) - {*OF_LINES}:
        expected = [getattr(simplified[row].quality, column) for row in order]
        assert stored.quality[column].tolist() == expected, column  # to the last bit
    assert np.array_equal(stored.F[:, 0], stored.quality["error"])
    assert np.array_equal(stored.F[:, 1], stored.quality["triangles"])
    assert np.array_equal(stored.source_index, model.source_index)
    assert stored.run["seed"] == 3
    assert stored.run["chosen"] == order.tolist().index(4)
    assert stored.run["model"]["hash"] == model.hash
    assert stored.run["versions"]["numpy"] == np.__version__
    assert stored.run["environment"] == {
        "platform": platform.platform(),
        "processor": stored.run["environment"]["processor"],
        "cores": os.cpu_count(),
    }
    assert stored.run["environment"]["processor"]


def test_other_fronts_are_stored_beside_it_sorted_by_triangles(tmp_path, model, solutions):
    others = {"greedy, worst point": [[0.1, 9], [1 / 3, 4]], 'a "b"': [[7.0, 2]]}
    stored = read_front(write_solutions(tmp_path / "out", model, solutions, series=others))
    assert {name: F.tolist() for name, F in stored.series.items()} == {
        "greedy, worst point": [[1 / 3, 4.0], [0.1, 9.0]], 'a "b"': [[7.0, 2.0]]
    }  # fmt: skip
    assert read_front(write_solutions(tmp_path / "alone", model, solutions)).series == {}
    assert not (tmp_path / "alone" / "series.csv").exists()
    for wrong in ([1.0, 2.0], [[1.0, np.nan]], np.zeros((0, 2))):
        with pytest.raises(ValueError, match="the series 'x' is no front"):
            write_solutions(tmp_path / "wrong", model, solutions, series={"x": wrong})


def test_meshes_stand_where_the_front_says_and_are_the_solutions(tmp_path, model, solutions):
    folder = write_solutions(tmp_path / "out", model, solutions)
    stored = read_front(folder)
    assert stored.meshes[0] == f"meshes/000_{stored.quality['triangles'][0]}.ply"
    for kept, triangles, path in zip(stored.kept, stored.quality["triangles"], stored.meshes, strict=True):
        mesh = trimesh.load(folder / path, process=False)
        assert len(mesh.faces) == triangles
        original = {tuple(point) for point in model.file_points[kept].tolist()}
        assert {tuple(point) for point in mesh.vertices.tolist()} <= original
        assert len(np.unique(mesh.faces)) == len(mesh.vertices)


def test_the_referee_agrees_with_the_written_front(tmp_path, model, freed_solutions, oracle):
    everything = np.ones(model.n_vertices, dtype=bool)
    assert HeightSurface(model).simplify(everything).quality.error < 1e-9
    write_mesh(tmp_path / "original.ply", model.file_points, model.faces)
    solutions, free = freed_solutions
    folder = write_solutions(tmp_path / "out", model, solutions, free=free)
    command = [sys.executable, oracle, tmp_path / "original.ply", "--front", folder / "front.csv"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.splitlines()[-1] == "0 wrong"
    assert len(run.stdout.splitlines()) == 13


def test_the_same_front_gives_the_same_bytes(tmp_path, model, solutions):
    one, two = (files(write_solutions(tmp_path / name, model, solutions, mesh_format="ply")) for name in "ab")
    assert one == two
    assert {"front.csv", "front.npz", "run.json"} < set(one)
    with zipfile.ZipFile(tmp_path / "a" / "front.npz") as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


@pytest.mark.parametrize(
    ("meshes", "written"),
    [(None, list(range(12))), (100, list(range(12))), (3, [0, 6, 11]), (1, [0]), (0, [])],
)
def test_a_long_front_writes_an_even_selection_of_its_meshes(tmp_path, model, solutions, meshes, written):
    folder = write_solutions(tmp_path / "out", model, solutions, meshes=meshes)
    stored = read_front(folder)
    assert [row for row, path in enumerate(stored.meshes) if path] == written
    on_disk = {p.relative_to(folder).as_posix() for p in folder.glob("meshes/*")}
    assert on_disk == {path for path in stored.meshes if path}


def test_a_tilted_model_is_written_back_in_its_own_frame(tmp_path):
    roof = load("roof:5")
    turned = SourceMesh(roof.points[:, [2, 0, 1]], roof.faces, {}, "turned")  # its height is along x
    model = build_model(turned, up="x")
    vertices, faces, _ = mesh_arrays(model, model.faces)
    assert np.array_equal(np.unique(vertices, axis=0), np.unique(turned.points, axis=0))
    normal = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    assert (normal[:, 0] > 0).all()


def test_an_existing_folder_is_refused_and_left_alone(tmp_path, model, solutions):
    (tmp_path / "out").mkdir()
    with pytest.raises(ResultError, match=r"out: exists already; name another folder or allow overwriting"):
        write_solutions(tmp_path / "out", model, solutions)
    assert list((tmp_path / "out").iterdir()) == []
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_own_results_are_replaced_when_asked(tmp_path, model, solutions):
    folder = write_solutions(tmp_path / "out", model, solutions, meshes=5, chosen=2)
    write_solutions(folder, model, solutions, meshes=0, overwrite=True)
    assert set(files(folder)) == {"front.csv", "front.npz", "run.json"}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("mesh_format", ["ply", "obj"])
def test_own_results_with_an_image_beside_the_chosen_mesh_are_replaced_too(tmp_path, model, solutions, mesh_format):
    look = Material(image=IMAGES[".png"] + b"...")
    painted = dataclasses.replace(model, material=look, attributes={"uv": model.points[:, :2]})
    for _ in range(2):
        folder = write_solutions(
            tmp_path / "out", painted, solutions, chosen=4, mesh_format=mesh_format, meshes=1, overwrite=True
        )
    assert [path.read_bytes() for path in folder.glob("texture-*.png")] == [look.image]
    (folder / "texture.png").write_bytes(b"a user's")
    with pytest.raises(ResultError, match=r"holds texture\.png, which is no result"):
        claim_output(folder, overwrite=True)


def test_foreign_files_are_never_deleted(tmp_path, model, solutions):
    folder = write_solutions(tmp_path / "out", model, solutions)
    (folder / "thesis.tex").write_text("years of work")
    before = files(folder)
    with pytest.raises(ResultError, match=r"out: holds thesis.tex, which is no result of meshsimp"):
        write_solutions(folder, model, solutions, overwrite=True)
    assert files(folder) == before


def test_an_old_result_survives_a_failure_while_its_successor_is_written(tmp_path, model, solutions, monkeypatch):
    folder = write_solutions(tmp_path / "out", model, solutions)
    before = files(folder)

    def fail(path, **_):
        assert path.with_name("front.csv").exists()
        raise KeyboardInterrupt

    monkeypatch.setattr("meshsimp_pymoo.storage.write_npz", fail)
    with pytest.raises(KeyboardInterrupt):
        write_solutions(folder, model, solutions, overwrite=True)
    assert files(folder) == before
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_an_old_result_survives_when_the_new_one_cannot_be_put_in_place(tmp_path, model, solutions, monkeypatch):
    folder = write_solutions(tmp_path / "out", model, solutions)
    before = files(folder)
    rename = Path.rename

    def fail_for_the_new_one(self, target):
        if self.name.endswith(".partial"):
            raise PermissionError(13, "Permission denied")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail_for_the_new_one)
    with pytest.raises(ResultError, match=r"cannot be put in place \(Permission denied\)"):
        write_solutions(folder, model, solutions, overwrite=True)
    monkeypatch.undo()
    assert files(folder) == before
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_failure_leaves_nothing(tmp_path, model, solutions, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("no ink")

    monkeypatch.setattr("meshsimp_pymoo.storage.write_npz", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        write_solutions(tmp_path / "out", model, solutions)
    assert list(tmp_path.iterdir()) == []


def test_claiming_a_folder_leaves_nothing_and_makes_nothing(tmp_path):
    assert claim_output(tmp_path / "a" / "b" / "out") == tmp_path / "a" / "b" / "out"
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultError, match="file: is a file; name a new folder"):
        claim_output(tmp_path / "file")
    with pytest.raises(ResultError, match=r"out: cannot be written in .*file \(Not a directory\)"):
        claim_output(tmp_path / "file" / "out")


def test_an_unwritable_parent_is_named(tmp_path, monkeypatch):
    def refuse(self, *args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refuse)  # root, who often runs tests, is refused nothing
    with pytest.raises(ResultError, match=r"out: cannot be written in .* \(Permission denied\); name another folder"):
        claim_output(tmp_path / "out")


def test_an_empty_or_unfinished_front_is_refused(tmp_path, model, solutions):
    kept, simplified = solutions
    surface, quality = HeightSurface(model), [s.quality for s in simplified]
    with pytest.raises(ValueError, match="the front is empty"):
        write_front(tmp_path / "out", surface, [], kept[:0])
    with pytest.raises(ValueError, match=r"kept has the shape \(11, 200\)"):
        write_front(tmp_path / "out", surface, quality, kept[:-1])
    broken = [*quality[:-1], dataclasses.replace(quality[-1], error=float("nan"))]
    with pytest.raises(ValueError, match="solution 11 has an error that is not finite"):
        write_front(tmp_path / "out", surface, broken, kept, meshes=0)
    with pytest.raises(ValueError, match="no faces are given"):
        write_front(tmp_path / "out", surface, quality, kept)
    with pytest.raises(ValueError, match="mesh_format is 'xyz'"):
        write_solutions(tmp_path / "out", model, solutions, mesh_format="xyz")
    with pytest.raises(TypeError, match=r"a set cannot be recorded in run\.json"):
        write_solutions(tmp_path / "out", model, solutions, run={"seed": {1}})
    assert list(tmp_path.iterdir()) == []


def test_meshes_that_would_be_late_are_left_out_but_the_chosen_one_is_written(tmp_path, model, solutions):
    late = write_solutions(tmp_path / "late", model, solutions, chosen=3, until=time.perf_counter())
    early = write_solutions(tmp_path / "early", model, solutions, chosen=3, until=time.perf_counter() + 60.0)
    plain = write_solutions(tmp_path / "plain", model, solutions, chosen=3)
    names = {folder: sorted(path.name for path in (folder / "meshes").iterdir()) for folder in (late, early, plain)}
    assert len(names[late]) == 1
    assert names[early] == names[plain]
    assert (late / "chosen.ply").read_bytes() == (plain / "chosen.ply").read_bytes()
    for name in names[plain]:
        assert (early / "meshes" / name).read_bytes() == (plain / "meshes" / name).read_bytes()
    assert (early / "front.csv").read_bytes() == (plain / "front.csv").read_bytes()
    stored = read_front(late)
    assert [Path(path).name for path in stored.meshes if path] == names[late]
    np.testing.assert_array_equal(stored.kept, read_front(plain).kept)
    # what takes longest is last
    kept, simplified = solutions
    quality, asked = [s.quality for s in simplified], []

    def faces(row):
        asked.append(quality[row].triangles)
        return simplified[row].faces

    how = {"faces": faces, "until": time.perf_counter() + 60.0}
    write_front(tmp_path / "order", HeightSurface(model), quality, kept, **how)
    assert asked[-1] == max(q.triangles for q in quality)
    assert asked[0] == min(q.triangles for q in quality)
    assert asked[1:-1] != sorted(asked[1:-1])


def test_a_model_in_place_of_a_surface_is_told_apart(tmp_path, model, solutions):
    kept, simplified = solutions
    with pytest.raises(TypeError, match=r"write_front: a OpenModel has no rules; give a surface"):
        write_front(tmp_path / "out", model, [s.quality for s in simplified], kept, meshes=0)


def spoil_csv(line, column, value):
    def spoil(folder):
        rows = [row.split(",") for row in (folder / "front.csv").read_text().splitlines()]
        rows[line - 1][FRONT_COLUMNS.index(column)] = value
        (folder / "front.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")

    return spoil


def cut(name, keep):
    def spoil(folder):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(keep * len(content))])

    return spoil


def spoil_npz(**changed):
    def spoil(folder):
        with np.load(folder / "front.npz") as file:
            arrays = dict(file)
        arrays |= {name: change(arrays[name]) for name, change in changed.items()}
        np.savez(folder / "front.npz", **arrays)

    return spoil


def link_out(folder):
    (folder.parent / "secret.ply").write_text("secret")
    (folder / "meshes").mkdir(exist_ok=True)
    (folder / "meshes" / "out.ply").symlink_to(folder.parent / "secret.ply")
    spoil_csv(2, "mesh", "meshes/out.ply")(folder)


def npz_bomb(folder):
    header = b"{'descr': '|u1', 'fortran_order': False, 'shape': (4000000000, 8), }".ljust(117) + b"\n"
    with zipfile.ZipFile(folder / "front.npz", "w") as archive:
        archive.writestr("kept.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)


def packed_bomb(folder):
    with zipfile.ZipFile(folder / "front.npz", "w") as archive:
        archive.writestr("kept.npy", b"\0" * 1000)
    content = (folder / "front.npz").read_bytes()
    at = content.rindex(b"PK\x01\x02")  # the directory's last entry: its unpacked size
    changed = content[: at + 24] + (4_000_000_000).to_bytes(4, "little") + content[at + 28 :]
    (folder / "front.npz").write_bytes(changed)


def change_run(**changed):
    def spoil(folder):
        run = json.loads((folder / "run.json").read_text())
        (folder / "run.json").write_text(json.dumps(run | changed))

    return spoil


def spoil_run(folder):
    run = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(run | {"solutions": 11}))


DAMAGE = {
    "another series": (
        lambda f: (f / "series.csv").write_text("name,error\na,1\n"),
        r"series\.csv: its first line must be series,minimised,triangles",
    ),
    "a word in a series": (
        lambda f: (f / "series.csv").write_text("series,minimised,triangles\na,1.5,2\na,much,7\n"),
        r"series\.csv, line 3: much,7 is no error and number of triangles",
    ),
    "an error in a series that is no number": (
        lambda f: (f / "series.csv").write_text("series,minimised,triangles\na,nan,2\n"),
        r"series\.csv, line 2: nan,2 is no error",
    ),
    "no csv": (
        lambda f: (f / "front.csv").unlink(),
        r"out: holds no front \(front\.csv is missing\); name the folder that simplify -o",
    ),
    "cut csv": (
        cut("front.csv", 0.5),
        r"front\.csv, line \d+: .*|front\.npz: its F is not that of front\.csv",
    ),
    "empty csv": (cut("front.csv", 0), r"front\.csv: its first line must be solution,error,triangles"),
    "only a header": (
        lambda f: (f / "front.csv").write_text(",".join(FRONT_COLUMNS) + "\n"),
        r"front\.csv: holds no solution",
    ),
    "text for a number": (spoil_csv(3, "error", "many"), r"front\.csv, line 3: error is 'many'"),
    "nan": (spoil_csv(3, "max_error", "nan"), r"front\.csv, line 3: max_error is 'nan'"),
    "fraction": (spoil_csv(4, "triangles", "7.5"), r"front\.csv, line 4: triangles is '7.5'"),
    "negative": (spoil_csv(4, "uncovered", "-1"), r"front\.csv, line 4: uncovered is '-1'"),
    "row missing": (spoil_csv(5, "solution", "9"), r"solutions are not numbered 0 to 11"),
    "unsorted": (spoil_csv(2, "triangles", "5000"), r"front\.csv, line 3: not sorted by triangles"),
    "climbing path": (
        spoil_csv(2, "mesh", "../x.ply"),
        r"line 2: mesh '\.\./x\.ply' is not inside the folder",
    ),
    "absolute path": (spoil_csv(2, "mesh", "/etc/x.ply"), r"line 2: mesh '/etc/x\.ply' is not inside the folder"),
    "Windows path": (spoil_csv(2, "mesh", "C:x.ply"), r"line 2: mesh 'C:x\.ply' is not inside the folder"),
    "climbing Windows path": (spoil_csv(2, "mesh", "a\\..\\..\\x.ply"), r"is not inside the folder"),
    "link that leads out": (link_out, r"line 2: mesh 'meshes/out\.ply' is not inside the folder"),
    "other error": (spoil_csv(3, "error", "1.5"), r"front\.npz: its F is not that of front\.csv"),
    "no npz": (lambda f: (f / "front.npz").unlink(), r"front\.npz: cannot be read \(No such file"),
    "cut npz": (cut("front.npz", 0.6), r"front\.npz: cannot be read \(.*File is not a zip file"),
    "no kept": (
        lambda f: np.savez(f / "front.npz", F=np.zeros((12, 2))),
        r"front\.npz: holds no array 'kept'",
    ),
    "pickled": (
        lambda f: np.savez(f / "front.npz", F=np.array([{}], dtype=object)),
        r"front\.npz: cannot be read \(.*F\.npy: holds Python objects, which are never unpickled",
    ),
    "array of 32 GB": (npz_bomb, r"front\.npz: cannot be read \(.*kept\.npy: truncated: declares"),
    "packed bomb": (packed_bomb, r"front\.npz: cannot be read \(.*declares 4000000000 bytes packed into"),
    "unpacked bits": (spoil_npz(kept=lambda k: np.unpackbits(k, axis=1)), r"kept has the shape \(12, 200\)"),
    "bools": (spoil_npz(kept=lambda k: k > 0), r"kept has the type bool"),
    "too many vertices": (
        spoil_npz(source_index=lambda s: np.append(s, [7, 8])),
        r"source_index is not a list of different rows",
    ),
    "fewer kept": (
        spoil_npz(kept=lambda k: k & 1),
        r"solution 0 keeps \d+ vertices, but front.csv says its mesh",
    ),
    "no run": (lambda f: (f / "run.json").unlink(), r"run\.json: cannot be read \(No such file"),
    "cut run": (cut("run.json", 0.5), r"run\.json: cannot be read"),
    "chosen beyond": (change_run(chosen=12), r"run\.json: chosen is not what a front's record holds"),
    "chosen no number": (change_run(chosen="0"), r"run\.json: chosen is not"),
    "model no mapping": (change_run(model="face.ply"), r"run\.json: model is not"),
    "file no text": (change_run(model={"name": "", "hash": "", "file": 3}), r"run\.json: model\.file is not"),
    "no model": (change_run(model=None), r"run\.json: model is not"),
    "model without a name": (change_run(model={"hash": "0"}), r"run\.json: model\.name is not"),
    "unknown objectives": (change_run(objectives=["foo", "triangles"]), r"run\.json: objectives is not what a front"),
    "objectives without triangles": (change_run(objectives=["error"]), r"run\.json: objectives is not"),
    "objectives in a list": (change_run(objectives=[["error"], "triangles"]), r"run\.json: objectives is not"),
    "objectives in a mapping": (change_run(objectives={"error": 1, "triangles": 2}), r"run\.json: objectives is not"),
    "wish no mapping": (change_run(wish="small"), r"run\.json: wish is not what a front"),
    "wish for nothing known": (change_run(wish={"beauty": 1}), r"run\.json: wish is not"),
    "wish for no number": (change_run(wish={"triangles": "few"}), r"run\.json: wish is not"),
    "of an earlier version": (
        change_run(settings={"footprint": "hull", "outside": "ignore"}, objectives=["error", "triangles"]),
        r"run\.json: is of an earlier version, .*; simplify the model again",
    ),
    "deep run": (lambda f: (f / "run.json").write_text("[" * 100_000), r"run\.json: cannot be read"),
    "other run": (spoil_run, r"run\.json: is not the record of this front of 12 solutions"),
    "no folder": (lambda f: shutil.rmtree(f), r"out: no such folder"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_result_is_noticed_and_named(tmp_path, model, solutions, damage):
    spoil, message = DAMAGE[damage]
    folder = write_solutions(tmp_path / "out", model, solutions, meshes=0)
    spoil(folder)
    with pytest.raises(ResultError, match=message) as caught:
        read_front(folder)
    assert "\n" not in str(caught.value)


def test_the_faces_of_free_meshes_are_read_back_where_they_belong(tmp_path, model, freed_solutions):
    """By hand: the smallest solution has the range [0, 0), the next free one begins where the last ended."""
    found, free = freed_solutions
    one, two = (write_solutions(tmp_path / name, model, found, free=free) for name in "ab")
    assert (one / "front.npz").read_bytes() == (two / "front.npz").read_bytes()
    stored = read_front(one)
    order = np.argsort([s.quality.triangles for s in found[1]], kind="stable")
    for faces, row in zip(stored.faces, order, strict=True):
        assert (faces is None) == (free[row] is None)
        assert faces is None or faces.tolist() == free[row].tolist()
    assert stored.quality["free"].tolist() == [int(free[row] is not None) for row in order]
    with np.load(one / "front.npz") as arrays:
        sizes = [0 if free[row] is None else len(free[row]) for row in order]
        assert arrays["face_start"].tolist() == [sum(sizes[:k]) for k in range(13)]
        assert arrays["faces"].tolist() == [
            face for row in order if free[row] is not None for face in free[row].tolist()
        ]
        assert arrays["faces"].dtype == np.int32
    none = read_front(write_solutions(tmp_path / "none", model, found))
    assert none.faces == (None,) * 12
    with pytest.raises(ValueError, match="free has 3 entries for 12 solutions"):
        write_solutions(tmp_path / "wrong", model, found, free=free[:3])


def free_rows(change):
    """Change the faces of the first free mesh, (M, 3), in place."""

    def spoil(folder):
        with np.load(folder / "front.npz") as file:
            arrays = dict(file)
        start = arrays["face_start"]
        change(arrays["faces"][: start[np.flatnonzero(np.diff(start))[0] + 1]])
        np.savez(folder / "front.npz", **arrays)

    return spoil


def put(at, value):
    def change(faces):
        faces[at] = value(faces) if callable(value) else value

    return free_rows(change)


FREE_DAMAGE = {
    "no faces": (
        lambda f: np.savez(f / "front.npz", **{n: a for n, a in np.load(f / "front.npz").items() if n != "faces"}),
        r"holds no array 'faces'",
    ),
    "other type": (spoil_npz(faces=lambda a: a.astype(np.int64)), r"faces has the type int64 and the shape \(\d+, 3\)"),
    "no numbers": (spoil_npz(faces=lambda a: a.astype(float)), r"faces has the type float64 and 2 dimensions"),
    "other shape": (
        spoil_npz(faces=lambda a: a[:, :2]),
        r"faces has the type int32 and the shape \(\d+, 2\) instead of",
    ),
    "a face less": (spoil_npz(faces=lambda a: a[:-1]), r"face_start does not cut its \d+ faces into those of 12"),
    "a start less": (spoil_npz(face_start=lambda a: a[:-1]), r"face_start does not cut its"),
    "starts out of order": (spoil_npz(face_start=lambda a: a[::-1].copy()), r"face_start does not cut its"),
    "negative starts": (spoil_npz(face_start=lambda a: a - 1), r"face_start does not cut its"),
    "later": (
        spoil_npz(face_start=lambda a: np.r_[0 * a[:-1], a[-1]]),
        r"holds 0 faces of solution \d+, whose free is 1 in front\.csv",
    ),
    "said to be free": (spoil_csv(2, "free", "1"), r"holds 0 faces of solution 0, whose free is 1"),
    "more than free": (spoil_csv(2, "free", "2"), r"holds 0 faces of solution 0, whose free is 2"),
    "free in words": (spoil_csv(2, "free", "yes"), r"front\.csv, line 2: free is 'yes'"),
    "not said to be free": (
        lambda f: [spoil_csv(line, "free", "0")(f) for line in range(2, 14)],
        r"holds \d+ faces of solution \d+, whose free is 0",
    ),
    "beyond the model": (put((-1, 2), 200), r"solution \d+: faces index rows \d+ to 200 of 200 vertices"),
    "negative": (put((0, 0), -1), r"solution \d+: faces index rows -1 to"),
    "unsorted": (put(slice(None), lambda f: f[::-1].copy()), r"its faces are not sorted, the smallest row first"),
    "turned": (put(slice(None), lambda f: np.roll(f, 1, axis=1)), r"its faces are not sorted"),
    "a face twice": (put(1, lambda f: f[0].copy()), r"one triangle twice"),
    "a corner twice": (put((0, 2), lambda f: f[0, 1]), r"a vertex twice in one triangle"),
    "a vertex that is not kept": (
        spoil_npz(kept=lambda k: np.roll(k, 1, axis=1)),
        r"solution \d+: its faces use vertex \d+, which it does not keep",
    ),
    "of fewer vertices": (
        lambda f: [spoil_csv(line, "vertices", "3")(f) for line in range(2, 14)],
        r"solution \d+: its faces are \d+ triangles of \d+ vertices, and it is said to have \d+ of 3",
    ),
}


@pytest.mark.parametrize("damage", FREE_DAMAGE)
def test_damaged_faces_are_noticed_and_named(tmp_path, model, freed_solutions, damage):
    spoil, message = FREE_DAMAGE[damage]
    found, free = freed_solutions
    folder = write_solutions(tmp_path / "out", model, found, free=free, meshes=0)
    read_front(folder)
    spoil(folder)
    with pytest.raises(ResultError, match=message) as caught:
        read_front(folder)
    assert "\n" not in str(caught.value)


def test_a_bit_beyond_the_last_vertex_is_noticed(tmp_path):
    surface = HeightSurface(open_model("roof:3"))
    kept = np.ones((1, 9), dtype=bool)
    whole = surface.simplify(kept[0])
    folder = write_front(tmp_path / "out", surface, [whole.quality], kept, meshes=0)
    spoil_npz(kept=lambda k: k | 1)(folder)
    with pytest.raises(ResultError, match="kept has bits set beyond the 9 vertices"):
        read_front(folder)

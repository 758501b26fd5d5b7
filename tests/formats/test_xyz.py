"""Clouds as text: whatever stands between the numbers, and text that is none."""

from __future__ import annotations

import pytest
from clouds import scattered
from numpy.testing import assert_array_equal

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.table import read_source

XYZ = [[0.5, 1.0, 2.0], [4.25, 0.0, 1.0], [4.0, 4.5, -1.0], [0.0, 4.0, 1e-3], [2.0, 2.0, 3.0]]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.xyz", "0.5 1 2\n4.25 0 1\n4 4.5 -1\n0 4 1e-3\n2 2 3\n"),
        ("a.XYZ", "\n\n  0.5\t1   2\r\n4.25 0 1\r\n\r\n4 4.5 -1\r\n0 4 1e-3\r\n2 2 3"),
        ("b.txt", "# made by hand\n0.5, 1, 2\n4.25,0 ,1\n4,4.5,-1 // high\n0,4,1e-3\n2,2,3\n"),
        ("c.csv", "0.5;1;2\n4.25;0;1\n4;4.5;-1\n0;4;1e-3\n2;2;3\n"),
        ("d.csv", "0,5;1;2\n4,25;0;1\n4;4,5;-1\n0;4;1e-3\n2;2;3\n"),
        ("e.txt", "0,5 1,0 2,0\n4,25 0 1\n4 4,5 -1\n0 4 1e-3\n2 2 3\n"),
        ("f.csv", "X,Y,Z\n0.5,1,2\n4.25,0,1\n4,4.5,-1\n0,4,1e-3\n2,2,3\n"),
        ("g.csv", '"id","z","x","y"\n7,2,0.5,1\n8,1,4.25,0\n9,-1,4,4.5\n10,1e-3,0,4\n11,3,2,2\n'),
        ("h.pts", "5\n0.5 1 2 7 1 2 3\n4.25 0 1 7 1 2 3\n4 4.5 -1 7 1 2 3\n0 4 1e-3 7 1 2 3\n2 2 3 7 1 2 3\n"),
        ("i.xyz", "\ufeff0.5 1 2\n4.25 0 1\n4 4.5 -1\n0 4 1e-3\n2 2 3\n"),
    ],
)
def test_text_is_read_whatever_stands_between_its_numbers(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(text.encode())
    source = read_source(path)
    assert_array_equal(source.points, XYZ)
    assert len(source.faces) == 4


def test_colours_behind_the_coordinates_are_kept(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text("\n".join(f"{x} {y} {z} {k} 200 255" for k, (x, y, z) in enumerate(XYZ)))
    assert_array_equal(read_source(path).attributes["color"][:, :3], [[k, 200, 255] for k in range(5)])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0 0 0\n1 0 0\n1 1 0\n0 1\n2 2 2\n", "the 4. line of numbers has 2, where the first has 3"),
        ("0 0\n1 0\n1 1\n0 1\n", "has 2, where 3 are needed"),
        ("0 0 0\n1 0 0\n1 x 0\n0 1 0\n", "'x' stands where a number should"),
        ("easting northing\n0 0\n", "neither holds numbers nor names"),
        ("0 0 0\n1 0 0\n1 1 0\n", "3 vertices"),
        ("# nothing\n", "0 vertices"),
        ("0 0 0\n1 0 inf\n1 1 0\n0 1 0\n", "1 of 4 vertices"),
        ("\0\0\0", "zero bytes"),
    ],
)
def test_text_that_is_no_cloud_is_refused_in_one_line(tmp_path, text, said):
    (tmp_path / "a.xyz").write_text(text)
    with pytest.raises(ModelError, match=said) as caught:
        read_source(tmp_path / "a.xyz")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "a.xyz"))


def test_a_pts_with_fewer_points_than_it_says_is_refused(tmp_path):
    (tmp_path / "a.pts").write_text("6\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 2 2\n")
    with pytest.raises(ModelError, match="declares 6 points, but 5 follow"):
        read_source(tmp_path / "a.pts")


def test_lines_are_compared_across_the_pieces_that_are_read_at_once(tmp_path, monkeypatch):
    from meshsimp_pymoo.formats import xyz

    points = scattered(300)
    lines = [" ".join(map(repr, row)) for row in points.tolist()]
    (tmp_path / "a.xyz").write_text("\n".join(lines))
    lines[271] += " 7"
    (tmp_path / "b.xyz").write_text("\n".join(lines))
    for size in (7, 100, 4096):
        monkeypatch.setattr(xyz, "CHUNK_BYTES", size)
        assert_array_equal(read_source(tmp_path / "a.xyz").points, points)
        with pytest.raises(ModelError, match=r"the 272\. line of numbers has 4, where the first has 3"):
            read_source(tmp_path / "b.xyz")

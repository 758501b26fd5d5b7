"""Clouds as text: whatever stands between the numbers, and text that is none."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from clouds import scattered
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
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
        ("j.csv", "\ufeffFID;POINT_X;POINT_Y;POINT_Z\n1;0,5;1;2\n2;4,25;0;1\n3;4;4,5;-1\n4;0;4;1e-3\n5;2;2;3\n"),
        ("k.txt", "//X Y Z\n5\n0.5 1 2\n4.25 0 1\n4 4.5 -1\n0 4 1e-3\n2 2 3\n"),
        ("l.txt", "5\n# n e h\n1 0.5 2\n0 4.25 1\n4.5 4 -1\n4 0 1e-3\n2 2 3\n"),
        ("m.csv", "Northing [m],Easting [m],Height (m)\n1,0.5,2\n0,4.25,1\n4.5,4,-1\n4,0,1e-3\n2,2,3\n"),
        ("n.csv", "Elevation_m\tLat\tLong\n2\t1\t0.5\n1\t0\t4.25\n-1\t4.5\t4\n1e-3\t4\t0\n3\t2\t2\n"),
        ("i.xyz", "\ufeff0.5 1 2\n4.25 0 1\n4 4.5 -1\n0 4 1e-3\n2 2 3\n"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*its coordinates are degrees")
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


# Points as survey programs write them: number, northing, easting, height, description.
WORDS = ["EP", '"a, b"', "MH #3", "", "4"]
PNEZD = [f"{k + 7},{y},{x},{z},{WORDS[k]}" for k, (x, y, z) in enumerate(XYZ)]


def lines(rows, head=""):
    return "\n".join(([head] if head else []) + list(rows)) + "\n"


def test_columns_that_are_no_coordinates_are_attributes_and_text_is_counted(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(lines(PNEZD, "point,northing,easting,elevation,description"))
    with pytest.warns(ModelWarning, match=r"a\.csv: columns without numbers stay behind: 'description'$"):
        source = read_source(path)
    assert_array_equal(source.points, XYZ)
    assert list(source.attributes) == ["point"]
    assert_array_equal(source.attributes["point"], [7, 8, 9, 10, 11])
    rows = (f"{x} {y} {z} {k} 200 255 {k / 4}" for k, (x, y, z) in enumerate(XYZ))
    path.write_text(lines(rows, "//X Y Z R G B Intensity"))
    source = read_source(path)
    assert sorted(source.attributes) == ["Intensity", "color"]
    assert_array_equal(source.attributes["color"][:, 0], range(5))
    assert_array_equal(source.attributes["Intensity"], [0, 0.25, 0.5, 0.75, 1])


def test_the_columns_of_x_y_and_z_can_be_said_by_name_or_number(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(lines(PNEZD))
    with pytest.warns(ModelWarning) as caught:
        wrong = read_source(path)
    assert_array_equal(wrong.points[:, 0], [7, 8, 9, 10, 11])
    said = [str(item.message) for item in caught]
    assert len(said) == 2
    assert "its first column of numbers only counts (7, 8, 9, ...), yet is taken for x" in said[0]
    assert "(--columns 2,3,4)" in said[0]
    assert said[1].endswith("columns without numbers stay behind: no. 5")
    with pytest.warns(ModelWarning, match=r"stay behind: no\. 5$"):
        assert_array_equal(read_source(path, Options(columns=(3, 2, 4))).points, XYZ)
    path.write_text(lines((f"{x};{z};{y};9" for x, y, z in XYZ), "X;H 1;Y;H 2"))
    for columns in (("X", "Y", "H 1"), ("x", "y", "h_1"), (1, "y", 2)):
        source = read_source(path, Options(columns=columns))
        assert_array_equal(source.points, XYZ)
        assert list(source.attributes) == ["H 2"]
    for columns, said in [
        (None, "its header 'X;H 1;Y;H 2' neither .*--columns"),
        (("x", "y", "h"), "has no column 'h', but X, H 1, Y, H 2; give other --columns"),
        ((1, 3, 5), "has no column 5, but 4 of them"),
    ]:
        with pytest.raises(ModelError, match=said):
            read_source(path, Options(columns=columns))
    path.write_text(lines((f"{x},{y},8,9,{z}" for x, y, z in XYZ), "lon,lat,x,Y,h"))
    source = read_source(path, Options(columns=("lon", "lat", "h")))
    assert_array_equal(source.points, XYZ)
    assert sorted(source.attributes) == ["Y_in_file", "x_in_file"]  # as PLY writes them beside the coordinates
    path.write_text(lines(f"{x} {y} {z}" for x, y, z in XYZ))
    with pytest.raises(ModelError, match="has no column 'x', since no line names its columns"):
        read_source(path, Options(columns=("x", 2, 3)))


def test_where_several_columns_may_be_the_height_it_is_said_which_is_taken(tmp_path):
    (tmp_path / "a.csv").write_text(lines((f"9,{x},{y},{z}" for x, y, z in XYZ), "elevation,x,y,z"))
    with pytest.warns(ModelWarning, match="several of its columns may be x, y and z; x, y, z are taken"):
        assert_array_equal(read_source(tmp_path / "a.csv").points, XYZ)


def test_coordinates_by_longitude_and_latitude_are_degrees(tmp_path):
    (tmp_path / "a.csv").write_text(lines((f"{y},{x},{z}" for x, y, z in XYZ), "lat,lon,elevation"))
    with pytest.warns(ModelWarning, match="its coordinates are degrees; lengths are measured in metres"):
        source = read_source(tmp_path / "a.csv")
    assert_array_equal(source.points, XYZ)
    assert source.georeference["unit"] == "degree"
    assert source.georeference["scale"] == pytest.approx([111_234, 110_576], abs=1)  # at 2.25 degrees north
    (tmp_path / "a.csv").write_text(lines((f"{x},{y},{z}" for x, y, z in XYZ), "east,north,elevation"))
    assert "unit" not in read_source(tmp_path / "a.csv").georeference


@pytest.mark.parametrize("value", ["-9999", "-3.4028234663852886e+38", "-3.40282e+38", "-1.7976931348623157e+308"])
def test_points_without_a_sample_are_warned_of_and_the_advice_helps(tmp_path, value):
    path = tmp_path / "a.xyz"
    path.write_text(lines(f"{x} {y} {z}" for x, y, z in [*XYZ, (9, 9, value), (8, 8, value)]))
    too_large = pytest.raises(ModelError, match="coordinates reach 1") if "308" in value else contextlib.nullcontext()
    far = r"a\.xyz: 2 of 7 heights are -\S+, far from all others \(-1 to 3\)"
    with pytest.warns(ModelWarning, match=far) as caught, too_large:
        assert len(read_source(path).points) == 7  # a warning, no more
    advice = str(caught[0].message).partition("(--nodata=")[2].rstrip(")")
    assert_array_equal(read_source(path, Options(nodata=float(advice))).points, XYZ)


def test_points_that_lack_a_number_are_left_out_with_their_count(tmp_path):
    path = tmp_path / "a.csv"
    for missing in ("9,9,nan", "9,9,", "9,NaN,1", "9,9,null"):
        path.write_text(lines([missing, *(f"{x},{y},{z}" for x, y, z in XYZ), missing]))
        with pytest.warns(ModelWarning, match=r"2 of 7 points lack a coordinate \(NaN or empty\) and were left out"):
            source = read_source(path)
        assert_array_equal(source.points, XYZ)
        assert_array_equal(source.rows, range(1, 6))


def test_a_text_cloud_with_classes_is_filtered_by_them(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(lines([*(f"{x},{y},{z},2" for x, y, z in XYZ), "9,9,9,5"], "x,y,z,Classification"))
    assert_array_equal(read_source(path, Options(classes=2)).points, XYZ)
    path.write_text(lines(f"{x},{y},{z}" for x, y, z in XYZ))
    with pytest.raises(ModelError, match="does not say the classes of its points"):
        read_source(path, Options(classes=2))


def test_a_pts_with_intensities_keeps_them_apart_from_its_colours(tmp_path):
    path = tmp_path / "a.pts"
    path.write_text(lines((f"{x} {y} {z} {-k} 1 2 3" for k, (x, y, z) in enumerate(XYZ)), "5"))
    attributes = read_source(path).attributes
    assert_array_equal(attributes["intensity"], [0, -1, -2, -3, -4])
    assert_array_equal(attributes["color"], [[1, 2, 3, 255]] * 5)


@given(
    values=st.lists(st.tuples(*[st.floats(-1e6, 1e6).filter(lambda x: abs(x) > 1e-3)] * 4), min_size=5, max_size=12),
    order=st.permutations(range(4)),
    names=st.sampled_from(["x y z", "Easting Northing Height", "POINT_X POINT_Y POINT_Z", "E N H", "lon lat alt"]),
    separator=st.sampled_from([";", "\t", ",", " ", ", ", "  "]),
    decimal_comma=st.booleans(),
    quotes=st.booleans(),
    text=st.booleans(),
)
@pytest.mark.filterwarnings("ignore:.*its coordinates are degrees")
def test_a_table_means_the_same_whatever_its_order_names_and_separators(
    tmp_path_factory, values, order, names, separator, decimal_comma, quotes, text
):
    table = np.array(values)
    table[:, :2] = np.random.default_rng(0).random((len(table), 2))  # different places

    def spelled(value):
        value = repr(float(value)) if not isinstance(value, str) else value
        value = value.replace(".", ",") if decimal_comma and "," not in separator else value
        return f'"{value}"' if quotes else value

    head = [[*names.split(), "w"][k] for k in order]
    rows = [[row[k] for k in order] + ["tree"] * text for row in table.tolist()]
    path = tmp_path_factory.mktemp("text") / "a.txt"
    path.write_text(lines(separator.join(map(spelled, row)) for row in [head + ["what"] * text, *rows]))
    if text:
        with pytest.warns(ModelWarning, match="stay behind: 'what'"):
            source = read_source(path)
    else:
        source = read_source(path)
    assert_array_equal(source.points, table[:, :3])
    assert_array_equal(source.attributes["w"], table[:, 3])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0 0 0\n1 0 0\n\n# high\n1 1 0\n0 1\n2 2 2\n", "its line 6 has 2 columns, where the first one has 3"),
        ("0 0 0 A\n1 0 0\n1 1 0 B\n0 1\n2 2 2\n", "its line 4 has 2 columns, where 3 are needed"),
        ("0 0\n1 0\n1 1\n0 1\n", "its line 1, '0 0', has fewer than 3 numbers"),
        ("1\n2\n3\n4\n", "its line 2, '2', has fewer than 3 numbers"),
        ("1,234.5 2,345.6 10.0\n" * 4, "has fewer than 3 numbers between the same separators"),
        ("0 0 0\n1 0 0\n1 x 0\n0 1 0\n", "'x' stands where a finite number should, in line 3"),
        ("easting northing\n0 0\n", "its line 2, '0 0', has fewer than 3 numbers"),
        ("easting northing\n0 0 0\n", "neither holds numbers nor names .*--columns"),
        ("Dear reader,\nhow are you?\n", "its line 2, 'how are you.', is the second one without numbers"),
        ("x y z\n", "no line of 3 numbers follows"),
        ("0 0 0\n1 0 0\n1 1 0\n", "3 vertices"),
        ("# nothing\n", "0 vertices"),
        ("0 0 0\n1 0 inf\n1 1 0\n0 1 0\n", "'inf' stands where a finite number should, in line 2"),
        ("0 0 0\n1 0 0\n1 1 -1e999\n0 1 0\n", "'-1e999' stands where a finite number should, in line 3"),
        ("x " * 40_000, "has more than 65536 characters"),
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
        monkeypatch.setattr(xyz, "CHUNK_SIZE", size)
        assert_array_equal(read_source(tmp_path / "a.xyz").points, points)
        with pytest.raises(ModelError, match=r"its line 272 has 4 columns, where the first one has 3"):
            read_source(tmp_path / "b.xyz")

"""How a model is read: what its file does not say, or says otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.settings import (
    LARGEST,
    Choice,
    Column,
    Direction,
    Part,
    Real,
    Scale,
    Several,
    Steps,
    Whole,
    documented,
    setting,
    settle,
)

# The part of a grid to take: column, row, columns, rows.
Window = tuple[int, int, int, int]


@documented
@dataclass(frozen=True)
class Options:
    """How a model is read. The fields are arguments of ``MeshProblem``, options of the shell and keys of YAML files.

    Parameters
    ----------
    SETTINGS

    Raises
    ------
    InputError
        If a value is none that the setting takes.
    """

    surface: str = setting(
        "auto",
        kind=Choice(("auto", "height", "closed")),
        accepts='"auto", "height" or "closed"',
        doc="What the model is: a height field seen from one side, or a closed surface: parts of genus 0, with holes "
        "or without. By default the first of both that it passes for.",
        help="what the model is: a height field, seen from one side, or a closed surface: parts like spheres, with "
        "holes or without (default: the first of both that it passes for)",
    )
    up: Any = setting(
        "auto",
        kind=Direction(),
        accepts='"auto", an axis such as "z" or "-x", or a vector',
        doc="Direction of the height.",
        help="direction of the height (default: auto); --up=-z",
        metavar="auto|x|y|z|X,Y,Z",
    )
    patch: str | None = setting(
        None,
        kind=Choice(("front",)),
        accepts='"front", optional',
        doc="Cut out the largest connected patch of the mesh that faces up and does not overlap itself.",
        help="take only the largest connected patch that faces up and does not overlap itself",
    )
    repair: str = setting(
        "mend",
        kind=Choice(("mend", "none")),
        accepts='"mend" or "none"',
        doc="Whether small defects of a mesh are mended: faces listed twice, wound the other way, or at edges of more "
        "than two (of these at most 1 %).",
        help="mend small defects of a mesh, and say how many: faces listed twice, wound the other way or at edges of "
        "more than two; none: take it as it is",
    )
    spacing: float | tuple[float, float] | None = setting(
        None,
        kind=Steps(),
        accepts="float or (dx, dy), optional",
        doc="Sample distances of a height grid; by default what the file says, else 1 [units].",
        help="of the samples of a height grid",
        metavar="D|DX,DY",
        describes=("grid",),
    )
    nodata: float | None = setting(
        None,
        kind=Real(most=LARGEST),
        accepts="float, optional",
        doc="Height that means 'no sample' in a height grid or a point cloud, beside NaN; by default what the file "
        "says, else none.",
        help="height that means no sample in a height grid or a point cloud",
        metavar="Z",
        describes=("grid", "cloud"),
    )
    window: Window | None = setting(
        None,
        kind=Part(),
        accepts="(column, row, columns, rows), optional",
        doc="The part of a height grid to take, from 0, as ``gdal_translate -srcwin`` has it.",
        help="the part of a height grid to take, from 0",
        metavar="COLUMN,ROW,COLUMNS,ROWS",
        describes=("grid",),
    )
    band: int | None = setting(
        None,
        kind=Whole(1),
        accepts="int, optional",
        doc="The band of a GeoTIFF that holds the heights, from 1; needed where there are several.",
        help="the band of a GeoTIFF that holds the heights, from 1",
        metavar="N",
        describes=("geotiff",),
    )
    encoding: str | None = setting(
        None,
        kind=Choice(("mapbox", "terrarium")),
        accepts='"mapbox" or "terrarium", optional',
        doc="How the colours of a terrain-RGB PNG are heights [m]: -10000 + (65536 R + 256 G + B) / 10, or "
        "256 R + G + B / 256 - 32768.",
        help="how the colours of a terrain-RGB PNG are heights",
        describes=("png",),
    )
    max_edge: float | None = setting(
        None,
        kind=Real(0, strict=True),
        accepts="float, optional",
        doc="Longest edge in the plane of a triangle of a point cloud [units]: keeps bays of its outline and holes "
        "open.",
        help="longest edge of a triangle of a point cloud, in the plane: keeps bays of its outline and holes open "
        "(default: its convex hull is covered)",
        metavar="L",
        describes=("cloud",),
    )
    classes: tuple[int, ...] | None = setting(
        None,
        kind=Several(Whole(0, 255)),
        accepts="int or list of int, optional",
        doc="Classes of the points of a point cloud that are taken, as LAS numbers them: 2 is ground; by default all.",
        help="take the points of these classes of a cloud alone: 2 is ground, `meshsimp info` says which there are",
        metavar="K,...",
        describes=("cloud",),
    )
    columns: tuple[str | int, ...] | None = setting(
        None,
        kind=Several(Column(), 3),
        accepts="list of three str or int, optional",
        doc="The columns of x, y and z (the height) in a point cloud that is text: names that its header has, or "
        "numbers from 1; by default the usual names in a header, else the first three columns of numbers.",
        help="the columns of x, y and height in a cloud of text: names in its header, or numbers from 1",
        metavar="X,Y,Z",
        describes=("xyz",),
    )

    scale: str | tuple[float, float] | None = setting(
        None,
        kind=Scale(),
        accepts='"degrees", (sx, sy) or "none", optional',
        doc="Metres to a unit of x and y, by which the plane is scaled before anything is measured; files keep their "
        'coordinates. By default, and with ``"degrees"``, found out where coordinates are degrees: at the middle '
        'latitude; ``"none"`` measures them as they are.',
        help="metres to a unit of x and y: the plane is scaled by them before anything is measured, files keep their "
        "coordinates (default: that of degrees, at the middle latitude, where the reference system has them; "
        "degrees: also where the file does not say so; none: measured as they are)",
        metavar="SX,SY|degrees|none",
    )

    def __post_init__(self) -> None:
        settle(self)

    __repr__ = as_made

    @property
    def steps(self) -> tuple[float, float] | None:
        """The sample distances along rows and columns, if they are given."""
        return cast("tuple[float, float] | None", self.spacing)


DEFAULT = Options()

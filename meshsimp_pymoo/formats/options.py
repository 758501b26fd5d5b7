"""How a model is read: what its file does not say, or says otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from meshsimp_pymoo.settings import LARGEST, Choice, Direction, Part, Real, Steps, Whole, setting, settle

# The part of a grid to take: column, row, columns, rows.
Window = tuple[int, int, int, int]


@dataclass(frozen=True)
class Options:
    """How a model is read. The fields are arguments of ``MeshProblem``, options of the shell and keys of YAML files.

    Raises
    ------
    InputError
        If a value is none that the setting takes.
    """

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
        doc="Height that means 'no sample' in a height grid, beside NaN; by default what the file says, else none.",
        help="height that means no sample in a height grid",
        metavar="Z",
        describes=("grid",),
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

    def __post_init__(self) -> None:
        settle(self)

    @property
    def steps(self) -> tuple[float, float] | None:
        """The sample distances along rows and columns, if they are given."""
        return cast("tuple[float, float] | None", self.spacing)


DEFAULT = Options()

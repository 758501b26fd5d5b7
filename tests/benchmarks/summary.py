"""Sum up the tables of ``quality.py`` in one: ``python tests/benchmarks/summary.py`` writes ``quality/summary.md``.

Geometric means over all models and sizes of a file, as its own tables of means have them; of free meshes over those
models that the other methods were tried on, too.
"""

from __future__ import annotations

import re
from pathlib import Path
from statistics import geometric_mean, median
from typing import NamedTuple

QUALITY = Path(__file__).with_name("quality")
SUMMARY = QUALITY / "summary.md"
CLASSES = ("small", "medium", "large")
# What the table calls a search, what the benchmark does, the file if it is not that of the class, and the measure.
SEARCHES = (
    ("`memetic`", "memetic", "", "error"),
    ("`memetic`, free meshes", "memetic free", "free", "error"),
    ("... their surface error, between the vertices", "memetic free", "free", "surface error"),
)
OTHERS = {
    "MeshLab, border kept": "MeshLab's quadric collapse, border kept",
    "worst triangle": "greedy insertion, worst triangle",
    "worst point": "greedy insertion, worst point",
    "pydelatin": "pydelatin (full grids only)",
    "pyfqmr": "pyfqmr",
    "fast-simplification": "fast-simplification",
    "NSGA-II v1": "NSGA-II v1 as in the paper, 50 generations",
}


class Row(NamedTuple):
    """What a table has of a method on a model."""

    model: str
    n_vertices: int
    measure: str
    method: str
    cells: list[str]

    @property
    def ratios(self) -> list[float]:
        """Errors relative to thinning's, of meshes that are small enough."""
        fitting = [cell for cell in self.cells if re.match(r"\d", cell) and "only at" not in cell]
        return [float(cell.split()[0].rstrip(",")) for cell in fitting]


def rows_of(text: str) -> list[Row]:
    """Return the rows of all tables of single models in a file of ``quality.py``."""
    rows: list[Row] = []
    here: tuple[str, int, str] | None = None
    n_vertices = 0
    for line in text.splitlines():
        if line.startswith("###"):
            title = re.fullmatch(r"### (\S+): (?:N = (\d+), )?(error|surface error) relative to thinning's", line)
            n_vertices = int(title[2] or n_vertices) if title else n_vertices
            here = (title[1], n_vertices, title[3]) if title else None
        elif here and line.startswith("| ") and not line.startswith("| method"):
            method, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            rows.append(Row(*here, method, cells))
    return rows


def mean_of(rows: list[Row], measure: str, method: str, models: list[str]) -> tuple[float, int] | None:
    """Return the geometric mean and its number of meshes; None: there are none."""
    first = 1 if measure == "error" else 0  # seconds
    found = [row for row in rows if (row.measure, row.method) == (measure, method) and row.model in models]
    ratios = [ratio for row in found for ratio in row._replace(cells=row.cells[first:]).ratios]
    return (geometric_mean(ratios), len(ratios)) if ratios else None


def means_of(text: str, measure: str, models: list[str]) -> dict[str, float]:
    """Return the means over these very models that a file of ``quality.py`` has itself, by method."""
    names = re.escape(", ".join(models))
    sheet = re.search(
        rf"### Geometric means of {measure} / thinning's: \w+ models \({names}\)\n(.*?)\n(?:#|\Z)", text, re.S
    )
    if sheet is None:
        return {}
    table = [[cell.strip() for cell in line.strip("|").split("|")] for line in sheet[1].splitlines() if line[:1] == "|"]
    return {row[0]: float(row[table[0].index("all")]) for row in table[2:]}


def by_seconds(search: str, means: dict[str, float]) -> str:
    """Return the means of a search, by the seconds that it was given."""
    found = [
        (int(name[1]), mean) for method, mean in means.items() if (name := re.fullmatch(rf"{search} (\d+) s", method))
    ]
    return ", ".join(f"{mean:.2f} ({seconds} s)" for seconds, mean in sorted(found))


def summary() -> str:
    """Return the page."""
    files = {name: (QUALITY / f"{name}.md").read_text(encoding="utf-8") for name in (*CLASSES, "free")}
    every = {name: rows_of(text) for name, text in files.items()}
    table: dict[str, list[str]] = {}
    heads = []
    for name in CLASSES:
        rows = every[name]
        sizes = {row.model: row.n_vertices for row in rows}
        models = list(sizes)
        extent = " to ".join(f"{n:,}".replace(",", " ") for n in sorted({min(sizes.values()), max(sizes.values())}))
        heads.append(f"{', '.join(models) if len(models) < 3 else f'{len(models)} models'}: N = {extent}")
        for called, search, source, measure in SEARCHES:
            source = source or name
            methods = {row.method for row in every[source]}
            own = {method: mean_of(every[source], measure, method, models) for method in methods}
            means = means_of(files[source], measure, models) | {method: mean[0] for method, mean in own.items() if mean}
            table.setdefault(called, []).append(by_seconds(search, means))
        seconds = median(float(row.cells[0]) for row in rows if row.method == "thinning, its error")
        table.setdefault("adaptive thinning", []).append(f"1 ({seconds:.2g} s)")
        for method, called in OTHERS.items():
            mean = mean_of(rows, "error", method, models)
            n_all = 4 * len(models)
            of = "" if mean is None or mean[1] == n_all else f" ({mean[1]} of {n_all})"
            table.setdefault(called, []).append("" if mean is None else f"{mean[0]:.2f}{of}")
    lines = [
        "Error relative to adaptive thinning's at equal triangles, lower is better: geometric means over 2, 5, 10 and",
        "20 % of the vertices. Two shared cores; whole fronts are searched in the seconds stated. *18 of 36*: so many",
        "of the meshes were small enough, or the method takes such models.",
        "",
        f"| method | {' | '.join(heads)} |",
        "|---|" + "---|" * len(heads),
        *(f"| {method} | {' | '.join(cells)} |" for method, cells in table.items()),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write it."""
    SUMMARY.write_text(summary(), encoding="utf-8")


if __name__ == "__main__":
    main()

"""Experiments with fronts made by hand, stored as the runner stores them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from meshsimp_pymoo.comparison.store import claim_experiment, write_experiment, write_model, write_run
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.settings import plain
from meshsimp_pymoo.surface.rules import Rules

PRESETS = {
    "N1": "nsga2_v1", "N2": "nsga2_v2", "MD": "moead", "MD normalised": "moead", "G1": "weighted_ga_v1",
    "G2": "weighted_ga_v2", "N1 common": "nsga2_v1", "G1 common": "weighted_ga_v1",
}  # fmt: skip
BUDGET = "9 generations"
Front = list[tuple[float, float]]


def store(
    folder: Path,
    fronts: Mapping[str, Mapping[str, Mapping[int, Front]]],
    *,
    classic: Mapping[str, Mapping[str, list[tuple[float, float, bool]]]] | None = None,
    outside: str = "nearest",
    nearest: float = 1.0,
    seconds: Mapping[str, float] | None = None,
    title: str = "by hand",
    merged: Collection[str] = (),
) -> Path:
    """Store an experiment.

    ``fronts[problem][method][seed]`` are rows (error, triangles), ``classic[problem][method]`` rows (error,
    triangles, of the paper's series); with ``nearest``, every error is so many times larger when uncovered
    vertices cost. Each front of the methods ``merged`` comes from two searches that found the same.
    """
    out = claim_experiment(folder)
    model = MeshProblem("roof:3").model
    stored = write_model(out, model)
    problems, runs, rows = [], [], []
    for problem, methods in fronts.items():
        problems.append(
            {
                "name": problem, "source": "roof:3", "options": plain(Options()),
                "rules": plain(Rules(outside=outside)), "limits": {}, "stored": stored,
                "hash": model.hash, "vertices": model.n_vertices, "triangles": len(model.faces),
            }
        )  # fmt: skip
        for method, seeds in methods.items():
            for seed, front in seeds.items():
                F = np.array(front, dtype=float)
                for value in (0, 1) if method in merged else (None,):
                    description = {
                        "problem": problem, "algorithm": {"name": method, "merged": {"w": value}}, "seed": seed,
                        "budget": {"generations": 9},
                    }  # fmt: skip
                    facts = {
                        "problem": problem, "algorithm": method, "seed": seed, "budget": BUDGET, "generations": 9,
                        "evaluations": 900, "seconds": (seconds or {}).get(method, 1.0) + 0.01 * seed, "versions": {},
                    }  # fmt: skip
                    label = f"{problem} {method} {seed} {value}"
                    path = write_run(out / "runs", label, description, arrays(F, nearest), facts)
                    runs.append(
                        {
                            "key": path.stem.rpartition(".")[2], "problem": problem, "algorithm": method,
                            "merged_value": value, "seed": seed, "budget": BUDGET,
                        }
                    )  # fmt: skip
    for problem, methods in (classic or {}).items():
        for method, meshes in methods.items():
            F = np.array([mesh[:2] for mesh in meshes], dtype=float)
            extra = {
                "asked": F[:, 1].astype(int), "paper": np.array([mesh[2] for mesh in meshes]),
                "mesh_vertices": np.zeros((0, 3)), "mesh_faces": np.zeros((0, 3), np.int32),
                "vertex_start": np.zeros(len(F) + 1, int), "face_start": np.zeros(len(F) + 1, int),
            }  # fmt: skip
            facts = {"seconds": 0.5, "notes": [""] * len(F), "versions": {}}
            description = {"baseline": method, "model": problem}
            path = write_run(out / "runs", f"{problem} {method}", description, arrays(F, nearest) | extra, facts)
            rows.append({"key": path.stem.rpartition(".")[2], "problem": problem, "method": method})
    names = list(dict.fromkeys(method for methods in fronts.values() for method in methods))
    seeds = sorted({seed for methods in fronts.values() for runs_ in methods.values() for seed in runs_})
    write_experiment(
        out,
        {
            "title": title,
            "problems": problems,
            "algorithms": [
                {
                    "name": name, "preset": PRESETS.get(name, ""), "class": "", "merged_parameter": "",
                    "merged_values": [0, 1] if name in merged else [None],
                    "description": {
                        "parameters": {"normalised": True} if "normalised" in name else {},
                        "settings": {
                            "sampling": {"class": "X.RandomSubset", "size": 0.2 if "common" in name else None},
                        },
                    },
                }
                for name in names
            ],
            "seeds": seeds,
            "budgets": [{"name": BUDGET, "generations": 9}],
            "baselines": None,
            "runs": runs,
            "classic": rows,
            "skipped": [],
        },
    )  # fmt: skip
    return out


def arrays(F: np.ndarray, nearest: float) -> dict[str, np.ndarray]:
    n = len(F)
    return {
        "F": F.reshape(n, 2), "kept": np.zeros((n, 2), np.uint8), "error_nearest": F.reshape(n, 2)[:, 0] * nearest,
        "vertices": np.full(n, 5), "uncovered": np.full(n, 3), "mean_error": np.full(n, 0.5),
        "rms_error": np.full(n, 0.6), "max_error": np.full(n, 0.7), "surface_error": np.full(n, 0.4),
        "min_angle_median": np.full(n, 30.0), "below_5_degrees": np.full(n, 0.25),
    }  # fmt: skip

"""QGIS, which opens what this package writes, by the Python of the system; tests skip where it is missing."""

from __future__ import annotations

import json
import os
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest

# Debian's, whose package python3-qgis no virtual environment sees.
PYTHON = "/usr/bin/python3"
SECONDS = 120
START = """
import json, sys
from qgis.core import *
application = QgsApplication([], False)
application.initQgis()
"""
# A mesh layer as MDAL reads it, and a layer of features as GDAL does, as far as tests want to know.
LAYERS = """
def mesh(path):
    layer = QgsMeshLayer(path, "mesh", "mdal")
    if not layer.isValid():
        return None
    provider, found = layer.dataProvider(), QgsMesh()
    provider.populateMesh(found)
    points = [found.vertex(k) for k in range(found.vertexCount())]
    groups = [QgsMeshDatasetIndex(k, 0) for k in range(provider.datasetGroupCount())]
    return {
        "points": [[p.x(), p.y(), p.z()] for p in points],
        "faces": [found.face(k) for k in range(found.faceCount())],
        "edges": provider.edgeCount(),
        "crs": layer.crs().authid(),
        "groups": [provider.datasetGroupMetadata(group).name() for group in groups],
    }

def features(path):
    layer = QgsVectorLayer(path, "features", "ogr")
    if not layer.isValid():
        return None
    found = [(f, f.geometry().constGet()) for f in layer.getFeatures()]
    return {
        "points": [[[v.x(), v.y(), v.z()] for v in shape.vertices()] for _, shape in found],
        "sorts": [QgsWkbTypes.displayString(shape.wkbType()) for _, shape in found],
        "values": [f.attributes() for f, _ in found],
        "crs": layer.crs().authid(),
    }

ways = {"mesh": mesh, "features": features}
print(json.dumps({path: ways[what](path) for what, path in json.loads(sys.argv[1])}, default=str))
"""


@cache
def version() -> str:
    """Return the version of QGIS; empty where it is missing."""
    if not Path(PYTHON).is_file():
        return ""
    ran = _run("from qgis.core import Qgis; print(Qgis.QGIS_VERSION)")
    return "" if ran.returncode else ran.stdout.split("-")[0].strip()


def opened(*layers: tuple[str, Path | str]) -> dict[str, Any]:
    """Return what QGIS finds in layers, each a ``"mesh"`` or ``"features"`` of a path; None of what it cannot open."""
    if not version():
        pytest.skip("no QGIS (Debian: apt install python3-qgis)")
    ran = _run(START + LAYERS, json.dumps([(what, str(path)) for what, path in layers]))
    if ran.returncode:
        pytest.fail(f"QGIS failed:\n{ran.stderr}")
    return json.loads(ran.stdout.splitlines()[-1])


def _run(script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(
        [PYTHON, "-c", script, *arguments],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
        env=environment | {"QT_QPA_PLATFORM": "offscreen", "PROJ_DATA": "", "GDAL_DATA": ""},
    )

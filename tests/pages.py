"""What tests of the pages of simplifications share: a model, and what is seen and read on a page."""

from __future__ import annotations

import io
import json
import math

import numpy as np
import pytest
from scipy.spatial import Delaunay


def relief(side, rng):
    """Return a rolling square: points (N, 3) with the height along z, their Delaunay triangles, colours."""
    y, x = np.mgrid[:side, :side].astype(float)
    inside = (x % (side - 1) > 0) & (y % (side - 1) > 0)
    x, y = (part + 0.3 * inside * rng.uniform(-1, 1, x.shape) for part in (x, y))  # one Delaunay triangulation, no ties
    z = 3 * np.sin(x / 4) * np.cos(y / 5) + rng.normal(scale=0.1, size=x.shape)
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    faces = Delaunay(points[:, :2]).simplices
    colour = np.column_stack([120 + 30 * points[:, 2], 200 - 5 * points[:, 0], 80 + 5 * points[:, 1]])
    return points, faces, colour.clip(0, 255).astype(np.uint8)


def shown(page):
    """Return the number of the solution whose mesh is shown, when the numbers beside it are the same one's."""
    row = number(page, "solution")
    page.wait_for_selector(f"html[data-shown='{row:.0f}']")
    return int(row)


def until(page, condition):
    """Wait for what the page's policy lets nobody wait for inside it."""
    for _ in range(200):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(20)
    pytest.fail(f"never came true: {condition}")


def number(page, name):
    return float(page.locator(f"#number-{name}").get_attribute("value"))


def pixels(page):
    """Return what is drawn in the windows of the original and of the simplified mesh, (height, width, 3) each."""
    from PIL import Image

    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    with Image.open(io.BytesIO(page.locator(".views").screenshot())) as image:
        drawn = np.asarray(image.convert("RGB")).astype(int)
    whole, *windows = (
        page.locator(place).bounding_box() for place in (".views", "#original-window", "#simplified-window")
    )
    scale = drawn.shape[1] / whole["width"]
    parts = []
    for box in windows:
        left, top = scale * (box["x"] - whole["x"]), scale * (box["y"] - whole["y"])
        rows = slice(math.ceil(top), math.floor(top + scale * box["height"]))
        parts.append(drawn[rows, math.ceil(left) : math.floor(left + scale * box["width"])])
    return parts


def dress(page, colours=None, shading=None, **more):
    """Choose how the meshes look."""
    for name, value in {"colours": colours, "shading": shading, **more}.items():
        if value is not None:
            page.check(f"input[name={name}][value={value}]", force=True)


def scale_of_errors(page):
    """Return the end of the colour bar."""
    return float(page.locator("#ticks span").last.inner_text().removeprefix("≥ ").replace(",", ""))


def unlike(a, b):
    """Return the share of pixels that differ visibly."""
    height, width = (min(s, t) for s, t in zip(a.shape[:2], b.shape[:2], strict=True))
    return float((np.abs(a[:height, :width] - b[:height, :width]).max(axis=2) > 24).mean())


def camera(page):
    """Return where the camera is and what is up, relative to what it looks at, and its magnification."""
    found = page.evaluate(
        """() => { const { camera, target } = state.viewer;
        return [camera.position.clone().sub(target).toArray(), camera.up.toArray(), camera.zoom, target.toArray()]; }"""
    )
    return tuple(map(np.array, found))


def taken(page, suffix, folder):
    """Return the path of the file that a button downloads."""
    with page.expect_download() as download:
        page.click(f"#downloads button[value={suffix}]")
    path = folder / f"page.{suffix}"
    download.value.save_as(path)
    return path


def chunks(path):
    """Return the tree of a GLB and the parts of its buffer, by accessor."""
    content = path.read_bytes()
    size = int.from_bytes(content[12:16], "little")
    tree, binary = json.loads(content[20 : 20 + size]), content[28 + size :]
    views = [tree["bufferViews"][accessor["bufferView"]] for accessor in tree["accessors"]]
    return tree, [binary[view["byteOffset"] :][: view["byteLength"]] for view in views]

"""One file of HTML that needs no other: style, scripts, libraries and data are inside it, and nothing else may run.

Texts are escaped where they are put in (Jinja's autoescape), data are JSON that no ``</script>`` can end, and a
Content-Security-Policy names the hash of every script and style of ours: whatever else a name might smuggle in does not
run, and nothing can be asked of a network.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.errors import printable
from meshsimp_pymoo.reprs import brief

__all__ = ["Framed", "embedded_array", "embedded_faces", "html_document"]

ASSETS = Path(__file__).with_name("assets")
COMPRESSION = 9

# What the browser calls the types of embedded arrays.
KINDS = {"u1": "u1", "u2": "u2", "u4": "u4", "f8": "f8"}


def html_document(template: str, scripts: Sequence[str], data: Any, **values: Any) -> str:
    """Fill a template of the folder ``assets``.

    Parameters
    ----------
    template : str
        Its name.
    scripts : sequence of str
        Names of the scripts to embed, in the order in which they run.
    data : JSON-able
        What the scripts find in the element ``data``.
    **values
        What the template asks for; texts are escaped.

    Returns
    -------
    str
        The page; the same for the same values.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    style, contents = _asset("style.css"), [_asset(name) for name in scripts]
    hashes = " ".join(_content_hash(content) for content in contents)
    policy = (
        f"default-src 'none'; script-src {hashes}; style-src {_content_hash(style)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
    environment = Environment(
        loader=FileSystemLoader(ASSETS), autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True,
        finalize=lambda value: printable(value, keep="\n\t") if type(value) is str else value,
    )  # fmt: skip
    return environment.get_template(template).render(
        policy=policy,
        style=Markup(style),
        scripts=[Markup(content) for content in contents],
        data=Markup(_json(data)),
        **values,
    )


@brief
@dataclass(frozen=True)
class Framed:
    """A page as notebooks show it: in a frame of its own, so that neither meets the other's styles and scripts.

    Attributes
    ----------
    page : str
        The HTML of it.
    height : int
        Of the frame [pixels].
    """

    page: str
    height: int

    def _repr_html_(self) -> str:
        # the document is an attribute: VS Code shows no frame of a file, and a copy of the notebook shows the same
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" style="width: 100%; height: {self.height}px; border: 0" '
            'title="page of meshsimp_pymoo" allow="clipboard-write; fullscreen" allowfullscreen></iframe>'
        )


def embedded_array(values: npt.NDArray[Any]) -> dict[str, str]:
    """Return an array as the browser unpacks it: base64 of gzip of all first bytes, then all second ones, ...

    Parameters
    ----------
    values : uint8, uint16, uint32 or float64 array
        Its shape is not kept.
    """
    kind = values.dtype.str[1:]
    if kind not in KINDS:
        raise TypeError(f"an array of {values.dtype} cannot be embedded; use one of {', '.join(KINDS)}")
    flat = np.ascontiguousarray(values).reshape(-1).astype(f"<{kind}", copy=False)
    planes = flat.view(np.uint8).reshape(-1, flat.dtype.itemsize).T
    packed = gzip.compress(planes.tobytes(), COMPRESSION, mtime=0)
    return {"kind": KINDS[kind], "data": base64.b64encode(packed).decode("ascii")}


def embedded_faces(faces: npt.NDArray[Any]) -> dict[str, str]:
    """Return triangles (M, 3) as the browser unpacks them: differences of neighbours, which are small along a curve.

    Each keeps its orientation, but begins with its smallest vertex, and they are sorted.
    """
    rows = np.asarray(faces, dtype=np.int64)
    turn = rows.argmin(axis=1)
    at = np.arange(len(rows))
    a, b, c = (rows[at, (turn + k) % 3] for k in range(3))
    order = np.lexsort((c, b, a))
    a, b, c = a[order], b[order], c[order]
    columns = np.concatenate([np.diff(a, prepend=0), b - a, c - a])
    return embedded_array(columns.astype(np.uint16 if columns.max(initial=0) < 2**16 else np.uint32))


@cache
def _asset(name: str) -> str:
    # newlines as the browser reads them, or the hash would be another
    return "\n".join((ASSETS / name).read_text(encoding="utf-8").splitlines()) + "\n"


def _content_hash(content: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode('ascii')}'"


def _json(data: Any) -> str:
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def slug(name: str) -> str:
    """Return a name as a file name.

    Examples
    --------
    >>> slug("50 generations"), slug("M1: Laurana/2")
    ('50-generations', 'M1-Laurana-2')
    """
    spelled = "".join(c if c.isascii() and (c.isalnum() or c in "._") else " " for c in name)
    return "-".join(spelled.split()) or "unnamed"

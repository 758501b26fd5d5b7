"""Tables that are made of the package's own, so that no page repeats what the code says."""

from __future__ import annotations

from typing import Any

from pygments.lexers.special import TextLexer


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_lexer("output", TextLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Every code block of the pages is run: ``pytest docs``. A page is one session, in an empty folder of its own.

* ``sh`` and ``python`` are run in order; all ``python`` of a page shares its names.
* ``output`` is what the block before it prints, but for lines about compiling; ``...`` stands for what differs from
  machine to machine.
* A ``{code-block}`` with a caption is a file of that name in the folder; YAML without one must be YAML.
* ``console``, lines that begin with ``$``, is what cannot be run here: what installs (see SHOWN).
* ``text`` is no code. A block in any other language fails.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from sybil import Document, Example, Region, Sybil
from sybil.parsers.myst import CodeBlockParser

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

collect_ignore_glob = ["*.py", "_build/*", "gallery/*"]
# Commands that are shown, not run, by how they begin: they need what a test machine lacks, or change what is installed.
SHOWN = ("conda", "docker", "git clone", "pip", "python -m venv", "source")
# What a machine says that runs a command for the first time, or slowly.
ONCE = re.compile(r"^(meshsimp: .*\d% after |(meshsimp: compiling|compiled) once for this machine).*\n", re.MULTILINE)
SAME = doctest.OutputChecker()
HOW = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def run_shell(example: Example) -> None:
    """Run the block as a script that ends at the first command that fails."""
    paths = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", example.parsed],
        cwd=example.namespace["folder"],
        env=os.environ | {"PATH": paths},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    example.namespace["printed"] = ONCE.sub("", done.stdout)
    assert done.returncode == 0, f"exit code {done.returncode}:\n{done.stdout}"


def run_python(example: Example) -> None:
    """Run the block with the names of the page, in its folder."""
    source = "\n" * (example.line - 1) + example.parsed
    names = example.namespace["names"]
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()) as printed:
        patch.chdir(example.namespace["folder"])
        exec(compile(source, example.path, "exec"), names)
    example.namespace["printed"] = printed.getvalue()


def compare(example: Example) -> None:
    """See that the block before printed this."""
    printed = example.namespace["printed"]
    assert SAME.check_output(example.parsed, printed, HOW), f"what was printed:\n{printed}"


def read(example: Example) -> None:
    """See that a block is YAML."""
    yaml.safe_load(example.parsed)


def show(example: Example) -> None:
    """See that what is only shown is what may be."""
    for line in example.parsed.splitlines():
        assert line.startswith(tuple(f"$ {name}" for name in SHOWN)), f"not run, although it could be: {line}"


def write(example: Example) -> None:
    """Write the file that the caption names."""
    path = Path(example.namespace["folder"], example.region.lexemes["options"]["caption"])
    path.write_text(example.parsed, encoding="utf-8")


def refuse(example: Example) -> None:
    """Say that nobody knows what to do with it."""
    pytest.fail(f"a code block in {example.region.lexemes['arguments']!r}, which nothing here runs")


LANGUAGES = {"sh": run_shell, "python": run_python, "output": compare, "yaml": read, "console": show}
PLAIN = ("text",)


def blocks(document: Document) -> Iterator[Region]:
    """Find the code blocks of a page, in any language."""
    for region in CodeBlockParser("sh").lexers(document):
        language = region.lexemes["arguments"]
        if language.startswith("{") or language in PLAIN:
            continue
        region.parsed = region.lexemes["source"]
        named = "caption" in (region.lexemes.get("options") or {})
        region.evaluator = write if named else LANGUAGES.get(language, refuse)
        yield region


def begin(names: dict[str, Any]) -> None:
    """Make the folder of a page."""
    names["folder"] = tempfile.mkdtemp()
    names["names"] = {"__name__": "__main__"}


def end(names: dict[str, Any]) -> None:
    """Remove it."""
    shutil.rmtree(names["folder"])


def pytest_configure(config: pytest.Config) -> None:
    """Keep each page in one process."""
    config.option.dist = "loadfile"


def pytest_xdist_auto_num_workers() -> int:
    """Let pages run side by side."""
    return 2


pytest_collect_file = Sybil([blocks], pattern="*.md", setup=begin, teardown=end).pytest()

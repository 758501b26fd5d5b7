"""Tables and lists of options that are made of the package's own, so that no page repeats what the code says.

* ````{table-of} formats```` is a table out of TABLES.
* ````{options-of} simplify```` lists the options of a command, each a target of ``{option}`meshsimp simplify --free```.
"""

from __future__ import annotations

import argparse
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import import_module
from typing import Any

from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.util.docutils import SphinxDirective

from meshsimp_pymoo import Options, Rules

Rows = Iterable[Sequence[str]]
TABLES: dict[str, tuple[Sequence[str], Callable[[], Rows]]] = {}
# How roles and references of docstrings are spelled in Markdown.
ROLES = re.compile(r":(\w+):`([^`]+)`")
# What means something in Markdown outside of code.
SPECIAL = re.compile(r"([\\*_{}\[\]<>#$|~])")


def table(name: str, *header: str) -> Callable[[Callable[[], Rows]], Callable[[], Rows]]:
    """Add a table, made by the function below."""

    def add(rows: Callable[[], Rows]) -> Callable[[], Rows]:
        TABLES[name] = header, rows
        return rows

    return add


def from_docstring(text: str) -> str:
    """Return a sentence of a docstring as Markdown."""
    return ROLES.sub(r"{py:\1}`\2`", " ".join(text.split()).replace("``", "`"))


def from_help(text: str) -> str:
    """Return a text of the shell's help as Markdown, which means nothing by it but code between backticks."""
    parts = " ".join(text.split()).split("`")
    return "`".join(part if place % 2 else SPECIAL.sub(r"\\\1", part) for place, part in enumerate(parts))


def code(*words: object) -> str:
    """Return words as code."""
    return ", ".join(f"`{word}`" for word in words)


def first_line(documented: Any) -> str:
    """Return the first sentence of what is documented."""
    return from_docstring((inspect.getdoc(documented) or "").partition("\n\n")[0])


def yes(value: object) -> str:
    """Return a word for what is true, and nothing for what is not."""
    return "yes" if value else ""


# ---------------------------------------------------------------------------------------------------------- the tables


@table("formats", "suffix", "what", "read as", "`--format`", "keeps, when written", "break lines", "needs")
def formats() -> Rows:
    """Return a row for each format of files: meshes, grids, clouds, lines."""
    from meshsimp_pymoo.formats.table import LINES, SORTS, all_formats

    spelled = {"color": "colours", "uv": "texture"}
    for kind in sorted(all_formats(), key=lambda kind: [*SORTS, LINES].index(kind.sort)):
        read = f"{kind.sort}{', or cloud' * kind.bare_points}" if kind.read else ""
        kept = ""
        if kind.write:
            kept = (
                "all vertex attributes, texture" if kind.keeps is None else ", ".join(spelled[it] for it in kind.keeps)
            )
            precision = "double precision"
            if kind.single_precision:
                precision = f"single precision{', from a stated origin' * kind.states_origin}"
            kept = ", ".join(filter(None, (precision, kept)))
        yield (
            code(*kind.suffixes) or "others",
            about(kind),
            read,
            code(kind.name) if kind.write else "",
            kept,
            ", ".join(["read"] * bool(kind.read_lines) + ["written"] * bool(kind.holds_lines or kind.write_lines)),
            code(f"[{kind.extra}]") if kind.extra else "",
        )


@table("windows", "suffix", "what")
def windows() -> Rows:
    """Return a row for each format that tiles read by windows."""
    from meshsimp_pymoo.formats.table import all_formats

    return [(code(*kind.suffixes), about(kind)) for kind in all_formats() if kind.open_heights is not None]


def about(kind: Any) -> str:
    """Return what people call a format, or what its file says of it first."""
    if not kind.title.startswith("."):
        return str(kind.title)
    documented = import_module(f"meshsimp_pymoo.formats.{kind.name}").__doc__ or ""
    return from_docstring(re.split("[:,]", documented)[0])


# Lists in place of tables, by the class whose settings they are.
LISTS = {"options": Options, "rules": Rules}


def settings(kind: type[Any]) -> Iterator[str]:
    """Yield what there is to say of each setting of a class: a term and its definition."""
    from meshsimp_pymoo.cli.arguments import option
    from meshsimp_pymoo.formats.table import SORTS, all_formats
    from meshsimp_pymoo.settings import Choice, defaults_of, settings_of

    titles = SORTS | {known.name: known.title for known in all_formats()}
    for name, known in settings_of(kind).items():
        metavar = "|".join(known.kind.names) if isinstance(known.kind, Choice) else known.metavar
        only = f" Only for {' and '.join(titles[sort] for sort in known.describes)}." if known.describes else ""
        in_shell = "not in the shell" if known.derived else f"`{option(name)} {metavar}`"
        takes = from_docstring(known.accepts.removesuffix(", optional"))
        default = code(repr(defaults_of(kind)[name]))
        yield f"`{name}`, {in_shell}\n: {from_docstring(known.doc)}{only}\n\n  Takes {takes}; default {default}."


@table("models", "name", "parameters and defaults", "what it is")
def models() -> Rows:
    """Return a row for each built-in model."""
    from meshsimp_pymoo.datasets import describe

    for name, line in describe().items():
        spelled, _, about = line.partition(" - ")
        yield code(name), code(*spelled.partition(":")[2].split(",")), from_help(about)


@table("operators", "kind", "in YAML", "class", "what it does")
def operators() -> Rows:
    """Return a row for each operator."""
    from meshsimp_pymoo.search.operators import OPERATORS

    for kind, known in OPERATORS.items():
        for name, operator in known.items():
            yield kind, code(name), f"{{py:obj}}`~meshsimp_pymoo.{operator.__name__}`", first_line(operator)


@table("presets", "name", "what it is", "paper", "shell", "measured by")
def presets() -> Rows:
    """Return a row for each preset."""
    from meshsimp_pymoo.search.presets import PRESETS

    for name, preset in PRESETS.items():
        yield (
            f"{{py:obj}}`~meshsimp_pymoo.{name}`",
            preset.about,
            yes(preset.is_the_papers),
            yes(preset.whole_front),
            ", ".join(preset.measured_by),
        )


@table("measures", "name", "what it is", "wish", "minimised by")
def measures() -> Rows:
    """Return a row for each number of a mesh."""
    from meshsimp_pymoo.cli.arguments import option
    from meshsimp_pymoo.surface.measures import MEASURES

    meanings = attributes(quality())
    for name, measure in MEASURES.items():
        meaning = meanings[name].removesuffix(".") + f" [{measure.unit}]." * bool(measure.unit)
        wish = f"{{option}}`{option(name)} <meshsimp simplify {option(name)}>`" if measure.wish else ""
        yield code(name), meaning, wish, code(f"--measure {measure.minimised}") if measure.minimised else ""


@table("front-columns", "column", "type", "unit", "what it is")
def front_columns() -> Rows:
    """Return a row for each column of a front's CSV file."""
    from meshsimp_pymoo.storage import FRONT_COLUMNS, INT_COLUMNS, REFIT_COLUMNS
    from meshsimp_pymoo.surface.measures import LENGTH, MEASURES, OF_LINES, OF_MESH

    meanings = attributes(quality()) | OTHER_COLUMNS
    for name in FRONT_COLUMNS + OF_LINES + REFIT_COLUMNS:
        kind = "text" if name.endswith("mesh") else "int" if name in INT_COLUMNS else "float"
        unit = MEASURES[name].unit if name in MEASURES else LENGTH if name.endswith("error") else ""
        empty = " Empty where it was not measured." if name in OF_MESH + OF_LINES else ""
        yield code(name), kind, unit, meanings[name] + empty


OTHER_COLUMNS = {
    "solution": "Its number, from 0, by triangles.",
    "mesh": "Path of its mesh in the folder; empty where it was not written.",
    "free": "1 if it is a free mesh, 0 if it is Delaunay.",
    "refitted_error": "The error with the best heights, where they were fitted. Only with `--refit`.",
    "refitted_mesh": "Path of that mesh in the folder. Only with `--refit`.",
}


def quality() -> str:
    """Return the docstring of what is said of a mesh."""
    from meshsimp_pymoo import Quality

    return inspect.getdoc(Quality) or ""


def attributes(docstring: str, section: str = "Attributes") -> dict[str, str]:
    """Return the sentences on each attribute of a docstring, or on each name of another section, without units."""
    found: dict[str, str] = {}
    names: list[str] = []
    for line in docstring.partition(f"{section}\n----------\n")[2].splitlines():
        if line and not line.startswith(" "):
            names = [name.strip() for name in line.partition(" : ")[0].split(",")]
        else:
            found |= {name: f"{found.get(name, '')} {line.strip()}" for name in names}
    return {name: from_docstring(re.sub(r" *\[[a-z ]+\]\.", ".", text)) for name, text in found.items()}


@table("constraints", "name", "limits", "what it is")
def constraints() -> Rows:
    """Return a row for each constraint of a problem."""
    from meshsimp_pymoo import MeshProblem
    from meshsimp_pymoo.problem import CONSTRAINTS

    meanings = attributes(inspect.getdoc(MeshProblem) or "", "Parameters")
    for name, objective in CONSTRAINTS.items():
        yield code(name), {0: "the first objective", -1: "the last, triangles"}[objective], meanings[name]


@table("indicators", "class", "what it is")
def indicators() -> Rows:
    """Return a row for each indicator."""
    from pymoo.core.indicator import Indicator

    import meshsimp_pymoo

    for name in meshsimp_pymoo.__all__:
        thing = getattr(meshsimp_pymoo, name)
        if inspect.isclass(thing) and issubclass(thing, Indicator):
            yield f"{{py:obj}}`~meshsimp_pymoo.{name}`", first_line(thing)


@table("baselines", "group", "method", "what it is", "needs")
def baselines() -> Rows:
    """Return a row for each method that fronts are compared with."""
    from meshsimp_pymoo.comparison.baselines import BASELINES

    for name, baseline in BASELINES.items():
        needs = code(f"[{baseline.extra}]") if baseline.extra else code(*filter(None, [baseline.package]))
        yield code(baseline.group), code(name), baseline.label + "; a whole front" * bool(baseline.front), needs


@table("exit-codes", "code", "meaning")
def exit_codes() -> Rows:
    """Return a row for each exit code of the shell command."""
    from meshsimp_pymoo import cli

    found: list[list[str]] = []
    for line in (cli.__doc__ or "").splitlines():
        if match := re.match(r"(\d+) +(.*)", line):
            found.append([*match.groups()])
        elif found and line.startswith("   "):
            found[-1][1] += f" {line.strip()}"
    return [(code(number), from_docstring(text)) for number, text in found]


# ------------------------------------------------------------------------------------------------------ the directives


class TableOf(SphinxDirective):
    """A table out of TABLES, or a list out of LISTS."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        (name,) = self.arguments
        if name in LISTS:
            return parsed(self, "\n\n".join(settings(LISTS[name])))
        if name not in TABLES:
            raise self.error(f"no table {name!r}; there are {', '.join((*TABLES, *LISTS))}")
        header, rows = TABLES[name]
        lines = [header, ["---"] * len(header), *rows()]
        return parsed(self, "\n".join(f"| {' | '.join(map(cell, line))} |" for line in lines))


class OptionsOf(SphinxDirective):
    """What a command of the shell does, its options and examples."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the description."""
        parser = command_parser(*self.arguments)
        self.env.ref_context["std:program"] = parser.prog.replace(" ", "-")
        return parsed(self, "\n\n".join(described(parser)))


def parsed(directive: SphinxDirective, text: str) -> list[nodes.Node]:
    """Return what Markdown of a directive's making becomes."""
    return directive.parse_text_to_nodes(text)


def cell(text: str) -> str:
    """Return a text for a cell of a table."""
    return text.replace("|", "\\|")


def command_parser(name: str) -> Any:
    """Return the parser of a command, with all arguments."""
    from meshsimp_pymoo.cli.parser import make_parser

    found = commands_of(make_parser())[name]
    found.fill()
    return found


def commands_of(parser: Any) -> dict[str, Any]:
    """Return the parsers of all commands, by name."""
    return next(dict(act.choices) for act in parser._actions if isinstance(act, argparse._SubParsersAction))


def described(parser: Any) -> Iterator[str]:
    """Yield the paragraphs on a command."""
    formatter = parser._get_formatter()
    shown = [action for action in parser._actions if action.help is not argparse.SUPPRESS]
    usage = " ".join([parser.prog, *(_plain_name(action) for action in shown if not action.option_strings)])
    yield f"```text\n{usage} [OPTIONS]\n```"
    yield from_help(parser.description)
    for group in parser._action_groups:
        known = [action for action in group._group_actions if action in shown and not _is_help(action)]
        if not known:
            continue
        if group.title not in ("options", "positional arguments"):
            yield f"```{{rubric}} {from_help(group.title[0].upper() + group.title[1:])}\n```"
        if group.description:
            yield from_help(group.description)
        for either in parser._mutually_exclusive_groups:
            if either._group_actions and either._group_actions[0] in known:
                names = code(*(action.option_strings[-1] for action in either._group_actions))
                yield f"{'Exactly' if either.required else 'At most'} one of {names}."
        for action in known:
            help_text = from_help(formatter._expand_help(action)) if action.help else ""
            spelled = formatter._format_action_invocation(action) if action.option_strings else _plain_name(action)
            yield f"````{{option}} {spelled}\n{help_text[:1].upper()}{help_text[1:]}\n````"
    if examples := parser.epilog.partition("examples:\n")[2].partition("\n\n")[0]:
        yield "```{rubric} Examples\n```"
        yield f"```text\n{inspect.cleandoc(examples)}\n```"


def _plain_name(action: argparse.Action) -> str:
    name = str(action.metavar or (action.dest if action.choices else action.dest.upper()))
    return f"[{name}]" if action.nargs in ("?", "*") else name


def _is_help(action: argparse.Action) -> bool:
    return isinstance(action, argparse._HelpAction)


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_lexer("output", TextLexer)
    app.add_directive("table-of", TableOf)
    app.add_directive("options-of", OptionsOf)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

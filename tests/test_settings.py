"""Settings: what each kind reads, and that what is stored of them is read back."""

from __future__ import annotations

import inspect
import json
import math
import pydoc
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.errors import InputError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.settings import (
    LARGEST,
    MOST_REAL,
    MOST_WHOLE,
    Choice,
    Column,
    Direction,
    Lines,
    Part,
    Pins,
    Real,
    Scale,
    Several,
    Steps,
    Weights,
    Whole,
    defaults_of,
    documentation,
    plain,
    read_back,
    setting,
    settings_of,
    taken,
)
from meshsimp_pymoo.surface.measures import OBJECTIVES
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES, PINS, Rules

# ------------------------------------------------------------------------------------------------------- kinds

TEXTS = [
    (Choice(("hull", "model")), "hull", "hull"),
    (Weights(), "importance", "importance"),
    (Whole(), "12", 12),
    (Whole(-3), "-3", -3),
    (Real(), "-1.5e3", -1500.0),
    (Real(0), "0", 0.0),
    (Real(), "-1e300", -MOST_REAL),
    (Real(most=LARGEST), "-1.7976931348623157e+308", -LARGEST),
    (Steps(), "2.5", (2.5, 2.5)),
    (Steps(), "2,3", (2.0, 3.0)),
    (Scale(), "2,3", (2.0, 3.0)),
    (Scale(), "degrees", "degrees"),
    (Scale(), "none", (1.0, 1.0)),
    (Several(Whole(0, 255)), "2, 9", (2, 9)),
    (Several(Column(), 3), "E,northing,4", ("E", "northing", 4)),
    (Part(), "0,1,20,30", (0, 1, 20, 30)),
    (Direction(), "-x", "-x"),
    (Direction(), "0,1,1", "0,1,1"),
    (Pins(PINS), "hull", "hull"),
    (Pins(PINS), "7,12", [7, 12]),
]
WRONG_TEXTS = [
    (Choice(("hull", "model")), "hul", r"unknown \(did you mean 'hull'\?\); expected one of hull, model"),
    (Choice(("hull", "model")), "xyz", "^expected one of hull, model"),
    (Whole(), "1.0", "'1.0' is not a whole number of at least 0"),
    (Whole(2), "1", "'1' is not a whole number of at least 2"),
    (Whole(), "-1", "at least 0"),
    (Real(), "many", "'many' is not a finite number"),
    (Real(), "nan", "'nan' is not a finite number"),
    (Real(), "inf", "'inf' is not a finite number"),
    (Real(0), "-1", "'-1' is below 0"),
    (Real(0, strict=True), "0", "'0' is not positive"),
    (Real(2, strict=True), "2", "'2' is not above 2"),
    (Real(), "-1e301", r"'-1e301' is larger than 1e\+300"),
    (Whole(), str(MOST_WHOLE + 1), r"is not a whole number of at least 0 and at most 2\*\*53"),
    (Weights(), "", "expected the name of an attribute, or a list of numbers"),
    (Direction(), "", "expected an axis"),
    (Steps(), "1,2,3", "'1,2,3' is not one or two positive numbers"),
    (Steps(), "-1", "not one or two positive numbers"),
    (Steps(), "a", "'a' is not a finite number"),
    (Scale(), "2", "expected degrees, none, or two positive numbers SX,SY"),
    (Scale(), "2,0", "expected a number of more than 0"),
    (Scale(), "metres", "expected degrees, none"),
    (Several(Whole(0, 255)), "2,256", "'256' is not a whole number of at least 0 and at most 255"),
    (Several(Whole(0, 255)), "2,2", "names one of them twice"),
    (Several(Column(), 3), "x,y", "expected 3 values, not 2"),
    (Several(Column(), 3), "x,y,0", "'0' is not a whole number of at least 1"),
    (Several(Column(), 3), "x,,y", "expected names of columns, or their numbers from 1"),
    (Part(), "1,2,3", "'1,2,3' is not COLUMN,ROW,COLUMNS,ROWS"),
    (Part(), "0,0,1,5", "'1' is not a whole number of at least 2"),
    (Pins(PINS), "7,-1", "'-1' is not a whole number of at least 0"),
    (Pins(PINS), "rim", "'rim' is not a whole number"),
]
PLAIN = [
    (Lines(), "sharp:30", "sharp:30"),
    (Lines(), Path("a") / "b.geojson", str(Path("a") / "b.geojson")),
    (Lines(), [[[0, 1.5], [2, 3]], [[0, 0, 0], [1, 1, 1]]], [[[0, 1.5], [2, 3]], [[0, 0, 0], [1, 1, 1]]]),
    (Choice(("hull", "model")), "model", "model"),
    (Weights(), "importance", "importance"),
    (Weights(), [1, 2.5], [1, 2.5]),
    (Weights(), [[1, 2], [3, 4]], [[1, 2], [3, 4]]),
    (Whole(), MOST_WHOLE, MOST_WHOLE),
    (Real(), 3, 3.0),
    (Real(), MOST_REAL, MOST_REAL),
    (Real(most=LARGEST), -LARGEST, -LARGEST),
    (Steps(), 2, (2.0, 2.0)),
    (Several(Whole(0, 255)), 2, (2,)),
    (Several(Column(), 3), ["E", " N ", 4], ("E", "N", 4)),
    (Steps(), [2, 3.5], (2.0, 3.5)),
    (Scale(), [2, 3.5], (2.0, 3.5)),
    (Scale(), "none", (1.0, 1.0)),
    (Part(), [0, 1, 20, 30], (0, 1, 20, 30)),
    (Direction(), "auto", "auto"),
    (Direction(), [0, 0, 2], [0.0, 0.0, 2.0]),
    (Pins(PINS), "hull", "hull"),
    (Pins(PINS), 7, 7),
    (Pins(PINS), [7, "hull", [0.5, 1.5]], [7, "hull", [0.5, 1.5]]),
]
WRONG_PLAIN = [
    (Choice(("hull", "model")), "Hull", r"did you mean 'hull'\?"),
    (Choice(("hull", "model")), None, "expected one of hull, model"),
    (Choice(("front",)), 3, "^expected front$"),
    (Weights(), [], "expected the name of an attribute, or a list of numbers"),
    (Weights(), 3, "expected the name of an attribute"),
    (Weights(), [1, "2"], "expected a list of numbers, and '2' is none"),
    (Whole(), True, "expected a whole number of at least 0"),
    (Whole(), 1.0, "expected a whole number"),
    (Whole(), MOST_WHOLE + 1, r"at least 0 and at most 2\*\*53"),
    (Real(), "3", "^expected a number$"),
    (Real(), False, "expected a number"),
    (Real(), math.nan, "expected a number"),
    (Real(), math.inf, r"^expected a number no larger than 1e\+300"),
    (Real(most=LARGEST), -math.inf, "no larger than 1.79769e"),
    (Real(0), -1, "expected a number of at least 0"),
    (Real(0, strict=True), 0, "expected a number of more than 0"),
    (Real(0), 10**400, r"^expected a number of at least 0 and no larger than 1e\+300"),
    (Steps(), [], r"expected one number or two, \[dx, dy\]"),
    (Steps(), [1, 2, 3], r"expected one number or two"),
    (Steps(), 0, "more than 0"),
    (Scale(), 2, "two positive numbers"),
    (Scale(), [1, 2, 3], "two positive numbers"),
    (Scale(), [1, -2], "more than 0"),
    (Part(), [0, 0, 1, 5], "expected a whole number of at least 2"),
    (Part(), [1, 2, 3], r"expected \[column, row, columns, rows\]"),
    (Part(), "0,0,2,2", "expected .column, row"),
    (Direction(), [0, 0, 0], "three numbers that are not all 0"),
    (Direction(), [0, 1], "expected an axis"),
    (Direction(), "", "expected an axis"),
    (Lines(), [], "expected a file, sharp:DEGREES, outline, or a list of lines"),
    (Lines(), " ", "expected a file"),
    (Lines(), [[[0, 0]]], "each a list of two or more positions"),
    (Lines(), [[[0, 0], [1, 1, 1]]], "each a list of two or more positions"),
    (Lines(), [[[0, 0], [1, math.nan]]], "each a list of two or more positions"),
    (Lines(), [[[0, 0], [1, True]]], "each a list of two or more positions"),
    (Lines(), [[0, 0], [1, 1]], "each a list of two or more positions"),
    (Pins(PINS), 1.5, "expected corners, hull, border, or a list"),
    (Pins(PINS), True, "expected corners, hull, border, or a list"),
]


def same(one, other):
    return one == other and type(one) is type(other)


@pytest.mark.parametrize(("kind", "text", "value"), TEXTS)
def test_a_word_of_a_command_line_is_read(kind, text, value):
    assert same(kind.from_text(text), value)


@pytest.mark.parametrize(("kind", "given", "value"), PLAIN)
def test_plain_data_are_read(kind, given, value):
    assert same(kind.from_plain(given), value)


@pytest.mark.parametrize(("kind", "text", "message"), WRONG_TEXTS)
def test_a_word_that_is_none_is_refused_with_what_was_expected(kind, text, message):
    with pytest.raises(ValueError, match=message):
        kind.from_text(text)


@pytest.mark.parametrize(("kind", "given", "message"), WRONG_PLAIN)
def test_data_that_are_none_are_refused_with_what_was_expected(kind, given, message):
    with pytest.raises(ValueError, match=message):
        kind.from_plain(given)


# ------------------------------------------------------------------------------------------ stored and read back

reals = st.floats(-MOST_REAL, MOST_REAL)
positive = st.floats(1e-300, MOST_REAL)
wholes = st.integers(0, 10**6)
directions = st.lists(st.floats(-10, 10), min_size=3, max_size=3).filter(any)
positions = st.lists(reals, min_size=2, max_size=3)
pins = st.one_of(
    st.sampled_from(PINS),
    wholes,
    st.lists(st.one_of(wholes, st.sampled_from(PINS), positions), max_size=4),
)
names = st.text(min_size=1).filter(str.strip)
lines = st.lists(st.lists(st.lists(reals, min_size=3, max_size=3), min_size=2, max_size=3), min_size=1, max_size=2)
SETTINGS = {
    "up": st.one_of(st.sampled_from(["auto", "z", "-x"]), directions),
    "patch": st.none() | st.just("front"),
    "repair": st.sampled_from(["mend", "none"]),
    "surface": st.sampled_from(["auto", "height", "closed"]),
    "spacing": st.none() | st.tuples(positive, positive),
    "nodata": st.none() | st.floats(allow_nan=False, allow_infinity=False),
    "window": st.none() | st.tuples(wholes, wholes, *2 * [wholes.map(lambda count: count + 2)]),
    "band": st.none() | wholes.map(lambda count: count + 1),
    "encoding": st.none() | st.sampled_from(["mapbox", "terrarium"]),
    "max_edge": st.none() | positive,
    "scale": st.none() | st.sampled_from(["degrees", "none"]) | st.tuples(positive, positive),
    "classes": st.none() | st.lists(st.integers(0, 255), min_size=1, unique=True),
    "columns": st.none()
    | st.lists(wholes.map(lambda k: k + 1) | names.map(str.strip), min_size=3, max_size=3, unique=True),
    "footprint": st.none() | st.sampled_from(FOOTPRINTS),
    "outside": st.none() | st.sampled_from(OUTSIDES),
    "pin": st.none() | pins,
    "weights": st.none() | names | st.lists(reals, min_size=1),
    "break_lines": st.none() | st.sampled_from(["outline", "sharp:30"]) | lines,
    "line_tolerance": st.none() | st.floats(0, MOST_REAL),
    "measure": st.sampled_from(list(OBJECTIVES)),
}


@pytest.mark.parametrize("kind", [Options, Rules])
@given(data=st.data())
def test_what_is_stored_of_settings_is_read_back(kind, data):
    assert set(settings_of(Options)) | set(settings_of(Rules)) == set(SETTINGS), "a new setting: draw it here too"
    drawn = {name: data.draw(SETTINGS[name], label=name) for name in settings_of(kind)}
    if kind is Rules:  # a tolerance is for lines, and all but words need one
        assume((drawn["line_tolerance"] is None) == (drawn["break_lines"] is None))
    settings = kind(**drawn)
    stored = json.loads(json.dumps(plain(settings), allow_nan=False))
    assert list(stored) == list(settings_of(kind))
    assert read_back(kind, stored) == settings


@given(values=st.lists(reals, min_size=3, max_size=3))
def test_arrays_tuples_and_numbers_of_numpy_are_stored_as_plain_data(values):
    assume(any(values))
    for up in (np.array(values), tuple(values), list(np.array(values))):
        assert json.loads(json.dumps(plain(Options(up=up))))["up"] == values
    rules = Rules(pin=(np.int64(3), np.array([[1.0, 2.0]])), weights=np.arange(3.0))
    assert plain(rules)["pin"] == [3, [[1.0, 2.0]]]
    assert read_back(Rules, plain(rules)).weights == [0.0, 1.0, 2.0]


def test_what_python_takes_is_made_plain_at_once_so_that_settings_can_be_compared_and_stored():
    given = Options(up=np.array([0, 0, 2]), spacing=np.float32(2), window=np.array([0, 0, 4, 4]))
    assert given == Options(up=(0, 0, 2), spacing=(2, 2), window=[0, 0, 4, 4]) != Options()
    assert (given.up, given.spacing, given.window) == ([0.0, 0.0, 2.0], (2.0, 2.0), (0, 0, 4, 4))
    rules = Rules(pin=(row for row in (7, 12)), weights=np.array([1, 2.5], np.float32))
    assert rules == Rules(pin=np.array([7, 12]), weights=(1.0, 2.5)) != Rules()
    assert read_back(Rules, json.loads(json.dumps(plain(rules)))) == rules


def test_a_weight_that_is_no_number_is_stored_as_nothing_and_read_back():
    rules = Rules(weights=np.array([[1.0, np.nan], [2.0, 3.0]]))
    assert plain(rules)["weights"] == [[1.0, None], [2.0, 3.0]]
    again = read_back(Rules, json.loads(json.dumps(plain(rules), allow_nan=False)))
    np.testing.assert_array_equal(again.weights, [[1.0, np.nan], [2.0, 3.0]])


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        (Options, {"window": (0.0, 0.0, 4, 4)}, r"window is \(0\.0, 0\.0, 4, 4\): expected a whole number"),
        (Options, {"window": (-1, 0, 4, 4)}, "window is .*: expected a whole number of at least 0"),
        (Options, {"spacing": (1, 2, 3)}, "spacing is .*: expected one number or two"),
        (Options, {"spacing": "wide"}, "spacing is 'wide': expected a number"),
        (Options, {"nodata": math.nan}, "nodata is nan: expected a number"),
        (Options, {"max_edge": math.inf}, "max_edge is inf: expected a number of more than 0 and no larger than"),
        (Options, {"patch": "back"}, "patch is 'back': expected front$"),
        (Options, {"up": ""}, "up is '': expected an axis"),
        (Rules, {"pin": {"hull": True}}, "pin is .*: expected corners, hull, border, or a list"),
        (Rules, {"weights": " "}, "weights is ' ': expected the name of an attribute"),
        (Rules, {"weights": np.array(["a"] * 1000)}, "weights is .*: expected a list of numbers, and 'a' is none"),
        (Rules, {"measure": None}, "measure is None: expected one of error, "),
    ],
)
def test_what_could_not_be_read_back_is_refused_when_it_is_given(kind, given, message):
    with pytest.raises(InputError, match=message) as caught:
        kind(**given)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


def test_defaults_are_read_back_and_missing_settings_have_them():
    for kind in (Options, Rules):
        assert read_back(kind, {}) == read_back(kind, plain(kind())) == kind()
        assert defaults_of(kind) == vars(kind())


@pytest.mark.parametrize(
    ("stored", "message"),
    [
        (None, "None holds no rules"),
        ([1], r"\[1\] holds no rules"),
        ({"foot": "hull"}, "'foot' is none of the rules: footprint, outside, pin, weights, break_lines, line_tol"),
        ({"footprint": "hul"}, r"footprint is 'hul': unknown \(did you mean 'hull'\?\)"),
        ({"pin": {}}, "pin is {}: expected corners, hull, border, or a list"),
        ({"weights": 3}, "weights is 3: expected the name of an attribute"),
        ({"measure": None}, "measure is None: expected one of error, "),
    ],
)
def test_what_was_stored_of_nothing_like_it_is_refused(stored, message):
    with pytest.raises(ValueError, match=message):
        read_back(Rules, stored)


def test_settings_are_taken_out_of_arguments_and_replace_those_of_an_object():
    arguments = {"footprint": "hull", "seed": 3}
    base = Rules(outside="ignore")
    assert taken(Rules, base, arguments) == Rules(footprint="hull", outside="ignore")
    assert arguments == {"seed": 3}
    assert taken(Rules, None, arguments) == Rules()


# ------------------------------------------------------------------------------------------------- documentation


@dataclass(frozen=True)
class Toy:
    """Two settings."""

    size: int = setting(3, kind=Whole(), accepts="int", doc="How many. " + "And so on. " * 20, help="how many")
    hidden: int = setting(3, kind=Whole(), accepts="int", doc="Follows.", help="", derived=True)


def test_settings_document_themselves_as_parameters_of_a_docstring():
    lines = documentation(Toy).splitlines()
    assert lines[0] == "size : int"
    assert all(line.startswith("    ") and len(line) < 120 for line in lines[1:])
    assert " ".join(" ".join(lines[1:]).split()) == ("How many. " + "And so on. " * 20).strip()


def test_help_names_every_setting_of_a_problem_with_its_default_and_meaning():
    said = pydoc.render_doc(MeshProblem, renderer=pydoc.plaintext)
    signature = inspect.signature(MeshProblem)
    for kind in (Options, Rules):
        for name, known in settings_of(kind).items():
            if known.derived:
                assert name not in signature.parameters
                continue
            assert signature.parameters[name].default == defaults_of(kind)[name]
            assert re.search(rf"[ (]{name}: '[^']+' = {re.escape(repr(defaults_of(kind)[name]))},", said)
            assert f" {name} : {known.accepts}" in said
            assert " ".join(known.doc.split()) in " ".join(said.replace("|", " ").split())
    assert "SETTINGS" not in said


@pytest.mark.parametrize("kind", [Options, Rules])
def test_the_help_of_a_class_of_settings_says_them_all(kind: type) -> None:
    said = (kind.__doc__ or "").partition("Parameters\n----------\n")[2].partition("\n\nRaises\n")[0]
    assert [line.partition(" : ")[0] for line in said.splitlines() if not line.startswith(" ")] == list(
        settings_of(kind)
    )

import json
import math
import os

import numpy as np

from aerial_operator.console import pairs, percent, reserved_output, table, to_json


def test_what_is_no_finite_number_becomes_null():
    figures = {"a": math.nan, "b": [math.inf, 1.0], "c": {"d": np.float64(2.0)}, "e": (True, None, "x")}
    assert json.loads(to_json(figures)) == {"a": None, "b": [None, 1.0], "c": {"d": 2.0}, "e": [True, None, "x"]}


def test_whatever_writes_to_standard_output_cannot_reach_the_reserved_one(capfd):
    with reserved_output() as output:
        os.write(1, b"a library's banner\n")
        print("a stray print")
        print("the report", file=output)
    print("afterwards")
    written = capfd.readouterr()
    assert written.out == "the report\nafterwards\n"
    assert written.err == "a library's banner\na stray print\n"


def test_columns_line_up():
    assert pairs([("a", "1"), ("long", "2")]) == "  a     1\n  long  2"
    assert table(("x", "long"), [("1", "2")]) == "  x  long\n  -  ----\n  1  2"


def test_an_unknown_ratio_is_a_dash():
    assert (percent(0.314), percent(None)) == ("31 %", "–")

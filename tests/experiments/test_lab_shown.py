"""What texts show of decided questions, whose code is gone, follows from the values of their records."""

import math
import re
from collections import Counter

import pytest
from lab.records import Records
from lab.results import PER_FRAME, summary
from lab.shown import DECIDED

NUMBER = re.compile(r"(?<![\w.,:-])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
"""A number of a cell; not that of a version, a clause or a name."""

SECONDS = (1, 2, 5, 10, 20, 50, 90)
"""When the learning curve is read: each shows its last point before that."""

COUNTED = ("device", "reader", "compiled", "missed", "equal", "open")
"""How a bug of `house3` was found, or else its state, in the order of the table."""

OTHERS = ("departures", "house3")
"""Records whose numbers are computed again, by test_lab_records.py and below."""


@pytest.mark.parametrize("name", sorted(name for name in DECIDED if DECIDED[name] not in OTHERS))
def test_numbers_of_tables_follow_from_the_values(name):
    """Each number is a value of its row's records, how many have one, or a mean, deviation or interval."""
    found = Records()[DECIDED[name]]
    lines = [line for line in found.data()["shown"][name].splitlines() if line.startswith("| ")]
    checked = 0
    for line in lines[2:]:
        first, *cells = line.strip("| ").split(" | ")
        texts, values = known(found, first)
        for text in NUMBER.findall(" | ".join(cells)):
            digits = len(text.partition("e")[0].partition(".")[2])
            form = f".{digits}{'e' if 'e' in text else 'f'}"
            assert text in texts | {format(value, form) for value in values}, f"{first}: {text}"
            checked += 1
    assert checked > 5


def test_counts_of_bugs_follow_from_the_values():
    found = Records()["house3"]
    bugs = [record["values"] for record in found.records() if "origin" in record["values"]]
    counts = Counter((bug["group"], bug["origin"], bug["tier"] or bug["state"]) for bug in bugs)
    counts.update(("all", "", bug["tier"] or bug["state"]) for bug in bugs)
    for line in found.data()["shown"]["house3"].splitlines()[2:]:
        group, origin, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        expected = [counts[group, origin, how] for how in COUNTED]
        assert list(map(int, cells)) == [sum(expected), *expected]


def known(found, first):
    """Return texts with numbers, and numbers, that a row may have: of a configuration, or of any."""
    rows = found.records()
    mine = [record for record in rows if record["configuration"].partition(" #")[0] == first] or rows
    every = [leaf for record in mine for leaf in leaves(record)]
    words = Counter(leaf for leaf in every if isinstance(leaf, str))
    texts = {text for word in words for text in NUMBER.findall(word)}
    values = [*words.values(), *(leaf for leaf in every if not isinstance(leaf, str))]
    for name in dict.fromkeys(record["configuration"] for record in mine):
        (one, *_) = (record["values"] for record in mine if record["configuration"] == name)
        posed = one.get(PER_FRAME, {})
        for key in {**one, **posed}:
            if key in posed or isinstance(one[key], int | float):
                values += [*spread(found.of(name, key)), *vars(found.interval(name, key)).values()]
        curves = found.of(name, "curve")
        for seconds in SECONDS:
            seen = [[point for point in curve if point["seconds"] <= seconds] for curve in curves]
            values += spread([points[-1]["psnr"] for points in seen if points])
        values += [n for key in ("psnr", "seconds") for n in spread([curve[-1][key] for curve in curves])]
    return texts, [value for value in values if math.isfinite(value)]


def spread(values):
    """Return mean and deviation of numbers, if there are any."""
    there = [value for value in values if isinstance(value, int | float)]
    return [summary(there).mean, summary(there).deviation] if there else []


def leaves(value):
    """Return the numbers and texts in a value, without those of each pose."""
    if isinstance(value, dict | list):
        inner = [value[key] for key in value if key != PER_FRAME] if isinstance(value, dict) else value
        return [leaf for part in inner for leaf in leaves(part)]
    return [] if value is None else [value]

"""The first page's table of speeds: what it says of texts is what the reader does."""

import pytest
from lab import speeds
from lab.records import Records

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.proof.checker import check
from wamnet.compiler.reading.check import check_text
from wamnet.compiler.reading.lanes import Unread
from wamnet.compiler.variants import FULL, plan_model
from wamnet.kernels.bench.workload import random_model

pytest.importorskip("matplotlib", reason="matplotlib is not installed")

CERTIFIED = [
    *(("whole", way) for way in ("opencl tile:16", "opencl plain", "opencl fft:16", "c fft:16")),
    ("whole8", "opencl dot:16"),
]
"""Forms and ways of the rows of wamnet's kernels that have a certificate in the record."""


def reads(path):
    """Return whether the reader takes the text beside a certificate."""
    try:
        return check_text(path)["sums"] > 0
    except Unread:
        return False


@pytest.mark.parametrize(("form", "way"), CERTIFIED)
def test_what_is_said_of_a_text_is_what_the_reader_does(form, way, tmp_path):
    target, schedule = way.split()
    variant = FULL if form == "whole" else form
    plan = plan_model(random_model(), target, schedule=schedule, variant=variant)
    artifact.write(compile_plan(plan), tmp_path)
    path = tmp_path / artifact.CERTIFICATE_NAME
    assert check(path)
    bound = f"{max(plan.bound.output):.1e} †"
    assert speeds.source_verified(form, way, bound) == ("yes" if reads(path) else "no")


def test_only_a_certified_kernel_s_text_is_checked():
    assert speeds.source_verified("whole", "opencl plain", "1e-3") == "no"
    assert speeds.source_verified("oidn:high", "–", "–") == "–"


def test_the_first_page_names_every_certified_row():
    table = speeds.speed_short("bench-minicubes")(Records())
    heads, _, *rows = ([cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines())
    found = [dict(zip(heads, row, strict=True)) for row in rows]
    names = {name: key for key, name in speeds.SPEED_SHORT.items()}
    assert len({row["backend"] for row in found}) == len(found), (
        "the kernel that is in front is not shown twice"
    )
    certified = [names[row["backend"]] for row in found if row["bound, all frames"].endswith("†")]
    assert sorted(certified) == sorted(CERTIFIED)
    assert all(row["schedule"] == names[row["backend"]][1] for row in found)
    assert {names[row["backend"]] for row in found if row["source verified"] == "yes"} <= set(CERTIFIED)

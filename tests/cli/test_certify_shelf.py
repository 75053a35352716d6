"""`wamnet certify` of the shelf: its index says what the command finds, of each kernel."""

import hashlib
import json
import re
import shutil
from pathlib import Path

import pytest
import shelf

from wamnet.compiler.artifact import CERTIFICATE_NAME, MANIFEST_NAME

SHELF = Path(__file__).resolve().parents[2] / "kernels/shelf"
"""The shelf of the repository."""


def rows():
    """Return the index's rows as dictionaries by the heads of its columns."""
    lines = [line for line in (SHELF / shelf.INDEX).read_text().splitlines() if line.startswith("|")]
    heads, _, *found = ([cell.strip() for cell in line.split("|")[1:-1]] for line in lines)
    return [dict(zip(heads, cells, strict=True)) for cells in found]


def kernel_of(row):
    """Return the folder of a row's kernel."""
    return (SHELF / re.findall(r"\((.*)\)", row["target"])[0]).parent


ROWS = {kernel_of(row).relative_to(SHELF).as_posix(): row for row in rows()}
"""Rows of the index by the folders of their kernels."""

USUAL = ("minicubes/c",)
"""Kernels that every run certifies; the others are for the night."""


def stated(row):
    """Return the bound in a row, as text."""
    return row["bound"].partition("]")[0].removeprefix("[")


def test_the_index_has_a_row_for_each_kernel():
    """Its bound is below a step of a display; test_shelf.py compiles and proves it again."""
    assert set(ROWS) == {path.parent.relative_to(SHELF).as_posix() for path in SHELF.rglob("manifest.json")}
    assert set(USUAL) < set(ROWS)
    assert max(float(stated(row)) for row in ROWS.values()) < 1 / 255


@pytest.mark.nightly(but=USUAL)
@pytest.mark.parametrize("name", ROWS)
def test_the_index_says_what_certify_finds(wamnet, name):
    """CER-6, TXT-1: bound, schedule, and that the text computes the certified program."""
    row, outcome = ROWS[name], wamnet("certify", SHELF / name)
    assert outcome.status == 0, outcome.out + outcome.err
    held, manifest = (json.loads((SHELF / name / n).read_text()) for n in (CERTIFICATE_NAME, MANIFEST_NAME))
    assert float(stated(row)) == max(held["bound"]["output"])
    assert f"holds: |output - reference| <= {stated(row)} for all images" in outcome.out
    assert row["schedule"] == manifest["schedule"]["name"]
    language = manifest["language"].partition(",")[0]
    assert row["text checked"] == (
        f"yes, as {language}" if "source: computes the certified program" in outcome.out else "no"
    )


@pytest.mark.nightly
def test_a_text_of_the_shelf_that_is_changed_is_refused(wamnet, tmp_path):
    """A weight's index is one off, and the digests agree."""
    shutil.copytree(SHELF / "glossy/wgsl", tmp_path / "kernel")
    shutil.copy(SHELF / "glossy/weights.bin", tmp_path)
    source = (tmp_path / "kernel/denoise.wgsl").read_bytes()
    wrong = source.replace(b"+ j]", b"+ j + 1]", 1)
    assert wrong != source
    (tmp_path / "kernel/denoise.wgsl").write_bytes(wrong)
    digest = hashlib.sha256(wrong + (tmp_path / "weights.bin").read_bytes()).hexdigest()
    for file, key in ((CERTIFICATE_NAME, "manifest_digest"), (MANIFEST_NAME, "digest")):
        told = json.loads((tmp_path / "kernel" / file).read_text())
        told["files"]["denoise.wgsl"] = hashlib.sha256(wrong).hexdigest()
        told[key] = digest
        told |= (
            {"file_bytes": {**told["file_bytes"], "denoise.wgsl": len(wrong)}} if "file_bytes" in told else {}
        )
        (tmp_path / "kernel" / file).write_text(json.dumps(told))
    outcome = wamnet("certify", tmp_path / "kernel")
    assert outcome.status == 1
    assert "rejected: source: " in outcome.out

"""The second implementation, examples/c99/wamnet.c: it needs nothing, and passes all.

Of its mutants (examples/c99/mutants.txt) every third is asked here; `python examples/c99/mutants.py` asks
all of them.
"""

import base64
import importlib.util
import json
import random
import re
import shutil
import subprocess
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wamnet.models.model_file import load_model, save_model
from wamnet.refimpl.network import domain
from wamnet.refimpl.network.dataset import channels_of
from wamnet.spec.conformance import run, vectors
from wamnet.spec.conformance.report import ELEMENTARY

SOURCE = Path(__file__).parents[2] / "examples" / "c99" / "wamnet.c"
"""The program: one file."""

EVERY = 3
"""One mutant in this many is asked."""

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
"""Options under which the program must compile."""

SANITIZERS = ["-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
"""Reads and writes outside of memory, and undefined behaviour, end a program that is built so."""

HEADERS = {"errno", "float", "math", "setjmp", "stdarg", "stdbool", "stdint", "stdio", "stdlib", "string"}
"""Parts of C99's own library."""


@pytest.fixture
def compiler(executor_named) -> str:
    """Give the C compiler, under the policy of executors: one that is required and missing fails here."""
    executor_named("c")
    found = shutil.which("cc") or shutil.which("gcc")
    if found is None:
        pytest.skip("the C compiler that CC names is neither cc nor gcc")
    return found


@pytest.fixture
def built(tmp_path, compiler):
    """Give a function that compiles the program with flags and returns its path."""

    def build(flags: list[str]) -> str:
        program = tmp_path / "wamnet-c99"
        command = [compiler, *STRICT, *flags, SOURCE, "-o", program, "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return str(program)

    return build


@pytest.fixture(scope="module")
def mutants():
    """Give the module of examples/c99/mutants.py."""
    spec = importlib.util.spec_from_file_location("c99_mutants", SOURCE.with_name("mutants.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_includes_headers_of_the_standard_alone():
    included = re.findall(r"^ *# *include *(\S+)", SOURCE.read_text(), re.MULTILINE)
    assert set(included) <= {f"<{name}.h>" for name in HEADERS}


def test_its_clauses_exist():
    chapters = "".join(path.read_text() for path in (SOURCE.parents[2] / "spec").glob("*.md"))
    named = set(re.findall(r"\b[A-Z]{3}-\d+[a-z]?\b", SOURCE.read_text())) - {"SHA-256", "UTF-8"}
    assert len(named) > 80
    assert not {clause for clause in named if f"**{clause}**" not in chapters}


def test_it_passes_all_cases_of_all_kinds(built, verdicts):
    found = verdicts([built(["-O2"])], [])
    assert [f"{v.id}: {v.stage} {v.text}" for v in found if v.verdict != run.PASS] == []
    assert len(found) == sum(map(len, run.read_vectors(vectors.FOLDER).values()))


@pytest.mark.nightly
def test_it_passes_under_sanitizers(built, verdicts):
    found = verdicts([built(SANITIZERS)], [])
    assert Counter(v.verdict for v in found) == {run.PASS: len(found)}


# ---- mutants ----------------------------------------------------------------------------------------------


def test_each_mutant_changes_one_place_and_breaks_a_clause(mutants):
    table = mutants.read(mutants.TABLE.read_text())
    assert len(table) >= 100
    assert len({m.name for m in table}) == len(table)
    known = {
        clause for some in run.read_vectors(vectors.FOLDER).values() for c in some for clause in c.clauses
    }
    assert {m.clause for m in table} <= known
    for mutant in table:
        mutants.mutated(mutant, SOURCE.read_text())


def test_a_mutant_whose_text_is_gone_is_an_error(mutants):
    mutant = mutants.Mutant("RNG-1", "nothing", (), "no such text", "another")
    with pytest.raises(ValueError, match=r"nothing: its text appears 0 times"):
        mutants.mutated(mutant, SOURCE.read_text())


@pytest.mark.nightly
def test_mutants_are_caught_and_blamed_on_the_clause_that_they_break(mutants, compiler, tmp_path):
    cases = run.read_vectors(vectors.FOLDER)
    asked = mutants.read(mutants.TABLE.read_text())[::EVERY]
    found = {m.name: mutants.outcome(m, cases, tmp_path, compiler) for m in asked}
    assert {name: came for name, came in found.items() if came.failed == 0} == {}
    wrong = {m.name: (m.clause, found[m.name]) for m in asked if found[m.name].clause != m.clause}
    assert wrong == {}


def test_every_kind_has_a_place_among_the_elementary_ones():
    kinds = run.read_vectors(vectors.FOLDER)
    assert [kind for kind in kinds if not any(kind.startswith(start) for start in ELEMENTARY)] == []


KNOWN_HARD = [
    b'{"id": "a", "kind": "file.scene", "input": {"text": "{\\"\\": 1}"}}',  # a name without letters
    b'{"kind": 1}',  # no id, no text
    b'{"id": "a", "kind": "metric.mse", "input": {"image": [[[]]], "reference": [[[]]]}}',
    b'{"id": "a", "kind": "file.model", "input": {"content": "===="}}',
    b'{"id": "a", "kind": "adam.run", "input": {"theta": [], "gradients": [[]], "learning_rate": 1}}',
]
"""Requests that ended the program once, or might."""


SEED = 20_261_121
"""Seed of the damage."""


def test_a_domain_is_a_text_like_others(built, tmp_path):
    """DOM-4: a reader that knows nothing of domains gives the same answer for a model that states one."""
    plain = base64.b64decode(run.read_vectors(vectors.FOLDER)["file.model"][0].inputs["content"])
    path = tmp_path / "m.safetensors"
    path.write_bytes(plain)
    model = load_model(path)
    flat = [np.full((2, 2, channels_of(model.features)), k / 9) for k in range(9)]
    text = domain.to_json(domain.domain_of(flat, model.features))
    save_model(path, replace(model, info={**model.info, domain.DOMAIN: text}))
    assert path.read_bytes() != plain
    lines = [
        json.dumps(
            {"id": "a", "kind": "file.model", "input": {"content": base64.b64encode(content).decode()}}
        )
        for content in (plain, path.read_bytes())
    ]
    done = subprocess.run(
        [built(["-O0"])], input="\n".join(lines), capture_output=True, text=True, check=True
    )
    first, second = done.stdout.splitlines()
    assert first == second
    assert "output" in json.loads(first)


def damaged(content: bytes, draw: random.Random) -> bytes:
    """Return bytes with some changed, cut, doubled, or replaced by what parsers stumble over."""
    hard = [b"", b"\x00", b"\xff", b"9" * 40, b"1e999", b"-", b"[" * 70, b'"', b"\\u", b"\\ud800", b"{", b"}"]
    for _ in range(draw.choice((1, 1, 2, 5))):
        at = draw.randrange(len(content) + 1)
        until = min(len(content), at + draw.choice((0, 1, 1, 2, 8)))
        piece = draw.choice((bytes([draw.randrange(256)]), draw.choice(hard), content[at : at + 20] * 2))
        content = content[:at] + piece + content[until:]
    return content


def hostile_requests(count: int) -> list[bytes]:
    """Return requests that hold damaged models and scenes, and damaged requests."""
    draw = random.Random(SEED)
    cases = run.read_vectors(vectors.FOLDER)
    models = [base64.b64decode(case.inputs["content"]) for case in cases["file.model"][:5]]
    texts = [str(case.inputs["text"]).encode() for case in cases["file.scene"][:5]]
    others = [
        json.dumps({"id": c.id, "kind": kind, "profile": "ieee", "input": dict(c.inputs)}).encode()
        for kind, some in cases.items()
        for c in some[:1]
    ]
    lines = []
    for index in range(count):
        model = base64.b64encode(damaged(draw.choice(models), draw)).decode()
        scene = damaged(draw.choice(texts), draw).decode("utf-8", "replace")
        for kind, given in (("file.model", {"content": model}), ("file.scene", {"text": scene})):
            lines.append(json.dumps({"id": str(index), "kind": kind, "input": given}).encode())
        lines.append(damaged(draw.choice(others), draw).replace(b"\n", b" "))
    return lines


@pytest.mark.nightly
def test_damaged_files_and_requests_are_answered(built):
    """Each line has an answer that is JSON, and no sanitizer ends the program."""
    lines = [line for line in [*KNOWN_HARD, *hostile_requests(300)] if line]
    done = subprocess.run(
        [built(SANITIZERS)], input=b"\n".join(lines), capture_output=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")[-2000:]
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(answers) == len(lines)
    words = Counter("refused" if "refused" in answer else "answered" for answer in answers)
    assert words["refused"] > len(lines) / 2  # most damage is noticed
    assert words["answered"] > 0  # some is a change to a name or a number

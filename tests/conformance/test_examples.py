"""The examples of the spec's chapter: programs that share no code with the project, and pass."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest

from wamnet.kernels.conformance import run, vectors
from wamnet.kernels.conformance.protocol import Session

CHAPTER = Path(__file__).parents[2] / "spec" / "conformance.md"


def verdicts(command, words, timeout_s=60.0):
    cases = run.chosen(run.read_vectors(vectors.FOLDER), words)
    with Session(command, timeout_s) as session:
        return list(run.run(session, cases, "ieee"))


def test_the_python_program_passes_what_it_supports(program):
    found = verdicts(program(), ["random.block", "encoding.display", "sine"])
    count = Counter((v.kind, v.verdict) for v in found)
    assert set(count) >= {("random.block", "pass"), ("encoding.display", "pass"), ("sine", "unsupported")}
    assert not [v for v in found if v.failed]


def test_the_python_program_has_forty_lines():
    (text,) = re.findall(r"^```python\n(.*?)^```$", CHAPTER.read_text(), re.MULTILINE | re.DOTALL)
    assert len(text.splitlines()) <= 40


def test_the_c_program_passes_what_it_supports(tmp_path):
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler is installed")
    (text,) = re.findall(r"^```c\n(.*?)^```$", CHAPTER.read_text(), re.MULTILINE | re.DOTALL)
    source, program = tmp_path / "small.c", tmp_path / "small"
    source.write_text(text)
    subprocess.run([compiler, "-std=c99", "-Wall", "-Werror", "-O2", source, "-o", program], check=True)
    found = verdicts([str(program)], ["random.block"])
    assert Counter(v.verdict for v in found) == {"pass": 16}

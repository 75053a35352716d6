"""The examples of the spec's chapter: programs that share no code with the project, and pass."""

import shutil
import subprocess
from collections import Counter

import pytest


def test_the_python_program_passes_what_it_supports(program, verdicts):
    found = verdicts(program(), ["random.block", "encoding.display", "sine"])
    count = Counter((v.kind, v.verdict) for v in found)
    assert set(count) >= {("random.block", "pass"), ("encoding.display", "pass"), ("sine", "unsupported")}
    assert not [v for v in found if v.failed]


def test_the_python_program_has_forty_lines(example):
    assert len(example("python").splitlines()) <= 40


def test_the_c_program_passes_what_it_supports(tmp_path, example, verdicts, executor_named):
    executor_named("c")  # A compiler that is required and missing fails here, under the policy of executors.
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("the C compiler that CC names is neither cc nor gcc")
    source, program = tmp_path / "small.c", tmp_path / "small"
    source.write_text(example("c"))
    subprocess.run([compiler, "-std=c99", "-Wall", "-Werror", "-O2", source, "-o", program], check=True)
    found = verdicts([str(program)], ["random.block"])
    assert Counter(v.verdict for v in found) == {"pass": 22}

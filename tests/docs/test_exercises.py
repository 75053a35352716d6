"""The exercises' graders: each passes a right answer, and fails the skeleton and wrong ones, with a
reason."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.needs("programs")

ROOT = Path(__file__).resolve().parents[2]

EXERCISES = ROOT / "docs/exercises"

SOLUTIONS = Path(__file__).parent / "solutions"
"""Right answers: for these tests, not for students."""

NAMES = sorted(path.name for path in EXERCISES.glob("ex*") if path.is_dir())

WRONG = {
    "ex1_sphere": [
        ("np.where(near > 0, near, far)", "near", "a distance is not positive|error"),
        (
            "radius * radius - np.sum(nearest * nearest, axis=-1)",
            "b * b - (np.sum(f * f, axis=-1) - radius * radius)",
            "off by .* at a distance of 1000",
        ),
        ("square > 0", "square > 0.1", "error .*, bound|in its way"),
    ],
    "ex2_camera": [
        ("height - 2 * (y + v)", "2 * (y + v) - height", "row 0 is at the top"),
        ("- width) / height", "- width) / width", "camera.ray"),
        ("np.cross(forward, camera.up)", "np.cross(camera.up, forward)", "column 0|row 0"),
    ],
    "ex3_sampling": [
        ("np.sqrt(u0), 2", "np.sqrt(1 - (1 - u0) ** 2), 2", "not of length 1"),
        (
            "radius, angle = np.sqrt(u0), 2 * np.pi * u1\n",
            "z = 1 - u0\n    radius, angle, u0 = np.sqrt(1 - z * z), 2 * np.pi * u1, 1 - z * z\n",
            "chi-square test",
        ),
        ("/ np.pi", "/ 2", "integral is"),
    ],
    "ex4_light": [
        ("reflectance * np.ones_like(z)", "reflectance * z / np.pi", "in a furnace of 2"),
        ("1 / (1 + ratio * ratio)", "(p := np.maximum(pdf, 1e-15)) * p / (p * p + other**2)", "are alike"),
        ("4 * half * half", "half * half", "p-value"),
    ],
    "ex5_window": [
        ("dx - size // 2", "dx - (size - 1) // 2", "image.window"),
        ("0 * pixel", "pixel", "image.window"),
        ("1 <= size <= 64", "1 <= size <= 65", "must be refused"),
    ],
    "ex6_network": [
        ("(x @ w.T + b) * omegas[min(layer, 1)]", "x @ w.T * omegas[min(layer, 1)] + b", "network.forward"),
        ("* np.cos(angles[layer]) * omegas[min(layer, 1)]", "* np.cos(angles[layer])", "network.gradient"),
        ("2 * error / error.size", "error / error.size", "network.gradient"),
    ],
    "ex7_adam": [
        ("(np.sqrt(square) + 1e-8)", "np.sqrt(square + 1e-8)", "the first step goes to|adam.run"),
        ("m / (1 - 0.9**t)", "m", "the first step goes to"),
        ("0.999 * v", "0.99 * v", "adam.run"),
    ],
    "ex8_sine": [
        ("for part in PI_PARTS:", "for part in (np.float32(np.pi),):", "sine|error"),
        ("k = np.floor(x * ONE_OVER_PI + 0.5)\n", "return np.sin(x)\n", "is not made of sin"),
        ("sign * p", "p", "sine/"),
    ],
    "ex9_pass": [
        ("(args, args[::-1])", "(args,)", r"\(-a\) \+ b became"),
        ('if node.op != "add"', 'if node.op not in ("add", "subtract")', r"a - \(-b\) became"),
        ("(kept, builder.nodes[other].args[0])", "(builder.nodes[other].args[0], kept)", "other numbers"),
    ],
    "ex10_integers": [
        (
            "np.sum(np.abs(weights), axis=1)",
            "np.abs(np.sum(weights, axis=1))",
            "a partial sum of row .* reaches",
        ),
        (
            "words * factor.astype(np.uint32) + bias.astype(np.uint32)",
            "(sums * factor + bias).astype(np.int64).astype(np.uint32)",
            "the phase of .* expected",
        ),
        ("x * q + (1 << (shift - 1))", "x * q", "whole.sine/.* bound 0"),
        (
            "np.minimum((x * q + (1 << (shift - 1))) >> shift, amplitude).astype(np.float32)",
            "np.floor((x * q + (1 << (shift - 1))).astype(np.float32) / 2**shift)",
            r"right in NumPy perhaps, but convert .* float32 is exact up to 2\^24",
        ),
    ],
    "ex11_suite": [
        (" & (behind < 1e30)", "", "6 cases of intersection.sphere see it: at most 4"),
        ("normal=-surface.normal", "normal=surface.normal", "no case sees a fault; ISC-8"),
        ("np.where(depth > 0, 1 / np.maximum(depth, 1e-9), 0)", "1 / depth", "the rule misses is blamed"),
        (" & (linear < 0.8)", "", r"encoding.display/\d+ sees what you hid"),
    ],
}
"""Of each exercise: a piece of the right answer, a wrong one in its place, and what the grader must say."""

BLAMED_WRONGLY = [
    [
        ("np.where((found == 1e30) & (behind < 1e30), -behind, found)", "found", "no case sees .*; ISC-6 is"),
        ("np.abs(a), axis=-1, keepdims=True)", "a * a, axis=-1, keepdims=True) ** 0.5", "VEC-3 is to be"),
        ("np.ones_like(hit.t)", "right(world, path, hit, surface)", "no case sees a fault; LTR-2 is"),
        ("1 / np.maximum(depth, 1e-9)", "2 * depth", "depth times distance is 1 up to .*: write one over"),
        ("found + 0.02", "found + 0.002", "0 of 1000 values are off by 0.01: at least 50"),
    ],
    [
        (
            "np.where((found == 1e30) & (behind < 1e30), -behind, found)",
            "np.stack([found] * 2)",
            "ValueError",
        ),
        (
            "a / np.sum(np.abs(a), axis=-1, keepdims=True)",
            "np.where(a == 3, 0.9, right(a))",
            "rays are right",
        ),
        ("np.ones_like(hit.t)", "1 // 0", "ZeroDivisionError"),
        ('"depth": np.where', '"normal": np.where', "the rule .* is blamed; depth is to be"),
        ("0.6", "0.9", "linear = 0.9 does not see what you hid"),
    ],
    [
        ("np.ones_like(hit.t)", "np.ones_like(hit.t) + path.missing", "AttributeError"),
        ("found + 0.02", "found + 0.02 * (np.size(linear) > 1)", "linear = 0.6 does not see what you hid"),
    ],
]
"""The same for the exercise of blame, several pieces at once: the grader must say all."""

ROUNDS = max(len(found) for found in WRONG.values())

NO_TESTS, FAILED = 5, 1
"""Exit statuses of pytest."""


def graded(*options: str, only: str = "") -> tuple[int, dict[str, str], str]:
    """Return the exit status of all graders, or of one, verdicts by exercise, and all that was said."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        str(EXERCISES / only),
        *options,
    ]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False, stdin=subprocess.DEVNULL
    )
    assert done.returncode in (0, FAILED), done.stdout + done.stderr
    verdicts = dict(re.findall(r"^(ex\d\w+): (.*)$", done.stdout, re.MULTILINE))
    assert sorted(verdicts) == ([only] if only else NAMES), done.stdout
    return done.returncode, verdicts, done.stdout


def test_there_is_an_answer_and_a_page_for_each_exercise():
    page = (EXERCISES / "index.md").read_text()
    assert sorted(WRONG) == NAMES == sorted(path.stem for path in SOLUTIONS.glob("ex*.py"))
    assert [name for name in NAMES if f"docs/exercises/{name}/exercise.py" not in page] == []


def test_right_answers_pass():
    status, verdicts, said = graded("--solutions", str(SOLUTIONS))
    assert status == 0, said
    assert all(re.fullmatch(r"(\d+) of \1 checks, passed", verdict) for verdict in verdicts.values())


def test_skeletons_fail_and_name_what_is_to_be_written():
    status, verdicts, _ = graded()
    assert status == FAILED
    for name in NAMES:
        first = re.search(r'NotImplementedError\("(\w+)"\)', (EXERCISES / name / "exercise.py").read_text())
        assert verdicts[name].startswith("0 of "), verdicts[name]
        assert f"not yet; NotImplementedError: {first and first[1]}" in verdicts[name]


@pytest.mark.parametrize("number", range(ROUNDS))
def test_wrong_answers_fail_with_a_reason(tmp_path, number):
    for name in NAMES:
        shutil.copy(SOLUTIONS / f"{name}.py", tmp_path)
        right, (old, new, _) = (SOLUTIONS / f"{name}.py").read_text(), WRONG[name][number % len(WRONG[name])]
        assert right.count(old) >= 1, f"{name}: {old!r} is gone"
        (tmp_path / f"{name}.py").write_text(right.replace(old, new))
    status, verdicts, said = graded("--solutions", str(tmp_path))
    assert status == FAILED
    for name in NAMES:
        *_, reason = WRONG[name][number % len(WRONG[name])]
        assert "not yet; " in verdicts[name], (
            f"{name} passed {WRONG[name][number % len(WRONG[name])]}\n{said}"
        )
        assert re.search(reason, verdicts[name]), f"{name}: {verdicts[name]}"


@pytest.mark.parametrize("pieces", BLAMED_WRONGLY)
def test_faults_that_are_blamed_wrongly_are_told(tmp_path, pieces):
    answer = (SOLUTIONS / "ex11_suite.py").read_text()
    for old, new, _ in pieces:
        assert answer.count(old) == 1, f"{old!r} is gone"
        answer = answer.replace(old, new)
    (tmp_path / "ex11_suite.py").write_text(answer)
    status, verdicts, said = graded("--solutions", str(tmp_path), only="ex11_suite")
    assert status == FAILED, said
    assert verdicts["ex11_suite"].startswith(f"{7 - len(pieces)} of 7 checks, not yet; ")
    assert [reason for *_, reason in pieces if not re.search(reason, said)] == [], said


def test_an_answer_that_is_not_there_is_told(tmp_path):
    _, verdicts, _ = graded("--solutions", str(tmp_path), "-k", "vectors or function or density or wards")
    assert all("not yet; there is no " in verdict for verdict in verdicts.values())

"""Kernels' texts for the tests of their reader: written, changed in a place, and with planted faults."""

import numpy as np
import text_faults
from kit import untrained

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_plan, compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.proof.evidence import read
from wamnet.compiler.targets import language_named
from wamnet.compiler.variants import plan_model

NAME = artifact.CERTIFICATE_NAME


def model(size=3, border="zero", activation="sine", seed=5):
    return untrained((6, 5), size=size, border=border, omegas=(1.0, 3.0), seed=seed, activation=activation)


def kernel(folder, target, schedule="plain", **kwargs):
    """Write a kernel; return its certificate's path."""
    artifact.write(compile_program(lower(model(**kwargs)), target, schedule=schedule), folder)
    return folder / NAME


def planned(folder, target, schedule="plain", variant="whole8", profile="ieee", **kwargs):
    """Write a kernel of a variant or a profile; return its certificate's path."""
    plan = plan_model(model(**kwargs), language_named(target).under(profile), schedule, variant)
    artifact.write(compile_plan(plan), folder)
    return folder / NAME


def parts(path):
    """Return the text of a kernel, its certificate, manifest and weights."""
    held, manifest, *_ = read(path)
    (name,) = (name for name in manifest["files"] if name != "weights.bin")
    weights = np.frombuffer((path.parent / "weights.bin").read_bytes(), "<f4")
    return (path.parent / name).read_text(), held, manifest, weights


def changed(given, old, new, count=1):
    source, *others = given
    assert source.count(old) >= count, f"the text has no {old!r}"
    return (source.replace(old, new, count), *others)


def unnoticed(given, count):
    """Plant faults of a fixed seed in a text, one at a time; return those that its reader accepts."""
    found = [*text_faults.tried(given, count, seed=7)]
    assert len(found) == count
    return [f for f, noticed in found if not noticed and not text_faults.spare(given[0], f)]

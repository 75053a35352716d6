"""Kernels' texts for the tests of their reader: written, changed in a place, and with planted faults."""

import json

import text_faults
from kit import untrained

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_plan, compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.proof.evidence import FIRST_PASS, read
from wamnet.compiler.targets import language_named
from wamnet.compiler.variants import plan_model

NAME = artifact.CERTIFICATE_NAME


def model(size=3, border="zero", activation="sine", seed=5, omegas=(1.0, 3.0)):
    return untrained((6, 5), size=size, border=border, omegas=omegas, seed=seed, activation=activation)


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
    held, manifest, _, _, weights = read(path)
    (name,) = (name for name in manifest["files"] if name != "weights.bin")
    first = FIRST_PASS if path.name.startswith(FIRST_PASS) else ""
    return (path.parent / f"{first}{name}").read_text(), held, manifest, weights


def certificate_of(path):
    return json.loads(path.read_text())


def leaves(node, under=False, place=()):
    """Return the places of all numbers under keys that hold `bound`."""
    if isinstance(node, dict):
        return [
            p for key, value in node.items() for p in leaves(value, under or "bound" in key, (*place, key))
        ]
    if isinstance(node, list):
        return [p for i, value in enumerate(node) for p in leaves(value, under, (*place, i))]
    return [place] if under and type(node) in (int, float) else []


def put(node, place, value):
    """Return a copy with another value at a place."""
    copy = json.loads(json.dumps(node))
    inner = copy
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value(inner[place[-1]])
    return copy


def changed(given, old, new, count=1):
    source, *others = given
    assert source.count(old) >= count, f"the text has no {old!r}"
    return (source.replace(old, new, count), *others)


def unnoticed(given, count):
    """Plant faults of a fixed seed in a text, one at a time; return those that its reader accepts."""
    found = [*text_faults.tried(given, count, seed=7)]
    assert len(found) == count
    return [f for f, noticed in found if not noticed and not text_faults.spare(given[0], f)]

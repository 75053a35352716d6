"""The language around a kernel's arithmetic: what no source may have is rejected, by class (spec/text.md)."""

import functools
import json

import pytest
import text_classes
import text_faults
from texts import kernel, parts, planned

from wamnet.compiler.core import sine
from wamnet.compiler.proof import checker, evidence
from wamnet.compiler.proof.evidence import Refused
from wamnet.compiler.reading.check import check_facts, check_text, run_text
from wamnet.compiler.reading.lanes import Unread
from wamnet.compiler.reading.languages import TITLES
from wamnet.compiler.reading.limits import limited
from wamnet.refimpl.errors import InputError

CASES = {
    f"{number} {target}: {what}": (target, old, new)
    for number, (what, targets, old, new) in enumerate(text_classes.CLASSES)
    for target in targets
}
"""Every class of faults, in every language that it is one of."""

USUAL = [f"{n} {ts[n % len(ts)]}: {what}" for n, (what, ts, *_) in enumerate(text_classes.CLASSES)]
"""One language of each class, in turn: one grammar reads all of them."""


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Return a function of the parts of a target's plain kernel."""
    folder = tmp_path_factory.mktemp("plain")
    return functools.cache(lambda target: parts(kernel(folder / target, target)))


@pytest.mark.nightly(but=USUAL)
@pytest.mark.parametrize("case", CASES)
def test_faults_of_the_language_are_rejected(plain, case):
    """TXT-1, TXT-5, TXT-8: each was accepted by an earlier source check, or is of the same class."""
    target, old, new = CASES[case]
    source, *others = plain(target)
    assert old in source
    with pytest.raises((Refused, Unread), match=r"\S"):
        run_text(source.replace(old, new, 1), *others)


@pytest.mark.parametrize(
    ("what", "of", "old", "new"),
    text_classes.OF_SCHEDULES,
    ids=[" ".join(c[:2]) for c in text_classes.OF_SCHEDULES],
)
def test_faults_of_the_language_of_schedules_are_rejected(what, of, old, new, tmp_path):
    source, *others = parts(planned(tmp_path, *of.split()))
    assert old in source
    last = "#define GROUP_HEIGHT 8\n" * (not new)
    with pytest.raises((Refused, Unread), match=r"\S"):
        run_text(source.replace(old, new, 1) + last, *others)


@pytest.mark.parametrize(
    ("of", "key", "value"),
    [
        ("window", "size", 5),
        ("window", "border", "clamp"),
        ("output", "name", "normal"),
        ("schedule", "rows", 2),
        ("schedule", "pixels", 1.5),
        ("schedule", "name", "group:1"),
        ("images", "channels", 4),
        ("images", "name", "albedo"),
        ("images", "high", 2.0),
        ("images", "", None),
    ],
)
def test_a_manifest_of_other_images_or_work_items_is_rejected(plain, of, key, value):
    """What a host calls a kernel by is what its certificate says."""
    source, held, manifest, weights = plain("opencl")
    turned = manifest["images"][::-1]
    if key:
        first = {**(manifest[of][0] if of == "images" else manifest[of]), key: value}
        turned = [first, *manifest["images"][1:]]

    def check(other):
        evidence.check_manifest(other, held["program"], len(weights))
        run_text(source, held, other, weights)

    check(manifest)
    with pytest.raises(Refused, match="manifest"):
        check({**manifest, of: turned if of == "images" else first})


@pytest.mark.parametrize(
    ("key", "value", "match"),
    [
        ("digest", "0" * 64, "digest of the kernel"),
        ("files", {"weights.bin": "0" * 64}, "digests"),
        ("certificate", None, "certificate"),
        ("output", {"name": "color", "channels": 2, "encoding": ""}, "channels"),
        ("output", {"name": "color", "channels": 3, "encoding": None}, "strings"),
        ("profile", {"name": "ieee-sine7", "text": ""}, "degree"),
        ("profile", {"name": "ieee", "text": "", "order": 1}, "unknown keys of profile"),
        ("stride", 4, "unknown keys"),
        ("language", [], "strings"),
        ("private_bytes", "x", "count"),
        ("bound", {"output": [0.0], "against": "float32"}, "against"),
        ("sine_arguments", [], "sine_arguments"),
        ("sine_arguments", [[-1e300, 0.0], [0.0, 1.0]], "ranges"),
        ("file_bytes", {"weights.bin": 1.0}, "file_bytes"),
        ("weights", {"layout": [], "order": "", "count": 1}, "layout"),
        ("weights", {"order": "", "layout": [{"name": "W0", "offset": 0, "shape": [9]}], "count": 8}, "in"),
    ],
)
def test_a_manifest_of_other_facts_is_rejected(plain, key, value, match):
    """TXT-8: what a host acts on is the certificate's."""
    source, held, manifest, weights = plain("opencl")
    data = source.encode() + weights.tobytes()
    check_facts(manifest, held, data)
    with pytest.raises(Refused, match=match):
        check_facts({**manifest, key: value}, held, data)


def test_a_manifest_of_another_form_is_rejected(tmp_path):
    """The mirror of the facts: none may be nothing, a number, a string or a list of nothing."""
    path = kernel(tmp_path, "opencl")
    manifest = json.loads((path.parent / "manifest.json").read_text())
    for key in manifest.keys() - {"info", "passes"}:
        for value in (None, -1e300, "x", [], [None]):
            if (key, value) == ("arguments", "x"):  # words for readers
                continue
            (path.parent / "manifest.json").write_text(json.dumps({**manifest, key: value}))
            with pytest.raises((Refused, InputError, Unread), match=r"\S"):
                checker.check(path) and check_text(path)


@pytest.mark.nightly(but=("opencl", "wgsl"))
@pytest.mark.parametrize("target", sorted(TITLES))
def test_a_foreign_word_is_rejected_anywhere(plain, target):
    """The mirror of the classes above: no other word is before a word of a kernel."""
    source, *others = plain(target)
    kinds = ("a foreign word", "a line lost")
    every = [fault for fault in text_faults.faults(source) if fault.kind in kinds]
    for fault in every[:: len(every) // 45]:
        with pytest.raises((Refused, Unread), match=r"\S"):
            run_text(source[: fault.start] + fault.new + source[fault.end :], *others)


def test_a_wrong_sine_of_the_compiler_is_found(monkeypatch, tmp_path):
    """TXT-4: the checkers have a sine of their own."""
    right = sine.POLYNOMIALS[11]
    wrong = tuple(c * (1.01 if k == 1 else 1.0) for k, c in enumerate(right.coefficients))
    polynomials = {**sine.POLYNOMIALS, 11: sine.Polynomial(wrong, 0.0, right.error, right.cosine_error)}
    monkeypatch.setattr(sine, "POLYNOMIALS", polynomials)
    path = kernel(tmp_path, "c")
    with pytest.raises(Refused, match="never made"):
        check_text(path)


@pytest.mark.parametrize(
    "new",
    [
        f"    int q = {'(' * 100_000}1{')' * 100_000};\n    for",
        "    " + "{" * 50_000 + "}" * 50_000 + "\n    for",
        "    wamnet_image(image_color, image_normal, weights, result, width, height);\n    for",
    ],
)
def test_deep_sources_are_not_checked(plain, new):
    source, *others = plain("c")
    with pytest.raises((Refused, Unread), match=r"\S"):
        run_text(source.replace("    for", new, 1), *others)


def test_a_source_that_never_ends_is_not_checked(plain, monkeypatch):
    monkeypatch.setattr("wamnet.compiler.reading.limits.SECONDS", 1)
    source, *others = plain("c")
    loops = "".join(f"for (int {k} = 0; {k} < 3000; ++{k}) {{ " for k in "abcd") + "v1[0] = 0.0f; }}}}"
    endless = source.replace("    float v1[6];", f"    float v1[6];\n    {loops}", 1)
    with pytest.raises(Unread, match="more than 1 s"):
        limited(run_text, endless, *others)


def test_a_source_that_fills_the_memory_is_not_checked():
    with pytest.raises(Unread, match="1024 MB"):
        limited(bytearray, [(2**31,)])

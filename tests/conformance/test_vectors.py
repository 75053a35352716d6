"""The vectors in the repository are those that the reference makes, in the form that their schema states."""

import json
import math
import re
from functools import cache
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scene as scene_module
from wamnet.refimpl.light import scenes
from wamnet.spec.conformance import case, vectors
from wamnet.spec.conformance.kinds import FUNCTIONS, KINDS
from wamnet.spec.conformance.numbers import from_json, is_number

FILES = sorted(path for path in vectors.FOLDER.glob("*.json") if path.name != "schema.json")

SHARE = 64
"""A number that is made again may differ by this share of its bound (CNF-7)."""


LONG = (
    *("path.start", "path.arrive", "path.scatter", "path.shadow", "path.whole"),
    *("picture.exact", "picture.rendered"),
)
"""Kinds that take seconds to make; the reference answers the written ones in every run."""

VALID = jsonschema.Draft202012Validator(json.loads((vectors.FOLDER / "schema.json").read_text())).validate


@cache
def made_of(name):
    """Return the cases of a kind, made once for all tests."""
    return KINDS[name].make()


@pytest.fixture(scope="module")
def made():
    return vectors.contents()


def moved(old, new, bound, path):
    """Yield what differs between a stored and a new value by more than a share of the bound."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        each = bound if isinstance(bound, list) else [bound] * len(old)
        for index, parts in enumerate(zip(old, new, each, strict=True)):
            yield from moved(*parts, f"{path}[{index}]")
    elif old != new and not (
        is_number(old) and is_number(new) and abs(number(old) - number(new)) <= number(bound) / SHARE
    ):
        yield f"{path}: {old} is now {new}"


def number(value):
    return float(from_json(value, "number"))


def differences(old, new):
    """Yield what differs between two cases; bounds have 8 bits, so they may be one bit apart."""
    plain = [{k: v for k, v in c.items() if k != "expected"} for c in (old, new)]
    if plain[0] != plain[1] or set(old.get("expected", ())) != set(new.get("expected", ())):
        yield f"{old['id']}: {plain[0]} is now {plain[1]}"
        return
    for name, output in old.get("expected", {}).items():
        others = new["expected"][name]
        ways = zip([output, *output.get("accepted", ())], [others, *others.get("accepted", ())], strict=True)
        for one, other in ways:
            yield from moved(one["value"], other["value"], one["bound"], f"{old['id']}: {name}")
            yield from moved(
                one["bound"], other["bound"], scaled(one["bound"]), f"{old['id']}: bound of {name}"
            )


def scaled(bound):
    """Return what a bound may change by, times SHARE: 2 of its 8 bits."""
    return [scaled(part) for part in bound] if isinstance(bound, list) else number(bound) * SHARE / 64


@pytest.mark.nightly(*LONG)
@pytest.mark.parametrize("name", KINDS)
def test_vectors_are_those_that_the_reference_makes(name):
    path = vectors.FOLDER / f"{name}.json"
    way_out = (
        "run wamnet conformance --write spec/vectors, read git diff, and raise the version if it is meant"
    )
    assert path.exists(), f"{path.name} is not there; {way_out}"
    old, new = json.loads(path.read_text()), json.loads(vectors.text_of(KINDS[name], made_of(name)))
    assert {k: v for k, v in old.items() if k != "cases"} == {k: v for k, v in new.items() if k != "cases"}
    assert [c["id"] for c in old["cases"]] == [c["id"] for c in new["cases"]], way_out
    found = [text for pair in zip(old["cases"], new["cases"], strict=True) for text in differences(*pair)]
    assert not found, f"{found[:5]}; {way_out}"


@pytest.mark.nightly
def test_pages_are_those_that_the_reference_makes(made):
    assert {
        p.relative_to(vectors.FOLDER).as_posix() for p in vectors.FOLDER.rglob("*") if p.is_file()
    } == set(made)
    for name in ("schema.json", "README.md"):
        assert (vectors.FOLDER / name).read_bytes() == made[name], name


def test_every_file_is_named_by_a_case():
    named = {
        value["file"]
        for path in FILES
        for c in json.loads(path.read_text())["cases"]
        for value in c["input"].values()
        if isinstance(value, dict) and "file" in value
    }
    assert named == {p.relative_to(vectors.FOLDER).as_posix() for p in vectors.FOLDER.glob("*/*")}


@pytest.mark.parametrize("name", ["cornell", "glossy", "daylight", "minicubes"])
def test_canonical_scenes_are_those_of_the_reference(name):
    text = (vectors.FOLDER / f"scenes/{name}.json").read_text()
    assert text == scene_module.to_json(scenes.canonical(name, time=1.25))


@pytest.mark.parametrize("path", sorted(vectors.FOLDER.glob("scenes/*")), ids=lambda path: path.stem)
def test_scenes_of_the_vectors_are_written_as_files_are(path):
    assert scene_module.to_json(scene_module.from_json(path.read_text())) == path.read_text()


def test_a_new_case_is_an_input_and_a_clause():
    """What else it has is computed: decimals of functions are rounded to float32."""
    made = KINDS["encoding.display"].made({"clause": "ENC-5", "input": {"linear": 0.1}}, 7)
    assert (made.id, made.inputs, made.flags) == ("encoding.display/7", {"linear": "0x1.99999ap-4"}, ())
    assert 0.0 < made.expected["encoded"].bound < 1e-5
    told = {
        "clause": "ENC-5",
        "note": "n",
        "input": made.inputs,
        "expected": {"encoded": {"clause": "ENC-1"}},
    }
    (output,) = KINDS["encoding.display"].made(told).expected.values()
    assert output.clause == "ENC-1"
    assert KINDS["image.draws"].made({"clause": "CNF-9", "input": {"seed": True}}).expected is None


# ---- form -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_files_follow_the_schema(path):
    data = json.loads(path.read_text())
    VALID(data)
    assert data["kind"] == path.stem
    assert data["version"] == case.VERSION
    assert len({c["id"] for c in data["cases"]}) == len(data["cases"])


def test_the_schema_refuses_what_is_no_vector():
    data = json.loads((vectors.FOLDER / "metric.mse.json").read_text())
    wrong = [
        lambda c: c.pop("clause"),
        lambda c: c.update(valid=False),
        lambda c: c["expected"]["value"].pop("bound"),
        lambda c: c["expected"]["value"].update(value="0x1.8"),
        lambda c: c.update(flags=["other"]),
        lambda c: c.update(id="metric.mse"),
    ]
    for change in wrong:
        changed = json.loads(json.dumps(data))
        change(changed["cases"][0])
        with pytest.raises(jsonschema.ValidationError, match=r"."):
            VALID(changed)


def test_every_kind_says_what_its_fields_are():
    for name, kind in KINDS.items():
        for c in json.loads((vectors.FOLDER / f"{name}.json").read_text())["cases"]:
            for side, fields in ((c["input"], kind.inputs), (c.get("expected", {}), kind.outputs)):
                known = [re.compile(name[:-1] + r"\d+" if name.endswith("_l") else name) for name in fields]
                unknown = [name for name in side if not any(p.fullmatch(name) for p in known)]
                assert not unknown, f"{c['id']}: the page of formats does not name {unknown}"


def test_bounds_are_finite_and_small():
    """Functions have bounds below 0.1 of 1 or of the value: an answer that means nothing passes nowhere."""
    for name in FUNCTIONS:
        for c in made_of(name):
            for output in c.expected.values():
                bound, value = np.max(output.bound), np.max(np.abs(output.value))
                assert math.isfinite(bound), name
                assert bound <= 0.1 * max(1.0, value), f"{c.id}: {bound} of {value}"


def test_each_kind_of_files_has_cases_to_be_refused():
    for name in (
        "file.model",
        "file.scene",
        "image.features",
        "image.smoothed",
        "image.window",
        "metric.ssim",
        "picture.denoised",
    ):
        assert any(c.expected is None for c in case.load(vectors.FOLDER / f"{name}.json")[1]), name


# ---- reading ----------------------------------------------------------------------------------------------


def written(tmp_path: Path, **changes) -> Path:
    data = json.loads((vectors.FOLDER / "sine.json").read_text())
    path = tmp_path / "sine.json"
    path.write_text(json.dumps({**data, **changes}))
    return path


def test_a_file_comes_back_as_it_was_made():
    kind, cases = case.load(vectors.FOLDER / "random.block.json")
    assert (kind, len(cases)) == ("random.block", 22)
    assert cases[0].expected["words"].value == list(KINDS["random.block"].make()[0].expected["words"].value)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"format": "other"}, "its format must be 'wamnet-vectors'"),
        (
            {"version": "2.0.0"},
            r"version '2\.0\.0': this runner reads version 1, a text such as 1.* \(update wamnet or",
        ),
        ({"version": 1.0}, r"version 1\.0: this runner reads version 1, a text such as 1"),
        ({"cases": [{"id": "a"}]}, "its cases must be as spec/vectors/schema.json says"),
        ({"cases": 3}, "its cases must be as spec/vectors/schema.json says"),
    ],
)
def test_other_files_are_refused(tmp_path, changes, text):
    with pytest.raises(InputError, match=text):
        case.load(written(tmp_path, **changes))


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 5000])
def test_what_is_no_vector_is_refused(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"acceptable JSON|its format must be"):
        case.load(path)


@pytest.mark.parametrize("name", ["../secret", "/dev/zero", "a/../../b", "a//b", "..", "", 3, None])
def test_vectors_name_files_of_their_own_folder(tmp_path, name):
    """RDG-4: untrusted vectors led the reference to any file, and to pipes."""
    text = (vectors.FOLDER / "image.window.json").read_text()
    data = json.loads(text)
    data["cases"][0]["input"]["image"] = {"file": name, "shape": [1]}
    (tmp_path / "a.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"plain name of a file in its own|are relative to its folder"):
        case.load(tmp_path / "a.json")


def test_a_link_out_of_the_folder_of_vectors_is_refused(tmp_path):
    (tmp_path / "secret").write_text("x")
    folder = tmp_path / "vectors"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path / "secret")
    with pytest.raises(InputError, match="must lie in the folder of vectors, also where it is a link"):
        case._placed({"file": "link"}, folder)
    (folder / "a").write_text("text")
    assert case.given(case._placed({"file": "a"}, folder)) == "text"


def test_a_folder_that_cannot_be_written_is_refused(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(vectors, "contents", lambda: {"a.json": b""})
    with pytest.raises(InputError, match=r"folder of vectors '.*': cannot be written"):
        vectors.write(tmp_path / "file")


def test_vectors_are_written_whole_and_through_no_link(tmp_path, monkeypatch):
    """What was there stays where another file cannot be written; a link is replaced, not followed."""
    monkeypatch.setattr(vectors, "contents", lambda: {"a.json": b"new", "images/b": b"new"})
    folder = tmp_path / "vectors"
    folder.mkdir()
    (tmp_path / "victim").write_bytes(b"old")
    (folder / "a.json").symlink_to(tmp_path / "victim")
    (folder / "images").symlink_to(tmp_path)
    with pytest.raises(InputError, match="cannot be written: images is a link"):
        vectors.write(folder)
    assert sorted(path.name for path in folder.iterdir()) == ["a.json", "images"]
    (folder / "images").unlink()
    (folder / "images").mkdir()
    (folder / "images/b").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        vectors.write(folder)
    (folder / "images/b").rmdir()
    assert vectors.write(folder) == 2
    assert (folder / "a.json").read_bytes() == (folder / "images/b").read_bytes() == b"new"
    assert (tmp_path / "victim").read_bytes() == b"old"

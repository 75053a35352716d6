"""What may happen to an untrusted file: damage of bytes, and changes that keep its form.

1. Bytes are flipped, cut, doubled, moved, or replaced by pieces that parsers have stumbled over [`of_bytes`].
2. A JSON text keeps its form while values, keys and lists change [`of_json`]; texts inside that are JSON
   themselves are changed in the same way.
3. A safetensors file keeps its header's length right while header and numbers change [`of_safetensors`].
4. A command line keeps its words, some of them with other values, in other places or twice [`of_words`].
5. A graph in ONNX's form is another one [`of_graph`].

All of it is a function of a `random.Random`: the same seed gives the same input.
"""

import json
import struct
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from random import Random
from typing import Any

TEXTS = (
    *("", "-", "--", "0", "-1", "1", "2", "3", "0.5", "-0.0", "1e-320", "1e30", "1e308", "1e400", "nan",
        "-inf"),
    *("inf", "2147483648", "4294967296", str(2**63), "9" * 30, "1" * 5000, "0x10", "1_0", "x", "y" * 5000),
    *("\x1b[2J", "\u202e", "\udcff", "\uff11", "..", ".", "pipe", "folder", "link", "missing/x", "x.exr",
        "x.png"),
    *("x.html", "1,2,3", "a=1", "=", "1=1,1,1", "1:2", "2:1", "nan:nan", "*", "%s", "{}", "[bold]", "é",
        "numpy"),
    *("c", "native", "window2", "rank1", "minicubes", "--help", "-h", "-o", "--seed", "--size", "--time"),
)  # fmt: skip
"""Words of a command line that programs have stumbled over; a byte that is not UTF-8 comes as a surrogate."""

VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2, 3, 0.5, -0.0, 1e-320, 1e-30, 1e30, 1e308, -1e308),
    *(float("nan"), float("inf"), float("-inf"), 2**31, 2**53 + 1, 2**63, -(2**63), 10**18, 10**400),
    *("", "x", "0", "nan", "1e999", "\x1b[2J", "\0", "\u202e", "\ud800", "\uffff", "../x", "/dev/zero",
        "color"),
    *([], {}, [[]], [0] * 3, [0.0] * 2000, "y" * 5000, [None] * 40),
)  # fmt: skip
"""Values that programs have taken for something else."""

PIECES = (
    *(b"[" * 3000, b"{" * 70, b"}", b"]", b",", b'"', b"\\", b"\\ud800", b"null", b"NaN", b"Infinity"),
    *(b"-", b"1" * 5000, b"1e999", b"1e-999", b"0.", b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80",
        b"\0" * 9),
    *(b"\x1b[2J", b"\xff" * 8, b"\x7f\xff\xff\xff", b"\x80\0\0\0", b"../", b"/dev/zero", b'{"a":0,"a":1}'),
)  # fmt: skip
"""Bytes that programs have stumbled over."""

FLOATS = (b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\x80\xff", b"\xff\xff\x7f\x7f", b"\1\0\0\0", b"\0\0\0\x80")
"""float32, little-endian: NaN, both infinities, the largest, a denormal number, -0."""


def of_bytes(random: Random, content: bytes) -> bytes:
    """Return content with one to four kinds of damage."""
    data = bytearray(content)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        at = random.randrange(len(data) + 1)
        to = min(len(data), at + random.choice((1, 1, 4, 16, 200)))
        way = random.randrange(6)
        if way == 0 and at < len(data):
            data[at] ^= 1 << random.randrange(8)
        elif way == 1:
            data[at:to] = b""
        elif way == 2:
            data[at:at] = data[at:to] * random.choice((1, 2, 50))
        elif way == 3:
            data[at:to] = random.choice(PIECES)
        elif way == 4:
            data[at:to] = random.randbytes(to - at)
        else:
            del data[at:]
    return bytes(data)


def of_json(random: Random, content: bytes) -> bytes:
    """Return a JSON text with values, keys or lists changed; of a text that is not JSON, damaged bytes."""
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        return of_bytes(random, content)
    for _ in range(random.choice((1, 1, 2, 5))):
        tree = _changed(random, tree)
    text = json.dumps(tree).encode()
    return of_bytes(random, text) if random.random() < 0.2 else text


def _changed(random: Random, tree: Any) -> Any:
    """Return a tree with a change at a random place, which is deep or not."""
    if isinstance(tree, dict) and tree and random.random() < 0.85:
        return _changed_object(random, tree)
    if isinstance(tree, list) and tree and random.random() < 0.85:
        items = list(tree)
        at = random.randrange(len(items))
        way = random.random()
        if way < 0.1:
            del items[at]
        elif way < 0.2:
            items.insert(at, random.choice(items))
        else:
            items[at] = _changed(random, items[at])
        return items
    if isinstance(tree, str) and tree[:1] in ("{", "["):
        return of_json(random, tree.encode()).decode(errors="replace")
    if (
        isinstance(tree, (int, float))
        and not isinstance(tree, bool)
        and abs(tree) < 1e30
        and random.random() < 0.3
    ):
        return tree * random.choice((-1, 2, 0.5, 10, 1e10))
    return random.choice(VALUES)


def _changed_object(random: Random, tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object without a key, with one more, with one renamed, or with another value."""
    items = dict(tree)
    key = random.choice(list(items))
    way = random.random()
    if way < 0.1:
        del items[key]
    elif way < 0.15:
        items[random.choice((key + "x", "", "\x1b[2J", "__class__"))] = random.choice(VALUES)
    elif way < 0.2:
        other, value = random.choice(list(items)), items.pop(key)
        items[other] = value
    else:
        items[key] = _changed(random, items[key])
    return items


def of_safetensors(random: Random, content: bytes) -> bytes:
    """Return a container whose header, or whose numbers, are changed; its length mostly stays right."""
    if random.random() < 0.2 or len(content) < 8:
        return of_bytes(random, content)
    (length,) = struct.unpack("<Q", content[:8])
    header, data = content[8 : 8 + length], bytearray(content[8 + length :])
    if random.random() < 0.7:
        header = of_json(random, header)
    else:
        for _ in range(random.choice((1, 1, 10))):
            at = 4 * random.randrange(max(1, len(data) // 4))
            data[at : at + 4] = random.choice((*FLOATS, random.randbytes(4)))
    return struct.pack("<Q", len(header)) + header + bytes(data)


def of_words(random: Random, content: bytes) -> bytes:
    """Return a command line, as a JSON list, with one to four words changed, left out, added or exchanged."""
    command, *words = json.loads(content)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        if not words:
            break
        at, other = (random.randrange(len(words)) for _ in range(2))
        if words[at].startswith("-") and at + 1 < len(words) and random.random() < 0.7:
            at += 1
        way = random.random()
        if way < 0.7:
            words[at] = _changed_word(random, words[at])
        elif way < 0.8:
            del words[at]
        elif way < 0.9:
            words.insert(at, random.choice((words[other], random.choice(TEXTS))))
        else:
            words[at], words[other] = words[other], words[at]
    return json.dumps([command, *words]).encode()


def _changed_word(random: Random, word: str) -> str:
    """Return another word, or this one with a part changed."""
    signs = [sign for sign in ",=:+" if sign in word]
    if signs and random.random() < 0.5:
        parts = word.split(random.choice(signs))
        parts[random.randrange(len(parts))] = random.choice(TEXTS)
        return random.choice(signs).join(parts)
    if word and random.random() < 0.2:
        at = random.randrange(len(word) + 1)
        return word[:at] + random.choice((*"-.:,=+/0\x01", "\udc80", "\n")) + word[at + random.randrange(2) :]
    return random.choice(TEXTS)


def of_graph(random: Random, _content: bytes) -> bytes:
    """Return a random graph in ONNX's form."""
    from graphs import graph

    return graph(random)


HAS_ONNX = all(map(find_spec, ("onnx", "onnxruntime")))
"""Whether graphs can be written and run."""

WAYS: Mapping[str, Callable[[Random, bytes], bytes]] = {
    "bytes": of_bytes,
    "json": of_json,
    "safetensors": of_safetensors,
    "words": of_words,
    **({"graph": of_graph} if HAS_ONNX else {}),
}
"""Ways by the form of a file."""

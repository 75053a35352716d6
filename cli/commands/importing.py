"""`wamnet import`: a network of another program becomes a model, which compiles as any other."""

import math
from pathlib import Path

from ...models.importing.network import Found, import_network
from ...models.model_file import save_model
from ...refimpl.errors import InputError
from ..common.inputs import check_input
from ..common.terminal import say
from ..files.outputs import check_output

SUFFIX = ".safetensors"
"""How the names of models end."""


def import_model(
    network: Path,
    output: Path | None = None,
    ranges: list[str] | None = None,
    border: str | None = None,
) -> None:
    """Import a small ONNX network as a model that compile, export and certify accept."""
    check_input(network)
    if network.suffix == SUFFIX:
        raise InputError("network", str(network), "holds weights, no graph", "use torch.onnx.export")
    path = output or Path(network.with_suffix(SUFFIX).name)
    check_output(path, (SUFFIX,), [network])
    given = dict(map(_range, ranges or []))
    if len(given) < len(ranges or []):
        raise InputError("--range", ", ".join(ranges or []), "each input once", "leave one out")
    found = import_network(network, given, border or "")
    save_model(path, found.model)
    say(str(path))
    for line in said_of(found):
        say(line)


def _range(text: str) -> tuple[str, tuple[float, float]]:
    """Return the input, "" for all others, and the range of [INPUT=]LOW:HIGH."""
    name, _, ends = text.rpartition("=")
    try:
        low, high = map(float, ends.split(":"))
    except ValueError:
        low = high = math.nan
    if not low < high or math.isinf(high - low):
        rule = "must be LOW:HIGH or INPUT=LOW:HIGH, two numbers in order"
        raise InputError("--range", text, rule, "give the range of the network's inputs, as in --range -1:1")
    return name, (low, high)


def said_of(found: Found) -> list[str]:
    """Return what a user must know of a network that was imported, as lines."""
    network, window = found.model.siren, found.model.window
    widths = " -> ".join(map(str, network.widths))
    lines = [f"layers {widths}; window {window.size} x {window.size}, border {window.border}"]
    lines += [
        f"image {each.name}: {each.channels} channels in [{each.low:g}, {each.high:g}], for which bounds hold"
        for each in getattr(network, "sources", ())
    ]
    lines += [
        f"image {name} is {dtype}: the network computes in {dtype}, the model in float32"
        for name, dtype in found.types.items()
        if dtype in ("float16", "float64")
    ]
    if found.moved:
        lines.append(
            f"the network pads or crops what it computes: {found.margin} pixels and more from the image's "
            "edge the model is the network, nearer to it the model is another function"
        )
    if found.rounded:
        lines.append(f"{found.rounded} weights are products of the network's, rounded to float32 once")
    return lines

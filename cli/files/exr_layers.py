"""Which channels of an OpenEXR file are which layer of a frame, by their names.

1. A channel is called `LAYER.COMPONENT`. Layers have several names, the best first [`ALIASES`], in upper or
   lower case and behind a prefix such as a view layer's; other channels are ignored.
2. A channel without a layer belongs to the layer that its part is named after, else to colour or depth.
3. Of several views (attribute `view` of parts, `multiView` for names) one is read: the first, or the one that
   is named. A part, or the first piece of the channels' names, may be named instead [`select`].
4. Where two things could be one layer (two parts, prefixes or spellings), neither is chosen.

Source: "Storing Multi-View Images in OpenEXR Files" of the OpenEXR documentation, for names with views.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from ...refimpl.errors import InputError
from ...refimpl.frame import DIRECT, HISTORY, LAYERS, SEEN, SEEN_DIRECT, SUN
from .exr_header import Part

_LETTERS = {
    **dict.fromkeys(
        ("albedo", "unshadowed", "seen_albedo", "seen_emission", "history", "direct", "seen_direct"), "RGB"
    ),
    **dict.fromkeys(("normal", "position", "direction", "seen_normal", "seen_position", "sun"), "XYZ"),
    "depth": "Z",
    "seen_depth": "Z",
    "history_weight": "V",
}
"""Letters of each layer's channels; those of the colour have no layer before them."""

CHANNELS: Mapping[str, tuple[str, ...]] = {
    "color": ("R", "G", "B"),
    **{layer: tuple(f"{layer}.{letter}" for letter in letters) for layer, letters in _LETTERS.items()},
}
"""The channels that hold each layer in the files that are written here."""

ALIASES: Mapping[str, tuple[str, ...]] = {
    "color": ("", "color", "rgb", "rgba", "beauty", "noisy image", "combined", "image"),
    "albedo": ("albedo", "denoising albedo", "diffuse_albedo", "diffusealbedo"),
    "normal": ("normal", "normals", "n", "denoising normal", "sh_normal"),
    "depth": ("depth", "z", "denoising depth", ""),
    "position": ("position", "p"),
    "direction": ("direction", "raydirection"),
    "unshadowed": ("unshadowed",),
    **{name: (name,) for name in (*SEEN, *HISTORY, SUN, DIRECT, SEEN_DIRECT)},
}
"""Names of each layer on reading, lower case, best first: as in Blender, pbrt, Mitsuba, Arnold and here.

Blender writes `Noisy Image` where its own denoiser has made `Combined`.
"""

COMPONENTS: Mapping[int, tuple[tuple[str, ...], ...]] = {
    3: (("r", "g", "b"), ("x", "y", "z")),
    1: (("z",), ("v",), ("y",), ("t",), ("depth",)),
}
"""Last parts of the channels' names of a layer of 3 or 1 channels, lower case, best first."""

OTHER_PART = "?"
"""Alias of the channels without a layer in a part of several whose name stands for no layer: taken if
there is nothing else."""

DENOISED = "wamnet"
"""Layer of a denoised image among another program's channels."""


class Plane(NamedTuple):
    """One channel: the index of its part, its name in the file, and the alias of its layer."""

    part: int
    name: str
    alias: str


Group = Mapping[str, Sequence[Plane]]
"""Channels of one layer by the lower-case last piece of their names."""


@dataclass(frozen=True)
class Selection:
    """The planes of each layer, which view they show, all views, and sentences on what was chosen."""

    layers: Mapping[str, Sequence[Plane]]
    view: str
    views: Sequence[str]
    notes: Sequence[str]

    def denoised_layer(self) -> str:
        """Return the name of a denoised image beside the colour: `View.wamnet` for `View.Combined.R`."""
        plane = self.layers["color"][0]
        pieces = plane.name.split(".")[:-1]
        at = next((at for at, piece in enumerate(pieces) if piece.lower() == plane.alias), None)
        if at is None:
            # A view is the last piece before the component.
            at = len(pieces) - (pieces[-1:] == [self.view])
            pieces.insert(at, DENOISED)
        pieces[at] = DENOISED
        return ".".join(pieces)


def select(path: Path, parts: Sequence[Part], chosen: str = "") -> Selection:
    """Return which channels of the file's parts are which layer; `chosen` names a view, part or prefix."""
    named = dict.fromkeys(part.text("view") for part in parts if part.text("view") and not part.deep)
    views = parts[0].texts("multiView") or list(named)
    view = chosen if chosen in views else next(iter(views), "")
    groups: dict[str, dict[tuple[int, str], dict[str, list[Plane]]]] = defaultdict(
        lambda: defaultdict(lambda: defaultdict(list))
    )
    for index, name, pieces in _chosen(parts, views, view, chosen):
        *prefix, component = pieces
        alias = prefix[-1].lower() if prefix else _part_alias(parts, index, views, chosen, name)
        groups[alias][index, ".".join(prefix)][component.lower()].append(Plane(index, name, alias))
    if chosen and not groups:
        names = sorted(name for part in parts for name in part.channels)
        prefixes = (name.split(".")[0] for name in names if "." in name)
        there = dict.fromkeys(name for name in (*views, *_names(parts), *prefixes) if name)
        rule = f"neither a view, a part nor the first piece of a channel's name; there are {', '.join(there)}"
        rule = rule if there else "the file has one view, without a name"
        raise InputError(f"{path}: view layer", chosen, rule, "leave it out, or name an existing one")
    layers = {name: planes for name in LAYERS if (planes := _layer(path, parts, name, groups))}
    taken = {name: [plane.name for plane in planes] for name, planes in layers.items()}
    notes = [
        f"{name} is taken from {_in_part(parts, layers[name][0].part, ', '.join(names))}"
        for name, names in taken.items()
        if len(parts) > 1 or (*names,) != CHANNELS[name]
    ]
    others = [f"{other!r}" for other in views if other != view]
    if others and layers:
        notes.append(f"view {view!r} is read, not {', '.join(others)} (the option --view-layer of denoise)")
    return Selection(layers, view, views, notes)


def unused(parts: Sequence[Part], selection: Selection) -> list[str]:
    """Return the channels that no layer of a selection is of."""
    taken = {plane[:2] for planes in selection.layers.values() for plane in planes}
    every = ((index, name) for index, part in enumerate(parts) for name in part.channels)
    return [_in_part(parts, index, name) for index, name in every if (index, name) not in taken]


def _chosen(
    parts: Sequence[Part], views: Sequence[str], view: str, chosen: str
) -> Iterator[tuple[int, str, list[str]]]:
    """Yield the part, the name, and its pieces without view and prefix, of the channels that are chosen."""
    by_part = chosen != "" and chosen in _names(parts) and chosen not in views
    prefix = f"{chosen}." if chosen and not by_part and chosen not in views else ""
    for index, part in enumerate(parts):
        if part.deep or (by_part and part.text("name") != chosen):
            continue
        for name in part.channels:
            of_name = next((piece for piece in name.split(".")[:-1] if piece in views), "")
            # A channel of no view belongs to the first.
            own = part.text("view") or of_name or next(iter(views), "")
            *pieces, component = name.removeprefix(prefix).split(".")
            if name.startswith(prefix) and (by_part or own == view):
                yield index, name, [*(piece for piece in pieces if piece != own), component]


def _names(parts: Sequence[Part]) -> list[str]:
    """Return the names of the parts that can be read."""
    return [part.text("name") for part in parts if not part.deep]


def _part_alias(parts: Sequence[Part], index: int, views: Sequence[str], chosen: str, channel: str) -> str:
    """Return the alias of a channel without a layer: its part's, or "" for colour and depth."""
    name = parts[index].text("name")
    last = next((piece.lower() for piece in reversed(name.split(".")) if piece not in views), "")
    if any(last in aliases for aliases in ALIASES.values()):
        # Depth may be in the part of the colour; X, Y, Z are a vector.
        vector = {f"{channel[:-1]}X", f"{channel[:-1]}x"} & parts[index].channels.keys()
        return "" if channel[-1:] in "Zz" and last in ALIASES["color"] and not vector else last
    return "" if chosen == name or len(_names(parts)) == 1 else OTHER_PART


def _layer(
    path: Path, parts: Sequence[Part], name: str, groups: Mapping[str, Mapping[tuple[int, str], Group]]
) -> Sequence[Plane]:
    """Return the planes of layer `name` under the best of its aliases; none if it is not in the file."""
    aliases = ALIASES[name]
    for alias in (*aliases, OTHER_PART) if "" in aliases else aliases:
        complete = {
            key: planes
            for key, group in groups.get(alias, {}).items()
            if (planes := _components(path, name, alias, group))
        }
        if len(complete) > 1:
            labels = [
                _in_part(parts, index, prefix or ", ".join(plane.name for plane in planes))
                for (index, prefix), planes in complete.items()
            ]
            rule = f"each of them could be {name}"
            way_out = "export one of them alone, or name a part or view layer with denoise --view-layer"
            raise InputError(f"{path}: layers", ", ".join(sorted(labels)), rule, way_out)
        if complete:
            return next(iter(complete.values()))
    return ()


def _components(path: Path, name: str, alias: str, group: Group) -> Sequence[Plane]:
    """Return the channels that make up a layer, in order; none if one is missing.

    Colour is R, G, B. Without a layer's name depth is Z: a lone Y is luminance, X, Y, Z are a vector.
    """
    choices = COMPONENTS[LAYERS[name].channels]
    if name == "color" or alias in ("", OTHER_PART):
        choices = choices[:1] if name == "color" or "x" not in group else ()
    complete = [[group[one] for one in choice] for choice in choices if all(one in group for one in choice)]
    planes = [plane for choice in complete for same in choice for plane in same]
    if len(planes) > LAYERS[name].channels:
        names = ", ".join(plane.name for plane in planes)
        raise InputError(f"{path}: channels", names, f"{name} has duplicates", "leave out or rename some")
    return planes


def _in_part(parts: Sequence[Part], index: int, what: str) -> str:
    """Return the name of something with its part, if there are several."""
    part = parts[index].text("name") or str(index)
    return f"{what} of part {part!r}" if len(parts) > 1 else what

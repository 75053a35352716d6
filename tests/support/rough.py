"""Layers of a rough frame for tests of the edge-avoiding filter."""

import numpy as np


def rough_layers(height, width, seed=1):
    """Return layers (H, W, C) in float32: a third of the pixels are misses, some light is above the clip."""
    random = np.random.default_rng(seed)
    spreads = {"normal": 0.4, "albedo": 0.15, "position": 0.4}
    layers = {name: random.normal(0, spread, (height, width, 3)) for name, spread in spreads.items()}
    layers["depth"] = random.uniform(2.0, 5.0, (height, width, 1))
    bright = random.choice([1e-3, 0.1, 1.0, 300.0], (height, width, 1))
    layers["color"] = random.exponential(1.0, (height, width, 3)) * bright
    missed = random.uniform(size=(height, width)) < 1 / 3
    for name in ("normal", "albedo", "position", "depth"):
        layers[name][missed] = 0.0
    return {name: values.astype(np.float32) for name, values in layers.items()}

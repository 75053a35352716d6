"""The sums over a tile's windows as the FFT schedules compute them, in NumPy."""

import numpy as np

from wamnet.compiler.proof import spectra
from wamnet.compiler.schedules.fourier import block_of, spectrum, transform


def both_ways(image, sign):
    """Return the transform (N, N) of an image (N, N) along rows, then along columns."""
    real, imaginary = image
    for _ in range(2):  # along the second axis, which then becomes the first
        columns = transform(list(zip(real.T, imaginary.T, strict=True)), sign)
        real, imaginary = (np.stack([number[part] for number in columns]) for part in (0, 1))
    return real, imaginary


def unpack(z):
    """Return twice the spectra (N, N) of p and of q from that of p + i q."""
    (a, b), (c, d) = z, (_mirrored(part) for part in z)
    return (a + c, b - d), (b + d, c - a)


def _mirrored(image):
    """Return the spectrum at -f."""
    return np.roll(image[::-1, ::-1], 1, axis=(0, 1))


def sums(tile, matrix, size):
    """Return W x (out, out, D_out) for the windows of a tile (N, N, C), in the tile's arithmetic."""
    points, dtype = len(tile), tile.dtype
    weights = spectrum(matrix, size, points)
    tile = np.concatenate([tile, np.zeros((points, points, tile.shape[2] % 2), dtype)], axis=2)
    half = tile.shape[2] // 2
    pairs = [unpack(both_ways((tile[..., j], tile[..., j + half]), -1)) for j in range(half)]
    channels = [first for first, _ in pairs] + [second for _, second in pairs]
    neurons = []
    nothing = np.zeros((points, points), dtype)
    for n in range(len(matrix)):
        whole = nothing, nothing
        for block in spectra.blocks_of(weights.shape[3], block_of(half)):
            real = imaginary = nothing
            for channel in block:
                (a, b), w = channels[channel], weights[n, :, :, channel]
                g, h = w.real.astype(dtype), w.imag.astype(dtype)
                real, imaginary = real + a * g - b * h, imaginary + a * h + b * g
            whole = whole[0] + real, whole[1] + imaginary
        neurons.append(whole)
    out, found = points - size + 1, np.zeros((points, points, 2 * len(matrix)), dtype)
    gap = -(-len(matrix) // 2)
    neurons += [(np.zeros_like(neurons[0][0]),) * 2] * gap
    for n in range(gap):
        (a, b), (c, d) = neurons[n], neurons[n + gap]
        found[..., n], found[..., n + gap] = both_ways((a - d, b + c), 1)
    return found[:out, :out, : len(matrix)]

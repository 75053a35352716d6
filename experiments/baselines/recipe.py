"""What a baseline is trained by; it is read without PyTorch."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Recipe:
    """All choices of a baseline's training; `steps` is the largest number, `every` those between two looks.

    `crop` and `batch`: what a step sees; `shrink` averages squares of so many pixels first; `tiles` takes
    crops from a grid, else from anywhere; `half`: see [`fitting.HALF`]. `features`: what the network is
    given.
    """

    method: str
    steps: int
    batch: int
    crop: int
    learning_rate: float
    features: tuple[str, ...] = ("color",)
    shrink: int = 1
    tiles: bool = False
    half: bool = False
    width: int = 64
    seed: int = 0
    every: int = 100

"""DnCNN: a convolutional network that predicts the noise of a picture, as the paper trained it.

1. `depth` layers of 3x3 convolutions with 64 channels: the first with ReLU, the middle ones with batch
   normalisation and ReLU, the last with neither [`network`]. It maps a noisy picture y to its noise R(y).
2. The loss is 1/(2N) sum over the N pictures of ||R(y) - (y - x)||^2, x the clean one [`residual_loss`].
3. The clean picture is y - R(y) [`DnCNN.picture`].

Sources: Zhang, Zuo, Chen, Meng, Zhang, "Beyond a Gaussian Denoiser: Residual Learning of Deep CNN for Image
Denoising", IEEE Transactions on Image Processing 26(7), 2017 (sections III.A and III.B, equation 1); *WAMnet
for Image Denoising*, section 4.4, for the depth of 16 and for the loss, its equation 2.

Decisions: the paper does not say more. Colour is display-encoded. Weights begin as in He et al. 2015, as
Zhang et al. have it; Adam follows the gradient, at a rate that falls to a tenth where progress ends. The
paper's pictures were resized from 1024x1024 to 256x256; [`recipe.Recipe.shrink`] does that by means of
squares of pixels.
"""

import numpy as np
import torch
from torch import nn

from wamnet.refimpl.frame import Floats, Frame

from .fitting import follow, planes
from .recipe import Recipe

CHANNELS = 64
"""Channels of the layers inside (Zhang et al. 2017, section III.B)."""

DEPTH = 16
"""Convolutions; Zhang et al. have 17 or 20, the paper 16."""


def network(depth: int = DEPTH, channels: int = CHANNELS) -> nn.Sequential:
    """Return the network from (N, 3, H, W) to the noise (N, 3, H, W)."""
    layers: list[nn.Module] = [nn.Conv2d(3, channels, 3, padding=1), nn.ReLU()]
    for _ in range(depth - 2):
        # A bias would be taken away again by the normalisation.
        layers += [nn.Conv2d(channels, channels, 3, padding=1, bias=False), nn.BatchNorm2d(channels)]
        layers += [nn.ReLU()]
    layers += [nn.Conv2d(channels, 3, 3, padding=1)]
    for layer in layers:
        if isinstance(layer, nn.Conv2d):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)
    return nn.Sequential(*layers)


def residual_loss(residual: torch.Tensor, noisy: torch.Tensor, clean: torch.Tensor) -> torch.Tensor:
    """Return 1/(2N) sum ||R(y) - (y - x)||^2 of pictures (N, 3, H, W)."""
    return ((residual - (noisy - clean)) ** 2).sum() / (2 * len(noisy))


class DnCNN:
    """The network, its optimiser, and a step of its training."""

    def __init__(self, recipe: Recipe, depth: int = DEPTH) -> None:
        """Make the network with the random weights of the recipe's seed."""
        with torch.random.fork_rng():
            torch.manual_seed(recipe.seed)
            # Channels last in memory: a third faster on processors, the same function.
            self.network = network(depth, recipe.width).to(memory_format=torch.channels_last)
        self.recipe = recipe
        self.networks = {"dncnn": self.network}
        self.optimizers = {"adam": torch.optim.Adam(self.network.parameters(), recipe.learning_rate)}

    def step(
        self, noisy: torch.Tensor, clean: torch.Tensor, generator: torch.Generator, share: float
    ) -> float:
        """Follow the gradient of the loss of some crops; nothing is random here."""
        self.network.train()
        loss = residual_loss(self.network(noisy).float(), noisy, clean)
        follow(self.optimizers["adam"], loss, share * self.recipe.learning_rate)
        return loss.item()

    def denoised(self, noisy: torch.Tensor) -> torch.Tensor:
        """Return what is left of pictures (N, 3, H, W) without their noise."""
        self.network.eval()
        return (noisy - self.network(noisy)).clamp(0.0, 1.0)

    @torch.no_grad()
    def picture(self, frame: Frame) -> Floats:
        """Return the denoised, display-encoded picture (H, W, 3) of a frame."""
        clean = self.denoised(planes(frame, self.recipe.features))
        return np.moveaxis(clean[0].numpy(), 0, -1)

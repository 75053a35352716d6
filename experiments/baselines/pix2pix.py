"""pix2pix: a conditional adversarial network on patches, as the paper trained it.

1. The generator G is a U-Net of six levels [`Generator`]: strided convolutions down to 1/64 of a patch's
   side, and up again, each level joined to the one that it mirrors. It is given the noisy patch x and
   Gaussian noise z.
2. The discriminator D is a PatchGAN of three convolutions [`discriminator`]: it judges, for each place of a
   patch, whether the pair of noisy and clean patch is real.
3. L_D = 1/2 (L(D(x, y), 1) + L(D(x, G(x, z)), 0)) for D, and L(D(x, G(x, z)), 1) + 100 |G(x, z) - y| for G, L
   being the mean squared error [`discriminator_loss`, `generator_loss`].
4. A picture is denoised patch by patch, and the patches are put together [`Pix2pix.picture`].

Sources: Isola, Zhu, Zhou, Efros, "Image-to-Image Translation with Conditional Adversarial Networks", CVPR
2017 (sections 3.1 to 3.3, 6.1); Mao et al., "Least Squares Generative Adversarial Networks", ICCV 2017, for
squared errors as L; *WAMnet for Image Denoising*, section 4.3, for the six levels, the noise, the three
layers, patches of 128x128 and the weights.

Decisions. The paper prints L_L1 = 1/N sum ||D(G(x, z)) - target_real||, a distance of judgements, and says in
the text that squared errors and a reconstruction loss (L1) stand as 1 : 100: L1 is taken as that of Isola et
al., between the picture and the clean one. Its L_G = L(D(G(x, z)), y) is taken as L(D(x, G(x, z)), real).
Noise is one more channel of the input (Isola et al. use dropout). "As light as possible": 32 channels in the
first level, at most 256. Normalisation is by the statistics of each patch (Isola et al.: batch size 1, also
when tested). The noisy colours and the normals are the condition x: the paper's data have both.
"""

import numpy as np
import torch
from torch import nn

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Floats, Frame

from .fitting import follow, generator_of, planes
from .recipe import Recipe

LEVELS = 6
"""Times that the generator halves a patch's side."""

LARGEST = 8
"""Most channels inside, in those of the first level."""

LAMBDA = 100.0
"""Weight of L1 (Isola et al. 2017, section 6.1; the paper's 1 : 100)."""

SLOPE = 0.2
"""Slope of the leaky ReLU for negative numbers (Isola et al. 2017, section 6.1)."""

BETAS = (0.5, 0.999)
"""Adam's decays (Isola et al. 2017, section 3.3)."""

DRAWN_FOR_PICTURES = 0xFFFFFFFF
"""The `step` whose noise a picture's patches get: none of training has it."""


def widths(width: int) -> list[int]:
    """Return the channels of the generator's levels."""
    return [width * min(2**level, LARGEST) for level in range(LEVELS)]


class Generator(nn.Module):
    """The U-Net from (N, channels + 1, H, W) to (N, 3, H, W) in [0, 1]; sides are multiples of 64."""

    def __init__(self, channels: int, width: int) -> None:
        """Make the levels."""
        super().__init__()
        down = widths(width)
        before = [channels + 1, *down[:-1]]
        self.down = nn.ModuleList(
            nn.Conv2d(n_in, n_out, 4, stride=2, padding=1) for n_in, n_out in zip(before, down, strict=True)
        )
        # The lowest level is not joined to anything; every other one to its mirror.
        inner = [down[-1], *(2 * n for n in reversed(down[:-1]))]
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(n_in, n_out, 4, stride=2, padding=1)
            for n_in, n_out in zip(inner, [*reversed(down[:-1]), 3], strict=True)
        )

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the picture."""
        kept: list[torch.Tensor] = []
        for level, layer in enumerate(self.down):
            x = layer(x if level == 0 else nn.functional.leaky_relu(x, SLOPE))
            # Neither the first nor the lowest level is normalised (Isola et al. 2017, section 6.1).
            if 0 < level < LEVELS - 1:
                x = nn.functional.instance_norm(x)
            kept.append(x)
        for level, layer in enumerate(self.up):
            x = layer(nn.functional.relu(x))
            if level < LEVELS - 1:
                x = torch.cat([nn.functional.instance_norm(x), kept[LEVELS - 2 - level]], dim=1)
        return 0.5 + 0.5 * torch.tanh(x)


def discriminator(channels: int, width: int) -> nn.Sequential:
    """Return the PatchGAN from noisy and clean patches (N, channels + 3, H, W) to judgements (N, 1, h, w)."""
    return nn.Sequential(
        nn.Conv2d(channels + 3, width, 4, stride=2, padding=1),
        nn.LeakyReLU(SLOPE),
        nn.Conv2d(width, 2 * width, 4, stride=2, padding=1),
        nn.InstanceNorm2d(2 * width),
        nn.LeakyReLU(SLOPE),
        nn.Conv2d(2 * width, 1, 4, padding=1),
    )


def squared(judgement: torch.Tensor, target: float) -> torch.Tensor:
    """Return the mean squared distance of judgements to what they should be."""
    return ((judgement - target) ** 2).mean()


def discriminator_loss(real: torch.Tensor, fake: torch.Tensor) -> torch.Tensor:
    """Return L_D of the judgements of real and of made pairs."""
    return 0.5 * (squared(real, 1.0) + squared(fake, 0.0))


def generator_loss(fake: torch.Tensor, made: torch.Tensor, clean: torch.Tensor) -> torch.Tensor:
    """Return the generator's loss: to be taken for real, plus 100 times the mean absolute difference."""
    return squared(fake, 1.0) + LAMBDA * (made - clean).abs().mean()


class Pix2pix:
    """Both networks, their optimisers, and a step of their training."""

    def __init__(self, recipe: Recipe) -> None:
        """Make the networks with the random weights of the recipe's seed: normal, of deviation 0.02."""
        if recipe.crop % 2**LEVELS:
            rule = f"{LEVELS} levels halve it: a multiple of {2**LEVELS}"
            raise InputError("side of pix2pix's patches", recipe.crop, rule, "the paper's is 128")
        self.recipe = recipe
        channels = 3 * len(recipe.features)
        with torch.random.fork_rng():
            torch.manual_seed(recipe.seed)
            self.generator = Generator(channels, recipe.width)
            self.discriminator = discriminator(channels, recipe.width)
            for layer in (*self.generator.modules(), *self.discriminator.modules()):
                if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d):
                    nn.init.normal_(layer.weight, 0.0, 0.02)
                    nn.init.zeros_(layer.bias)
        self.networks = {"generator": self.generator, "discriminator": self.discriminator}
        self.optimizers = {
            name: torch.optim.Adam(net.parameters(), recipe.learning_rate, BETAS)
            for name, net in self.networks.items()
        }

    def make(self, noisy: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        """Return clean patches for noisy ones (N, C, H, W) and noise of the generator."""
        shape = (len(noisy), 1, *noisy.shape[2:])
        made: torch.Tensor = self.generator(torch.cat([noisy, torch.randn(shape, generator=generator)], 1))
        return made.float()

    def step(
        self, noisy: torch.Tensor, clean: torch.Tensor, generator: torch.Generator, share: float
    ) -> float:
        """Let the discriminator learn, then the generator; return the generator's loss."""
        rate = share * self.recipe.learning_rate
        made = self.make(noisy, generator)
        real, fake = (torch.cat([noisy, image], dim=1) for image in (clean, made))
        judged = discriminator_loss(
            self.discriminator(real).float(), self.discriminator(fake.detach()).float()
        )
        follow(self.optimizers["discriminator"], judged, rate)
        loss = generator_loss(self.discriminator(fake).float(), made, clean)
        follow(self.optimizers["generator"], loss, rate)
        return loss.item()

    def denoised(self, noisy: torch.Tensor) -> torch.Tensor:
        """Return the pictures (N, 3, H, W) of feature images whose sides are multiples of a patch's."""
        size = self.recipe.crop
        made = torch.zeros(len(noisy), 3, *noisy.shape[2:])
        noise = generator_of(self.recipe.seed, DRAWN_FOR_PICTURES)
        for y in range(0, noisy.shape[2], size):
            for x in range(0, noisy.shape[3], size):
                rows, columns = slice(y, y + size), slice(x, x + size)
                made[:, :, rows, columns] = self.make(noisy[:, :, rows, columns], noise)
        return made

    @torch.no_grad()
    def picture(self, frame: Frame) -> Floats:
        """Return the denoised, display-encoded picture (H, W, 3) of a frame, patch by patch.

        A picture whose side is not a multiple of the patch's is continued by its last pixels.
        """
        height, width, size = frame.height, frame.width, self.recipe.crop
        margins = (0, -width % size, 0, -height % size)
        padded = nn.functional.pad(planes(frame, self.recipe.features), margins, mode="replicate")
        made = self.denoised(padded)[0, :, :height, :width]
        return np.moveaxis(made.numpy(), 0, -1)

"""Profiles: what a kernel's arithmetic promises, and so which bound on its error can be computed.

1. Rounding: the relative error of each class of operations that targets may make [`RELATIVE_ERROR`].
2. Sine: an absolute error on a domain, or no promise [`SineContract`]. Profile `ieee` emits its own sine;
   `native` calls the target's, whose promise is in the target's dialect [`Language.sine`].
3. The passes that turn the program which bounds see into the one that is emitted [`Profile`].
4. Profile `ieee` has its sine in other degrees too, under names of their own: a trade of speed for error
   [`Profile.with_degree`].

Sources: OpenCL C 1.2 specification, section 7.4 (divide 2.5 ulp, sqrt 3 ulp, sin 4 ulp, exp2 and log2 3 ulp,
full profile); GLSL 4.60 specification, section 4.7.1 (+ - * correctly rounded, a / b 2.5 ulp for 2**-126 <=
|b| <= 2**126, sqrt as 1.0 / inversesqrt(): 2 ulp and 2.5 ulp, pow as exp2 and log2). GLSL 3.30 states
nothing; the later text describes the same hardware and is assumed. GLSL leaves the rounding mode open:
rounding to nearest is assumed too. OpenCL says it of each device, and the executor asks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from ...refimpl.errors import CompileError, choice
from . import sine
from .ops import Rounding

UNIT_ROUNDOFF = 2.0**-24
"""u: the largest relative error of rounding to nearest in float32."""

FLUSH = 2.0**-126
"""The smallest normal float32: a target may read or write anything smaller as zero."""

RELATIVE_ERROR: Mapping[Rounding, float] = {
    "exact": 0.0,
    "nearest": UNIT_ROUNDOFF,
    "divide": 2.5 * 2 * UNIT_ROUNDOFF,
    "sqrt": 5.0 * 2 * UNIT_ROUNDOFF,
}
"""Largest relative error by class, over all targets; an ulp is at most 2 u |result|."""

LOG2_RELATIVE = 3.0 * 2 * UNIT_ROUNDOFF
"""Relative error of log2: 3 ulp; GLSL promises that only outside [1/2, 2]."""

LOG2_ABSOLUTE = 2.0**-21
"""Absolute error of GLSL's log2 inside [1/2, 2]."""

EXP2_ULPS = (3.0, 2.0)
"""Error of exp2(x): 3 + 2 |x| ulp in GLSL, whose pow(x, y) is as good as exp2(y log2(x)); OpenCL's 3 ulp."""

EXP_ULPS = (3.0, 2.0)
"""Error of exp(x): 3 + 2 |x| ulp in GLSL, 3 ulp in OpenCL."""

LARGEST_DIVISOR = 2.0**126
"""Largest |b| for which GLSL bounds the error of a / b."""


@dataclass(frozen=True)
class SineContract:
    """|computed - sin(x)| <= error for |x| <= domain; `error` None: no promise. `text` names the source."""

    text: str
    error: float | None
    domain: float = math.inf


@dataclass(frozen=True)
class Profile:
    """A promise: `sine` None means the target's own, `passes` run after bounds are computed."""

    name: str
    text: str
    sine: SineContract | None
    passes: tuple[str, ...]

    @property
    def facts(self) -> dict[str, str]:
        """Return what manifests and headers say about it."""
        return {"name": self.name, "text": self.text}

    def with_degree(self, degree: int) -> Profile:
        """Return it with an emitted sine of this degree: what it costs and how far it is off differ."""
        if degree == sine.DEGREE:
            return self
        passes = tuple(f"{name}_{degree}" if name == EXPAND_SINE else name for name in self.passes)
        name = f"{self.name}{DEGREE_WORD}{degree}"
        return replace(self, name=name, sine=emitted_sine(degree), passes=passes)


def emitted_sine(degree: int = sine.DEGREE) -> SineContract:
    """Return what a sine of compiler/core/sine.py promises."""
    text = f"emitted, odd polynomial of degree {degree}"
    return SineContract(text, sine.POLYNOMIALS[degree].error, sine.DOMAIN)


def emitted_cosine(degree: int = sine.DEGREE) -> SineContract:
    """Return what a cosine of sine.py promises; denoisers have none, a sine's derivative does."""
    return replace(
        emitted_sine(degree), error=sine.POLYNOMIALS[degree].cosine_error, domain=sine.COSINE_DOMAIN
    )


EMITTED_SINE = emitted_sine()
"""The sine of the degree in use."""

EMITTED_COSINE = emitted_cosine()
"""The cosine of the degree in use."""

OPENCL_SINE = SineContract(
    "sin() of OpenCL 1.2, 4 ulp on all arguments (full profile)", 4 * 2 * UNIT_ROUNDOFF
)
"""The only sine of a standard that is good enough for a proof: for its dialect and the checker."""

CUDA_SINE = SineContract("sinf() of CUDA, 2 ulp on all arguments", 2 * 2 * UNIT_ROUNDOFF)
"""The sine that CUDA's manual promises: for its dialect and the checker."""

EXPAND_SINE = "expand_sine"
"""The pass that emits the sine of the degree in use; that of another degree has its number behind it."""

DEGREE_WORD = "-sine"
"""What joins a profile's name and the degree of its sine, where that is not the one in use."""

PROFILES: Mapping[str, Profile] = {
    profile.name: profile
    for profile in (
        Profile(
            "ieee",
            "any order of summation, fused multiply-add allowed, emitted sine",
            EMITTED_SINE,
            (EXPAND_SINE, "fold", "eliminate_dead"),
        ),
        Profile(
            "native", "any order of summation, fused multiply-add allowed, the target's own sine", None, ()
        ),
    )
}
"""All profiles, by name."""

IEEE = PROFILES["ieee"]
"""The profile of kernels for which none is named."""


REMOVED = "exact"
"""A profile of earlier releases: naming it is an error that names its replacement, for one release."""


def profile_named(name: str) -> Profile:
    """Return the profile, or say which ones there are; `ieee-sine7` is `ieee` with a sine of degree 7."""
    if name in PROFILES:
        return PROFILES[name]
    if name == REMOVED:
        raise CompileError(
            f"profile {name} was removed; use an integer network, variant whole8 (--variant whole8), which "
            "is bit-identical on every device and compiler"
        )
    base, _, degree = name.partition(DEGREE_WORD)
    if base in PROFILES and PROFILES[base].sine and degree in map(str, sine.POLYNOMIALS):
        return PROFILES[base].with_degree(int(degree))
    others = [
        f"{profile.name}{DEGREE_WORD}{degree}"
        for profile in PROFILES.values()
        for degree in sine.POLYNOMIALS
        if profile.sine and degree != sine.DEGREE
    ]
    raise CompileError(f"profile {name!r}: unknown ({choice(name, [*PROFILES, *others])})")

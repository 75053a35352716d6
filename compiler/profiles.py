"""Profiles: what a kernel's arithmetic promises, and so which bound on its error can be computed.

1. Rounding: the relative error of each class of operations that targets may make [`RELATIVE_ERROR`].
2. Sine: an absolute error on a domain, or no promise [`SineContract`]. Profile `ieee` emits its own sine;
   `native` calls the target's, whose promise stands in the target's dialect [`sine_contract`].
3. The passes that bounds see after the common ones, and those that turn the program into the one that is
   emitted [`Profile`].

Sources: OpenCL C 1.2 specification, section 7.4 (divide 2.5 ulp, sqrt 3 ulp, sin 4 ulp, exp2 and log2 3 ulp,
full profile); GLSL 4.60 specification, section 4.7.1 (+ - * correctly rounded, a / b 2.5 ulp for 2**-126 <=
|b| <= 2**126, sqrt as 1.0 / inversesqrt(): 2 ulp and 2.5 ulp, pow as exp2 and log2). GLSL 3.30 states
nothing; the later text describes the same hardware and is assumed. GLSL leaves the rounding mode open:
rounding to nearest is assumed too. OpenCL says it of each device, and the executor asks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..refimpl.errors import CompileError
from . import sine
from .ir import LEAST
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
"""Relative error of log2: 3 ulp; GLSL promises that outside [1/2, 2] alone."""

LOG2_ABSOLUTE = 2.0**-21
"""Absolute error of GLSL's log2 inside [1/2, 2]."""

EXP2_ULPS = (3.0, 2.0)
"""Error of exp2(x): 3 + 2 |x| ulp in GLSL, whose pow(x, y) is as good as exp2(y log2(x)); OpenCL's 3 ulp."""

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
    """A promise: `sine` None means the target's own, `passes` run after bounds are computed.

    `common` run before that, after the passes that all profiles share.
    """

    name: str
    text: str
    sine: SineContract | None
    passes: tuple[str, ...]
    common: tuple[str, ...] = ()


EMITTED_SINE = SineContract(
    f"emitted, odd polynomial of degree {sine.DEGREE}", sine.POLYNOMIALS[sine.DEGREE].error, sine.DOMAIN
)
"""The sine of compiler/sine.py."""

EMITTED_COSINE = SineContract(
    f"emitted, odd polynomial of degree {sine.DEGREE}", sine.COSINE_ERROR, sine.COSINE_DOMAIN
)
"""The cosine of compiler/sine.py; denoisers have none, the derivative of a sine does."""

EXACT_SINE = SineContract(
    f"{EMITTED_SINE.text}, 0 where the reduced argument is below {LEAST:g}",
    sine.POLYNOMIALS[sine.DEGREE].error + LEAST,
    sine.DOMAIN,
)
"""The sine of compiler/sine.py in which no number is denormal."""

PROFILES: Mapping[str, Profile] = {
    profile.name: profile
    for profile in (
        Profile(
            "ieee",
            "any order of summation, fused multiply-add allowed, emitted sine",
            EMITTED_SINE,
            ("expand_sine", "fold", "eliminate_dead"),
        ),
        Profile(
            "exact",
            "the same bits on every target: one order of summation, every operation rounded, emitted sine",
            EXACT_SINE,
            ("expand_sine", "fold", "eliminate_dead"),
            ("pin",),
        ),
        Profile(
            "native", "any order of summation, fused multiply-add allowed, the target's own sine", None, ()
        ),
    )
}
"""All profiles, by name."""


def unpinned(name: str, what: str) -> Profile:
    """Return the profile of programs that no pass pins, or refuse `exact`."""
    found = profile_named(name)
    if found.common:
        raise CompileError(
            f"{what} divide and take roots, which targets round differently: profile {name} holds denoisers; "
            "use profile ieee"
        )
    return found


def profile_named(name: str) -> Profile:
    """Return the profile, or say which ones there are."""
    if name not in PROFILES:
        raise CompileError(f"profile {name!r} does not exist; there are: {', '.join(PROFILES)}")
    return PROFILES[name]

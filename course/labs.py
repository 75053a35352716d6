"""The labs: their order, names and graders, and the files that a student gets.

1. A lab is one file of the student, `lab03_sampling.py`, one skeleton of the same name and one grader
   [`LABS`]. Extras come after the twelve.
2. Whoever means a lab may write `3`, `lab3`, `lab03`, `sampling` or the file's name [`lab_named`].
3. A skeleton is the only text of a lab that is installed: right answers are in the tests.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from wamnet.refimpl.errors import InputError

from .frame import Check

SKELETONS = Path(__file__).parent / "skeletons"
"""The folder of what students begin with."""


class Lab(NamedTuple):
    """A lab: the stem of its file, its title, the clauses to read, and how long it takes in minutes."""

    name: str
    title: str
    clauses: str
    minutes: int

    @property
    def short(self) -> str:
        """Return the name without its number."""
        return self.name.partition("_")[2]

    @property
    def target(self) -> str:
        """Return the name of the Makefile's target: lab3, or extra1."""
        return re.sub(r"lab0?(\d+)", r"lab\1", self.name.partition("_")[0])

    @property
    def file(self) -> str:
        """Return the name of the student's file."""
        return f"{self.name}.py"

    @property
    def skeleton(self) -> str:
        """Return the text that a student begins with."""
        return (SKELETONS / self.file).read_text(encoding="utf-8")

    @property
    def checks(self) -> Sequence[Check]:
        """Return the grader's checks in their order."""
        module = importlib.import_module(f".graders.{self.short}", __package__)
        checks: Sequence[Check] = module.CHECKS
        return checks


LABS = (
    Lab("lab01_sphere", "A ray and a sphere", "ISC-6, ISC-2", 60),
    Lab("lab02_camera", "A camera", "CAM-1, CAM-2", 45),
    Lab("lab03_sampling", "Random numbers and a sampler", "RNG-1, RNG-2, RNG-5, SMP-2", 60),
    Lab("lab04_light", "Light", "LAM-1, SMP-2, LTR-5", 75),
    Lab("lab05_picture", "A picture and its variance", "RND-1, RND-4, RND-5, MET-3", 75),
    Lab("lab06_window", "Windows and features", "DAT-1, DAT-3, DAT-4, DAT-5, DAT-6, DAT-9", 45),
    Lab("lab07_network", "A network and its gradient", "SIR-1, SIR-2, SIR-7", 90),
    Lab("lab08_adam", "Adam and training", "ADM-1, TRN-4", 60),
    Lab("lab09_tracer", "An intermediate representation and a tracer", "IR-1, IR-2, IR-3, IR-5, IR-6", 120),
    Lab("lab10_emitter", "A schedule and a language", "IR-3, KER-24, KER-25, KER-26", 120),
    Lab("lab11_bound", "A bound and a certificate", "PRO-6, CER-2, CER-3", 120),
    Lab("lab12_integers", "Integers, the same bits", "WHO-3, WHO-4, WHO-5", 75),
    Lab("extra1_sine", "A sine for kernels", "SIN-1, SIN-3, SIN-4", 90),
    Lab("extra2_rewrite", "A pass of the compiler", "IR-1, IR-2, IR-8", 60),
    Lab("extra3_suite", "Faults, and who is blamed", "CNF-3, CNF-11, CNF-13", 60),
)
"""All labs in the order of the course, then the extras."""


def lab_named(word: str) -> Lab:
    """Return the lab that a word means; InputError lists the known ones."""
    asked = word.strip().lower().removesuffix(".py")
    for lab in LABS:
        number = lab.target.removeprefix("lab")
        if asked in (lab.name, lab.short, lab.target, lab.name.partition("_")[0], number):
            return lab
    known = ", ".join(lab.target for lab in LABS)
    raise InputError("lab", word, "there is none of this name", f"known are {known}, and all")

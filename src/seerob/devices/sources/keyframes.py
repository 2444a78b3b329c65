"""A hand-made animation of a person: postures at instants, as `humans.keyframes` reads them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from seerob.core.errors import InputError
from seerob.core.samples import JointSample
from seerob.core.snapshot import Finding
from seerob.description.humans import keyframes
from seerob.description.humans.keyframes import Sampled
from seerob.workstation.source import Opened, Source, Target

MAX_RATE = 1000.0


@dataclass(frozen=True, eq=False)
class _Samples:
    """Can be iterated again and again."""

    sampled: Sampled
    source: str
    target: str

    def __len__(self) -> int:
        return len(self.sampled.t)

    def __iter__(self) -> Iterator[JointSample]:
        rows = zip(self.sampled.t.tolist(), self.sampled.q.tolist(), self.sampled.qd.tolist(), strict=True)
        for seq, (t, q, qd) in enumerate(rows):
            yield JointSample(source=self.source, target=self.target, seq=seq, t=t, q=tuple(q), qd=tuple(qd))


class Keyframes(Source, frozen=True, kw_only=True):
    """A person moved by a file of postures."""

    human: str
    """The person it drives."""
    file: str
    """Path, from the folder of the workstation file; or ``library:reach``, ``library:walk`` …"""
    rate: float = 60.0
    """Samples per second."""

    def target(self) -> str:
        """The person."""
        return self.human

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the file and check its postures against the person's limits.

        Raises:
            InputError: The file is missing or wrong, or what it drives is no person.
        """
        if target is None or target.description is None:
            raise InputError.at(self.file, "human", f"no person {self.human!r}", "name one of [[humans]]")
        if not 1.0 <= self.rate <= MAX_RATE:
            raise InputError.at(self.file, "rate", f"{self.rate:g} 1/s", f"give 1…{MAX_RATE:g} per second")
        played = keyframes.read(self.file, target.description, folder=folder)
        sampled = keyframes.sample(played, target.description, self.rate)
        text = f"motion {played.title or self.file}: {played.note or 'made by hand, not captured'}"
        return Opened(
            samples=_Samples(sampled, self.name or f"keyframes {self.human}", target.name),
            duration=float(sampled.t[-1]),
            findings=(Finding(level="assumed", subject=target.name, text=text),),
        )

"""What a source of one's own yields from a file or a formula, looked at sample by sample.

A live source is looked at by who listens to it, and the shipped readers look at their files; whoever writes a
source of their own looks at nothing. So here: what is no sample or has the wrong shape ends the run with the
name of the source; time that goes back, values where no joint can be, and velocities that positions do not
follow are the sample's ``reason``, and what rests on it is UNDECIDED.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from numbers import Real
from typing import get_args

from msgspec.structs import replace

from seerob.core.errors import InputError, SeerobError
from seerob.core.samples import JointSample, Quality, Sample, SignalSample, key
from seerob.devices.live.contradictions import Contradictions
from seerob.devices.live.device_clock import HOLD
from seerob.files.trajectories.trajectory import TrajectorySamples
from seerob.workstation.source import Opened, Target

BEYOND = 0.1
"""A controller may let a joint go so much farther than its description says [rad or m]."""


def looked_at(opened: Opened, name: str, target: Target | None) -> Opened:
    """Wrap what a source opened, so that each of its samples is looked at.

    Raises:
        InputError: It is not what a source returns.
    """
    if not isinstance(opened, Opened):
        what = f"open returns {type(opened).__name__}"
        raise InputError.at(name, "open", what, "return a seerob.workstation.source.Opened")
    if not 0 <= opened.duration < math.inf:
        what = f"the duration is {opened.duration} s"
        raise InputError.at(name, "open", what, "give the time from the first to the last sample")
    if isinstance(opened.samples, TrajectorySamples):
        return opened  # a motion as a whole was looked at when it was made
    return replace(opened, samples=LookedAt(opened.samples, name, target))


class LookedAt:
    """Samples of a recorded source, each with what is wrong with it.

    Args:
        samples: In time order; iterating again starts again.
        name: Of the source, for messages.
        target: What it drives.
    """

    def __init__(self, samples: Iterable[Sample], name: str, target: Target | None) -> None:
        self._samples, self._name, self._target = samples, name, target

    def __iter__(self) -> Iterator[Sample]:
        """Yield each sample once the next one is known, which says whether its time can be.

        Raises:
            InputError: What is yielded is no sample of what it drives, or the source fails.
        """
        looks: dict[tuple[str, ...], Contradictions] = {}
        told: dict[tuple[str, ...], tuple[str, float]] = {}
        until: dict[tuple[str, ...], float] = {}
        pending: Sample | None = None
        for sample in self._all():
            about = key(sample)
            newest = until.get(about, -math.inf)
            # What a machine says of several variables may be of one instant.
            again = isinstance(sample, SignalSample) and sample.t == newest
            if not (again or newest < sample.t < math.inf):
                # Who lies is not known, the sample whose time is ahead or the one whose time goes back,
                # nor of which instants the source speaks from then on.
                told[about] = f"time goes from {newest:.3f} to {sample.t:.3f} s", math.inf
                if pending is not None and key(pending) == about:
                    pending = _doubted(pending, self._name, told[about][0])
                continue
            look = looks.setdefault(about, Contradictions(self._target, live=False))
            stamped = sample if sample.t_device is not None else replace(sample, t_device=sample.t)
            reason, holds = told.get(about, ("", -math.inf))
            if (found := look.find(stamped)) and holds < math.inf:
                reason, holds = told[about] = found, sample.t + HOLD
            reason = self._beyond(sample) or (reason if sample.t <= holds else "")
            if pending is not None:
                yield pending
            pending = _doubted(sample, self._name, reason) if reason else sample
            until[about] = sample.t
        if pending is not None:
            yield pending

    def _all(self) -> Iterator[Sample]:
        t = -math.inf
        try:
            for sample in self._samples:
                self._check(sample)
                t = sample.t
                yield sample
        except (SeerobError, OSError):
            raise
        except Exception as error:
            when = f"after its sample of {t:.3f} s" if math.isfinite(t) else "before its first sample"
            what = f"it fails {when}: {type(error).__name__}: {error}"
            raise InputError.at(self._name, "samples", what, "mend the source") from error

    def _check(self, sample: Sample) -> None:
        if not isinstance(sample, get_args(Sample)):
            what = f"it yields {type(sample).__name__}"
            raise InputError.at(self._name, "samples", what, "yield samples of seerob.core.samples")
        if not isinstance(sample.t, Real) or not isinstance(sample.quality, Quality):
            what = f"t is {sample.t!r}, quality {sample.quality!r}"
            raise InputError.at(self._name, "samples", what, "give seconds as a number, and a seerob Quality")
        for what in ("q", "qd", "tau") if isinstance(sample, JointSample) else ():
            values = getattr(sample, what)
            if values is None and what != "q":
                continue
            if not isinstance(values, tuple) or not all(isinstance(x, Real) for x in values):
                text = f"{what} is {values!r}"
                raise InputError.at(self._name, "samples", text, "give a tuple of numbers, one per joint")

    def _beyond(self, sample: Sample) -> str:
        """Which joint is where it cannot be."""
        target = self._target
        if not isinstance(sample, JointSample) or target is None or sample.target != target.name:
            return ""
        for name, q, low, high in zip(target.joints, sample.q, target.lower, target.upper, strict=False):
            if not low - BEYOND <= q <= high + BEYOND:
                return f"{name} is said to be at {q:.4g}, its limits are {low:.4g} and {high:.4g}"
        return ""


def _doubted(sample: Sample, name: str, reason: str) -> Sample:
    quality = Quality.DEGRADED if sample.quality is Quality.GOOD else sample.quality
    return replace(sample, quality=quality, reason=sample.reason or f"{name}: {reason}")

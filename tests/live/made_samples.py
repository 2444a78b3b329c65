"""Samples of a device, and what the last of them contradicts: ``from made_samples import …``."""

from __future__ import annotations

from seerob.core.samples import BodyPoint, BodySample, JointSample, PoseSample
from seerob.devices.live.contradictions import Contradictions

BEGIN = 100.0
"""Of the device's clock [s]."""


def said(t, q, qd=None, device=True):
    at = BEGIN + t
    return JointSample(source="", seq=0, target="arm", t=at, t_device=at if device else None, q=q, qd=qd)


def last(samples, target=None):
    looking = Contradictions(target)
    return [looking.find(sample) for sample in samples][-1]


def pose(t, position=(0.0, 0.0, 0.0), wxyz=(1.0, 0.0, 0.0, 0.0)):
    return PoseSample(source="", seq=0, target="cart", t=t, t_device=t, position=position, wxyz=wxyz)


def body(t, places):
    points = tuple(
        BodyPoint(name=name, bone="hip", position=None if x is None else (x, 0.0, 0.0))
        for name, x in places.items()
    )
    return BodySample(source="", seq=0, target="op", t=t, t_device=t, points=points)

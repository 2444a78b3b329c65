"""A person of the workstation file: percentiles, lengths and masses by hand, what is said of them."""

from __future__ import annotations

import math

import pytest

from seerob.core.errors import InputError
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.model.mounting.overrides import SLIPS, describe, size
from seerob.workstation.workstation import Human

CHAIN = ("ankle_height", "shank", "thigh", "pelvis", "lumbar", "thorax", "neck", "head")


def human(**more: object) -> Human:
    return Human(**{"name": "p", "stature": 1.7, "mass": 80.0, "sex": "male", **more})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("key", "sex", "wanted", "said"),
    [
        ("germany P5", "male", 1.650, "quoted from memory"),
        ("germany P95", "female", 1.720, "DIN 33402-2"),
        ("japan P50", "female", 1.530, "read in a publication"),
        (1.7, "male", 1.7, None),
    ],
)
def test_a_percentile_is_the_published_stature_and_says_how_sure_it_is(key, sex, wanted, said):
    description, findings = describe(human(stature=key, sex=sex), touches=False)
    assert size(human(stature=key, sex=sex)).stature == pytest.approx(wanted, abs=1e-12)
    assert all(f.level == "assumed" and said in f.text for f in findings)
    assert bool(findings) == (said is not None)
    assert f"{wanted:g} m" in description.source


@pytest.mark.parametrize("wrong", ["P50", "germany P51", "atlantis P50", "germany", "germany P999999999", ""])
def test_what_is_no_percentile_says_what_would_be(wrong):
    with pytest.raises(InputError, match='"germany P50"'):
        describe(human(stature=wrong), touches=False)


@pytest.mark.parametrize("lengths", ["drillis", "deleva", {"forearm": 0.24, "thigh": 0.43}])
@pytest.mark.parametrize("masses", ["deleva", "zatsiorsky", {"thigh": 9.5, "left_hand": 0.6}])
@pytest.mark.parametrize("stature", ["germany P5", "us P50", "british_19_65 P95"])
def test_the_chain_closes_and_the_bones_weigh_the_body_mass(lengths, masses, stature):
    given = human(stature=stature, lengths=lengths, masses=masses)
    description, _ = describe(given, touches=False)
    body = size(given)
    bones = [link for link in description.links if link.name in BONES]
    assert math.fsum(link.inertial.mass for link in bones) == pytest.approx(80.0, abs=1e-9)
    assert math.fsum(body.length[k] for k in CHAIN) == pytest.approx(body.stature, abs=1e-9)
    # From the sole to the vertex through the bones themselves, in the anatomical position.
    _, p = bone_poses(description, [0.0] * 53)
    head = p[BONES.index("head")]
    assert head[2] + body.length["head"] == pytest.approx(body.stature, abs=1e-9)


def test_task_space_with_contacts_is_warned_of():
    assert SLIPS in [f.text for f in describe(human(follow="task"), touches=True)[1]]
    assert not describe(human(follow="task"), touches=False)[1]
    assert not describe(human(), touches=True)[1]

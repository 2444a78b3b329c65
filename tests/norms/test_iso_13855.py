"""Distances of ISO 13855 at both sides of every figure at which a rule changes, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.core.errors import InputError, Undecided
from seerob.criteria.stopping.terms import assumed_speed
from seerob.description.norms.iso_13855 import (
    Approach,
    Edition,
    intrusion,
    least_distance,
    minimum_distance,
)
from seerob.kernels.separation import approach_speeds

ACROSS, ALONG = Approach.ORTHOGONAL, Approach.PARALLEL
OLD, NEW = Edition.E2010, Edition.E2024
NONE = {"over": 0.0, "under": 0.0}


@pytest.mark.parametrize(
    ("T", "S", "K"),
    [
        (0.0, 0.1, 2.0),
        (0.05, 0.1, 2.0),
        (0.0625, 0.125, 2.0),
        (0.25, 0.5, 2.0),
        # 2 m/s leads beyond 0.5 m: 1.6 m/s, but not less than 0.5 m.
        (0.26, 0.5, 1.6),
        (0.3125, 0.5, 1.6),
        (0.5, 0.8, 1.6),
    ],
)
def test_hands_move_at_two_metres_per_second_up_to_half_a_metre(T, S, K):
    """A field of 14 mm lets nothing intrude: C = 0."""
    found = minimum_distance(ACROSS, OLD, T, capability=0.014, **NONE)
    assert (found.distance, found.speed) == (pytest.approx(S), K)
    assert found.intrusion.value == 0
    # The supplement of 2024 adds to it, and to what is compared with half a metre.
    more = minimum_distance(ACROSS, NEW, T, capability=0.014, supplement=0.01, **NONE)
    by_hand = max(2 * T + 0.01, 0.1)
    expected = by_hand if by_hand <= 0.5 else max(1.6 * T + 0.01, 0.5)
    assert more.distance == pytest.approx(expected)


@pytest.mark.parametrize("edition", Edition)
@pytest.mark.parametrize(("d", "fine"), [(0.0141, True), (0.03, True), (0.04, True), (0.0401, False)])
def test_the_field_across_adds_eight_times_what_it_resolves_or_an_arm(edition, d, fine):
    found = intrusion(ACROSS, edition, capability=d, **NONE)
    assert found.value == pytest.approx(8 * (d - 0.014) if fine else 0.85)
    least = minimum_distance(ACROSS, edition, 0.1, capability=d, supplement=0.0, **NONE)
    assert least.distance == pytest.approx(
        found.value + (0.2 if found.value <= 0.3 else 0.16) if fine else 1.01
    )
    assert f"ISO 13855:{edition} across" in found.source
    assert ("(2S" in found.source) is (edition is OLD)


def test_nobody_walks_at_two_metres_per_second_through_a_coarse_field_or_along_one():
    for approach, more in ((ACROSS, {}), (ACROSS, {"capability": 0.05}), (ALONG, {"capability": 0.03})):
        found = minimum_distance(approach, OLD, 0.25, **more, **NONE)
        assert (found.distance, found.speed) == (pytest.approx(found.intrusion.value + 0.4), 1.6)


@pytest.mark.parametrize(
    ("H", "C"), [(None, 1.2), (0.0, 1.2), (0.2, 1.12), (0.5, 1.0), (0.875, 0.85), (0.9, 0.85), (1.0, 0.85)]
)
def test_a_field_along_the_floor_gains_with_its_height_in_2010_only(H, C):
    for edition, value in ((OLD, C), (NEW, 1.2)):
        assert intrusion(ALONG, edition, capability=0.05, height=H).value == pytest.approx(value)
        assert intrusion(ALONG, edition, height=H).value == 1.2


@pytest.mark.parametrize(("d", "H"), [(0.06, 0.15), (0.07, 0.3), (0.1, 0.75), (0.05 + 1 / 15, 1.0)])
def test_a_coarse_field_along_the_floor_must_be_high(d, H):
    assert intrusion(ALONG, OLD, capability=d, height=H).value == pytest.approx(max(1.2 - 0.4 * H, 0.85))
    with pytest.raises(InputError, match="too low"):
        intrusion(ALONG, OLD, capability=d, height=H - 1e-9)
    with pytest.raises(Undecided, match="height is not given"):
        intrusion(ALONG, OLD, capability=d)
    with pytest.raises(InputError, match="too coarse"):
        intrusion(ALONG, OLD, capability=0.05 + 1 / 15 + 1e-9, height=1.0)
    assert intrusion(ALONG, OLD, capability=0.05).value == 1.2


@pytest.mark.parametrize(
    ("approach", "edition", "more", "ways"),
    [
        (ACROSS, OLD, {}, ("reaching over the field",)),
        (ACROSS, NEW, {}, ("reaching over the field", "reaching under the field")),
        (ALONG, OLD, {}, ("crawling under the field",)),
        (ALONG, NEW, {"height": 0.2}, ()),
        (ALONG, OLD, {"height": 0.2}, ()),
        (ALONG, OLD, {"height": 0.2001}, ("crawling under the field",)),
    ],
)
def test_ways_around_the_field_are_asked_for_and_the_largest_counts(approach, edition, more, ways):
    found = intrusion(approach, edition, **more)
    assert found.uncovered == ways
    if ways:
        with pytest.raises(Undecided, match=ways[-1]):
            minimum_distance(approach, edition, 0.1, supplement=0.0, **more)
    for given, largest in (
        (0.0, found.value),
        (found.value, found.value),
        (2.0, 2.0 if ways else found.value),
    ):
        around = {"over" if "over" in way else "under": given for way in ways}
        again = intrusion(approach, edition, **more, **around)
        assert (again.value, again.uncovered) == (largest, ())
        assert ("2 m" in again.source) is (largest == 2.0)


def test_one_way_around_counts_while_the_other_is_not_known():
    found = intrusion(ACROSS, NEW, capability=0.03, over=0.5)
    assert (found.value, found.uncovered) == (0.5, ("reaching under the field",))


def test_a_distance_that_depends_on_the_speed_has_the_same_edges():
    ways = np.array([0.1, 0.25, 0.26, 0.3125, 0.32])
    assert least_distance(lambda K: K * ways) == pytest.approx([0.2, 0.5, 0.5, 0.5, 0.512])
    for given, seen, speeds in ((None, 0.0, [2.0, 1.6]), (None, 1.8, [2.0, 1.8]), (0.5, 0.4, [0.5, 0.5])):
        found = np.empty(2)
        approach_speeds(np.array([0.49, 0.5]), assumed_speed(given), seen, found)
        assert found.tolist() == speeds


@pytest.mark.parametrize("d", [0.0, -0.01, np.inf, np.nan])
def test_what_is_no_capability_is_refused(d):
    for approach in (ACROSS, ALONG):
        with pytest.raises(InputError, match="no detection capability"):
            intrusion(approach, OLD, capability=d)


def test_without_a_supplement_2024_is_undecided_and_2010_needs_none():
    assert minimum_distance(Approach.TWO_HAND, OLD, 0.5).distance == pytest.approx(0.25 + 0.8)
    with pytest.raises(Undecided, match="Z is not given"):
        minimum_distance(ACROSS, NEW, 0.1, capability=0.03, **NONE)


@pytest.mark.parametrize("edition", Edition)
def test_beyond_70_mm_across_the_field_no_figure_is_known(edition):
    assert intrusion(ACROSS, edition, capability=0.07).value == 0.85
    with pytest.raises(Undecided, match="coarser than"):
        intrusion(ACROSS, edition, capability=0.0701)

"""The long form of `tests/human/test_places.py`: whatever is dropped of a capture, nothing becomes within."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "human"))

from test_places import dropped


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(2, 400))
def test_dropping_any_bones_from_any_frames_never_makes_anything_within(seed):
    dropped(seed)

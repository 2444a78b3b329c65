"""``kill -9`` at any moment while ``seerob run`` records: the file opens, less than a second is lost."""

import random

import pytest

from soak.cut_short import run_and_kill, workstation


@pytest.mark.parametrize(
    "kills", [pytest.param(1, id="short"), pytest.param(50, id="long", marks=pytest.mark.soak)]
)
def test_a_killed_run_loses_less_than_a_second(tmp_path, kills):
    moments = random.Random(9)
    cell = workstation(tmp_path / "cell")
    lost = [run_and_kill(cell, tmp_path / f"run{k}", moments.uniform(0.0, 2.5)) for k in range(kills)]
    assert max(lost) < 1.0

"""S_p against its integrals on as many random robots and motions as are asked for.

``SEEROB_SOAK_CELLS`` says of how many.
"""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "stopping"))
import test_s_p_against_its_integral as asked

SEEDS = range(10, 10 + int(os.environ.get("SEEROB_SOAK_CELLS", "1000")))


@pytest.mark.soak
@pytest.mark.parametrize("kind", asked.KINDS)
def test_motions_that_are_known_ahead(tmp_path, kind):
    for seed in SEEDS:
        for name, found in asked.room(tmp_path / f"{seed}", seed, kind).items():
            assert min(found, default=0.0) >= -1e-9, (seed, name)


@pytest.mark.soak
def test_joint_tables_and_robots_that_are_heard_live(tmp_path):
    for seed in SEEDS:
        asked.test_s_p_by_a_joint_table_is_no_less_than_what_its_joints_need(tmp_path / f"a{seed}", seed)
        asked.test_s_p_of_a_robot_that_is_heard_live_is_no_less_than_its_integral(tmp_path / f"b{seed}", seed)

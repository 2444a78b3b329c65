"""The long form of ``test_reading_anything.py``: any table is a workstation or a list of mistakes."""

import pytest
from hypothesis import HealthCheck, given, settings

from test_reading_anything import ANY_TABLE, outcome


@pytest.mark.soak
@settings(max_examples=5_000, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(ANY_TABLE)
def test_any_of_thousands_of_tables_is_a_workstation_or_a_list_of_mistakes(table):
    outcome(table)

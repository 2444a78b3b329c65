"""Any table, any change of the starter and any damage to it is a workstation or a list of mistakes."""

from __future__ import annotations

import contextlib
import copy
import tomllib
from datetime import date
from importlib import resources

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from seerob.core.errors import InputError
from seerob.session.reading import convert_workstation, read
from seerob.workstation.workstation import TABLES, Workstation

STARTER = (resources.files("seerob.app.commands") / "starter" / "workstation.toml").read_text()
FIELDS = sorted(
    {f for kind in TABLES.values() for f in kind.__struct_fields__} | {"position", "rpy", "kind", "stop"}
)
KEYS = st.sampled_from([*FIELDS, *(f + s for f in FIELDS for s in ("_mm", "_deg", "_g")), "", "x.y", "é"])
LEAVES = st.one_of(
    st.none().map(lambda _: date(2020, 1, 1)),
    st.booleans(),
    st.integers(-(10**30), 10**30),
    st.just(10**500),
    st.floats(),
    st.sampled_from(["ur10", "library:ur10", "velocity", "csv", "a/b", "ur10/tool0", "*", "[", "", "male"]),
    st.text(max_size=5),
)
VALUES = st.recursive(
    LEAVES, lambda v: st.lists(v, max_size=4) | st.dictionaries(KEYS, v, max_size=4), max_leaves=8
)
GROUPS = [*Workstation.__struct_fields__, "more"]
ANY_TABLE = st.dictionaries(
    st.sampled_from(GROUPS), VALUES | st.lists(st.dictionaries(KEYS, VALUES, max_size=5)), max_size=4
)


def outcome(table):
    station, problems = convert_workstation(table, "w.toml")
    assert (isinstance(station, Workstation) and not problems) or (station is None and problems)
    return str(problems)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(ANY_TABLE)
def test_any_table_is_a_workstation_or_a_list_of_mistakes(table):
    outcome(table)


def places(value, path=()):
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield (*path, key)
            yield from places(value[key], (*path, key))


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_one_thing_changed_in_the_starter_is_read_or_refused(data):
    table = copy.deepcopy(tomllib.loads(STARTER))
    *path, last = data.draw(st.sampled_from(list(places(table))))
    inner = table
    for key in path:
        inner = inner[key]
    inner[last] = data.draw(VALUES)
    outcome(table)


@settings(max_examples=80, deadline=None)
@given(st.integers(0, len(STARTER.encode()) - 1), st.binary(max_size=3))
def test_a_damaged_file_is_read_or_refused(tmp_path_factory, at, put):
    raw = STARTER.encode()
    file = tmp_path_factory.getbasetemp() / "workstation.toml"
    file.write_bytes(raw[:at] + put + raw[at + 1 :])
    with contextlib.suppress(InputError):
        assert isinstance(read(file), Workstation)

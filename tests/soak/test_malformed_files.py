"""Any file may be given to a reader: it is read, or refused with what is wrong, and nothing else happens."""

import pytest

from soak.hammering import hammer, hammer_in_processes
from soak.made_files import KINDS

FEW, MANY = 60, 100_000


@pytest.mark.parametrize("kind", KINDS)
def test_a_small_file_of_each_kind_is_read_as_it_is(tmp_path, kind):
    path = tmp_path / f"f.{KINDS[kind].suffix}"
    KINDS[kind].make(path)
    KINDS[kind].read(path)


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_read_or_refused(kind):
    few = FEW // 4 if kind.endswith("xlsx") else FEW
    counts = hammer(kind, 0, few)
    assert counts["read"] > 0
    assert counts["refused"] > few // 4


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_a_hundred_thousand_broken_files_are_read_or_refused(capsys, kind):
    def tell(text):
        with capsys.disabled():
            print(f"\r{text}", end="", flush=True)

    counts = hammer_in_processes(kind, MANY, tell)
    tell(f"{kind}: {counts['read']} read, {counts['refused']} refused of {MANY}\n")
    assert sum(counts.values()) == MANY
    assert counts["read"] > 0
    assert counts["refused"] > MANY // 4

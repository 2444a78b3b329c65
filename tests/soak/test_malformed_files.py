"""Any file may be given to a reader: it is read, or refused with what is wrong, and nothing else happens."""

import pytest

from soak.hammering import hammer, hammer_in_processes, in_this_process
from soak.made_cells import KINDS

FEW, MANY = 200, 100_000
IN_THEIR_PROCESS = 10
"""Of the files whose parser has a process of its own, so many are read there; the others are read here."""


@pytest.mark.parametrize("kind", KINDS)
def test_a_small_file_of_each_kind_is_read_as_it_is(tmp_path, kind):
    path = tmp_path / f"f.{KINDS[kind].suffix}"
    KINDS[kind].make(path)
    KINDS[kind].read(path)


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_read_or_refused(kind):
    hammer(kind, 1, IN_THEIR_PROCESS)
    with in_this_process():
        counts = hammer(kind, 0, FEW - IN_THEIR_PROCESS)
    assert counts["read"] > 0
    assert counts["refused"] > FEW // 8


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

"""The mailbox between processes: newest wins, nothing is torn, nothing is lost of the last."""

from __future__ import annotations

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.core.errors import SeerobError
from seerob.core.samples import (
    BodyPoint,
    BodySample,
    JointSample,
    Mailbox,
    PoseSample,
    Quality,
    SignalSample,
    key,
)
from seerob.devices.live import source_process
from seerob.devices.live.source_process import SharedMailbox, memory


@pytest.fixture(name="ends", params=["memory", "file"])
def made(request, monkeypatch):
    if request.param == "file":

        def forbidden(name):
            raise PermissionError

        monkeypatch.setattr(os, "memfd_create", forbidden, raising=False)
    file = memory()
    ends = SharedMailbox(file), SharedMailbox(file)
    os.close(file)
    return ends


numbers = st.floats(allow_nan=False)
names = st.text(max_size=8)
head = {"source": names, "seq": st.integers(0, 2**53), "t": numbers, "t_device": st.none() | numbers,
        "quality": st.sampled_from(Quality)}  # fmt: skip
rows = st.lists(numbers, max_size=9).map(tuple)
three, four = st.tuples(*[numbers] * 3), st.tuples(*[numbers] * 4)
points = st.builds(
    BodyPoint, name=names, bone=names, at=three, position=st.none() | three, wxyz=st.none() | four,
    position_weight=numbers, orientation_weight=numbers, confidence=st.none() | numbers,
)  # fmt: skip
samples = st.one_of(
    st.builds(JointSample, **head, target=names, q=rows, qd=st.none() | rows, tau=st.none() | rows),
    st.builds(PoseSample, **head, target=names, position=three, wxyz=four),
    st.builds(
        BodySample, **head, target=names, points=st.lists(points, max_size=4).map(tuple), subject=names,
        latency=numbers, hold=numbers, smoothing=numbers,
    ),
    st.builds(
        SignalSample, **head, values=st.dictionaries(names, numbers | st.booleans() | names, max_size=5),
        doubts=st.dictionaries(names, names, max_size=3),
    ),
)  # fmt: skip


@given(st.lists(st.lists(samples, max_size=6), max_size=4))
def test_it_is_the_mailbox_of_one_process(batches):
    """Each kind's newest, whole and equal, whatever it is and however often it is emptied."""
    file = memory()
    here, there, one = SharedMailbox(file), SharedMailbox(file), Mailbox()
    os.close(file)
    for batch in batches:
        for sample in batch:
            assert here.waits(key(sample)) is one.waits(key(sample))
            here.post(sample)
            one.post(sample)
            assert [box.waits(key(sample)) for box in (here, one)] == [True, True]
        found, expected = there.take(), one.take()
        assert sorted(map(repr, found)) == sorted(map(repr, expected))


def test_numbers_of_numpy_and_those_that_are_none_come_as_they_are(ends):
    here, there = ends
    values = {"a": np.float64(1.5), "b": np.bool_(True), "c": np.int64(3), "d": math.nan, "e": -math.inf}
    here.post(SignalSample(source="s", seq=0, t=0.0, values=values))
    (found,) = there.take()
    assert [type(x) for x in found.values.values()] == [float, bool, float, float, float]
    assert (found.values["a"], found.values["b"], found.values["c"]) == (1.5, True, 3.0)
    assert math.isnan(found.values["d"])
    assert found.values["e"] == -math.inf


def test_what_has_no_room_is_refused_and_the_rest_stays(ends, monkeypatch):
    here, there = ends
    small = JointSample(source="s", seq=0, t=0.0, target="0", q=(0.0,))
    here.post(small)
    with pytest.raises(SeerobError, match=r"a sample of \d+ bytes; the most is 131072"):
        here.post(SignalSample(source="s", seq=1, t=0.0, values={"text": "x" * source_process.LARGEST}))
    for k in range(1, source_process.SLOTS):
        here.post(JointSample(source="s", seq=k, t=0.0, target=str(k), q=(0.0,)))
    with pytest.raises(SeerobError, match="more than 256 different things"):
        here.post(JointSample(source="s", seq=999, t=0.0, target="one more", q=(0.0,)))
    here.post(JointSample(source="s", seq=1000, t=0.0, target="255", q=(0.0,)))
    assert [s.seq for s in there.take()] == [*range(255), 1000]


def test_what_is_no_sample_is_a_mistake_of_who_says_it(ends):
    here, there = ends
    for odd in ({"odd": {1}}, {"odd": None}, {"odd": object()}, {"odd": np.zeros(3)}):
        with pytest.raises(TypeError, match=r"no SignalSample: Expected|a (object|ndarray) in a sample"):
            here.post(SignalSample(source="s", seq=0, t=0.0, values=odd))
    assert there.take() == ()


WRITER = """
import sys
from seerob.devices.live.source_process import SharedMailbox
from seerob.core.samples import SignalSample
box = SharedMailbox(int(sys.argv[1]))
for k in range(int(sys.argv[2])):
    box.post(SignalSample(source="s", seq=k, t=0.0, values={str(i): float(k) for i in range(k % 200)}))
"""


def test_nothing_is_torn_while_another_process_writes_as_fast_as_it_can():
    file, count = memory(), 20_000
    box = SharedMailbox(file)
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(file), str(count)], pass_fds=(file,))
    os.close(file)
    last, heard = -1, 0
    with writer:
        while writer.poll() is None or last < count - 1:
            for sample in box.take():
                assert sample.seq > last
                last, heard = sample.seq, heard + 1
                assert sample.values == {str(i): float(last) for i in range(last % 200)}
            assert writer.returncode in (None, 0)
    assert heard > 10


def test_what_is_being_written_is_read_the_next_time(ends):
    """A half whose number or checksum is not the slot's is never taken."""
    here, there = ends
    here.post(JointSample(source="s", seq=0, t=0.0, target="a", q=(0.0,)))
    here.post(JointSample(source="s", seq=1, t=0.0, target="a", q=(0.0,)))
    start = source_process._HEAD
    half = start + source_process._HEAD
    for place in (half, half + 8, half + 12, half + 16):  # number, length, checksum, the sample itself
        kept = here._memory[place]
        here._memory[place] = kept ^ 0xFF
        assert there.take() == ()
        here._memory[place] = kept
    assert [s.seq for s in there.take()] == [1]


def test_a_sample_is_not_taken_for_an_older_one_that_it_overwrites(ends):
    """Its number was read before, and all else after it was written: it would be taken twice."""
    here, there = ends
    for seq in range(3):
        here.post(JointSample(source="s", seq=seq, t=0.0, target="a", q=(0.0,)))
    start, newest = source_process._HEAD, 3
    places = start, start + source_process._HEAD + source_process._ROOM
    for number in (1, 0):
        for place in places:
            source_process._COUNT.pack_into(here._memory, place, number)
        assert there.take() == ()
    for place in places:
        source_process._COUNT.pack_into(here._memory, place, newest)
    assert [s.seq for s in there.take()] == [2]
    assert there.take() == ()

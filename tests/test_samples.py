"""The latest wins; nothing queues."""

from __future__ import annotations

from threading import Thread

import msgspec
import pytest

from seerob.core.samples import JointSample, Mailbox, PoseSample, Quality, Sample, SignalSample, key


def joints(target, seq, source="s"):
    return JointSample(source=source, target=target, seq=seq, t=float(seq), q=(0.0,))


def pose(target, seq):
    return PoseSample(source="s", target=target, seq=seq, t=0.0, position=(0, 0, 0), wxyz=(1, 0, 0, 0))


def test_only_the_newest_of_each_target_is_kept_in_order_of_first_posting():
    box = Mailbox()
    for sample in (joints("a", 0), joints("b", 0), pose("a", 0), joints("a", 1), joints("a", 2, "other")):
        box.post(sample)
    assert [(s.target, s.seq) for s in box.take()] == [("a", 2), ("b", 0), ("a", 0)]
    assert box.take() == ()


def test_signals_replace_those_of_their_own_source_only():
    box = Mailbox()
    for source, value in (("plc", 1.0), ("scanner", 2.0), ("plc", 3.0)):
        box.post(SignalSample(source=source, seq=0, t=0.0, values={"x": value}))
    assert [s.values["x"] for s in box.take()] == [3.0, 2.0]


@pytest.mark.parametrize(
    "sample",
    [
        JointSample(
            source="s", target="r", seq=1, t=0.5, q=(1.0, 2.0), qd=(0.0, 0.1), tau=(3.0, 4.0), t_device=9.0
        ),
        PoseSample(
            source="s",
            target="r",
            seq=1,
            t=0.5,
            position=(1, 2, 3),
            wxyz=(1, 0, 0, 0),
            quality=Quality.INVALID,
        ),
        SignalSample(source="s", seq=1, t=0.5, values={"lamp": True, "speed": 0.5, "mode": "auto"}),
    ],
)
def test_a_sample_survives_the_wire_with_its_type(sample):
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(sample), type=Sample) == sample


def test_threads_never_lose_the_newest_nor_see_one_twice():
    """Four writers, one reader: per target what is taken only ever rises, and ends with the last."""
    box, last, n = Mailbox(), {}, 2000
    threads = [Thread(target=lambda k=k: [box.post(joints(f"r{k}", i)) for i in range(n)]) for k in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads) or len(last) < 4 or min(last.values()) < n - 1:
        for sample in box.take():
            assert sample.seq > last.get(sample.target, -1)
            last[sample.target] = sample.seq
    for thread in threads:
        thread.join()
    assert last == {f"r{k}": n - 1 for k in range(4)}
    assert key(joints("a", 0)) != key(pose("a", 0))


def test_whose_fault_a_doubt_is():
    assert [quality.invalid_reason("plc") for quality in Quality] == [
        "",
        "plc says degraded",
        "plc says invalid",
        "this machine is too slow: run time fell behind",
    ]

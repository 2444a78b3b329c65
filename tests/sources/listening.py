"""A live source on a real socket, until enough is heard."""

import time

from seerob.devices.live.listening import Listener

PATIENCE = 120.0


def heard(source, enough):
    """Samples until there are enough of them whose time is known: on a busy machine the first are late."""
    samples = []
    listener = Listener(source, None, lambda s: "its clock" in s.reason or samples.append(s))
    listener.start()
    end = time.monotonic() + PATIENCE
    while not enough(samples) and time.monotonic() < end:
        time.sleep(0.01)
    listener.ask_to_stop()
    assert listener.join(PATIENCE)
    assert enough(samples)
    return samples


def by_name(sample):
    return {point.name: point for point in sample.points}

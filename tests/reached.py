"""What a live source says when it is opened and then asked, as a run does: ``from reached import …``."""


def reached(source, folder, target):
    """Findings before and after the connection."""
    opened = source.open(folder, target)
    return (*opened.findings, *opened.reach())


def asked(station):
    """A station whose live sources have been asked."""
    station.reach()
    return station

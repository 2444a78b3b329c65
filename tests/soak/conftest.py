"""Tests marked ``soak`` run only when asked for: ``pytest -m soak tests/soak``."""

MARKER = "soak: long runs, kills and fuzzing; only with -m soak"


def pytest_configure(config):
    config.addinivalue_line("markers", MARKER)


def pytest_collection_modifyitems(config, items):
    if "soak" in (config.option.markexpr or ""):
        return
    long = [item for item in items if item.get_closest_marker("soak")]
    if long:
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if not item.get_closest_marker("soak")]

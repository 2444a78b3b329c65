"""Being here puts this folder on the path, so that tests can ``from oracles.… import …``."""

import gc

from hypothesis import settings

# How long an example takes says something about the machine, not about the code.
settings.register_profile("anywhere", deadline=None)
settings.load_profile("anywhere")


def pytest_collection_finish() -> None:
    """Libraries and tests stay to the end: not looking through them again and again saves a fifteenth."""
    gc.collect()
    gc.freeze()

"""Being here puts this folder on the path, so that tests can ``from oracles.… import …``."""

from hypothesis import settings

# How long an example takes says something about the machine, not about the code.
settings.register_profile("anywhere", deadline=None)
settings.load_profile("anywhere")

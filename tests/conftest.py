"""Being here puts this folder on the path, so that tests can ``from oracles.… import …``."""

import gc
import os

import pytest
from hypothesis import settings

# How long an example takes says something about the machine, not about the code.
settings.register_profile("anywhere", deadline=None)
settings.load_profile("anywhere")

APART = "/test_relations.py"
"""Its cells share nothing and take long: one by one, at the end, they keep whoever is ready busy."""

gc.disable()


def pytest_collection_modifyitems(config, items):
    """Long runs, marked ``soak`` wherever they lie, run only when asked for: ``pytest -m soak``."""
    if "soak" in (config.option.markexpr or ""):
        return
    if long := [item for item in items if item.get_closest_marker("soak")]:
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if not item.get_closest_marker("soak")]


def pytest_collection_finish() -> None:
    """Libraries and tests stay to the end: not looking through them again and again saves a fifteenth.

    Nor while they are collected, which is an eighth of that.
    """
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A file is one worker's: what its tests share is made once, and what they must not do at once is not.

    ``xdist_group`` of pytest-xdist 3.8 groups nothing with pytest 9.2: a test's name is not its attribute any
    more.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            file, _, _ = nodeid.partition("::")
            return nodeid if file.endswith(APART) else file

    return ByFile(config, log)


@pytest.fixture(scope="session", autouse=True)
def _gaps_at_joints_are_kept(tmp_path_factory):
    """How fast parts close at a joint is worked out once for all workers: 2.5 s of a UR10.

    Whoever runs a cell finds that kept at the second start.
    """
    from seerob.criteria.contact import joint_gaps

    base = tmp_path_factory.getbasetemp()
    kept = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "gaps"
    rates = joint_gaps._rates
    joint_gaps._rates = lambda *given: rates(*given[:-1], given[-1] or kept)
    yield
    joint_gaps._rates = rates

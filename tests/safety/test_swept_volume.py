"""The criterion: what it has swept is what the trajectory sweeps, and what it cannot know."""

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, two_r
from made_sweep import inside
from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Verdict
from seerob.model.volumes.swept import swept_volume
from seerob.session.run import Judge
from seerob.twin.engine import Engine

SWEPT = '[[safety]]\nkind = "swept_volume"\nname = "swept"\nof = "arm"\nvoxel = 0.05\n'


def station(folder, more=""):
    return made(folder, FLOATING + TWO_R + SWEPT + more, {"arm.urdf": two_r()})


def along(station, instants, timeout=0.2):
    """Results while the arm turns at 1 rad/s from sample to sample, as the run loop makes them."""
    engine = Engine(station.model, driven={"arm": timeout})
    judge, results, t = Judge(station.bound), [], 0.0
    for k in range(round(max(instants) / 0.01) + 1):
        now = [heard("arm", s, [s, 0.0], [1.0, 0.0]) for s in instants if abs(s - k * 0.01) < 1e-9]
        engine.take(now)
        state = engine.tick() if k else engine.start()
        results.append(judge(state)[0])
        t = state.t
    assert t == pytest.approx(max(instants))
    return results


def test_sweep_of_ticks_is_the_sweep_of_the_trajectory(tmp_path):
    cell = station(tmp_path)
    results = along(cell, np.arange(0, 1.001, 0.01))
    values = [r.value for r in results]
    assert values == sorted(values)
    way = np.column_stack([np.linspace(0, 1, 101), np.zeros(101)])
    whole = swept_volume(cell.model, cell.model.select("arm"), {"arm": way}, voxel=0.05)
    assert values[-1] == pytest.approx(whole.volume, rel=0.03)
    assert values[-1] > 0.5 * 1.0 * 2.0**2 * 0.1


def test_marker_is_a_closed_surface_that_contains_the_arm(tmp_path):
    cell = station(tmp_path)
    hull = along(cell, np.arange(0, 0.101, 0.01))[0].markers[0]
    mesh = Mesh(np.array(hull.vertices), np.array(hull.faces, np.int32))
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    x, y, z = np.meshgrid(np.linspace(0, 2, 9), [-0.05, 0, 0.05], [-0.05, 0, 0.05])
    assert inside(mesh, np.column_stack([x.ravel(), y.ravel(), z.ravel()])).all()


@pytest.mark.parametrize(("limit", "verdict"), [(1.0, Verdict.WITHIN), (0.1, Verdict.EXCEEDED)])
def test_limit(tmp_path, limit, verdict):
    last = along(station(tmp_path, f"limit = {limit}\n"), np.arange(0, 0.301, 0.01))[-1]
    assert last.verdict is verdict
    assert last.limit == limit


def test_gap_in_what_was_heard_is_never_within(tmp_path):
    instants = [*np.arange(0, 0.101, 0.01), *np.arange(0.3, 0.701, 0.01)]
    results = along(station(tmp_path, "limit = 5\n"), np.round(instants, 2), timeout=0.1)
    assert results[9].verdict is Verdict.WITHIN
    assert results[25].value is None
    assert results[-1].verdict is Verdict.UNDECIDED
    assert "not known where it went from 0." in results[-1].reason


def test_asked_too_rarely_is_never_within(tmp_path):
    last = along(station(tmp_path, "limit = 5\nevery = 0.1\n"), np.arange(0, 0.301, 0.01))[-1]
    assert last.verdict is Verdict.UNDECIDED


def test_second_run_starts_anew(tmp_path):
    cell = station(tmp_path)
    instants = np.arange(0, 0.201, 0.01)
    assert [r.value for r in along(cell, instants)] == [r.value for r in along(cell, instants)]


def test_not_heard_is_undecided(tmp_path):
    cell = station(tmp_path)
    engine = Engine(cell.model, driven={"arm": 0.2})
    result = Judge(cell.bound)(engine.start())[0]
    assert result.verdict is Verdict.UNDECIDED
    assert "nothing heard yet" in result.reason


def test_wrong_options_are_told_before_the_run(tmp_path):
    text = FLOATING + TWO_R + SWEPT.replace("0.05", "0.00001")
    cell = made(tmp_path, text, {"arm.urdf": two_r()})
    with pytest.raises(InputError, match=r"\(swept\): voxel: 1e-05 m needs .* use voxels of"):
        _ = cell.bound
    with pytest.raises(InputError, match="did you mean 'arm'"):
        made(tmp_path, TWO_R + SWEPT.replace('of = "arm"', 'of = "amr"'), {"arm.urdf": two_r()})
    with pytest.raises(InputError, match="voxel"):
        made(tmp_path, TWO_R + SWEPT.replace("0.05", "-1"), {"arm.urdf": two_r()})

"""Of a mass alone nobody knows where in its shape it is: whatever that may be is in the interval."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, person, results_at
from seerob.core.errors import InputError

LINK = (
    '<link name="l{0}"><inertial><origin xyz="0.2 0 0"/><mass value="{1}"/><inertia ixx="0.02" iyy="0.03" '
    'izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0.2 0 0"/><geometry>'
    '<box size="0.4 0.1 0.1"/></geometry></collision></link>'
)
JOINT = (
    '<joint name="j{0}" type="continuous"><parent link="{1}"/><child link="l{0}"/><origin xyz="{2} 0 0"/>'
    '<axis xyz="{3}"/><limit effort="500" velocity="10"/></joint>'
)
ARM = (
    '<robot name="arm"><link name="base"/>'
    + "".join(LINK.format(k, mass) for k, mass in ((1, 2.0), (2, 1.5), (3, 0.8), (4, 0.5)))
    + JOINT.format(1, "base", 0, "0 0 1")
    + JOINT.format(2, "l1", 0.4, "0 1 0")
    + JOINT.format(3, "l2", 0.4, "0 1 0")
    + JOINT.format(4, "l3", 0.4, "1 0 0")
    + "</robot>"
)
KINDS = {
    "energy": 'kind = "kinetic_energy"\nrobot = "arm"',
    "point": 'kind = "point_energy"\nat = "arm/l4"\noffset = [0.1, 0.05, 0]',
    "felt": 'kind = "effective_mass"\nat = "arm/l4"\noffset = [0.1, 0.05, 0]',
    "worst": 'kind = "effective_mass"\nat = "arm/l4"\nalong = "worst"',
}
CONTACT = '[[safety]]\nkind = "power_and_force"\nname = "contact"\nrobot = "arm"\n'
LOADED = '[[safety]]\nkind = "force_polytope"\nname = "force"\nat = "arm/l4"\nlimit = 5000\n'
LOADED += "torque_limits = [[-20, 20], [-20, 20], [-20, 20], [-20, 20]]\n"


def heavy_points(rng, shape):
    """Masses that sum to 1 in a box, ball or cylinder about the origin: centre, and moments about it."""
    kind, sizes = shape
    n = rng.integers(4, 9)
    at = rng.uniform(-1, 1, (n, 3))
    # Most of it at one place, which is on the surface half of the time.
    if kind == "box":
        at[0] = np.sign(at[0]) if rng.random() < 0.5 else at[0]
        at = at * np.array(sizes) / 2
    elif kind == "sphere":
        at = at / np.maximum(np.linalg.norm(at, axis=1), 1)[:, None] * sizes
    else:
        at[:, :2] /= np.maximum(np.linalg.norm(at[:, :2], axis=1), 1)[:, None]
        at = at * np.array([sizes[0], sizes[0], sizes[1] / 2])
    share = rng.dirichlet(np.ones(n)) * 0.4
    share[0] += 0.6
    com = share @ at
    d = at - com
    second = (d * share[:, None]).T @ d
    return com, np.trace(second) * np.eye(3) - second


def text_of(shape, mass, said, limits, at):
    kind, sizes = shape
    given = sizes if kind == "sphere" else list(sizes)
    tool = (
        f'[[tools]]\nname = "grip"\non = "arm/l4"\nshape = {{ {kind} = {given} }}\nmass = {mass}\n'
        f"at = {{ position = [0.4, {at}, 0] }}\n{said}\n"
    )
    criteria = (
        f'[[safety]]\nname = "{name}"\n{kind}\n' + (f"limit = {limits[name]}\n" if limits else "")
        for name, kind in KINDS.items()
    )
    return FLOATING + TWO_R + tool + person("op", 1.6, 0.0, -1.0) + "".join(criteria) + CONTACT + LOADED


def stated(mass, com, inertia=None):
    said = f"com = {com.tolist()}\n"
    if inertia is None:
        return said
    six = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    return said + f"inertia = {[mass * float(x) for x in six]}\n"


def random_cell(folder, seed):
    """Results with a mass alone, with its centre, and with both; and limits near what they say."""
    rng = np.random.default_rng(seed)
    shape = [
        ("box", tuple(rng.uniform(0.05, 0.4, 3).tolist())),
        ("sphere", float(rng.uniform(0.05, 0.2))),
        ("cylinder", tuple(rng.uniform(0.05, 0.3, 2).tolist())),
    ][seed % 3]
    mass, at = float(rng.uniform(0.5, 8)), float(rng.uniform(-0.1, 0.1))
    com, second = heavy_points(rng, shape)
    pose = rng.uniform(-1, 1, 4), rng.uniform(-2, 2, 4)

    def results(name, said, limits=None):
        cell = made(folder / name, text_of(shape, mass, said, limits, at), {"arm.urdf": ARM})
        return results_at(cell, arm=pose)

    exact = results("exact", stated(mass, com, second))
    limits = {name: float(exact[name].value * rng.uniform(0.6, 1.6)) for name in KINDS}
    return (
        results("alone", "", limits),
        results("centre", stated(mass, com), limits),
        results("both", stated(mass, com, second), limits),
    )


@pytest.mark.parametrize("seed", range(6))
def test_wherever_a_mass_is_in_its_shape_figures_are_in_their_interval(tmp_path, seed):
    """Against the same cell with centre and moments of points in it; who says more has no wider one."""
    alone, centre, both = random_cell(tmp_path, seed)
    for name in KINDS:
        truth, (low, high) = both[name].value, alone[name].interval
        assert both[name].interval is None
        assert low - 1e-9 <= truth <= high + 1e-9, name
        less, more = centre[name].interval
        assert less - 1e-9 <= truth <= more + 1e-9, name
    (low, high), (less, more) = alone["energy"].interval, centre["energy"].interval
    assert low - 1e-9 <= less <= more <= high + 1e-9
    for name, result in both.items():
        for found in (alone[name], centre[name]):
            if found.verdict in ("within", "exceeded") and result.verdict is not None:
                assert found.verdict == result.verdict, name
            assert result.verdict is None or found.verdict is not None, name
    for part, true in zip(alone["contact"].parts, both["contact"].parts, strict=True):
        # Another surface governs where the speeds are not the same.
        if part.interval is None or true.limit is None or part.value != pytest.approx(true.value):
            continue
        low, high = part.interval
        assert low - 1e-9 <= part.value + part.limit - true.limit <= high + 1e-9
    assert alone["force"].verdict == "undecided"
    assert "where the mass of grip is, of which nobody gave com and inertia, ±" in alone["force"].reason
    assert both["force"].verdict == "within"


SHIFT = 'shape = {{ box = [0.2, 0.1, 0.1] }}\non = "arm/l4"\nmass = 2\n{}'


@pytest.mark.parametrize(
    ("said", "exact"),
    [
        ("", False),
        ("com = [0, 0, 0]", False),
        ("com_tolerance = 0.01", False),
        ("uniform_density = true", True),
        ("uniform_density = true\ncom = [0.0005, 0, 0]", True),
    ],
)
def test_uniform_density_is_taken_from_who_says_it_alone(tmp_path, said, exact):
    text = FLOATING + TWO_R + '[[tools]]\nname = "grip"\n' + SHIFT.format(said)
    text += '\n[[safety]]\nname = "energy"\nkind = "kinetic_energy"\nrobot = "arm"\n'
    cell = made(tmp_path, text, {"arm.urdf": ARM})
    result = results_at(cell, arm=(np.zeros(4), np.ones(4)))["energy"]
    assert (result.interval is None) is exact
    told = [finding.text for finding in cell.model.findings if finding.subject == "grip"]
    assert any("give" in text and "inertia" in text for text in told) is not exact


def test_a_centre_that_no_uniform_density_has_contradicts_it(tmp_path):
    text = FLOATING + TWO_R + '[[tools]]\nname = "grip"\n'
    with pytest.raises(InputError, match="from where uniform density has it") as caught:
        made(tmp_path, text + SHIFT.format("uniform_density = true\ncom = [0.02, 0, 0]"), {"arm.urdf": ARM})
    assert caught.value.problems[0].key == "tools[0] (com)"
    dense, spread = "density = 1000", "mass = 2\ncom = [0, 0, 0]\ninertia = [0.01, 0.01, 0.01, 0, 0, 0]"
    for said in (dense, spread):
        table = SHIFT.replace("mass = 2\n", "").format(f"uniform_density = true\n{said}")
        with pytest.raises(InputError, match="uniform_density"):
            made(tmp_path / "refused", text + table, {"arm.urdf": ARM})

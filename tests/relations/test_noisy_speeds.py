"""What noise of positions does to whatever rests on speeds derived from them, on random cells.

The same log is played twice: with the speeds that seerob derives from its noisy positions in columns of their
own, so that nobody knows that they are noisy, and without. All figures are the same.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from random_cells import ALL, files, random_cell, station
from random_cells import said as log_of
from test_bounds import by_table, map_csv

from made_cell import meant
from seerob.core.snapshot import Verdict
from seerob.recording.series import CODES
from seerob.session import batch
from seerob.session.recorded_motion import recorded
from seerob.session.run import engine_of, looks_ahead, pump
from seerob.session.station import load

WITHIN, UNDECIDED = CODES[Verdict.WITHIN], CODES[Verdict.UNDECIDED]
BARELY = 1e-7
"""Margin that is left of every figure [its unit]: far less than what noise makes of it."""
SPACE = "human_speed = 1.6\nintrusion = FIGURE\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"
EXCLUDED = '["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]'
STOPS = {
    "bound": "{ reaction = 0.1, stopping = 0.2, acceleration = 0 }",
    "ahead": "{ reaction = 0.05, stopping = 0.2 }",
    "gains": "{ reaction = 0.1, stopping = 0.2, acceleration = 1.0, tolerance = { reaction = 0.01 } }",
    "slows": '{ model = "constant_deceleration", reaction = 0.1, deceleration = 2.0, acceleration = 0 }',
}
KINDS = {
    "tip": ('kind = "velocity"\nat = "arm"\nlimit = FIGURE\n', 9.0),
    "all": ('kind = "velocity"\nof = "arm"\nlimit = FIGURE\n', 9.0),
    "energy": ('kind = "kinetic_energy"\nrobot = "arm"\nlimit = FIGURE\n', 240.0),
    "mass": ('kind = "effective_mass"\nat = "arm"\nlimit = FIGURE\n', 140.0),
    "own": ('kind = "own.joint_speed"\nrobot = "arm"\nlimit = FIGURE\n', 99.0),
    **{
        name: (f'kind = "separation"\nbetween = ["arm", "op"]\nstop = {stop}\n{SPACE}', 0.0)
        for name, stop in STOPS.items()
    },
    "ever": (
        f'kind = "separation"\nmode = "fixed"\nbetween = ["arm", "op"]\nstop = {STOPS["bound"]}\n{SPACE}',
        0.0,
    ),
    "table": ("", 0.0),
    "area": ('kind = "separation_area"\nseparation = "bound"\nof = "op"\n', 0.0),
    "contact": (
        'kind = "power_and_force"\nrobot = "arm"\ncontact_area = { arm = 1e-4 }\nlargest_area = 1e-4\n'
        f'excluded = {EXCLUDED}\nperson_speed = FIGURE\n', 0.0,
    ),
    "path": ('kind = "path_speed"\nrobot = "arm"\nmap = "map.csv"\ntolerance = 1\n', 9.0),
}  # fmt: skip
ADDS = {*STOPS, "ever", "table", "contact"}
"""Whose figure is added to the value or the limit, instead of being the limit."""


def asked(cell, figures):
    """Tables of all criteria that ask for speeds, each with its figure."""
    texts = []
    for name, (text, _) in KINDS.items():
        text = f'[[safety]]\nname = "{name}"\n{text}'
        if name == "table":
            text = by_table(name, len(cell.links), ", acceleration = 0", "human_speed = 1.6\n")
            text = text.replace("full_speed = 50.0", "full_speed = 15.0").replace("sion = 0", "sion = FIGURE")
            # About half of speed times time, as of a robot that brakes evenly.
            text = text.replace("[[0.2, 0.25]], [[0.5, 0.7]]", "[[0.6, 0.75]], [[2.5, 3.0]]")
        texts.append(text.replace("FIGURE", repr(figures[name])))
    return "".join(texts)


def slow(seed, *, told):
    """A random arm that moves slowly, of which the log is noisy, and a person far enough from it.

    Args:
        seed: Of the cell.
        told: Whether the speeds that follow from the log's positions are in it, as if they were measured.
    """
    cell = random_cell(seed, published=False, around=False)
    everything = {
        "speed",
        "fastest",
        "energy",
        "distance",
        "separation",
        "area",
        "felt",
        "contact",
        "posture",
    }
    return replace(
        cell,
        amplitude=0.15 * cell.amplitude,
        person=np.array([6.0, 0.0, 0.0]),
        rate=200.0,
        tool=None,
        speeds=told,
        derived=True,
        noise=5e-5,
        walks=False,
        left_out=frozenset(everything),
    )


def cell_of(cell, folder, figures):
    n = len(cell.links)
    units = ["m" if link.kind == "prismatic" else "rad" for link in cell.links]
    folder.mkdir(parents=True, exist_ok=True)
    places = [(*[x] * n, figures["path"]) for x in (0.0, 0.01)]
    (folder / "map.csv").write_text(map_csv(units, places))
    asking = replace(cell, more=cell.more + asked(cell, figures))
    # How fast the arm gets from tick to tick is not the matter here.
    return station(replace(asking, more=asking.more + meant(files(asking)["workstation.toml"])), folder)


def at_ticks(made):
    """What everybody says at the ticks, whatever happens between them."""
    motion = recorded(made.model, pump(made.sources, made.workstation.engine.tick), made.duration)
    findings = [found for _, opened in made.sources for found in opened.findings]
    bound = [replace(one, watch=None) for one in made.bound]
    found = batch.judged(made.model, bound, replace(motion, ways=None), threads=1, findings=findings)
    return {name: found[name].answers for name in KINDS}


@pytest.mark.parametrize("seed", [1, 6])
def test_what_noise_may_make_exceed_is_not_within(seed, tmp_path):
    lax = {name: figure for name, (_, figure) in KINDS.items()}
    first = at_ticks(cell_of(slow(seed, told=True), tmp_path / "lax", lax))
    figures, worst = {}, {}
    for name, said in first.items():
        known = said.verdict == WITHIN
        assert known.sum() > 10, name
        least = said.value if said.interval is None else said.interval[0]
        margins = least - said.limit if name in ADDS - {"contact"} else said.limit - said.value
        worst[name] = int(np.where(known, margins, np.inf).argmin())
        left = float(margins[worst[name]]) - BARELY
        figures[name] = left if name in ADDS else lax[name] - left
    # Its value is the share of a speed that is permitted.
    figures["path"] = lax["path"] * float(first["path"].value.max()) + BARELY
    figures["area"] = 0.0
    one, other = (cell_of(slow(seed, told=told), tmp_path / str(told), figures) for told in (True, False))
    known, noisy = at_ticks(one), at_ticks(other)
    run = other.run().results
    for name in KINDS:
        k = worst["bound" if name == "area" else name]
        # Of a speed that only grows by noise: the figures are the same, and one of them is not within.
        np.testing.assert_allclose(noisy[name].value[k], known[name].value[k], rtol=1e-9, err_msg=name)
        assert known[name].verdict[k] == WITHIN, name
        assert noisy[name].verdict[k] == UNDECIDED, name
        assert run[name].verdicts[k] != WITHIN, name
        greener = (noisy[name].verdict == WITHIN) & (known[name].verdict != WITHIN)
        assert not greener.any(), name


@pytest.mark.parametrize("physics", [False, True])
@pytest.mark.parametrize("seed", [3, 12])
def test_slopes_between_noisy_samples_hide_no_speed_that_the_log_says(seed, physics, tmp_path):
    """Speeds of the log are exact, its positions are not, and ticks lie between its samples."""
    cell = random_cell(seed, published=False, around=False)
    figures = {"speed": "speed", "fastest": "speed", "energy": "energy"}
    cell = replace(
        cell, rate=125.0, duration=1.0, speeds=True, walks=False, tool=None, physics=physics,
        machine=None, left_out=frozenset(ALL) - figures.keys(),
    )  # fmt: skip
    true = log_of(replace(cell, physics=False), tmp_path / "truth")
    limits = cell.limits | {
        limit: float(np.median(true[name].values)) for name, limit in figures.items() if name != "speed"
    }
    noisy = replace(cell, noise=2e-4, limits=limits)
    made = station(noisy, tmp_path / "noisy")
    run = made.run().results
    arrays = None if physics else made.batch()
    could = 0
    for name, limit in figures.items():
        beyond = true[name].values > (1.05 * limits[limit] + 0.01)
        could += int(beyond.sum())
        for verdicts in (run[name].verdicts, arrays and arrays[name].answers.verdict):
            if verdicts is not None:
                assert len(verdicts) == len(beyond)
                assert not (beyond & (verdicts == WITHIN)).any(), (name, verdicts[beyond])
    assert could > 50


@pytest.mark.parametrize("name", ["two_robots", "ur10_assembly"])
def test_a_motion_without_noise_has_no_interval_however_the_twin_follows_it(name):
    cell = load(Path(__file__).parents[2] / "workstations" / name)
    period, engine = cell.workstation.engine.tick, engine_of(cell.model)
    for k, samples in enumerate(islice(pump(cell.sources, period, ahead=looks_ahead(cell.model)), 60)):
        engine.take(samples)
        state = engine.tick() if k else engine.start()
        assert not state.speed_errors, state.t

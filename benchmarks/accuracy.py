"""How exact the twin is, in figures: against Pinocchio, against exact motions, against itself.

    python benchmarks/accuracy.py            # prints the figures of docs/validation.md
    python benchmarks/accuracy.py --smoke    # few poses and short motions

The tests say what must hold; this says how well it does.
"""

from __future__ import annotations

import argparse
import atexit
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib.resources import files
from itertools import repeat
from pathlib import Path

import msgspec
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import pinocchio as pin

from made_cell import FLOATING, heard, hinge_limits, made, state_at
from oracles import pinocchio_oracle as oracle
from seerob.core.transforms import Array
from seerob.criteria.safety.kinetic_energy import kinetic_energy
from seerob.description.robots import library
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording
from seerob.session.run import pump
from seerob.session.station import Station, load, load_recorded
from seerob.twin.engine import Engine
from seerob.twin.state import State
from seerob.workstation.source import Opened, Source

Motion = Callable[[float], tuple[Array, Array]]
UR10 = '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n'
LOAD = (
    '[[tools]]\nname = "load"\non = "arm/tool0"\nshape = { box = [0.1, 0.1, 0.1] }\nmass = 3\n'
    "tcp = { position = [0, 0, 0.1] }\n"
)
PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
START, AMPLITUDE = np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.array([1, 0.5, -0.6, 0.8, -0.7, 1.0])


def wave(t: float) -> tuple[Array, Array]:
    """A joint motion with a peak of 2 rad/s."""
    return START + AMPLITUDE * np.sin(2 * t), 2 * AMPLITUDE * np.cos(2 * t)


def folder() -> Path:
    made = Path(tempfile.mkdtemp(prefix="seerob-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def dynamics(poses: int, names: tuple[str, ...]) -> None:
    """M, J and E of library robots through `State`, against Pinocchio built from the same figures."""
    rng = np.random.default_rng(0)
    worst = {"M": 0.0, "J": 0.0, "E": 0.0}
    counted = 0
    for name in names:
        description = library.load(name)
        station = made(folder(), f'{FLOATING}[[robots]]\nname = "arm"\nmodel = "library:{name}"\n')
        robot, model = station.model.robot("arm"), oracle.pinocchio_model(description)
        low, high = hinge_limits(station, "arm")
        for _ in range(poses):
            q, qd = rng.uniform(low, high), rng.uniform(-2, 2, len(low))
            state = state_at(station, arm=(q, qd))
            J = state.jacobian(station.model.frame(f"arm/{description.tip}"), robot)
            worst["J"] = max(worst["J"], relative(J, oracle.jacobian(model, q, description.tip)))
            if robot.unknown_masses:
                continue
            M = state.mass_matrix(robot)
            E = oracle.kinetic_energy(model, q, qd)
            worst["M"] = max(worst["M"], relative(M, oracle.mass_matrix(model, q)))
            worst["E"] = max(worst["E"], abs(float(kinetic_energy(M, state.qd(robot))) - E) / E)
        counted += not robot.unknown_masses
    said = ", ".join(f"{what} {value:.1e}" for what, value in worst.items())
    print(f"dynamics   {len(names)} robots ({counted} with masses), {poses} poses: {said} (relative)")
    print(f"           against pinocchio {pin.__version__}")


def relative(ours: Array, theirs: Array) -> float:
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


def states(
    station: Station, name: str, motion: Motion, rate: float, seconds: float, *, qd: bool
) -> Iterator[State]:
    """The states of a run of samples of a motion, as the product makes them."""
    times = np.arange(0, seconds + 1e-9, 1 / rate).tolist()
    samples = tuple(heard(name, t, motion(t)[0], motion(t)[1] if qd else None) for t in times)
    engine = Engine(station.model, driven={name: 0.2})
    opened = Opened(samples=samples, duration=times[-1])
    for k, taken in enumerate(pump([(Source(), opened)], station.workstation.engine.tick)):
        engine.take(taken)
        yield engine.tick() if k else engine.start()


def tracking(seconds: float, timesteps: tuple[float, ...] = (0.001, 0.002)) -> None:
    """Error at the tool of a UR10 with 3 kg, at the instant of each state."""
    model = oracle.pinocchio_model(library.load("ur10"))
    for timestep in timesteps:
        station = made(folder(), f"engine = {{ timestep = {timestep} }}\n{UR10}{LOAD}")
        tip = station.model.mechanism("arm").tip
        for rate, qd in ((100, True), (100, False), (50, True), (50, False), (500, True)):
            errors = []
            for state in states(station, "arm", wave, rate, seconds, qd=qd):
                exact = oracle.pose(model, wave(state.t)[0], "tool0") @ [0, 0, 0.1, 1]
                errors.append(np.linalg.norm(state.pose(tip)[1] - exact[:3]))
            rms, largest = np.sqrt(np.square(errors).mean()), max(errors)
            print(
                f"tracking   2 rad/s, {rate} Hz samples {'with' if qd else 'without'} velocities, step "
                f"{timestep * 1e3:g} ms: {rms * 1e6:.3g} µm rms, {largest * 1e6:.3g} µm largest"
            )


def person(seconds: float) -> None:
    """Joint error of a person who follows samples at 60 Hz."""
    station = made(folder(), PERSON)
    human = station.model.human("op")
    n = len(human.joints)
    rng = np.random.default_rng(0)
    low, high = hinge_limits(station, "op")
    amplitude, f, phase = 0.2 * np.minimum(high - low, 1), rng.uniform(1, 4, n), rng.uniform(0, 6, n)

    def motion(t: float) -> tuple[Array, Array]:
        return human.home + amplitude * np.sin(f * t + phase), amplitude * f * np.cos(f * t + phase)

    errors = [
        np.abs(state.joint_positions(human) - motion(state.t)[0])
        for state in states(station, "op", motion, 60, seconds, qd=True)
    ]
    rms, largest = np.sqrt(np.square(errors).mean()), np.max(errors)
    print(f"person     {n} joints, 60 Hz samples: {rms:.2g} rad rms, {largest:.2g} rad largest")


def energy(ticks: int) -> None:
    """Kinetic energy in free motion, without gravity and controllers."""
    for name in ("ur10", "iiwa14", "ur5e"):
        station = made(folder(), f'{FLOATING}[[robots]]\nname = "arm"\nmodel = "library:{name}"\n')
        robot = station.model.robot("arm")
        rng = np.random.default_rng(3)
        n = len(robot.joints)
        engine = Engine(station.model, controllers=False)
        engine.take([heard("arm", 0.0, rng.uniform(-1, 1, n), rng.uniform(-1, 1, n))])
        found = []
        for k in range(ticks + 1):
            state = engine.tick() if k else engine.start()
            found.append(float(kinetic_energy(state.mass_matrix(robot), state.qd(robot))))
        spread = (max(found) - min(found)) / found[0]
        print(f"energy     {name}, {ticks / 100:g} s of free motion: varies by {spread:.1e} (relative)")


def replay(ticks: int | None) -> None:
    """The starter's run, or its first ticks, against its recording, computed again from the files in it."""
    source, place = files("seerob.app.commands") / "starter", folder()
    for entry in source.iterdir():
        (place / entry.name).write_bytes(entry.read_bytes())
    left = repeat(None) if ticks is None else repeat(None, ticks)
    load(place).run(
        folder=place / "first",
        sinks=[Recorder(lossless=True)],
        stop=lambda: next(left, "none left") is not None,
    )
    first = Recording.open(place / "first" / "run.mcap")
    load_recorded(first).replay(first, folder=place / "again", sinks=[Recorder(lossless=True)])
    again = Recording.open(place / "again" / "run.mcap")
    pairs = list(zip(first.snapshots(), again.snapshots(), strict=True))
    results = sum(len(a.results) for a, _ in pairs)
    # Encoded, so that every bit of every figure, marker and reason counts.
    differ = sum(msgspec.msgpack.encode(a) != msgspec.msgpack.encode(b) for a, b in pairs)
    print(f"replay     {len(pairs)} snapshots with {results} results: {differ} differ in any bit")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--smoke", action="store_true", help="few poses and short motions")
    smoke = parser.parse_args().smoke
    names = tuple(library.names())
    dynamics(2 if smoke else 200, names[::4] if smoke else names)
    tracking(*((0.1, (0.002,)) if smoke else (3.0,)))
    person(0.2 if smoke else 3.0)
    energy(10 if smoke else 100)
    replay(50 if smoke else None)
    return 0


if __name__ == "__main__":
    sys.exit(main())

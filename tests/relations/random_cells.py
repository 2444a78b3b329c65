"""Random workstations, and what can be done to them: tests import it as ``from random_cells import …``.

A cell is plain data; `files` writes it as a user would. What is done to a cell is a function from one cell to
another, so that any relation between their verdicts can be asked of any cell.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from kept_run import Kept
from seerob.core.markers import Segment
from seerob.files.trajectories.trajectory import derive_velocities
from seerob.recording.result_log import ResultLog
from seerob.recording.series import Series
from seerob.session.station import Station, load

LIBRARY = {
    "ur3e": (6, "tool0"),
    "ur5": (6, "tool0"),
    "ur10": (6, "tool0"),
    "ur16e": (6, "tool0"),
    "iiwa7": (7, "lbr_link_ee"),
    "iiwa14": (7, "lbr_link_ee"),
    "niryo_one": (6, "tool_link"),
    "doosan_m1013": (6, "link6"),
}
"""Robot of the library → number of joints, and the link that carries tools."""
FOUND = (700023, 700071)
"""Cells in which relations, or what the comparison made of them, once failed; they are as they were then."""
PIECE = 3
"""Into how many a link is split by fixed joints."""


@dataclass(frozen=True)
class Inertial:
    mass: float
    com: np.ndarray
    inertia: np.ndarray
    """About the centre of mass, in the axes of the link, shape (3, 3) [kg·m²]."""

    def urdf(self) -> str:
        (a, b, c), (_, d, e), (_, _, f) = self.inertia.tolist()
        return (
            f'<inertial><origin xyz="{_xyz(self.com)}"/><mass value="{self.mass!r}"/><inertia ixx="{a!r}" '
            f'ixy="{b!r}" ixz="{c!r}" iyy="{d!r}" iyz="{e!r}" izz="{f!r}"/></inertial>'
        )


@dataclass(frozen=True)
class Link:
    origin: np.ndarray
    """Of its joint in the link before [m]."""
    axis: np.ndarray
    kind: str
    box: np.ndarray
    """Edges [m]."""
    middle: np.ndarray
    """Of the box, in the link [m]."""
    inertial: Inertial | None
    shaped: bool = True


@dataclass(frozen=True)
class Machine:
    """What a PLC tells of, and what it may carry the robot on."""

    kind: str
    """agv, axis, turntable or door."""
    carries: bool
    """Whether the robot stands on it."""
    place: np.ndarray
    """x, y, yaw where its joints are 0."""
    mass: float
    amplitude: float
    """Of its way about 0.3 [m or rad]: angles that no degrees could be."""
    frequency: float
    phase: float
    height: float = 0.3
    """Of its shape [m]."""
    wider: float = 0.0
    """Of its shape, to all sides [m]."""
    heard: bool = True
    """Whether there is anything in what the PLC told."""
    by_file: bool = False
    """Whether a file of joint positions drives it instead of variables."""


@dataclass(frozen=True)
class Gripper:
    """Two fingers at the end of the arm that open and close, as a file of their opening says."""

    mass: float
    """Of a finger [kg]."""
    frequency: float
    phase: float


@dataclass(frozen=True)
class Cell:
    links: tuple[Link, ...]
    """Of a random arm; empty for one of the library."""
    library: str
    tool: float | None
    """Mass of a tool [kg]; None without."""
    amplitude: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray
    rate: float
    """Samples per second."""
    duration: float
    speeds: bool
    """Whether the log has velocities."""
    noise: float = field(default=0.0, kw_only=True)
    """Standard deviation of the log's positions [rad or m]."""
    derived: bool = field(default=False, kw_only=True)
    """Whether the velocities of the log are derived from its positions."""
    stature: float
    person: np.ndarray
    """x, y, yaw of the person."""
    walks: bool
    limits: dict[str, float]
    tick: float = 0.01
    physics: bool = False
    world: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """x, y, yaw of everything."""
    names: tuple[str, str] = ("arm", "op")
    cart: str = "cart"
    """Name of the machine."""
    turned_tables: bool = False
    units: bool = False
    """Whether figures are written in mm and degrees."""
    split: bool = False
    start: float = 0.0
    """Of the log's clock [s]."""
    gap: tuple[float, float] | None = None
    """Stretch of the log that is not there [s]."""
    heard: bool = True
    uncertainty: float = 0.0
    mass_tolerance: float = 0.0
    post: np.ndarray | None = None
    """x, y of a thin post that reaches from the floor to 2 m."""
    anyone: bool = False
    """Whether contacts are judged of anyone who could stand anywhere, and not of the person alone."""
    live: bool = False
    """Whether the arm is heard from a live source instead of a log."""
    machine: Machine | None = None
    gripper: Gripper | None = None
    brakes: tuple[float, ...] = ()
    """How hard joints brake by a table of the maker [rad/s²]; empty for a stopping time."""
    tilt: float = 0.0
    """Angle about x by which everything is turned, gravity too [rad]."""
    more: str = ""
    """More tables."""
    every: float | None = None
    """Period of all criteria [s]."""
    left_out: frozenset[str] = field(default=frozenset())
    """Criteria that are not asked."""


def random_cell(seed: int, *, published: bool = True, around: bool = True) -> Cell:
    """An arm of two to seven joints that swings beside a person who stands or reaches.

    Every other cell has a machine.

    Args:
        seed: Equal seeds are equal cells.
        published: Whether one of four arms is one of the library.
        around: Whether there may be a post, and contacts of a slower arm with anyone.
    """
    rng = np.random.default_rng(seed)
    links = []
    for i in range(int(rng.integers(2, 6))):
        box = rng.uniform(0.05, 0.12, 3)
        along = rng.integers(3)
        box[along] = rng.uniform(0.2, 0.45)
        middle = np.zeros(3)
        middle[along] = box[along] / 2
        mass = float(rng.uniform(0.5, 8))
        # Within its box: of a mass where nothing has a shape, nothing that is about shapes is within.
        squares = (box * rng.uniform(0.7, 0.95)) ** 2
        inertia = np.diag(mass / 12 * (squares.sum() - squares))
        origin = np.zeros(3) if i == 0 else links[-1].middle * 2
        axis = rng.standard_normal(3)
        kind = "prismatic" if rng.random() < 0.15 else "revolute"
        links.append(
            Link(origin, axis / np.linalg.norm(axis), kind, box, middle, Inertial(mass, middle, inertia))
        )
    library = "" if rng.random() < 0.75 or not published else str(rng.choice(list(LIBRARY)))
    if library:
        links = []
    n = LIBRARY[library][0] if library else len(links)
    size = np.array([0.15 if link.kind == "prismatic" else 1.0 for link in links] or [0.6] * n)
    heading = rng.uniform(-np.pi, np.pi)
    far = rng.uniform(0.6, 2.2)
    cell = Cell(
        links=tuple(links),
        library=library,
        tool=float(rng.uniform(0.3, 4)) if rng.random() < 0.6 else None,
        amplitude=size * rng.uniform(0.1, 0.8, n),
        frequency=rng.uniform(1.0, 5.0, n),
        phase=rng.uniform(-np.pi, np.pi, n),
        rate=float(rng.choice([50, 100, 125, 200])),
        duration=0.2,
        speeds=bool(rng.random() < 0.5),
        stature=float(rng.uniform(1.55, 1.9)),
        person=np.array([far * np.cos(heading), far * np.sin(heading), rng.uniform(-np.pi, np.pi)]),
        walks=bool(rng.random() < 0.4),
        limits={
            "speed": float(rng.uniform(0.2, 4)),
            "energy": float(10 ** rng.uniform(-1, 2)),
            "distance": float(rng.uniform(0.05, 1.0)),
            "mass": float(rng.uniform(1, 15)),
        },
        machine=random_machine(rng, far * np.array([np.cos(heading), np.sin(heading)])) if seed % 2 else None,
    )
    if seed in FOUND or not around:
        return replace(cell, duration=0.3)
    return replace(cell, **more_of(np.random.default_rng([seed, 1]), cell))


def more_of(rng: np.random.Generator, cell: Cell) -> dict[str, object]:
    """What there is around a cell: a post, and contacts with anyone, slow enough that some are permitted.

    One arm in ten hardly moves.
    """
    heading, far = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 0.9)
    found: dict[str, object] = {"anyone": bool(rng.random() < 0.5)}
    if rng.random() < 0.5:
        found["post"] = far * np.array([np.cos(heading), np.sin(heading)])
    if found["anyone"]:
        found["frequency"] = cell.frequency * 10 ** rng.uniform(-2, 0)
    if rng.random() < 0.1:
        found["frequency"] = cell.frequency * 10 ** rng.uniform(-5, -3)  # below 1 mm/s
    if rng.random() < 0.3:
        found["gripper"] = Gripper(*(float(x) for x in rng.uniform([0.05, 1.0, -np.pi], [0.5, 8.0, np.pi])))
    if rng.random() < 0.3 and all(link.kind == "revolute" for link in cell.links):
        found["brakes"] = tuple(rng.uniform(6, 40, len(cell.amplitude)).tolist())
    return found


def random_machine(rng: np.random.Generator, person: np.ndarray | None = None) -> Machine:
    """A machine of any kind, which carries the arm in half of the cases where it can.

    Args:
        rng: Chance.
        person: x, y of the person near whom one stands that carries nothing [m].
    """
    kind = str(rng.choice(["agv", "axis", "turntable", "door"]))
    turn, far = rng.uniform(-np.pi, np.pi), rng.uniform(0.5, 2.0)
    carries = kind != "door" and bool(rng.random() < 0.6)
    beside = np.array(
        [*(far * np.array([np.cos(turn), np.sin(turn)]) + (0.0 if person is None else person)), turn]
    )
    place = np.zeros(3) if carries else beside
    return Machine(
        kind=kind,
        carries=carries,
        place=place,
        mass=float(rng.uniform(20, 200)),
        amplitude=float(rng.uniform(0.02, 0.15)),
        frequency=float(rng.uniform(0.5, 3.0)),
        phase=float(rng.uniform(-np.pi, np.pi)),
        by_file=bool(rng.random() < 0.4),
    )


# -- as a user writes it ------------------------------------------------------------------------


def _xyz(values) -> str:
    return " ".join(repr(float(v)) for v in values)


def _place(cell: Cell, x: float, y: float, z: float, yaw: float) -> str:
    wx, wy, turn = cell.world
    c, s = np.cos(turn), np.sin(turn)
    position, rpy = np.array([wx + c * x - s * y, wy + s * x + c * y, z]), np.array([0.0, 0.0, yaw + turn])
    if cell.tilt:
        tilted = _about_x(cell.tilt)
        position, rpy = tilted @ position, _rpy(tilted @ _about_z(yaw + turn))
    if cell.units:
        return f"{{ position_mm = {(1000 * position).tolist()}, rpy_deg = {np.degrees(rpy).tolist()} }}"
    return f"{{ position = {position.tolist()}, rpy = {rpy.tolist()} }}"


def _about_x(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _rpy(R: np.ndarray) -> np.ndarray:
    return np.array(
        [np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1, 1)), np.arctan2(R[1, 0], R[0, 0])]
    )


def _length(cell: Cell, key: str, value: float) -> str:
    return f"{key}_mm = {1000 * value!r}\n" if cell.units else f"{key} = {value!r}\n"


def _halves(inertial: Inertial) -> list[Inertial]:
    """Pieces that have the mass, the centre and the inertia of the whole: all alike, at the same place."""
    return [Inertial(inertial.mass / PIECE, inertial.com, inertial.inertia / PIECE)] * PIECE


def urdf(cell: Cell) -> str:
    """The arm."""
    text = ['<link name="base"/>']
    before = "base"
    for i, link in enumerate(cell.links):
        box = (
            f'<collision><origin xyz="{_xyz(link.middle)}"/><geometry><box size="{_xyz(link.box)}"/>'
            "</geometry></collision>"
        )
        pieces = [None] if link.inertial is None else [link.inertial]
        if cell.split and link.inertial is not None:
            pieces = _halves(link.inertial)
        text.append(
            f'<link name="l{i}">{box if link.shaped else ""}{pieces[0].urdf() if pieces[0] else ""}</link>'
            f'<joint name="j{i}" type="{link.kind}"><parent link="{before}"/><child link="l{i}"/>'
            f'<origin xyz="{_xyz(link.origin)}"/><axis xyz="{_xyz(link.axis)}"/>'
            '<limit lower="-6" upper="6" effort="10000" velocity="50"/></joint>'
        )
        for k, piece in enumerate(pieces[1:]):
            text.append(
                f'<link name="l{i}_{k}">{piece.urdf()}</link><joint name="f{i}_{k}" type="fixed">'
                f'<parent link="l{i}"/><child link="l{i}_{k}"/></joint>'
            )
        before = f"l{i}"
    text.append(
        f'<link name="tip"/><joint name="end" type="fixed"><parent link="{before}"/><child link="tip"/>'
        f'<origin xyz="{_xyz(cell.links[-1].middle * 2)}"/></joint>'
    )
    return f'<robot name="chain">{"".join(text)}</robot>'


def truth(cell: Cell, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of the arm's joints at some instants, shape (N, n)."""
    angles = cell.frequency * np.asarray(t)[:, None] + cell.phase
    return cell.amplitude * np.sin(angles), cell.amplitude * cell.frequency * np.cos(angles)


def motion(cell: Cell) -> str:
    """The log of the arm."""
    n = len(cell.amplitude)
    turning = [link.kind == "revolute" for link in cell.links] or [True] * n
    unit = [("deg" if cell.units else "rad") if turn else ("mm" if cell.units else "m") for turn in turning]
    factor = np.array([{"deg": 180 / np.pi, "mm": 1000.0}.get(u, 1.0) for u in unit])
    header = ["t [s]", *(f"j{i} [{unit[i]}]" for i in range(n))]
    if cell.speeds:
        header += [f"qd_j{i} [{unit[i]}/s]" for i in range(n)]
    rows = [",".join(header)]
    every = np.arange(round(cell.duration * cell.rate) + 1) / cell.rate
    q, qd = truth(cell, every)
    q = q + np.random.default_rng(0).normal(0.0, cell.noise, q.shape)
    if cell.derived:
        qd = derive_velocities(every, q).qd
    for t, at, speed in zip(every.tolist(), q * factor, qd * factor, strict=True):
        if cell.gap and cell.gap[0] < t < cell.gap[1]:
            continue
        row = [t + cell.start, *at.tolist(), *(speed.tolist() if cell.speeds else ())]
        rows.append(",".join(repr(v) for v in row))
    return "\n".join(rows) + "\n"


WAYS = {"agv": ("x", "y", "heading"), "axis": ("way",), "turntable": ("angle",), "door": ("angle",)}
"""Of each kind of machine, what tells its joints."""


def machine_tables(cell: Cell, machine: Machine) -> list[str]:
    """The machine, and what moves it."""
    x, y, yaw = machine.place.tolist()
    box = (np.array([0.06, 0.8, 1.8] if machine.kind == "door" else [0.6, 0.5, 0.0]) + machine.wider).tolist()
    box[2] = 1.8 if machine.kind == "door" else machine.height
    motion = {
        "agv": 'vehicle = { x = "x", y = "y", heading = "heading" }',
        "axis": 'slide = { along = [0, 1, 0], position = "way" }',
        "turntable": 'turn = { angle = "angle" }',
        "door": 'turn = { angle = "angle" }',
    }[machine.kind]
    table = (
        f'[[machines]]\nname = "{cell.cart}"\nshape = {{ box = {box} }}\nmass = {machine.mass!r}\n'
        f"at = {_place(cell, x, y, box[2] / 2 + 0.02, yaw)}\n"
    )
    if machine.by_file:
        table += motion.split("=")[0] + "= { " + "along = [0, 1, 0] " * (machine.kind == "axis") + "}\n"
        source = f'[[sources]]\nkind = "csv"\nrobot = "{cell.cart}"\nfile = "machine.csv"\n'
    else:
        table += motion + "\n"
        source = (
            '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "machine.csv"\ntime = "t"\n'
            'time_unit = "s"\n'
        )
    return [table, source]


def machine_files(cell: Cell, machine: Machine) -> dict[str, str]:
    """What a PLC told of it, and what its variables mean; or the log of its joints."""
    ways = WAYS[machine.kind]
    unit = [("deg" if way in ("heading", "angle") else "mm") if cell.units else
            ("rad" if way in ("heading", "angle") else "m") for way in ways]  # fmt: skip
    factor = np.array([{"deg": 180 / np.pi, "mm": 1000.0}.get(u, 1.0) for u in unit])
    rows = [",".join(["t [s]", *(f"j{i} [{u}]" for i, u in enumerate(unit))])]
    if not machine.by_file:
        rows = [",".join(["t", *ways])]
    for k in range(round(cell.duration * cell.rate) + 1):
        t = k / cell.rate
        if cell.gap and cell.gap[0] < t < cell.gap[1]:
            continue
        phase = machine.frequency * t + machine.phase + np.arange(len(ways))
        q = (0.3 + machine.amplitude * np.sin(phase)) * factor
        rows.append(",".join([repr(t + cell.start), *(repr(v) if machine.heard else "" for v in q.tolist())]))
    found = {"machine.csv": "\n".join(rows) + "\n"}
    if not machine.by_file:
        found["variables.toml"] = "".join(
            f'[[variables]]\nname = "{way}"\nsource = "plc"\naddress = "{way}"\nunit = "{u}"\n'
            for way, u in zip(ways, unit, strict=True)
        )
    return found


def gripper_file(cell: Cell, gripper: Gripper) -> str:
    """The log of how far each finger is from the middle, as far as the arm's goes."""
    rows = ["t [s],j0 [m]"]
    for k in range(round(cell.duration * cell.rate) + 1):
        t = k / cell.rate
        if not (cell.gap and cell.gap[0] < t < cell.gap[1]):
            side = 0.025 + 0.02 * np.sin(gripper.frequency * t + gripper.phase)
            rows.append(f"{t + cell.start!r},{float(side)!r}")
    return "\n".join(rows) + "\n"


def stop_of(cell: Cell) -> str:
    """How the arm stops: within a time, or joint by joint as a table says."""
    if not cell.brakes:
        carried = cell.machine is not None and cell.machine.carries
        return f"reaction = 0.1, stopping = 0.2{', acceleration = 2.0' * carried}"
    full, shares = 6.0, np.arange(0.1, 1.01, 0.1)

    def grid(values: np.ndarray) -> str:
        return str([[[float(x)]] for x in values])

    joints = ", ".join(
        f"{{ joint = {j}, full_speed = {full}, speed = {shares.round(3).tolist()}, "
        f"way = {grid((shares * full) ** 2 / 2 / a)}, time = {grid(shares * full / a)} }}"
        for j, a in enumerate(cell.brakes)
    )
    head = f'robot = "{cell.names[0]}", category = 1, source = "s", confidence = "1S", rated_payload = 90.0'
    said = f'table_for = "{cell.names[0]}"'
    return f'reaction = 0.1, {said}, model = "table", table = {{ {head}, joints = [{joints}] }}'


def machine_criteria(cell: Cell) -> dict[str, str]:
    """What is asked of the machine: speed, energy, distance, separation, contact."""
    cart, op, limits = cell.cart, cell.names[1], cell.limits
    return {
        "cart speed": f'kind = "velocity"\nof = "{cart}"\nlimit = {limits["speed"]!r}\n',
        "cart energy": f'kind = "kinetic_energy"\nrobot = "{cart}"\nlimit = {limits["energy"]!r}\n',
        "cart distance": f'kind = "minimum_distance"\nbetween = ["{cart}", "{op}"]\n'
        + _length(cell, "limit", limits["distance"])
        + _length(cell, "uncertainty", cell.uncertainty),
        "cart separation": f'kind = "separation"\nbetween = ["{cart}", "{op}"]\n'
        "stop = { reaction = 0.1, stopping = 0.2, acceleration = 2.0 }\n"
        + _length(cell, "intrusion", 0.1)
        + _length(cell, "human_uncertainty", 0.02 + cell.uncertainty)
        + _length(cell, "robot_uncertainty", 0.01),
        "cart contact": f'kind = "power_and_force"\nrobot = "{cart}"\nhuman = "{op}"\n'
        f"contact_area = {{ {cart} = 1e-4 }}\nlargest_area = 1e-4\ndrive_force = 20\n",
    }


def files(cell: Cell) -> dict[str, str]:
    """The folder of the workstation."""
    arm, op = cell.names
    x, y, yaw = cell.person.tolist()
    tolerance = f"mass_tolerance = {cell.mass_tolerance!r}\n" if cell.mass_tolerance else ""
    tip = "" if cell.tool is not None or cell.library else 'tool = "tip"\n'
    model = f"library:{cell.library}" if cell.library else "arm.urdf"
    end = LIBRARY[cell.library][1] if cell.library else "tip"
    machine = cell.machine
    base = f"base = {_place(cell, 0, 0, 0.8, 0)}\n"
    if machine is not None and machine.carries:
        base = f'on = "{cell.cart}"\nbase = {{ position = [0, 0, {machine.height / 2 + 0.02}] }}\n'
    tables = [
        f'[[robots]]\nname = "{arm}"\nmodel = "{model}"\n{tip}{tolerance}{base}',
        f'[[humans]]\nname = "{op}"\nstature = {cell.stature!r}\nmass = 75\nsex = "male"\n'
        f"at = {_place(cell, x, y, 0.0, yaw)}\n",
        f'[[areas]]\nname = "side"\nshape = {{ box = [1.0, 1.0, 2.0] }}\n'
        f"at = {_place(cell, 0.9, 0, 1.0, 0)}\n",
    ]
    if cell.tool is not None:
        tables.append(
            f'[[tools]]\nname = "tool"\non = "{arm}/{end}"\nshape = {{ box = [0.06, 0.06, 0.06] }}\n'
            f"mass = {cell.tool!r}\ntcp = {{ position = [0, 0, 0.05] }}\n"
        )
    if cell.gripper is not None:
        on = "tool" if cell.tool is not None else f"{arm}/{end}"
        tables.append(
            f'[[machines]]\nname = "hand"\non = "{on}"\nat = {{ position = [0, 0, 0.07] }}\n'
            f"shape = {{ box = [0.02, 0.02, 0.06] }}\nmass = {cell.gripper.mass!r}\n"
            "grip = { lower = 0, upper = 0.1 }\n"
        )
        tables.append('[[sources]]\nkind = "csv"\nrobot = "hand"\nfile = "hand.csv"\n')
    if cell.post is not None:
        tables.append(
            '[[parts]]\nname = "post"\nshape = { box = [0.1, 0.1, 2.0] }\n'
            f"at = {_place(cell, *cell.post.tolist(), 1.0, 0)}\n"
        )
    if cell.live:
        tables.append(
            f'[[sources]]\nkind = "rtde"\nrobot = "{arm}"\nhost = "127.0.0.1"\nfrequency = {cell.rate!r}\n'
        )
    elif cell.heard:
        tables.append(f'[[sources]]\nkind = "csv"\nrobot = "{arm}"\nfile = "motion.csv"\n')
    found = {"motion.csv": motion(cell)}
    if cell.gripper is not None:
        found["hand.csv"] = gripper_file(cell, cell.gripper)
    if machine is not None:
        tables += machine_tables(cell, machine)
        found |= machine_files(cell, machine)
    if cell.links:
        found["arm.urdf"] = urdf(cell)
    if cell.walks:
        tables.append(f'[[sources]]\nkind = "keyframes"\nhuman = "{op}"\nfile = "person.toml"\n')
        found["person.toml"] = (
            'title = "reach"\n[[keyframes]]\nt = 0.0\nposture = "standing"\n'
            f'[[keyframes]]\nt = {cell.duration!r}\nposture = "reach_forward"\n'
        )
    limits = cell.limits
    carried = machine is not None and machine.carries
    criteria = {
        "speed": f'kind = "velocity"\nat = "{arm}"\nlimit = {limits["speed"]!r}\n',
        "fastest": f'kind = "velocity"\nof = "{arm}"\nlimit = {limits["speed"]!r}\n',
        "energy": f'kind = "kinetic_energy"\nrobot = "{arm}"\nlimit = {limits["energy"]!r}\n',
        "distance": f'kind = "minimum_distance"\nbetween = ["{arm}", "{op}"]\n'
        + _length(cell, "limit", limits["distance"])
        + _length(cell, "uncertainty", cell.uncertainty),
        "separation": f'kind = "separation"\nbetween = ["{arm}", "{op}"]\n'
        + f"stop = {{ {stop_of(cell)} }}\n"
        + _length(cell, "intrusion", 0.1)
        + _length(cell, "human_uncertainty", 0.02 + cell.uncertainty)
        + _length(cell, "robot_uncertainty", 0.01),
        "area": f'kind = "safety_area"\narea = "side"\nof = "{arm}"\n'
        + _length(cell, "tolerance", 0.001 + cell.uncertainty),
        "felt": f'kind = "effective_mass"\nat = "{arm}"\ntoward = "{op}"\nlimit = {limits["mass"]!r}\n',
        "contact": f'kind = "power_and_force"\nrobot = "{arm}"\n'
        + (
            'excluded = ["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]\n'
            if cell.anyone
            else f'human = "{op}"\n'
        )
        + f"contact_area = {{ {arm} = 1e-4{', tool = 1e-4' if cell.tool is not None else ''} }}\n"
        "largest_area = 1e-4\n" + "drive_force = 20\n" * carried,
    } | ({} if machine is None else machine_criteria(cell))
    if cell.gripper is not None:
        criteria |= {
            "hand speed": f'kind = "velocity"\nof = "hand"\nlimit = {limits["speed"]!r}\n',
            "hand distance": f'kind = "minimum_distance"\nbetween = ["hand", "{op}"]\n'
            + _length(cell, "limit", limits["distance"])
            + _length(cell, "uncertainty", cell.uncertainty),
        }
    if cell.walks:
        criteria["posture"] = f'kind = "owas"\nhuman = "{op}"\n'
    asked = [(name, text) for name, text in criteria.items() if name not in cell.left_out]
    if cell.turned_tables:
        tables, asked = tables[::-1], asked[::-1]
    for name, text in asked:
        group = "ergonomics" if name == "posture" else "safety"
        period = "" if cell.every is None else f"every = {cell.every!r}\n"
        tables.append(f'[[{group}]]\nname = "{name}"\n{period}{text}')
    phase = '[[phases]]\ntitle = "all"\nstart = 0.0\nload = 1.0\nlegs = "posture"\n' * cell.walks
    spoken = machine is not None and not machine.by_file
    head = (
        'variables = "variables.toml"\n' * spoken
        + f"[engine]\ntimestep = 0.001\ntick = {cell.tick!r}\nphysics = {str(cell.physics).lower()}\n"
        + _gravity(cell)
    )
    found["workstation.toml"] = "\n".join([head, *tables, phase, cell.more])
    return found


# -- what they say ------------------------------------------------------------------------------


def _gravity(cell: Cell) -> str:
    """Along the tilted vertical, which is meant."""
    if not cell.tilt:
        return ""
    down = (_about_x(cell.tilt) @ np.array([0.0, 0.0, -9.81])).tolist()
    return (
        f'gravity = {down}\n[[confirmed]]\nkey = "engine.gravity.turned"\nvalue = {abs(cell.tilt)!r}\n'
        'why = "the hall leans"\n'
    )


def station(cell: Cell, folder: Path) -> Station:
    """The cell, read and compiled."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files(cell).items():
        (folder / name).write_text(text)
    return load(folder, allow_plugins=True)


ALL = (
    "speed", "fastest", "energy", "distance", "separation", "area", "felt", "contact", "posture",
    "cart speed", "cart energy", "cart distance", "cart separation", "cart contact", "hand speed",
    "hand distance",
)  # fmt: skip
"""Names of all criteria."""
_kept: dict[tuple[str, ...], ResultLog] = {}
"""What cells that many relations are asked of said, by their files."""
KEPT = 32


def said(cell: Cell, folder: Path) -> ResultLog:
    """What every criterion says over the run; a cell that was run of late is not run again."""
    key = tuple(files(cell).values())
    if key not in _kept:
        while len(_kept) >= KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = station(cell, folder).run().results
    return _kept[key]


def least_margin(series: Series) -> float:
    """Least distance to the limit over the run, negative beyond it; nan without figures.

    A figure that only informs is compared by itself; instants without a limit of one that is judged are left
    out.
    """
    limits, values = series.limits, series.values
    limits = np.nan_to_num(limits) if series.verdict is None else limits
    margins = limits - values if series.at_most else values - limits
    return float(np.nanmin(margins)) if np.isfinite(margins).any() else np.nan


# -- what is done to them -----------------------------------------------------------------------


def heavier(cell: Cell) -> Cell:
    """Links and tool half as heavy again."""
    links = tuple(
        replace(k, inertial=Inertial(1.5 * k.inertial.mass, k.inertial.com, 1.5 * k.inertial.inertia))
        for k in cell.links
    )
    machine = cell.machine and replace(cell.machine, mass=1.5 * cell.machine.mass)
    hand = cell.gripper and replace(cell.gripper, mass=1.5 * cell.gripper.mass)
    tool = None if cell.tool is None else 1.5 * cell.tool
    return replace(cell, links=links, machine=machine, tool=tool, gripper=hand)


def mirrored(cell: Cell) -> Cell:
    """Left and right exchanged: a random arm, the person and what is around, without machines."""
    over, turned = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])

    def link(k: Link) -> Link:
        # An axis to turn about is a pseudovector: the sense of turning changes, too.
        axis = k.axis * (turned if k.kind == "revolute" else over)
        inertial = k.inertial and replace(k.inertial, com=k.inertial.com * over)
        return replace(k, origin=k.origin * over, axis=axis, middle=k.middle * over, inertial=inertial)

    return replace(
        cell,
        links=tuple(map(link, cell.links)),
        person=cell.person * np.array([1.0, -1.0, -1.0]),
        post=None if cell.post is None else cell.post * np.array([1.0, -1.0]),
    )


def thicker(cell: Cell) -> Cell:
    machine = cell.machine and replace(cell.machine, wider=0.04)
    return replace(cell, links=tuple(replace(k, box=k.box + 0.04) for k in cell.links), machine=machine)


def faster(cell: Cell) -> Cell:
    """Twice as fast on the same way, asked at the same places."""
    machine = cell.machine and replace(cell.machine, frequency=2 * cell.machine.frequency)
    return replace(
        cell,
        frequency=2 * cell.frequency,
        rate=2 * cell.rate,
        duration=cell.duration / 2,
        tick=cell.tick / 2,
        machine=machine,
        gripper=cell.gripper and replace(cell.gripper, frequency=2 * cell.gripper.frequency),
    )


def nearer(cell: Cell, name: str, folder: Path) -> tuple[ResultLog, Cell | None]:
    """What the cell says, and it with the person nearer by half of the worst distance, along it.

    None instead where nothing is between them, or only what lies above or below.
    """
    kept = Kept()
    log = station(cell, folder).run(writers=[kept]).results
    series = log[name]
    margins = series.values - series.limits
    if series.verdict is None or not np.isfinite(margins).any():
        return log, None
    shown = kept.snapshots[int(np.nanargmin(margins))]
    (lines,) = ([m for m in r.markers if isinstance(m, Segment)] for r in shown.results if r.name == name)
    if not lines:
        return log, None
    arm, person = np.array([lines[0].start, lines[0].end])
    way = (arm - person)[:2]
    if np.linalg.norm(way) < 0.02:
        return log, None
    return log, replace(cell, person=cell.person + np.array([*(0.5 * way), 0.0]))

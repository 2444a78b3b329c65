"""A made-up workstation for the page's tests: everything is a function of run time."""

from __future__ import annotations

import math

import made_up_person
import numpy as np

from seerob.core.snapshot import (
    Arrow,
    Basis,
    Box,
    CriterionInfo,
    Ellipsoid,
    Finding,
    Highlight,
    Hull,
    Input,
    JointInfo,
    Label,
    MechanismInfo,
    Node,
    Origin,
    Result,
    Scene,
    Segment,
    Snapshot,
    Sphere,
    Verdict,
)
from seerob.description.shapes.glb import glb_bytes, mesh_hash
from seerob.description.shapes.shapes import box_mesh, capsule_mesh

PERIOD = 0.01
TCP_LIMIT = 0.7
HOSTILE = "<img src=x onerror=window.hacked=1>"

# name, parent, axis of the joint ("" when fixed), place in the parent [m], where the link ends [m], radius
ARM = [
    ("base_link", None, "", (0.0, 0.0, 0.8), (0, 0, 0.06), 0.095),
    ("shoulder_link", 0, "z", (0, 0, 0.128), (0, 0, 0.02), 0.08),
    ("upper_arm_link", 1, "y", (0, 0.176, 0), (0, 0, 0.612), 0.06),
    ("forearm_link", 2, "y", (0, -0.128, 0.612), (0, 0, 0.572), 0.05),
    ("wrist_1_link", 3, "y", (0, 0, 0.572), (0, 0.09, 0), 0.045),
    ("wrist_2_link", 4, "z", (0, 0.115, 0), (0, 0, 0.09), 0.045),
    ("wrist_3_link", 5, "y", (0, 0, 0.115), (0, 0.04, 0), 0.045),
]
BODY = [
    ("pelvis", (0, -0.09, 0.95), (0, 0.09, 0.95), 0.11),
    ("torso", (0, 0, 1.08), (0, 0, 1.36), 0.14),
    ("head", (0, 0, 1.6), (0, 0, 1.68), 0.09),
    ("right upper arm", (0, -0.21, 1.4), (-0.05, -0.24, 1.13), 0.045),
    ("right forearm", (-0.05, -0.24, 1.13), (-0.28, -0.18, 1.12), 0.038),
    ("right hand", (-0.3, -0.17, 1.12), (-0.38, -0.15, 1.12), 0.035),
    ("left upper arm", (0, 0.21, 1.4), (0, 0.25, 1.12), 0.045),
    ("left forearm", (0, 0.25, 1.12), (-0.02, 0.26, 0.88), 0.038),
    ("right leg", (0, -0.1, 0.86), (0, -0.1, 0.08), 0.075),
    ("left leg", (0, 0.1, 0.86), (0, 0.1, 0.08), 0.075),
]
SILENT = (17.0, 18.0)
"""When the robot is not heard [s]."""

PARTS = [
    ("table", (-0.4, -0.6, 0.74), (0.9, 0.6, 0.8), (0.45, 0.36, 0.28, 1.0)),
    ("line/fixture/pin_1", (0.55, -0.2, 0.8), (0.59, -0.16, 0.9), (0.5, 0.55, 0.6, 1.0)),
    ("line/fixture/pin_2", (0.55, 0.16, 0.8), (0.59, 0.2, 0.9), (0.5, 0.55, 0.6, 1.0)),
    (HOSTILE, (-0.3, 0.3, 0.8), (-0.1, 0.5, 0.95), (0.3, 0.4, 0.5, 1.0)),
]
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
METAL, SKIN = (0.72, 0.76, 0.8, 1.0), (0.82, 0.62, 0.5, 1.0)

SEPARATION = Basis(
    formula="S_p = v_h (T_r + T_s) + v_r T_r + S_s + C + Z_d + Z_r",
    source="ISO/TS 15066:2016, 5.5.4.2.3, Eq. 2",
    inputs=(
        Input(name="v_h", value=1.6, unit="m/s", origin=Origin.STATED, source="ISO 13855:2010, 5.2"),
        Input(name="T_r", value=0.1, unit="s", origin=Origin.GIVEN, source="workstation.toml"),
        Input(name="T_s", origin=Origin.MISSING, source="nobody gave the stopping time"),
    ),
    not_modelled=("uncertainty of the person's position",),
)


def joints(t: float) -> tuple[float, ...]:
    """Joint positions at run time ``t`` [rad]."""
    w = 2 * math.pi * t / 8.0
    return (0.9 * math.sin(w), 0.6 + 0.2 * math.cos(w), 1.1 + 0.3 * math.sin(2 * w), 1.4, -1.57, w % 6.28)


def _turn(axis: str, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    if axis == "z":
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    return np.array([[c, 0, s], [0, 1.0, 0], [-s, 0, c]]) if axis == "y" else np.eye(3)


def _quaternion(R: np.ndarray) -> tuple[float, float, float, float]:
    # From the largest eigenvector (Bar-Itzhack 2000): no case distinction.
    K = np.array(
        [
            [R[0, 0] + R[1, 1] + R[2, 2], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [0, R[0, 0] - R[1, 1] - R[2, 2], R[1, 0] + R[0, 1], R[0, 2] + R[2, 0]],
            [0, 0, R[1, 1] - R[0, 0] - R[2, 2], R[2, 1] + R[1, 2]],
            [0, 0, 0, R[2, 2] - R[0, 0] - R[1, 1]],
        ]
    )
    wxyz = np.linalg.eigh(K.T)[1][:, -1]
    return tuple(float(x) for x in wxyz * (1 if wxyz[0] >= 0 else -1))


def arm_poses(t: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Position and rotation of each link in the world."""
    poses: list[tuple[np.ndarray, np.ndarray]] = []
    angles = iter(joints(t))
    for _, parent, axis, place, _, _ in ARM:
        p, R = poses[parent] if parent is not None else (np.zeros(3), np.eye(3))
        turn = _turn(axis, next(angles)) if axis else np.eye(3)
        poses.append((p + R @ np.array(place, float), R @ turn))
    return poses


def person_at(t: float) -> np.ndarray:
    """Where the person stands [m]; steps closer every twelve seconds."""
    return np.array([1.75 - 0.45 * max(0.0, math.sin(2 * math.pi * t / 12.0)), -0.1, 0.0])


def workstation(further: int = 0) -> tuple[Scene, dict[str, bytes]]:
    """The scene and its meshes by hash, with so many further boxes that move."""
    meshes: dict[str, bytes] = {}

    def keep(mesh: object) -> str:
        glb = glb_bytes([mesh])
        meshes[mesh_hash(glb)] = glb
        return mesh_hash(glb)

    nodes = [
        Node(
            name=f"ur10/{name}",
            role="robot",
            owner="ur10",
            mover="ur10",
            mesh=keep(capsule_mesh((0, 0, 0), end, radius, color=METAL)),
            triangles=800,
            mass=3.0 if name == "forearm_link" else None,
            mass_origin=Origin.STATED if name == "forearm_link" else Origin.MISSING,
            note="envelope made by seerob, not the maker's mesh",
        )
        for name, _, _, _, end, radius in ARM
    ]
    for name, start, end, radius in BODY:
        mesh = keep(capsule_mesh(start, end, radius, color=SKIN))
        nodes.append(Node(name=f"operator/{name}", role="human", owner="operator", mesh=mesh, triangles=800))
    for name, lower, upper, color in PARTS:
        mesh = keep(box_mesh(lower, upper, color=color))
        owner = name.split("/")[0]
        real = name == "table"
        nodes.append(
            Node(name=name, role="part", owner=owner, mesh=mesh, triangles=12, moves=False, real=real)
        )
    room = keep(box_mesh((-0.7, -0.8, 0.7), (0.1, 0.8, 1.9)))
    nodes.append(
        Node(name="robot side", role="area", owner="robot side", mesh=room, triangles=12, moves=False)
    )
    box = keep(box_mesh((-0.02, -0.02, -0.02), (0.02, 0.02, 0.02)))
    nodes += [
        Node(name=f"box_{k}", role="part", owner=f"box_{k}", mesh=box, triangles=12) for k in range(further)
    ]
    criteria = (
        _criterion("separation", "separation", "m", at_most=False, basis=SEPARATION),
        _criterion("tcp speed", "velocity", "m/s", limit=TCP_LIMIT),
        _criterion("arm energy", "kinetic_energy", "J", limit=20.0),
        _criterion("effective mass", "effective_mass", "kg", limit=5.0),
        _criterion("manipulability", "manipulability", ""),
        _criterion("work area", "area", "m", at_most=False, limit=0.0),
        *made_up_person.criteria(),
    )
    findings = (
        Finding(level="assumed", subject="ur10/tool0", text="no payload given; 0 kg assumed"),
        Finding(level="warning", subject="table", text="mesh was open; 2 holes closed"),
        Finding(level="note", subject=HOSTILE, text=f"name taken from the file: {HOSTILE}"),
    )
    mechanisms = (
        MechanismInfo(
            name="ur10",
            role="robot",
            joints=tuple(JointInfo(name=n, unit="rad", lower=-6.28, upper=6.28) for n in JOINTS),
        ),
    )
    scene = Scene(
        title=f"UR10 assembly {HOSTILE}",
        edition="ISO/TS 15066:2016",
        version="0.1.0",
        workstation_hash="5e" * 32,
        period=PERIOD,
        nodes=tuple(nodes),
        mechanisms=mechanisms,
        criteria=criteria,
        findings=findings,
    )
    return scene, meshes


def _criterion(
    name: str,
    kind: str,
    unit: str,
    *,
    limit: float | None = None,
    at_most: bool = True,
    basis: Basis | None = None,
) -> CriterionInfo:
    return CriterionInfo(
        name=name,
        kind=kind,
        group="safety",
        title=f"{name.capitalize()} of the robot.",
        subjects=("ur10", "operator"),
        unit=unit,
        limit=limit,
        at_most=at_most,
        basis=basis or Basis(formula=f"{kind}(q, qd)", source="the paper"),
    )


def _judge(value: float, limit: float, *, at_most: bool) -> Verdict:
    return Verdict.WITHIN if (value <= limit if at_most else value >= limit) else Verdict.EXCEEDED


def _vec(a: np.ndarray) -> tuple[float, float, float]:
    return float(a[0]), float(a[1]), float(a[2])


def snapshot(seq: int, t: float, further: int = 0) -> Snapshot:
    """The snapshot of run time ``t`` [s], with so many further boxes."""
    arm = arm_poses(t)
    person = person_at(t)
    block = [(*p, *_quaternion(R)) for p, R in arm]
    block += [(*person, 1, 0, 0, 0)] * len(BODY) + [(0, 0, 0, 1, 0, 0, 0)] * (len(PARTS) + 1)
    block += [
        (math.cos(t + k), math.sin(t + k), 0.1 + 0.05 * k, math.cos(t), 0, 0, math.sin(t))
        for k in range(further)
    ]
    tcp, hand = arm[-1][0], person + np.array([-0.38, -0.15, 1.12])
    v = (arm_poses(t + 1e-4)[-1][0] - arm_poses(t - 1e-4)[-1][0]) / 2e-4
    distance, speed = float(np.linalg.norm(tcp - hand)), float(np.linalg.norm(v))
    near, quick = 0.5 + 0.2 * speed, _judge(speed, TCP_LIMIT, at_most=True)
    apart = _judge(distance, near, at_most=False)
    energy = 12.0 * speed**2
    results = (
        Result(
            name="separation",
            value=distance,
            unit="m",
            limit=near,
            at_most=False,
            verdict=apart,
            reason="wrist_3_link ↔ right hand",
            interval=(distance - 0.01, distance + 0.01),
            markers=(
                Segment(start=_vec(tcp), end=_vec(hand), label=f"{distance * 1e3:.0f} mm", verdict=apart),
                Sphere(center=_vec(hand), radius=0.08, verdict=apart),
                Highlight(body="operator/right hand", verdict=apart),
            ),
        ),
        Result(
            name="tcp speed",
            value=speed,
            unit="m/s",
            limit=TCP_LIMIT,
            verdict=quick,
            markers=(Arrow(origin=_vec(tcp), vector=_vec(v * 0.4), label="v", verdict=quick),),
        ),
        Result(
            name="arm energy",
            value=energy,
            unit="J",
            limit=20.0,
            verdict=_judge(energy, 20.0, at_most=True),
            parts=tuple(
                Result(name=f"ur10/{row[0]}", value=energy * (i + 1) / 28, unit="J")
                for i, row in enumerate(ARM)
            ),
        ),
        Result(
            name="effective mass",
            unit="kg",
            limit=5.0,
            verdict=Verdict.UNDECIDED,
            reason=f"mass of ur10/shoulder_link was given by nobody {HOSTILE}",
        ),
        Result(
            name="manipulability",
            value=abs(math.sin(joints(t)[2])) * 0.2,
            markers=(Ellipsoid(center=_vec(tcp), wxyz=_quaternion(arm[-1][1]), radii=(0.2, 0.12, 0.06)),),
        ),
        Result(
            name="work area",
            value=0.3,
            unit="m",
            limit=0.0,
            at_most=False,
            verdict=Verdict.WITHIN,
            markers=(
                Box(
                    center=(0.3, 0.0, 1.3),
                    wxyz=(1, 0, 0, 0),
                    size=(2.0, 1.6, 1.2),
                    label="area",
                    verdict=Verdict.WITHIN,
                ),
                Hull(
                    vertices=((-0.4, 0.5, 0.8), (-0.1, 0.5, 0.8), (-0.2, 0.2, 0.8), (-0.2, 0.4, 1.1)),
                    faces=((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
                    verdict=Verdict.UNDECIDED,
                ),
                Highlight(body="robot side", verdict=Verdict.WITHIN),
                Label(position=(0.3, 0.0, 1.95), text=HOSTILE, verdict=None),
            ),
        ),
    )
    return Snapshot(
        seq=seq,
        t=t,
        poses=np.array(block, "<f4").tobytes(),
        joints={"ur10": joints(t)},
        tracking={"ur10": 1e-4},
        doubts={"ur10": f"ur10: not heard for {t - SILENT[0]:.2f} s (time-out 0 s)"}
        if SILENT[0] <= t < SILENT[1]
        else {},
        results=(*results, *made_up_person.results(t, speed, distance)),
    )

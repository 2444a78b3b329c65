"""One small file of every format that a workstation's robots, parts, motions and tables come in."""

import base64
import json
import sys
import zipfile
from importlib import resources
from pathlib import Path

import msgspec
import numpy as np

from seerob.app.importing.plant import Made
from seerob.core.errors import InputError
from seerob.criteria.contact import measured
from seerob.description.formats import automationml
from seerob.description.loader import load_robot
from seerob.description.mesh import load_meshes
from seerob.description.norms import body_limits
from seerob.description.robots.calibration import read_calibration
from seerob.devices.sources.bag import Bag
from seerob.devices.sources.csv import Csv
from seerob.devices.sources.excel import Excel
from seerob.devices.sources.kuka_log import KukaLog
from seerob.devices.sources.robodk import Robodk
from seerob.devices.sources.signals_csv import SignalsCsv
from seerob.devices.sources.tool_path import ToolPath
from seerob.devices.sources.ur_record import UrRecord
from seerob.files.trajectories import path_map
from seerob.session import reading
from seerob.workstation import variables
from seerob.workstation.source import Target
from seerob.workstation.tables.controller_zones import zones_of
from soak.made_files import FILES, Malformed, _lines, _said, _workbook
from soak.mutations import mutated, mutated_text, mutated_zip

sys.path.insert(0, str(Path(__file__).parents[1] / "sources"))

from made_motion import DOF, motion, target

URDF = """<robot name="a"><material name="m"><color rgba="1 0 0 1"/></material>
<link name="base"><visual><geometry><box size="0.1 0.2 0.3"/></geometry><material name="m"/></visual></link>
<link name="l"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="1.5"/>
<inertia ixx="0.01" iyy="0.01" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.1"/><geometry><cylinder radius="0.05" length="0.2"/></geometry></collision>
</link><link name="f"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="l"/><origin xyz="0 0 0.2" rpy="0 1.5 0"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="50" velocity="2"/><dynamics damping="0.1"/></joint>
<joint name="k" type="prismatic"><parent link="l"/><child link="f"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.1" effort="5" velocity="1"/><mimic joint="j" multiplier="0.1" offset="0.01"/>
</joint></robot>"""
XACRO = """<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="n" default="2"/>
<xacro:property name="r" value="0.05"/><link name="base"/>
<xacro:macro name="arm" params="k *more"><link name="l${k}"><xacro:insert_block name="more"/>
<collision><geometry><sphere radius="${r*k + 0.1}"/></geometry></collision></link>
<joint name="j${k}" type="continuous"><parent link="base"/><child link="l${k}"/></joint></xacro:macro>
<xacro:if value="${1 &lt; 2}"><xacro:arm k="$(arg n)"><inertial><mass value="${1 + 2.5}"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></xacro:arm></xacro:if>
</robot>"""
MJCF = """<mujoco model="a"><compiler angle="degree" autolimits="true"/>
<default><joint damping="0.1"/><default class="c"><geom rgba="1 0 0 1" density="500"/></default></default>
<worldbody><body name="base" pos="0 0 0.1"><geom type="box" size="0.1 0.1 0.1"/>
<body name="l" pos="0 0 0.2" euler="0 90 0"><joint name="j" type="hinge" axis="0 0 1" range="-90 90"/>
<inertial pos="0 0 0.1" mass="1.5" diaginertia="0.01 0.01 0.005"/>
<geom class="c" type="capsule" fromto="0 0 0 0 0 0.3" size="0.05"/>
<body name="f" pos="0 0 0.3"><joint name="k" type="slide" axis="1 0 0" range="0 0.1"/>
<geom type="sphere" size="0.05" mass="0.2"/><site name="s" pos="0 0 0.1"/></body></body></body></worldbody>
<actuator><motor joint="j" ctrlrange="-50 50" gear="2"/></actuator></mujoco>"""
AML = (
    '<CAEXFile SchemaVersion="2.15"><InstanceHierarchy Name="P"><InternalElement Name="L" ID="{A}">'
    '<Attribute Name="Frame"><Attribute Name="x" Unit="mm"><Value>1000</Value></Attribute>'
    '<Attribute Name="rz" Unit="deg"><Value>90</Value></Attribute></Attribute>'
    '<InternalElement Name="B" ID="{B}"><ExternalInterface Name="S" RefBaseClassPath="X/VariableInterface">'
    '<Attribute Name="refURI" AttributeDataType="xs:double" Unit="mm/s"><Value>DB1.S</Value></Attribute>'
    '</ExternalInterface><InternalLink Name="l" RefPartnerSideA="{A}:S" RefPartnerSideB="{B}:S"/>'
    "</InternalElement></InternalElement></InstanceHierarchy></CAEXFile>"
)
STATION = (resources.files("seerob.app.commands") / "starter" / "workstation.toml").read_text()
DICTIONARY = """[[variables]]
name = "belt/speed"
source = "plc"
unit = "m/min"
range = [0, 30]
address = { browse = ["a", "b"] }
[[variables]]
name = "belt/state"
source = "plc"
address = 4
type = "choice"
choices = { 0 = "idle", 1 = "running" }
timeout_ms = 200
"""
ZONES = """source = "controller, 0x1234"
on = "ur10/base_link"
[[zones]]
name = "a"
polygon = [[0, 0], [1000e-3, 0], [1, 1]]
height = [0, 2.5]
[[zones]]
name = "b"
low = [0, 0, 0]
high = [1, 1.5, 2]
"""
MEASURED = """[[measurements]]
part = "arm/l2"
region = "Chest"
contact = "free"
speed = 0.45
force_N = 200
pressure_N_cm2 = 150.5
device = "PFMD 7"
spring_N_mm = 25
date = 2026-03-01
calibrated = 2025-09-01
"""
CALIBRATION = """theta = [0.0001, 0, 0, 0, 0, 0]
a = [0, -0.6, -0.57, 0, 0, 0]
d = [0.128, 0, 0, 0.16, 0.11, 0.09]
alpha = [1.57, 0, 0, 1.57, -1.57, 0]
"""


def _robot(path):
    robot = load_robot(path.name, folder=path.parent)
    for link in robot.links:
        assert link.inertial is None or np.isfinite(link.inertial.mass)
        assert np.isfinite(link.parent_from_link).all()


def _meshes(path):
    for mesh in load_meshes(path, units="m", up="z").plain():
        assert np.isfinite(mesh.vertices).all()
        assert 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)


def _box(form, **options):
    def write(path):
        import trimesh

        box = trimesh.creation.box((0.2, 0.3, 0.4))
        data = trimesh.Scene(box).export(file_type=form) if form in {"glb", "3mf"} else box.export(
            file_type=form, **options
        )  # fmt: skip
        path.write_bytes(data if isinstance(data, bytes) else data.encode())

    return write


def _gltf(path):
    import trimesh

    data = trimesh.Scene(trimesh.creation.box((0.2, 0.3, 0.4))).export(file_type="gltf")
    tree = json.loads(data["model.gltf"])
    for buffer in tree["buffers"]:
        held = base64.b64encode(data[buffer["uri"]]).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{held}"
    path.write_text(json.dumps(tree))


def _packed_plant(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        archive.writestr(
            "_rels/.rels",
            '<Relationships><Relationship Type="http://schemas.automationml.org/container/relationship/Root" '
            'Target="/cell.aml"/></Relationships>',
        )
        archive.writestr("cell.aml", AML)


def _plant(path):
    Made(automationml.read(path)).files()


def _heard(opened):
    for sample in opened.samples:
        assert np.isfinite(sample.t)


def _motion(kind, dof=DOF, **options):
    who = msgspec.structs.replace(target(dof), world_from_base=np.eye(4))

    def read(path):
        _heard(kind(robot="ur10", file=path.name, **options).open(path.parent, who))

    return read


def _table(head, columns, by=",", n=8):
    def write(path):
        path.write_text(_lines(head, *np.round(columns(n), 6).tolist(), by=by))

    return write


def _joints(n):
    t, q, _ = motion(n)
    return np.column_stack([t, q])


def _record(n):
    t, q, qd = motion(n)
    return np.column_stack([t + 4029.5, q, qd])


def _kuka(path):
    t, q, _ = motion(8, 0.005, 7)
    head = ["ZeitInSec", "ZeitInNanoSec", *(f"axisQMsr_a[{i}]" for i in range(7))]
    rows = ([1450000000, int(s * 1e9), *np.degrees(r).round(4)] for s, r in zip(t, q, strict=True))
    path.write_text("% " + _lines(head, *rows, by=" "))


def _robodk(path):
    t, q, _ = motion(8, 0.02)
    head = [*(f"J{i + 1}" for i in range(DOF)), "ERROR", "MM_STEP", "DEG_STEP", "MOVE_ID", "TIME", *"XYZ"]
    rows = (
        [*np.degrees(r).round(4), 0, 1, 1, 1, s, 500, 500, 500] for s, r in zip(t.round(4), q, strict=True)
    )
    path.write_text(_lines(head, *rows))


def _tool_path(path):
    t = np.arange(8) * 0.01
    rows = ([s, 600 + s, 1, 500, 1, 0, 0, 0] for s in t.round(4))
    path.write_text(_lines(["time [s]", "x [mm]", "y [mm]", "z [mm]", "qw", "qx", "qy", "qz"], *rows))


def _signals(path):
    known = (
        variables.Variable(name="belt/speed", source="plc", address="v", unit="mm/s", range=(0, 1000)),
        variables.Variable(name="clear", source="plc", address="c", type=variables.Kind.BOOL),
    )
    source = SignalsCsv(name="plc", file=path.name, time="t", time_unit="ms")
    _heard(source.open(path.parent, Target(variables=known)))


def _excel(path):
    _, q, _ = motion(8)
    rows = ([k / 100, *r.round(4)] for k, r in enumerate(q))
    _workbook(path, (["Time [s]", *(f"J{i + 1} [rad]" for i in range(DOF))], *rows))


def _map(path):
    head = [path_map.PIECE, path_map.PERMISSIBLE, path_map.TOOL_PERMISSIBLE, path_map.TOOL_GIVEN]
    head += [*path_map.TOOL, *path_map.joint_columns(("rad", "rad")), *path_map.WHO, path_map.WHY]
    rows = ([0, 0.5, 0.25, 1, k / 10, 0, 1, k / 10, 0, "v", "", "", "", ""] for k in range(4))
    path.write_text(_lines(head, *rows))


def _station(path):
    (path.parent / "m.csv").touch()
    reading.read(path)


def _zones(path):
    problems = []
    zones_of(path.name, path.parent, "w", problems)
    if problems:
        raise InputError(problems)


def _limits(path):
    path.write_bytes(resources.files("seerob.description.norms").joinpath(body_limits.SHIPPED).read_bytes())


def _bag(path):
    from rosbags.rosbag1 import Writer

    from seerob.protocols.ros.ros_messages import Content, Edition, Joints, encode, store

    path.unlink(missing_ok=True)
    with Writer(path) as writer:
        kind = Content.JOINT_STATE
        topic = writer.add_connection("/joint_states", kind.message_type, typestore=store(Edition.ROS1))
        names = target().joints
        for k in range(4):
            said = Joints(100 + k / 50, names, (0.1 * k,) * DOF, (), ())
            writer.write(topic, round((100 + k / 50) * 1e9), encode(kind, said, Edition.ROS1))


CELLS = {
    "urdf": Malformed("urdf", _said(URDF), _robot),
    "mjcf": Malformed("xml", _said(MJCF), _robot),
    "xacro": Malformed("xacro", _said(XACRO), _robot),
    "stl": Malformed("stl", _box("stl"), _meshes, mutated),
    "stl text": Malformed("stl", _box("stl_ascii"), _meshes),
    "obj": Malformed("obj", _box("obj"), _meshes),
    "ply": Malformed("ply", _box("ply"), _meshes, mutated),
    "ply text": Malformed("ply", _box("ply", encoding="ascii"), _meshes),
    "off": Malformed("off", _box("off"), _meshes),
    "glb": Malformed("glb", _box("glb"), _meshes, mutated_text),
    "gltf": Malformed("gltf", _gltf, _meshes),
    "dae": Malformed("dae", _box("dae"), _meshes),
    "3mf": Malformed("3mf", _box("3mf"), _meshes, mutated_zip),
    "automationml": Malformed("aml", _said(AML), _plant),
    "automationml container": Malformed("amlx", _packed_plant, _plant, mutated_zip),
    "motion csv": Malformed(
        "csv", _table(["Time [s]", *(f"J{i + 1} [rad]" for i in range(DOF))], _joints), _motion(Csv)
    ),
    "motion xlsx": Malformed("xlsx", _excel, _motion(Excel), mutated_zip),
    "ur record": Malformed(
        "csv",
        _table(["timestamp", *(f"actual_{k}_{i}" for k in ("q", "qd") for i in range(DOF))], _record, by=" "),
        _motion(UrRecord),
    ),
    "kuka log": Malformed("log", _kuka, _motion(KukaLog, 7)),
    "robodk": Malformed("csv", _robodk, _motion(Robodk)),
    "tool path": Malformed("csv", _tool_path, _motion(ToolPath, frame="world")),
    "signals csv": Malformed("csv", _said("t,v,c\n1000,250,1\n1100,,0\n1250,900,\n"), _signals),
    "ros bag": Malformed("bag", _bag, _motion(Bag), mutated),
    "permissible speeds": Malformed(
        "csv", _map, lambda path: path_map.read_map(path.read_bytes(), name="m", units=("rad", "rad"))
    ),
    "workstation": Malformed("toml", _said(STATION), _station),
    "variables": Malformed("toml", _said(DICTIONARY), lambda path: variables.read(path)),
    "zones of a controller": Malformed("toml", _said(ZONES), _zones),
    "measured contacts": Malformed("toml", _said(MEASURED), lambda path: measured.read(path)),
    "measured curve": Malformed(
        "csv",
        _said("Time [ms]; Force [N]\n" + "".join(f"{k};{min(k, 20 - k) * 10}\n" for k in range(20))),
        lambda path: measured.read_curve(path, "c"),
    ),
    "calibration": Malformed(
        "toml", _said(CALIBRATION), lambda path: read_calibration(path.read_bytes(), path.name)
    ),
    "body limits": Malformed("toml", _limits, lambda path: body_limits.read(path)),
}


KINDS = {**FILES, **CELLS}

"""Files that unpack to more than they say or than anybody has, and figures that no arithmetic bears."""

from __future__ import annotations

import gzip
import json
import re
import struct
import subprocess
import sys
import zipfile
import zlib
from functools import partial
from pathlib import Path

import pytest

import seerob as sr
from seerob.core.errors import InputError
from seerob.core.files import bounded, parser_process
from seerob.core.files.parser_process import parsed
from seerob.core.files.toml_file import read_toml
from seerob.core.printable import printable
from seerob.description import mesh_files as mesh_source
from seerob.description.capture.mapping import read_conventions
from seerob.description.loader import load_robot
from seerob.description.mesh import load_meshes
from seerob.description.norms import body_limits
from seerob.description.robots.calibration import read_calibration
from seerob.files.motion_capture import ros_bag
from seerob.files.tables.table_files import MAX_LEFT_OUT, sheets
from seerob.outputs.html import text
from soak import made_cells

HUGE = 1 << 30
ROBOT = (
    '<robot name="a"><link name="base"/><link name="l"><inertial><mass value="1"/>{}</inertial></link>'
    '<joint name="j" type="continuous"><parent link="base"/><child link="l"/></joint></robot>'
)
READ = """
import resource, sys
from pathlib import Path
from seerob.core.errors import InputError
import {module}
begun = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    {call}
except InputError as error:
    print(error)
else:
    print("read")
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - begun) >> 10)
"""


def zeros(size):
    """Deflated zeros, made without holding them."""
    packed, piece = zlib.compressobj(9, zlib.DEFLATED, -15), bytes(1 << 20)
    return b"".join([*(packed.compress(piece) for _ in range(size >> 20)), packed.flush()])


def with_lies(path, members, lie=None):
    """An archive whose member ``lie`` unpacks to `HUGE` bytes while its directory says 100."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    data = zeros(HUGE)
    with zipfile.ZipFile(path, "a") as archive:
        info = zipfile.ZipInfo(lie)
        archive.writestr(info, data)  # as it is
        info.compress_type, info.file_size = zipfile.ZIP_DEFLATED, 100
    raw = bytearray(path.read_bytes())
    local = raw.index(lie.encode()) - 30
    raw[local + 8 : local + 10] = (8).to_bytes(2, "little")
    path.write_bytes(raw)


def asked(module, call):
    """What a process of its own says of a file, and by how many MiB it grew."""
    done = subprocess.run(
        [sys.executable, "-c", READ.format(module=module, call=call)],
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    *said, grown = done.stdout.splitlines()
    return " ".join(said), int(grown)


def test_a_3mf_whose_directory_lies_about_sizes_is_refused_after_a_piece(tmp_path):
    path = tmp_path / "a.3mf"
    with_lies(path, {"[Content_Types].xml": "<x/>"}, "3D/3dmodel.model")
    with pytest.raises(zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
        bounded.unpacked(archive, "3D/3dmodel.model", HUGE)
    said, grown = asked(
        "seerob.description.mesh", f"seerob.description.mesh.load_meshes(Path({str(path)!r}))"
    )
    assert str(path) in said
    assert grown < 200


def test_a_workbook_that_unpacks_to_a_thousand_times_its_size_is_refused(tmp_path):
    path = tmp_path / "a.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", "<x/>")
        with archive.open("xl/worksheets/sheet1.xml", "w") as file:
            for _ in range(HUGE >> 20):
                file.write(bytes(1 << 20))
    assert path.stat().st_size < 2 << 20
    said, grown = asked(
        "seerob.files.tables.table_files",
        f"seerob.files.tables.table_files.sheets(Path({str(path)!r}), 'a.xlsx')",
    )
    assert "a.xlsx: unpacks to more than" in said
    assert grown < 200


def test_a_row_number_that_no_sheet_has_is_refused_after_few_rows(tmp_path):
    from openpyxl import Workbook

    path, made = tmp_path / "a.xlsx", tmp_path / "b.xlsx"
    book = Workbook()
    book.active.append([1, 2])
    book.active.append([3, 4])
    book.save(path)
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            if name.endswith("sheet1.xml"):
                content = content.replace(b'r="2"', b'r="999999999"')
            new.writestr(name, content)
    assert len(list(sheets(path, "a.xlsx")[0].rows())) == 2
    with pytest.raises(InputError, match=f"leaves out more than {MAX_LEFT_OUT} rows"):
        list(sheets(made, "b.xlsx")[0].rows())


@pytest.mark.parametrize("figures", ['ixx="1" iyy="1e308" izz="1"', 'ixx="1" iyy="1" izz="1" ixy="-1e300"'])
def test_a_moment_of_inertia_that_nothing_has_is_refused_by_its_link(tmp_path, figures):
    (tmp_path / "a.urdf").write_text(ROBOT.format(f"<inertia {figures}/>"))
    with pytest.raises(InputError, match=r"a\.urdf: link\[l\]\.inertial: has a figure beyond 1e\+09"):
        load_robot("a.urdf", folder=tmp_path)


@pytest.mark.parametrize("name", ["x" * 300 + ".urdf", "x/" * 3000 + ".urdf"])
def test_a_name_that_no_file_can_have_is_a_mistake_in_the_file(tmp_path, name):
    (tmp_path / "workstation.toml").write_text(f'[[robots]]\nname = "a"\nmodel = "{name}"\n')
    with pytest.raises(InputError, match="is no name of a file"):
        sr.load(tmp_path)


def test_what_a_terminal_or_a_page_would_obey_is_written_or_left_out():
    obeyed = "\x1b[2J \u061c\u200e\u200f\u2028\u202e\u2066\x07\x9b"
    for shown in (printable(f"a{obeyed}b"), text(f"a{obeyed}b")):
        assert not set(obeyed.replace(" ", "").replace("[2J", "")) & set(shown)


BOMBED = """
import os, resource, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from seerob.core.errors import SeerobError
from soak.made_cells import KINDS
own = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGESIZE")
resource.setrlimit(resource.RLIMIT_AS, (own + (700 << 20), own + (700 << 20)))
for line in sys.stdin.read().splitlines():
    kind, path = line.split("|")
    try:
        KINDS[kind].read(Path(path))
    except SeerobError as error:
        print(kind, "|", " ".join(str(error).split())[:400])
    except BaseException as error:
        print(kind, "| RAISED", repr(error)[:200])
    else:
        print(kind, "| read")
"""
DEEP = 100_000


def bombs(folder):
    """Kind, file and what its message says, of files that ask for more than anybody has."""

    def put(name, data):
        (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())
        return folder / name

    def sparse(name, size):
        with (folder / name).open("wb") as file:
            file.truncate(size)
        return folder / name

    def nested(name, tag, around="{}"):
        return put(name, around.format(f"<{tag}>" * DEEP + f"</{tag}>" * DEEP))

    ply = "ply\nformat {} 1.0\nelement vertex 1000000000000\nproperty float x\nelement face 1\nend_header\n"
    tree = {
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "buffers": [{"byteLength": 36}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 10**12, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36 * 10**12}],
    }  # fmt: skip
    lying = json.dumps(tree).encode()
    lying += b" " * (-len(lying) % 4)
    body = struct.pack("<I4s", len(lying), b"JSON") + lying + struct.pack("<I4s", 36, b"BIN\0") + bytes(36)
    number = "9" * DEEP
    yield "ply", put("a.ply", ply.format("binary_little_endian")), "announces 1000000000000 vertex rows"
    yield "ply text", put("b.ply", ply.format("ascii")), "announces 1000000000000 vertex rows"
    yield "stl", put("a.stl", bytes(80) + b"\xff" * 4), "announces 4294967295 triangles"
    yield "off", put("a.off", "OFF\n1000000000000 1 0\n"), "1000000000000 vertices"
    yield "glb", put("a.glb", struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body), "a.glb"
    for kind, name in (
        ("obj", "a.obj"),
        ("stl", "b.stl"),
        ("ply", "c.ply"),
        ("dae", "a.dae"),
        ("3mf", "a.3mf"),
    ):
        yield kind, sparse(name, 2 << 30), "has more than 536870912 bytes"
    yield "obj", put("b.obj", b"v 0 0 0\nv " + bytes(30 << 20)), "line 2: is longer than"
    yield "urdf", sparse("a.urdf", 2 << 30), "has more than"
    yield "workstation", sparse("a.toml", 2 << 30), "larger than 4 MiB"
    yield "motion csv", sparse("a.csv", 2 << 30), "binary data, not text"
    yield "bvh", sparse("a.bvh", 2 << 30), "characters"
    yield "trackers jsonl", sparse("a.jsonl", 2 << 30), "r: line 1"
    yield "signals csv", sparse("b.csv", 2 << 30), "no end"
    yield "c3d", sparse("a.c3d", 2 << 30), "no C3D file"
    yield "urdf", nested("b.urdf", "link", "<robot>{}</robot>"), "b.urdf"
    yield "mjcf", nested("a.xml", "body", "<mujoco><worldbody>{}</worldbody></mujoco>"), "a.xml"
    yield "automationml", nested("a.aml", "InternalElement", "<CAEXFile><InstanceHierarchy>{}"), "a.aml"
    yield "mvnx", nested("a.mvnx", "subject", "<mvnx>{}</mvnx>"), "a.mvnx"
    yield "dae", nested("b.dae", "node", "<COLLADA><library_nodes>{}</library_nodes></COLLADA>"), "b.dae"
    yield "waypoints urp", put("a.urp", gzip.compress(b"<URProgram>" + b"<children>" * DEEP)), "w: "
    yield "gltf", put("a.gltf", "[" * DEEP), "a.gltf"
    yield "kinect json", put("a.json", '{"frames": [' + "[" * DEEP), "f: "
    yield "trackers jsonl", put("b.jsonl", "[" * DEEP), "r: line 1"
    yield "waypoints yaml", put("a.yaml", "waypoints: " + "[" * DEEP), "w: "
    for kind in ("workstation", "variables", "measured contacts", "keyframes", "skeleton", "zones toml"):
        yield kind, put(f"{kind}1.toml", "a = " + "[" * DEEP), "nested|recursion|TOML"
        yield kind, put(f"{kind}2.toml", f"a = {number}"), "digits"
    yield "urdf", put("c.urdf", made_cells.URDF.replace("1.5", number)), "must be finite"
    yield "motion csv", put("c.csv", f"Time [s],J1 [rad]\n0,{number}\n1,0\n"), "c.csv"


def test_files_that_ask_for_more_than_anybody_has_are_refused_by_name_within_700_mib(tmp_path):
    listed = list(bombs(tmp_path))
    done = subprocess.run(
        [sys.executable, "-c", BOMBED.format(tests=str(Path(__file__).parent))],
        input="\n".join(f"{kind}|{path}" for kind, path, _ in listed),
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    said = done.stdout.splitlines()
    assert (done.returncode, len(said)) == (0, len(listed)), done.stderr[-2000:]
    for line, (kind, _, expected) in zip(said, listed, strict=True):
        assert re.search(expected, line), line
        assert line.startswith(f"{kind} | ")
        assert "RAISED" not in line


def test_a_chunk_of_a_bag_that_unpacks_to_more_than_there_is_ends_the_parser_alone(tmp_path, monkeypatch):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    path, kind = tmp_path / "a.bag", "std_msgs/msg/Empty"
    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    with writer:
        topic = writer.add_connection("/a", kind, typestore=get_typestore(Stores.ROS1_NOETIC))
        writer.write(topic, 1, bytes(400 << 20))
    assert path.stat().st_size < 4 << 20
    monkeypatch.setattr(ros_bag, "MEMORY", 300 << 20)
    with pytest.raises(InputError, match=r"a.bag: takes more than 300 MiB of memory to read; repair it"):
        list(ros_bag.raw_messages(path, "a.bag", ("/a",), 1 << 20))


def test_a_collada_file_that_takes_too_much_ends_its_parser_with_a_message_and_the_next_is_read(
    tmp_path, monkeypatch
):
    import trimesh

    good = trimesh.creation.box((1, 1, 1)).export(file_type="dae")
    (tmp_path / "good.dae").write_bytes(good)
    large = re.sub(rb'(id="verts-array-array">)[^<]*', rb"\g<1>" + b"0 " * 3_000_000, good, count=1)
    (tmp_path / "large.dae").write_bytes(large)
    parser_process._end_all()
    assert len(load_meshes(tmp_path / "good.dae").meshes) == 1
    # What runs out of memory first decides: this package, a parser in C, or the process.
    refused = r"large.dae: (takes more than 32 MiB|.*more memory than|ends the process|.*unknown error)"
    with monkeypatch.context() as limited:
        limited.setattr(mesh_source, "parsed", partial(parsed, memory=32 << 20))
        with pytest.raises(InputError, match=refused):
            load_meshes(tmp_path / "large.dae")
    assert len(load_meshes(tmp_path / "good.dae").meshes) == 1
    monkeypatch.setattr(mesh_source, "parsed", partial(parsed, seconds=1e-3))
    with pytest.raises(InputError, match=r"large.dae: takes more than 0.001 s to read; export it"):
        load_meshes(tmp_path / "large.dae")


@pytest.mark.parametrize(
    "text", ["a" + ".a" * 2_000_000 + " = 1", "[a" + ' . "b"' * 600_000 + "]", "a = '" + "x" * 4_000_000]
)
@pytest.mark.parametrize(
    "read",
    [
        read_toml,
        lambda file: read_calibration(file.read_bytes(), file.name),
        lambda file: read_conventions(file, file.name),
        body_limits.read,
    ],
)
def test_a_key_of_a_million_parts_is_refused(tmp_path, text, read):
    """Python's own parser would take hours for it."""
    file = tmp_path / "a.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"a\.toml: "):
        read(file)

"""``seerob share``: what others get replays, is judged the same, and holds nothing that was planted."""

from __future__ import annotations

import getpass
import io
import socket
import zipfile
from pathlib import Path

import openpyxl
import pytest
from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from msgspec.structs import replace

import seerob as sr
from made_cell import FLOATING, TWO_R, heard, made, two_r
from seerob.app.cli import main
from seerob.core.errors import InputError
from seerob.core.samples import BodyPoint, BodySample
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.format import Visitor, content_hash
from seerob.session.sharing import share

PLANTED = (
    "planteduser",
    "plantedname",
    "plantedhost",
    "plantedvisitor",
    "plantedcolumn",
    "plantedvalue",
    "plantedfile",
    "plantedcomment",
    "plantedtitle",
    "plantedtracker",
    "plantedsubject",
    "203.0.113.",
    "2001:db8:",
    "/home/",
)
ROWS = "".join(f"{k / 20:g},{k / 10:g},0,plantedvalue{k}\n" for k in range(9))
CELL = f"""# plantedcomment, of /home/planteduser
title = "plantedtitle of line 7"
description = "by planteduser@plantedhost.example, in /home/planteduser/cells"
{FLOATING}{TWO_R}
[[robots]]
name = "ur"
model = "library:ur5e"
base = {{ position = [3, 0, 0] }}
[[humans]]
name = "plantedname"
stature = 1.75
mass = 75
sex = "female"
at = {{ position = [0, 3, 0] }}
[[parts]]
name = "post"
mesh = "post.stl"
units = "m"
up = "z"
[[sources]]
kind = "csv"
robot = "arm"
file = "plantedfile.csv"
[[sources]]
kind = "rtde"
robot = "ur"
host = "press.plantedhost.example"
[[sources]]
kind = "mvn"
human = "plantedname"
sender = "203.0.113.5"
[[safety]]
kind = "velocity"
name = "fast"
at = "arm"
limit = 0.5
[[safety]]
kind = "velocity"
name = "slow"
at = "arm"
limit = 8
[[safety]]
kind = "minimum_distance"
name = "far from plantedname"
between = ["arm", "plantedname"]
limit = 0.1
"""


class Visits:
    """Who looks on."""

    def seen(self):
        return None

    def take(self, *, end=False):
        if end:
            return ()
        return (Visitor(event="came", role="view", address="203.0.113.77 plantedvisitor", since="2026"),)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recording with secrets wherever one can be."""
    import trimesh

    folder = tmp_path_factory.mktemp("share") / "planteduser"
    urdf = two_r().replace("<link", "<!-- plantedcomment --><link", 1)
    stl = trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation((0, -3, 0)).export(file_type="stl")
    files = {
        "arm.urdf": urdf,
        "post.stl": b"plantedcomment".ljust(80) + stl[80:],
        "plantedfile.csv": f"t [s],j1 [rad],j2 [rad],plantedcolumn\n{ROWS}",
    }
    station = made(folder, CELL, files)
    scene = station.scene()
    (writer,) = station.open_sinks([Recorder(lossless=True)], folder / "out", scene)
    writer.watch(Visits())
    points = tuple(
        BodyPoint(name=f"plantedtracker{k}", bone="pelvis", position=(0, 3, 0.9)) for k in range(2)
    )

    def feed():
        for k in range(40):
            t = k / 100
            body = BodySample(
                source="mvn plantedname",
                seq=k,
                target="plantedname",
                t=t,
                points=points,
                subject="plantedsubject",
            )
            reason = "another sender, [2001:db8:0:1::7]:9763 or 203.0.113.6, see /home/planteduser/log.txt"
            yield (
                heard("arm", t, (k / 50, 0), (2, 0)),
                heard("ur", t, (0, -1, 1, -1, -1, 0), reason=reason if k > 30 else ""),
                body,
            )

    station.run(feed=feed(), end=0.39, writers=[writer], scene=scene)
    return folder / "out" / "run.mcap"


def everything(path: Path) -> str:
    """All text that a recording holds, by the mcap library, unpacked, and its bytes as they are."""
    found = [path.read_bytes()]
    with path.open("rb") as file:
        for record in StreamReader(file, validate_crcs=True).records:
            match record:
                case Message():
                    found.append(record.data)
                case Schema():
                    found += [record.name.encode(), record.data]
                case Channel():
                    found.append(f"{record.topic} {record.metadata}".encode())
                case Attachment():
                    found += [record.name.encode(), record.data]
                case Metadata():
                    found.append(f"{record.name} {record.metadata}".encode())
                case Header():
                    found.append(f"{record.library} {record.profile}".encode())
    return b"\n".join(found).decode("latin-1").casefold()


def test_nothing_that_was_planted_is_in_it_and_it_is_judged_the_same(recorded, capsys):
    before = everything(recorded)
    assert not [word for word in PLANTED if word not in before]
    to = recorded.with_name("shared.mcap")
    assert main(["share", str(recorded), str(to)]) == 0
    said = capsys.readouterr().out
    after = everything(to)
    here = {name.casefold() for name in (getpass.getuser(), socket.gethostname()) if len(name) > 4}
    assert not [word for word in (*PLANTED, *here, "seerob-") if word in after]
    assert "dropped      the file plantedfile.csv" in said
    assert "/visitors" in said
    assert "kept         arm.urdf" in said

    old, new = sr.Recording.open(recorded), sr.Recording.open(to)
    assert new.check() == ()
    again = sr.load_recorded(new).replay(new)
    first = [r.verdict for r in old.snapshot_at(0.2).results]
    assert [r.verdict for r in new.snapshot_at(0.2).results] == first
    then = sr.load_recorded(old).replay(old)
    assert [s.verdict for s in again.results.values()] == [s.verdict for s in then.results.values()]
    assert again.results["fast"].values.tolist() == then.results["fast"].values.tolist()
    assert {"exceeded", "within"} <= set(first), again.results
    assert "far from person_1" in again.results


def test_one_that_is_cut_off_or_was_changed_is_not_shared(recorded, tmp_path):
    content = recorded.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: content.index(b"seerob.end") - 20])
    with pytest.raises(InputError, match="share one that is whole"):
        share(sr.Recording.open(tmp_path / "cut.mcap"), tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()


def test_one_that_would_be_judged_otherwise_is_not_shared(recorded, tmp_path, monkeypatch):
    """A sample that says more than the one it stands for."""
    from seerob.session import sharing

    monkeypatch.setattr(
        sharing.Renamed, "__call__", lambda self, sample: heard("arm", sample.t, (0, 0), (0, 0))
    )
    with pytest.raises(InputError, match="fast: was exceeded, and is"):
        share(sr.Recording.open(recorded), tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()


def test_a_recording_is_inspected_without_its_sources(recorded, capsys):
    assert main(["inspect", str(recorded)]) == 0
    said = capsys.readouterr().out
    assert "reads        plantedfile.csv, " in said
    assert "connects" not in said


def _put(recording, files):
    """Other files, and a scene that says that they are its own."""
    recording.files = files
    recording.scene = replace(recording.scene, workstation_hash=content_hash(files))


def test_one_without_a_workstation_file_is_no_traceback(tmp_path, recorded):
    recording = sr.Recording.open(recorded)
    _put(recording, {"a.csv": b""})
    with pytest.raises(InputError, match=r"workstation\.toml: is not in it"):
        share(recording, tmp_path / "out.mcap")


@pytest.mark.parametrize(
    "name", ["../x", "TMP/x", "a/../../x", "..\\x", "c:x", "", ".", "a\0b", "x" * 300, "arm.urdf/x"]
)
def test_no_name_of_a_file_leads_out_of_where_it_is_unpacked(tmp_path, recorded, name):
    recording = sr.Recording.open(recorded)
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    _put(recording, {**recording.files, name.replace("TMP", str(tmp_path)): b"PLANTED"})
    for unpacks in (lambda: share(recording, tmp_path / "out.mcap"), lambda: recording.extract(folder)):
        with pytest.raises(InputError, match="do not trust this recording"):
            unpacks()
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.read_bytes() == b"PLANTED"]


def test_a_workbook_that_is_kept_has_no_author_and_no_bomb(monkeypatch):
    from seerob.session import sharing

    book, made = openpyxl.Workbook(), io.BytesIO()
    book.properties.creator = "plantedname"
    book.active.append(["limit", 3])
    book.save(made)
    cleaned = sharing._workbook("a.xlsx", made.getvalue())
    with zipfile.ZipFile(io.BytesIO(cleaned)) as archive:
        assert not [name for name in archive.namelist() if b"plantedname" in archive.read(name)]
    assert openpyxl.load_workbook(io.BytesIO(cleaned)).active["B1"].value == 3
    monkeypatch.setattr(sharing, "MAX_WORKBOOK", 100)
    for content in (made.getvalue(), b"no archive"):
        with pytest.raises(InputError, match=r"a\.xlsx: cannot be read"):
            sharing._workbook("a.xlsx", content)

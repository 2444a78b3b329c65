"""What files, recordings and devices call things reaches neither the terminal nor the page as a command."""

import logging
import math
import re
import sys
import tomllib
import unicodedata

import msgspec
import openpyxl
import pytest
from made_cells import make_cell, seerob

import seerob as sr
from seerob.app.console.terminal import PrintableLines, line
from seerob.core.errors import InputError
from seerob.core.markers import Label
from seerob.core.printable import obeyed, printable, printable_record
from seerob.core.samples import BodyPoint, BodySample, JointSample, Quality, SignalSample
from seerob.core.snapshot import Result, Row, Snapshot
from seerob.description.loader import load_robot
from seerob.description.mesh import load_meshes
from seerob.outputs.sink import Closing
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording

OBEYED = "\x1b[2J\x1b]0;title\x07\x00\x9b31m\u202egnirts\u2066"
WORDS = "操作员 – Рука 🤖 ½ m²\tπ"
NAME = f"{OBEYED}\n{WORDS}"


def test_bytes_of_a_fingerprint_are_no_pictures(capsys):
    """Rich shows a disc for ``:CD:``, and a flag for ``:DE:``."""
    line("trust", "SHA-256 BF:63:08:CD:4C:83:DE:02, :ok:")
    assert "BF:63:08:CD:4C:83:DE:02, :ok:" in capsys.readouterr().out


def test_nothing_is_left_that_a_terminal_obeys_and_every_encoding_takes_it():
    everything = "".join(map(chr, range(sys.maxunicode + 1)))
    shown = printable(everything)
    left = {c for c in shown if unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp")}
    assert left == {"\t", "\n"}
    assert not any(unicodedata.bidirectional(c) in ("LRE", "RLE", "LRO", "RLO", "PDF") for c in shown)
    assert not any(unicodedata.bidirectional(c) in ("LRI", "RLI", "FSI", "PDI") for c in shown)
    shown.encode("utf-8")


def test_words_stay_as_they_are():
    assert printable(WORDS) == WORDS


def test_what_is_logged_is_printable_too():
    record = logging.makeLogRecord({"msg": "robot says: %s", "args": (OBEYED,)})
    assert PrintableLines().format(record) == f"robot says: {printable(OBEYED)}"


@pytest.fixture
def named(tmp_path):
    """A cell whose title and criterion are called so."""
    cell = make_cell(tmp_path / "cell")
    file = cell / "workstation.toml"
    toml = "".join(f"\\u{ord(c):04x}" if c in OBEYED + "\n" else c for c in NAME)
    file.write_text(file.read_text().replace('"arm"', f'"{toml}"').replace('"speed"', f'"{toml}"'))
    assert tomllib.loads(file.read_text())["title"] == NAME
    return cell


def test_a_name_is_one_line_of_words_on_the_terminal_and_in_the_files(capsys, tmp_path, named):
    code, out, err = seerob(capsys, "assess", named, "-o", tmp_path / "out")
    assert (code, err) == (0, "")
    assert not any(unicodedata.category(c) == "Cc" and c != "\n" for c in out.replace("\t", ""))
    (line,) = [line for line in out.splitlines() if line.startswith("within")]
    assert printable(OBEYED) in line
    assert "操作员" in line
    report = (tmp_path / "out" / "report.html").read_text()
    assert not any(unicodedata.category(c) == "Cc" and c not in "\n\t" for c in report)
    assert not any(unicodedata.bidirectional(c) in ("RLO", "LRI") for c in report)  # would turn what follows
    assert "操作员" in report
    book = openpyxl.load_workbook(tmp_path / "out" / "results.xlsx", read_only=True)
    assert book.sheetnames
    book.close()


def test_what_any_text_of_a_workstation_holds_is_in_no_message_result_scene_or_file(capsys, tmp_path):
    """Planted in every text: names are taken with escapes, the rest is told with escapes."""
    toml = "".join(f"\\u{ord(c):04x}" for c in OBEYED)
    cell = tmp_path / "cell"
    assert seerob(capsys, "new", cell)[0] == 0
    file = cell / "workstation.toml"
    starter = file.read_text()
    texts = sorted(set(re.findall(r'(?m)^[a-z][^#\n"]*"([^"\n]+)"', starter)))
    assert len(texts) > 15
    taken = {"My cell", "tcp speed"}
    for text in texts:
        file.write_text(starter.replace(f'"{text}"', f'"{text} {toml}"'))
        said = ""
        try:
            sr.read(cell)
        except sr.SeerobError as error:
            said = str(error)
        assert not obeyed(said.replace("\n", " "))
        assert not (said and text in taken)
    for text in taken:
        starter = starter.replace(f'"{text}"', f'"{text} {toml}"')
    file.write_text(starter)
    station = sr.load(cell)
    assert printable(OBEYED) in station.workstation.title
    assert not obeyed(msgspec.json.encode(station.scene()).decode())
    _, out, err = seerob(capsys, "assess", cell, "-o", tmp_path / "out")
    assert not obeyed((out + err).replace("\n", " ").replace("\t", " "))
    for written in (tmp_path / "out").rglob("*"):
        if written.suffix in (".html", ".csv", ".json", ".toml", ".md", ".svg", ".txt"):
            for line in written.read_text().splitlines():
                assert not obeyed(line.replace("\t", " ")), written
    recording = Recording.open(tmp_path / "out" / "run.mcap")
    assert not obeyed(msgspec.json.encode(recording.scene).decode())


def test_names_in_files_of_robots_and_parts_that_turn_the_reading_are_refused_or_escaped(tmp_path):
    (tmp_path / "a.urdf").write_text('<robot name="a"><link name="b&#x202e;"/></robot>')
    with pytest.raises(InputError, match=r"a.urdf: link.name: holds U\+202E"):
        load_robot("a.urdf", folder=tmp_path)
    (tmp_path / "a.obj").write_text("o b\u202e\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (mesh,) = load_meshes(tmp_path / "a.obj", units="m", up="z").meshes
    assert mesh.name == "b\\u202e"


SPOKEN = (
    BodySample(
        source="suit",
        target="op",
        seq=0,
        t=0.0,
        subject=OBEYED,
        points=(BodyPoint(name=OBEYED, bone="pelvis", position=(0.0, 0.0, 1.0)),),
    ),
    SignalSample(
        source="plc",
        seq=0,
        t=0.0,
        values={OBEYED: OBEYED, "on": True},
        doubts={"on": OBEYED},
        ages={OBEYED: 1.0},
    ),
    JointSample(source="r", target="ur5e", seq=0, t=0.0, q=(0,) * 6, reason=OBEYED, quality=Quality.DEGRADED),
)


def test_what_devices_say_is_printable_from_the_first_tick_on(tmp_path):
    """In every result, on the page's wire and in the recording."""
    cell = make_cell(tmp_path / "cell")
    person = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
    with (cell / "workstation.toml").open("a") as file:
        file.write(person)
    station = sr.load(cell)
    sent = []

    class Page(Closing):
        def write(self, snapshot, samples):
            sent.append(msgspec.json.encode((snapshot, samples), enc_hook=list).decode())

        def close(self):
            pass

    station.run(
        feed=iter([SPOKEN, (), ()]), folder=tmp_path, sinks=[Recorder(lossless=True)], writers=[Page()]
    )
    assert not any(f"\\u00{ord(c):02x}" in said for said in sent for c in "\x1b\x07\x00")
    assert not any(obeyed(said) for said in sent)
    heard = next(iter(Recording.open(tmp_path / "run.mcap").ticks())).samples
    assert heard[0].subject == heard[0].points[0].name == heard[2].reason == printable(OBEYED)
    assert heard[1].values == {printable(OBEYED): printable(OBEYED), "on": True}


@pytest.mark.parametrize("where", ["reason", "label", "row", "part", "joints"])
def test_what_a_recorded_picture_says_is_printable_when_it_is_shown(where):
    text = Label(position=(0.0, 0.0, 0.0), text=OBEYED if where == "label" else "a")
    shown = Snapshot(
        seq=1,
        t=0.5,
        poses=bytes(range(28)),
        joints={OBEYED if where == "joints" else "r": (0.0, math.nan)},
        results=(
            Result(
                name="d",
                value=math.nan,
                reason=OBEYED if where == "reason" else "né",
                markers=(text,),
                rows=(Row(name=OBEYED if where == "row" else "palm"),),
                parts=(Result(name=OBEYED if where == "part" else "l"),),
            ),
        ),
    )
    made = printable_record(shown)
    assert OBEYED not in msgspec.json.decode(msgspec.json.encode(repr(msgspec.to_builtins(made))))
    encode = msgspec.msgpack.encode
    assert encode(made) == encode(shown).replace(encode(OBEYED), encode(printable(OBEYED)))
    assert printable_record(made) is made

"""Any file may be given to a reader: it is read, or refused with what is wrong, and nothing else happens."""

import contextlib
import hashlib
import io
import re
import warnings
import zipfile
from importlib import resources
from pathlib import Path

import pytest

import seerob as sr
from seerob.core.errors import SeerobError
from seerob.core.files import parser_process
from soak.corpus import corpus
from soak.hammering import hammer, hammer_in_processes, in_this_process
from soak.made_cells import KINDS

FEW, MANY = 200, 100_000
IN_THEIR_PROCESS = 10
"""Of the files whose parser has a process of its own, so many are read there; the others are read here."""


@pytest.mark.parametrize("kind", KINDS)
def test_a_small_file_of_each_kind_is_read_as_it_is(tmp_path, kind):
    path = tmp_path / f"f.{KINDS[kind].suffix}"
    KINDS[kind].make(path)
    KINDS[kind].read(path)


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_read_or_refused(kind):
    hammer(kind, 1, IN_THEIR_PROCESS)
    with in_this_process():
        counts = hammer(kind, 0, FEW - IN_THEIR_PROCESS)
    assert counts["read"] > 0
    assert counts["refused"] > FEW // 8


FOUND = [
    ("urdf", b'axis xyz="0 0 1"', b'axis xyz="0 -1e308 1"'),
    (
        "urdf",
        b'radius="0.05"/></geometry></collision></link>\n<joint',
        b'radius="1e-320"/></geometry></collision></link><joint',
    ),
    ("mjcf", b'size="0.05"/>\n<body', b'size="nan"/><body'),
    ("mjcf", b'pos="0 0 0.1" mass', b'pos="-1e308 0 0.1" mass'),
    ("mjcf", b'axis="1 0 0"', b'axis="-1e-320 0 0"'),
    ("mjcf", b'euler="0 90 0"', b'euler="0 1e308 0"'),
    ("mjcf", b'fromto="0 0 0 0 0 0.3"', b'fromto="0 0 0 0 0 1e308"'),
    ("ply text", b"vertex 8", b"vertex " + b"1" * 5000),
    ("obj", b"f ", b"v inf 0 0\nf "),
    ("obj", b"f ", b"v inf 0 0\nv 0 inf 0\nf -1 -2 1 2\nf "),
    ("motion csv", b"\n0.01,", b"\n5e-324,"),
    ("motion csv", b"\n0.01,", b"\n-1e308,"),
    ("tool path", b"\n0.01,", b"\n5e-324,"),
    ("zones of a controller", b"[0, 2.5]", b"[0, 0x" + b"1" * 5000 + b"]"),
    ("waypoints xlsx", b'<row r="2">', b'<row r="999999999">'),
]
"""Kind of file, what stands in the valid one, and what a hunt put there that hung, warned or raised."""


@pytest.mark.parametrize(("kind", "there", "put"), FOUND)
def test_what_a_hunt_found_is_read_or_refused(tmp_path, kind, there, put):
    whole = corpus(kind)[0]
    path = tmp_path / f"f.{KINDS[kind].suffix}"
    if kind.endswith("xlsx"):
        with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(path, "w") as new:
            for name in old.namelist():
                new.writestr(name, old.read(name).replace(there, put))
    else:
        assert there in whole
        path.write_bytes(whole.replace(there, put, 1))
    with warnings.catch_warnings(), in_this_process(), contextlib.suppress(SeerobError):
        warnings.simplefilter("error")
        KINDS[kind].read(path)


NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.])")


@pytest.mark.parametrize("step", [12, pytest.param(1, marks=pytest.mark.soak)])
@pytest.mark.parametrize("bad", ["nan", "inf", "1e308", "-1e308", "5e-324"])
def test_a_number_that_nothing_has_is_taken_or_told_with_its_place(tmp_path, step, bad):
    """In each ``step``-th figure of the starter, all the way to the compiled twin."""
    starter = resources.files("seerob.app.commands") / "starter"
    (tmp_path / "motion.csv").write_bytes((starter / "motion.csv").read_bytes())
    text = re.sub(r"#.*", "", (starter / "workstation.toml").read_text())
    places = [found.span() for found in NUMBER.finditer(text) if text.count('"', 0, found.start()) % 2 == 0]
    said = []
    for at, end in places[::step]:
        (tmp_path / "workstation.toml").write_text(text[:at] + bad + text[end:])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                sr.load(tmp_path)
            except SeerobError as error:
                said.append(str(error))
    assert said or bad == "5e-324"
    assert all(re.search(r"\b(robots|tools|parts|humans|safety)\[\d\]", each) for each in said), said


def test_one_process_reads_what_parsers_of_others_read_one_file_after_the_other(tmp_path):
    parser_process._end_all()
    processes = set()
    for kind in (
        "xacro",
        "dae",
        "xacro",
        "zones xlsx",
        "ply",
        "ros bag",
        "kinect bag",
        "xacro",
        "motion xlsx",
    ):
        path = tmp_path / f"{kind}.{KINDS[kind].suffix}"
        path.write_bytes(corpus(kind)[0])
        KINDS[kind].read(path)
        processes.add(tuple(child.process.pid for child in parser_process._idle))
    assert len(processes) == 1


def test_a_signalling_nan_of_an_stl_is_refused(tmp_path):
    whole = bytearray(corpus("stl")[0])
    whole[96:100] = b"\x01\x00\x80\x7f"
    (tmp_path / "f.stl").write_bytes(whole)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(SeerobError, match="not finite"):
            KINDS["stl"].read(tmp_path / "f.stl")


@pytest.fixture(scope="module")
def code():
    """What tells the code that is hunted in from that of another day."""
    folders = (Path(sr.__file__).parent, Path(__file__).parent)
    files = sorted(path for folder in folders for path in folder.rglob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_a_hundred_thousand_broken_files_are_read_or_refused(capsys, request, code, kind):
    """Stopped, it goes on where it was the next time, as long as no line of the code has changed."""

    def tell(text):
        with capsys.disabled():
            print(f"\r{text}", end="", flush=True)

    place, cache = f"broken files/{kind}", request.config.cache
    known = cache.get(place, {})
    done = known.get("chunks", {}) if known.get("code") == code else {}
    counts = hammer_in_processes(
        kind, MANY, tell, done, lambda chunks: cache.set(place, {"code": code, "chunks": chunks})
    )
    tell(f"{kind}: {counts['read']} read, {counts['refused']} refused of {MANY}\n")
    assert sum(counts.values()) == MANY
    assert counts["read"] > 0
    assert counts["refused"] > MANY // 4


@pytest.mark.soak
def test_a_hunt_that_is_stopped_goes_on_where_it_was():
    kept = []

    def stop(text):
        if len(kept) == 1:
            raise KeyboardInterrupt

    def keep(done):
        kept.append({seed: dict(found) for seed, found in done.items()})

    with pytest.raises(KeyboardInterrupt):
        hammer_in_processes("kuka log", 4100, stop, {}, keep)
    assert len(kept) == 1
    again = []
    total = hammer_in_processes("kuka log", 4100, lambda text: None, dict(kept[0]), again.append)
    assert sum(total.values()) == 4100
    assert len(again) == 2

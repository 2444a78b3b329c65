import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import msgspec
import pytest

from seerob.app import wire
from seerob.core import snapshot
from seerob.core.errors import InputError

STRUCTS = [c for c in vars(snapshot).values() if isinstance(c, type) and issubclass(c, msgspec.Struct)]
STRUCTS.remove(msgspec.Struct)


@cache
def typescript() -> str:
    """What is written, once: each time it takes a third of a second."""
    return wire.typescript()


def test_the_file_in_the_repository_is_current():
    assert wire.is_current(), "run `make wire`"


@pytest.mark.parametrize("cls", STRUCTS, ids=lambda c: c.__name__)
def test_an_interface_has_exactly_the_keys_that_are_encoded(cls):
    body = re.search(rf"^export interface {cls.__name__} {{\n(.*?)^}}", typescript(), re.M | re.S)[1]
    declared = re.findall(r"^  (\w+)\??:", body, re.M)
    tag = ["type"] if cls.__struct_config__.tag else []
    assert declared == tag + [f.encode_name for f in msgspec.structs.fields(cls)]


def test_encoded_messages_have_the_keys_of_their_interface():
    for message in (
        snapshot.Hello(server="s", mode="live"),
        snapshot.Transport(playing=True, t=0.0),
        snapshot.Snapshot(seq=1, t=0.0, poses=b"", results=(snapshot.Result(name="a"),)),
    ):
        data = msgspec.msgpack.decode(msgspec.msgpack.encode(message))
        body = re.search(rf"interface {type(message).__name__} {{\n(.*?)^}}", typescript(), re.M | re.S)[1]
        left_out = {
            field.name
            for field in msgspec.structs.fields(message)
            if not field.required and type(message) in wire.COMPLETED and field.name not in data
        }
        assert list(data) == [key for key in re.findall(r"^  (\w+):", body, re.M) if key not in left_out]
        assert data["type"] == type(message).__struct_config__.tag


def test_the_page_knows_the_order_of_all_that_is_an_array_on_the_wire():
    arrays = {c for c in STRUCTS if c.__struct_config__.array_like}
    assert set(wire.ARRAYS) == arrays
    orders = re.search(r"^export const FIELDS = {\n(.*?)^}", typescript(), re.M | re.S)[1]
    found = dict(re.findall(r"^  (\w+): (\[.*\]),$", orders, re.M))
    for cls in arrays:
        tag = cls.__struct_config__.tag
        order = msgspec.json.decode(found.pop(tag or cls.__name__.lower()))
        given = {field.name: None for field in msgspec.structs.fields(cls)} | {"verdict": "within"}
        sent = msgspec.msgpack.decode(
            msgspec.msgpack.encode(cls(**{k: given[k] for k in order if k != "type"}))
        )
        assert len(sent) == len(order)
        assert [sent[order.index(k)] for k in ("type", "verdict") if k in order] == [
            v for k, v in (("type", tag), ("verdict", "within")) if k in order
        ]
    assert not found


def test_types_map_to_what_a_decoder_gives():
    text = typescript()
    assert "  poses: Uint8Array;" in text
    assert "  verdict: Verdict | null;" in text
    assert "  markers: Marker[];" in text
    assert "  parts: Result[];" in text
    assert "  interval: [number, number] | null;" in text
    assert "  faces: [number, number, number][];" in text
    assert "  joints: Record<string, number[]>;" in text
    assert "  value: number | string | null;" in text
    assert 'export const PROTOCOL = "seerob.v2.msgpack";' in text


def test_every_docstring_of_a_field_goes_along():
    text = " ".join(typescript().replace("*", " ").split())
    source = Path(snapshot.__file__).read_text(encoding="utf-8")
    docs = re.findall(r'^    """(.*?)"""$', source, re.M | re.S)
    assert len(docs) > 50
    for doc in docs:
        assert " ".join(doc.replace("``", "`").replace("*", " ").split()) in text


def test_the_hash_changes_with_a_type_and_not_with_a_word(monkeypatch):
    before = wire.schema()

    class Label(msgspec.Struct, tag="label"):
        """Another text."""

        position: snapshot.Vec3
        text: str
        verdict: snapshot.Verdict | None = None

    Label.__module__ = snapshot.__name__
    monkeypatch.setattr(snapshot, "Label", Label)
    assert wire.schema() == before
    monkeypatch.setattr(snapshot, "Vec3", tuple[float, float])
    assert wire.schema() != before


def test_a_stale_file_is_noticed_and_written_anew(tmp_path):
    file = tmp_path / "wire.ts"
    assert not wire.is_current(file)
    wire.write(file)
    assert wire.is_current(file)
    file.write_text(file.read_text(encoding="utf-8") + " ", encoding="utf-8")
    assert not wire.is_current(file)


def test_without_a_checkout_nothing_is_written(tmp_path):
    with pytest.raises(InputError, match="checkout"):
        wire.write(tmp_path / "web" / "src" / "wire.ts")


def test_a_comment_cannot_end_early():
    assert wire._comment("a */ b").count("*/") == 1


def test_the_command_line_tells_what_it_takes():
    run = [sys.executable, "-m", "seerob.app.wire"]
    assert subprocess.run([*run, "--check"], check=False).returncode == 0
    wrong = subprocess.run([*run, "--chekc"], check=False, capture_output=True, text=True)
    assert wrong.returncode == 2
    assert "usage" in wrong.stderr


def test_typescript_accepts_it(tmp_path):
    tsc = wire.FILE.parents[1] / "node_modules" / ".bin" / "tsc"
    node = shutil.which("node")
    if not (tsc.exists() and node):
        # The web checks compile the page with this file; here it is only an early word.
        assert typescript().count("{") == typescript().count("}")
        return
    done = subprocess.run(
        [node, str(tsc.resolve()), "--noEmit", "--strict", "--target", "es2022", str(wire.FILE)],
        check=False, capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout

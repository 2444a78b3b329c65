"""Editing a workstation file over real sockets: what changes, what stays, what two pages do together."""

import http.client
import json
import os
import runpy
import stat
import tomllib
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np
import pytest
from websockets.exceptions import InvalidStatus

from model_io import made_mechanisms
from seerob.app.commands.edit import serving
from seerob.app.console.loading import compiled
from seerob.app.console.visiting import Visiting
from seerob.app.server import cad_route
from seerob.app.server.access import Role, Tokens
from seerob.core.errors import InputError
from seerob.core.snapshot import (
    Change,
    Draft,
    Edit,
    Edited,
    Hold,
    Introduction,
    Measure,
    Measured,
    Scene,
    Snapshot,
    Visitors,
)
from seerob.workstation.allowed import NOTHING
from seerob.workstation.editing import changed
from server.frames import Visitor

MADE = runpy.run_path(str(Path(__file__).parents[2] / "scripts/make-imported-line"))

CELL = b"""# A cell; this line and all others that nobody edits stay.
title = "Edited"

[[parts]]
name = "table"            # beside the robot
shape = { box = [0.8, 1.4, 0.74] }
at = { position = [0.8, 0, 0.37] }  # its middle

[[parts]]
name = "rack"
shape = { box = [0.2, 0.2, 1] }
at.position_mm = [2000, 0, 500]

# -- people --

[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
at = { position = [3, 0, 0] }

[[safety]]
kind = "minimum_distance"
between = ["table", "operator"]
limit = 0.5               # [m]
"""
MOVE = Change(kind="set", path=("parts", 0, "at", "position"), value=[0.9, 0, 0.37])
AREA = {"name": "zone", "shape": {"box": [1, 1, 2]}, "at": {"position": [1, 2, 1]}}


class Page(Visitor):
    """A page that edits; `draft` is the newest that it was told."""

    def __init__(self, server, **options):
        super().__init__(server, **options)
        self.draft, self.shown, self._id = None, {}, 0

    def read(self, timeout=60.0):
        message = super().read(timeout)
        if isinstance(message, Draft):
            self.draft = message
        if isinstance(message, Scene | Snapshot):
            self.shown[type(message)] = message
        return message

    def edit(self, *changes, action="change", revision=None):
        """What became of an edit; by then the draft has come too."""
        self._id += 1
        if revision is None:
            revision = self.draft.revision
        edit = Edit(id=self._id, action=action, revision=revision, changes=changes)
        self.socket.send(msgspec.msgpack.encode(edit))
        answer = self.until(lambda m: isinstance(m, Edited) and m.id == self._id)
        while answer.accepted and self.draft.revision < answer.revision:
            self.read()
        return answer


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "workstation.toml"
    path.write_bytes(CELL)
    path.chmod(0o640)
    return path


@pytest.fixture
def desk(file):
    how = Visiting(tokens=None, tls=None, clear_text=False)
    server, desk, _ = serving(compiled(file), file, NOTHING, "127.0.0.1", 0, how)
    with server:
        yield server, desk


def pages(server, n):
    found = [Page(server) for _ in range(n)]
    for page in found:
        page.of(Draft)
    return found


def test_an_edit_is_shown_reviewed_and_saved_and_all_else_stays_byte_for_byte(desk, file):
    server, table = desk
    with Page(server) as page:
        assert "edit" in page.read().may
        before = page.of(Scene)
        page.of(Draft)
        answer = page.edit(MOVE, Change(kind="add", path=("areas",), value=AREA))
        assert answer.accepted
        while page.shown[Snapshot].seq == 0:
            page.read()
        after, first = page.shown[Scene], page.shown[Snapshot]
        assert {n.name for n in after.nodes} - {n.name for n in before.nodes} == {"zone"}
        assert first.results[0].value == pytest.approx(1.4, abs=0.4)
        assert file.read_bytes() == CELL  # not before it is saved
        assert "+at = { position = [0.9, 0, 0.37] }  # its middle" in page.draft.diff.splitlines()
        assert table.unsaved
        assert page.edit(action="save").accepted
    saved = CELL.replace(b"[0.8, 0, 0.37]", b"[0.9, 0, 0.37]")
    added = b'\n[[areas]]\nname = "zone"\nshape = { box = [1, 1, 2] }\nat = { position = [1, 2, 1] }\n'
    assert file.read_bytes() == saved + added
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    assert os.listdir(file.parent) == [file.name]
    assert not table.unsaved


def test_undo_and_redo_restore_it_byte_for_byte_also_behind_a_save(desk, file):
    server, _ = desk
    edits = (
        (Change(kind="remove", path=("parts", 1)),),
        (
            Change(
                kind="copy", path=("parts", 0), value={"name": "table_2", "at": {"position": [5, 0, 0.37]}}
            ),
        ),
        (Change(kind="remove", path=("safety", 0, "limit")), MOVE),
    )
    (page,) = pages(server, 1)
    with page:
        for changes in edits:
            assert page.edit(*changes).accepted
        assert page.edit(action="save").accepted
        edited = file.read_bytes()
        for _ in edits:
            assert page.draft.undo
            assert page.edit(action="undo").accepted
        assert not page.draft.undo
        assert page.edit(action="save").accepted
        assert file.read_bytes() == CELL
        for _ in edits:
            assert page.edit(action="redo").accepted
        assert page.edit(action="save").accepted
        assert file.read_bytes() == edited
        assert not page.edit(action="redo").accepted


WRONG = [
    Change(kind="set", path=("safety", 0, "limit"), value="wide"),
    Change(kind="set", path=("safety", 0, "between"), value=["table", "nobody"]),
    Change(kind="set", path=("parts", 0, "shpe"), value={}),
    Change(kind="remove", path=("humans", 0)),
    Change(kind="add", path=("parts",), value={"name": "table", "shape": {"box": [1, 1, 1]}}),
    Change(kind="add", path=("tools",), value={"name": "t", "on": "x", "mesh": "../../etc/passwd"}),
]


@pytest.mark.parametrize("change", WRONG, ids=lambda change: ".".join(map(str, change.path)))
def test_what_makes_the_file_wrong_is_refused_with_key_and_words_of_check_file(desk, file, change, tmp_path):
    from seerob.workstation.editing import changed

    wrong = tmp_path / "wrong"
    wrong.mkdir()
    (wrong / file.name).write_bytes(changed(CELL, [change], "")[0])
    with pytest.raises(InputError) as said:
        compiled(wrong)
    (page,) = pages(desk[0], 1)
    with page:
        answer = page.edit(change)
        assert not answer.accepted
        words = {(p.key, p.what, p.remedy) for p in said.value.problems}
        assert {(m.key, m.what, m.remedy) for m in answer.mistakes} == words
        assert page.draft.revision == answer.revision == 1
        assert not page.edit(action="undo").accepted
    assert file.read_bytes() == CELL


NOWHERE = [
    Change(kind="set", path=(), value=1),
    Change(kind="set", path=("parts", 7, "name"), value="x"),
    Change(kind="set", path=("parts", -1, "name"), value="x"),
    Change(kind="set", path=("parts", 0, "name"), value=None),
    Change(kind="set", path=("parts", 0, "name", "x"), value=1),
    Change(kind="set", path=("title",), value=float("nan")),
    Change(kind="set", path=("title",), value={"a": {1: 2}}),
    Change(kind="set", path=("title",), value=b"x"),
    Change(kind="remove", path=("parts", 0, "nothing")),
    Change(kind="copy", path=("parts",), value={}),
    Change(kind="copy", path=("parts", -1), value={"name": "x"}),
    Change(kind="add", path=("title",), value={}),
    Change(kind="sudo", path=("title",), value=1),
]


def test_what_leads_nowhere_or_is_no_value_is_refused(desk, file):
    (page,) = pages(desk[0], 1)
    with page:
        for change in NOWHERE:
            answer = page.edit(change)
            assert not answer.accepted, change
            assert answer.mistakes[0].what
        assert not page.edit(MOVE, NOWHERE[1]).accepted  # all of it or nothing
        assert not page.edit(action="format the disk").accepted
        assert page.edit(MOVE).accepted
        assert page.draft.diff.count("\n+") == 2


def test_two_pages_lose_nothing_of_each_other(desk, file):
    one, other = pages(desk[0], 2)
    with one, other:
        assert one.edit(
            Change(kind="remove", path=("parts", 0)), Change(kind="remove", path=("safety", 0))
        ).accepted
        # The other one has not heard of that: what it calls the second part is the first now.
        rack = Change(kind="set", path=("parts", 1, "at", "position_mm"), value=[2500, 0, 500])
        assert other.edit(rack, revision=1).accepted
        assert other.edit(Change(kind="add", path=("areas",), value=AREA), revision=1).accepted
        told = other.edit(MOVE, revision=1)
        assert [m.key for m in told.mistakes] == ["parts[0].at.position"]
        assert "taken away meanwhile" in told.mistakes[0].what or "changed meanwhile" in told.mistakes[0].what
        now = tomllib.loads(_saved(other, file).decode())
        assert [p["name"] for p in now["parts"]] == ["rack"]
        assert now["parts"][0]["at"]["position_mm"] == [2500, 0, 500]
        assert now["areas"][0]["name"] == "zone"
        # Each takes back its own, whatever the other did since.
        assert one.edit(action="undo").accepted
        now = tomllib.loads(_saved(one, file).decode())
        assert [p["name"] for p in now["parts"]] == ["table", "rack"]
        assert now["parts"][1]["at"]["position_mm"] == [2500, 0, 500]
        assert other.edit(action="undo").accepted
        assert other.edit(action="undo").accepted
        assert _saved(other, file) == CELL


def test_who_changes_what_another_page_changed_is_told_what_it_is_now(desk):
    one, other = pages(desk[0], 2)
    with one, other:
        assert one.edit(MOVE).accepted
        for change in (
            Change(kind="set", path=MOVE.path, value=[0.1, 0, 0.37]),
            Change(kind="remove", path=("parts", 0)),
            Change(kind="set", path=("parts", 0, "at", "position", 2), value=0.4),
        ):
            told = other.edit(change, revision=1)
            assert not told.accepted
            assert "changed meanwhile by another page" in told.mistakes[0].what
        assert "[0.9, 0, 0.37]" in other.edit(WRONG[0], MOVE, revision=1).mistakes[0].what
        # A save is of what was reviewed, and so is what is thrown away.
        assert not other.edit(action="save", revision=1).accepted
        assert other.edit(Change(kind="set", path=("title",), value="Mine")).accepted
        assert other.edit(action="discard").accepted
        assert "0.9" in other.draft.diff
        assert "Mine" not in other.draft.diff


def test_discarding_ends_at_the_file_and_a_file_that_somebody_else_saved_is_not_written_over(desk, file):
    (page,) = pages(desk[0], 1)
    with page:
        assert page.edit(MOVE).accepted
        assert page.edit(action="discard").accepted
        assert page.draft.diff == ""
        assert page.edit(MOVE).accepted
        theirs = CELL.replace(b"Edited", b"By an editor")
        file.write_bytes(theirs)
        assert "another program has changed" in page.edit(action="save").mistakes[0].what
        assert file.read_bytes() == theirs
        assert page.edit(action="discard").accepted
        assert page.draft.tables["title"] == "By an editor"
        assert page.edit(MOVE).accepted
        assert page.edit(action="save").accepted
        assert file.read_bytes() == theirs.replace(b"[0.8, 0, 0.37]", b"[0.9, 0, 0.37]")


def test_only_a_page_that_may_control_edits_and_only_where_the_command_line_says_so(file):
    tokens = Tokens.made()
    how = Visiting(tokens=tokens, tls=None, clear_text=False)
    server, desk, _ = serving(compiled(file), file, NOTHING, "127.0.0.1", 0, how)
    actions = ("change", "undo", "redo", "save", "discard", "run", "stop", "no such action")

    def ask(page, action, revision=1):
        changes = (MOVE,) if action == "change" else ()
        edit = Edit(id=7, action=action, revision=revision, changes=changes)
        page.socket.send(msgspec.msgpack.encode(edit))

    with server:
        for role in (Role.VIEW, Role.TRACK):
            with Visitor(server, path=f"/ws?token={tokens[list(Role).index(role)]}") as page:
                assert "edit" not in page.read().may
                for action in actions:
                    ask(page, action)
                    [mistake] = page.of(Edited).mistakes
                    assert mistake.what == "this page may not edit"
        # Nor does a page from elsewhere, in the browser of who may.
        for origin in ("http://evil.example", "null", f"http://127.0.0.1:{server.port}0"):
            with pytest.raises(InvalidStatus) as refused:
                Page(server, path=f"/ws?token={tokens.control}", origin=origin)
            assert refused.value.response.status_code == 403
        with Page(server, path=f"/ws?token={tokens.control}") as page:
            page.of(Draft)
            assert page.draft.revision == 1
            assert page.edit(MOVE).accepted
            # What is unsaved is neither saved, nor taken back, nor run by who may not.
            for token in (tokens.view, tokens.track):
                with Visitor(server, path=f"/ws?token={token}") as looker:
                    for action in actions:
                        ask(looker, action, revision=page.draft.revision)
                        assert not looker.of(Edited).accepted
            assert page.edit(action="undo").accepted
            assert page.edit(action="redo").accepted
    assert desk.unsaved
    assert file.read_bytes() == CELL


def test_a_distance_is_the_engine_s_and_follows_the_draft(desk):
    (page,) = pages(desk[0], 1)
    with page:

        def measured(*between):
            page.socket.send(msgspec.msgpack.encode(Measure(id=3, between=between)))
            return page.of(Measured)

        # The faces of two boxes, 0.8 m wide at 0.8 m and 0.2 m wide at 2 m.
        found = measured("table", "rack")
        assert found.result.value == pytest.approx(1.9 - 1.2, abs=1e-6)
        assert found.result.limit is None
        (line,) = found.result.markers
        assert (line.start[0], line.end[0]) == pytest.approx((1.2, 1.9))
        assert page.edit(MOVE).accepted
        assert measured("table", "rack").result.value == pytest.approx(0.6, abs=1e-6)
        for wrong in (("table", "nobody"), ("table", "table"), ("", ""), ("*", "rack"), ("[", "rack")):
            found = measured(*wrong)
            assert found.result is None
            assert found.refusal


def test_line_ends_and_forms_of_toml_stay_as_they_are(tmp_path):
    from seerob.workstation.editing import changed

    raw = b'\xef\xbb\xbfa = "x" # y\r\n[[parts]]\r\nname = """\r\n[[areas]]\r\n# no"""\r\n'
    raw += b"at.position = [\r\n1, # x\r\n2]\r\n"
    raw += b'[parts.more]\r\nk = 1\r\n[other]\r\n[[parts]]\r\nname = "b"\r\n'
    made, _ = changed(raw, [Change(kind="set", path=("parts", 1, "name"), value="c")], "")
    assert made == raw.replace(b'"b"', b'"c"')
    made, _ = changed(raw, [Change(kind="set", path=("parts", 0, "more", "k"), value=2)], "")
    assert made == raw.replace(b"k = 1", b"k = 2")
    made, _ = changed(raw, [Change(kind="remove", path=("parts", 0))], "")
    assert made == raw[:16] + raw[raw.index(b"[other]") :]
    turned = Change(kind="set", path=("at", "rpy_deg"), value=[0, 0, 30])
    made, _ = changed(b"at = { position = [1, 2, 3] } # x\n", [turned], "")
    assert made == b"at = { position = [1, 2, 3], rpy_deg = [0, 0, 30] } # x\n"
    inline = b"parts = [ { name = 'a' }, { name = 'b' } ] # all\n"
    made, _ = changed(inline, [Change(kind="set", path=("parts", 1, "name"), value="c")], "")
    assert made == inline.replace(b"'b'", b'"c"')
    # An entry in two pieces: without the first, the second would be another thing.
    apart = b'[[parts]]\nname = "a"\n[other]\n[parts.more]\nk = 1\n'
    with pytest.raises(InputError, match="cannot be edited here"):
        changed(apart, [Change(kind="remove", path=("parts", 0))], "")
    with pytest.raises(InputError):
        changed(b"a = 1\r\nb = 2\n", [Change(kind="set", path=("a",), value=2)], "")


def test_the_first_waypoint_comes_with_its_source_and_what_it_lacks_is_said_of_its_key(tmp_path):
    file = tmp_path / "workstation.toml"
    raw = b'title = "Taught"\n[[robots]]\nname = "ur5e"\nmodel = "library:ur5e"\n'
    file.write_bytes(raw)

    def told(draft):
        return compiled(tmp_path, NOTHING, quiet=True, raw=draft).scene()

    (hand,) = told(raw).taught
    assert (hand.robot, hand.source, hand.points) == ("ur5e", None, 0)
    point = {"name": "home", "q_deg": [0, -80, 90, -100, -90, 0], "pause": 1}
    source = {"kind": "waypoints", "robot": "ur5e", "joint_jerk": 20, "points": [point]}
    wanting, _ = changed(raw, [Change(kind="add", path=("sources",), value=source)], "")
    with pytest.raises(InputError) as refused:
        told(wanting)
    assert {p.key for p in refused.value.problems} == {
        "sources[0].joint_speed",
        "sources[0].joint_acceleration",
    }
    figures = [
        Change(kind="set", path=("sources", 0, key), value=1.0)
        for key in ("joint_speed", "joint_acceleration")
    ]
    far = {"move": "joint", "at": {"position": [9, 0, 0], "rpy_deg": [0, 0, 0]}}
    add = Change(kind="add", path=("sources", 0, "points"), value=point | {"q_deg": [0] * 6})
    made, _ = changed(wanting, [*figures, add], "")
    assert made.startswith(raw)
    assert made.count(b"\n\n[[sources.points]]\n") == 2
    (hand,) = told(made).taught
    assert (hand.source, hand.points) == (0, 2)
    beyond, _ = changed(made, [Change(kind="add", path=("sources", 0, "points"), value=far)], "")
    with pytest.raises(InputError) as refused:
        told(beyond)
    assert [p.key for p in refused.value.problems] == ["sources[0].points[2]"]


def _saved(page, file):
    while True:  # what the other page did is on its way
        answer = page.edit(action="save")
        if answer.accepted:
            return file.read_bytes()
        page.of(Draft)


def test_what_one_holds_no_other_changes_nor_takes_back(desk):
    server, _ = desk
    shift = Change(kind="set", path=("parts", 1, "at", "position_mm"), value=[2100, 0, 500])
    with ExitStack() as stack:
        first, second = (stack.enter_context(page) for page in pages(server, 2))
        say = {
            page: lambda m, page=page: page.socket.send(msgspec.msgpack.encode(m)) for page in (first, second)
        }

        def held(page, *expected):
            """Wait until what is held, by name of the holder, is that."""

            def is_so(m):
                return isinstance(m, Visitors) and {(v.name, v.holds) for v in m.visitors if v.holds} == {
                    *expected
                }

            page.until(is_so)

        say[first](Introduction(name="Anna"))
        say[second](Introduction(name="Berta"))
        say[first](Hold(names=("table",)))
        held(second, ("Anna", ("table",)))
        say[second](Hold(names=("table", "rack")))
        held(second, ("Anna", ("table",)), ("Berta", ("rack",)))
        assert "table is in the hands of Anna" in second.edit(MOVE).mistakes[0].what
        assert second.edit(shift).accepted
        assert first.edit(MOVE).accepted  # whoever holds it may
        say[first](Hold(names=()))
        say[second](Hold(names=()))
        held(second)
        while second.draft.revision < first.draft.revision:
            second.read()
        assert second.edit(Change(kind="set", path=MOVE.path, value=[1, 0, 0.37])).accepted
        # What is held is not taken back either, and what is not said again is let go.
        say[first](Hold(names=("table",)))
        held(second, ("Anna", ("table",)))
        assert "Anna" in second.edit(action="undo").mistakes[0].what
        held(second)
        assert second.edit(action="undo").accepted
    server.stop()
    refused = [reason for v in server.visits.take(end=True) if v.event == "left" for reason in v.refused]
    assert any(reason.startswith("hold: table, held by visitor") for reason in refused)


def test_changes_that_are_made_at_once_make_the_file_that_they_make_one_by_one():
    random = np.random.default_rng(7)
    adds = [
        Change(kind="add", path=("parts",), value={"name": f"p{k}", "shape": {"box": [1, 1, k + 1]}})
        for k in range(4)
    ]
    for _ in range(40):
        at = random.permutation(6)
        sets = [
            Change(kind="set", path=("parts", int(k), "color"), value=[0.1, 0.2, float(random.random())])
            for k in at[:4]
        ]
        more = [Change(kind="set", path=("parts", int(at[0]), "at"), value={"position": [1, 2, 3]})]
        gone = [Change(kind="remove", path=("parts", int(k))) for k in sorted(at[4:], reverse=True)]
        changes = [*adds, *sets, *more, *gone]
        raw, events = changed(CELL, changes, "x")
        one_by_one, found = CELL, []
        for change in changes:
            one_by_one, event = changed(one_by_one, [change], "x")
            found += event
        assert raw == one_by_one
        assert events == found
    with pytest.raises(InputError, match=r"parts\[9\]\.color"):
        changed(
            CELL,
            [
                Change(kind="set", path=("parts", 0, "up"), value="z"),
                Change(kind="set", path=("parts", 9, "color"), value=[1, 1, 1]),
            ],
            "x",
        )


def brought(server, name, content, query="", origin=None):
    """What the server answers to a CAD file, line by line; or the status of a refusal."""
    host = f"127.0.0.1:{server.port}"
    asked = http.client.HTTPConnection(host, timeout=120)
    headers = {"Origin": origin or f"http://{host}", "Content-Type": "application/octet-stream"}
    asked.request("POST", f"/cad/{name}{query}", content, headers)
    answer = asked.getresponse()
    text = answer.read().decode()
    asked.close()
    return [json.loads(line) for line in text.splitlines()] if answer.status == 200 else answer.status


def test_a_cad_file_that_a_page_brings_becomes_parts_and_accepted_axes_a_robot(desk, file):
    server, _ = desk
    made_mechanisms.write(file.with_name("door.step"), made_mechanisms.door()[0])
    door = file.with_name("door.step").read_bytes()
    with Page(server) as page:
        page.of(Draft)
        *said, found = brought(server, "door.step", door)
        assert any("cutting" in line["say"] for line in said)
        assert found["parts"] == 2
        hinge = next(k for k, a in enumerate(found["axes"], 1) if a["kind"] == "revolute")
        assert abs(found["axes"][hinge - 1]["axis"][2]) == pytest.approx(1)
        assert "on one axis" in found["axes"][hinge - 1]["reason"]
        assert file.read_bytes() == CELL
        page._id += 1
        edit = Edit(id=page._id, action="change", revision=page.draft.revision, brought=found["brought"])
        page.socket.send(msgspec.msgpack.encode(edit))
        assert page.until(lambda m: isinstance(m, Edited) and m.id == edit.id).accepted
        while len(page.draft.tables["parts"]) < 4:
            page.read()
        assert {p["name"] for p in page.draft.tables["parts"][2:]} == {"door/frame", "door/leaf"}
        # With an axis, what moves is a robot and no part any more.
        *_, found = brought(server, "door.step", b"", f"?again=1&accept={hinge}")
        assert found["robots"] == 1
        page._id += 1
        edit = Edit(id=page._id, action="change", revision=page.draft.revision, brought=found["brought"])
        page.socket.send(msgspec.msgpack.encode(edit))
        assert page.until(lambda m: isinstance(m, Edited) and m.id == edit.id).accepted
        while "robots" not in page.draft.tables:
            page.read()
        assert [p["name"] for p in page.draft.tables["parts"][2:]] == ["door/frame"]
        assert page.edit(action="undo").accepted
        assert len(page.draft.tables["parts"]) == 4
    assert file.read_bytes() == CELL


def test_an_assembly_comes_with_the_files_that_it_names_and_with_densities(desk, file):
    server, _ = desk
    other, main = MADE["Step"](), MADE["Step"]()
    other.cylinder("pin", 5.0, 20.0)
    block, pin = main.box("block", (40.0, 20.0, 10.0)), main.elsewhere("pin", "the pin.stp")
    place = MADE["place"]
    main.assembly("fixture", [(block, "base", place()), (pin, "left", place(10, 10, 10))])
    with Page(server) as page:

        def taken(*arguments):
            *_, found = brought(server, "a.step", *arguments)
            page._id += 1
            edit = Edit(id=page._id, action="change", revision=page.draft.revision, brought=found["brought"])
            page.socket.send(msgspec.msgpack.encode(edit))
            assert page.until(lambda m: isinstance(m, Edited) and m.id == edit.id).accepted
            while page.draft.revision == edit.revision:
                page.read()
            return found, {part["name"]: part for part in page.draft.tables["parts"][2:]}

        page.of(Draft)
        assert brought(server, "the%20pin.stp", other.text().encode(), "?beside=a.step") == 204
        found, parts = taken(main.text().encode(), "?density=2700&triangles=400")
        assert found["options"]["density"] == ["2700"]
        assert not found["left_out"]
        assert parts["fixture/base"]["density"] == 2700
        # Of what is round, the triangles are not the solid: its own mass is written, its moments with it.
        assert "density" not in parts["fixture/left"]
        assert parts["fixture/left"]["mass"] > 0
        assert len(parts["fixture/left"]["inertia"]) == 6
        assert parts["fixture/left"]["triangles"] == 400
        # What is not said again is as before; what is empty is none.
        found, parts = taken(b"", "?again&smaller=25&triangles=")
        assert list(parts) == ["fixture/base"]
        assert parts["fixture/base"]["density"] == 2700
        assert "triangles" not in parts["fixture/base"]
        assert [row["name"] for row in page.draft.tables["left_out"]] == ["a: --smaller 25"]
        assert brought(server, "a.step", b"", "?again&smaller=0")[-1]["problems"][0][0] == "smaller"


def test_what_is_brought_is_bounded_and_of_who_may_edit_alone(desk, file, monkeypatch):
    server, _ = desk
    assert brought(server, "a.step", b"x", origin="http://elsewhere.example") == 403
    for name in ("..%2Fa.step", ".a.step", "a", "a%2Fb.step", "a..step"):
        assert brought(server, name, b"x") in (400, 404, 405)
    assert brought(server, "a.step", b"x", "?nonsense=1") == 400
    assert brought(server, "a.step", b"x", "?smaller=much") == 400
    for name in ("..", ".a", "import-0.json", "a%2Fb.stp", "a%5Cb.stp", "a%0A.stp"):
        assert brought(server, name, b"x", "?beside=a.step") in (400, 404, 405)
    assert brought(server, "a.step", b"") == 400
    assert brought(server, "never.step", b"", "?again=1") == 404
    (file.parent / "elsewhere").mkdir()
    (file.parent / "imported").mkdir(exist_ok=True)
    (file.parent / "imported/linked").symlink_to(file.parent / "elsewhere")
    assert brought(server, "linked.step", b"x") == 403
    assert not list((file.parent / "elsewhere").iterdir())
    monkeypatch.setattr(cad_route, "MOST_BYTES", 1000)
    assert brought(server, "a.step", bytes(1001)) == 413
    assert brought(server, "a.step", iter([bytes(600), bytes(600)])) == 413
    *_, answer = brought(server, "a.step", b"ISO-10303-21;")
    assert "problems" in answer
    assert not [p for p in file.parent.rglob("*") if p.name.endswith((".coming", ".glb"))]

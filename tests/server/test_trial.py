"""A draft that is run while it is edited: what follows, what is refused, what is never written."""

import os
import time
from threading import Thread

import pytest

from seerob.app.commands.edit import keep_trying, serving
from seerob.app.console.loading import compiled
from seerob.app.console.visiting import Visiting
from seerob.core.snapshot import Change, Draft, Hello, Scene, Snapshot, Transport
from seerob.workstation.allowed import NOTHING
from server.test_desk import CELL, Page

FASTER = Change(kind="set", path=("safety", 0, "limit"), value=5)
MOVE = Change(kind="set", path=("humans", 0, "at", "position"), value=[2, 0, 0])
LIVE = {
    "kind": "vrpn",
    "name": "tracker",
    "human": "operator",
    "host": "127.0.0.1",
    "trackers": {"pelvis": "a"},
}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "workstation.toml"
    path.write_bytes(CELL)
    return path


def begun(file, *, running):
    how = Visiting(tokens=None, tls=None, clear_text=False)
    return serving(compiled(file), file, NOTHING, "127.0.0.1", 0, how, running=running)


class Watching(Page):
    """Keeps the newest message of each kind, and does not wait for ever beside a run that goes on."""

    def __init__(self, server):
        super().__init__(server)
        self.told = {}

    def read(self, timeout=60.0):
        message = super().read(timeout)
        self.told[type(message)] = message
        return message

    def until(self, accept, timeout=60.0):
        end = time.monotonic() + timeout
        while not accept(message := self.read(timeout)):
            assert time.monotonic() < end, message
        return message


class Running:
    """A server whose drafts a thread of its own runs."""

    def __init__(self, file, *, running=False):
        self.server, self.desk, self.trial = begun(file, running=running)
        self._over = False
        self._thread = Thread(target=keep_trying, args=(self.trial, self.server, lambda: self._over))

    def __enter__(self):
        self.server.start()
        self._thread.start()
        return self.server

    def __exit__(self, *_):
        self._over = True
        self._thread.join()
        self.server.stop()


def moving(page):
    """The first snapshot of a run that has begun, and is going on."""
    return page.until(lambda m: isinstance(m, Snapshot) and m.t > 0.05)


def test_a_run_follows_an_edit_and_writes_nothing(file):
    with Running(file) as server, Watching(server) as page:
        assert page.of(Hello).mode == "edit"
        page.of(Draft)
        assert page.edit(action="run").accepted
        assert page.told[Hello].mode == "live"
        assert page.told[Hello].may[-1] == "edit"
        before = moving(page).results[0]
        assert page.draft.runs
        answer = page.edit(MOVE, FASTER)
        assert answer.accepted
        page.until(lambda m: isinstance(m, Snapshot) and m.results[0].limit == 5 and m.t > 0.05)
        after = page.shown[Snapshot]
        assert after.results[0].value == pytest.approx(before.value - 1, abs=0.02)
        assert after.results[0].verdict == "exceeded"
        assert before.verdict == "within"
        assert page.edit(action="stop").accepted
        assert page.told[Hello].mode == "edit"
        assert not page.told[Transport].playing
        assert not page.draft.runs
        still = page.until(lambda m: isinstance(m, Snapshot) and m.t == 0)
        assert still.results[0].limit == 5
    assert file.read_bytes() == CELL
    assert os.listdir(file.parent) == [file.name]


def test_an_edit_begins_the_run_anew(file):
    with Running(file, running=True) as server, Watching(server) as page:
        assert page.of(Hello).mode == "live"
        page.of(Draft)
        page.until(lambda m: isinstance(m, Snapshot) and m.t > 0.3)
        assert page.edit(FASTER).accepted
        first = page.until(lambda m: isinstance(m, Snapshot) and m.results[0].limit == 5)
        assert first.t < 0.3
        assert page.draft.runs
        assert page.edit(action="undo").accepted
        page.until(lambda m: isinstance(m, Snapshot) and m.results[0].limit == 0.5)


def test_a_refused_edit_leaves_the_run_as_it_is(file):
    with Running(file, running=True) as server, Watching(server) as page:
        page.of(Draft)
        before = moving(page).t
        assert not page.edit(Change(kind="set", path=("safety", 0, "limit"), value="wide")).accepted
        page.until(lambda m: isinstance(m, Snapshot) and m.t > before + 0.2)
        assert page.draft.revision == 1


def test_no_page_decides_whom_the_machine_connects_to(file):
    add = Change(kind="add", path=("sources",), value=LIVE)
    with Running(file) as server, Watching(server) as page:
        page.of(Draft)
        assert page.edit(add).accepted
        told = page.edit(action="run")
        assert not told.accepted
        assert "seerob run --edit" in told.mistakes[0].what
    with Running(file, running=True) as server, Watching(server) as page:
        page.of(Draft)
        moving(page)
        assert page.edit(add).accepted
        assert not page.draft.runs
        assert "no page decides" in page.draft.ended
        page.until(lambda m: isinstance(m, Snapshot) and m.t == 0)
        assert page.edit(action="undo").accepted
        assert page.draft.ended == ""
        assert page.edit(action="run").accepted
        moving(page)


def test_a_run_that_fails_says_why_and_shows_where_everybody_begins(file, monkeypatch):
    from seerob.session.station import Station

    real = Station.run

    def run(self, **options):
        def fail(t):
            if t > 0.1:
                raise ZeroDivisionError("of a plug-in")

        return real(self, **options, progress=fail)

    monkeypatch.setattr(Station, "run", run)
    with Running(file) as server, Watching(server) as page:
        page.of(Draft)
        assert page.edit(action="run").accepted
        page.until(lambda m: isinstance(m, Draft) and m.ended != "")
        assert "of a plug-in" in page.draft.ended
        assert not page.draft.runs
        assert page.told[Scene].title == "Edited"
        while page.told[Snapshot].t != 0:
            page.read()

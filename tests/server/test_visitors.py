"""Who was connected to a run is in its recording and in the log."""

import json
import logging
import os
import subprocess
import sys
from contextlib import ExitStack
from datetime import datetime

import httpx
import pytest
from mcap.reader import make_reader

from seerob.app.cli import main
from seerob.app.server.access import FREE, MOST_STRANGERS, WAITING, Visits, read_tokens
from seerob.app.server.live import LiveView
from seerob.core.snapshot import Hello, Snapshot, Transport
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording
from server.frames import MESHES, PATIENCE, Visitor, scene, snapshot
from server.test_company import Guest, presence
from soak.cut_short import workstation

CLI = [sys.executable, "-m", "seerob.app.cli"]


def visitors(path):
    with path.open("rb") as file:
        return [json.loads(m.data) for _, _, m in make_reader(file).iter_messages(topics=["/visitors"])]


def test_a_run_records_who_looked_on_from_where_and_what_was_refused(tmp_path):
    cell, tokens, out = workstation(tmp_path / "cell"), tmp_path / "tokens.toml", tmp_path / "out"
    read_tokens(tokens)
    command = [*CLI, "run", cell, "-o", out, "--port", "0", "--token-file", tokens, "--seconds", "3600"]
    process = subprocess.Popen(
        list(map(str, command)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=dict(os.environ),
    )
    try:
        pages = {}
        for line in process.stdout:
            word, _, rest = line.strip().partition(" ")
            if word in ("page", "track", "control"):
                pages[word] = rest.split()[0]
            if len(pages) == 3:
                break
        known = read_tokens(tokens)
        assert [url.partition("token=")[2] for url in pages.values()] == [
            known.view,
            known.track,
            known.control,
        ]

        class Served:
            port = int(pages["page"].partition("//")[2].partition("/")[0].partition(":")[2])

        with Visitor(Served, path=f"/ws?token={known.view}") as looker:
            assert looker.of(Hello).may == ("view",)
            looker.of(Snapshot)
            looker.ask("pause")
            looker.of(Transport)
            looker.of(Snapshot)
        for _ in range(FREE + 2):
            httpx.get(f"http://127.0.0.1:{Served.port}/?token={'0' * 32}")
    except BaseException:
        process.kill()
        raise
    finally:
        process.terminate()
        _, said = process.communicate(timeout=PATIENCE)
    found = visitors(out / "run.mcap")
    page = [v for v in found if v["role"] == "view"]
    assert [v["event"] for v in page] in (["came", "refused", "left"], ["came", "refused", "there"])
    assert {v["address"] for v in page} == {"127.0.0.1"}
    assert page[-1]["refused"] == {"pause": 1}
    assert datetime.fromisoformat(page[0]["since"]) <= datetime.fromisoformat(
        page[-1]["until"] or page[-1]["since"]
    )
    stranger = [v for v in found if v["role"] == "none"][-1]
    assert sum(stranger["refused"].values()) == FREE + 2
    assert "page of 127.0.0.1 (view): refused: pause" in said
    assert "too many wrong tokens" in said
    # It reads and replays as before.
    recording = Recording.open(out / "run.mcap")
    assert recording.complete
    assert recording.findings == ()
    assert not any(token in (out / "run.mcap").read_bytes().decode("latin-1") for token in known)


def test_who_is_there_at_the_end_is_recorded_and_nothing_where_nobody_came(tmp_path):
    for visited in (True, False):
        folder = tmp_path / str(visited)
        folder.mkdir()
        with LiveView(scene=scene(), meshes=MESHES, port=0) as view:
            writer = Recorder().open(scene(), MESHES, {}, folder)
            writer.watch(view.server.visits)
            if visited:
                page = Visitor(view.server)
                page.read()
            for k in range(10):
                writer.write(snapshot(k), ())
            writer.close()
            if visited:
                page.socket.close()
        found = visitors(folder / "run.mcap")
        assert [(v["event"], v["role"]) for v in found] == (
            [("came", "any"), ("there", "any")] if visited else []
        )
        with (folder / "run.mcap").open("rb") as file:
            topics = {c.topic for c in make_reader(file).get_summary().channels.values()}
        assert ("/visitors" in topics) == visited


def test_visits_are_in_the_log(caplog):
    caplog.set_level(logging.INFO)
    with LiveView(scene=scene(), meshes=MESHES, port=0) as view, Visitor(view.server) as page:
        page.read()
    said = [r.getMessage() for r in caplog.records if "access" in r.name]
    assert said == ["page of 127.0.0.1 (any): connected", "page of 127.0.0.1 (any): gone, refused nothing"]


def test_what_strangers_and_pages_make_it_remember_is_bounded():
    visits = Visits()
    for k in range(5 * WAITING):
        visits.turn_away(f"10.0.{k >> 8}.{k & 255}", f"reason {k}")
    page = visits.come("view", "192.0.2.1")
    for k in range(1000):
        page.refuse(f"action {k}")
    assert len(visits._strangers) == MOST_STRANGERS
    assert len(page.refused) <= 16
    assert len(visits.take(end=True)) <= WAITING + MOST_STRANGERS + 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--token", "0" * 32], "use --token-file FILE, or - to be asked"),
        (["--host", "0.0.0.0", "--key", "k.pem"], "--key: is of no use alone"),
        (["--clear-text", "--certificate", "c.pem"], "contradicts --certificate"),
        (["--token-file", "-"], "there is no terminal"),
        (["--certificate", "none.pem"], "give --certificate and --key, both PEM"),
    ],
)
def test_what_would_not_protect_is_refused_before_anything_is_served(
    capsys, monkeypatch, tmp_path, options, said
):
    cell = workstation(tmp_path / "cell")
    monkeypatch.chdir(tmp_path)
    with open(os.devnull) as nobody:
        monkeypatch.setattr(sys, "stdin", nobody)
        try:
            code = main(["run", str(cell), "--no-record", "--port", "0", *options])
        except SystemExit as end:  # of argparse
            code = end.code
    out, err = capsys.readouterr()
    assert code == 3
    assert said in err
    assert "page" not in out


@pytest.mark.parametrize("names", [False, True])
def test_everybody_is_recorded_with_their_places_and_names_only_when_asked(tmp_path, names):
    with ExitStack() as stack:
        view = stack.enter_context(LiveView(scene=scene(), meshes=MESHES, port=0))
        view.server.visits.names = names
        a = stack.enter_context(Guest(view.server, name="Anna", scale=10.0))
        writer = Recorder().open(scene(), MESHES, {}, tmp_path)
        writer.watch(view.server.visits)
        b = stack.enter_context(Guest(view.server, name="Berta", device="vr"))
        b.say(presence(3.0, hands=False, points=bytes(24)))
        a.sees(lambda every: b.hello.visitor in every)
        writer.write(snapshot(0), ())
        a.say(presence(4.0))
        b.sees(lambda every: a.hello.visitor in every)
        writer.write(snapshot(1), ())
        writer.close()
    with (tmp_path / "run.mcap").open("rb") as file:
        everything = b"".join(m.data for *_, m in make_reader(file).iter_messages())
    assert (b"Anna" in everything, b"Berta" in everything) == (names, names)
    told = [v for v in visitors(tmp_path / "run.mcap") if v["event"] == "introduced"]
    assert [(v["id"], v["name"], v["scale"]) for v in told] == [
        (a.hello.visitor, "Anna" * names, 10.0),
        (b.hello.visitor, "Berta" * names, 1.0),
    ]
    with (tmp_path / "run.mcap").open("rb") as file:
        found = [json.loads(m.data) for *_, m in make_reader(file).iter_messages(topics=["/presences"])]
    assert [[one["id"] for one in told["visitors"]] for told in found] == [[2], [1, 2]]
    (one,) = found[0]["visitors"]
    assert (one["head"][0], one["left"], len(one["points"])) == (3.0, None, 2)
    assert found[1]["visitors"][0]["left"][:3] == pytest.approx([4.0, 0.3, 1.0])
    recording = Recording.open(tmp_path / "run.mcap")
    assert (recording.complete, recording.findings) == (True, ())

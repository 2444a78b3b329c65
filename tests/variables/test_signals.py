"""How old what is known of a variable is: since it was asked for, whether or not anybody is connected."""

from __future__ import annotations

import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from live_story import listening, wait_for
from made_cell import made, person
from seerob import load
from seerob.core.samples import SignalSample
from seerob.core.snapshot import Basis, Result, Verdict
from seerob.criteria.criterion import Criterion
from seerob.criteria.question import bound_to
from seerob.devices.sources.web import Web
from seerob.session.opening import open_sources
from seerob.session.run import Judge, engine_of
from seerob.twin.signals import Signals
from seerob.workstation.source import Target
from seerob.workstation.variables import Variable

SPEED = Variable(name="belt/speed", source="plc", address=1, unit="m/s", timeout=0.5)


def picture(t=0.0, **ages):
    return SignalSample(
        source="plc", seq=0, t=t, values={"belt/speed": 0.25}, ages={"belt/speed": ages.get("age", 0)}
    )


def known(t, age=0.0, source=1.0):
    signals = Signals({"belt/speed": SPEED}, {"belt/speed": min(SPEED.timeout, source)})
    signals.take(picture(age=age))
    return signals.at("belt/speed", t)


def test_its_own_time_out_counts_after_the_session_has_ended():
    """The last picture is all there is; a second of the source's time-out is not half a second of its own."""
    assert known(0.49).invalid_reason == ""
    for t in (0.51, 0.7, 0.98):
        assert f"not heard for {t:.2f} s (time-out 0.5 s)" in known(t).invalid_reason
    assert "time-out 0.2 s" in known(0.3, source=0.2).invalid_reason


@pytest.mark.parametrize("age", [0.1, 0.4])
def test_it_is_as_old_as_the_question(age):
    assert known(0.49 - age, age=age).invalid_reason == ""
    assert "not heard for 0.51 s" in known(0.51 - age, age=age).invalid_reason


def test_an_answer_that_takes_its_time_is_as_old_as_its_question():
    """Over a real socket: the value was so at some instant in between."""

    class Slow(BaseHTTPRequestHandler):
        def do_GET(self):
            time.sleep(0.2)
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b'{"speed": 0.25}')

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Slow) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        source = Web(name="plc", url=f"http://127.0.0.1:{server.server_port}/", every=0.05)
        variable = Variable(name="belt/speed", source="plc", address="/speed", unit="m/s")
        with listening(source, Target(variables=(variable,))) as heard:
            wait_for(lambda: len(heard) > 4)
        server.shutdown()
    assert all(0.2 <= s.ages["belt/speed"] < 30 for s in heard)


STATION = f"""
variables = "variables.toml"
{person("op", 2, 0, 0)}
[[sources]]
kind = "mqtt"
name = "plc"
host = "127.0.0.1"
MORE
[[machines]]
name = "gate"
shape = {{ box = [0.2, 1.0, 1.0] }}
at = {{ position = [0, 0, 1] }}
slide = {{ along = [1, 0, 0], position = "gate/position", lower = 0, upper = 1.5 }}
"""
POSITION = """
[[variables]]
name = "gate/position"
source = "plc"
address = ADDRESS
unit = "m"
"""


def gate(folder, more="", address='"gate"', age=0.0, ticks=20):
    """Why nobody knows where a gate is, tick by tick, that stands where its last picture says."""
    (folder / "workstation.toml").write_text(STATION.replace("MORE", more))
    (folder / "variables.toml").write_text(POSITION.replace("ADDRESS", address))
    engine = engine_of(load(folder).model)
    ages = {"gate/position": age} if age else {}
    engine.take([SignalSample(source="plc", seq=0, t=0.0, values={"gate/position": 0.25}, ages=ages)])
    states = [engine.start()]
    return [state.invalid_reason("gate") for state in states] + [
        engine.tick().invalid_reason("gate") for _ in range(ticks)
    ]


def test_what_moves_by_who_sends_no_time_is_known_where_the_file_bounds_how_late_it_is(tmp_path):
    assert "sends no time and cannot be asked" in gate(tmp_path)[0]
    assert "delay of the source" in gate(tmp_path)[0]
    assert gate(tmp_path, "delay = 0.1")[0] == ""
    assert gate(tmp_path, address='{ topic = "gate", pointer = "/x", time = "/t" }')[0] == ""


def test_a_machine_is_as_old_as_the_question_too(tmp_path):
    timed = '{ topic = "gate", pointer = "/x", time = "/t" }'
    fresh, old = gate(tmp_path, address=timed, ticks=60), gate(tmp_path, address=timed, age=0.3, ticks=60)
    late = [next(k for k, why in enumerate(doubts) if "not heard for" in why) for doubts in (fresh, old)]
    assert late[0] - late[1] == pytest.approx(30, abs=1)
    assert late[0] < 51


JUDGED = """
[[variables]]
name = "door/shut"
source = "plc"
address = ADDRESS
type = "bool"
[[safety]]
kind = "variable"
name = "shut"
variable = "door/shut"
expected = true
[[safety]]
kind = "minimum_distance"
name = "near"
between = ["gate", "op"]
limit = 0.1
active = "door/shut"
[[safety]]
kind = "minimum_distance"
name = "far"
between = ["gate", "op"]
limit = 3
active = "door/shut"
"""
TIMED = '{ topic = "door", pointer = "/x", time = "/t" }'


def judged(folder, more, address, shut, ticks=3):
    """What each criterion says at the last of some ticks."""
    variables, criteria = JUDGED.split("[[safety]]", 1)
    moved = POSITION.replace("ADDRESS", TIMED.replace("door", "gate"))
    (folder / "workstation.toml").write_text(STATION.replace("MORE", more) + "[[safety]]" + criteria)
    (folder / "variables.toml").write_text(moved + variables.replace("ADDRESS", address))
    station = load(folder)
    engine, judge = engine_of(station.model), Judge(station.bound)
    for k in range(ticks):
        values = {"gate/position": 0.25, "door/shut": shut[min(k, len(shut) - 1)]}
        engine.take([SignalSample(source="plc", seq=k, t=0.01 * k, values=values)])
        found = judge(engine.start() if k == 0 else engine.tick())
    return [str(r.verdict) if r.verdict else "muted" if r.muted else None for r in found], found


@pytest.mark.parametrize(("more", "address"), [("delay = 0.1", '"door"'), ("", TIMED)])
def test_what_is_known_not_to_apply_is_muted(tmp_path, more, address):
    assert judged(tmp_path, more, address, [False])[0] == ["exceeded", "muted", "muted"]
    assert judged(tmp_path, more, address, [True])[0] == ["within", "within", "exceeded"]


@pytest.mark.parametrize("shut", [[False], [True, False], [False, True, False]])
def test_nothing_that_moves_is_muted_by_who_sends_no_time(tmp_path, shut):
    """It may have been true for long: what is within all the same is, and what would be exceeded is open."""
    verdicts, found = judged(tmp_path, "", '"door"', shut)
    assert verdicts == ["exceeded", "within", "undecided"]
    assert found[2].reason.startswith("exceeded were it true: door/shut: plc sends no time")
    assert judged(tmp_path, "", '"door"', [True])[0] == ["within", "within", "exceeded"]


class Parted(Criterion, frozen=True):
    """As long as the door is shut a gate may be anywhere."""

    def depends(self, model):
        return ("gate",)

    def variables(self):
        return {"door/shut": "bool"}

    def bind(self, model):
        def evaluate(state):
            shut = state.signal("door/shut")
            verdict = Verdict.WITHIN if shut else Verdict.EXCEEDED
            return Result(name=self.name, value=1.0 - shut, limit=0.5, verdict=verdict)

        return evaluate

    def basis(self, model):
        return Basis(formula="", source="")


@pytest.mark.parametrize(("more", "known"), [("delay = 0.1", True), ("", False)])
@pytest.mark.parametrize("shut", [True, False])
def test_nothing_that_moves_is_within_for_ones_own_by_who_sends_no_time(tmp_path, more, known, shut):
    judged(tmp_path, more, '"door"', [True], ticks=1)
    station = load(tmp_path)
    engine = engine_of(station.model)
    values = {"gate/position": 0.25, "door/shut": shut}
    engine.take([SignalSample(source="plc", seq=0, t=0.0, values=values)])
    (found,) = Judge([bound_to(station.model, Parted(name="own"), "safety")])(engine.start())
    assert found.verdict == ("exceeded" if not shut else "within" if known else "undecided")


MODBUS = ('kind = "modbus"\nport = 1\nevery = 0.3', '{ table = "coil", at = 1, type = "bit" }')
UNSEEN = (
    "door/shut: heard every 0.3 s; what one is for less than that is not seen, and nothing is judged by it"
)


@pytest.mark.parametrize(("kind", "told"), [(MODBUS, [UNSEEN]), (('kind = "mqtt"', '"door"'), [])])
def test_how_long_is_not_seen_between_two_questions_is_told(tmp_path, kind, told):
    source, address = kind
    text = f'variables = "v.toml"\n{person()}\n[[sources]]\nname = "plc"\nhost = "127.0.0.1"\n{source}\n'
    variable = f'[[variables]]\nname = "door/shut"\nsource = "plc"\ntype = "bool"\naddress = {address}\n'
    station = made(tmp_path, text, {"v.toml": variable})
    every = [f.text for _, one in open_sources(station.model) for f in one.findings]
    assert [text for text in every if "heard every" in text] == told

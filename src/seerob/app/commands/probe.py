"""``seerob probe``: connect to a controller, say what is heard, and what to write into the workstation.

Of variables, before there is a dictionary of them, it says how regularly a device tells them.
"""

from __future__ import annotations

import argparse
import asyncio
import time
import tomllib
from collections import Counter
from collections.abc import Sequence
from contextlib import aclosing, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.interruption import Stopped
from seerob.app.console.terminal import OUT, Exit, add_allowed, allowed, line, port, seconds
from seerob.core.errors import InputError, SeerobError
from seerob.devices.live.listening import TRIED_AGAIN, Arrivals
from seerob.devices.variables.live_source import Change, Node, VariablesSource
from seerob.protocols import NotLetIn
from seerob.workstation.variables import Kind, Variable

if TYPE_CHECKING:
    from seerob.core.samples import Sample
    from seerob.devices.live.listening import LiveSource
    from seerob.devices.variables.live_source import VariablesSource
    from seerob.workstation.allowed import Allowed


def tell_heard(source: VariablesSource, nodes: Sequence[Node], wait: float) -> None:
    """Listen to variables, and print how regularly they come, which do not, and what is wrong with which.

    Args:
        source: Reads them.
        nodes: The variables.
        wait: How long [s].

    Raises:
        OSError: The device is gone.
        SeerobError: What it says cannot be understood.
    """
    arrivals, reasons = asyncio.run(_heard(source, nodes, wait))
    line("heard", f"{arrivals.statistics()}; {len(reasons)} of {len(nodes)} variables")
    for node in nodes:
        if (reason := reasons.get(node.address, "not heard")) != "":
            line("reason", f"{node.address}: {reason}", "yellow")


async def _heard(
    source: VariablesSource, nodes: Sequence[Node], wait: float
) -> tuple[Arrivals, dict[str, str]]:
    """Arrivals of anything, and by address what is wrong with what was said last; empty when nothing is."""
    # As texts: no unit is asked for what is not looked at.
    variables = tuple(
        Variable(name=f"v{k}", source="probe", address=_address(node.address), type=Kind.TEXT)
        for k, node in enumerate(nodes)
    )
    addresses = {variable.name: node.address for variable, node in zip(variables, nodes, strict=True)}
    arrivals, reasons = Arrivals(), dict[str, str]()
    clock = asyncio.get_running_loop()
    try:
        async with (
            aclosing(source.changes(variables, Path())) as said,
            asyncio.timeout_at(clock.time() + wait),
        ):
            async for changes in said:
                changed = [change for change in changes if isinstance(change, Change)]
                if changed:
                    arrivals.add(time.monotonic(), None)
                reasons |= {addresses[change.name]: change.invalid_reason for change in changed}
    except TimeoutError:
        pass  # of the listening, or of a device that has nothing to say
    return arrivals, reasons


def _address(shown: str) -> object:
    """An address as a dictionary has it; some are tables."""
    return tomllib.loads(f"value = {shown}")["value"] if shown.startswith("{") else shown


HELP = "connect to a controller and print what it says, how regularly, and what is missing"
EXAMPLE = "seerob probe rtde 192.168.0.10"
MOST_SHOWN = 40
"""Variables."""
NEAR = 0.2
"""Rates that differ by a smaller share are the same: a few seconds are heard."""
ADDRESSES = ("host", "url", "address")
"""Options of live sources that say where the other end is; a source has one of them, or listens itself."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    text = "what it speaks: the kind of a live source, as `seerob kinds` lists it; or a workstation's folder"
    sub.add_argument("kind", help=text)
    sub.add_argument("address", nargs="?", help="its name, address or URL; none for what sends to us")
    sub.add_argument("--port", type=port, help="port, when it is not the usual one")
    sub.add_argument("--frequency", type=float, help="samples per second to ask for [Hz]")
    sub.add_argument("--robot", default="robot", help="name of the robot in the snippet")
    sub.add_argument("--human", default="operator", help="name of the person in the snippet")
    sub.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="any other option of the source, value as in the workstation file; may be repeated",
    )
    sub.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help="write the kinematics of that very robot to a new file",
    )
    sub.add_argument(
        "--server-certificate",
        type=Path,
        metavar="FILE",
        help="write the certificate that an OPC UA server shows to a new file, so that no other is taken",
    )
    add_allowed(sub)
    sub.add_argument("--seconds", type=seconds, default=3.0, help="how long to listen (default: 3)")


def run(options: argparse.Namespace) -> int:
    """Ask, listen, print; `Exit.ERROR` when nothing is heard.

    Raises:
        InputError: It cannot be reached, or is not what the source can use.
    """
    import asyncio

    from seerob.core.plugin import kinds
    from seerob.core.samples import SignalSample
    from seerob.devices.live.listening import Listener, because

    if options.address is None and options.kind not in kinds("sources") and Path(options.kind).exists():
        return _workstation(Path(options.kind), allowed(options))
    source, given = _source(options)
    where = f"{options.kind} {options.address or ''}".strip()
    if options.address is not None and (port := getattr(source, "port", None)) is not None:
        where += f" (port {port})"
    _tell_endpoints(source, given, options.server_certificate, where)
    try:
        findings = asyncio.run(source.ask())
    except InputError:
        raise
    except NotLetIn as error:
        raise InputError.at(where, "", f"not let in: {because(error)}") from error
    except (OSError, EOFError, SeerobError) as error:
        remedy = "is it switched on, is the address right, does a firewall stand between?"
        raise InputError.at(where, "", because(error), remedy) from error
    for finding in findings:
        line(finding.level, finding.text, "" if finding.level == "note" else "yellow")
    from seerob.devices.variables.live_source import VariablesSource

    if isinstance(source, VariablesSource):
        return _variables(source, options.kind, given, options.seconds)
    if options.calibration is not None:
        _save_calibration(source, options.calibration, where)
    newest: dict[str, Sample] = {}
    qualities: Counter[str] = Counter()

    def hear(sample: Sample) -> None:
        newest[type(sample).__name__] = sample
        if not isinstance(sample, SignalSample):
            qualities[sample.quality] += 1

    listener = Listener(source, None, hear)
    stopped = Stopped()
    end = time.monotonic() + options.seconds
    listener.start()
    while time.monotonic() < end and not stopped():
        time.sleep(0.02)
    listener.ask_to_stop()
    listener.join(1.0)
    if not newest:
        line("nothing", f"heard in {options.seconds:g} s", "yellow")
        return Exit.ERROR
    statistics = listener.statistics()
    line("heard", str(statistics))
    if statistics.offset is not None:
        line("clock", f"host less device {statistics.offset:.3f} s")
    line("quality", ", ".join(f"{count} {quality}" for quality, count in qualities.items()))
    for sample in newest.values():
        _tell(sample)
    rate = heard_rate(source, given, statistics.rate)
    if rate is not None:
        line("note", f"heard {rate} times a second: frequency = {rate} below")
        given["frequency"] = rate
    OUT.print(_snippet(options.kind, given), markup=False)
    if source.asks and source.asks.split()[1] not in given:
        OUT.print(source.asks, markup=False)
    return Exit.WITHIN


def _workstation(path: Path, allow: Allowed) -> int:
    """Ask every live source of a workstation what it has; `Exit.ERROR` when one is not reached."""
    from seerob.app.commands.run import reach
    from seerob.app.console.loading import compiled

    station = compiled(path, allow)
    before = {f for _, opened in station.sources for f in opened.findings}
    reach(station)
    said = [f for _, opened in station.sources for f in opened.findings if f not in before]
    for finding in said:
        style = "" if finding.level == "note" else "yellow"
        line(finding.level, f"{finding.subject}: {finding.text}", style)
    return Exit.ERROR if any(TRIED_AGAIN in f.text for f in said) else Exit.WITHIN


def heard_rate(source: LiveSource, given: dict[str, object], rate: float | None) -> int | None:
    """What ``frequency`` should be [Hz]; None when it is right, was asked for, or is no option of the source.

    Args:
        source: As it was heard.
        given: Its options.
        rate: Samples per second.
    """
    import msgspec

    assumed = getattr(source, "frequency", None)
    if assumed is None or rate is None or "frequency" in given or abs(rate / assumed - 1) < NEAR:
        return None
    try:
        msgspec.convert({**given, "frequency": round(rate)}, type(source))
    except msgspec.ValidationError:
        return None  # it takes more than another frequency, a longer timeout for one
    return round(rate)


def _variables(source: VariablesSource, kind: str, given: dict[str, object], wait: float) -> int:
    """Print what a device has, and how regularly; a dictionary says what it means."""
    import asyncio

    from seerob.app.commands.variables import nodes_of
    from seerob.devices.live.listening import because

    try:
        nodes = asyncio.run(nodes_of(source))
    except InputError as error:
        line("note", "; ".join(f"{p.what}: {p.remedy}" for p in error.problems))
        nodes = []
    except (OSError, EOFError, SeerobError) as error:
        raise InputError.at(kind, "", because(error), "is it switched on, is the address right?") from error
    for node in nodes[:MOST_SHOWN]:
        unit = f" [{node.unit}]" if node.unit else ""
        line(node.type or "variable", f"{node.address} = {node.value}{unit}")
    if len(nodes) > MOST_SHOWN:
        line("", f"… {len(nodes) - MOST_SHOWN} more")
    if nodes:
        try:
            tell_heard(source, nodes[:MOST_SHOWN], wait)
        except (OSError, EOFError, SeerobError) as error:
            line("heard", f"nothing: {because(error)}", "yellow")
    name = kind if source.name == "" else source.name
    if nodes:
        line("note", f"seerob variables my_cell --browse {name} writes a dictionary of them")
    OUT.print(_snippet(kind, {"name": name} | given), markup=False)
    return Exit.WITHIN


def _tell_endpoints(source: LiveSource, given: dict[str, object], save: Path | None, where: str) -> None:
    """Say what an OPC UA server offers and whose certificate it shows; pin that where it is asked for.

    Args:
        source: As it was given.
        given: Its options; the file is added.
        save: Where the certificate is written to.
        where: For messages.

    Raises:
        InputError: There is no certificate to write, or it cannot be.
    """
    import asyncio

    from seerob.devices.live.listening import because
    from seerob.devices.sources.opcua import Opcua
    from seerob.devices.sources.opcua_robot import OpcuaRobot
    from seerob.protocols.plc.opcua_client import endpoints
    from seerob.protocols.plc.opcua_security import certificate, chosen, pem_of

    if not isinstance(source, Opcua | OpcuaRobot):
        if save is not None:
            what = "its protocol has no certificate of the server to write"
            raise InputError.at(where, "--server-certificate", what, "leave it out")
        return
    try:
        offered = asyncio.run(endpoints(source.url))
    except (OSError, SeerobError) as error:
        raise InputError.at(where, "", because(error), "is it switched on, is the address right?") from error
    for each in offered:
        line("offers", str(each))
    way = chosen(offered, source.security.value) or next((e for e in offered if e.certificate), None)
    if way is not None and way.certificate:
        line("server", f"its certificate: {certificate(way.certificate)}")
    if save is None:
        return
    if way is None or not way.certificate:
        raise InputError.at(where, "--server-certificate", "the server shows none", "leave it out")
    try:
        with save.open("xb") as file:
            file.write(pem_of(way.certificate))
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError.at(save, "--server-certificate", what, "give the name of a new file") from error
    given["server_certificate"] = str(save)
    line("wrote", f"{save}: compare its fingerprint with what the server itself shows", "bold")


def _save_calibration(source: LiveSource, path: Path, where: str) -> None:
    """Read the kinematics of the very robot, and write them."""
    import asyncio
    from datetime import datetime

    from seerob.description.robots.calibration import written
    from seerob.devices.live.listening import because
    from seerob.devices.sources.rtde import Rtde

    if not isinstance(source, Rtde):
        what = "its protocol does not tell the kinematics of the very robot"
        raise InputError.at(where, "--calibration", what, "leave it out")
    try:
        found = asyncio.run(source.calibration())
    except (OSError, EOFError, SeerobError) as error:
        remedy = (
            "is the primary interface on? it is a service of its own in the controller's security settings"
        )
        raise InputError.at(where, "--calibration", because(error), remedy) from error
    date = datetime.now().astimezone().strftime("%Y-%m-%d")
    try:
        with path.open("x") as file:
            file.write(
                written(found, f"Kinematics of the robot at {source.host}, read {date} by seerob probe")
            )
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError.at(path, "--calibration", what, "give the name of a new file") from error
    line("wrote", f'{path}; in the robot\'s table: calibration = "{path.name}"', "bold")


def _source(options: argparse.Namespace) -> tuple[LiveSource, dict[str, object]]:
    """The source, and the options that make it."""
    from seerob.core.errors import Problem
    from seerob.core.extras import need
    from seerob.core.plugin import load
    from seerob.devices.live.listening import LiveSource
    from seerob.workstation.conversion import convert
    from seerob.workstation.source import Source

    kind = load("sources", options.kind, Source)
    if not issubclass(kind, LiveSource):
        what = f"{options.kind} plays a file: there is no controller to ask"
        raise InputError.at("seerob probe", "kind", what, "seerob check-file says what its file lacks")
    fields = set(kind.__struct_fields__)
    given = {key: getattr(options, key) for key in ("robot", "human", "port", "frequency")}
    given = {key: value for key, value in given.items() if value is not None and key in fields}
    if options.address is not None:
        where = next((name for name in ADDRESSES if name in fields), None)
        if where is None:
            what = f"{options.kind} has no address: it is sent to this machine"
            raise InputError.at("seerob probe", "address", what, "leave it out")
        given[where] = options.address
    given |= options_of(options.set)
    problems: list[Problem] = []
    source = convert(given, kind, file=f"seerob probe {options.kind}", key="", problems=problems)
    if source is None:
        raise InputError(problems)
    need(*source.loads)
    return source, given


def options_of(pairs: list[str], command: str = "seerob probe") -> dict[str, object]:
    """Options of a source from ``KEY=VALUE`` texts, values as in the workstation file.

    Args:
        pairs: Of the command line.
        command: For messages.

    Raises:
        InputError: One of them is no such text.
    """
    import tomllib

    found: dict[str, object] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not (equals and key.isidentifier()):
            raise InputError.at(command, "--set", f"{pair!r}", "write key=value")
        found[key] = text  # a bare word, which a shell takes the quotes of
        with suppress(ValueError, RecursionError):
            read = tomllib.loads(f"value = {text}")
            if len(read) == 1:
                found[key] = read["value"]
    return found


def _tell(sample: Sample) -> None:
    from seerob.core.samples import BodySample, GrabSample, JointSample, PoseSample, SignalSample

    if isinstance(sample, BodySample):
        seen = [point for point in sample.points if point.position is not None or point.wxyz is not None]
        line("person", f"{sample.subject or 'no name'}: {len(seen)} of {len(sample.points)} points are seen")
        for point in sample.points:
            text = (
                "not seen" if point.position is None else "{:+.3f} {:+.3f} {:+.3f} m".format(*point.position)
            )
            line("point", f"{point.name} ({point.bone}): {text}")
    elif isinstance(sample, JointSample):
        for name, unit, values in (
            ("q", "rad", sample.q),
            ("qd", "rad/s", sample.qd),
            ("tau", "N·m", sample.tau),
        ):
            text = "not heard" if values is None else f"{' '.join(f'{x:+.4f}' for x in values)} {unit}"
            line(name, text)
    elif isinstance(sample, PoseSample):
        place = " ".join(f"{x:+.4f}" for x in sample.position)
        turn = " ".join(f"{x:+.4f}" for x in sample.wxyz)
        line("pose", f"{sample.target}: {place} m, w x y z {turn}")
    elif isinstance(sample, GrabSample):
        line("grab", f"{sample.target}: {sample.piece or 'nothing'}")
    elif isinstance(sample, SignalSample):
        for name, value in sample.values.items():
            line("signal", f"{name} = {value:.4f}" if isinstance(value, float) else f"{name} = {value}")
        for reason in sample.doubts.values():
            line("reason", reason, "yellow")


def _snippet(kind: str, given: dict[str, object]) -> str:
    from seerob.files.tables.mapping import toml_value

    shown = (f"{key} = {toml_value(value)}" for key, value in given.items())
    return "\n".join(["", "[[sources]]", f'kind = "{kind}"', *shown])

"""``seerob run``: live, with the page, a recording, and a report at the end."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from msgspec.structs import replace

from seerob.app.console.interruption import Stopped
from seerob.app.console.loading import compiled
from seerob.app.console.progress import announced, spinner
from seerob.app.console.sinks import add_pdf, file_of, opened_sinks, refuse_existing, sinks_of, tell_files
from seerob.app.console.terminal import (
    Exit,
    add_allowed,
    add_verbose,
    allowed,
    describe,
    exit_code,
    line,
    run_folder,
    seconds,
    tell,
    tell_results,
)
from seerob.app.console.visiting import add_page, tell_pages, visiting
from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.workstation.workstation import locate

if TYPE_CHECKING:
    from seerob.app.emulation.ports import Move
    from seerob.app.emulation.processes import Running
    from seerob.core.snapshot import Scene
    from seerob.devices.live.camera_pictures import Cameras
    from seerob.outputs.sink import Writer
    from seerob.session.station import Station
    from seerob.session.writing import CartesianTargets, Triggers

HELP = "run a workstation live: sources connect, the page opens, recording starts"
EXAMPLE = "seerob run my_cell            (then open the address it prints; Ctrl-C ends the run)"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument(
        "workstation", type=Path, nargs="?", help="folder with a workstation.toml, or the file itself"
    )
    add_allowed(sub)
    add_live(sub)
    sub.add_argument(
        "--allow-writing",
        action="store_true",
        help="let the workstation's triggers write to machines, where its file allows it too",
    )
    text = "start what stands for its devices ([[emulators]]), and end it afterwards"
    sub.add_argument("--emulated", action="store_true", help=text)
    text = "let pages edit the file meanwhile: every edit begins the run anew, nothing is recorded or written"
    sub.add_argument("--edit", action="store_true", help=text)
    sub.add_argument("--replay", type=Path, metavar="FILE", help="show this recording, as seerob replay does")


def add_live(sub: argparse.ArgumentParser) -> None:
    """Options of every live run: its page, what it writes, how long it lasts."""
    add_page(sub)
    add_verbose(sub)
    add_pdf(sub)
    sub.add_argument(
        "-o", "--output", type=Path, help="folder to write to (default: runs/<time> beside the workstation)"
    )
    text = "also record what visitors call themselves; without it they are numbers"
    sub.add_argument("--record-names", action="store_true", help=text)
    text = "fetch pictures of [[cameras]] from this host, too; those on this machine always are"
    sub.add_argument("--allow-camera", action="append", default=[], metavar="HOST", help=text)
    sub.add_argument("--no-record", action="store_true", help="no recording and no report")
    sub.add_argument("--seconds", type=seconds, help="end the run after this time")


def run(options: argparse.Namespace) -> int:
    """Run until Ctrl-C, then write the report.

    Raises:
        InputError: There is nothing to run, or it cannot be used as it is.
    """
    if options.replay is not None:
        from seerob.app.commands import replay

        return replay.show(options.replay, options)
    if options.workstation is None:
        raise InputError.at("seerob run", "workstation", "missing", "name a folder, or --replay FILE")
    station = compiled(options.workstation, allowed(options))
    describe(station)
    with _emulated(station, locate(options.workstation), wanted=options.emulated) as running:
        if moves := tuple(move for each in running for move in each.moves):
            from seerob.app.emulation.ports import at_ports

            station = at_ports(station, moves)
        reach(station)
        scene = station.scene()
        said = tuple(
            Finding(level="assumed", subject=each.key, text=f"no device, an emulator ({each.kind}) {each.at}")
            for each in running
        )
        scene = replace(scene, findings=(*scene.findings, *said))
        tell(scene.findings, verbose=options.verbose)
        found = _edited(station, options, moves) if options.edit else live(station, scene, options, running)
        for each in running:
            if each.ended:
                line("warning", f"{each.key}: the emulator ({each.kind}) ended by itself", "yellow")
    return found


def _edited(station: Station, options: argparse.Namespace, moves: Sequence[Move]) -> int:
    """Run the draft that pages edit; what it came to is of no file and no verdict.

    Raises:
        InputError: Something is asked for that only a run of one workstation has.
    """
    from seerob.app.commands.edit import edited

    for name in ("output", "pdf", "allow_writing"):
        if getattr(options, name):
            option = f"--{name.replace('_', '-')}"
            raise InputError.at("seerob run", option, "not with --edit", "leave one of them out")
    line("note", "a trial: nothing is recorded, reported or written to machines; edits begin it anew")
    edited(station, options, running=True, moves=moves)
    return Exit.WITHIN


@contextmanager
def _emulated(station: Station, file: Path, *, wanted: bool) -> Iterator[tuple[Running, ...]]:
    """What stands for the devices of a workstation meanwhile, where that is wanted.

    Raises:
        InputError: One of them cannot be had, or none is named.
    """
    emulators = station.workstation.emulators
    if not wanted:
        if emulators:
            line(
                "note", f"its devices are expected to be there; --emulated starts {len(emulators)} emulators"
            )
        yield ()
        return
    if not emulators:
        raise InputError.at(file, "emulators", "none is named", "add [[emulators]], or leave out --emulated")
    from seerob.app.emulation.processes import emulated

    with ExitStack() as stack:
        with spinner() as say:
            say("starting emulators")
            running = stack.enter_context(emulated(emulators, file, station.workstation.sources))
        for each in running:
            line("emulates", f"{each.kind} {each.at}: {each.what.split(';')[0]}", "bold")
            for move in each.moves:
                line("note", f"{each.kind}: {move}", "yellow")
        yield running


def reach(station: Station) -> None:
    """Say whom the run connects to and as whom, then ask them what they have.

    Raises:
        InputError: One of them is not what its source can use.
    """
    for name, contact in station.contacts().items():
        line("connects", f"{name}: {contact}")
    with spinner() as say:
        say("asking live sources")
        station.reach()


def live(
    station: Station, scene: Scene, options: argparse.Namespace, emulators: Sequence[Running] = ()
) -> int:
    """Show, judge and record until Ctrl-C or the time is over."""
    from seerob.app.server.live import LiveView
    from seerob.outputs.sink import RecordsPictures, RecordsVisitors
    from seerob.session.measuring import Ruler

    folder = run_folder(station.model.folder, options.output)
    sinks = [] if options.no_record else sinks_of(station.workstation, lossless=False, pdf=options.pdf)
    refuse_existing(sinks, folder)
    scene, cameras = _cameras(station, scene, options.allow_camera)
    stopped = Stopped()
    with (
        ExitStack() as seen,
        LiveView(
            scene=scene,
            meshes=station.model.meshes,
            host=options.host,
            port=options.port,
            ruler=Ruler(lambda: station.model),
            cameras=cameras,
            **visiting(options),
        ) as view,
    ):
        for camera in cameras.of.values():
            seen.enter_context(camera)
        if view.server.notice:
            line("note", view.server.notice)
        now = 0.0

        def over() -> bool:
            return stopped() or (options.seconds is not None and now >= options.seconds)

        def note(t: float) -> None:
            nonlocal now
            now = t

        with spinner() as say, opened_sinks(station, sinks, folder, scene) as opened:
            files = announced(opened, list(map(file_of, sinks)), say, outlived=True)
            writers: list[Writer] = [view, *files]
            for writer in opened:
                if isinstance(writer, RecordsVisitors):
                    writer.watch(view.server.visits)
                    view.server.visits.names = options.record_names
                if isinstance(writer, RecordsPictures):
                    writer.look(cameras)
            tell_pages(view.server, "Ctrl-C ends the run", options)
            for each in emulators:
                each.find_page(view.server.port)
            _tell_ends(station)
            writers += _triggers(station, allow=options.allow_writing)
            targets = _targets(station, allow=options.allow_writing)
            writers += targets
            summary = station.run(writers=writers, live=True, scene=scene, stop=over, progress=note)
    line("ran", f"{summary.duration:.1f} s" + _slipped(summary.slipped))
    _tell_rest(station, summary.duration)
    for way in (way for each in targets for way in each.ways):
        line("sent", str(way), "" if way.published else "yellow")
    for name in sorted(station.contacts().keys() & summary.sources.keys()):
        heard = summary.sources[name]
        line("source", f"{name}: {heard}", "" if heard.heard and not heard.losses else "yellow")
    for name, (late, bound) in summary.late.items():
        text = f"{name}: heard up to {1e3 * late:.0f} ms later than at its best; {1e3 * bound:.0f} ms may be"
        line("late", text, "yellow" if late > bound else "")
    tell_results(summary)
    return exit_code(summary.verdict) if tell_files(sinks, folder, files) else Exit.ERROR


def _cameras(station: Station, scene: Scene, hosts: Sequence[str]) -> tuple[Scene, Cameras]:
    """Cameras whose pictures may be fetched; of the others the scene says why they are not."""
    from seerob.devices.live.camera_pictures import CameraPictures, Cameras, allowed

    of, recorded, infos = {}, {}, []
    for i, (camera, info) in enumerate(zip(station.workstation.cameras, scene.cameras, strict=True)):
        infos.append(info)
        if camera.address is None:
            continue
        if not allowed(camera.address, hosts):
            why = f"its pictures are on another machine: --allow-camera {urlsplit(camera.address).hostname}"
            line("note", f"camera {camera.name}: {why}")
            infos[i] = replace(info, mistake=why)
            continue
        line("camera", f"{camera.name}: {camera.address}" + (", recorded" if camera.record else ""))
        of[i] = CameraPictures(camera.address, info.size, always=camera.record)
        if camera.record:
            recorded[camera.name] = of[i]
    return replace(scene, cameras=tuple(infos)), Cameras(of, recorded)


def _tell_ends(station: Station) -> None:
    """Say whose file ends while the run goes on: nobody says where they are from then on."""
    for source, opened in station.sources:
        if source.target() and opened.duration > 0 and not source.loop:
            text = (
                f"{source.target()}: {source.name} ends at {opened.duration:.1f} s; what depends on it "
                "is undecided from then on (loop = true in its source starts it again)"
            )
            line("note", text)


def _tell_rest(station: Station, ran: float) -> None:
    """Say whose file goes on where the run was ended: nobody has judged that.

    Args:
        station: The workstation.
        ran: How long it ran [s].
    """
    for source, opened in station.sources:
        rest = opened.duration - ran
        if source.target() and rest > station.model.workstation.engine.tick:
            text = (
                f"{source.target()}: {source.name or 'its source'} goes on to {opened.duration:.2f} s: "
                f"{rest:.2f} s of it were not evaluated, of which the verdict says nothing"
            )
            line("warning", text, "yellow")


def _triggers(station: Station, *, allow: bool) -> list[Triggers]:
    """What writes to machines; nothing unless file and command line both allow it, which is said."""
    from seerob.session.writing import Triggers, allowed

    names = ", ".join(trigger.variable for trigger in station.workstation.triggers)
    if allowed(station.model, on_command_line=allow):
        line("writes", f"{names}: workstation file and command line both allow it", "yellow")
        return [Triggers(station.model, on_command_line=allow)]
    if names:
        line("note", f"writes nothing: {names} would need {_missing(station)}")
    elif allow and not station.workstation.targets:
        line("note", "writes nothing: the workstation has no triggers")
    return []


def _targets(station: Station, *, allow: bool) -> list[CartesianTargets]:
    """What publishes Cartesian targets; nothing unless file and command line both allow it, which is said."""
    from seerob.session.writing import CartesianTargets, targets_allowed

    topics = ", ".join(f"{target.topic} ({target.host})" for target in station.workstation.targets)
    if targets_allowed(station.model, on_command_line=allow):
        line("targets", f"{topics}: workstation file and command line both allow it", "yellow")
        return [CartesianTargets(station.model, on_command_line=allow)]
    if topics:
        line("note", f"publishes no targets: {topics} would need {_missing(station)}")
    return []


def _missing(station: Station) -> str:
    return "--allow-writing" if station.workstation.allow_writing else "allow_writing = true in the file"


def _slipped(lost: float) -> str:
    return f", {lost:.1f} s behind real time: this machine is too slow for the workstation" if lost else ""

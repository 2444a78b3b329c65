"""The Python API: a workstation that has been read and compiled, its runs, and that of a recording."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace as replaced
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec.structs import replace
from numpy.typing import ArrayLike

from seerob.core.errors import InputError, Problem
from seerob.core.plugin import PluginError
from seerob.core.samples import Sample
from seerob.core.snapshot import Finding, Scene, Snapshot
from seerob.criteria.contact.measured import curves
from seerob.criteria.criterion import Criterion
from seerob.devices.live.headset_offers import HasOffers
from seerob.devices.live.listening import Contact, LiveSource, name_of
from seerob.devices.live.receivers import Clock, Receivers, hear, require_recorded
from seerob.model.model import Model
from seerob.model.mounting.compilation import Progress, compile_workstation
from seerob.model.mounting.in_place import implausible
from seerob.model.mounting.things import MadeArea
from seerob.outputs.notebook import criteria_html
from seerob.outputs.sentences import counted
from seerob.outputs.sink import Closing, Sink, Writer
from seerob.recording.format import SOURCES, source_files
from seerob.recording.recording import Recording
from seerob.session import run as road
from seerob.session.opening import open_sources, reached, source_target
from seerob.session.reading import read
from seerob.session.run import Bound, Feed, Summary
from seerob.session.scene import scene_of, unmet_phases
from seerob.twin.controller_check import ControllerLog, controller_log
from seerob.twin.states import motion_of
from seerob.workstation.allowed import Allowed
from seerob.workstation.source import Opened, Source
from seerob.workstation.workstation import Workstation, file_among

if TYPE_CHECKING:
    from anywidget import AnyWidget

    from seerob.outputs.film import Film
    from seerob.session.batch import Batch
    from seerob.session.explanation import Explanation
    from seerob.session.identification.identify import Identified, Known
    from seerob.session.permissible import evaluation
    from seerob.session.permissible.evaluation import PermissibleSpeed, Say, Wish
    from seerob.session.permissible.joint_limits import Given


class Station:
    """A workstation, read and compiled.

    Attributes:
        workstation: What the file says.
        model: The compiled twin.
    """

    def __init__(
        self, workstation: Workstation, *, cache: Path | None = None, progress: Progress = lambda _: None
    ) -> None:
        """Compile a workstation; see `load` for the usual way.

        Raises:
            InputError: With every mistake in every file that it names.
        """
        self.workstation = workstation
        self._cache = cache
        made = self._swept_areas(cache, progress)
        self.model: Model = compile_workstation(workstation, cache=cache, progress=progress, made=made)

    def __repr__(self) -> str:
        return f"<Station {self.workstation.title!r}: {self._counts()}>"

    def _repr_html_(self) -> str:
        infos = scene_of(self.model, self.bound, [], files={}).criteria
        return criteria_html(self.workstation.title, self._counts(), infos)

    def _counts(self) -> str:
        """``two robots, one person, 18 criteria``."""
        roles = [mechanism.role for mechanism in self.model.mechanisms.values()]
        criteria = len(self.workstation.safety) + len(self.workstation.ergonomics)
        every = (
            (roles.count("robot"), "robot", "robots"),
            (roles.count("human"), "person", "people"),
            (roles.count("machine"), "machine", "machines"),
            (criteria, "criterion", "criteria"),
        )
        return ", ".join(counted(n, one, many) for n, one, many in every if n)

    def __getstate__(self) -> dict[str, object]:
        """What the file says; who reads it back compiles it again, from the same files or not at all."""
        return {"workstation": self.workstation, "cache": self._cache, "files": _digests(self.model.files)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Compile again.

        Raises:
            InputError: A file of the workstation is another than it was.
        """
        self.__init__(state["workstation"], cache=state["cache"])  # type: ignore[misc]
        now, then = _digests(self.model.files), state["files"]
        changed = [name for name in {**then, **now} if now.get(name) != then.get(name)]
        if changed:
            what = "changed since the workstation was pickled"
            raise InputError.at(changed[0], "", what, "load the workstation again in this process")

    def _swept_areas(self, cache: Path | None, progress: Progress) -> dict[str, MadeArea]:
        """Areas that are swept, from a run of the same workstation without them."""
        if not any(area.swept for area in self.workstation.areas):
            return {}
        from seerob.session.areas import in_place, make, without_swept

        with in_place(self.workstation):
            bare = Station(without_swept(self.workstation), cache=cache, progress=progress)
            bound = bare.bound
        return make(
            self.workstation, bare.model, bound, bare.files, lambda writer: bare.run(writers=[writer]),
            cache=cache, progress=progress,
        )  # fmt: skip

    @cached_property
    def bound(self) -> tuple[Bound, ...]:
        """Its criteria and rules, names resolved."""
        return road.bind(self.model)

    @cached_property
    def sources(self) -> tuple[tuple[Source, Opened], ...]:
        """Its sources, opened and checked; nothing is connected to until `reach`."""
        return open_sources(self.model)

    def contacts(self) -> dict[str, Contact]:
        """Whom a live run connects to, where it listens and as whom, by the name of the source."""
        live = (source for source in self.workstation.sources if isinstance(source, LiveSource))
        return {name_of(source): source.contact() for source in live}

    def reach(self) -> None:
        """Ask every live source what it has, once, which connects; `scene` tells what they said.

        Raises:
            InputError: One can be reached, and is not what its source can use.
        """
        self.sources = reached(self.model, self.sources)

    @property
    def duration(self) -> float:
        """Length of its longest source [s]."""
        return road.ends_at(self.sources)

    def scene(self, *, with_sources: bool = True) -> Scene:
        """What sinks and the page need to know once."""
        opened = self.sources if with_sources else ()
        return scene_of(
            self.model,
            self.bound,
            [
                *(f for _, o in opened for f in o.findings),
                *(unmet_phases(self.model, self.bound, road.ends_at(opened)) if with_sources else ()),
            ],
            files=self.files,
            fed=not with_sources,
        )

    def first(self, scene: Scene) -> Snapshot:
        """What a run begins with: everybody where the first samples of files have them, judged.

        Args:
            scene: Of this workstation; nothing that one of its findings holds is within.

        Raises:
            SimulationDiverged: The physics produced a number that is not finite.
        """
        feed = road.pump(self.sources, self.workstation.engine.tick, endless=True)
        judge = road.Judge(self.bound, scene.findings)
        snapshot, _ = next(road.ticks(road.engine_of(self.model), judge, feed))
        return snapshot

    @cached_property
    def files(self) -> dict[str, bytes]:
        """The workstation file and every file it names, trajectories and tables of limits included."""
        station = self.workstation
        named = [getattr(source, "file", None) for source in station.sources]
        named += [getattr(rule, "limits", None) for rule in (*station.safety, *station.ergonomics)]
        named += [getattr(rule, "table", None) for rule in station.ergonomics]
        named += [getattr(rule, "map", None) for rule in station.safety]
        measured = [
            name for rule in station.safety if isinstance(name := getattr(rule, "measurements", None), str)
        ]
        named += [*measured, *(curve for name in measured for curve in curves(self.model.folder / name))]
        named += [station.report.logo, *(camera.calibration for camera in station.cameras)]
        named += [getattr(each, name, None) for each in station.emulators for name in ("file", "waypoints")]
        references = [name for name in named if isinstance(name, str)]
        return {
            **self.model.files,
            **source_files(references, folder=self.model.folder, outside=station.outside),
        }

    def with_criteria(self, *criteria: Criterion) -> Station:
        """Return the compiled workstation with more safety criteria; nothing is compiled again."""
        other = object.__new__(Station)
        other._cache = self._cache
        other.workstation = replace(self.workstation, safety=(*self.workstation.safety, *criteria))
        model = replaced(self.model, workstation=other.workstation)
        findings = tuple(dict.fromkeys((*model.findings, *implausible(model))))
        other.model = replaced(model, findings=findings)
        return other

    def with_addresses(self, workstation: Workstation) -> Station:
        """Return the compiled workstation with sources and targets elsewhere; nothing is compiled again.

        Args:
            workstation: The same but for their addresses.
        """
        other = object.__new__(Station)
        other._cache, other.workstation = self._cache, workstation
        other.model = replaced(self.model, workstation=workstation)
        return other

    def open_sinks(self, sinks: Sequence[Sink], folder: Path, scene: Scene) -> list[Writer]:
        """Open sinks for one run, all or none.

        Raises:
            InputError: One of them cannot be opened; the others are closed again.
            PluginError: One gives what cannot be written to.
        """
        opened: list[Writer] = []
        if not sinks:
            return opened
        new = not folder.exists()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            what = f"cannot be made: {error.strerror}"
            raise InputError.at(folder, "", what, "give a folder that may be written") from error
        try:
            for sink in sinks:
                opened.append(sink.open(scene, self.model.meshes, self.files, folder))
                if lacks := [
                    name for name in ("write", "close", "__exit__") if not hasattr(opened[-1], name)
                ]:
                    raise PluginError(
                        f"open of {type(sink).__module__} gives {type(opened[-1]).__name__}, which has no "
                        f"{', no '.join(lacks)}: derive it from seerob.api.Closing, with a write"
                    )
                own = type(opened[-1])
                if getattr(own, "close", None) is Closing.close and not own.__module__.startswith("seerob."):
                    raise PluginError(
                        f"open of {type(sink).__module__} gives {own.__name__}, which has no close: define "
                        "it, to finish what it writes, or to do nothing"
                    )
        except BaseException:
            for writer in opened:
                if hasattr(writer, "close"):
                    writer.close()
            if new and not any(folder.iterdir()):
                folder.rmdir()
            raise
        return opened

    def run(
        self,
        *,
        folder: Path | str | None = None,
        sinks: Sequence[Sink] = (),
        writers: Sequence[Writer] = (),
        live: bool = False,
        feed: Feed | None = None,
        end: float = math.inf,
        scene: Scene | None = None,
        before: tuple[Iterable[Snapshot], str] | None = None,
        stop: Callable[[], bool] = lambda: False,
        progress: Callable[[float], None] = lambda _: None,
    ) -> Summary:
        """Run from the first to the last sample of the sources.

        Args:
            folder: Where ``sinks`` write; needed when there are any.
            sinks: Opened for this run and closed after it.
            writers: Sinks that are open already; closed after the run too.
            live: In real time and without end (until ``stop``), instead of as fast as possible.
            feed: What is heard, instead of the workstation's sources.
            end: When that ends, and the last tick with it [s]; a motion that ends within a tick is
                undecided there when not given.
            scene: The one that ``writers`` were opened with.
            before: What was said of the same samples, and by whom: nothing is within that was not.
            stop: Asked once per tick.
            progress: Told the run time once per tick [s].

        Returns:
            The results by criterion, ``summary.results["tcp speed"].max()``, and how it went.

        Raises:
            InputError: A source, a criterion or a sink cannot be used as the file has it, or a live
                source is asked to run in any other than real time.
            SimulationDiverged: The physics gave up, or produced a number that is not finite.
        """
        if sinks and folder is None:
            raise InputError.at("run", "folder", "missing", "sinks need a folder to write to")
        heard: tuple[LiveSource, ...] = ()
        given = feed
        if feed is None and live:
            heard = tuple(s for s in self.workstation.sources if isinstance(s, LiveSource))
            self.reach()
        elif feed is None:
            require_recorded(self.workstation)
        clock = Clock() if live else None
        scene = scene or self.scene(with_sources=feed is None)
        if heard:  # also what was asked after a scene was made counts
            said = (f for _, opened in self.sources for f in opened.findings)
            scene = replace(scene, findings=tuple(dict.fromkeys((*scene.findings, *said))))
        if feed is None:
            end = math.inf if live else self.duration
            feed = road.pump(
                self.sources,
                self.workstation.engine.tick,
                endless=live,
                ahead=road.looks_ahead(self.model),
            )
        lines: road.Lines = dict
        with ExitStack() as until_the_end:
            if clock and heard:
                targets = [(source, source_target(self.model, source)) for source in heard]
                offers = next((w.offers for w in writers if isinstance(w, HasOffers)), None)
                listening = until_the_end.enter_context(Receivers(targets, offers))
                lines = listening.lines
                road.warm_up(self.model)  # while they begin
                feed = hear(feed, listening, clock)
            bound = self.bound  # refused, if so, before anything is open
            opened = self.open_sinks(sinks, Path(folder or "."), scene) if sinks else []
            summary = road.run(
                self.model,
                feed,
                bound=bound,
                scene=scene,
                before=before,
                end=end,
                writers=[*opened, *writers],
                clock=clock,
                lines=lines,
                stop=stop,
                progress=progress,
            )
        # A run of recorded sources is a function of them: the same samples, the same ticks.
        recorded = not live and given is None
        return replaced(summary, again=lambda: self._film(scene, end)) if recorded else summary

    def _film(self, scene: Scene, end: float) -> Film:
        """Frames of a run of the recorded sources."""
        from seerob.outputs.film import Film

        film = Film(scene, self.model.meshes)
        self.run(writers=[film], scene=scene, end=end)
        return film

    def show(self, *, height: int = 480) -> AnyWidget:
        """Show in a notebook where everybody begins, judged there: the page's scene, offline.

        Args:
            height: Of the scene [px].

        Raises:
            MissingPackage: anywidget is not installed (extra ``notebook``).
        """
        from seerob.outputs.film import Film

        scene = self.scene()
        film = Film(scene, self.model.meshes)
        film.write(self.first(scene))
        return film.widget(height=height, verdict="at the start, not run")

    def batch(
        self,
        q: Mapping[str, ArrayLike] | None = None,
        qd: Mapping[str, ArrayLike] | None = None,
        *,
        t: ArrayLike | None = None,
        threads: int | None = None,
    ) -> Batch:
        """Every criterion at many instants, in arrays; nothing is pulled, drawn or recorded.

        Every criterion is asked at every instant, also one with a period; see `seerob.session.batch`.

        Args:
            q: Positions of the commanded joints of robots and humans by name [rad or m], shape (N, n) each;
                who is not named stands where the file says. Without it, what the workstation's sources
                say at every tick.
            qd: Velocities likewise [rad/s or m/s].
            t: Instants of ``q``, increasing [s], shape (N,); the ways from each to the next are judged too,
                and what comes next is known, as in a run of a file.
                When not given they are instants of their own, a tick apart.
            threads: How many work at once; as many as there are processors when not given.

        Returns:
            By criterion values, limits and verdicts: ``station.batch()["tcp speed"].value``.

        Raises:
            InputError: Arrays that do not fit, or a live source without them.
        """
        from seerob.session import batch
        from seerob.session.recorded_motion import recorded

        findings: list[Finding] = []
        if q is None:
            if qd is not None or t is not None:
                raise InputError.at("batch", "q", "missing", "give positions with qd and t, or none of them")
            require_recorded(self.workstation)
            feed = road.pump(self.sources, self.workstation.engine.tick)
            motion = recorded(self.model, feed, self.duration)
            findings = [found for _, opened in self.sources for found in opened.findings]
        else:
            motion = motion_of(self.model, q, qd or {}, t)
        threads = threads or os.cpu_count() or 1
        return batch.judged(self.model, self.bound, motion, threads=threads, findings=findings)

    def identify(self, robot: str, carrying: Station | None = None, known: Known | None = None) -> Identified:
        """Base inertial parameters and friction of a robot by the torques that a recorded source measured.

        Args:
            robot: Its name; it carries nothing in this workstation, whatever the log was taken with.
            carrying: A workstation with the same robot, whose log was taken with a payload on it.
            known: What turns currents into torques, of a log that has no torques.

        Raises:
            InputError: No recorded source of it measures torques or currents, or it carries something.
            UnknownName: There is no such robot.
        """
        from seerob.model.mounting.specification import pose_matrix
        from seerob.session.identification.identify import NOTHING_KNOWN, identify

        found = self.model.robot(robot)
        if not found.alone or found.carried:
            what = "carries something here, or is carried"
            raise InputError.at("identify", found.name, what, "name a cell of the bare arm")
        (entry,) = (each for each in self.workstation.robots if each.name == found.name)
        gravity = pose_matrix(entry.base)[:3, :3].T @ np.array(self.model.mj.opt.gravity)
        more = None if carrying is None else carrying._torque_log(robot, currents=True)
        said = self._torque_log(found.name, currents=True)
        return identify(found.description, gravity, said, more, known or NOTHING_KNOWN)

    def _torque_log(self, name: str, *, currents: bool = False) -> ControllerLog:
        for source, opened in self.sources:
            if source.target() == name and not isinstance(source, LiveSource):
                said = controller_log(opened.samples, getattr(source, "file", source.name))
                if said is not None and (said.tau is not None or (currents and said.current is not None)):
                    return said
        remedy = (
            "log them: actual_current_as_torque of RTDE, measured torques of FRI, torque columns of a table"
        )
        raise InputError.at("torques", name, "no recorded source of it measures torques", remedy)

    def explain(self, robot: str) -> Explanation:
        """Whether the model explains the torques that a recorded source measured, and what would.

        Raises:
            InputError: No recorded source of that robot measures torques, or too little can be told.
            UnknownName: There is no such robot.
        """
        from seerob.session.explanation import explain as explained

        name = self.model.robot(robot).name
        return explained(self.model, name, self._torque_log(name))

    def permissible_speed(
        self,
        robot: str | None = None,
        *,
        wish: Wish | None = None,
        sources: evaluation.Sources | None = None,
        velocity: Given = None,
        acceleration: Given = None,
        jerk: Given = None,
        folder: Path | str | None = None,
        sinks: Sequence[Sink] = (),
        writers: Sequence[Writer] = (),
        ready: Callable[[PermissibleSpeed], None] = lambda found: None,
        say: Say = lambda what, share: None,
    ) -> PermissibleSpeed:
        """How fast a robot may go along its path, a motion that keeps to it, and the criteria asked of that.

        Args:
            robot: Its name; the only robot when not given.
            wish: Whose ceilings count, tolerances and spacings.
            sources: Opened, instead of the workstation's own, such as those of a recording.
            velocity: Limits of the joints, one for all or one each, instead of the robot's [rad/s or m/s].
            acceleration: Likewise [rad/s² or m/s²]; never assumed.
            jerk: Likewise [rad/s³ or m/s³]; never assumed.
            folder: Where ``sinks`` write.
            sinks: Of the run of the rescaled motion.
            writers: Sinks that are open already, of the same run.
            ready: Told what was found before the rescaled motion is run.
            say: Told what is done and which share of it, 0 to 1; what it raises stops the work.

        Raises:
            InputError: A limit that nobody gave, no criterion that limits the speed, a live source, or not
                exactly one source of the robot's motion.
        """
        from seerob.session.permissible import evaluation
        from seerob.session.permissible.joint_limits import limits_of

        if sources is None:
            require_recorded(self.workstation)
        names = [r.name for r in self.workstation.robots]
        if robot is None and len(names) != 1:
            what = f"missing, and there are {len(names)} robots"
            raise InputError.at(
                "permissible speed", "robot", what, f"name one of {', '.join(names) or 'none'}"
            )
        subject = self.model.robot(names[0] if robot is None else robot)
        played = self.sources if sources is None else sources
        motion, solved_from = evaluation.given_motion(self.model, played, subject.name)
        limits = limits_of(self.model, subject, velocity=velocity, acceleration=acceleration, jerk=jerk)
        scene = self.scene(with_sources=sources is None)
        seen = evaluation.witness(self.model, played, self.bound, scene.criteria, say)

        def again(feed: Feed, duration: float) -> Summary:
            def told(t: float) -> None:
                say("the rescaled motion", min(1.0, t / duration))

            return self.run(
                folder=folder,
                sinks=sinks,
                writers=writers,
                feed=feed,
                end=duration,
                scene=scene,
                progress=told,
            )

        return evaluation.evaluation(
            self.model,
            played,
            seen=seen,
            motion=motion,
            solved_from=solved_from,
            limits=limits,
            wish=wish or evaluation.Wish(),
            again=again,
            ready=ready,
            say=say,
        )

    def replay_scene(self, recording: Recording) -> Scene:
        """The scene of a recording that is computed again, with what was found when it was made and since."""
        findings = [f for f in recording.scene.findings if f not in self.model.findings]
        findings += recording.check()
        fed = not self.workstation.sources and any(tick.samples for tick in recording.ticks())
        return scene_of(self.model, self.bound, findings, files=self.files, fed=fed)

    def replay(
        self,
        recording: Recording,
        *,
        folder: Path | str | None = None,
        sinks: Sequence[Sink] = (),
        writers: Sequence[Writer] = (),
        stop: Callable[[], bool] = lambda: False,
        progress: Callable[[float], None] = lambda _: None,
    ) -> Summary:
        """Compute a recording again from its samples: same samples, same ticks, same figures.

        What another version called exceeded or undecided, of the same workstation, is not within now.

        Raises:
            InputError: The recording was made with another tick than this workstation has.
        """
        if abs(recording.scene.period - self.workstation.engine.tick) > 1e-12:
            raise InputError.at(
                recording.path,
                "period",
                f"recorded with a tick of {recording.scene.period} s",
                f"set engine.tick = {recording.scene.period} in the workstation file",
            )
        scene = self.replay_scene(recording)
        before = None
        if recording.scene.workstation_hash == scene.workstation_hash:
            before = recording.snapshots(), f"seerob {recording.scene.version}, which recorded it,"
        return self.run(
            folder=folder,
            sinks=sinks,
            writers=writers,
            feed=recording.heard(),
            end=recording.end,
            scene=scene,
            before=before,
            stop=stop,
            progress=progress,
        )


def _digests(files: Mapping[str, bytes]) -> dict[str, str]:
    return {name: sha256(content).hexdigest() for name, content in files.items()}


def load(
    path: Path | str, *, cache: Path | None = None, allow_plugins: bool = False, allow_outside: bool = False
) -> Station:
    """Read and compile a workstation.

    Args:
        path: A workstation file, or a folder with a ``workstation.toml``.
        cache: Folder that keeps what takes long to make between starts.
        allow_plugins: Whether dotted kinds that no installed package offers are imported by their names.
        allow_outside: Whether files outside the workstation's folder are read that it, or a description in
            it, names; which is logged before.

    Raises:
        InputError: With every mistake in the file and in the files it names.
    """
    return Station(read(path, Allowed(allow_plugins, allow_outside)), cache=cache)


_REMEDY = "give the workstation that it was made with (--workstation)"


def load_recorded(
    recording: Recording,
    *,
    cache: Path | None = None,
    allow_plugins: bool = False,
    allow_outside: bool = False,
) -> Station:
    """The workstation that a recording was made with, from the files inside it.

    Args:
        recording: The recording.
        cache: Folder that keeps what takes long to make between starts.
        allow_plugins: Whether dotted kinds that no installed package offers are imported by their names.
        allow_outside: Whether descriptions that it names outside its folder are read from this machine.

    Raises:
        InputError: It needs files that the recording does not carry, or that have changed since.
    """
    with TemporaryDirectory(prefix="seerob-") as folder:
        recording.extract(Path(folder))
        allowed = Allowed(allow_plugins, allow_outside, replayed=True)
        try:
            file = Path(folder) / file_among(recording.files)
            station = Station(read(file, allowed), cache=cache)
        except InputError as error:
            problems = [p._replace(file=p.file.removeprefix(f"{folder}/")) for p in error.problems]
            raise InputError(
                [*problems, Problem(str(recording.path), "", "cannot be computed from itself", _REMEDY)]
            ) from error
        # Read while the folder is there.
        now, then = station.files, recording.files
        _ = station.bound
    compared = (name for name in {*now, *then} if not name.startswith(SOURCES))
    changed = sorted(name for name in compared if now.get(name) != then.get(name))
    if changed:
        what = f"was made with other files than are found now: {', '.join(changed[:6])}"
        raise InputError.at(recording.path, "", what, _REMEDY)
    return station


def recorded_sources(
    sources: Iterable[Source], samples: Iterable[Sample], duration: float
) -> tuple[tuple[Source, Opened], ...]:
    """Every source with its recorded samples; rounds of a loop follow each other as they were played.

    Args:
        sources: Of the workstation.
        samples: Of the recording, in order.
        duration: Of the recording [s].
    """
    heard: dict[str, list[Sample]] = {}
    for sample in samples:
        own = heard.setdefault(sample.source, [])
        # A sample that speaks of no later instant says nothing new.
        if not own or sample.t > own[-1].t:
            own.append(sample)
    return tuple(
        (replace(source, loop=False), Opened(samples=heard.get(source.name, []), duration=duration))
        for source in sources
    )

"""Areas made from what something sweeps or can reach, when a workstation is read; kept between starts."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import msgspec
import numpy as np

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.files.whole_file import whole_file
from seerob.core.samples import Sample
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding, Origin, Result, Snapshot
from seerob.core.transforms import Array
from seerob.criteria.safety.separation import MORE
from seerob.distance.voxels import check_room, dilated
from seerob.model.model import Model
from seerob.model.mounting.compilation import Progress
from seerob.model.mounting.things import MadeArea
from seerob.model.volumes.moving import posed, reach_box
from seerob.model.volumes.reachable import reachable_volume
from seerob.model.volumes.swept import BATCH, Sweep, Swept
from seerob.outputs.sink import Closing, Writer
from seerob.recording.format import content_hash
from seerob.session.run import Bound
from seerob.twin.machines.gripping import before
from seerob.workstation.workstation import Area, SweptArea, Workstation

VERSION = "seerob swept area 4"
"""Changes whenever what is made does."""
MOST = 6_000
"""Triangles of an area, about; it still contains every voxel."""

SEPARATION = "criterion of kind separation"

Run = Callable[[Writer], object]
"""Runs the workstation once and tells a writer."""


class MotionRecord(Closing):
    """A writer that keeps the twin's joint positions, and results, of a part of a run."""

    def __init__(self, start: float, end: float) -> None:
        """Begin and end of the part [s]."""
        self.start, self.end = start - 1e-9, end + 1e-9
        self.joints: list[dict[str, tuple[float, ...]]] = []
        self.results: list[tuple[Result, ...]] = []
        self.instants: list[float] = []
        self.off: dict[str, float] = {}
        """Largest distance of each twin from what was heard [rad or m]."""

    def write(self, snapshot: Snapshot, samples: Iterable[Sample]) -> None:
        """Take one tick: what goes out, and what came in to make it."""
        if self.start <= snapshot.t <= self.end:
            self.joints.append(snapshot.joints)
            self.results.append(snapshot.results)
            self.instants.append(snapshot.t)
            for name, error in snapshot.tracking.items():
                self.off[name] = max(self.off.get(name, 0.0), error)

    def motion(self, start: int = 0, end: int | None = None) -> dict[str, Array]:
        """Joint positions by robot and human [rad or m], shape (N, n) each; of some of the instants."""
        chosen = self.joints[start:end]
        return {name: np.array([joints[name] for joints in chosen]) for name in self.joints[0]}


def without_swept(station: Workstation) -> Workstation:
    """Drop swept areas, and all criteria but those whose S_p one of these areas wants."""
    wanted = {area.swept.separation for area in station.areas if area.swept is not None}
    return msgspec.structs.replace(
        station,
        areas=tuple(area for area in station.areas if area.swept is None),
        safety=tuple(criterion for criterion in station.safety if criterion.name in wanted),
        ergonomics=(),
        sinks=(),
    )


@contextmanager
def in_place(station: Workstation) -> Iterator[None]:
    """Tells mistakes that are found without the swept areas at their places in the whole workstation.

    `without_swept` counts areas and criteria anew. Wrong names of criteria are told with them.

    Raises:
        InputError: What was raised within, and every `SweptArea.separation` that nothing is named.
    """
    try:
        yield
    except InputError as error:
        raise InputError(_in_place(error.problems, station)) from None


def _in_place(problems: Iterable[Problem], station: Workstation) -> list[Problem]:
    bare = without_swept(station)
    places = {
        f"{table}[{i}]": f"{table}[{getattr(station, table).index(entry)}]"
        for table in ("areas", "safety")
        for i, entry in enumerate(getattr(bare, table))
    }
    found = []
    for problem in problems:
        head, bracket, rest = problem.key.partition("]")
        place = head + bracket
        found.append(problem._replace(key=places.get(place, place) + rest))
    known, file = _separations(station), next(iter(station.files), "workstation")
    for i, area in enumerate(station.areas):
        name = None if area.swept is None else area.swept.separation
        if name is not None and name not in known:
            text = str(UnknownName(SEPARATION, name, known))
            found.append(Problem(file, f"areas[{i}].swept.separation", text))
    return found


def _separations(station: Workstation) -> list[str]:
    # The kind of a criterion is the name of its module.
    return [c.name for c in station.safety if type(c).__module__.endswith(".separation")]


def make(
    workstation: Workstation,
    model: Model,
    bound: Sequence[Bound],
    files: Mapping[str, bytes],
    run: Run,
    *,
    cache: Path | None = None,
    progress: Progress = lambda _: None,
) -> dict[str, MadeArea]:
    """Every swept area of a workstation.

    Args:
        workstation: With the areas.
        model: The same compiled without them.
        bound: The criteria that are left in it: those whose S_p is wanted.
        files: All that the result depends on.
        run: Runs it.
        cache: Folder in which ``areas`` are kept, by content.
        progress: Told what is being made.

    Raises:
        InputError: With every area that cannot be made; names area, key and remedy.
    """
    made: dict[str, MadeArea] = {}
    problems: list[Problem] = []
    file = next(iter(workstation.files), "workstation")
    maker = _Maker(model, {b.criterion.name: b for b in bound}, run, progress, _separations(workstation))
    for i, area in enumerate(workstation.areas):
        if area.swept is None:
            continue
        key = f"areas[{i}].swept"
        try:
            maker.check(area.swept)
            content = f"{VERSION}\0{content_hash(dict(files))}\0{area.swept!r}"
            path = None if cache is None else cache / "areas" / hashlib.sha256(content.encode()).hexdigest()
            found = None if path is None else _read(path, area)
            if found is None:
                progress(f"sweeping {area.name}")
                found = maker.make(area)
                if path is not None:
                    _write(path, found)
            made[area.name] = found
        except InputError as error:
            problems += [p._replace(file=file, key=f"{key}.{_short(p.key)}") for p in error.problems]
        except UnknownName as error:
            problems.append(
                Problem(file, f"{key}.{'separation' if 'criterion' in error.what else 'of'}", str(error))
            )
    if problems:
        raise InputError(problems)
    return made


def _short(key: str) -> str:
    return key.rpartition(".")[2] or "of"


class _Maker:
    def __init__(
        self,
        model: Model,
        bound: Mapping[str, Bound],
        run: Run,
        progress: Progress,
        separations: Sequence[str],
    ) -> None:
        self.model, self.bound, self.run, self.progress = model, bound, run, progress
        self.separations = separations
        self.record: MotionRecord | None = None

    def check(self, swept: SweptArea) -> None:
        """Refuse what cannot be before anything runs."""
        bodies = self.model.select(swept.of)
        wide = swept.margin
        if swept.separation is not None:
            self._separation(swept.separation)
        low, high = reach_box(self.model, bodies)
        check_room(low - wide, high + wide, swept.voxel)

    def make(self, area: Area) -> MadeArea:
        """One area."""
        swept = area.swept
        assert swept is not None
        bodies = self.model.select(swept.of)
        findings: list[Finding] = []
        if swept.reach:
            found = reachable_volume(self.model, bodies, voxel=swept.voxel)
            assert found is not None
            found = _wider(found, swept.margin)
            what = f"all that {swept.of} can reach"
            if any(self.model.bodies[i].holder for i in bodies):
                what += ", with what it picks up in the hand, where the file has it"
        else:
            record, wanted = self._recorded(swept)
            found = self._swept(swept, bodies, record, wanted)
            what = f"what {swept.of} sweeps from {record.instants[0]:.2f} to {record.instants[-1]:.2f} s"
            if swept.separation is not None:
                what += f", and what is nearer to it than S_p of {swept.separation!r}"
            limit = self.model.workstation.engine.tracking_limit
            for name, error in record.off.items():
                if error > limit:
                    text = f"the twin of {name} was off by up to {error:.3g} rad or m: it is the twin's way"
                    findings.append(
                        Finding(level="warning", subject=area.name, text=text, holds=(area.name,))
                    )
        text = f"{what}, in voxels of {swept.voxel:g} m: {found.volume:.3g} m³, not less than the truth"
        if found.excess is not None:
            text += f"; larger by at most {found.excess * 1e3:.0f} mm before any margin"
        if swept.margin:
            text += f"; dilated by {swept.margin:g} m"
        findings.insert(0, Finding(level="note", subject=area.name, text=text))
        more = f"some voxels of {swept.voxel:g} m" if found.excess is None else f"{found.excess * 1e3:.0f} mm"
        note = f"{what}, larger than the truth by up to {more}"
        return MadeArea(found.mesh(most=MOST), note, tuple(findings))

    def _separation(self, name: str) -> Bound:
        if name not in self.bound:
            raise UnknownName(SEPARATION, name, self.separations)
        bound = self.bound[name]
        missing = [given.name for given in bound.basis.inputs if given.origin is Origin.MISSING]
        if missing:
            what = f"S_p of {name!r} is not known: {', '.join(missing)} not given"
            raise InputError.at("swept", "separation", what, "give them in the criterion")
        return bound

    def _recorded(self, swept: SweptArea) -> tuple[MotionRecord, list[dict[str, float]]]:
        """The motion of the part, and S_p of each moving body at each of its ticks."""
        if self.record is None:
            self.record = MotionRecord(0.0, np.inf)
            self.run(self.record)
        whole = self.record
        kept = [
            i
            for i, t in enumerate(whole.instants)
            if swept.start - 1e-9 <= t <= (np.inf if swept.end is None else swept.end) + 1e-9
        ]
        if not kept:
            what = f"no tick lies from {swept.start:g} s on within the part"
            raise InputError.at("swept", "start", what, f"the motion takes {whole.instants[-1]:g} s")
        part = MotionRecord(swept.start, np.inf)
        part.off = whole.off
        for i in kept:
            part.joints.append(whole.joints[i])
            part.results.append(whole.results[i])
            part.instants.append(whole.instants[i])
        wanted = [self._distances(swept.separation, part, k) for k in range(len(kept))]
        return part, wanted

    def _distances(self, name: str | None, record: MotionRecord, k: int) -> dict[str, float]:
        if name is None:
            return {}
        result = next((r for r in record.results[k] if r.name == name), None)
        if result is None or result.limit is None or result.at_most:
            why = "it is no separation" if result is None or not result.reason else result.reason
            what = f"{name!r} gives no S_p at {record.instants[k]:.2f} s: {why}"
            raise InputError.at("swept", "separation", what, "mend the criterion, or take another part")
        more = next((part for part in result.parts if part.name == MORE), None)
        if more is not None and more.value is None:
            what = f"S_p of {name!r} is not known at {record.instants[k]:.2f} s: {more.reason}"
            raise InputError.at("swept", "separation", what, "mend the criterion, or take another part")
        beyond = 0.0 if more is None or more.value is None else more.value
        own = {body.name for body in self.model.bodies}
        return {p.name: p.limit + beyond for p in result.parts if p.name in own and p.limit is not None}

    def _swept(
        self,
        swept: SweptArea,
        bodies: Sequence[int],
        record: MotionRecord,
        wanted: Sequence[dict[str, float]],
    ) -> Swept:
        qpos = posed(self.model, record.motion())
        assert self.record is not None
        first = self.record.instants.index(record.instants[0])
        earlier = posed(self.model, self.record.motion())[:first]
        sweep = Sweep(self.model, bodies, voxel=swept.voxel, held=before(self.model, earlier))
        names = [self.model.bodies[core.body].name for core in sweep.moving.cores]
        largest = max((max(each.values(), default=0.0) for each in wanted), default=0.0)
        if not np.isfinite(largest) or largest > 100:
            raise InputError.at("swept", "separation", f"S_p grows to {largest:g} m", "mend the criterion")
        low, high = reach_box(self.model, bodies)
        wide = swept.margin + largest
        check_room(low - wide, high + wide, swept.voxel)

        def beyond(k: int) -> Array:
            return np.array([wanted[k].get(name, 0.0) + swept.margin for name in names])

        sweep.beyond = beyond(0)
        sweep.start(qpos[0])
        for k in range(1, len(qpos)):
            # The larger of both ends, for all that lies between them.
            sweep.beyond = np.maximum(beyond(k - 1), beyond(k))
            sweep.enqueue(qpos[k])
            if k % BATCH == 0 or k == len(qpos) - 1:
                sweep.flush()
                self.progress(f"sweeping {swept.of}: {k / (len(qpos) - 1):.0%}")
        return sweep.swept


def _wider(found: Swept, margin: float) -> Swept:
    """The voxels dilated by a margin: every voxel within it of a marked one is marked."""
    if margin <= 0:
        return found
    grid = found.grid
    low, high = grid.bounds()
    grid.cover(low * grid.pitch - margin, (high + 1) * grid.pitch + margin)
    # From centre to centre a gap may be longer than between cubes by a diagonal.
    grid.cells[:] = dilated(grid.cells, margin / grid.pitch + np.sqrt(3))
    grid.count = int(grid.cells.sum())
    return found


def _read(path: Path, area: Area) -> MadeArea | None:
    """What was kept; None when there is none or it is not what was written."""
    try:
        blob = path.read_bytes()
        if blob[:32] != hashlib.sha256(blob[32:]).digest():
            return None
        with np.load(io.BytesIO(blob[32:]), allow_pickle=False) as kept:
            said = msgspec.json.decode(kept["said"].tobytes(), type=tuple[str, tuple[Finding, ...]])
            return MadeArea(Mesh(kept["vertices"], kept["faces"]), *said)
    except (OSError, ValueError, KeyError, EOFError, msgspec.MsgspecError):
        return None


def _write(path: Path, made: MadeArea) -> None:
    """Keep an area; a folder that cannot be written is not an error."""
    said = np.frombuffer(msgspec.json.encode((made.note, made.findings)), np.uint8)
    payload = io.BytesIO()
    np.savez(payload, vertices=made.mesh.vertices, faces=made.mesh.faces, said=said)
    blob = payload.getvalue()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as hidden:
            hidden.write_bytes(hashlib.sha256(blob).digest() + blob)
    except OSError:
        return

r"""Power and force limiting: permissible speed of contact, ISO/TS 15066:2016 5.5.5 and Annex A."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, ClassVar, Literal, cast

import numpy as np
from msgspec import Meta, Struct, field
from msgspec.structs import replace
from numpy.typing import NDArray

from seerob.core.errors import InputError, Undecided, UnknownName
from seerob.core.quantities import Coordinate, Tolerance
from seerob.core.snapshot import Basis, Input, Origin, Result, Verdict
from seerob.core.tolerances import Spread, deciding
from seerob.core.transforms import Array
from seerob.criteria.body_parts import seen_first
from seerob.criteria.contact import collision
from seerob.criteria.contact import limits as contact_limits
from seerob.criteria.contact import shape as contact_shape
from seerob.criteria.contact.clamped_regions import Clamping, floor_input
from seerob.criteria.contact.clamping import STILL
from seerob.criteria.contact.impact_mass import Behind, moving_masses, train
from seerob.criteria.contact.limits import NOT_GIVEN, ContactEnds, Judged, pushed, ranks, robot_masses
from seerob.criteria.contact.measured import Measurements, worse
from seerob.criteria.contact.regions import REGIONS, HeightReach, Person, reach_inputs, without_limit
from seerob.criteria.contact.rows import NOT_MODELLED, ContactMarkers, ContactRows, area_results
from seerob.criteria.contact.shape import given_contacts
from seerob.criteria.criterion import Criterion, Evaluate, Lowest
from seerob.criteria.figure import Compute, Figure, Parts, Present, Shown
from seerob.description.humans.anthropometry import STATURE_RANGE
from seerob.description.norms import body_limits
from seerob.description.norms.crushing_gaps import NOT_VERIFIED, gap_inputs
from seerob.description.norms.limit_inputs import excluded_input, limit_inputs, table_input
from seerob.kernels.contact_speeds import governing
from seerob.model import provenance
from seerob.model.model import Mechanism, Model
from seerob.twin.spans import Points, Span, change_of_motion, rows_of
from seerob.twin.state import State

STANDSTILL = 1e-3
"""Speed below which a part of a robot hits nobody [m/s], where no drive of its own is behind it: with 1 t and
the stiffest region of the table (150 N/mm) a blow of 12 N."""
ADMITTED = 1e-6
"""Share of a permissible speed that is more than rounding (`verdict.ROUNDING`) of whatever moves."""
FAR = 1e6
"""Larger than any margin of speed [m/s]."""
GOVERNING = tuple(limit.name.lower() for limit in collision.Governing)
_BY_RANK = (Verdict.WITHIN, Verdict.UNDECIDED, Verdict.EXCEEDED)
HORIZON = 0.5
"""How near a part of a robot must be to hit a body part, when nobody says [m]."""
CAP = 1e-4
"""Contact area that the stiffness of the table is good for [m²] (STIMBA PFL calculator, 1S)."""

_Positive = Annotated[float, Meta(gt=0, extra={"unit": "m"})]
_Height = Annotated[Coordinate, Meta(extra={"unit": "m"})]
_Area = Annotated[float, Meta(gt=0, extra={"unit": "m²"})]
_Stature = Annotated[float, Meta(ge=STATURE_RANGE[0], le=STATURE_RANGE[1], extra={"unit": "m"})]
_Credited = Annotated[float, Meta(gt=0, le=CAP, extra={"unit": "m²"})]


class PowerAndForce(Criterion, frozen=True, kw_only=True):
    """Power and force limiting: speed of every moving part against what each body region may be hit with."""

    unit: ClassVar[str] = "m/s"
    heavier_is_worse: ClassVar[bool] = True
    adults: ClassVar[bool] = True
    whole: ClassVar[bool] = False

    robot: str
    """A robot or a machine, with its tools and workpieces."""
    human: str | None = None
    """A person: regions within ``horizon`` of a part can be hit by it, and those of everybody else in the
    workstation. Without one, anyone could stand anywhere."""
    horizon: _Positive = HORIZON
    """Distance within which a part of the robot could hit a body part [m]."""
    person_speed: Annotated[float, Meta(ge=0, extra={"unit": "m/s"})] | None = None
    """Speed of the body part, added to the robot's [m/s]; without it as observed, 0 without a person."""
    excluded: tuple[str, ...] = ()
    """Body regions that other measures keep from any contact; named in every report."""
    limits: str | None = None
    """File with other limits, of the form of the one that ships."""
    multiplier: Annotated[float, Meta(ge=1, le=2)] | None = None
    """Transient over quasi-static limits; lowers the table's, which is 2."""
    mass: Literal["larger", "simplified", "projected"] = "larger"
    """Mass of the robot: M/2 + m_L, the effective mass along the motion, or the larger of both. A machine,
    and what it carries while it moves, has its whole mass instead of M/2 + m_L."""
    drive_force: Annotated[float, Meta(ge=0, extra={"unit": "N"})] | None = None
    """Largest force with which the drive of a machine, or of what carries the robot, keeps pushing whoever it
    touches, at any place that can touch [N]; 0 of what rolls freely."""
    contact_radius: dict[str, _Positive] = field(default_factory=dict)
    """Radius of the sharpest edge of parts by name [m], instead of what their meshes tell; the robot's name
    means its links up to the flange, not what is mounted there."""
    contact_area: dict[str, _Area] = field(default_factory=dict)
    """Smallest contact area of parts by name [m²], likewise."""
    largest_area: _Credited = CAP
    """Area above which a contact is not credited [m²]; never more than 1 cm²."""
    stiffness_tolerance: Tolerance = 0.0
    """How far the stiffness k of every body region may be off, as a share: 0.1 for ± 10 %."""
    area_tolerance: Tolerance = 0.0
    """How far every contact area may be off, as a share: 0.1 for ± 10 %."""
    postures: tuple[str, ...] = ()
    """Without a person: postures of the library in which people can be there, such as ``standing``; regions
    that a part cannot reach by its height are then left out, and listed. Without it, every region counts."""
    postures_source: str | None = None
    """What says so: the risk assessment, with its number."""
    statures: tuple[_Stature, _Stature] = STATURE_RANGE
    """Least and largest stature of these people [m]."""
    measurements: str | None = None
    """File of contacts that were measured at the robot: the worse of measurement and prediction counts."""
    thickness: dict[str, _Positive] = field(default_factory=dict)
    """Gap in which a body region can be clamped [m], instead of the gaps of ISO 13854."""
    floor: bool = True
    """Whether the floor is a surface that clamps, also where no part of the workstation is drawn there."""
    floor_height: _Height = 0.0
    """Its height, z in the world [m]."""

    def __post_init__(self) -> None:
        if self.postures and self.human is not None:
            raise ValueError("postures speak of anyone: who is named by human is where the twin has them")
        if self.postures and not self.postures_source:
            raise ValueError("postures rest on somebody's word: name it in postures_source")
        if self.statures[0] > self.statures[1]:
            raise ValueError(f"statures = {list(self.statures)}: the least comes first")

    def judged(self, model: Model) -> set[int]:
        """Return what moves of the robot and the human: of what carries the robot, contact is not judged."""
        return {i for name in self.subjects() for i in model.mechanism(name).moving}

    def subjects(self) -> tuple[str, ...]:
        """The robot and the human."""
        return (self.robot,) if self.human is None else (self.robot, self.human)

    def depends(self, model: Model) -> tuple[str, ...]:
        """Everybody who can be hit, or who carries a surface that clamps."""
        return tuple(model.mechanisms)

    def hits(self, model: Model) -> tuple[tuple[int, ...], float, float]:
        """What moves of the robot, from the horizon on."""
        return model.mover(self.robot).moving, self.horizon, min(STANDSTILL, STILL)

    def bind(self, model: Model) -> Evaluate:
        """Return the function that judges one instant: of who is partly seen, what is seen first."""
        contacts = Contacts(self, model)
        bones = () if contacts.people is None else contacts.people.bodies
        return contacts.whoever_is_known(seen_first(bones, contacts.judging(), contacts.without))

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes relative speeds."""
        return Contacts(self, model).computing()

    def present(self, model: Model) -> Present:
        """Return the function that says what of a person each moving part may hit, and draws the worst."""
        return Contacts(self, model).present

    def one_by_one(self, model: Model) -> str:
        """Say why there are no arrays of what clamps."""
        return "what clamps, and where, is searched for at each instant"

    def lowest(self, model: Model, points: Points) -> Lowest | None:
        """Judge the least margin within a span."""
        return Contacts(self, model).lowest(points)

    def table(self, model: Model) -> body_limits.BodyLimits:
        """The limits that apply."""
        return (
            body_limits.shipped()
            if self.limits is None
            else body_limits.read(Path(model.folder, self.limits))
        )

    def shapes(self, model: Model) -> list[contact_shape.ContactShape]:
        """How sharp each moving body of the robot is, by its mesh or by the file.

        Raises:
            UnknownName: A part that the robot does not move.
        """
        moving = model.mover(self.robot).moving
        radii, _, _ = self._contacts(model)
        known = contact_shape.body_shape
        return [
            contact_shape.round_shape(radii[i]) if i in radii else known(model.bodies[i].solids)
            for i in moving
        ]

    def pressure_forces(self, model: Model, arrays: contact_limits.RegionArrays) -> Array:
        """Force of each moving body that keeps the pressure of each specific area [N], shape (b, 2, a).

        Free and clamped; see `contact_limits.RegionArrays.pressure_force`.
        """
        moving = model.mover(self.robot).moving
        _, given, _ = self._contacts(model)
        found = [arrays.pressure_force(shape, self.largest_area) for shape in self.shapes(model)]
        for row, body in enumerate(moving):
            if body in given:
                found[row] = arrays.pressures() * min(given[body], self.largest_area)
        return np.array(found).reshape(len(moving), 2, len(arrays.pressure))

    def given_contacts(self, model: Model) -> frozenset[int]:
        """Bodies of which the file says how they touch."""
        return frozenset(self._contacts(model)[2])

    def measured(self, model: Model) -> Measurements:
        """What was measured at the robot."""
        arrays = contact_limits.RegionArrays.of(self.table(model), multiplier=self.multiplier)
        return Measurements(model, model.mover(self.robot), arrays, self.measurements)

    def _contacts(self, model: Model) -> tuple[dict[int, float], dict[int, float], dict[int, str]]:
        """Radii [m] and areas [m²] that the file gives, by moving body, and by which name."""
        return given_contacts(model, model.mover(self.robot), self.contact_radius, self.contact_area)

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        robot, limits = model.mover(self.robot), self.table(model)
        people = [] if self.human is None else [human.name for human in model.workstation.humans]
        names = (self.robot, *people)
        table, undecided_reasons = table_input(limits, model.workstation.edition)
        return Basis(
            formula="v = min(F/√(μk), pA/√(μk), √(2E/μ)), μ = 1/(1/m_H + 1/m_R), "
            f"m_R = {self._whole(robot)}; clamped: m_H → ∞ and quasi-static limits; "
            + {
                "larger": "m_R at least the effective mass along the motion",
                "simplified": "the effective mass along the motion is shown, not used",
                "projected": "m_R replaced by the effective mass along the motion (chosen in the file)",
            }[self.mass]
            + (
                "; a drive that keeps pushing with F_d: F(F − 2F_d) for F²"
                if Behind(model, robot).pushed
                else ""
            ),
            source="ISO/TS 15066:2016 Annex A.3, A.1 to A.6 (public sources that agree, 2S; A.1, A.2: M)",
            inputs=(
                *provenance.motion(model, *names),
                *self._given(model),
                table,
                *limit_inputs(limits, own=self.limits is not None, multiplier=self.multiplier),
                contact_limits.credited_input(self.largest_area, CAP),
                *gap_inputs(self.thickness, [r.name for r in limits.regions.values() if r.permitted]),
                floor_input(self.floor_height if self.floor else None),
                *(excluded_input(region) for region in self.excluded),
                *(
                    reach_inputs(self.postures, self.postures_source or "", self.statures, self.floor_height)
                    if self.postures
                    else ()
                ),
                *self.measured(model).inputs(),
            ),
            not_modelled=(
                "a design estimate: power and force limiting needs measurement at the real robot",
                *undecided_reasons,
                *NOT_MODELLED,
                *(
                    ()
                    if robot.rotor_inertia_known
                    else ("rotor inertia: the effective mass along the motion is link side only",)
                ),
                *self._motion_left_out(),
                *(
                    (
                        "limits that other standards set for doors, gates and vehicles",
                        "a drive that presses for longer, or harder than drive_force before it is limited",
                    )
                    if Behind(model, robot).pushed
                    else ()
                ),
                *(("people in other postures than those that are named",) if self.postures else ()),
            ),
        )

    @staticmethod
    def _whole(robot: Mechanism) -> str:
        """The mass that counts beside the effective one, in words."""
        if robot.role == "machine":
            return "all that moves of it, with what is on it"
        return "M/2 + m_L" + (", all that moves while it is carried about" if robot.on else "")

    def _motion_left_out(self) -> tuple[str, ...]:
        if self.person_speed is not None:
            return ()
        seen = "" if self.human is None else ", beyond what is observed: who stands still counts with 0 m/s"
        return (f"the person's own motion{seen} (person_speed is not given)",)

    def _given(self, model: Model) -> tuple[Input, ...]:
        """What the file says of the contact, and what the robot and its surfaces are."""
        robot = model.mover(self.robot)
        M = None if robot.unknown_masses else moving_masses(model, robot)[0]
        links, *carried = provenance.masses(model, robot)
        links = replace(links, name=f"M, moving links of {self.robot}", value=M)
        found = [links, *carried]
        roots = [*model.carriers_of(robot.name), *([robot.name] if robot.role == "machine" else [])]
        movers = train(model, model.mechanisms[roots[-1]]) if roots else ()
        for each in movers:
            found += () if each is robot else provenance.masses(model, each)
        if self.drive_force is not None:
            found.append(provenance.given("drive_force", self.drive_force, "N"))
        elif roots:
            found.append(Input(name="drive_force", origin=Origin.MISSING, source=NOT_GIVEN))
        if self.human is not None:
            found.append(provenance.option("horizon", self.horizon, HORIZON, "m"))
        tolerances = {key: getattr(self, key) for key in ("stiffness_tolerance", "area_tolerance")}
        found += [provenance.given(key, share, "") for key, share in tolerances.items() if share]
        if self.person_speed is not None:
            found.append(provenance.given("person_speed", self.person_speed, "m/s"))
        radii, areas, by = self._contacts(model)
        return (
            *found,
            *(
                contact_limits.contact_input(
                    model.bodies[body].name,
                    shape,
                    radius=radii.get(body),
                    area=areas.get(body),
                    by=by.get(body, ""),
                )
                for body, shape in zip(robot.moving, self.shapes(model), strict=True)
            ),
        )


class _Hits(Struct, frozen=True, eq=False):
    """What of people can be hit at an instant, and by what."""

    judged: Judged
    people: Person | None
    hit: NDArray[np.int64] = np.zeros(0, np.int64)
    """Which of `REGIONS` can be, shape (h,)."""
    measured: Mapping[int, tuple[Result, ...]] = {}
    """What was measured of them."""
    touched: NDArray[np.bool_] | None = None
    """Which moving body touches which of `REGIONS`; None where none is kept from contact."""
    invalid_reason: str = ""
    """Why that is not known; then all are."""


class Contacts:
    """What is resolved once, and the judgement of a state."""

    def __init__(self, spec: PowerAndForce, model: Model) -> None:
        self.spec, self.model = spec, model
        self.robot = model.mover(spec.robot)
        self.robot.require_masses(spec.name)
        self.moving = self.robot.moving
        self.names = [model.bodies[i].name for i in self.moving]
        self.undriven = np.zeros(len(self.moving), bool)
        for key, names in (("excluded", spec.excluded), ("thickness", spec.thickness)):
            for name in names:
                if name not in REGIONS:
                    raise UnknownName(f"body region ({key})", name, REGIONS)
        self.limits = spec.table(model)
        self.arrays = contact_limits.RegionArrays.of(self.limits, multiplier=spec.multiplier)
        self.columns = {region.name: k for k, region in enumerate(self.arrays.regions)}
        self.in_regions = np.array([REGIONS.index(name) for name in self.columns], int)
        self.column_of = np.array([self.columns.get(name, -1) for name in REGIONS])
        self.excluded = np.array([name in spec.excluded for name in REGIONS])
        shapes = spec.shapes(model)
        placed = [
            None if i in spec.given_contacts(model) else shape
            for i, shape in zip(self.moving, shapes, strict=True)
        ]
        self.markers = ContactMarkers(model, self.moving, placed, self.arrays, spec.largest_area)
        self.forces = spec.pressure_forces(model, self.arrays)
        self.least = self.arrays.by_region(self.forces)
        self.unknown = [
            shape.unknown if np.isnan(force).any() else ""
            for shape, force in zip(shapes, self.forces, strict=True)
        ]
        self.behind = Behind(model, self.robot)
        if spec.drive_force is not None and not self.behind.pushed:
            what = f"{self.robot.name} is a robot that nothing carries: forces of its drives are not modelled"
            raise InputError.at(spec.name, "drive_force", what, "leave it out, or name a machine")
        self.ends = ContactEnds(
            model,
            self.robot,
            self.arrays,
            lambda arrays: arrays.by_region(spec.pressure_forces(model, arrays)),
            stiffness=spec.stiffness_tolerance,
            area=spec.area_tolerance,
        )
        floor = spec.floor_height if spec.floor else None
        self.clamping = Clamping(model, self.robot, spec.thickness, tuple(self.columns), floor)
        if spec.human is not None:
            model.human(spec.human)
        self.humans = [human.name for human in model.workstation.humans]
        # Who is named is not alone, and where anyone can be, everybody of the twin is somebody.
        everybody = (
            Person(model, self.robot, *self.humans, horizon=spec.horizon)
            if self.humans and self.moving
            else None
        )
        self.people = None if spec.human is None else everybody
        self.everybody = everybody if spec.human is None and spec.excluded else None
        without = (None if name in self.columns else self._without_limit(name, "")[0] for name in REGIONS)
        self.forbidden = np.array([verdict is Verdict.EXCEEDED for verdict in without])
        hands = {human.hand for human in model.workstation.humans}
        hand = hands.pop() if spec.human is not None and len(hands) == 1 else None
        self.rows = ContactRows(self, hand=hand)
        self.measured = spec.measured(model)
        self.reach = (
            HeightReach(
                model, self.robot, spec.postures, spec.statures,
                horizon=spec.horizon, floor=spec.floor_height,
            )
            if spec.postures and self.moving
            else None
        )  # fmt: skip

    def computing(self, people: Person | None = None) -> Compute:
        """Return the function that computes all contacts with these people; with everybody when not given."""
        people = people or self.people
        return lambda twin: self._compute(cast("State", twin), people)

    def judging(self, people: Person | None = None) -> Evaluate:
        """Judge contacts with these people; with everybody when not given."""
        return self.spec.judging(self.computing(people), self.present)

    def without(self, lost: tuple[int, ...]) -> Evaluate | None:
        """Judge contacts with the other bones of these people; None when there are none."""
        if {i for name in self.humans for i in self.model.human(name).bodies} <= set(lost):
            return None
        return self.judging(
            Person(self.model, self.robot, *self.humans, horizon=self.spec.horizon, without=lost)
        )

    def whoever_is_known(self, judge: Evaluate) -> Evaluate:
        """Judge several people: if one is not known, another's contact may be exceeded, never within."""
        if self.people is None or not self.people.several:
            return judge
        horizon = self.spec.horizon
        alone = [self.judging(Person(self.model, self.robot, name, horizon=horizon)) for name in self.humans]

        def evaluate(state: State) -> Result:
            try:
                return judge(state)
            except Undecided:
                for each in alone:
                    with suppress(Undecided):
                        result = each(state)
                        if result.verdict is Verdict.EXCEEDED:
                            return result
                raise

        return evaluate

    def judge(self, state: State, people: Person | None = None) -> Judged:
        """Every part of the robot against every body region; of ``people`` instead of the whole person.

        Raises:
            Undecided: Not heard, or a mass that nobody gave.
        """
        spec, robot = self.spec, self.robot
        if not self.moving:
            raise Undecided(f"{robot.name} has no moving part with a shape")
        mover = self.behind.mover(state)
        simplified = self.behind.simplified(mover)
        v_r = state.fastest_speeds(self.moving)
        riders = () if mover is not None else self.behind.riding(state)
        # A drive presses as hard however slowly it moves.
        pressing = {body for rider in riders for body in rider.moving}
        driven, by_drive = self.undriven, mover is not None
        if mover is not None or pressing:
            driven = np.array([mover is not None or body in pressing for body in self.moving])
            by_drive = bool(driven.any())
        moves = v_r > (np.where(driven, STILL, STANDSTILL) if by_drive else STANDSTILL)
        slowest = STILL if by_drive else STANDSTILL
        projected = self.behind.along_motion(state, mover, self.moving, standstill=slowest)
        masses = robot_masses(spec.mass, simplified, projected)
        people = people or self.people
        if people is None:
            near: NDArray[np.bool_] = np.ones((len(v_r), len(REGIONS)), bool)
            if self.reach is not None:
                near &= self.reach.at(state)
            v_h = np.full(len(REGIONS), spec.person_speed or 0.0)
        else:
            near, v_h = people.near(state, spec.person_speed)
        near &= moves[:, None]
        clamped, on_floor, speed = self.clamping.at(state, near[:, self.in_regions])
        closing = None
        if speed.any():
            closing = np.zeros(near.shape)
            closing[:, self.in_regions] = speed
        speeds = self.arrays.speeds(masses, self.least, clamped)
        ends = None
        if self.ends.tolerances:
            given = None if mover is None else masses
            ends = self.ends.at(state, self.moving, spec.mass, simplified, clamped, slowest, given)
        invalid_reason = ""
        if mover is not None:
            k, F_d = self.arrays.stiffness * (1 - spec.stiffness_tolerance), spec.drive_force
            if self.ends.masses.weighs_otherwise:
                invalid_reason = (
                    f"mass_tolerance is not followed on what moves {robot.name}: leave it out here"
                )
                F_d = None
            else:
                invalid_reason = NOT_GIVEN if F_d is None else f"the drive keeps pushing with {F_d:g} N"
                invalid_reason += (
                    f" ({mover.name} moves" + ("" if mover is robot else f" and carries {robot.name}") + ")"
                )
            ends = pushed(speeds, ends, k, self.arrays.force, clamped, F_d)
        elif riders:
            # Fingers press as hard as their drive, whatever they weigh.
            pressed = clamped & driven[:, None]
            if pressed.any():
                names, F_d = ", ".join(rider.name for rider in riders), spec.drive_force
                invalid_reason = NOT_GIVEN if F_d is None else f"the drive keeps pushing with {F_d:g} N"
                invalid_reason += f" ({names} moves)"
                k = self.arrays.stiffness * (1 - spec.stiffness_tolerance)
                ends = pushed(speeds, ends, k, self.arrays.force, clamped, F_d, where=pressed)
        v = contact_limits.relative(v_r, v_h, closing)
        governing = self._governing(v, near, speeds, ends)
        return Judged(
            v_r, moves, v_h, near, projected, speeds, clamped, *governing, ends, on_floor, closing,
            simplified, invalid_reason, mover is not None,
        )  # fmt: skip

    def lowest(self, points: Points) -> Lowest | None:
        r"""Least margin in a span, a share of what is permitted; none of carriers and measurements.

        Surfaces are as fast as they get in the span, hit whatever they may come near and clamp whatever they
        may clamp. Of the effective mass along the motion, :math:`m_u v^2 \le 2E`, E the kinetic energy of
        the robot: no motion of its joints that gives a point that velocity has less (Cauchy and Schwarz).
        """
        spec, model, robot = self.spec, self.model, self.robot
        held = any(body.holder for body in model.bodies)
        if not self.moving or not robot.alone or self.behind.pushed or held:
            return None
        if spec.measurements is not None:
            return None
        moving = rows_of(self.moving)
        reach = np.array([model.bodies[i].radius + model.bodies[i].deviation for i in self.moving])
        masses = self.ends.masses
        if len(self.ends.tolerances) > len(masses):
            return None
        changes = change_of_motion(model, robot.mj_bodies, robot.v_address, points, masses.heaviest)
        excluded, heaviest = self.excluded, (1,) * len(masses)
        limited = np.isin(np.arange(len(REGIONS)), self.in_regions)
        simplified = masses.simplified(self.behind.simplified(None), heaviest)

        def turned(span: Span) -> Array:
            """How much faster surfaces are than the points whose direction counts [m/s], shape (b,)."""
            chains = (points.chain(int(i)) for i in moving)
            return np.asarray(
                reach * [(span.qd + span.joint_noise)[joints][turns].sum() for joints, turns, _ in chains]
            )

        def energy(state: State, span: Span) -> float:
            qd = state.qd(robot)
            M, off = state.mass_matrix(robot), span.joint_noise[robot.v_address[robot.own]]
            if heaviest:
                M = masses.matrices(state).at(heaviest)
            now = math.sqrt(float(qd @ M @ qd)) + math.sqrt(float(np.diagonal(M) @ off**2))
            return (now + changes(span)[0]) ** 2 / 2

        def shares(v: Array, m_R: Array, clamped: NDArray[np.bool_]) -> Array:
            # Who may be clamped may be free too, of which another table may permit less.
            both = (self.arrays.speeds(m_R, self.least, each) for each in (clamped, np.zeros_like(clamped)))
            with np.errstate(divide="ignore", invalid="ignore"):
                used = (np.where(np.isnan(x.pressure), np.inf, v / x.permissible) for x in both)
                return np.maximum(*used)

        def lowest(state: State, span: Span) -> float:
            state.require_bodies(self.moving)
            noise = span.noise[moving]
            fast = span.fast[moving] + noise
            if not np.isfinite(fast).all():
                return -math.inf
            if self.people is None:
                near: NDArray[np.bool_] = np.ones((len(moving), len(REGIONS)), bool)
                if self.reach is not None:
                    near &= self.reach.at(state, span)
                v_h: Array = np.full(len(REGIONS), spec.person_speed or 0.0)
            else:
                near, v_h = self.people.near(state, spec.person_speed, span)
            near &= (fast > STANDSTILL)[:, None]
            if not near.any():
                return math.inf
            if near[:, ~(limited | excluded)].any():
                return -math.inf  # no limit, or no contact at all
            if spec.excluded:
                person = self.people or self.everybody
                if person is not None:
                    way = span.way(moving) + span.way(rows_of(person.bodies))
                    if (person.touched(state, way) & near)[:, excluded].any():
                        return -math.inf
            wanted = near[:, self.in_regions]
            clamped, closing = self.clamping.ever(state, span, wanted)
            v = fast[:, None] + v_h[self.in_regions]
            m_hit = m_closing = np.full(len(moving), simplified)
            if spec.mass != "simplified":
                more, E = turned(span), energy(state, span)
                slower = np.maximum(span.slow[moving] - noise - more, STANDSTILL)
                # m_u (v_r + v_h)² of a point that is at least so fast: as a share of v² it is most at an end.
                ends = [np.maximum(fast + v_h.min(), STANDSTILL), np.maximum(fast + v_h.max(), STANDSTILL)]
                most = np.max([(slower + more + each - fast) / (slower * each) for each in ends], axis=0)
                m_hit = np.maximum(simplified, 2 * E * most**2)
                m_closing = np.maximum(simplified, 2 * E / slower**2)
            found = shares(v, m_hit, clamped)
            if (closing > 0).any():
                found = np.maximum(found, np.where(closing > 0, shares(closing, m_closing, clamped), 0.0))
            asked = wanted & ~excluded[self.in_regions]
            return 1 - float(np.where(asked, found, 0.0).max(initial=0.0)) - ADMITTED

        return lowest

    def _compute(self, state: State, people: Person | None) -> Figure:
        """Relative speeds of each region that can be hit; see `judge`."""
        spec, judged = self.spec, self.judge(state, people)
        near, speeds, ends = judged.near, judged.speeds, judged.ends
        hit = np.flatnonzero(near.any(axis=0))
        if not len(hit):
            return Figure(None, nothing=True, beside=_Hits(judged, people))
        # Who is touched all the same was not kept from contact.
        touched, invalid_reason = self._touched(state, people, near) if spec.excluded else (None, "")
        row, column, kept_off = judged.rows[hit], self.column_of[hit], self.excluded[hit]
        value, limit = judged.v[row, hit], np.full(len(hit), np.nan)
        limited = (column >= 0) & ~kept_off
        at = row[limited], column[limited]
        limit[limited] = speeds.permissible[at]
        interval = None
        if ends is not None:
            low, high = np.full((2, len(hit)), np.nan)
            low[limited] = value[limited] - (ends.high[at] - limit[limited])
            high[limited] = value[limited] + (limit[limited] - ends.low[at])
            interval = low, high
        unsure = np.zeros(len(hit), bool)
        unsure[limited] = np.isnan(speeds.pressure[at])
        exceeded = self.forbidden[hit] & ~kept_off
        measured: dict[int, tuple[Result, ...]] = {}
        for i in np.flatnonzero(limited).tolist() if self.measured.every else ():
            if told := self._measured(int(hit[i]), judged):
                measured[int(hit[i])] = told
                # Of what is predicted and what was measured the worse counts.
                unsure[i] |= any(part.verdict is Verdict.UNDECIDED for part in told)
                exceeded[i] |= any(part.verdict is Verdict.EXCEEDED for part in told)
        informs = kept_off
        if touched is not None:
            informs = kept_off & ~np.asarray(touched[:, hit]).any(axis=0)
        names = [REGIONS[k] for k in hit.tolist()]
        parts = Parts(names, value, limit, interval, unsure=unsure, exceeded=exceeded, informs=informs)
        return Figure(None, parts=parts, beside=_Hits(judged, people, hit, measured, touched, invalid_reason))

    def present(self, state: State, figure: Figure, verdict: Verdict | None) -> Shown:
        """Say what governs each region that can be hit, and draw the worst."""
        at: _Hits = figure.beside
        judged, people, parts = at.judged, at.people, figure.parts
        beside = self._masses(judged)
        if parts is None:
            nobody = f"nobody within {self.spec.horizon:g} m of a moving part"
            return Shown(nobody if judged.moves.any() else "no part moves", None, beside)
        if people is not None:
            left = [REGIONS[k] for k in np.flatnonzero(~judged.near.any(axis=0)).tolist()]
            far = f"farther than {self.spec.horizon:g} m from every moving part: {', '.join(left)}"
            beside = (*beside, *((Result(name="out of reach", reason=far),) if left else ()))
        pressed = self.rows.by_pressure(judged)
        found: list[tuple[Result, int]] = []
        beneath: list[tuple[Result, ...]] = []
        figures = zip(parts.value.tolist(), parts.limit.tolist(), parts.verdicts, strict=True)
        for k, (value, limit, told) in zip(at.hit.tolist(), figures, strict=True):
            name, row, measured = REGIONS[k], int(judged.rows[k]), at.measured.get(k, ())
            reason, areas = self._region(k, row, value, judged, pressed)
            if people is not None and people.several:
                reason = f"{reason}; {', '.join(people.owners(name))}"
            if at.touched is not None and name in self.spec.excluded and at.touched[:, k].any():
                row = int(at.touched[:, k].argmax())
                reason = f"{reason}, and {at.invalid_reason or f'touched by {self.names[row]} here'}"
            if measured:
                _, reason = worse(_BY_RANK[int(judged.ranks[k])], reason, measured)
            found.append(
                (
                    Result(
                        name=name,
                        value=value,
                        unit="m/s",
                        limit=None if math.isnan(limit) else limit,
                        verdict=told,
                        reason=reason,
                    ),
                    row,
                )
            )
            beneath.append((*measured, *areas))
        part, row = found[parts.governs]
        out, place = self._out_of_reach(judged), self.markers.place(state, row)
        return Shown(
            f"{part.name}: {part.reason}",
            lambda: self.markers.of(place, part, row, judged),
            (*(each for each, _ in out), *beside),
            [each.reason for each, _ in found],
            beneath,
            self.rows.of(
                [*found, *out],
                judged,
                (lambda _: ()) if people is None else people.hit,
                pressed=pressed,
                measured={REGIONS[k]: told for k, told in at.measured.items()},
            ),
        )

    def _masses(self, judged: Judged) -> tuple[Result, ...]:
        known = judged.projected[np.isfinite(judged.projected)]
        heaviest, still = (float(known.max()), "") if len(known) else (None, "no part moves")
        return (
            Result(name="whole mass" if judged.whole else "M/2 + m_L", value=judged.simplified, unit="kg"),
            Result(name="m_u along the motion, heaviest part", value=heaviest, unit="kg", reason=still),
        )

    def _touched(
        self, state: State, people: Person | None, near: NDArray[np.bool_]
    ) -> tuple[NDArray[np.bool_], str]:
        """Which moving body touches which region of a person, and why that is not known; then all are."""
        found = np.zeros_like(near)
        try:
            person = self.everybody if people is None else people
            if person is not None:
                found |= person.touched(state)
        except Undecided as reason:
            return near, f"whether it is touched is open: {reason}"
        return found & near, ""

    def _governing(
        self, v: Array, near: NDArray[np.bool_], speeds: contact_limits.Speeds, ends: Spread | None
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Row of the moving body that governs each of `REGIONS`, and its rank: 2 exceeded, 1 open, 0 within.

        Without a limit it is the fastest.
        """
        known = ranks(v[:, self.in_regions], speeds, ends)
        return governing(v, near, self.in_regions, speeds.permissible, known, FAR)

    def _region(
        self, k: int, row: int, value: float, judged: Judged, pressed: Sequence[float]
    ) -> tuple[str, tuple[Result, ...]]:
        """What is said of one of `REGIONS` and the row of the moving body that governs it; its areas."""
        name, column = REGIONS[k], self.columns.get(REGIONS[k])
        body = self.names[row]
        if name in self.spec.excluded:
            return "kept from contact by the workstation file", ()
        if column is None:
            return self._without_limit(name, body)[1], ()
        speeds, ends = judged.speeds, judged.ends
        verdict = _BY_RANK[int(judged.ranks[k])]
        how = "clamped" if judged.clamped[row, column] else "free"
        reason = f"{GOVERNING[int(speeds.governing[row, column])]}, {how}, {body}"
        if judged.on_floor is not None and judged.on_floor[row, column]:
            reason += ", on the floor"
        if speeds.pressure[row, column] == 0.0:
            reason += (
                ": by the shape of its contact every force exceeds the pressure; a contact_area replaces it"
            )
        if verdict is Verdict.WITHIN and how == "free" and name not in self.spec.thickness:
            reason += f"; not clamped {NOT_VERIFIED}"
        if verdict is Verdict.UNDECIDED and ends is not None and not math.isnan(speeds.pressure[row, column]):
            why = deciding(self.ends.tolerances, ends.widths[:, row, column]) if self.ends.tolerances else ""
            reason += f"; {judged.pushed or why}"
        elif verdict is Verdict.UNDECIDED:
            reason = f"contact pressure of {body} ({how}): {self.unknown[row]}"
        of_areas, unknown = pressed[self.rows.areas_of(column)], self.unknown[row]
        at = row, column
        return reason, area_results(
            self.arrays, of_areas, at, judged, whole=verdict, unknown=unknown, v=value
        )

    def _without_limit(self, name: str, body: str) -> tuple[Verdict, str]:
        region = self.limits.region(name)
        within = None if self.people is None else f"{body} moves within {self.spec.horizon:g} m"
        return without_limit(name, region is None or region.permitted, within, self.limits.file)

    def _out_of_reach(self, judged: Judged) -> list[tuple[Result, int]]:
        """Regions that no moving part can hit by its height."""
        if self.reach is None or not judged.moves.any():
            return []
        row = int(judged.v_r.argmax())
        reason = f"out of reach: no moving part within {self.spec.horizon:g} m of where it is while "
        return [
            (Result(name=REGIONS[k], unit="m/s", reason=reason + self.reach.words), row)
            for k in np.flatnonzero(~judged.near.any(axis=0)).tolist()
        ]

    def _measured(self, k: int, judged: Judged) -> tuple[Result, ...]:
        """What was measured of one of `REGIONS`."""
        name = REGIONS[k]
        column = self.columns.get(name)
        if column is None or name in self.spec.excluded:
            return ()
        return self.measured.results(column, judged.v[:, k], judged.near[:, k], judged.clamped[:, column])

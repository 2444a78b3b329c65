r"""Compression of the lowest disc of the back, L5/S1, of a person who holds a posture with a load.

Inverse dynamics from the hands down, of a body at rest: weights of all bones above the joint between pelvis
and lumbar bone, and of the load, have a moment about it, which one muscle holds that runs along the spine.
What is below, and the ground, does not enter.

.. math:: C = |M_\perp| / d + W u_z

with :math:`M_\perp` the moment across the spine's axis :math:`u`, :math:`d` the lever of the muscle and
:math:`W` the weight above the joint.

That the motion is slow is the file's word. It is held against what is seen: with the accelerations of the
last `WINDOW` seconds the same formula says what it takes to move body and load, and where that is more by
`SHARE`, the weights are not all that acts. Where nobody looked so long, as at first, what a file says of the
next seconds counts instead; of who is heard live, nobody knows then.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, ClassVar, Literal, NamedTuple

import mujoco
import numpy as np
from msgspec import Meta

from seerob.core import figures
from seerob.core.domains import agree, at_least
from seerob.core.errors import Undecided
from seerob.core.snapshot import Arrow, Basis, Input, Origin, Result
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.scoring.basis import posture_quality
from seerob.criteria.scoring.handled import NOTE, bind_handled, load_range
from seerob.criteria.scoring.phases import Kilograms
from seerob.criteria.scoring.rule import PostureRule, bone_rows
from seerob.description.humans.skeleton import BONES
from seerob.model import provenance
from seerob.model.model import Mechanism, Model
from seerob.twin.state import State

G = 9.81
"""[m/s²]"""
ACTION_LIMIT = 3400.0
"""[N], NIOSH 1981, kept by the revised equation of 1991 (1)."""
LEVER, LONG_LEVER = 0.05, 0.075
"""Of the muscles of the back behind L5/S1 [m]: 5 cm (Chaffin's model, 2+); at most 7.5 cm (McGill and Norman
1987, quoted from memory)."""
BODY = 0.1
"""By how much each bone's weight may differ from that of the regressions, as a share; a choice."""
WINDOW = 0.2
"""Over which accelerations are taken [s]: a lift takes a second and more; a choice."""
FEWEST = 5
"""Instants within it, by which noise is not an acceleration of its own; a choice."""
SELDOM = WINDOW / (FEWEST - 1)
"""Who is asked less often does not see whether a motion is slow [s]."""
SHARE = 0.1
"""How much more than their weight body and load may press where the motion is called slow; a choice."""
ARMS = {
    side: tuple(f"{side}_{bone}" for bone in ("upper_arm", "forearm", "hand")) for side in ("right", "left")
}
CHAINS: dict[str, tuple[str, ...]] = {
    "lumbar": ("lumbar",),
    "thorax": ("lumbar", "thorax"),
    "neck": ("lumbar", "thorax", "neck"),
    "head": ("lumbar", "thorax", "neck", "head"),
    **{
        bone: ("lumbar", "thorax", f"{side}_clavicle", *arm[: k + 1])
        for side, arm in ARMS.items()
        for k, bone in enumerate(arm)
    },
    **{f"{side}_clavicle": ("lumbar", "thorax", f"{side}_clavicle") for side in ARMS},
}
"""Bones above L5/S1, each with those between that joint and itself."""
UPPER = tuple(bone for bone in BONES if bone in CHAINS)


class Held(NamedTuple):
    """What a posture asks of the back and shoulders."""

    vector: Array
    """Moment of all weights about L5/S1 [N·m], in the world, shape (3,)."""
    moment: float
    """Size of it across the spine [N·m]."""
    weight: float
    """Above it, with the load [N]."""
    body: float
    """Without the load [N]."""
    upright: float
    """Cosine between the spine's axis there and the vertical."""
    error: float
    """By how much the moment may be off as angles are [N·m]."""
    each: float
    """Sum of the sizes of the moments of all bones [N·m]."""
    shoulders: tuple[float, float]
    """Moments about the right shoulder and the left one [N·m]."""
    at: Array
    """Centres of mass of the bones [m], shape (n, 3)."""
    masses: Array
    """Of the bones, with the load [kg], shape (n,)."""
    joint: Array
    """L5/S1 [m], shape (3,)."""
    spine: Array
    """Its axis there, shape (3,)."""


def compression(moment: float, weight: float, upright: float, lever: float) -> float:
    """Force along the spine [N] of a moment across it [N·m], held by a muscle with a lever [m].

    Args:
        moment: Its size [N·m].
        weight: Above the disc [N].
        upright: Cosine between spine and vertical; of who hangs upside down the weight does not relieve.
        lever: Of the muscle [m].
    """
    moment, lever = float(at_least("moment", moment, unit="N·m")), float(at_least("lever", lever, unit="m"))
    return moment / lever + float(at_least("weight", weight, unit="N")) * max(upright, 0.0)


def held(
    R: Array, x: Array, masses: Array, coms: Array, load: float, hands: tuple[str, ...], off: float
) -> Held:
    """Moments that hold a posture still.

    Args:
        R: World, z up, from bone, shape (n, 3, 3), of `UPPER`.
        x: Origins of the bones [m], shape (n, 3).
        masses: Of the bones [kg], shape (n,).
        coms: Their centres of mass in the bones [m], shape (n, 3).
        load: Mass in the hands [kg].
        hands: That hold it, each as much: ``right``, ``left`` or both.
        off: How far each angle may be off [rad].
    """
    row = {bone: k for k, bone in enumerate(UPPER)}
    at = x + np.einsum("nij,nj->ni", R, coms)
    m = masses.copy()
    for side in hands:
        m[row[f"{side}_hand"]] += load / len(hands)  # it is where the hand's own centre of mass is
    p, u = x[row["lumbar"]], R[row["lumbar"]][:, 1]
    force = np.zeros((len(m), 3))
    force[:, 2] = -G * m
    moments = np.cross(at - p, force)
    vector = moments.sum(axis=0)
    across = float(np.linalg.norm(vector - (vector @ u) * u))
    # Each joint on the way turns what is beyond it by as much as its angle is off.
    paths = [
        sum(float(np.linalg.norm(at[k] - x[row[each]])) for each in CHAINS[bone])
        for k, bone in enumerate(UPPER)
    ]
    shoulders = []
    for arm in ARMS.values():
        rows = [row[bone] for bone in arm]
        about = np.cross(at[rows] - x[rows[0]], force[rows]).sum(axis=0)
        shoulders.append(float(np.linalg.norm(about)))
    return Held(
        vector=vector,
        moment=across,
        weight=G * float(m.sum()),
        body=G * float(masses.sum()),
        upright=float(u[2]),
        # The spine's axis, across which the moment counts, is off, too.
        error=off * (G * float(m @ np.array(paths)) + float(np.linalg.norm(vector))),
        each=float((np.linalg.norm(moments, axis=1) * masses / m).sum()),
        shoulders=(shoulders[0], shoulders[1]),
        at=at,
        masses=m,
        joint=p,
        spine=u,
    )


def moved(found: Held, a: Array, lever: float) -> float:
    """Compression while bones and load accelerate [N]; of a body at rest that of `compression`.

    Args:
        found: The posture.
        a: Accelerations of the bones' centres of mass [m/s²], shape (n, 3).
        lever: Of the muscle [m].
    """
    agree(n=(len(found.masses), len(a)))
    force = found.masses[:, None] * (np.array([0.0, 0.0, -G]) - a)
    vector, u = np.cross(found.at - found.joint, force).sum(axis=0), found.spine
    across = float(np.linalg.norm(vector - (vector @ u) * u))
    return compression(across, max(0.0, float(-force[:, 2].sum())), float(u[2]), lever)


class Accelerations:
    """Of points, out of where they were at the last instants: the parabola through those of `WINDOW`."""

    def __init__(self) -> None:
        self._seen = deque[tuple[float, Array]]()

    def add(self, t: float, at: Array) -> Array | None:
        """Accelerations [m/s²], shape (n, 3); None while fewer than `FEWEST` instants are within the window.

        Args:
            t: [s]
            at: Points then [m], shape (n, 3).
        """
        seen = self._seen
        if seen and not 0 <= t - seen[-1][0] <= SELDOM * (1 + 1e-9):
            seen.clear()
        elif seen and t == seen[-1][0]:
            seen.pop()
        seen.append((t, at))
        while t - seen[0][0] > WINDOW * (1 + 1e-9):
            seen.popleft()
        if len(seen) < FEWEST or t - seen[0][0] < WINDOW / 2:
            return None
        return of_parabola([each - t for each, _ in seen], [each for _, each in seen])


def of_parabola(t: Sequence[float] | Array, places: Sequence[Array] | Array) -> Array:
    """Acceleration of points that the parabola nearest to them has [m/s²], shape (n, 3).

    Args:
        t: Instants [s], shape (k,).
        places: Where the points are then [m], shape (k, n, 3).
    """
    rows = np.asarray(places)
    found: Array = 2 * np.linalg.lstsq(np.vander(t, 3), rows.reshape(len(rows), -1), rcond=None)[0][0]
    return found.reshape(rows.shape[1:])


def bind_ahead(model: Model, human: Mechanism, bones: Sequence[int]) -> Callable[[State], Array | None]:
    """Return what says how a file, or nobody, goes on to move the centres of mass of bones.

    Args:
        model: The workstation.
        human: The person.
        bones: Of MuJoCo.

    Returns:
        A function that returns accelerations over the next `WINDOW` seconds [m/s²], shape (n, 3); None where
        nobody knows, or something else moves the person along.
    """
    data, ahead = mujoco.MjData(model.mj), np.linspace(0.0, WINDOW, 2 * FEWEST)

    def accelerations(state: State) -> Array | None:
        foreseen = None if human.on else state.foresee(human.name, state.t + ahead)
        if foreseen is None or foreseen[2]:
            return None
        places = []
        for q in foreseen[0]:
            data.qpos[human.q_address] = human.coupling @ q + human.offset
            mujoco.mj_kinematics(model.mj, data)
            places.append(data.xipos[bones].copy())
        return of_parabola(ahead, places)

    return accelerations


class BackCompression(PostureRule, frozen=True, kw_only=True):
    """Compression of the disc L5/S1 of a person who holds a load, and moments about the shoulders."""

    unit: ClassVar[str] = "N"
    adults: ClassVar[bool] = True
    by_shape: ClassVar[bool] = False
    weighs_hands: ClassVar[bool] = True

    load: Kilograms | None = None
    """Mass in the hands [kg]; what the twin's hands are seen to hold counts where that is more."""
    hands: Literal["both", "right", "left"] = "both"
    """Which hold it; of both each has half of it."""
    slow: bool = False
    """Whether body and load move so slowly that no more than their weight acts; else nothing is within, nor
    where they are seen to move faster."""
    limit: Annotated[float, Meta(gt=0, extra={"unit": "N"})] = ACTION_LIMIT
    """Largest admissible compression [N]; NIOSH's action limit when not given."""
    lever: Annotated[float, Meta(gt=0, le=0.2, extra={"unit": "m"})] = LEVER
    """Shortest lever of the muscles of the back [m]."""
    long_lever: Annotated[float, Meta(gt=0, le=0.2, extra={"unit": "m"})] = LONG_LEVER
    """Longest lever of them [m]."""
    body_tolerance: Annotated[float, Meta(ge=0, lt=1)] = BODY
    """By how much the weight of the upper body may be off, as a share."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.long_lever < self.lever:
            raise ValueError("long_lever is shorter than lever")

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the compression."""
        human = model.human(self.human)
        slots = dict(zip(BONES, bone_rows(model, human), strict=True))
        bones = tuple(slots[bone] for bone in UPPER)
        mj = [model.bodies[i].mj for i in bones]
        masses, coms = model.mj.body_mass[mj].copy(), model.mj.body_ipos[mj].copy()
        error, in_hands = self.error(model), bind_handled(model, self.human)
        off = max(error.values(), default=0.0) if isinstance(error, Mapping) else error or 0.0
        sides = ("right", "left") if self.hands == "both" else (self.hands,)
        unmeasured = {bone for bone in self.unmeasured if bone in UPPER}
        accelerations, seldom = Accelerations(), (self.every or 0.0) > SELDOM
        ahead = bind_ahead(model, human, mj)

        def compute(twin: Twin) -> Figure:
            assert isinstance(twin, State)
            hearing = twin.hearing(human.name, strayed=True)
            lost = unmeasured.union(twin.invalid_orientations(human.name), hearing.unaimed(twin.t))
            if unseen := [bone for bone in UPPER if bone in lost]:
                raise Undecided(f"{human.name}: not measured: {', '.join(unseen).replace('_', ' ')}")
            R, x = twin.captured(human.name, bones, posture=True)
            least, most = load_range(self.load, in_hands(twin))
            found = held(R, x, masses, coms, least, sides, off)
            share = self.body_tolerance
            loose, weight = found.error + share * found.each, share * found.body
            value = compression(found.moment, found.weight, found.upright, self.lever)
            low = compression(
                max(found.moment - loose, 0.0), found.weight - weight, found.upright - off, self.long_lever
            )
            high = compression(
                found.moment + loose, found.weight + weight, min(found.upright + off, 1.0), self.lever
            )
            known = math.isfinite(most)
            a, share = accelerations.add(twin.t, found.at), 0.0
            if a is None and self.slow:
                a = ahead(twin)
            if a is not None:
                share = moved(found, a, self.lever) / value - 1
            fast = share > SHARE or high <= self.limit < high * (1 + share)
            unwatched = self.slow and (seldom or a is None)
            return Figure(
                value if known else None,
                self.limit,
                interval=(low, high if known else math.inf),
                open=not (known and self.slow) or unwatched or fast,
                beside=(found, known, share, fast, unwatched),
            )

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says the moments and draws the compression at the lumbar bone."""
        frame, seldom = model.frame(f"{self.human}/lumbar"), (self.every or 0.0) > SELDOM

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            posture, known, share, fast, unwatched = figure.beside
            parts = tuple(
                Result(name=name, value=moment, unit="N·m")
                for name, moment in (
                    ("moment at L5/S1", posture.moment),
                    ("moment at the right shoulder", posture.shoulders[0]),
                    ("moment at the left shoulder", posture.shoulders[1]),
                )
            )
            reason = ""
            if verdict is Verdict.UNDECIDED:
                if not known:
                    reason = "not entered: load"
                elif not self.slow and figure.interval is not None and figure.interval[1] <= self.limit:
                    reason = "what it takes to accelerate body and load is not counted: give slow = true"
                elif fast:
                    reason = (
                        "slow = true, and body and load are seen to accelerate so that they press "
                        f"{share:.0%} harder than their weight"
                    )
                elif seldom:
                    reason = f"every = {self.every:g}: so seldom nobody sees whether it is slow"
                elif unwatched:
                    reason = f"not seen throughout the last {WINDOW / 2:g} s: nobody knows whether it is slow"
                else:
                    reason = "lever of the muscles, weight of the body and accuracy of the angles decide"
            place = state.drawn_point(frame, np.zeros(3))
            return Shown(reason, self._drawing(place, figure.number, verdict), parts)

        return present

    def _drawing(
        self, place: Callable[[], Array], value: float, verdict: Verdict | None
    ) -> Callable[[], tuple[Arrow, ...]] | None:
        if math.isnan(value):
            return None
        label = figures.worded(value, self.limit, self.unit, at_most=True)

        def draw() -> tuple[Arrow, ...]:
            x, y, z = place().tolist()
            long = 1e-4 * value
            return (Arrow(origin=(x, y, z + long), vector=(0.0, 0.0, -long), label=label, verdict=verdict),)

        return draw

    def looks_ahead(self, model: Model) -> Mapping[str, float]:
        """Look ahead where nobody has looked back long enough [s], for accelerations."""
        return {self.human: WINDOW} if self.slow else {}

    def remembers(self, model: Model) -> bool:
        """Say that accelerations follow from earlier instants."""
        return True

    def one_by_one(self, model: Model) -> str:
        """Say so: what hands hold is known of one instant at a time."""
        return "what hands hold is known of one instant at a time"

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        load = Input(name="load", origin=Origin.MISSING, source="not entered")
        if self.load is not None:
            load = provenance.given("load", self.load, "kg")
        own = [
            Input(
                name=name,
                value=value,
                unit=unit,
                origin=Origin.CHOICE if value == usual else Origin.GIVEN,
                source=source if value == usual else "workstation file",
            )
            for name, value, usual, unit, source in (
                ("lever", self.lever, LEVER, "m", "Chaffin's single muscle, as public sources quote it (2+)"),
                ("long_lever", self.long_lever, LONG_LEVER, "m", "McGill and Norman 1987, from memory"),
                ("body_tolerance", self.body_tolerance, BODY, "", "a choice"),
                ("limit", self.limit, ACTION_LIMIT, "N", "NIOSH 1981, action limit, kept in 1991 (1)"),
            )
        ]
        return Basis(
            formula="C = |M⊥| / d + W u_z at L5/S1; M and W of the body above it and of the load, at rest",
            source="single equivalent muscle (Chaffin), as public sources quote it; the book was not read; "
            "limit: NIOSH 1981, kept in 1991",
            inputs=(
                *provenance.motion(model, self.human),
                load,
                *own,
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured, model, self.human),
            ),
            not_modelled=(
                "what it takes to accelerate body and load: with slow = false nothing is within, nor where "
                f"they are seen to press {SHARE:.0%} harder than their weight; in the first {WINDOW / 2:g} s "
                "what a file says of the next ones counts, and without one nothing is within",
                "a load whose centre is farther from the body than the hands, or that pushes or pulls",
                "muscles that work against each other, and pressure in the abdomen",
                "twisting moments, shear, and how often it is done",
                NOTE,
            ),
        )

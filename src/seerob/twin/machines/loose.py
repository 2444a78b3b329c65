r"""Loose workpieces: people take, carry, hand over and put them down, and the physics moves them.

A workpiece that a hand holds hangs on it by a spring: on its centre of mass and about it act

.. math:: F = \min(m, 1\,\mathrm{kg}) (\omega^2 \Delta x + 2 \omega \Delta v) - m g,\quad
          \tau = I (\omega^2 \Delta\varphi + 2 \omega \Delta w)

toward where it would be if it were fixed to the hand as it was when it was taken, no faster than `FASTEST`.
The opposite force acts on the hand's joint, so that arm and trunk carry its weight; the moment about the
wrist is left out, since what pulls a twin's wrist is set for a hand without a load. It is never put
anywhere: a table that is in the way stops it, and farther than ``torn`` from where it should be it is torn
out. In a gripper it hangs on a stiffer one, whose moment the wrist feels. One that was taken from
afar comes to the hand with `REEL`. In a place with ``snap`` the same spring pulls it into the place's pose.

A surface that runs drags what lies on it by friction toward its speed v_b, no harder than within two steps h:

.. math:: F = -\min(\mu N, \tfrac{m}{2 h} |v - v_b|)\, \frac{v - v_b}{|v - v_b|}

at the centre of mass, and what turns on it likewise. N is the normal force of all contacts with it.

Its joints are three ways and three turns. The frame they are counted from is put anew between two ticks
before the second turn comes near a right angle, where the others would be one.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.samples import GrabSample
from seerob.core.snapshot import Event
from seerob.core.transforms import (
    Array,
    inverse,
    length,
    rotation_from_rpy,
    rotation_from_wxyz,
    transform,
    wxyz_from_rotation,
)
from seerob.kernels import loose as kernel
from seerob.model.model import Model
from seerob.model.mounting.compilation import pose_matrix
from seerob.model.mounting.machines import BODY
from seerob.twin.signals import Signals
from seerob.workstation.workstation import Part, Place

STIFFNESS = 8.0
"""Natural frequency of the spring [Hz]: as stiff as arms that hold something; our choice."""
FIRM = 20.0
"""Natural frequency of what a gripper holds [Hz]: under 5 m/s² it lags by 0.3 mm; our choice."""
HEAVY = 1.0
"""What weighs more is pulled no harder [kg], beside its weight: the spring stays stable on a light hand."""
FASTEST, QUICKEST = 4.0, 20.0
"""No spring makes a workpiece go faster [m/s], nor turn faster [rad/s]: a hand that jumps from picture to
picture throws nothing away; our choice, beyond what hands at work do."""
NEAR = 0.25
"""A hand whose wrist is no farther from a workpiece's surface takes it where it is [m]: a hand's length and
what a ball about the workpiece has too much; our choice."""
FARTHEST = 3.0
"""From farther nothing is taken [m]; our choice."""
REEL = 1.5
"""Speed at which what was taken from afar comes to the hand [m/s]; our choice."""
TILTED = math.pi / 4
"""From this second turn on the frame is put anew [rad]."""
STILL, STILL_FOR = 0.02, 0.1
"""Slower than this [m/s] for so long [s] it lies."""
SLACK = 1e-9
"""Instants that differ by less are the same [s]."""
Indices = NDArray[np.int64]
HANDS = ("left_hand", "right_hand")
WAITING = 256
"""Grabs that lie ahead of the tick, at most."""


@dataclass
class _Spring:
    """What pulls a workpiece: a hand, or a place."""

    carrier: int
    """MuJoCo's body that it is fixed to."""
    carrier_from_piece: Array
    """Where it pulls to, shape (4, 4)."""
    reels: bool = False
    """Whether the workpiece is still on its way to the hand."""
    firm: bool = False
    """Whether fingers of a gripper hold it: stiffer, and its wrist feels moments."""


@dataclass
class _Piece:
    """A loose workpiece at one instant."""

    name: str
    index: int
    """Of its shape."""
    body: int
    """MuJoCo's."""
    q: Indices
    """Columns of its joints in ``qpos``, shape (6,)."""
    v: Indices
    """In ``qvel``, shape (6,)."""
    torn: float
    radius: float
    """Of the ball about its centre of mass that contains it [m]."""
    bound: kernel.Piece
    """Keeps the arrays of its table."""
    table: Indices
    """Of `seerob.kernels.loose.PIECE`."""
    hands: dict[str, _Spring] = field(default_factory=dict)
    place: str = ""
    """Where it lies, or whose spring pulls it."""
    pulled: _Spring | None = None
    """Spring of that place."""
    falls: bool = False
    """Whether it was let go and does not lie yet."""
    taken: float = 0.0
    """When it was taken last [s]."""
    since: float = math.inf
    """Since when it is still [s]."""
    by: str = ""
    """Hand that let it go, or what it rode on."""
    rides: Array | None = None
    """Velocity of the surface that it lies on [m/s], where one runs."""


class Loose:
    """The loose workpieces of a twin.

    Args:
        model: The compiled workstation, with a `mujoco.MjModel` of its own.
        physics: The `mujoco.MjModel` that is stepped.
        data: Of that.
        shown: Data of the other one.
        signals: What machines say.

    Attributes:
        names: Of the workpieces.
        events: What happened since `said` was asked last.
    """

    def __init__(
        self,
        model: Model,
        physics: mujoco.MjModel,
        data: mujoco.MjData,
        shown: mujoco.MjData,
        signals: Signals,
    ) -> None:
        self._model, self._mj, self._data, self._shown = model, physics, data, shown
        self.events: list[Event] = []
        self._pieces = {
            piece.name: _piece(model, piece.name, piece.torn)
            for piece in model.workstation.workpieces
            if piece.loose
        }
        self.names = frozenset(self._pieces)
        self._places = {place.name: (place, *_fixed(model, place)) for place in model.workstation.places}
        self._hands = {
            f"{human.name}/{hand}": model.frames[f"{human.name}/{hand}"].mj
            for human in model.workstation.humans
            for hand in HANDS
        }
        self._lost: dict[int, str] = {}
        """Bodies of which nobody knows where they are, with the reason."""
        self._omega = min(2 * math.pi * STIFFNESS, 0.2 / physics.opt.timestep)
        self._firm = min(2 * math.pi * FIRM, 0.2 / physics.opt.timestep)
        self._signals = signals
        self._running = {
            body.mj: _Running(part.name, part.conveyor.speed, _way(part))
            for part in model.workstation.parts
            if part.conveyor is not None
            for body in model.bodies
            if body.role == "part" and body.owner == part.name
        }
        """Surfaces that run, by MuJoCo's body."""
        self._body_of, self._cone = physics.geom_bodyid.astype(np.int32), int(physics.opt.cone)
        self._piece_of, self._surface_of = np.full((2, physics.nbody), -1, np.int64)
        self._piece_of[[piece.body for piece in self._pieces.values()]] = np.arange(len(self._pieces))
        self._surface_of[list(self._running)] = np.arange(len(self._running))
        self._normal = np.zeros((len(self._pieces), len(self._running), 3))
        self._touch = np.zeros(self._normal.shape[:2], bool)
        self._riding = False
        """Whether anything lay on a surface that runs at the step before."""
        # Views that MuJoCo writes through; to ask the data for them takes longer than to use them.
        self._xfrc = data.xfrc_applied
        self._bodies = kernel.Bodies(
            data.xpos, data.xmat, data.ximat, data.xipos, data.cvel, data.subtree_com, physics.body_rootid,
            self._xfrc, physics.opt.gravity,
        )  # fmt: skip
        """Keeps the arrays of its table."""
        self._table = kernel.BODIES.rows(self._bodies)
        self._back: list[tuple[_Piece, str]] = []
        """What is put into the pose of a place at the next tick."""
        self._waiting: deque[GrabSample] = deque(maxlen=WAITING)
        self._rounds: dict[str, float] = {}
        """When the last round ended at each place [s]."""
        self._filling: dict[str, int] = {}
        """How many workpieces lie in each place that they fill."""
        self._filled: list[float] = []
        """When places were filled [s]."""
        self._first: float | None = None
        """When anything was taken first [s]."""
        self._before: dict[str, tuple[list[float], float, int]] = {}
        self._pulls = False
        self._second = np.array([piece.q[4] for piece in self._pieces.values()], np.int64)
        """Columns of their second turns in ``qpos``."""
        if (
            self._pieces
        ):  # Loops that are not kept yet are compiled now: a run that waits for them falls behind.
            self._compile()

    def _compile(self) -> None:
        """Ask each loop once, of nothing."""
        piece = next(iter(self._pieces.values()))
        self._pull(piece, _Spring(0, np.eye(4)), self._mj.opt.timestep)
        self._pressed()
        self._rub(piece, np.zeros(3), np.zeros(3), self._mj.opt.timestep)
        self._xfrc[:] = 0.0

    def bodies(self) -> frozenset[int]:
        """Bodies of all of them, by index."""
        return frozenset(b.index for b in self._model.bodies if b.owner in self._pieces)

    def hear(self, sample: GrabSample) -> None:
        """Hear what a hand holds, from the sample's instant on."""
        self._waiting.append(sample)

    # -- the physics' steps -----------------------------------------------------------------

    def pull(self, t: float, dt: float) -> None:
        """Before a step: take and let go what was heard until ``t`` [s], and set the springs' forces."""
        while self._waiting and self._waiting[0].t <= t + SLACK:
            self._grab(self._waiting.popleft(), t)
        if self._pulls:
            self._xfrc[:] = 0.0
            self._pulls = False
        if self._running:
            self._drag(t, dt)
        for piece in self._pieces.values():
            for hand, spring in tuple(piece.hands.items()):
                self._pulls = True
                if self._pull(piece, spring, dt) > piece.torn:
                    del piece.hands[hand]
                    reason = f"farther than {piece.torn:g} m from where the hand has it"
                    self._say(t, "torn", piece, by=hand, reason=reason)
                    self._let_go(piece, hand)
            if piece.pulled is not None and not piece.hands:
                self._pulls = True
                if self._pull(piece, piece.pulled, dt) > 2 * piece.torn + self._places[piece.place][3]:
                    piece.pulled, piece.place = None, ""

    def _drag(self, t: float, dt: float) -> None:
        """Let surfaces that run drag what lies on them."""
        count = self._pressed()
        if not count and not self._riding:
            return
        self._riding = bool(count)
        for piece, touch, normals in zip(
            self._pieces.values(), self._touch.tolist(), self._normal, strict=True
        ):
            if piece.rides is not None and not any(touch):
                piece.rides = None
                if not piece.hands:
                    piece.falls, piece.since = True, math.inf
            for runs, lies, normal in zip(self._running.values(), touch, normals, strict=True):
                if lies:
                    self._ride(piece, runs, normal, t, dt)

    def _pressed(self) -> int:
        """How many contacts workpieces have with surfaces that run; sums their normal forces."""
        contact = self._data.contact
        found = kernel.pressed(
            contact.geom, contact.frame, contact.dim, contact.efc_address, self._data.efc_force,
            self._cone, self._body_of, self._piece_of, self._surface_of, self._normal, self._touch,
        )  # fmt: skip
        return int(found)

    def _ride(self, piece: _Piece, runs: _Running, normal: Array, t: float, dt: float) -> None:
        known = self._signals.at(runs.variable, t)
        if known.value is None or known.invalid_reason:
            why = known.invalid_reason or f"{runs.variable}: not heard"
            if not self.is_lost(piece.name) and not piece.hands:
                reason = f"{piece.name}: how far {runs.part} took it along nobody knows ({why})"
                self.lose([piece.name], reason)
        piece.rides, piece.by = float(known.value or 0.0) * runs.way, piece.by or runs.part
        self._rub(piece, piece.rides, normal, dt)
        self._pulls = True

    def _rub(self, piece: _Piece, rides: Array, normal: Array, dt: float) -> None:
        """Set the friction on a surface that runs at a velocity [m/s] and presses it with a force [N]."""
        kernel.drag(self._table, piece.table, piece.body, rides, normal, dt)

    def _pull(self, piece: _Piece, spring: _Spring, dt: float) -> float:
        """Set the forces of a spring; how far the workpiece is from where it pulls [m]."""
        gap, reels = kernel.pull(
            self._table, piece.table, piece.body, spring.carrier, spring.carrier_from_piece,
            self._firm if spring.firm else self._omega, spring.firm, spring.reels, REEL * dt,
        )  # fmt: skip
        spring.reels = bool(reels)
        return float(gap)

    # -- hands ------------------------------------------------------------------------------

    def held(self) -> dict[str, tuple[str, ...]]:
        """Workpieces that hands and grippers hold, each with these."""
        return {name: tuple(piece.hands) for name, piece in self._pieces.items() if piece.hands}

    def snapped(self) -> list[str]:
        """Workpieces that a place pulls into its pose."""
        return [name for name, piece in self._pieces.items() if piece.pulled is not None]

    def lags(self) -> dict[str, float]:
        """How far what is held is at most from where it would be if it were fixed [m], by name.

        What still comes to a hand from afar is nothing that somebody could hold, and is where it is.
        """
        return {
            name: max(self._lag(piece, spring) for spring in piece.hands.values())
            for name, piece in self._pieces.items()
            if piece.hands
        }

    def _lag(self, piece: _Piece, spring: _Spring) -> float:
        if spring.reels:
            return 0.0
        wanted, here = (
            _pose(self._data, spring.carrier) @ spring.carrier_from_piece,
            _pose(self._data, piece.body),
        )
        com = self._mj.body_ipos[piece.body]
        shift = (wanted - here)[:3, :3] @ com + (wanted - here)[:3, 3]
        turn = float(np.linalg.norm(_rotation_vector(wanted[:3, :3] @ here[:3, :3].T)))
        return float(length(shift)) + 2 * piece.radius * math.sin(0.5 * turn)

    def _grab(self, sample: GrabSample, t: float) -> None:
        hand = sample.target
        held = next((piece for piece in self._pieces.values() if hand in piece.hands), None)
        if held is not None and held.name == sample.piece:
            return
        if held is not None:
            del held.hands[hand]
            self._let_go(held, hand)
            self._pulls = True  # forces are to be taken back
        if not sample.piece:
            return
        piece = self._pieces.get(sample.piece)
        body = self._hands.get(hand)
        if piece is None or body is None:
            what = f"no loose workpiece {sample.piece!r}" if piece is None else f"no hand {hand!r}"
            self.events.append(Event(t=t, what="refused", piece=sample.piece, by=hand, reason=what))
            return
        far = float(np.linalg.norm(self._data.xipos[piece.body] - self._data.xpos[body])) - piece.radius
        if not far <= FARTHEST:
            reason = f"{far:.2f} m away: nothing is taken from farther than {FARTHEST:g} m"
            self._say(t, "refused", piece, by=hand, reason=reason)
            return
        fixed = inverse(_pose(self._data, body)) @ _pose(self._data, piece.body)
        self._hold(piece, hand, _Spring(body, fixed, reels=far > NEAR), t)

    def _hold(self, piece: _Piece, hand: str, spring: _Spring, t: float) -> None:
        if piece.hands:
            self._say(t, "handed", piece, by=hand)
        else:
            self._say(t, "taken", piece, by=hand, where=piece.place)
            if self._filling.get(piece.place):
                self._filling[piece.place] -= 1
            piece.taken = t
            self._first = t if self._first is None else self._first
        piece.hands[hand] = spring
        piece.pulled, piece.place, piece.falls, self._pulls = None, "", False, True

    def _let_go(self, piece: _Piece, hand: str) -> None:
        if piece.hands:
            return
        piece.falls, piece.since, piece.by = True, math.inf, hand
        for place, body, fixed, _ in self._places.values():
            taken = any(other.place == place.name for other in self._pieces.values())
            if place.snap and not taken and self._in(place, body, fixed, piece):
                piece.place, piece.pulled = place.name, _Spring(body, fixed)
                return

    def _in(self, place: Place, body: int, fixed: Array, piece: _Piece) -> bool:
        """Whether the origin of a workpiece is in a place."""
        if not fnmatchcase(piece.name, place.of):
            return False
        local = inverse(_pose(self._data, body) @ fixed) @ _pose(self._data, piece.body)
        return bool((np.abs(local[:3, 3]) <= 0.5 * np.array(place.size)).all())

    # -- grippers ---------------------------------------------------------------------------

    def radius(self, name: str) -> float:
        """Of the ball about the centre of mass of a workpiece that contains it [m]."""
        return self._pieces[name].radius

    def held_by(self, gripper: str) -> str:
        """What a gripper holds; empty for nothing."""
        return next((name for name, piece in self._pieces.items() if gripper in piece.hands), "")

    def take(self, name: str, gripper: str, palm: int, t: float) -> None:
        """Let a gripper hold a workpiece as it is.

        Args:
            name: Of the workpiece.
            gripper: Name of the gripper.
            palm: MuJoCo's body that holds its fingers.
            t: Now [s].
        """
        piece = self._pieces[name]
        fixed = inverse(_pose(self._data, palm)) @ _pose(self._data, piece.body)
        self._hold(piece, gripper, _Spring(palm, fixed, firm=True), t)

    def let_go(self, name: str, gripper: str, t: float, *, unheard: str, slid: bool) -> None:
        """Let a gripper hold a workpiece no more.

        Args:
            name: Of the workpiece.
            gripper: Name of the gripper.
            t: Now [s].
            slid: Whether it did not open: it slid off what something stopped.
            unheard: Why the gripper was not relied on until now; empty when it was.
        """
        piece = self._pieces[name]
        del piece.hands[gripper]
        if slid:
            self._say(t, "torn", piece, by=gripper, reason="its fingers slid off")
        self._let_go(piece, gripper)
        self._pulls = True  # forces are to be taken back
        if unheard:
            self.lose(
                [name], f"{name}: let go while its gripper was not relied on ({unheard}), nobody knows where"
            )

    def is_lost(self, name: str) -> bool:
        """Whether nobody knows where a workpiece is."""
        return self._pieces[name].index in self._lost

    def lose(self, names: Iterable[str], reason: str, bodies: Iterable[int] = ()) -> None:
        """From now on nobody knows where workpieces are, nor what else there is of them in grippers."""
        self._lost |= dict.fromkeys((*(self._pieces[name].index for name in names), *bodies), reason)

    # -- ticks ------------------------------------------------------------------------------

    def begin(self, before: Array) -> tuple[str, ...]:
        """Before a tick: put back what is to begin again, and frames anew.

        Args:
            before: Velocities before the last step, shape (nv,); written.

        Returns:
            What was put elsewhere.
        """
        back, self._back = self._back, []
        for piece, to in back:
            _, carrier, fixed, _ = self._places[to]
            pose = _pose(self._shown, carrier) @ fixed
            for model in (self._mj, self._model.mj):
                model.body_pos[piece.body] = pose[:3, 3]
                model.body_quat[piece.body] = wxyz_from_rotation(pose[:3, :3])
            for rates in (self._data.qvel, before, self._shown.qvel):
                rates[piece.v] = 0.0
            for positions in (self._data.qpos, self._shown.qpos):
                positions[piece.q] = 0.0
            self._data.qacc_warmstart[piece.v] = 0.0
            piece.place, piece.rides = "", None
            self._before.pop(piece.name, None)
        if len(self._second) and np.abs(self._data.qpos[self._second]).max() > TILTED:
            for piece in self._pieces.values():
                if abs(self._data.qpos[piece.q[4]]) > TILTED:
                    self._put_frame_anew(piece, before)
        return tuple(piece.name for piece, _ in back)

    def _put_frame_anew(self, piece: _Piece, before: Array) -> None:
        mj, q, v = self._mj, piece.q, piece.v
        base = rotation_from_wxyz(mj.body_quat[piece.body])
        origin = mj.body_pos[piece.body].copy()
        at = self._data.qpos[q].copy()
        turned = base.copy()
        axes = np.empty((3, 3))
        for k in range(3):
            axes[:, k] = turned[:, k]
            turned = turned @ _about(k, float(at[3 + k]))
        origin = origin + base @ at[:3]
        wxyz = wxyz_from_rotation(turned)
        turned = rotation_from_wxyz(np.array(wxyz))
        for rates in (self._data.qvel, before, self._shown.qvel):
            rates[v[:3]] = turned.T @ base @ rates[v[:3]]
            rates[v[3:]] = turned.T @ axes @ rates[v[3:]]
        for positions in (self._data.qpos, self._shown.qpos):
            positions[q] = 0.0
        for model in (mj, self._model.mj):
            model.body_pos[piece.body], model.body_quat[piece.body] = origin, wxyz
        self._data.qacc_warmstart[v] = 0.0

    def stop(self, name: str, before: Array) -> None:
        """Let one stand that the physics has lost, where it is; its way is not known.

        Args:
            name: Of the workpiece.
            before: Velocities before the last step, shape (nv,); written.
        """
        piece = self._pieces[name]
        self._data.qvel[piece.v] = before[piece.v] = self._data.qacc_warmstart[piece.v] = 0.0

    def end(self, t: float) -> None:
        """After a tick at ``t`` [s]: look what lies, and where."""
        places = self._shown.xpos
        for piece in self._pieces.values():
            place, carrier = places[piece.body], 0 if piece.pulled is None else piece.pulled.carrier
            if carrier:
                place = self._shown.xmat[carrier].reshape(3, 3).T @ (place - places[carrier])
            if piece.rides is not None:
                place = place - t * piece.rides
            here = place.tolist()
            last, self._before[piece.name] = self._before.get(piece.name), (here, t, carrier)
            if not piece.falls:
                continue
            if last is None or (last[2] == carrier and math.dist(here, last[0]) > STILL * (t - last[1])):
                piece.since = math.inf
                continue
            piece.since = min(piece.since, t)
            if t - piece.since >= STILL_FOR - SLACK:
                self._lies(piece, t)

    def _lies(self, piece: _Piece, t: float) -> None:
        piece.falls = False
        inside = [
            place for place, body, fixed, _ in self._places.values() if self._in(place, body, fixed, piece)
        ]
        # Of places within one another the smallest is meant.
        place = min(inside, key=lambda one: math.prod(one.size), default=None)
        took = t - piece.taken
        if place is None:
            piece.place = ""
            self._say(t, "dropped", piece, by=piece.by, took=took)
            return
        piece.place = place.name
        self._say(t, "placed", piece, by=piece.by, where=place.name, took=took)
        if place.returns is not None:
            self._back.append((piece, place.returns))
            self._say(t, "returned", piece, where=place.returns)
        if place.ends_round:
            before = max(self._rounds.values(), default=self._first or 0.0)
            begun = self._rounds.get(place.name, before)
            self._rounds[place.name] = t
            self._say(t, "round", piece, by=piece.by, where=place.name, took=t - begun)
        if place.full is not None:
            self._fill(place.name, place.full, piece, t)

    def _fill(self, place: str, full: int, piece: _Piece, t: float) -> None:
        """One more lies in a place that takes so many; the next ones begin another."""
        self._filling[place] = self._filling.get(place, 0) + 1
        if self._filling[place] < full:
            return
        self._filling[place] = 0
        begun = self._filled[-1] if self._filled else self._first or 0.0
        self._filled.append(t)
        self._say(t, "filled", piece, by=piece.by, where=place, took=t - begun, count=len(self._filled))

    def _say(
        self,
        t: float,
        what: str,
        piece: _Piece,
        *,
        by: str = "",
        where: str = "",
        took: float | None = None,
        reason: str = "",
        count: int = 0,
    ) -> None:
        said = Event(
            t=t, what=what, piece=piece.name, by=by, where=where, took=took, reason=reason, count=count
        )
        self.events.append(said)

    def said(self) -> tuple[Event, ...]:
        """What happened since this was asked last."""
        said, self.events = tuple(self.events), []
        return said

    def lost(self) -> dict[int, str]:
        """Bodies of which nobody knows where they are, with the reason."""
        return self._lost


@dataclass(frozen=True)
class _Running:
    """A part whose surface runs."""

    part: str
    variable: str
    way: Array
    """Direction in the world, shape (3,)."""


def _way(part: Part) -> Array:
    assert part.conveyor is not None
    along = np.array(part.conveyor.along)
    return np.asarray(pose_matrix(part.at)[:3, :3] @ along / np.linalg.norm(along))


def _piece(model: Model, name: str, torn: float) -> _Piece:
    mechanism = model.mechanisms[name]
    body = model.frames[f"{name}/{BODY}"].mj
    com = model.mj.body_ipos[body]
    own = [b for b in model.bodies if b.owner == name]
    reach = [float(np.linalg.norm(b.corners - com, axis=1).max(initial=0.0)) + b.radius for b in own]
    table = next(piece for piece in model.workstation.workpieces if piece.name == name)
    mass, moments = float(model.mj.body_mass[body]), model.mj.body_inertia[body].copy()
    radius = max(reach, default=0.0)
    figures = np.empty(8)
    figures[[kernel.MASS, kernel.PULLED, kernel.RADIUS]] = mass, min(mass, HEAVY), radius
    figures[[kernel.FRICTION, kernel.LARGEST]] = table.friction, moments.max()
    figures[[kernel.NEAR, kernel.FASTEST, kernel.QUICKEST]] = 0.5 * NEAR, FASTEST, QUICKEST
    bound = kernel.Piece(com.copy(), moments, figures)
    return _Piece(
        name,
        own[0].index,
        body,
        mechanism.q_address,
        mechanism.v_address,
        torn,
        radius,
        bound,
        kernel.PIECE.rows(bound),
    )


def _fixed(model: Model, place: Place) -> tuple[int, Array, float]:
    """MuJoCo's body that a place moves with, its pose there, and half its diagonal [m].

    Raises:
        UnknownName: It is on nothing that there is.
    """
    half = 0.5 * math.hypot(*place.size)
    if place.on is None:
        return 0, pose_matrix(place.at), half
    moving = model.mechanisms.get(place.on)
    machine = moving is not None and moving.role == "machine"
    frame = model.frame(f"{place.on}/{BODY}" if machine else place.on)
    return frame.mj, frame.body_from_frame @ pose_matrix(place.at), half


def _pose(data: mujoco.MjData, body: int) -> Array:
    """World from body, shape (4, 4)."""
    return transform(data.xmat[body].reshape(3, 3), data.xpos[body])


def _about(axis: int, angle: float) -> Array:
    return rotation_from_rpy(np.array([angle if k == axis else 0.0 for k in range(3)]))


def _rotation_vector(turn: Array) -> Array:
    """Axis times angle of a rotation [rad], shape (3,)."""
    found, wxyz = np.zeros(3), np.array(wxyz_from_rotation(turn))
    mujoco.mju_quat2Vel(found, wxyz, 1.0)
    return found

"""Grippers that pick up workpieces and let them go: where each is, and on whom it weighs.

A workpiece is held from the tick on at which both fingers are as near to it as ``touch`` and it reaches
between them; it then keeps its place in the hand. It is let go when a finger is farther from it than twice
that, and lies where it was then: nothing falls, and no belt takes it along. Where another gripper has both
fingers at it then, or while it lies, nobody knows where it is, nor what that gripper weighs. Where a run
begins with fingers that are not shut and no farther apart than if they held it, as the file has it in the
hand, and it does not lie between them, nobody knows where it is.

What is loose is held in the same way, one at a time, wherever it lies: the physics moves it, by a spring
from the gripper, which feels its weight (`seerob.twin.machines.loose`). In masses and distances it is a part
of the gripper meanwhile, put anew where the physics has it by more than `OFF`. Of two that are between the
fingers nobody knows which is held.

What grippers hold along a motion that was recorded: picked up and let go as in the run that it is of.
"""

from __future__ import annotations

from dataclasses import replace
from fnmatch import fnmatchcase

import mujoco
import numpy as np

from seerob.core.errors import InputError
from seerob.core.shapes import Solid
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.distance.least import Query, Shapes
from seerob.model.model import Body, Model
from seerob.model.mounting.machines import AWAY, BODY, FINGERS, OFF, RESTING
from seerob.twin.attachments import Columns
from seerob.twin.machines.following import ON_ITS_WAY
from seerob.twin.machines.loose import Loose
from seerob.twin.state import State
from seerob.twin.validity.hearing import Hearing
from seerob.workstation.tables.machines import Fingers
from seerob.workstation.workstation import Machine, Workpiece


class Held:
    """The grippers of a workstation at one instant of a motion after the other.

    Attributes:
        mj: The `mujoco.MjModel` that tells where bodies are on those that carry them: what is held is where
            it was taken, what was not yet is in the hand as the file has it.
    """

    def __init__(self, model: Model) -> None:
        """At the begin: nothing is held."""
        own = own_masses(model)
        self.mj: mujoco.MjModel = own.mj
        hearings = {name: Hearing(given=True, driven=False) for name in own.mechanisms}
        self._data = mujoco.MjData(own.mj)
        self._state = State(own, self._data, hearings)
        self._loose = any(body.holder not in ("", body.owner) for body in own.bodies)
        self._grips = Grips(self._state, own.mj)

    def follow(self, qpos: Array) -> None:
        """The next instant.

        Args:
            qpos: Positions of all joints [rad or m], shape (nq,).
        """
        if not self._loose:
            return
        self._data.qpos[:] = qpos
        self._state.refresh(self._state.t)
        if self._grips.follow(self._state):
            self._state.refresh(self._state.t)


def before(model: Model, qpos: Array) -> Held:
    """The grippers after a motion.

    Args:
        model: The compiled workstation.
        qpos: Positions of all joints at its instants [rad or m], shape (N, nq).
    """
    held = Held(model)
    for at in np.asarray(qpos, float):
        held.follow(at)
    return held


LET_GO = 2.0
"""A finger that is farther than this times ``touch`` does not hold any more."""


def own_masses(model: Model) -> Model:
    """Copy the MuJoCo model, so that masses and places may change, when something is picked up."""
    changes = any(piece.rest is not None or piece.loose for piece in model.workstation.workpieces)
    return replace(model, mj=model.mj.__copy__()) if changes else model


class Grips:
    """The workpieces of a twin that are picked up and let go. None is held at first.

    Args:
        state: The twin, of a model from `own_masses`.
        physics: The `mujoco.MjModel` that is stepped.
        loose: The loose workpieces; None where no physics moves them, and nobody knows who holds them.

    Raises:
        InputError: The fingers of a gripper do not face each other.
    """

    def __init__(self, state: State, physics: mujoco.MjModel, loose: Loose | None = None) -> None:
        models = (state.model.mj, physics)
        station = state.model.workstation
        self._grips: list[_Grip | _Jaws] = [
            _Grip(state, models, piece) for piece in station.workpieces if piece.rest is not None
        ]
        if loose is not None:
            self._grips += [
                _Jaws(state, models, loose, machine, machine.motion)
                for machine in station.machines
                if isinstance(machine.motion, Fingers)
                and any(fnmatchcase(name, machine.motion.takes) for name in loose.names)
            ]
        self._masses = np.zeros(0)
        self._weigh(state)

    def follow(self, state: State) -> bool:
        """Look who holds what now; whether that changed, so that the state is to be renewed."""
        changed = [grip.follow(state) for grip in self._grips]
        if any(changed):
            self._weigh(state)
        return any(changed)

    def _weigh(self, state: State) -> None:
        mj = state.model.mj
        if self._grips and not np.array_equal(self._masses, mj.body_subtreemass):
            self._masses = mj.body_subtreemass.copy()
            mechanisms = state.model.mechanisms.values()
            state.columns = {m.name: Columns.of(m, mj) for m in mechanisms}


class _Grip:
    """A workpiece and its gripper."""

    def __init__(self, state: State, models: tuple[mujoco.MjModel, ...], piece: Workpiece) -> None:
        model = state.model
        self._models, self._piece, self._hand = models, piece.name, piece.on
        machine = next(m for m in model.workstation.machines if m.name == piece.on)
        assert isinstance(machine.motion, Fingers)
        self._touch = machine.motion.touch
        own = [b for b in model.bodies if b.owner == piece.name]
        self._held = [b.index for b in own if b.carrier]
        self._resting = [b.index for b in own if not b.carrier]
        self._fingers = [_body(model, f"{piece.on}/{side}") for side in FINGERS]
        ids = (piece.name, f"{piece.name}/{RESTING}", f"{piece.name}/{AWAY}", f"{piece.on}/{BODY}")
        self._in_hand, self._lying, self._away, self._palm = (
            int(mujoco.mj_name2id(model.mj, mujoco.mjtObj.mjOBJ_BODY, name)) for name in ids
        )
        mj = model.mj
        self._mass, self._inertia = float(mj.body_mass[self._in_hand]), mj.body_inertia[self._in_hand].copy()
        self._gap = _reaching_between(model, self._fingers[0], machine.motion, self._resting)
        cap = 2 * LET_GO * self._touch
        self._between_fingers = Query(model.shapes, *((finger.index,) for finger in self._fingers), cap=cap)
        self._queries = {
            places: [Query(model.shapes, (finger.index,), places, cap=cap) for finger in self._fingers]
            for places in (tuple(self._held), tuple(self._resting))
        }
        self._others = [
            _Other(model, other.name, other.motion.touch, places)
            for other in model.workstation.machines
            if other.name != self._hand and isinstance(other.motion, Fingers)
            for places in (tuple(self._held), tuple(self._resting))
        ]
        for index in (*self._held, *self._resting):
            state.attachments.unknown.pop(index, None)
        self._holds = True
        self._unheard = ""
        self._begins = True
        self._bring(state, held=False)

    def follow(self, state: State) -> bool:
        """Whether it was picked up, let go or lost."""
        if state.attachments.unknown.keys() & set(self._resting):
            return False
        if silent(state, self._hand):
            self._unheard = state.invalid_reason(self._hand) or "not heard"
            return False
        unheard, self._unheard = self._unheard, ""
        begins, self._begins = self._begins, False
        grips = self._grips(state)
        if begins and not grips and self._as_if_held(state):
            reason = (
                f"{self._piece}: the run begins with the fingers of {self._hand} as if they held it, nobody "
                "knows where it is: begin with fingers that are open or shut, or let it rest between them"
            )
            state.attachments.unknown |= dict.fromkeys((*self._held, *self._resting), reason)
            return False
        if not grips and (other := self._with_another(state)):
            # Of two that hold it the first one's word counts, as long as it does hold it.
            reason = (
                f"{self._piece}: the fingers of {other.name} are at it, and only those of {self._hand} are "
                "said to pick it up: nobody knows where it is"
            )
            state.attachments.unknown |= dict.fromkeys((*self._held, *self._resting, *other.bodies), reason)
            return False
        if self._holds == grips:
            return False
        if not self._holds:
            self._pick_up(state)
        elif unheard:
            self._let_go(state)
            reason = (
                f"{self._piece}: let go while its gripper was not relied on ({unheard}), nobody knows where"
            )
            state.attachments.unknown |= dict.fromkeys(self._resting, reason)
        else:
            self._let_go(state)
        return True

    def _grips(self, state: State) -> bool:
        """Whether both fingers are at it, or still near it, and it reaches between them."""
        places = tuple(self._held if self._holds else self._resting)
        near = LET_GO * self._touch if self._holds else self._touch
        R, x = state.rotations, state.positions
        if any(query.minimum(R, x).distance > near for query in self._queries[places]):
            return False
        palm = state.data.xmat[self._palm].reshape(3, 3), state.data.xpos[self._palm]
        both = np.stack([palm[0], R[places[0]]]), np.stack([palm[1], x[places[0]]])
        return self._holds or self._gap.minimum(*both).distance <= 0

    def _with_another(self, state: State) -> _Other | None:
        """Another gripper whose fingers are both at it where it is."""
        places = tuple(self._held if self._holds else self._resting)
        here = (other for other in self._others if other.places == places)
        return next((other for other in here if other.grips(state)), None)

    def _as_if_held(self, state: State) -> bool:
        """Whether fingers that are not shut would be at it in the hand, where the file has it there."""
        if self._between_fingers.minimum(state.rotations, state.positions).distance <= self._touch:
            return False
        R, x, held = state.rotations.copy(), state.positions.copy(), self._held
        turn, mj = state.data.xmat[self._palm].reshape(3, 3), state.model.mj
        own = np.empty(9)
        mujoco.mju_quat2Mat(own, mj.body_quat[self._in_hand])
        R[held] = turn @ own.reshape(3, 3)
        x[held] = state.data.xpos[self._palm] + turn @ mj.body_pos[self._in_hand]
        near = LET_GO * self._touch
        return all(query.minimum(R, x).distance <= near for query in self._queries[tuple(held)])

    def _pick_up(self, state: State) -> None:
        index = self._resting[0]
        turn, origin = state.data.xmat[self._palm].reshape(3, 3), state.data.xpos[self._palm]
        rotation = turn.T @ state.rotations[index]
        self._place(self._in_hand, turn.T @ (state.positions[index] - origin), wxyz_from_rotation(rotation))
        self._bring(state, held=True)

    def _let_go(self, state: State) -> None:
        index = self._held[0]
        self._place(self._lying, state.positions[index], state.quaternions[index])
        self._bring(state, held=False)

    def _place(self, body: int, position: Array, wxyz: Array) -> None:
        for mj in self._models:
            mj.body_pos[body], mj.body_quat[body] = position, wxyz

    def _bring(self, state: State, *, held: bool) -> None:
        """Into the hand, or out of it."""
        here, gone = (self._held, self._resting) if held else (self._resting, self._held)
        carrier = self._in_hand if held else self._lying
        for mj in self._models:
            self._load(mj, held)
        for index in here:
            state.attachments.put(state.model.mj, index, carrier)
        for index in gone:
            state.attachments.put(state.model.mj, index, self._away)
        state.attachments.drawn[here] = here
        state.attachments.drawn[gone] = here
        state.attachments.away = (state.attachments.away - set(here)) | set(gone)
        self._holds = held

    def _load(self, mj: mujoco.MjModel, held: bool) -> None:
        """Let it weigh on the hand, or not."""
        _weighs(mj, self._in_hand, self._mass if held else 0.0, self._inertia)


class _Other:
    """A gripper that the file does not let pick up a piece, and that may take it all the same."""

    def __init__(self, model: Model, name: str, touch: float, places: tuple[int, ...]) -> None:
        self.name, self.places, self._touch = name, places, touch
        self.bodies = tuple(b.index for b in model.bodies if b.owner == name)
        fingers = [_body(model, f"{name}/{side}") for side in FINGERS]
        self._queries = [Query(model.shapes, (f.index,), places, cap=2 * touch) for f in fingers]

    def grips(self, state: State) -> bool:
        """Whether both of its fingers are as near to the piece as they are when they hold it."""
        R, x = state.rotations, state.positions
        return all(query.minimum(R, x).distance <= self._touch for query in self._queries)


class _Jaws:
    """A gripper and the loose workpieces that it may take."""

    def __init__(
        self,
        state: State,
        models: tuple[mujoco.MjModel, ...],
        loose: Loose,
        machine: Machine,
        motion: Fingers,
    ) -> None:
        self._loose, self._hand, self._touch = loose, machine.name, motion.touch
        self._mj, self._holds, self._unheard = state.model.mj, "", ""
        self._taken_at = 0.0
        """Width at which it took what it holds [m]."""
        self._fingers = [_body(state.model, f"{machine.name}/{side}") for side in FINGERS]
        self._palm = _mj_body(state.model, f"{machine.name}/{BODY}")
        self._reach = max(
            float(np.linalg.norm(f.corners, axis=1).max(initial=0.0)) + f.radius for f in self._fingers
        )
        self._may = {
            name: _Graspable(state.model, self._hand, self._fingers, motion, name, loose.radius(name))
            for name in sorted(loose.names)
            if fnmatchcase(name, motion.takes)
        }
        for piece in self._may.values():
            for mj in models:
                _weighs(mj, piece.in_hand, 0.0, piece.inertia)
            state.attachments.unknown.pop(piece.held, None)
            self._bring(state, piece, held=False)

    def follow(self, state: State) -> bool:
        """Whether one was taken, let go or torn out, or is to be put anew."""
        held, changed = self._loose.held_by(self._hand), False
        if self._holds and held != self._holds:
            torn = self._may[self._holds]
            self._bring(state, torn, held=False)
            changed, self._holds = True, ""
            if torn.at_fingers(state, LET_GO * self._touch):
                reason = f"{torn.name}: torn out of {self._hand}, and still between its fingers"
                self._loose.lose([torn.name], f"{reason}: nobody knows whether it holds it", [torn.held])
        if silent(state, self._hand):
            self._unheard = state.invalid_reason(self._hand) or "not heard"
            return self._keep(state) or changed
        unheard, self._unheard = self._unheard, ""
        if held:
            if self._may[held].at_fingers(state, LET_GO * self._touch):
                return self._keep(state) or changed
            slid = self._width(state) <= self._taken_at + self._touch
            self._loose.let_go(held, self._hand, state.t, unheard=unheard, slid=slid)
            self._bring(state, self._may[held], held=False)
            self._holds = ""
            return True
        found = [
            p
            for p in self._may.values()
            if not self._loose.is_lost(p.name)
            and self._near(state, p)
            and p.is_between(state, self._touch, self._palm)
        ]
        if len(found) == 1:
            self._loose.take(found[0].name, self._hand, self._palm, state.t)
            self._holds, self._taken_at = found[0].name, self._width(state)
            self._place(state)
            self._bring(state, found[0], held=True)
            return True
        if found:
            names = " and ".join(p.name for p in found)
            self._loose.lose(
                [p.name for p in found],
                f"{names} are between the fingers of {self._hand}: nobody knows which it holds",
                [p.held for p in found],
            )
        return changed

    def _near(self, state: State, piece: _Graspable) -> bool:
        """Whether it may be between the fingers: by the balls that contain both."""
        far = np.linalg.norm(state.positions[piece.index] - state.data.xpos[self._palm])
        return bool(far <= self._reach + self._spread(state) + piece.radius)

    def _width(self, state: State) -> float:
        """How far the fingers are apart [m], but for a constant."""
        one, other = (state.positions[finger.index] for finger in self._fingers)
        return float(np.linalg.norm(one - other))

    def _spread(self, state: State) -> float:
        """How far a finger is from the middle of the gripper [m]."""
        palm = state.data.xpos[self._palm]
        return max(float(np.linalg.norm(state.positions[f.index] - palm)) for f in self._fingers)

    def _keep(self, state: State) -> bool:
        """Put what it holds where the physics has it, when that is elsewhere."""
        if not self._holds:
            return False
        piece = self._may[self._holds]
        shift = np.linalg.norm(state.positions[piece.held] - state.positions[piece.index])
        turn = np.linalg.norm(state.rotations[piece.held] - state.rotations[piece.index]) * piece.radius
        if max(shift, turn) <= OFF:
            return False
        self._place(state)
        return True

    def _place(self, state: State) -> None:
        piece = self._may[self._holds]
        turn, origin = state.data.xmat[self._palm].reshape(3, 3), state.data.xpos[self._palm]
        self._mj.body_pos[piece.in_hand] = turn.T @ (state.positions[piece.index] - origin)
        self._mj.body_quat[piece.in_hand] = wxyz_from_rotation(turn.T @ state.rotations[piece.index])

    def _bring(self, state: State, piece: _Graspable, *, held: bool) -> None:
        """Into the hand, or out of it."""
        _weighs(self._mj, piece.in_hand, piece.mass if held else 0.0, piece.inertia)
        state.attachments.put(self._mj, piece.held, piece.in_hand if held else piece.away)
        state.attachments.drawn[piece.held] = piece.index
        away = {piece.held}
        state.attachments.away = state.attachments.away - away if held else state.attachments.away | away


class _Graspable:
    """A loose workpiece before a gripper and in it."""

    def __init__(
        self, model: Model, hand: str, fingers: list[Body], motion: Fingers, name: str, radius: float
    ) -> None:
        self.name, self.radius = name, radius
        own = _mj_body(model, f"{name}/{BODY}")
        self.mass, self.inertia = float(model.mj.body_mass[own]), model.mj.body_inertia[own].copy()
        self.index, self.held = _body(model, f"{name}/{BODY}").index, _body(model, f"{hand}/{name}").index
        self.in_hand, self.away = _mj_body(model, f"{hand}/{name}"), _mj_body(model, f"{name}/{AWAY}")
        model.mj.body_ipos[self.in_hand] = model.mj.body_ipos[own]
        model.mj.body_iquat[self.in_hand] = model.mj.body_iquat[own]
        cap = 2 * LET_GO * motion.touch
        self._queries = [Query(model.shapes, (finger.index,), (self.index,), cap=cap) for finger in fingers]
        self._gap = _reaching_between(model, fingers[0], motion, [self.index])

    def at_fingers(self, state: State, near: float) -> bool:
        """Whether both fingers are that near [m]."""
        R, x = state.rotations, state.positions
        return all(query.minimum(R, x).distance <= near for query in self._queries)

    def is_between(self, state: State, near: float, palm: int) -> bool:
        """Whether both fingers are that near [m], and it reaches between them."""
        if not self.at_fingers(state, near):
            return False
        turn, origin = state.data.xmat[palm].reshape(3, 3), state.data.xpos[palm]
        both = np.stack([turn, state.rotations[self.index]]), np.stack([origin, state.positions[self.index]])
        return bool(self._gap.minimum(*both).distance <= 0)


def silent(state: State, name: str) -> bool:
    """Whether a gripper or whoever carries it is not known to be where it is shown."""
    while name:
        why = state.hearings[name].invalid_reason(state.t)
        if why and not why.startswith(ON_ITS_WAY):
            return True
        name = state.model.mechanisms[name].on
    return False


def _weighs(mj: mujoco.MjModel, body: int, mass: float, inertia: Array) -> None:
    """Let one of MuJoCo's bodies weigh as much on what carries it [kg, kg·m²], or nothing."""
    change = mass - float(mj.body_mass[body])
    mj.body_mass[body] += change
    mj.body_inertia[body] = inertia if mass else 0.0
    while True:
        mj.body_subtreemass[body] += change
        if body == 0:
            break
        body = int(mj.body_parentid[body])


def _reaching_between(model: Model, finger: Body, motion: Fingers, pieces: list[int]) -> Query:
    """From the plate in the middle between two fingers, in the palm's frame, to a workpiece."""
    plate = _between(finger, np.array(motion.along))
    solids = tuple(solid for index in pieces for solid in model.bodies[index].solids)
    return Query(Shapes.build([("gap", (plate,)), ("piece", solids)]), (0,), (1,), cap=motion.touch)


def _mj_body(model: Model, name: str) -> int:
    return int(mujoco.mj_name2id(model.mj, mujoco.mjtObj.mjOBJ_BODY, name))


def _body(model: Model, name: str) -> Body:
    return next(body for body in model.bodies if body.name == name)


def _between(finger: Body, along: Array) -> Solid:
    """The plate in the middle between two fingers, as large as they face each other, in the palm's frame."""
    up = np.array([0.0, 0.0, 1.0])
    across = np.cross(up, along / np.linalg.norm(along))
    spans = []
    for axis in (across, up):
        reach = finger.corners @ axis
        spans.append((float(reach.min()) - finger.radius, float(reach.max()) + finger.radius))
    # The other finger is turned by half a turn about z.
    half = min(spans[0][1], -spans[0][0])
    if half <= 0:
        what = "its fingers do not face each other"
        raise InputError.at("workstation", finger.owner, what, "let z run through the middle of a finger")
    low, high = spans[1]
    corner = low * up - half * across
    return Solid(points=np.array([corner, corner + 2 * half * across, corner + (high - low) * up]))

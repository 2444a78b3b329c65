r"""Mass matrices of a robot whose masses are known within tolerances.

A body whose mass is off by a share has that share more or less of its inertia too: its part of the mass
matrix, :math:`M_b = m J_c^T J_c + J_\omega^T I J_\omega`, is scaled. Every part is positive semi-definite, so
that with a larger mass of any body

- :math:`\dot q^T M \dot q` is larger or the same,
- :math:`M^{-1}` is smaller in the order of Loewner, :math:`u^T J_v M^{-1} J_v^T u` too, and the effective
  mass along any direction larger or the same,
- :math:`M/2 + m_L` is larger.

All three are monotone in every mass, whatever the others are: their ends are at the ends of the masses.

A density that is off is a mass that is off. Of what follows from a density and a mesh, one share bounds mass,
centre and moments at once (`seerob.description.shapes.mass_bounds`). A centre of mass that is off by d, in
any direction, changes :math:`J_c` by no more than :math:`\delta = |d|` times :math:`J_\omega`, so that for
every :math:`0 < \epsilon < 1`, in the order of Loewner,

.. math:: (1-\epsilon) J_c^T J_c - (1/\epsilon - 1)\,\delta^2 J_\omega^T J_\omega
    \le J_{c+d}^T J_{c+d} \le (1+\epsilon) J_c^T J_c + (1 + 1/\epsilon)\,\delta^2 J_\omega^T J_\omega

(Young's inequality). Both sides are bounds, not ends: ε is chosen by the present motion, for which the
larger one is then reached where :math:`d \perp v`. The lesser is no less than a body that weighs nothing.

Of a body of which only the mass is known and a ball around its centre in which all of it is
(`seerob.description.description.Inertial.within`), each of its parts is d away from the centre, with
:math:`|d| \le \delta`: the inequality holds for each, and so for all of them together, without any moment of
inertia of its own on either side.

Of a body whose centre of mass is known and whose moments are not (`Inertial.gyration`, k), these are anything
between nothing and :math:`m k^2` about every axis: between :math:`m J_c^T J_c` and
:math:`m J_c^T J_c + m k^2 J_\omega^T J_\omega`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from seerob.core.tolerances import Shifts, Tolerance
from seerob.core.transforms import Array
from seerob.description.description import Inertial, Quantity
from seerob.model.model import Mechanism, Model
from seerob.twin.state import State
from seerob.workstation.workstation import Mounted, Workpiece

EXACT = 1e-4
"""Relative error of a volume up to which it is told as exact."""
NOTHING = 1e-9
"""Share of a mass matrix that is none: what may weigh nothing then still has an inverse."""


class MassTolerances:
    """Masses of one robot, with everything mounted on it, that are known within tolerances.

    Args:
        model: The compiled workstation.
        robot: The robot.
    """

    def __init__(self, model: Model, robot: Mechanism) -> None:
        self._model, self.robot = model, robot
        names = {int(i): str(model.mj.body(int(i)).name) for i in robot.mj_bodies}
        bodies = {name: i for i, name in names.items()}
        station = model.workstation
        found: list[_Off] = []
        for table in station.robots:
            if table.name == robot.name:
                own = robot.links
                links = [i for i, name in names.items() if name in own]
                found += _offs(
                    table.name,
                    links,
                    mass=table.mass_tolerance,
                    com=table.com_tolerance,
                    estimated=max(
                        (_estimated(link.inertial) for link in robot.description.links), default=0.0
                    ),
                )
                found += _of_links(robot, bodies, table.mass_tolerance or 0.0)
                if share := table.rotor_tolerance:
                    tolerance = Tolerance(f"rotor_tolerance of {table.name}", 100 * share, "%")
                    found.append(_Off(tolerance, (), share=share, rotors=True))
        for thing in (*station.tools, *station.workpieces):
            own_bodies = [i for i, name in names.items() if name == thing.name or i in _held(model, thing)]
            known = (body.mass for body in model.bodies if body.owner == thing.name)
            found += _offs(
                thing.name,
                own_bodies,
                mass=thing.mass_tolerance,
                density=thing.density_tolerance,
                com=thing.com_tolerance,
                estimated=max(map(_estimated, known), default=0.0),
            )
        if robot.role == "machine":
            found += _of_links(robot, bodies, 0.0)
        found += _estimates(model, robot)
        self.tolerances = tuple(off.tolerance for off in found)
        self._offs = found
        self.own = not robot.on and all(_moved_by(model, robot, body) for off in found for body in off.bodies)
        """Whether all that may be off is moved by the robot's own joints alone."""
        masses = model.mj.body_mass
        # Of M/2 + m_L: links by half, what is mounted in full. A centre of mass changes nothing in it.
        self._simplified = np.array(
            [
                off.share * sum(float(masses[i]) * (1 if i in robot.load else 0.5) for i in off.bodies)
                for off in found
            ]
        )

    def heaviest_load(self) -> float:
        """What is mounted on the robot [kg], at most."""
        masses, load = self._model.mj.body_mass, self.robot.load
        off = sum(o.share * float(masses[i]) for o in self._offs for i in o.bodies if i in load)
        return float(sum(float(masses[i]) for i in sorted(load))) + off

    def __len__(self) -> int:
        """How many tolerances there are."""
        return len(self.tolerances)

    def heaviest(self, body: int) -> tuple[float, float]:
        """Factor on the mass of one of MuJoCo's bodies, and way of its centre of mass [m], at most."""
        offs = [off for off in self._offs if body in off.bodies]
        factor = max(1 + sum(max(off.share, off.spread) for off in offs), *(off.heavier for off in offs), 1.0)
        return factor, sum(off.way_of(body) for off in offs)

    def simplified(self, nominal: float, shifts: Shifts) -> float:
        """M/2 + m_L at shifted masses [kg].

        Args:
            nominal: As given [kg].
            shifts: Of each tolerance.
        """
        found = nominal + float(self._simplified @ np.array(shifts, float)) if shifts else nominal
        return max(found, NOTHING * nominal)

    def weighed(self, mj: mujoco.MjModel, shifts: Shifts) -> mujoco.MjModel:
        """A `mujoco.MjModel` with shifted masses, and moments of inertia with them.

        Centres of mass stay where they are: `moved` names those that may be off.

        Args:
            mj: With masses as given.
            shifts: Of each tolerance.
        """
        found, factors = mj.__copy__(), np.ones(mj.nbody)
        for off, shift in zip(self._offs, shifts, strict=True):
            factors[list(off.bodies)] += shift * max(off.share, off.spread)
            if off.rotors:
                found.dof_armature[self.robot.v_address] *= 1 + shift * off.share
        factors = np.maximum(factors, NOTHING)
        found.body_mass *= factors
        found.body_inertia *= factors[:, None]
        mujoco.mj_setConst(found, mujoco.MjData(found))
        return found

    @property
    def moved(self) -> tuple[str, ...]:
        """What leaves centres of mass open, in words."""
        return tuple(str(off.tolerance) for off in self._offs if off.ways or off.spread)

    @property
    def weighs_otherwise(self) -> bool:
        """Whether it may weigh more or less in all, wherever its masses are."""
        return any(off.share or off.spread for off in self._offs if not off.rotors)

    def of_torques(self, *, at_rest: bool) -> tuple[str, ...]:
        """What leaves torques open, in words: moments of inertia do not where the robot stands."""
        return tuple(str(off.tolerance) for off in self._offs if not (at_rest and off.turned))

    def matrices(self, state: State, rates: Array | None = None) -> Matrices:
        """Mass matrices of a state, to be asked at shifted masses.

        Args:
            state: The twin.
            rates: Of the joints, for which bounds are to be close, shape (n,): those of the motion when not
                given. They hold for any.

        Raises:
            Undecided: Not heard, or a mass that nobody gave.
        """
        M = state.mass_matrix(self.robot)
        rates = state.qd(self.robot) if rates is None else rates
        parts = [off.parts(state, self.robot, rates) for off in self._offs]
        return Matrices(M, parts, lambda: self._without(state, M))

    def energies(self, state: State) -> Callable[[Shifts], float]:
        """How much more energy there is at shifted masses, whatever else moves what may be off [J].

        Args:
            state: The twin.

        Raises:
            Undecided: Not heard.
        """
        rates = state.data_of(self.robot.name, *self.robot.riders).qvel
        parts = [off.parts(state, self.robot, rates, whole=True) for off in self._offs]
        lost, gained = ([0.5 * float(rates @ part[k] @ rates) for part in parts] for k in (0, 2))

        def more(shifts: Shifts) -> float:
            return sum(
                shift * (up if shift > 0 else down)
                for shift, up, down in zip(shifts, gained, lost, strict=True)
            )

        return more

    def _without(self, state: State, M: Array) -> Array:
        """A mass matrix without all bodies that may be off by anything: no less is ever left of it."""
        off = {body for each in self._offs for body in each.bodies}
        found = M - sum((_Part.of(state, self.robot, body).matrix for body in sorted(off)), np.zeros_like(M))
        rates = np.zeros(len(M))
        return found - sum(
            (each.parts(state, self.robot, rates).lost for each in self._offs if each.rotors),
            np.zeros_like(M),
        )


def loose_torques(model: Model, robot: Mechanism, *, at_rest: bool = False) -> str:
    """Why torques that the model needs of a robot may be others: tolerances of masses; empty without.

    Args:
        model: The compiled workstation.
        robot: The robot.
        at_rest: Whether it stands: moments of inertia count for nothing then.
    """
    off = ", ".join(MassTolerances(model, robot).of_torques(at_rest=at_rest))
    return f"{off} not followed in torques that the model needs" if off else ""


class _Bounds(NamedTuple):
    """What one input makes of a mass matrix at its ends, shape (n, n) each."""

    lost: Array
    lost_at_most: Array
    """Never more than a body has: another bound, which leaves the matrix one that can be inverted."""
    gained: Array
    whole: bool
    """Whether nothing of its bodies may be left of it."""


@dataclass(frozen=True)
class _Off:
    """One input of some bodies that may be off."""

    tolerance: Tolerance
    bodies: tuple[int, ...]
    """Of `mujoco`."""
    share: float = 0.0
    """Of their masses."""
    spread: float = 0.0
    """Of all that they add to a mass matrix, no less than the share of their masses; 0 where these alone are
    off."""
    ways: tuple[float, ...] = ()
    """Of the centre of mass of each, or of all its parts [m]; empty where only masses are off."""
    anyhow: bool = False
    """Whether it is all their parts that may be so far from the centre, and their inertia is not known."""
    turned: bool = False
    """Whether it is their radii of gyration that are no more than that, and their centres are known."""
    lighter: float = 1.0
    """Least factor on the masses whose centres may be off."""
    heavier: float = 1.0
    """Largest one."""
    rotors: bool = False
    """Whether it is the share of the rotors' inertias."""

    def way_of(self, body: int) -> float:
        """How far the mass of one of the bodies may be off [m]."""
        return self.ways[self.bodies.index(body)] if self.ways else 0.0

    def parts(self, state: State, robot: Mechanism, qd: Array, *, whole: bool = False) -> _Bounds:
        """What it makes of the mass matrix at its ends; of all that moves, when the whole is asked for."""
        n = len(qd)
        found = [np.zeros((n, n)) for _ in range(3)]
        for body in self.bodies:
            part = _Part.of(state, robot, body, whole=whole)
            way = self.way_of(body)
            share = max(self.share, self.spread)
            lost = min(share, 1.0) * part.matrix
            each = part.shifted(self, way, qd) if self.ways else (lost, lost, share * part.matrix)
            if self.turned:
                each = part.turned(self, way)
            found = [a + b for a, b in zip(found, each, strict=True)]
        if self.rotors:
            spun = state.model.mj.dof_armature[robot.v_address]
            coupling = np.eye(n)[robot.v_address] if whole else robot.coupling
            matrix = self.share * coupling.T @ (spun[:, None] * coupling)
            found = [a + matrix for a in found]
        lost, at_most, gained = found
        return _Bounds(lost, at_most, gained, self.anyhow or self.turned or self.spread >= 1)


@dataclass(frozen=True)
class _Part:
    """What one body makes of the mass matrix."""

    m: float
    J_c: Array
    J_w: Array
    inertia: Array
    """In world axes (3, 3) [kg·m²]."""

    @classmethod
    def of(cls, state: State, robot: Mechanism, body: int, *, whole: bool = False) -> _Part:
        """Of a body of `mujoco`; of the joints of all that moves, when the whole is asked for."""
        mj, data = state.model.mj, state.data_of(robot.name)
        linear, angular = np.zeros((3, mj.nv)), np.zeros((3, mj.nv))
        mujoco.mj_jacBodyCom(mj, data, linear, angular, body)
        J_c, J_w = linear, angular
        if not whole:
            J_c, J_w = (rows[:, robot.v_address] @ robot.coupling for rows in (linear, angular))
        turn = data.ximat[body].reshape(3, 3)
        return cls(float(mj.body_mass[body]), J_c, J_w, turn @ np.diag(mj.body_inertia[body]) @ turn.T)

    @property
    def matrix(self) -> Array:
        """Shape (n, n)."""
        return np.asarray(self.m * self.J_c.T @ self.J_c + self.spun)

    @property
    def spun(self) -> Array:
        """What its own moments of inertia make of the matrix, shape (n, n)."""
        return np.asarray(self.J_w.T @ self.inertia @ self.J_w)

    def turned(self, off: _Off, gyration: float) -> tuple[Array, Array, Array]:
        """What is lost at most where its moments are off, the same again, what is gained."""
        lost = off.lighter * self.spun
        most = self.m * gyration**2 * self.J_w.T @ self.J_w
        return lost, lost, off.heavier * (most - self.spun)

    def shifted(self, off: _Off, way: float, qd: Array) -> tuple[Array, Array, Array]:
        """What is lost at most where its mass is off, the same in any case, what is gained."""
        moved, turned = self.J_c.T @ self.J_c, way**2 * self.J_w.T @ self.J_w
        v, w = (math.sqrt(max(float(qd @ A @ qd), 0.0)) for A in (moved, turned))
        if not (v > 0 and w > 0):
            v, w = (math.sqrt(float(np.trace(A))) for A in (moved, turned))
        # All that moves a body along may be lost; what turns it stays, unless nobody knows how it is spread.
        own = self.spun if off.anyhow else np.zeros_like(moved)
        all_of_it = off.lighter * (self.m * moved + own)
        if not (v > 0 and w > 0):
            return all_of_it, all_of_it, off.heavier * (self.m * turned - own)
        eps = w / v
        more = off.heavier * (self.m * (eps * moved + (1 + 1 / eps) * turned) - own)
        less = all_of_it
        if eps < 1:
            less = off.lighter * (self.m * (eps * moved + (1 / eps - 1) * turned) + own)
        return less, all_of_it, more


def _moved_by(model: Model, robot: Mechanism, body: int) -> bool:
    """Whether every joint between a body of `mujoco` and the world is one of the robot's."""
    mj, own = model.mj, set(robot.v_address.tolist())
    while body > 0:
        first, count = int(mj.body_dofadr[body]), int(mj.body_dofnum[body])
        if not own.issuperset(range(first, first + count)):
            return False
        body = int(mj.body_parentid[body])
    return True


def _offs(
    name: str,
    bodies: Sequence[int],
    *,
    mass: float | None = None,
    density: float | None = None,
    com: float | None = None,
    estimated: float = 0.0,
) -> Iterator[_Off]:
    """What of a robot, tool or workpiece is said to be off; by how much its estimated masses are, besides."""
    if not bodies:
        return
    # A mass that is off by a share, of a density that is off, is off by the product of both.
    of_density = (density or 0.0) * (1 + (mass or 0.0))
    for key, told, share in (
        ("mass_tolerance", mass, mass),
        ("density_tolerance", density, of_density),
    ):
        if told and share:
            yield _Off(Tolerance(f"{key} of {name}", 100 * told, "%"), tuple(bodies), share=share)
    if com:
        either = (mass or 0.0) + of_density
        tolerance = Tolerance(f"com_tolerance of {name}", com, "m")
        lighter, heavier = max(1 - either, 0.0), (1 + either) * (1 + estimated)
        ways = (com,) * len(bodies)
        yield _Off(tolerance, tuple(bodies), ways=ways, lighter=lighter, heavier=heavier)


def _of_links(robot: Mechanism, bodies: Mapping[str, int], either: float) -> Iterator[_Off]:
    """What nobody knows of links: by how much their masses are off, and where within their shapes they are.

    Args:
        robot: Whose.
        bodies: Of `mujoco`, by full name.
        either: Share by which the workstation file says that masses may be off, besides.
    """
    full = {f"{robot.name}/{link.name}": link.inertial for link in robot.description.links}
    known = [(bodies[name], of) for name, of in full.items() if of is not None and name in bodies]
    for share, spread in sorted({(of.error, of.spread_error) for _, of in known if _estimated(of)}):
        off = tuple(body for body, of in known if (of.error, of.spread_error) == (share, spread))
        yield _off_by(f"masses of links of {robot.name}", off, share, spread, either)
    if anyhow := [(body, of) for body, of in known if of.within]:
        name, error = f"where masses are in links of {robot.name}", max(of.error for _, of in anyhow)
        yield _anywhere(name, {body: of.within for body, of in anyhow}, either, error)
    for body, of in known:
        if of.gyration:
            name = f"radius of gyration of {next(name for name, each in full.items() if each is of)}"
            yield _turned(name, body, of.gyration, either, _estimated(of))


def _estimates(model: Model, robot: Mechanism) -> Iterator[_Off]:
    """Masses of a density and a volume of which only bounds are known, and those that may be anywhere."""
    things = (*model.workstation.tools, *model.workstation.workpieces)
    given = {thing.name: thing for thing in things}
    # What has several pieces has its mass in the body that they are all fixed to.
    of_name = {str(model.mj.body(int(i)).name): int(i) for i in robot.mj_bodies}
    found = [(model.bodies[i], of_name.get(model.bodies[i].owner, model.bodies[i].mj)) for i in robot.carried]
    for thing in things:
        in_hand = _held(model, thing).intersection(robot.mj_bodies)
        found += [(body, i) for body in model.bodies if body.owner == thing.name for i in in_hand]
    for body, mj in found:
        if body.mass is None:
            continue
        of = given.get(body.owner)
        either = 0.0 if of is None else heavier_by_tolerances(of) - 1
        off = _estimated(body.mass)
        if off > EXACT:
            yield _off_by(f"volume of {body.owner}", (mj,), body.mass.error, body.mass.spread_error, either)
        if body.mass.gyration:
            yield _turned(f"radius of gyration of {body.owner}", mj, body.mass.gyration, either, off)
        if body.mass.within:
            name = f"where the mass of {body.owner} is, of which nobody gave com and inertia,"
            yield _anywhere(name, {mj: body.mass.within}, either, off)


def _anywhere(name: str, within: Mapping[int, float], either: float, estimated: float) -> _Off:
    """Masses that may be anywhere in balls about where they are told to be.

    Args:
        name: What is told as off.
        within: Radii of these [m], by body of `mujoco`.
        either: Share by which the masses may be off, as somebody says.
        estimated: Share by which they are, as they are estimated.
    """
    return _Off(
        Tolerance(name, max(within.values()), "m"),
        tuple(within),
        ways=tuple(within.values()),
        anyhow=True,
        lighter=max(1 - estimated - either, 0.0),
        heavier=(1 + estimated) * (1 + either),
    )


def _turned(name: str, body: int, gyration: float, either: float, estimated: float) -> _Off:
    """Moments that nobody knows, of a body that may be heavier, besides.

    Args:
        name: What is told as off.
        body: Of `mujoco`.
        gyration: Its largest radius of gyration about its centre of mass [m].
        either: Share by which its mass may be off.
        estimated: Share by which it is, as it is estimated.
    """
    return _Off(
        Tolerance(name, gyration, "m"),
        (body,),
        ways=(gyration,),
        turned=True,
        lighter=max(1 - either, 0.0),
        heavier=(1 + either) * (1 + estimated),
    )


def heavier_by_tolerances(thing: Mounted) -> float:
    """Factor by which a thing may be heavier by the tolerances of its mass and of its density."""
    return (1 + (thing.mass_tolerance or 0.0)) * (1 + (thing.density_tolerance or 0.0))


def _held(model: Model, thing: Mounted) -> set[int]:
    """Bodies of `mujoco` that are a loose workpiece in grippers that may hold it."""
    if not (isinstance(thing, Workpiece) and thing.loose):
        return set()
    return {body.mj for body in model.bodies if body.name == f"{body.owner}/{thing.name}"}


def _estimated(of: Inertial | Quantity | None) -> float:
    """Share by which all that an estimated mass adds to a mass matrix may be off."""
    return 0.0 if of is None else max(of.error, of.spread_error)


def _off_by(name: str, bodies: tuple[int, ...], share: float, spread: float, either: float) -> _Off:
    """Estimated masses of which the workstation file says, besides, that they may be off by a share."""
    share, spread = share * (1 + either), spread * (1 + either)
    return _Off(Tolerance(name, 100 * (share or spread), "%"), bodies, share=share, spread=spread)


class Matrices:
    """Mass matrices of one state at the ends of what may be off."""

    def __init__(self, M: Array, parts: Sequence[_Bounds], without: Callable[[], Array]) -> None:
        self.M, self.parts, self._without = M, parts, without

    def at(self, shifts: Shifts) -> Array:
        """M at shifted inputs, shape (n, n): no less than it can be with 1, no more with −1."""
        # Of bodies of which all may be lost as good as nothing is left: that has an inverse, too.
        share = NOTHING if any(part.whole for part in self.parts) else 0.0
        found = self._at(shifts, 0)
        if np.linalg.eigvalsh(found)[0] <= share * np.trace(self.M):
            found = self._at(shifts, 1) + share * self.M
            if np.linalg.eigvalsh(found)[0] < 0:
                # Of one body, which several inputs leave open, they would take more than there is.
                found = self._without() + NOTHING * self.M
        return found

    def _at(self, shifts: Shifts, bound: int) -> Array:
        found = self.M
        for shift, part in zip(shifts, self.parts, strict=True):
            found = found + (shift * part.gained if shift > 0 else shift * part[bound])
        return np.asarray(found)

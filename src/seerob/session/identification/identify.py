r"""What a recorded excitation tells of an arm: base inertial parameters, friction, payload, and how surely.

.. math:: \tau = Y(q, \dot q, \ddot q)\,\pi + F_c\,\mathrm{sgn}(\dot q) + F_v\,\dot q + o + \varepsilon .

β, the base parameters of π (`seerob.session.identification.regressor`), and friction are fitted as
`seerob.session.explanation` fits, with the same intervals.

Of motor currents i, :math:`\tau_j = k_j i_j`. A log alone leaves all torque constants :math:`k_j` open by one
common factor. Either somebody states them, with a tolerance: then :math:`\beta` is linear in each, and what
the largest errors make of it is added to every interval. Or a second log carries a known mass
(`seerob.session.identification.currents`): what the tolerance of that mass makes of the fit is added.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.description.description import Description
from seerob.session.explanation import (
    HALF_WINDOW,
    LEAST,
    MOST,
    NORMAL_95,
    SLOW,
    Figure,
    Fitted,
    fit,
    friction,
    slopes,
    spread,
)
from seerob.session.identification.currents import fit_currents
from seerob.session.identification.regressor import Base, Regressor, base_parameters
from seerob.twin.controller_check import ControllerLog

UNITS = ("kg", *("kg·m",) * 3, *("kg·m²",) * 6)
"""Of ten parameters of one body, in the order of `seerob.session.identification.regressor.PARAMETERS`."""


@dataclass(frozen=True, eq=False)
class Identified:
    """What a log tells of an arm."""

    robot: str
    source: str
    samples: int
    names: tuple[str, ...]
    """Of base parameters: the one that stands for each."""
    units: tuple[str, ...]
    values: tuple[Figure, ...]
    coulomb: tuple[Figure, ...]
    viscous: tuple[Figure, ...]
    offset: tuple[Figure, ...]
    left: Array
    """Root mean square of the torques that the fit leaves, per joint [N·m or N]."""
    condition: float
    regressor: Regressor
    base: Base
    fitted: Fitted
    payload: tuple[Figure, ...] = ()
    """Mass [kg], first moments [kg·m] and moments of inertia [kg·m²] in the frame of the last body."""
    constants: tuple[Figure, ...] = ()
    """Of currents: torque constants of the joints [N·m/A or N/A]."""
    systematic: Array | None = None
    """What errors of constants or of a known mass do to the fit at the most, each in a row, shape (e, p)."""

    @property
    def hidden(self) -> tuple[str, ...]:
        """Base parameters that this motion does not tell."""
        return tuple(n for n, value in zip(self.names, self.values, strict=True) if not value.determined)

    @property
    def never(self) -> tuple[str, ...]:
        """Parameters that no motion tells by themselves: they are in others, or in none."""
        shared = (np.abs(self.base.regrouped) > 0).sum(axis=0)
        alone = {c for k, c in enumerate(self.base.columns) if (self.base.regrouped[k] != 0).sum() == 1}
        columns = self.regressor.columns
        return tuple(name for c, name in enumerate(columns) if c not in alone and shared[c] >= 0)


class Known(NamedTuple):
    """What turns currents into torques: constants of the joints, or a mass that the second log carries."""

    constants: tuple[float, ...] = ()
    """Torque per current at each joint, gears included [N·m/A or N/A]."""
    payload: float | None = None
    """[kg]"""
    tolerance: float = 0.0
    """By which share each constant, or the mass, may be off."""


NOTHING_KNOWN = Known()


def identify(
    description: Description,
    gravity: Array,
    said: ControllerLog,
    carrying: ControllerLog | None = None,
    known: Known = NOTHING_KNOWN,
) -> Identified:
    """Fit base parameters and friction to a log, and a payload to a second one.

    Args:
        description: The arm.
        gravity: In the frame of its base [m/s²], shape (3,).
        said: Of the bare arm; torques are needed, or currents and what is ``known``.
        carrying: Of the same arm with a payload on it, after the first.
        known: Of currents.

    Raises:
        InputError: No torques, too little motion, or currents of which nobody knows the common factor.
    """
    regressor = Regressor(description, gravity)
    base = base_parameters(regressor)
    n = len(regressor.names)
    if said.tau is not None and known != NOTHING_KNOWN:
        what = "torques are measured already"
        raise InputError.at(said.file, "currents", what, "leave out --constants and --payload")
    if said.tau is None and said.current is not None:
        if not known.constants:
            return _of_currents(regressor, base, said, carrying, known)
        if len(known.constants) != n:
            what = f"{len(known.constants)} torque constants for {n} joints"
            raise InputError.at(said.file, "currents", what, "give one per joint, from the base on")
        said = said._replace(tau=said.current * np.array(known.constants))
        if carrying is not None and carrying.tau is None and carrying.current is not None:
            carrying = carrying._replace(tau=carrying.current * np.array(known.constants))
    Y, friction_columns, tau, used = _rows(regressor, said)
    columns = np.concatenate([Y[..., list(base.columns)], friction_columns], axis=-1)
    if carrying is not None:
        more, more_friction, more_tau, more_used = _rows(regressor, carrying)
        last = 10 * (len(regressor.bodies) - 1)
        upper = np.concatenate([columns, np.zeros((*tau.shape, 10))], axis=-1)
        lower = np.concatenate(
            [more[..., list(base.columns)], more_friction, more[..., last : last + 10]], axis=-1
        )
        columns = np.concatenate([upper, lower])
        tau, used = np.concatenate([tau, more_tau]), np.concatenate([used, more_used])
    found = fit(columns, tau, used)
    systematic = None
    if known.constants:
        # What one joint's torques alone add to the fit: it grows with that joint's constant.
        systematic = np.array([_of_joint(columns, tau, used, found, j) for j in range(n)]) * known.tolerance
    figures = _figures(found, systematic)
    constants = [Figure(value, known.tolerance * value) for value in known.constants]
    return _identified(regressor, base, said, found, figures, tau, tuple(constants), systematic)


def _figures(found: Fitted, systematic: Array | None) -> list[Figure]:
    """Values with halves of their intervals: 95 % of the noise, and the most that errors make of them."""
    more = np.zeros(len(found.values)) if systematic is None else np.abs(systematic).sum(axis=0)
    return [
        Figure(float(x), float(NORMAL_95 * np.sqrt(max(v, 0.0)) + m) if told else float("inf"))
        for x, v, told, m in zip(found.values, np.diag(found.covariance), found.determined, more, strict=True)
    ]


def _of_joint(columns: Array, measured: Array, used: NDArray[np.bool_], found: Fitted, j: int) -> Array:
    """Of a weighted fit, the part that what is measured of one joint makes, shape (p,)."""
    sigma = np.sqrt(np.nanmean(found.residuals**2, axis=0))
    A, b = columns / sigma[:, None], measured / sigma
    rows = A[used]
    alone = np.zeros_like(used)
    alone[:, j] = used[:, j]
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    return np.asarray(np.linalg.lstsq(rows / scale, np.where(alone, b, 0.0)[used], rcond=1e-10)[0] / scale)


def _of_currents(
    regressor: Regressor, base: Base, said: ControllerLog, carrying: ControllerLog | None, known: Known
) -> Identified:
    """Fit currents of two logs, of which the second carries a known mass.

    Raises:
        InputError: There is no such log, or it does not tell the common factor.
    """
    if known.payload is None or carrying is None or carrying.current is None:
        what = "are currents [A]: alone they leave every mass open by one common factor"
        remedy = (
            "give torque constants (--constants), or a second log of currents with a payload of known mass "
            "(--carrying, --payload); each with --tolerance and --known-by"
        )
        raise InputError.at(said.file, "actual_current", what, remedy)
    n, k = len(regressor.names), len(base.columns)
    Y, F, current, used = _rows(regressor, said._replace(tau=said.current))
    more, more_F, more_current, more_used = _rows(regressor, carrying._replace(tau=carrying.current))
    first = len(current)
    current, used = np.concatenate([current, more_current]), np.concatenate([used, more_used])
    last = 10 * (len(regressor.bodies) - 1)
    load = np.concatenate([np.zeros((first, n, 10)), more[..., last : last + 10]])
    of_base = np.concatenate([Y, more])[..., list(base.columns)]
    # Torques: those of the known mass, and linear in the rest. Currents: g times that.
    torques = np.concatenate([of_base, np.concatenate([F, more_F]), load[..., 1:]], axis=-1)
    weight = load[..., 0] * known.payload
    told = fit_currents(torques, weight, current, used)
    if told is None:
        what = f"{known.payload:g} kg more does not show in them: the common factor stays open"
        raise InputError.at(carrying.file, "actual_current", what, "carry more, and move as in the first log")
    found, x, g = told
    p = len(x)
    # All that weighs grows with the known mass, and the currents per torque shrink.
    grow = np.concatenate([x, -g])[None] * known.tolerance
    figures = _figures(found, grow)
    constants = tuple(Figure(1 / each.value, each.half / each.value**2) for each in figures[p:])
    load_mass = Figure(known.payload, known.payload * known.tolerance)
    figures = [*figures[: k + 3 * n], load_mass, *figures[k + 3 * n : p]]
    found = replace(found, residuals=found.residuals / g)
    return _identified(regressor, base, said, found, figures, current, constants, grow)


def _identified(
    regressor: Regressor,
    base: Base,
    said: ControllerLog,
    found: Fitted,
    figures: list[Figure],
    tau: Array,
    constants: tuple[Figure, ...],
    systematic: Array | None,
) -> Identified:
    n, k = len(regressor.names), len(base.columns)
    units = [*UNITS * len(regressor.bodies), *("kg·m²" if r else "kg" for r in regressor.revolute)]
    return Identified(
        robot=regressor.description.name,
        source=said.file,
        samples=len(tau),
        names=tuple(regressor.columns[c] for c in base.columns),
        units=tuple(units[c] for c in base.columns),
        values=tuple(figures[:k]),
        coulomb=tuple(figures[k : k + n]),
        viscous=tuple(figures[k + n : k + 2 * n]),
        offset=tuple(figures[k + 2 * n : k + 3 * n]),
        left=np.sqrt(np.nanmean(found.residuals**2, axis=0)),
        condition=found.condition,
        regressor=regressor,
        base=base,
        fitted=found,
        payload=tuple(figures[k + 3 * n :]),
        constants=constants,
        systematic=systematic,
    )


def _rows(regressor: Regressor, said: ControllerLog) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Columns of bodies and of friction, torques, and which rows count."""
    n = len(regressor.names)
    if said.tau is None:
        remedy = (
            "log measured torques: actual_current_as_torque of RTDE, measured torques of FRI; or its currents"
        )
        raise InputError.at(said.file, "torques", "the source measures none", remedy)
    if said.q.shape[1] != n:
        what = f"{said.q.shape[1]} joints, and the robot has {n}"
        raise InputError.at(said.file, "joints", what, "name the log of this robot")
    if len(said.t) < LEAST:
        raise InputError.at(said.file, "torques", f"{len(said.t)} valid samples", f"log {LEAST} or more")
    qd = said.qd if said.qd is not None else slopes(said.t, said.q, HALF_WINDOW)
    qdd = slopes(said.t, qd, HALF_WINDOW)
    rows = spread(len(said.t), MOST)
    q, qd, qdd = (np.asarray(x[rows], float) for x in (said.q, qd, qdd))
    slow = np.where(regressor.revolute, SLOW["rad"], SLOW["m"])
    used = np.abs(qd) > slow
    still = [name for j, name in enumerate(regressor.names) if used[:, j].sum() < LEAST]
    if still:
        what = f"{', '.join(still)} never move" if len(still) > 1 else f"{still[0]} never moves"
        raise InputError.at(said.file, "motion", what, "log a motion in which every joint moves")
    return regressor(q, qd, qdd), friction(qd), np.asarray(said.tau[rows]), used

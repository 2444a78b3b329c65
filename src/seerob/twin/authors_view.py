"""What criteria of one's own are given instead of `State` and `States`: accessors, for one question.

Whatever is not listed here is the engine's or the judge's, and raises `NotAsked`. So does everything once the
question is answered: what is kept, in a closure or for a thread, says nothing of another instant.
"""

from __future__ import annotations

from copy import copy, deepcopy
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import NotAsked
from seerob.model.model import Model
from seerob.twin.attachments import moving_dofs

Indices = NDArray[np.int64]

OF_AN_INSTANT = frozenset(
    {
        "along", "asked", "attachments", "body_velocities", "invalid_bones", "invalid_orientations",
        "captured", "closest", "closest_per_body", "columns", "contact_forces", "data_of", "distances",
        "drawn_point", "fastest_point", "fastest_points", "fastest_speed", "fastest_speeds", "foresee",
        "invalid_source_reason", "hearing", "in_body", "input_reason",
        "inverse_effective_mass", "many", "singular_values", "invalid_bodies", "invalid_place_reason",
        "invalid_reason", "jacobian", "joint_noise", "joint_positions", "knots", "largest_speeds",
        "mass_ellipsoid", "mass_matrix", "measured_torques", "model", "moved", "once", "placed", "pose",
        "poses", "q", "qd", "require", "require_bodies", "signal", "signals_meanwhile", "speed_error",
        "speed_errors", "speed_noise", "stray", "strayed", "strays", "t", "torques_within", "velocity",
        "velocity_ellipsoid", "weigh",
    }
)  # fmt: skip
"""Names of `seerob.twin.state.State` that a criterion of one's own may ask; some say what to ask instead."""
SHARED = frozenset({"asked", "attachments", "columns"})
"""Those of the names that give what everybody uses: copies of it."""
OF_MANY = frozenset(
    {
        "along", "asked", "captured", "closest", "closest_per_body", "fastest_points", "held",
        "inverse_effective_mass", "jacobian", "many", "mass_matrix", "model", "placed", "pose", "qd",
        "require", "singular_values", "speed_error", "t", "velocity",
    }
)  # fmt: skip
"""Names of `seerob.twin.states.States`, likewise."""


class AuthorsView:
    """One of both, as whoever wrote a criterion of their own may use it.

    Args:
        of: A `State` or `States`.
        given: Names that may be asked.
    """

    __slots__ = ("_answered", "_given", "_of")

    def __init__(self, of: Any, given: frozenset[str]) -> None:
        self._of, self._given, self._answered = of, given, False

    def __getattr__(self, name: str) -> Any:
        kind = self._kind(name)
        if name not in self._given:
            if not hasattr(self._of, name):
                raise AttributeError(f"{kind} has no {name}")
            getattr(self._of, name)  # what is closed says what to ask instead
            raise NotAsked(f"{kind}.{name} is for the engine and the judge, so no criterion may use it")
        found = getattr(self._of, name)
        return deepcopy(found) if name in SHARED else found

    def __len__(self) -> int:
        self._kind("__len__")
        return len(self._of)

    def _kind(self, name: str) -> str:
        kind = type(self._of).__name__
        if self._answered:
            raise NotAsked(f"{kind}.{name}: a question was answered with it; ask the one of this instant")
        return kind

    def answered(self) -> None:
        """Close it: the question is answered."""
        self._answered = True


OF_DOFS = ("qvel", "qacc", "qacc_warmstart", "qfrc_applied", "qfrc_bias", "qfrc_passive", "qfrc_actuator",
           "qfrc_constraint", "qfrc_smooth", "qfrc_inverse", "cdof", "cdof_dot")  # fmt: skip
OF_BODIES = ("xpos", "xquat", "xmat", "xipos", "ximat", "cvel", "cacc", "cfrc_int", "cfrc_ext", "cinert")
OF_SUBTREES = ("subtree_com", "subtree_linvel", "subtree_angmom", "crb")
"""Arrays of `mujoco.MjData` by degree of freedom, by body, and by body with all that it carries."""


class Others(NamedTuple):
    """What of MuJoCo's data others have an influence on."""

    q: Indices
    """Positions of joints."""
    v: Indices
    """Degrees of freedom."""
    bodies: Indices


def moved_by_others(model: Model, names: tuple[str, ...]) -> Others:
    """What moves with others than some robots, people and machines, and whoever carries them."""
    known = {each for name in names for each in (name, *model.carriers_of(name))}
    others = [m for m in model.mechanisms.values() if m.name not in known]
    q = np.concatenate([np.zeros(0, np.int64), *(m.q_address for m in others)])
    v = np.concatenate([np.zeros(0, np.int64), *(m.v_address for m in others)])
    moved = [i for i in range(model.mj.nbody) if moving_dofs(model.mj, i)[v].any()]
    return Others(q, v, np.array(moved, np.int64))


def without(mj: mujoco.MjModel, data: mujoco.MjData, others: Others) -> mujoco.MjData:
    """A copy of MuJoCo's data in which what others have an influence on is not a number."""
    data, (q, v, bodies) = copy(data), others
    if not len(v):
        return data
    data.qpos[q] = np.nan
    for name in OF_DOFS:
        getattr(data, name)[v] = np.nan
    for name in OF_BODIES:
        getattr(data, name)[bodies] = np.nan
    # What a body carries is in it: of the world, everybody.
    above = {0, *bodies.tolist()}
    for body in bodies.tolist():
        while body:
            above.add(body := int(mj.body_parentid[body]))
    for name in OF_SUBTREES:
        getattr(data, name)[sorted(above)] = np.nan
    for kind in ("geom", "site", "cam"):
        rows = np.isin(getattr(mj, f"{kind}_bodyid"), bodies)
        for name in (f"{kind}_xpos", f"{kind}_xmat"):
            getattr(data, name)[rows] = np.nan
    joints = np.isin(mj.jnt_dofadr, v)
    data.xanchor[joints], data.xaxis[joints] = np.nan, np.nan
    return data

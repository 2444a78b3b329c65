"""What MuJoCo makes of a MJCF file, in the parsers' process: a file that ends its parser ends no run.

Its parser is C++: a model that attaches itself overflows the stack, and one line asks for 10⁹ bodies. What
comes back is plain: the arrays of the compiled model by their names there, and names.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seerob.core.errors import InputError
from seerob.core.files.parser_process import parsed
from seerob.core.printable import printable
from seerob.description.xml_values import MAX_ELEMENTS

MEMORY = 2 << 30
"""[byte]"""
SECONDS = 60.0
REMEDY = "simplify it, or name another description"

_COUNTS = ("nbody", "nu", "neq", "nsite", "ntendon", "nflex", "npair", "nexclude", "nplugin")
_BODIES = ("pos", "quat", "ipos", "iquat", "mass", "inertia", "parentid")
_BODY_PARTS = ("geomadr", "geomnum", "jntadr", "jntnum")
_GEOMS = ("type", "size", "pos", "quat", "rgba", "matid", "dataid", "contype", "conaffinity")
_JOINTS = ("type", "pos", "axis", "range", "limited", "qposadr", "dofadr", "stiffness")
_JOINT_FORCES = ("actfrclimited", "actfrcrange")
_MESHES = ("vert", "vertadr", "vertnum", "face", "faceadr", "facenum")
_ACTUATORS = ("trntype", "trnid", "gear", "gaintype", "gainprm", "biastype")
_ACTUATOR_LIMITS = ("forcelimited", "forcerange", "ctrllimited", "ctrlrange")
_ARRAYS = (
    "qpos0",
    "mat_rgba",
    *(f"body_{what}" for what in (*_BODIES, *_BODY_PARTS)),
    *(f"geom_{what}" for what in _GEOMS),
    *(f"jnt_{what}" for what in (*_JOINTS, *_JOINT_FORCES)),
    *(f"dof_{what}" for what in ("armature", "damping", "frictionloss")),
    *(f"mesh_{what}" for what in _MESHES),
    *(f"site_{what}" for what in ("pos", "quat", "bodyid")),
    *(f"actuator_{what}" for what in (*_ACTUATORS, *_ACTUATOR_LIMITS)),
    *(f"eq_{what}" for what in ("type", "obj1id", "obj2id", "active0", "data")),
)
_NAMED = {"body": "nbody", "geom": "ngeom", "joint": "njnt", "site": "nsite", "mesh": "nmesh"}


class WrittenGeom(NamedTuple):
    """What a file says of the weight of a geom."""

    mass: float
    """NaN when not given [kg]."""
    density: float
    """[kg/m³]"""
    group: int


class Compiled:
    """A compiled model as plain arrays.

    Each array and count of ``mujoco.MjModel`` that is asked for here is an attribute of its name there.

    Args:
        counts: By name.
        arrays: Type, shape and bytes by name.
        names: Of bodies, geoms, joints, sites and meshes, empty where there is none.
        bodies: Whether a body has an ``<inertial>`` of its own, and its geoms, as written.
        compiler: Options of it as they hold.
        rotors: Inertia that a degree of freedom has besides the bodies it moves [kg·m² or kg], shape (nv,).
        coupled: Whether there is more of it, which several of them share.
        changed: Options that change masses, and bodies that have others for them than the file gives.
        warned: What MuJoCo warned of.
    """

    def __init__(
        self,
        counts: dict[str, int],
        arrays: dict[str, tuple[str, tuple[int, ...], bytes]],
        names: dict[str, list[str]],
        bodies: list[tuple[bool, list[tuple[float, float, int]]]],
        compiler: dict[str, Any],
        rotors: list[float],
        coupled: bool,
        changed: tuple[str, list[int]],
        warned: list[str],
    ) -> None:
        self.names, self.compiler, self.warned = names, compiler, warned
        self.rotors, self.coupled, self.changed = rotors, coupled, changed
        self.written = [(own, [WrittenGeom(*geom) for geom in geoms]) for own, geoms in bodies]
        self._of: dict[str, Any] = dict(counts)
        for name, (kind, shape, data) in arrays.items():
            self._of[name] = np.frombuffer(data, kind).reshape(shape)

    def __getattr__(self, name: str) -> Any:
        try:
            return vars(self)["_of"][name]
        except KeyError:
            raise AttributeError(name) from None


def compiled(path: Path, file: str) -> Compiled:
    """A file as MuJoCo compiles it, with the names of fixed bodies and shapes for the screen.

    Args:
        path: The file.
        file: What messages call it.

    Raises:
        InputError: MuJoCo refuses it, it is too large, or ends the process that reads it.
    """
    given = parsed(_compile, path, file, file=file, remedy=REMEDY, memory=MEMORY, seconds=SECONDS)
    return Compiled(*given)


def _remedy(said: str) -> str:
    """What would be right, where MuJoCo only says what is wrong."""
    if "mass" in said:
        return "give every moving body a mass greater than 0, and inertia: <inertial>, or mass of its geoms"
    if "inertia" in said:
        return "give principal moments greater than 0, none of them larger than the sum of the others"
    return "correct that element"


# -- in the other process -----------------------------------------------------------------------


def _compile(path: Path, file: str) -> tuple[Any, ...]:
    import mujoco

    # Its own way is the terminal, and a file in the folder where the user happens to be.
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        # Names of fixed bodies and shapes for the screen are kept, whatever the file says.
        spec.compiler.fusestatic = False
        spec.compiler.discardvisual = False
        with warnings.catch_warnings(record=True) as said_of_it:
            warnings.simplefilter("always")
            model = spec.compile()
    except ValueError as error:
        said = printable(" ".join(str(error).split()))
        named = re.search(r"Element name '([^']+)'", said)
        key = f"element {named[1]!r}" if named else ""
        raise InputError.at(file, key, f"MuJoCo cannot read it: {said}", _remedy(said)) from None
    except RuntimeError as error:
        if "unknown exception" in str(error):  # what it says of memory that is not there
            raise MemoryError from None
        raise
    made = sum(getattr(model, count) for count in _NAMED.values())
    if made > MAX_ELEMENTS:
        what = f"has {made} bodies, joints, geoms, sites and meshes when it is compiled"
        raise InputError.at(file, "", what, f"at most {MAX_ELEMENTS} are read")
    arrays = {name: np.ascontiguousarray(getattr(model, name)) for name in _ARRAYS}
    compiler = spec.compiler
    return (
        {name: int(getattr(model, name)) for name in _COUNTS},
        {name: (array.dtype.str, array.shape, array.tobytes()) for name, array in arrays.items()},
        {
            what: [getattr(model, what)(i).name for i in range(getattr(model, count))]
            for what, count in _NAMED.items()
        },
        [
            (
                bool(body.explicitinertial),
                [(float(g.mass), float(g.density), int(g.group)) for g in body.geoms],
            )
            for body in spec.bodies
        ],
        {
            "inertiagrouprange": tuple(int(group) for group in compiler.inertiagrouprange),
            "inertiafromgeom": int(compiler.inertiafromgeom),
        },
        *_rotors(model),
        _changed(path, model, compiler),
        [str(warning.message) for warning in said_of_it],
    )


def _rotors(model: Any) -> tuple[list[float], bool]:
    """What MuJoCo's mass matrix has besides bodies: joints, actuators and tendons have a part in it.

    With R the difference, R 1 is its diagonal where it has nothing else, whatever the posture.
    """
    import mujoco

    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    weights, found = np.ones(model.nv), []
    for _ in range(4):
        for step in (
            mujoco.mj_kinematics,
            mujoco.mj_comPos,
            mujoco.mj_tendon,
            mujoco.mj_transmission,
            mujoco.mj_makeM,
            mujoco.mj_comVel,
        ):
            step(model, data)
        every, moved, held = np.zeros((3, model.nv))
        mujoco.mj_mulM(model, data, every, weights)
        data.qacc[:] = weights
        mujoco.mj_rne(model, data, 1, moved)
        mujoco.mj_rne(model, data, 0, held)
        found.append((every - moved + held) / weights)
        weights = rng.uniform(0.5, 1.5, model.nv)
        mujoco.mj_integratePos(model, data.qpos, rng.uniform(-1, 1, model.nv), 1.0)
    least = 1e-9 * max(float(np.abs(every).max(initial=0.0)), 1e-3)
    coupled = bool((np.abs(np.subtract(found, found[0])) > least).any())
    exact = coupled | (np.abs(found[0] - model.dof_armature) <= least)
    rotors = np.where(exact, model.dof_armature, found[0])
    return rotors.tolist(), coupled


MASSES = {"boundmass": 0.0, "boundinertia": 0.0, "balanceinertia": False, "settotalmass": -1.0}
"""Options by which MuJoCo changes masses that a file gives, and their values that change nothing."""


def _changed(path: Path, model: Any, compiler: Any) -> tuple[str, list[int]]:
    """Options that change masses, and bodies whose masses they change."""
    import mujoco

    options = [name for name, nothing in MASSES.items() if getattr(compiler, name) != nothing]
    options = [name for name in options if name != "settotalmass" or compiler.settotalmass > 0]
    if not options:
        return "", []
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.fusestatic = False
    for name, nothing in MASSES.items():
        setattr(spec.compiler, name, nothing)
    try:
        plain = spec.compile()
    except ValueError:  # it cannot be without them, and which bodies that is about is not told
        return ", ".join(options), list(range(model.nbody))
    pairs = ((model.body_mass[:, None], plain.body_mass[:, None]), (model.body_inertia, plain.body_inertia))
    other = np.any([~np.isclose(a, b, rtol=1e-9, atol=0).all(axis=1) for a, b in pairs], axis=0)
    return ", ".join(options), np.flatnonzero(other).tolist()

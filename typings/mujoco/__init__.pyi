# What seerob uses of MuJoCo 4.0.1, whose wheel has no types; tests/test_mujoco_types.py holds it against it.

from collections.abc import Callable
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

class MjOption:
    cone: int
    disableflags: int
    gravity: NDArray[np.float64]
    integrator: int
    timestep: float

class MjStatistic:
    center: NDArray[np.float64]
    extent: float

class MjModel:
    _address: int
    actuator_biasprm: NDArray[np.float64]
    actuator_biastype: NDArray[np.int32]
    actuator_ctrllimited: NDArray[np.bool_]
    actuator_ctrlrange: NDArray[np.float64]
    actuator_forcelimited: NDArray[np.bool_]
    actuator_forcerange: NDArray[np.float64]
    actuator_gainprm: NDArray[np.float64]
    actuator_gaintype: NDArray[np.int32]
    actuator_gear: NDArray[np.float64]
    actuator_trnid: NDArray[np.int32]
    actuator_trntype: NDArray[np.int32]
    body_dofadr: NDArray[np.int32]
    body_dofnum: NDArray[np.int32]
    body_geomadr: NDArray[np.int32]
    body_geomnum: NDArray[np.int32]
    body_inertia: NDArray[np.float64]
    body_ipos: NDArray[np.float64]
    body_iquat: NDArray[np.float64]
    body_jntadr: NDArray[np.int32]
    body_jntnum: NDArray[np.int32]
    body_mass: NDArray[np.float64]
    body_mocapid: NDArray[np.int32]
    body_parentid: NDArray[np.int32]
    body_pos: NDArray[np.float64]
    body_quat: NDArray[np.float64]
    body_rootid: NDArray[np.int32]
    body_subtreemass: NDArray[np.float64]
    body_weldid: NDArray[np.int32]
    dof_armature: NDArray[np.float64]
    M_colind: NDArray[np.int32]
    M_rowadr: NDArray[np.int32]
    M_rownnz: NDArray[np.int32]
    dof_bodyid: NDArray[np.int32]
    dof_damping: NDArray[np.float64]
    dof_frictionloss: NDArray[np.float64]
    dof_jntid: NDArray[np.int32]
    dof_parentid: NDArray[np.int32]
    eq_active0: NDArray[np.bool_]
    eq_data: NDArray[np.float64]
    eq_obj1id: NDArray[np.int32]
    eq_obj2id: NDArray[np.int32]
    eq_type: NDArray[np.int32]
    geom_bodyid: NDArray[np.int32]
    geom_conaffinity: NDArray[np.int32]
    geom_contype: NDArray[np.int32]
    geom_dataid: NDArray[np.int32]
    geom_matid: NDArray[np.int32]
    geom_pos: NDArray[np.float64]
    geom_quat: NDArray[np.float64]
    geom_rgba: NDArray[np.float32]
    geom_size: NDArray[np.float64]
    geom_type: NDArray[np.int32]
    jnt_actfrclimited: NDArray[np.bool_]
    jnt_actfrcrange: NDArray[np.float64]
    jnt_axis: NDArray[np.float64]
    jnt_bodyid: NDArray[np.int32]
    jnt_dofadr: NDArray[np.int32]
    jnt_limited: NDArray[np.bool_]
    jnt_pos: NDArray[np.float64]
    jnt_qposadr: NDArray[np.int32]
    jnt_range: NDArray[np.float64]
    jnt_stiffness: NDArray[np.float64]
    jnt_type: NDArray[np.int32]
    mat_rgba: NDArray[np.float32]
    mesh_face: NDArray[np.int32]
    mesh_faceadr: NDArray[np.int32]
    mesh_facenum: NDArray[np.int32]
    mesh_vert: NDArray[np.float32]
    mesh_vertadr: NDArray[np.int32]
    mesh_vertnum: NDArray[np.int32]
    na: int
    names: bytes
    nbody: int
    neq: int
    ngeom: int
    nsensor: int
    nexclude: int
    nflex: int
    npair: int
    nplugin: int
    nq: int
    nsite: int
    ntendon: int
    nu: int
    nv: int
    opt: MjOption
    qpos0: NDArray[np.float64]
    site_bodyid: NDArray[np.int32]
    site_pos: NDArray[np.float64]
    site_quat: NDArray[np.float64]
    stat: MjStatistic
    tendon_armature: NDArray[np.float64]
    @staticmethod
    def from_xml_path(filename: str) -> MjModel: ...
    @staticmethod
    def from_xml_string(xml: str) -> MjModel: ...
    def __copy__(self) -> Self: ...
    def body(self, name_or_id: str | int) -> _Named: ...
    def __deepcopy__(self, memo: dict[int, object]) -> Self: ...

class MjData:
    def __init__(self, model: MjModel) -> None: ...
    _address: int
    M: NDArray[np.float64]
    act: NDArray[np.float64]
    actuator_force: NDArray[np.float64]
    cdof: NDArray[np.float64]
    contact: Any
    ctrl: NDArray[np.float64]
    cvel: NDArray[np.float64]
    energy: NDArray[np.float64]
    efc_force: NDArray[np.float64]
    ncon: int
    nplugin: int
    qacc: NDArray[np.float64]
    qacc_warmstart: NDArray[np.float64]
    qfrc_actuator: NDArray[np.float64]
    qfrc_applied: NDArray[np.float64]
    qfrc_bias: NDArray[np.float64]
    qfrc_passive: NDArray[np.float64]
    qfrc_smooth: NDArray[np.float64]
    qpos: NDArray[np.float64]
    qvel: NDArray[np.float64]
    subtree_com: NDArray[np.float64]
    time: float
    warning: Any
    xanchor: NDArray[np.float64]
    xaxis: NDArray[np.float64]
    ximat: NDArray[np.float64]
    xfrc_applied: NDArray[np.float64]
    xipos: NDArray[np.float64]
    xmat: NDArray[np.float64]
    xpos: NDArray[np.float64]
    xquat: NDArray[np.float64]

class _Named:
    id: int
    name: str

class MjsJoint:
    name: str

class MjsGeom:
    name: str

class MjsBody:
    name: str
    explicitinertial: bool
    mass: float
    ipos: ArrayLike
    iquat: ArrayLike
    inertia: ArrayLike
    fullinertia: ArrayLike
    def add_body(self, **fields: object) -> MjsBody: ...
    def add_geom(self, **fields: object) -> MjsGeom: ...
    def add_joint(self, **fields: object) -> MjsJoint: ...

class MjSpec:
    joints: list[MjsJoint]
    worldbody: MjsBody
    @staticmethod
    def from_file(filename: str) -> MjSpec: ...
    def compile(self) -> MjModel: ...
    def __getattr__(self, name: str) -> Any: ...
    def __setattr__(self, name: str, value: object) -> None: ...

class FatalError(Exception): ...
class UnexpectedError(Exception): ...

def mj_comPos(m: MjModel, d: MjData) -> None: ...
def mj_comVel(m: MjModel, d: MjData) -> None: ...
def mj_contactForce(m: MjModel, d: MjData, id: int, result: NDArray[np.float64]) -> None: ...
def mj_forward(m: MjModel, d: MjData) -> None: ...
def mj_fullM(m: MjModel, d: MjData, dst: NDArray[np.float64]) -> None: ...
def mj_fwdPosition(m: MjModel, d: MjData) -> None: ...
def mj_fwdVelocity(m: MjModel, d: MjData) -> None: ...
def mj_id2name(m: MjModel, type: int, id: int) -> str | None: ...
def mj_jac(
    m: MjModel,
    d: MjData,
    jacp: NDArray[np.float64] | None,
    jacr: NDArray[np.float64] | None,
    point: NDArray[np.float64],
    body: int,
) -> None: ...
def mj_jacBodyCom(
    m: MjModel, d: MjData, jacp: NDArray[np.float64] | None, jacr: NDArray[np.float64] | None, body: int
) -> None: ...
def mj_kinematics(m: MjModel, d: MjData) -> None: ...
def mj_integratePos(m: MjModel, qpos: NDArray[np.float64], qvel: NDArray[np.float64], dt: float) -> None: ...
def mj_makeM(m: MjModel, d: MjData) -> None: ...
def mj_mulM(m: MjModel, d: MjData, res: NDArray[np.float64], vec: NDArray[np.float64]) -> None: ...
def mj_name2id(m: MjModel, type: int, name: str) -> int: ...
def mj_objectVelocity(
    m: MjModel, d: MjData, objtype: int, objid: int, res: NDArray[np.float64], flg_local: int
) -> None: ...
def mj_passive(m: MjModel, d: MjData) -> None: ...
def mj_rne(m: MjModel, d: MjData, flg_acc: int, result: NDArray[np.float64]) -> None: ...
def mj_setConst(m: MjModel, d: MjData) -> None: ...
def mj_resetData(m: MjModel, d: MjData) -> None: ...
def mj_step(m: MjModel, d: MjData, nstep: int = 1) -> None: ...
def mju_quat2Vel(res: NDArray[np.float64], quat: NDArray[np.float64], dt: float) -> None: ...
def mju_quat2Mat(res: NDArray[np.float64], quat: NDArray[np.float64]) -> None: ...
def mj_tendon(m: MjModel, d: MjData) -> None: ...
def mj_transmission(m: MjModel, d: MjData) -> None: ...
def set_mju_user_warning(arg0: Callable[[str], object] | None) -> None: ...

class mjtBias(IntEnum):
    mjBIAS_NONE = 0
    mjBIAS_AFFINE = 1
    mjBIAS_MUSCLE = 2
    mjBIAS_DCMOTOR = 3
    mjBIAS_SO3 = 4
    mjBIAS_USER = 5

class mjtDisableBit(IntEnum):
    mjDSBL_CONSTRAINT = 1
    mjDSBL_EQUALITY = 2
    mjDSBL_FRICTIONLOSS = 4
    mjDSBL_LIMIT = 8
    mjDSBL_CONTACT = 16
    mjDSBL_SPRING = 32
    mjDSBL_DAMPER = 64
    mjDSBL_GRAVITY = 128
    mjDSBL_CLAMPCTRL = 256
    mjDSBL_WARMSTART = 512
    mjDSBL_FILTERPARENT = 1024
    mjDSBL_ACTUATION = 2048
    mjDSBL_REFSAFE = 4096
    mjDSBL_SENSOR = 8192
    mjDSBL_MIDPHASE = 16384
    mjDSBL_EULERDAMP = 32768
    mjDSBL_AUTORESET = 65536
    mjDSBL_NATIVECCD = 131072
    mjDSBL_ISLAND = 262144
    mjDSBL_MULTICCD = 524288
    mjNDISABLE = 20

class mjtEq(IntEnum):
    mjEQ_CONNECT = 0
    mjEQ_WELD = 1
    mjEQ_JOINT = 2
    mjEQ_TENDON = 3
    mjEQ_FLEX = 4
    mjEQ_FLEXVERT = 5
    mjEQ_FLEXSTRAIN = 6
    mjEQ_DISTANCE = 7

class mjtGain(IntEnum):
    mjGAIN_FIXED = 0
    mjGAIN_AFFINE = 1
    mjGAIN_MUSCLE = 2
    mjGAIN_DCMOTOR = 3
    mjGAIN_SO3 = 4
    mjGAIN_PID = 5
    mjGAIN_USER = 6

class mjtGeom(IntEnum):
    mjGEOM_PLANE = 0
    mjGEOM_HFIELD = 1
    mjGEOM_SPHERE = 2
    mjGEOM_CAPSULE = 3
    mjGEOM_ELLIPSOID = 4
    mjGEOM_CYLINDER = 5
    mjGEOM_BOX = 6
    mjGEOM_MESH = 7
    mjGEOM_SDF = 8
    mjNGEOMTYPES = 9
    mjGEOM_ARROW = 100
    mjGEOM_ARROW1 = 101
    mjGEOM_ARROW2 = 102
    mjGEOM_LINE = 103
    mjGEOM_LINEBOX = 104
    mjGEOM_FLEX = 105
    mjGEOM_SKIN = 106
    mjGEOM_LABEL = 107
    mjGEOM_TRIANGLE = 108
    mjGEOM_NONE = 1001

class mjtInertiaFromGeom(IntEnum):
    mjINERTIAFROMGEOM_FALSE = 0
    mjINERTIAFROMGEOM_TRUE = 1
    mjINERTIAFROMGEOM_AUTO = 2

class mjtIntegrator(IntEnum):
    mjINT_EULER = 0
    mjINT_RK4 = 1
    mjINT_IMPLICIT = 2
    mjINT_IMPLICITFAST = 3
    mjINT_DISCRETE = 4

class mjtJoint(IntEnum):
    mjJNT_FREE = 0
    mjJNT_BALL = 1
    mjJNT_SLIDE = 2
    mjJNT_HINGE = 3

class mjtMeshInertia(IntEnum):
    mjMESH_INERTIA_CONVEX = 0
    mjMESH_INERTIA_EXACT = 1
    mjMESH_INERTIA_LEGACY = 2
    mjMESH_INERTIA_SHELL = 3

class mjtObj(IntEnum):
    mjOBJ_UNKNOWN = 0
    mjOBJ_BODY = 1
    mjOBJ_XBODY = 2
    mjOBJ_JOINT = 3
    mjOBJ_DOF = 4
    mjOBJ_GEOM = 5
    mjOBJ_SITE = 6
    mjOBJ_CAMERA = 7
    mjOBJ_LIGHT = 8
    mjOBJ_FLEX = 9
    mjOBJ_MESH = 10
    mjOBJ_SKIN = 11
    mjOBJ_HFIELD = 12
    mjOBJ_TEXTURE = 13
    mjOBJ_MATERIAL = 14
    mjOBJ_PAIR = 15
    mjOBJ_EXCLUDE = 16
    mjOBJ_EQUALITY = 17
    mjOBJ_TENDON = 18
    mjOBJ_ACTUATOR = 19
    mjOBJ_SENSOR = 20
    mjOBJ_NUMERIC = 21
    mjOBJ_TEXT = 22
    mjOBJ_TUPLE = 23
    mjOBJ_KEY = 24
    mjOBJ_PLUGIN = 25
    mjNOBJECT = 26
    mjOBJ_FRAME = 100
    mjOBJ_DEFAULT = 101
    mjOBJ_MODEL = 102

class mjtTrn(IntEnum):
    mjTRN_JOINT = 0
    mjTRN_JOINTINPARENT = 1
    mjTRN_SLIDERCRANK = 2
    mjTRN_TENDON = 3
    mjTRN_SITE = 4
    mjTRN_BODY = 5
    mjTRN_SO3 = 6
    mjTRN_UNDEFINED = 1000

class mjtWarning(IntEnum):
    mjWARN_INERTIA = 0
    mjWARN_CONTACTFULL = 1
    mjWARN_CNSTRFULL = 2
    mjWARN_BADQPOS = 3
    mjWARN_BADQVEL = 4
    mjWARN_BADQACC = 5
    mjWARN_BADCTRL = 6
    mjNWARNING = 7

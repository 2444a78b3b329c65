"""The workstation file: what the engineer writes, typed, frozen, checked all at once.

`read` turns ``workstation.toml`` into a `Workstation`; every mistake is reported in one
`InputError`. Quantities are SI; a key that ends in ``_deg``, ``_mm`` … is converted at the door.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from msgspec import Meta, Struct, field

from seerob.core.errors import InputError
from seerob.core.quantities import (
    Alternatives,
    Coordinate,
    Density,
    Length,
    Mass,
    Name,
    PathName,
    Percentile,
    Radian,
    Radians,
    Share,
    Table,
    Tolerance,
    unit,
)
from seerob.core.quantities import Metres3 as Metres3  # noqa: PLC0414
from seerob.core.quantities import Pose as Pose  # noqa: PLC0414
from seerob.workstation.tables.cameras import Camera as Camera  # noqa: PLC0414
from seerob.workstation.tables.controls import Control as Control  # noqa: PLC0414
from seerob.workstation.tables.machines import Belt, Conveyor, Fingers, Motion, Route, Slide, Turn, Vehicle
from seerob.workstation.tables.places import Place as Place  # noqa: PLC0414
from seerob.workstation.tables.sensors import Sensor
from seerob.workstation.tables.simple_shape import Shape as Shape  # noqa: PLC0414
from seerob.workstation.tables.task_phase import TaskPhase
from seerob.workstation.tables.writing import CartesianTarget, Trigger

Color = tuple[Share, Share, Share]


class Display(Table, frozen=True, kw_only=True):
    """A look that follows a variable: a lamp's colour, or whether something is there to be seen."""

    of: str
    """Name of a part, a machine or an area; wildcards allowed."""
    variable: str
    """Variable of the dictionary: a bool, a choice or a text."""
    colors: dict[str, Color] = field(default_factory=dict)
    """Value → red, green, blue in 0…1: ``{ true = [0.9, 0.1, 0.1] }``; its own colour at any other."""
    hidden: tuple[str, ...] = ()
    """Values at which it is not drawn. It counts in distances all the same."""

    def __post_init__(self) -> None:
        if not self.colors and not self.hidden:
            raise ValueError("give colors, hidden or both")


FILE_NAME = "workstation.toml"


class _Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every table; the linter knows a struct by its base in the same file."""


class Engine(_Table, frozen=True, kw_only=True):
    """How the twin is moved."""

    timestep: Annotated[float, unit("s", ge=0.001, le=0.002)] = 0.002
    """Physics step [s]: 500 to 1 000 Hz."""
    tick: Annotated[float, unit("s", gt=0, le=0.01)] = 0.01
    """Period of results [s]: 100 Hz or more, a whole number of steps."""
    bandwidth: Annotated[float, unit("Hz", ge=1, le=60)] = 20.0
    """Natural frequency of the critically damped controllers that pull robots [Hz]."""
    human_bandwidth: Annotated[float, unit("Hz", ge=1, le=40)] = 10.0
    """Natural frequency of the critically damped controllers that pull people [Hz]."""
    gravity: Annotated[tuple[Coordinate, Coordinate, Coordinate], unit("m/s²")] = (0.0, 0.0, -9.81)
    """[m/s²]"""
    tracking_limit: Annotated[float, unit("rad", gt=0)] = 0.01
    """Joint error [rad or m] beyond which the twin does not follow: what depends on it is UNDECIDED."""
    human_tracking_limit: Annotated[float, unit("rad", gt=0)] = 0.05
    """Joint error [rad or m] beyond which the twin does not follow a person: what depends on it is UNDECIDED.
    The default is about what devices that see people are good to."""
    physics: bool = True
    """Whether forces move the twin toward the samples. Without, it is put on the motion through them at every
    tick: for long recordings, several times as fast, and blind to torque limits and contacts."""

    def __post_init__(self) -> None:
        steps = self.tick / self.timestep
        if abs(steps - round(steps)) > 1e-9 or round(steps) < 1:
            raise ValueError(f"tick = {self.tick} s is not a whole number of timesteps of {self.timestep} s")


class ReportCover(_Table, frozen=True, kw_only=True):
    """What the first page of a report says besides; nothing of it is judged."""

    customer: str = ""
    """For whom the workstation is evaluated."""
    author: str = ""
    """Who answers for it."""
    revision: str = ""
    """Of the workstation, as its owner counts."""
    logo: str | None = None
    """A PNG or JPEG file of at most 1 MB, beside this one."""
    language: Literal["en", "de", "fr", "es", "it"] = "en"
    """Of headings, verdicts and sentences; formulas, sources and names stay as they are."""


class Robot(_Table, frozen=True, kw_only=True):
    """A robot arm or any other chain of joints."""

    name: Name
    """Its name, by which criteria and sources ask for it."""
    model: str
    """``library:ur10``, ``description:ur5e_description``, ``package:…/ur10_robot.urdf``, or a path to URDF,
    xacro or MJCF."""
    on: str | None = None
    """Machine that carries it, an axis, a turntable or a cart; it stands in the world when not given."""
    base: Pose = Pose()
    """Pose of its root link in the world, or in the frame of the machine it is on."""
    meshes: str | None = None
    """The maker's description (as ``model``) whose shapes replace the library's envelope."""
    visuals: Literal["read", "ignore"] = "read"
    """``ignore``: what a description shows besides its collision shapes is not read, and distances take it
    that nothing stands out of those; where a link has no other shape, it is read all the same."""
    openings: Literal["open", "closed"] | None = None
    """Whether holes in meshes of its links are ``open`` in reality or ``closed``, each by a surface in the
    convex hull of its rim. When not given, nothing is within that would not be with a surface anywhere in the
    convex hull of all rims of a mesh."""
    scale: Annotated[float, Meta(ge=0.01, le=100)] = 1.0
    """How many times as large it is as the one that exists; masses, speeds and torques follow by similarity,
    and a finding says that there is no such robot."""
    calibration: str | None = None
    """File with the kinematics of this very robot, as ``seerob probe`` writes it."""
    packages: dict[str, str] = {}
    """Folders of ROS packages that ``package://`` may name."""
    arguments: dict[str, str] = {}
    """Values of the arguments of a xacro file."""
    tool: str | None = None
    """Link that is its point of interest; its last mounted tool's ``tcp`` when not given."""
    q: Radians | None = None
    """Joint positions [rad or m] where it stands when no source drives it."""
    rotor_inertia: Annotated[tuple[float, ...], unit("kg·m²")] | None = None
    """Rotor inertia seen at each joint [kg·m²]; unknown when not given."""
    torque_limits: Annotated[tuple[float, ...], unit("N·m")] | None = None
    """Largest torque per joint [N·m], instead of the description's."""
    velocity_limits: Annotated[tuple[float, ...], unit("rad/s")] | None = None
    """Largest speed per joint [rad/s], instead of the description's."""
    acceleration_limits: Annotated[tuple[float, ...], unit("rad/s²")] | None = None
    """Largest acceleration per joint [rad/s²], of a rescaled motion and of moves between waypoints; never
    assumed."""
    jerk_limits: Annotated[tuple[float, ...], unit("rad/s³")] | None = None
    """Largest jerk per joint [rad/s³], likewise."""
    masses: dict[str, Body] = {}
    """Mass properties by hand, per link name."""
    controller_tcp: Pose | None = None
    """Where its controller has its tool centre point, in the frame of the flange, when that is neither the
    flange nor the ``tcp`` of a tool: what a source says of it is compared with the twin."""
    tcp_tolerance: Annotated[float, unit("m", gt=0, le=0.2)] | None = None
    """How far what a source says of the tool centre point may be from the twin's [m]; 10 mm when not given,
    for no two arms of a type are alike. Beyond it, what rests on the robot is undecided."""
    mass_tolerance: Tolerance | None = None
    """How far the masses of its links may be off, all alike, as a share: 0.05 for ± 5 %."""
    rotor_tolerance: Tolerance | None = None
    """How far ``rotor_inertia`` may be off, all alike, as a share."""
    com_tolerance: Annotated[float, unit("m", ge=0, le=10)] | None = None
    """How far the centre of mass of every link may be from where it is said to be, in any direction [m]."""
    published_mass: Mass | None = None
    """What its maker says that the whole arm weighs, base included, without tools [kg]: the mass table is
    compared with it."""
    published_mass_source: Annotated[str, Meta(min_length=1, max_length=200)] | None = None
    """Where the maker says so: data sheet, edition, page."""
    real: bool = False
    """Whether it exists where the twin is shown over the real cell (AR, a camera's picture): it is not drawn
    there, hides what is behind it, and counts in every figure as before."""

    def __post_init__(self) -> None:
        if (self.published_mass is None) != (self.published_mass_source is None):
            raise ValueError("published_mass and published_mass_source belong together: give both or none")
        if self.scale != 1 and (self.calibration is not None or self.real):
            raise ValueError("a robot with a scale does not exist: leave out calibration and real")
        if self.rotor_tolerance is not None and self.rotor_inertia is None:
            raise ValueError("rotor_tolerance is one of rotor_inertia: give that too")


class Body(_Table, frozen=True, kw_only=True):
    """Physical properties given by hand."""

    mass: Mass
    """Mass [kg]."""
    com: Metres3 | None = None
    """Centre of mass in the link's frame [m]; anywhere in the hull of its shape when not given."""
    inertia: Annotated[tuple[float, float, float, float, float, float], unit("kg·m²")] | None = None
    """ixx, iyy, izz, ixy, ixz, iyz about the centre of mass [kg·m²]; any that fit into its shape when not
    given."""
    uniform_density: bool = False
    """Whether the link is of one density throughout, so that `com` and `inertia` follow from its shape."""
    source: str = "workstation file"
    """Where the figures are from, for the report."""

    def __post_init__(self) -> None:
        if self.uniform_density and self.inertia is not None:
            raise ValueError("inertia is given, and follows from uniform_density: keep one")


class Thing(_Table, frozen=True, kw_only=True):
    """What a tool, a workpiece and a part have in common: a shape and where it is."""

    one_of: ClassVar[Alternatives] = ((("mesh",), ("shape",)),)

    name: PathName
    """Its name, by which criteria and sources ask for it."""
    mesh: str | None = None
    """STL, OBJ, PLY, OFF, glTF, COLLADA or 3MF file; or any other that ``seerob import`` reads (STEP, IGES,
    3DXML, USD, SDF, URDF, MJCF), as one rigid thing."""
    shape: Shape | None = None
    """A simple shape, when there is no mesh file."""
    units: str | None = None
    """Unit of the mesh file (``mm``, ``m``, ``inch`` …) when the format does not say."""
    up: Literal["x", "y", "z"] | None = None
    """Axis that points up in the mesh file, when the format does not say."""
    deviation: Annotated[float, unit("m", ge=0, le=1)] = 0.0
    """How far the real surface may lie outside the mesh [m], as of a round one that was cut into triangles;
    every distance is uncertain by it, or by what the reader of the file leaves out where that is more. A mass
    by `density` is uncertain as if it lay as far inside, too."""
    hole_depth: Annotated[float, unit("m", ge=0, le=1)] | None = None
    """How far the surface that a mesh lacks at its holes may lie beyond the convex hull of each hole's rim,
    of a heap of triangles from these [m]: 0 where all holes are flat. A mass by `density` needs it of a mesh
    with holes; without it, a given mass may be anywhere in the hull of the mesh. It says `openings` to be
    closed, as they are of a body."""
    openings: Literal["open", "closed"] | None = None
    """Of a mesh with holes, whether they are ``open`` in reality, as of sheet metal, a fence or a tray, or
    ``closed``, each by a surface in the convex hull of its rim or `hole_depth` beyond. With neither, nothing
    is within that would not be with a surface anywhere in the convex hull of all rims."""
    triangles: Annotated[int, Meta(ge=100, le=20_000_000)] | None = None
    """Most triangles of each of its meshes on the screen, 20 000 when not given; how far what is shown is off
    then is a finding. Distances use all."""
    at: Pose = Pose()
    """Pose in the world, or in the frame it is mounted on."""
    mass: Mass | None = None
    """Mass [kg]; by `density` when not given, and with neither nobody knows it."""
    com: Metres3 | None = None
    """Centre of mass in its own frame [m]; of a `mass`, anywhere in the hull of its shape when not given."""
    inertia: Annotated[tuple[float, float, float, float, float, float], unit("kg·m²")] | None = None
    """ixx, iyy, izz, ixy, ixz, iyz about the centre of mass [kg·m²]; of a `mass`, any that fit into its shape
    when not given."""
    density: Density | None = None
    """Uniform density [kg/m³] to compute the mass from the shape."""
    uniform_density: bool = False
    """Whether a `mass` is of one density throughout, as of a block of steel that was weighed, so that `com`
    and `inertia` follow from the shape; a gripper with a motor is not."""
    color: tuple[Share, Share, Share] | None = None
    """Red, green, blue in 0…1."""

    @property
    def library(self) -> str | None:
        """Name in the library of tools, where its shape is that."""
        return None

    def __post_init__(self) -> None:
        if self.library is not None:
            if self.mesh is not None or self.shape is not None:
                raise ValueError("model has a shape: leave out mesh and shape")
        elif (self.mesh is None) == (self.shape is None):
            raise ValueError("give either mesh or shape")
        if self.deviation and self.mesh is None:
            raise ValueError("deviation is of a mesh: leave it out beside a shape")
        if self.hole_depth is not None and self.mesh is None:
            raise ValueError("hole_depth is of a mesh: leave it out beside a shape")
        if self.openings is not None and self.mesh is None:
            raise ValueError("openings are of a mesh: leave them out beside a shape")
        if self.openings == "open" and self.hole_depth is not None:
            raise ValueError("hole_depth is of openings that are closed: leave it out, or openings")
        if self.triangles is not None and self.mesh is None:
            raise ValueError("triangles are of a mesh: leave it out beside a shape")
        if self.mass is not None and self.density is not None:
            raise ValueError("mass and density are both given: keep one")
        if self.inertia is not None and (self.mass is None or self.com is None):
            raise ValueError("inertia needs mass and com beside it")
        if self.com is not None and self.mass is None:
            raise ValueError("com needs mass beside it")
        if self.uniform_density and (self.mass is None or self.inertia is not None):
            raise ValueError("uniform_density is of a mass without inertia: leave it out")


class Mounted(Thing, frozen=True, kw_only=True):
    """A thing that moves with a robot."""

    on: str
    """Full name of the link that carries it, such as ``ur10/tool0``, or of another tool."""
    mass_tolerance: Tolerance | None = None
    """How far its mass may be off, as a share: 0.05 for ± 5 %."""
    density_tolerance: Tolerance | None = None
    """How far its ``density`` may be off, as a share, and with it its mass."""
    com_tolerance: Annotated[float, unit("m", ge=0, le=10)] | None = None
    """How far its centre of mass may be from where it is, in any direction [m]; without `com`, from where
    uniform density has it."""
    real: bool = False
    """Whether it exists where the twin is shown over the real cell (AR, a camera's picture): it is not drawn
    there, hides what is behind it, and counts in every figure as before."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _toleranced(self)


def _toleranced(thing: Mounted | Part) -> None:
    if thing.density_tolerance is not None and thing.density is None:
        raise ValueError("density_tolerance is of a density, which is not given: give mass_tolerance")


class Tool(Mounted, frozen=True, kw_only=True):
    """Something mounted on a robot, real or virtual: it changes the twin's masses and torques."""

    one_of = ((("mesh",), ("shape",), ("model",)),)

    model: (
        Annotated[str, Meta(pattern=r"^library:[a-z0-9_]+$", description="library: and the name of a tool")]
        | None
    ) = None
    """A tool of the library, as ``library:robotiq_2f_85``, instead of a mesh or a shape: its envelope, mass
    and working point, unless they are given here."""
    tcp: Pose | None = None
    """Its working point in its own frame; the robot's point of interest from then on."""

    @property
    def library(self) -> str | None:
        """Name in the library of tools, where its shape is that."""
        return None if self.model is None else self.model.removeprefix("library:")


class Workpiece(Mounted, frozen=True, kw_only=True):
    """A payload: something a tool carries, or a loose part that people and grippers take and put down."""

    on: str = ""
    """Full name of the link that carries it, such as ``ur10/tool0``, or of another tool. Without it, it is
    loose: it lies where ``at`` says, gravity and what touches it move it, people and grippers take it."""
    rest: Pose | None = None
    """Where it lies first, in the world: the gripper that ``on`` names picks it up and lets it go.
    Without it, it is on what carries it all the time."""
    friction: Annotated[float, unit("1", gt=0, le=2)] = 0.5
    """Coefficient of friction of a loose one on everything that it touches; the default is our choice."""
    torn: Annotated[float, unit("m", gt=0, le=1)] = 0.15
    """A loose one is torn out of a hand that is farther than this from where it took it [m]; our choice."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.loose and self.rest is not None:
            raise ValueError("rest is of what a gripper picks up: name the gripper as on, or leave rest out")
        if self.loose and "/" in self.name:
            raise ValueError(f"name = {self.name!r}: the name of a loose workpiece has no /")
        if self.loose and self.mass is None and self.density is None:
            raise ValueError("a loose workpiece is moved by forces: give its mass or density")

    @property
    def loose(self) -> bool:
        """Whether nothing carries it all the time."""
        return not self.on


class Part(Thing, frozen=True, kw_only=True):
    """Something of the environment that stands still."""

    conveyor: Conveyor | None = None
    """Its surface runs: loose workpieces on it ride along."""
    mass_tolerance: Tolerance | None = None
    """How far its mass may be off, as a share: what stands still is not judged by it, and what becomes a
    workpiece or a tool keeps it. ``seerob import`` writes it."""
    density_tolerance: Tolerance | None = None
    """How far its ``density`` may be off, as a share, and with it its mass."""
    real: bool = False
    """Whether it exists where the twin is shown over the real cell (AR, a camera's picture): it is not drawn
    there, hides what is behind it, and counts in every figure as before."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _toleranced(self)


class Machine(Thing, frozen=True, kw_only=True):
    """Something that moves: an axis, a door, a turntable, what a belt carries, a cart, a gripper."""

    one_of = (*Thing.one_of, (("slide",), ("turn",), ("belt",), ("vehicle",), ("route",), ("grip",)))

    on: str | None = None
    """Machine, link or tool that carries it, such as ``ur10/tool0``; stands in the world when not given."""
    slide: Slide | None = None
    """It moves along a straight line."""
    turn: Turn | None = None
    """It turns about an axis."""
    belt: Belt | None = None
    """It is carried by a belt."""
    vehicle: Vehicle | None = None
    """It drives on the floor and tells its pose."""
    route: Route | None = None
    """It goes along a way that is drawn on the floor."""
    grip: Fingers | None = None
    """It is a gripper with these fingers."""
    real: bool = False
    """Whether it exists where the twin is shown over the real cell (AR, a camera's picture): it is not drawn
    there, hides what is behind it, and counts in every figure as before."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if "/" in self.name:
            raise ValueError(f"name = {self.name!r}: the name of a machine has no /")
        if sum(m is not None for m in self._motions()) != 1:
            raise ValueError("give exactly one of slide, turn, belt, vehicle, route, grip")

    def _motions(self) -> tuple[Motion | None, ...]:
        return self.slide, self.turn, self.belt, self.vehicle, self.route, self.grip

    @property
    def motion(self) -> Motion:
        """How it moves."""
        return next(motion for motion in self._motions() if motion is not None)


class SweptArea(_Table, frozen=True, kw_only=True):
    """An area made when the workstation is read, from what something sweeps or can reach."""

    of: str
    """What sweeps: a robot with everything on it, a tool, a link; wildcards allowed."""
    voxel: Length = 0.05
    """Edge of a voxel [m]."""
    reach: bool = False
    """All that the joint limits allow, instead of the motion of the sources."""
    start: Annotated[float, unit("s", ge=0)] = 0.0
    """Begin of the part of the motion to take [s]."""
    end: Annotated[float, unit("s", ge=0)] | None = None
    """End of it [s]; that of the motion when not given."""
    margin: Annotated[float, unit("m", ge=0, le=10)] = 0.0
    """Dilated by this [m]."""
    separation: str | None = None
    """Name of a criterion of kind ``separation``: dilated, at every instant, by its S_p too. Who is outside
    is farther from every swept part than its protective separation distance was when it was there."""

    def __post_init__(self) -> None:
        if self.end is not None and self.end < self.start:
            raise ValueError(f"end = {self.end:g} s is before start = {self.start:g} s: begin before the end")
        if self.reach and (self.start or self.end is not None or self.separation is not None):
            raise ValueError(
                "reach takes no part of a motion and no S_p: leave out start, end and separation"
            )


class Area(Thing, frozen=True, kw_only=True):
    """A safety area: a shape that is watched, not touched."""

    one_of = ((("mesh",), ("shape",), ("swept",)),)

    swept: SweptArea | None = None
    """Instead of a mesh or a shape: what something sweeps."""
    on: str | None = None
    """Full name of the link, tool or bone that carries it; stands still when not given."""

    def __post_init__(self) -> None:
        if self.swept is None:
            super().__post_init__()
        elif self.mesh is not None or self.shape is not None:
            raise ValueError("give exactly one of mesh, shape, swept")
        elif self.on is not None or self.at != Pose():
            raise ValueError("what is swept lies in the world: leave out on and at")
        if self.mass is not None or self.density is not None:
            raise ValueError("an area has no mass")


class Human(_Table, frozen=True, kw_only=True):
    """A person."""

    name: Name
    """Its name, by which criteria and sources ask for it."""
    stature: Annotated[float, unit("m", ge=0.8, le=2.3)] | Percentile
    """[m], at least 1.2 of an adult, or a percentile of a published population: ``"germany P50"``."""
    mass: Annotated[float, unit("kg", ge=10, le=250)]
    """[kg], at least 30 of an adult."""
    adult: bool = True
    """Whether tables of adults hold. Of a child or adolescent distances and speeds are judged, with an
    adult's proportions; postures and lifts are not, and no contact is within its limits."""
    sex: Literal["male", "female"]
    """Which anthropometric tables are used."""
    hand: Literal["right", "left"] = "right"
    """Dominant hand."""
    lengths: Literal["drillis", "deleva"] | dict[str, Length] = "drillis"
    """Data set that segment lengths are taken from; or lengths by hand [m], ``{ forearm = 0.26, … }``, the
    others then from ``drillis`` so that the chain ends at the stature."""
    masses: Literal["deleva", "zatsiorsky"] | dict[str, Mass] = "deleva"
    """Data set of segment masses; or masses by hand [kg], ``{ thigh = 9.5, … }``, the others then from
    ``deleva`` so that all weigh the body mass."""
    follow: Literal["posture", "task"] = "posture"
    """What the controllers that pull the twin hold: each joint at its value, or each bone at its place."""
    unseen_uncertainty: Annotated[float, unit("m", gt=0, le=2)] | None = None
    """How far bones that no device sees may be from their estimate [m]; without it they stay undecided."""
    at: Pose = Pose()
    """Where the person stands: the point on the floor between the feet."""
    posture: str = "standing"
    """Named posture when no source moves the person."""
    joints: dict[str, Radian] = {}
    """Joint angles on top of the posture [rad]; ``joints_deg`` for degrees."""
    real: bool = False
    """Whether it exists where the twin is shown over the real cell (AR, a camera's picture): it is not drawn
    there, hides what is behind it, and counts in every figure as before."""

    def __post_init__(self) -> None:
        small = not isinstance(self.stature, str) and self.stature < 1.2
        if self.adult and (small or self.mass < 30):
            what = f"stature {self.stature:g} m" if small else f"mass {self.mass:g} kg"
            raise ValueError(f"{what} is not an adult's: say adult = false of a child or adolescent")


BOARD = Meta(
    max_length=60,
    pattern=r"^charuco \d{1,2}x\d{1,2} \d+(\.\d+)? \d+(\.\d+)?$",
    description="charuco, its squares across and down, and the sides of a square and of a tag in mm: "
    "charuco 8x6 40.1 30.1",
)
"""Of `seerob.description.camera.board`."""


class Landmark(_Table, frozen=True, kw_only=True):
    """A place of the cell that can be touched or seen, by which a visitor's room or a camera is placed."""

    name: Name
    """What the visitor is asked for, such as ``table_corner``."""
    on: str | None = None
    """Full name of the link, tool, part or machine that carries it, such as ``ur10/tool0``: it goes along; in
    the world when not given."""
    at: Pose = Pose()
    """Where it is in that frame; a board lies in its plane z = 0, from this point along x and y."""
    accuracy: Annotated[float, unit("m", ge=0, le=0.1)]
    """How far it may be from there, standard deviation per axis [m]: as it was measured, or as the robot that
    carries it is accurate."""
    accuracy_turn: Annotated[float, unit("rad", ge=0, le=0.5)] | None = None
    """How far it may be turned from there, standard deviation per axis [rad]; must be given of one in whose
    pose a controller is laid."""
    board: Annotated[str, BOARD] | None = None
    """What is printed on the board that lies there, such as ``charuco 8x6 40.1 30.1``, by which a visitor's
    device with a camera finds it."""


class Contact(_Table, frozen=True, kw_only=True):
    """Two sets that may touch in the physics. Nothing else does."""

    between: tuple[str, str]
    """Two names, of groups, things or bodies."""


Words = Annotated[str, Meta(min_length=1, max_length=1000, pattern=r"\w", description="a reason in words")]


class Confirmed(_Table, frozen=True, kw_only=True):
    """A value that looks like a mistake and is meant: it does not keep verdicts undecided any more."""

    key: Annotated[str, Meta(max_length=300)]
    """Where it stands in the file, with the number of its entry from 0: ``robots[0].base.position``."""
    of: Annotated[str, Meta(max_length=300)] | None = None
    """Name of that entry (title of a phase), so that what is put in another order confirms nothing else."""
    value: float | list[Any]
    """The value that is meant, as the file has it; another one later is not confirmed."""
    why: Words
    """Why it is right, in words; it stands in the report."""


class LeftOut(_Table, frozen=True, kw_only=True):
    """Something that stands in the real cell and not in this file, so that nobody is warned of it.

    As long as nobody says why that does not matter, nothing is within.
    """

    name: Annotated[str, Meta(min_length=1, max_length=500)]
    """What it is called where it comes from."""
    why: Annotated[str, Meta(max_length=1000)] = ""
    """Why it is not here."""
    accepted: Words | None = None
    """Why it does not matter that nobody is warned of it, in words; it stands in the report."""


class Workstation(_Table, frozen=True, kw_only=True):
    """A workstation file."""

    title: str = "Untitled workstation"
    edition: Literal["ISO 10218-2:2025", "ISO/TS 15066:2016"] = "ISO/TS 15066:2016"
    """Edition of the norm that limits are taken from."""
    description: str = ""
    variables: str | None = None
    """Dictionary of the variables of controllers and machines, a TOML file beside this one."""
    zones: str | None = None
    """Zones of a robot controller as more ``[[areas]]``, a TOML or JSON file beside this one."""
    allow_writing: bool = False
    """Whether ``[[triggers]]`` and ``[[targets]]`` may write; the command line must allow it too."""
    engine: Engine = Engine()
    report: ReportCover = ReportCover()
    robots: tuple[Robot, ...] = ()
    tools: tuple[Tool, ...] = ()
    workpieces: tuple[Workpiece, ...] = ()
    parts: tuple[Part, ...] = ()
    machines: tuple[Machine, ...] = ()
    places: tuple[Place, ...] = ()
    controls: tuple[Control, ...] = ()
    areas: tuple[Area, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    humans: tuple[Human, ...] = ()
    phases: tuple[TaskPhase, ...] = ()
    landmarks: tuple[Landmark, ...] = ()
    cameras: tuple[Camera, ...] = ()
    displays: tuple[Display, ...] = ()
    triggers: tuple[Trigger, ...] = ()
    targets: tuple[CartesianTarget, ...] = ()
    contacts: tuple[Contact, ...] = ()
    confirmed: tuple[Confirmed, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    sources: tuple[Any, ...] = ()
    """`Source`s, each of the type that its ``kind`` names."""
    safety: tuple[Any, ...] = ()
    """`Criterion`s."""
    ergonomics: tuple[Any, ...] = ()
    """Rules, which are `Criterion`s too."""
    sinks: tuple[Any, ...] = ()
    """`Sink`s."""
    emulators: tuple[Any, ...] = ()
    """`Emulator`s that stand for its devices where somebody asks for that."""

    folder: str = ""
    """Folder of the file; not written in it."""
    outside: bool = False
    """Whether files outside it may be read, as whoever opens the file says; not written in it."""
    files: dict[str, bytes] = {}
    """The file itself, and after `compile` every file it names; not written in it."""

    def __repr__(self) -> str:
        tables = [f"{name} {len(there)}" for name in (*TABLES, *PLUGINS) if (there := getattr(self, name))]
        return f"<Workstation {self.title!r}: {', '.join(tables) or 'empty'}>"


def real_names(station: Workstation) -> frozenset[str]:
    """Names of what exists in the real cell: robots, people, parts and what else says so."""
    entries = (station.robots, station.tools, station.workpieces, station.parts, station.machines)
    named = (entry for group in (*entries, station.humans) for entry in group)
    return frozenset(entry.name for entry in named if entry.real)


TABLES: dict[str, type[Struct]] = {
    "robots": Robot,
    "tools": Tool,
    "workpieces": Workpiece,
    "parts": Part,
    "machines": Machine,
    "places": Place,
    "controls": Control,
    "areas": Area,
    "sensors": Sensor,
    "humans": Human,
    "phases": TaskPhase,
    "landmarks": Landmark,
    "cameras": Camera,
    "displays": Display,
    "triggers": Trigger,
    "targets": CartesianTarget,
    "contacts": Contact,
    "confirmed": Confirmed,
    "left_out": LeftOut,
}
"""Lists of tables and the type of their entries."""

PLUGINS = ("sources", "safety", "ergonomics", "sinks", "emulators")
"""Tables whose type is told by their ``kind``."""


def locate(path: Path | str) -> Path:
    """The workstation file of a path that is one, or a folder that contains one.

    Raises:
        InputError: There is none.
    """
    path = Path(path)
    try:
        file = path / FILE_NAME if path.is_dir() else path
        found = file.is_file()
    except (OSError, ValueError) as error:
        raise InputError.at(path, "", f"no such file: {error}", "give a folder or a file") from error
    if not found:
        remedy = f"give a folder with a {FILE_NAME}, or make one with `seerob new`"
        raise InputError.at(file, "", "no such file", remedy)
    return file


def file_among(names: Iterable[str]) -> str:
    """Which of the files of a recording is the workstation file."""
    own = [name for name in names if "/" not in name and name.endswith(".toml")]
    return FILE_NAME if FILE_NAME in own or len(own) != 1 else own[0]

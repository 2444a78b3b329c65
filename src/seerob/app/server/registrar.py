"""Where the rooms of visitors lie in the cell: what they touch, step by step, and what follows from it.

The mathematics is `seerob.description.capture.registration`; here is what was touched, and when it may count.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from seerob.core.errors import InputError
from seerob.core.samples import Placing
from seerob.core.snapshot import Place, Register, Registered, Scene, Snapshot
from seerob.core.transforms import Array, inverse, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.description.camera import board as boards
from seerob.description.camera.calibration import Corners, look
from seerob.description.capture import registration as solve
from seerob.description.capture.registration import Registration
from seerob.devices.live.headset_offers import LONGEST_NAME, Offers, Registering, Room
from seerob.protocols.tracking.vive import WORLD_FROM_XR

MOST_POSES, MOST_TOUCHES = 500, 64
MOST_PX = 2.0
"""Of a picture in which corners are off by more nothing is taken [px]: it is blurred, or of another lens."""
STILL, STILL_FOR = 0.003, 0.6
"""What is touched with, or touched, moves no farther while it is [m], for so long before [s]."""
MOST_CORNERS = 400
"""Of a board."""
STEPS = ("sweep", "touch", "strapped", "known", "seen", "check", "nudge", "restore", "drop", "forget")
UNCHECKED = "where the room lies was kept from another session: check it, with one touch of a landmark"


@dataclass
class _Touch:
    landmark: str
    room: Array
    """Where the tip was [m]."""
    grip: Array
    """How the controller was turned, room from grip, (3, 3)."""
    cell: Array
    """Where the landmark was [m]."""
    accuracy: float


@dataclass
class _Begun:
    """What one page told of one tracking space."""

    space: str
    tip: Array | None = None
    tip_covariance: Array | None = None
    touches: list[_Touch] = field(default_factory=list)
    straps: list[tuple[str, Array, Array]] = field(default_factory=list)
    """Landmark, cell from it, room from grip."""
    looks: list[tuple[str, Array, Array, Array]] = field(default_factory=list)
    """Landmark, cell from camera, room from camera, and covariance of the former."""
    found: Registration | None = None
    doubt: str = ""

    def begin(self) -> None:
        """Nothing was touched or seen yet."""
        self.touches.clear()
        self.straps.clear()
        self.looks.clear()


class Registrar:
    """Takes steps of pages one by one; `show` and `take` may come from different threads.

    Args:
        offers: Told where rooms lie.
        scene: With the landmarks.
    """

    def __init__(self, offers: Offers, scene: Scene) -> None:
        self._offers = offers
        self._of: dict[object, _Begun] = {}
        self._recent: deque[Snapshot] = deque(maxlen=256)
        self.begin(scene)

    def begin(self, scene: Scene) -> None:
        """Another scene: what was found out of another cell holds no more."""
        self._scene = scene
        self._places = {place.name: place for place in scene.landmarks}
        self._rows = {node.name: row for row, node in enumerate(scene.nodes)}
        self._movers = {node.name: (node.name, node.mover, node.owner) for node in scene.nodes}
        self._offers.mixed = any(node.real for node in scene.nodes)
        self._recent.clear()
        self._of.clear()

    def show(self, snapshot: Snapshot) -> None:
        """What is shown now."""
        while self._recent and not self._recent[0].t >= snapshot.t - STILL_FOR:
            self._recent.popleft()
        self._recent.append(snapshot)

    def gone(self, visitor: object) -> None:
        """A page has left."""
        self._of.pop(visitor, None)

    def take(self, visitor: object, asked: Register) -> Registered:
        """Take a step, and say what is known after it.

        Raises:
            ValueError: It contradicts itself, or is too large.
        """
        poses = _poses(asked)
        begun = self._of.get(visitor)
        if begun is None or begun.space != asked.space:
            begun = self._of[visitor] = _Begun(asked.space)
            self._offers.place(asked.human, None, visitor)
        options = self._offers.registering(asked.human)
        try:
            self._step(begun, asked, poses, options)
        except _Refused as refusal:
            return self._answer(begun, asked, options, str(refusal))
        answer = self._answer(begun, asked, options, "")
        found = begun.found
        if found is None:
            self._offers.place(asked.human, None, visitor)
        else:
            placing = Placing(covariance=answer.covariance, about=_three(found.about), reason=answer.doubt)
            self._offers.place(
                asked.human, Room(visitor, asked.space, found.cell_from_room, placing), visitor
            )
        return answer

    def _step(self, begun: _Begun, asked: Register, poses: Array, options: Registering) -> None:
        match asked.step:
            case "sweep":
                try:
                    begun.tip, begun.tip_covariance, _ = solve.pivot(poses[:, :3, :3], poses[:, :3, 3])
                except ValueError as error:
                    raise _Refused(str(error)) from None
                if begun.touches:
                    begun.touches.clear()
                    begun.found = None
                return
            case "touch":
                if len(begun.touches) >= MOST_TOUCHES:
                    raise _Refused(f"{MOST_TOUCHES} touches are enough")
                touch = self._touch(begun, asked.landmark, poses)
                begun.straps.clear()
                begun.looks.clear()
                begun.touches.append(touch)
            case "drop":
                for kept in (begun.touches, begun.looks):
                    del kept[-1:]
            case "strapped":
                grip, cell = _held(poses), self._still(asked.landmark)
                begun.straps.append((asked.landmark, cell, grip))
                begun.touches.clear()
                begun.looks.clear()
            case "seen":
                self._look(begun, asked, poses)
            case "known":
                self._known(begun, asked.landmark, poses, options)
                return
            case "check":
                self._check(begun, self._touch(begun, asked.landmark, poses), options)
                return
            case "nudge":
                if begun.found is None or len(asked.by) != 6:
                    raise _Refused("there is nothing to move yet")
                begun.found = solve.nudged(begun.found, np.array(asked.by))
                return
            case "restore":
                begun.found, begun.doubt = _restored(asked.by), UNCHECKED
                return
            case _:
                begun.begin()
                begun.found, begun.doubt = None, ""
                return
        self._solve(begun, options)

    def _solve(self, begun: _Begun, options: Registering) -> None:
        begun.found, begun.doubt = None, ""
        level = np.inf if options.level is None else options.level
        try:
            if begun.looks:
                self._solve_looks(begun, level)
            elif begun.straps:
                cells, grips = (np.array([one[k] for one in begun.straps]) for k in (1, 2))
                accuracy = max(self._places[landmark].accuracy for landmark, *_ in begun.straps)
                begun.found, _ = solve.strapped(cells, grips, place_error=accuracy)
            elif begun.touches:
                begun.found = solve.touched(
                    np.array([touch.room for touch in begun.touches]),
                    np.array([touch.cell for touch in begun.touches]),
                    place_error=np.array([touch.accuracy for touch in begun.touches]),
                    touch_error=options.touch,
                    level=level,
                    grips=np.array([touch.grip for touch in begun.touches]),
                    tip_covariance=begun.tip_covariance,
                )
        except ValueError as error:
            begun.doubt = str(error)
            return
        if begun.found is not None and begun.touches and begun.found.strange.max() > 1:
            worst = begun.touches[int(begun.found.strange.argmax())]
            off = 1e3 * float(begun.found.residuals[int(begun.found.strange.argmax())])
            begun.doubt = (
                f"what was touched as {worst.landmark} contradicts the others ({off:.0f} mm off): "
                "take it back, and touch it again"
            )

    def _look(self, begun: _Begun, asked: Register, poses: Array) -> None:
        """Keep one look of the device's camera at a board."""
        if len(begun.looks) >= MOST_TOUCHES:
            raise _Refused(f"{MOST_TOUCHES} looks are enough")
        cell_from_board = self._still(asked.landmark)
        if not self._places[asked.landmark].board:
            raise _Refused(f"nobody says what is printed on a board at {asked.landmark}: give its board")
        rows = np.frombuffer(asked.corners, "<f4").reshape(-1, 4).astype(float)
        seen = Corners(np.column_stack([rows[:, :2], np.zeros(len(rows))]), rows[:, 2:])
        try:
            camera_from_board, covariance, px = look(seen, np.array([*asked.by, 0, 0, 0, 0, 0]))
        except (ValueError, InputError) as error:
            raise _Refused(str(error)) from None
        if px > MOST_PX:
            raise _Refused(
                f"corners of the board are {px:.1f} px off: hold the device still, and see it whole"
            )
        if begun.looks and begun.looks[0][0] != asked.landmark:
            begun.looks.clear()
        begun.touches.clear()
        begun.straps.clear()
        room_from_camera = poses[0].copy()
        room_from_camera[:3, 1:3] *= -1  # y down, z ahead
        begun.looks.append(
            (asked.landmark, cell_from_board @ inverse(camera_from_board), room_from_camera, covariance)
        )

    def _solve_looks(self, begun: _Begun, level: float) -> None:
        place = self._places[begun.looks[0][0]]
        cells, rooms, covariances = (np.array([one[k] for one in begun.looks]) for k in (1, 2, 3))
        # A board whose corners are off on their own is turned by as much over half its edge.
        board = boards.read(place.board)
        half = 0.5 * board.square * min(board.across, board.up)
        turned = place.accuracy / half / math.sqrt(2) if place.accuracy_turn is None else place.accuracy_turn
        about = self._pose(place, self._recent[-1] if self._recent else None)[:3, 3]
        begun.found = solve.looked(
            cells, rooms, covariances, about=about, place_error=(place.accuracy, turned), level=level
        )
        worst = int(begun.found.strange.argmax())
        if begun.found.strange[worst] > 1:
            off = 1e3 * float(begun.found.residuals[worst])
            begun.doubt = f"look {worst + 1} contradicts the others ({off:.0f} mm off): begin anew"

    def _touch(self, begun: _Begun, landmark: str, poses: Array) -> _Touch:
        if begun.tip is None:
            raise _Refused("nobody knows where the tip of the controller is: turn it about its tip first")
        cell, place = self._still(landmark), self._places[landmark]
        tips = poses[:, :3, :3] @ begun.tip + poses[:, :3, 3]
        grip = _held(poses, tips)
        return _Touch(landmark, tips.mean(0), grip[:3, :3], cell[:3, 3], place.accuracy)

    def _known(self, begun: _Begun, landmark: str, poses: Array, options: Registering) -> None:
        if options.pose is None or options.pose_turn is None:
            raise _Refused("nobody says how well the device sees it: give registration.pose and pose_turn")
        cell, place = self._still(landmark), self._places[landmark]
        if place.accuracy_turn is None:
            raise _Refused(f"nobody says how {landmark} may be turned: give its accuracy_turn")
        _held(poses)
        # Its axes are those of a room: x where it points, z up.
        looks = poses.copy()
        looks[:, :3, :3] = poses[:, :3, :3] @ WORLD_FROM_XR.T
        begun.found = solve.placed(
            cell,
            looks,
            place_error=(place.accuracy, place.accuracy_turn),
            pose_error=(options.pose, options.pose_turn),
            level=np.inf if options.level is None else options.level,
        )
        begun.doubt = ""

    def _check(self, begun: _Begun, touch: _Touch, options: Registering) -> None:
        if begun.found is None:
            raise _Refused("there is nothing to check yet")
        assert begun.tip_covariance is not None  # a touch has a tip
        tip = float(np.linalg.eigvalsh(begun.tip_covariance)[-1])
        error = float(np.sqrt((options.touch or 0.0) ** 2 + touch.accuracy**2 + tip))
        off, may = solve.contradiction(begun.found, touch.room, touch.cell, error)
        begun.doubt = (
            ""
            if off <= may
            else (
                f"{touch.landmark} was touched {1e3 * off:.0f} mm off, and it may be {1e3 * may:.0f} mm: "
                "register anew"
            )
        )

    def _still(self, landmark: str) -> Array:
        """Where a landmark is, shape (4, 4), if that is known and it stands still."""
        place = self._places.get(landmark)
        if place is None:
            raise _Refused(
                f"there is no landmark {landmark!r}: [[landmarks]] has {', '.join(self._places) or 'none'}"
            )
        recent = tuple(self._recent)
        if place.node and not recent:
            raise _Refused(f"nobody has shown yet where {landmark} is")
        if place.node:
            names = self._movers[place.node]
            doubt = next((recent[-1].doubts[name] for name in names if name in recent[-1].doubts), "")
            if doubt:
                raise _Refused(f"{landmark} may be elsewhere: {doubt}")
            places = np.array([self._pose(place, snapshot)[:3, 3] for snapshot in recent])
            if float(np.ptp(places, axis=0).max()) > STILL:
                raise _Refused(f"{landmark} moves: let it stand still while it is touched")
        return self._pose(place, recent[-1] if recent else None)

    def _pose(self, place: Place, snapshot: Snapshot | None) -> Array:
        at = transform(rotation_from_wxyz(place.wxyz), place.position)
        if not place.node:
            return at
        assert snapshot is not None  # asked before
        x, y, z, *wxyz = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7)[self._rows[place.node]].tolist()
        return np.asarray(transform(rotation_from_wxyz(wxyz), [x, y, z]) @ at)

    def _answer(self, begun: _Begun, asked: Register, options: Registering, refusal: str) -> Registered:
        found, tip = begun.found, begun.tip_covariance
        said = Registered(
            id=asked.id,
            accepted=not refusal,
            reason=refusal,
            doubt=begun.doubt,
            landmarks=tuple(
                [touch.landmark for touch in begun.touches]
                or [landmark for landmark, *_ in begun.straps or begun.looks]
            ),
            tip=None if tip is None else solve.CHI * float(np.sqrt(np.linalg.eigvalsh(tip)[-1])),
        )
        if found is None:
            return said
        error, tool = self._worst(found)
        doubt = begun.doubt
        if not doubt and error > options.limit:
            doubt = f"it may be {1e3 * error:.0f} mm off at {tool}, {1e3 * options.limit:.0f} mm are accepted"
        T = found.cell_from_room
        return Registered(
            id=said.id,
            accepted=said.accepted,
            reason=refusal,
            at=(*T[:3, 3].tolist(), *wxyz_from_rotation(T[:3, :3]).tolist()),
            about=_three(found.about),
            covariance=tuple(found.covariance.ravel().tolist()),
            error=error,
            tool=tool,
            doubt=doubt,
            landmarks=said.landmarks,
            residuals=tuple(found.residuals.tolist()),
            tip=said.tip,
        )

    def _worst(self, found: Registration) -> tuple[float, str]:
        """Largest error at points of interest of robots [m], and whose; without one, at what was touched."""
        newest = self._recent[-1] if self._recent else None
        where = [(solve.bound(found.covariance, found.about, found.about, np.zeros(())), "what was touched")]
        if newest is not None:
            tips = [(self._pose(tip, newest)[:3, 3], tip.name) for tip in self._scene.tips]
            where = [
                (solve.bound(found.covariance, found.about, at, np.zeros(())), name) for at, name in tips
            ] or where
        error, tool = max(where, key=lambda one: float(one[0]))
        return float(error), tool


class _Refused(Exception):
    """A step that cannot be made, with the reason."""


def _poses(asked: Register) -> Array:
    """Room from grip, room with z up, shape (n, 4, 4).

    Raises:
        ValueError: It is not one of the steps, or contradicts itself.
    """
    if asked.step not in STEPS or max(len(asked.human), len(asked.space), len(asked.landmark)) > LONGEST_NAME:
        raise ValueError("register: an unknown step, or a name that is too long")
    if len(asked.poses) % 28 or len(asked.poses) > 28 * MOST_POSES or len(asked.by) not in (0, 4, 6, 46):
        raise ValueError(f"register: {len(asked.poses)} bytes of poses")
    if len(asked.corners) % 16 or len(asked.corners) > 16 * MOST_CORNERS:
        raise ValueError(f"register: {len(asked.corners)} bytes of corners")
    if (asked.step == "seen") != (len(asked.by) == 4):
        raise ValueError("register: a lens has four numbers, and belongs to what is seen")
    if asked.step == "seen" and not (
        min(asked.by[:2]) > 1 and np.isfinite(np.frombuffer(asked.corners, "<f4")).all()
    ):
        raise ValueError("register: a lens or corners that cannot be")
    with np.errstate(invalid="ignore"):
        rows = np.frombuffer(asked.poses, "<f4").reshape(-1, 7).astype(float)
    if not (np.abs(rows).max(initial=0.0) < 1e3 and np.abs(asked.by).max(initial=0.0) < 1e4):
        raise ValueError("register: a pose that is not finite, or beyond 1 km")
    if len(rows) and not (np.linalg.norm(rows[:, 3:], axis=1) > 0.5).all():
        raise ValueError("register: a quaternion of length zero")
    if not len(rows) and asked.step in ("sweep", "touch", "strapped", "known", "seen", "check"):
        raise ValueError(f"register: {asked.step} without poses")
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    if len(rows):
        T[:, :3, :3] = WORLD_FROM_XR @ rotation_from_wxyz(rows[:, 3:])
        T[:, :3, 3] = rows[:, :3] @ WORLD_FROM_XR.T
    return T


def _held(poses: Array, points: Array | None = None) -> Array:
    """The pose in the middle of what was held still, shape (4, 4)."""
    places = poses[:, :3, 3] if points is None else points
    if float(np.ptp(places, axis=0).max()) > 3 * STILL:
        raise _Refused("hold the controller still while it touches")
    mean: Array = poses[len(poses) // 2].copy()
    mean[:3, 3] = poses[:, :3, 3].mean(0)
    return mean


def _restored(by: tuple[float, ...]) -> Registration:
    numbers = np.array(by, float)
    if len(numbers) != 46 or not np.linalg.norm(numbers[3:7]) > 0.5:
        raise _Refused("what was kept is not whole: register anew")
    covariance = numbers[10:].reshape(6, 6)
    if not (np.allclose(covariance, covariance.T) and np.linalg.eigvalsh(covariance)[0] > -1e-9):
        raise _Refused("what was kept is no covariance: register anew")
    T = transform(rotation_from_wxyz(numbers[3:7]), numbers[:3])
    return Registration(T, covariance, numbers[7:10], np.zeros(0), np.array(np.inf), np.zeros(0))


def _three(at: Array) -> tuple[float, float, float]:
    x, y, z = at.tolist()
    return x, y, z

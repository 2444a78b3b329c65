"""Worn trackers that the OpenXR runtime of this computer sees, through ``pyopenxr`` (extra ``openxr``).

`OpenXrSession` is nothing but calls. Nothing is drawn, so that the runtime must offer ``XR_MND_headless``.
Written from the registry; no runtime was there to try it with. What a runtime says becomes the message of
`seerob.protocols.tracking.vive` in `OpenXr`. Source: ``XR_HTCX_vive_tracker_interaction`` of the OpenXR
registry.
"""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, Self

from seerob.protocols import ProtocolError
from seerob.protocols.tracking.vive import MOST_DEVICES, RUNNING_OK, Device, Devices, device, plain_role

ROLES = tuple(
    f"/user/vive_tracker_htcx/role/{name}"
    for name in (
        "waist", "chest", "left_foot", "right_foot", "left_knee", "right_knee",
        "left_elbow", "right_elbow", "left_shoulder", "right_shoulder",
    )
)  # fmt: skip
"""Where on a body a tracker may be worn; camera, keyboard and what is held are no part of one."""
_SERIAL = re.compile(r"LH[RB]-[0-9A-Z]{6,12}")
LONGEST = 128
"""Characters of a serial number."""


@dataclass(frozen=True)
class Located:
    """Where a tracker is, as the runtime has it."""

    tracked: bool
    """Position and orientation are valid and tracked now; a held-over pose is not."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """x right, y up, -z forward [m]."""
    xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    """Space from tracker; OpenXR has w last."""


class Runtime(Protocol):
    """What is needed of a runtime."""

    def begin(self) -> None:
        """Begin a session, or raise `ProtocolError`."""

    def end(self) -> None:
        """End it."""

    def frame(self) -> bool:
        """Wait for the next instant; whether the origin was set anew since the last."""

    def trackers(self) -> Sequence[tuple[str, str]]:
        """Persistent path and role path (empty without a role) of every tracker that is connected."""

    def locate(self, path: str) -> Located:
        """Where the tracker of a role path or a persistent path is at that instant."""


class OpenXr:
    """An OpenXR runtime's trackers; open while used as a context.

    Args:
        runtime: Of `seerob.protocols.tracking.openxr_session`, or something with the same functions.
        clock: Monotonic time [s].
    """

    def __init__(self, runtime: Runtime, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._runtime, self._clock, self._epoch = runtime, clock, 0

    def __enter__(self) -> Self:
        """Begin.

        Raises:
            ProtocolError: The package is not installed, or the runtime has no trackers to offer.
        """
        self._runtime.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._runtime.end()

    def read(self) -> Devices:
        """All trackers now."""
        self._epoch += self._runtime.frame()
        connected = list(dict(self._runtime.trackers()).items())[:MOST_DEVICES]
        names = serials([path for path, _ in connected])
        worn = Counter(role for _, role in connected if role)
        devices = [
            # One pose for a role that two trackers have: nobody knows whose it is.
            _device(
                name, role, Located(tracked=False) if worn[role] > 1 else self._runtime.locate(role or path)
            )
            for name, (path, role) in zip(names, connected, strict=True)
        ]
        return Devices(self._clock(), tuple(devices), self._epoch)


def serials(paths: Sequence[str]) -> list[str]:
    """Names of trackers by their persistent paths: as OpenVR calls them where that can be read from them.

    Runtimes are free in what a persistent path is. SteamVR's ends in the serial number, so that
    ``trackers`` of the source need not change with the interface; any other name is the path's last part,
    and the whole path where that would name two alike.
    """
    found = [m[0] if (m := _SERIAL.search(path)) else path.rstrip("/").rpartition("/")[2] for path in paths]
    times = Counter(found)
    return [
        name if name and times[name] == 1 else path[-LONGEST:]
        for name, path in zip((n[:LONGEST] for n in found), paths, strict=True)
    ]


def _device(name: str, role: str, seen: Located) -> Device:
    x, y, z, w = seen.xyzw
    return device(
        name,
        plain_role(role),
        tracking=seen.tracked,
        result=RUNNING_OK,
        position=seen.position,
        wxyz=(w, x, y, z),
    )


TRACKERS = "XR_HTCX_vive_tracker_interaction"
HEADLESS = "XR_MND_headless"
PROFILE = "/interaction_profiles/htc/vive_tracker_htcx"
MOST_EVENTS = 256
"""Looked at between two frames."""
WAIT = 50
"""Looks for the session to begin, a tenth of a second apart."""


class OpenXrSession:
    """The runtime of this computer; a `seerob.protocols.tracking.openxr_session.Runtime`."""

    def __init__(self) -> None:
        self._xr: Any = None
        self._instance: Any = None
        self._session: Any = None
        self._base: Any = None
        self._actions: Any = None
        self._spaces: dict[str, Any] = {}
        self._running = False
        self._now: Any = 0

    def begin(self) -> None:
        """Begin a session.

        Raises:
            ProtocolError: The package is not installed, or the runtime is absent or cannot do it.
        """
        try:
            import xr  # type: ignore[import-not-found,unused-ignore]
        except ImportError as error:
            what = f'the package pyopenxr cannot be imported ({error}): pip install "seerob[openxr]"'
            raise ProtocolError(what) from error
        self._xr = xr
        try:
            self._create()
            self._begin()
        except ProtocolError:
            self.end()
            raise
        except Exception as error:  # its errors, and the loader's when there is no runtime at all
            self.end()
            what = f"the OpenXR runtime cannot be used: {type(error).__name__} {error}"
            raise ProtocolError(what) from error

    def end(self) -> None:
        """End it; whatever belongs to the instance goes with it."""
        if self._instance is not None:
            self._xr.destroy_instance(self._instance)
        self._instance = self._session = None
        self._spaces = {}

    def frame(self) -> bool:
        """Wait for the next instant; returns whether the origin was set anew since the last."""
        xr = self._xr
        anew = self._events()
        if not self._running:
            raise ProtocolError("the OpenXR runtime has ended the session")
        state = xr.wait_frame(self._session)
        xr.begin_frame(self._session)
        xr.end_frame(
            self._session,
            xr.FrameEndInfo(
                display_time=state.predicted_display_time,
                environment_blend_mode=xr.EnvironmentBlendMode.OPAQUE,
                layers=[],
            ),
        )
        self._now = state.predicted_display_time
        sets = (xr.ActiveActionSet * 1)(xr.ActiveActionSet(self._actions, xr.NULL_PATH))
        xr.sync_actions(
            self._session, xr.ActionsSyncInfo(count_active_action_sets=1, active_action_sets=sets)
        )
        return anew

    def trackers(self) -> Sequence[tuple[str, str]]:
        """List the persistent path and role path (empty without a role) of every connected tracker."""
        xr = self._xr
        return [
            (self._text(each.persistent_path), self._text(each.role_path))
            for each in xr.enumerate_vive_tracker_paths_htcx(self._instance)
        ]

    def locate(self, path: str) -> Located:
        """Tell where the tracker of a role path or a persistent path is at that instant."""
        space = self._spaces.get(path)
        if space is None:  # connected without a role after the session began: actions are fixed by then
            return Located(tracked=False)
        xr = self._xr
        found = xr.locate_space(space, self._base, self._now)
        flags = xr.SpaceLocationFlags
        wanted = (
            flags.POSITION_VALID_BIT
            | flags.ORIENTATION_VALID_BIT
            | flags.POSITION_TRACKED_BIT
            | flags.ORIENTATION_TRACKED_BIT
        )
        p, q = found.pose.position, found.pose.orientation
        return Located(found.location_flags & wanted == wanted, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))

    def _create(self) -> None:
        xr = self._xr
        offered = {_plain(each.extension_name) for each in xr.enumerate_instance_extension_properties()}
        lacking = [name for name in (TRACKERS, HEADLESS) if name not in offered]
        if lacking:
            what = f"the OpenXR runtime does not offer {', '.join(lacking)}"
            raise ProtocolError(f"{what}: with SteamVR leave --openxr out, OpenVR is asked then")
        self._instance = xr.create_instance(
            xr.InstanceCreateInfo(
                application_info=xr.ApplicationInfo(application_name="seerob"),
                enabled_extension_names=[TRACKERS, HEADLESS],
            )
        )
        system = xr.get_system(
            self._instance, xr.SystemGetInfo(form_factor=xr.FormFactor.HEAD_MOUNTED_DISPLAY)
        )
        self._session = xr.create_session(self._instance, xr.SessionCreateInfo(system_id=system))
        self._base = xr.create_reference_space(
            self._session, xr.ReferenceSpaceCreateInfo(reference_space_type=xr.ReferenceSpaceType.STAGE)
        )
        self._actions = xr.create_action_set(
            self._instance,
            xr.ActionSetCreateInfo(action_set_name="trackers", localized_action_set_name="Trackers"),
        )

    def _begin(self) -> None:
        """Fix the actions (roles, and who is connected without one), and wait until the session runs."""
        import time

        xr = self._xr
        names = dict.fromkeys((*ROLES, *(path for path, role in self.trackers() if not role)))
        paths = {name: xr.string_to_path(self._instance, name) for name in names}
        among = (xr.Path * len(paths))(*paths.values())
        action = xr.create_action(
            self._actions,
            xr.ActionCreateInfo(
                action_name="pose",
                action_type=xr.ActionType.POSE_INPUT,
                count_subaction_paths=len(paths),
                subaction_paths=among,
                localized_action_name="Pose",
            ),
        )
        suggested = [
            xr.ActionSuggestedBinding(action, xr.string_to_path(self._instance, f"{name}/input/grip/pose"))
            for name in names
        ]
        xr.suggest_interaction_profile_bindings(
            self._instance,
            xr.InteractionProfileSuggestedBinding(
                interaction_profile=xr.string_to_path(self._instance, PROFILE),
                count_suggested_bindings=len(suggested),
                suggested_bindings=(xr.ActionSuggestedBinding * len(suggested))(*suggested),
            ),
        )
        sets = (xr.ActionSet * 1)(self._actions)
        xr.attach_session_action_sets(
            self._session, xr.SessionActionSetsAttachInfo(count_action_sets=1, action_sets=sets)
        )
        self._spaces = {
            name: xr.create_action_space(
                self._session, xr.ActionSpaceCreateInfo(action=action, subaction_path=path)
            )
            for name, path in paths.items()
        }
        for _ in range(WAIT):
            self._events()
            if self._running:
                return
            time.sleep(0.1)
        raise ProtocolError("the OpenXR runtime does not begin the session: is a headset or tracker on?")

    def _events(self) -> bool:
        """Follow the session; whether the origin was set anew."""
        from ctypes import POINTER, byref, cast

        xr, anew = self._xr, False
        for _ in range(MOST_EVENTS):
            try:
                event = xr.poll_event(self._instance)
            except xr.EventUnavailable:
                return anew
            kind = xr.StructureType(event.type)
            if kind == xr.StructureType.EVENT_DATA_REFERENCE_SPACE_CHANGE_PENDING:
                anew = True
            elif kind == xr.StructureType.EVENT_DATA_INSTANCE_LOSS_PENDING:
                self._running = False
            elif kind == xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED:
                told = cast(byref(event), POINTER(xr.EventDataSessionStateChanged)).contents
                self._follow(xr.SessionState(told.state))
        return anew

    def _follow(self, state: Any) -> None:
        xr = self._xr
        if state == xr.SessionState.READY:
            kind = xr.ViewConfigurationType.PRIMARY_STEREO
            xr.begin_session(self._session, xr.SessionBeginInfo(kind))
            self._running = True
        elif state == xr.SessionState.STOPPING:
            self._running = False
            xr.end_session(self._session)
        elif state in (xr.SessionState.EXITING, xr.SessionState.LOSS_PENDING):
            self._running = False

    def _text(self, path: Any) -> str:
        return "" if path in (None, 0) else _plain(self._xr.path_to_string(self._instance, path))


def _plain(text: Any) -> str:
    return text.decode("utf-8", "replace").rstrip("\x00") if isinstance(text, bytes) else str(text)

"""Of whom the twin may be relied on at this tick, and who was asked for.

What cannot be relied on raises `Undecided` here, so that no accessor of `seerob.twin.state.State` and no
author of a criterion can forget it. Each reason is worked out once per tick.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import NotAsked, Undecided
from seerob.model.model import Model
from seerob.twin.attachments import Attachments
from seerob.twin.signals import Signals
from seerob.twin.validity.hearing import Hearing, bones_of, unobserved_reason
from seerob.workstation.variables import VARIABLE, Value

MOST = 4096
"""Sets of bodies of which it is kept whom they belong to."""

T = TypeVar("T")


class _Owners(NamedTuple):
    """Whom bodies belong to."""

    key: int
    others: tuple[str, ...]
    """Robots and machines."""
    people: dict[str, frozenset[str]]
    """Person → which bones."""
    everyone: frozenset[str]
    bodies: frozenset[int]
    rows: NDArray[np.int64]
    """The bodies, in the order in which they were asked for."""


class _Asking:
    """A context in which what would not raise `Undecided` is closed, without a generator at each question."""

    def __init__(self, of: Validity) -> None:
        self._of = of

    def __enter__(self) -> None:
        of = self._of
        of.asked.clear()
        of.speeds_asked.clear()
        of._closed = True

    def __exit__(self, *_: object) -> None:
        self._of._closed = False


class Validity:
    """What may be relied on at an instant.

    Args:
        model: The compiled workstation.
        hearings: What is known of each robot, person and machine.
        signals: What machines say.
    """

    def __init__(self, model: Model, hearings: dict[str, Hearing], signals: Signals | None = None) -> None:
        self._model = model
        self._author = ""
        """Name of the criterion of one's own that is asked; empty while none is."""
        self.t = 0.0
        """Run time [s]."""
        self.asked: set[str] = set()
        """Robots and humans that answers have depended on since the set was last cleared."""
        self.speeds_asked: set[str] = set()
        """Those of them of which speeds were asked, or what holds them."""
        self.attachments = Attachments(model)
        """Which of MuJoCo's bodies moves each body."""
        self.held: dict[str, tuple[str, ...]] = {}
        """Loose workpiece → hands and grippers that hold it."""
        self.lags: dict[str, float] = {}
        """How far each of those is from where it would be if it were fixed there [m]: any of its points."""
        self.left: dict[str, float] = {}
        """How far off others may be that a hand let go [m]: as far as that hand was, until one takes them."""
        self._hearings = hearings
        self._signals = signals or Signals(model.dictionary, {})
        self._closed = False
        self._asking = _Asking(self)
        self._cache: dict[str | tuple[Hashable, ...], Any] = {}
        engine = model.workstation.engine
        self._period = engine.tick
        limits = {"human": engine.human_tracking_limit}
        self._tracking_limits = {
            m.name: limits.get(m.role, engine.tracking_limit) for m in model.mechanisms.values()
        }
        self._owners_of: dict[tuple[int, ...], _Owners] = {}
        self._owners_last: dict[int, tuple[tuple[int, ...], _Owners]] = {}
        """By the identity of bodies that were asked for, them and whom they belong to."""
        self._reasons: dict[tuple[str, str], str] = {}
        """By question and name, why something may not be relied on at this tick."""
        self._bones: dict[tuple[str, str], tuple[str, ...]] = {}
        """By question and person, bones that may not be relied on at this tick."""
        self._lost: dict[int, tuple[frozenset[str], tuple[int, ...]]] = {}
        self._relied_on: set[Hashable] = set()
        self._carriers: dict[str, tuple[str, ...]] = {}
        """By name, who it is and what carries it."""
        self._moved: dict[str, bool] = {}
        """By name, what `moved` says at this tick."""
        self._sound: frozenset[str] | None = None
        """Of whom nothing is in doubt at this tick: what is mostly everybody, and found out once."""

    @property
    def model(self) -> Model:
        """The compiled workstation; while a criterion of one's own is asked, a copy of its own."""
        return self._model.own_of(self._author) if self._author else self._model

    def heard(self) -> None:
        """Work every reason out again: what is known of robots, people and machines has changed."""
        self._reasons.clear()
        self._bones.clear()
        self._lost.clear()
        self._relied_on.clear()
        self._moved.clear()
        self._sound = None

    def moved(self, name: str) -> bool:
        """Whether anything tells how fast somebody is: a source of its own, or of what carries it.

        A single position does not. People and machines that no source moves stand; of a robot nobody knows.
        """
        found = self._moved.get(name)
        if found is None:
            carriers = self._carriers.get(name)
            if carriers is None:
                carriers = self._carriers[name] = (name, *self._model.carriers_of(name))
            every = [self._hearings[each] for each in carriers]
            found = self._model.mechanisms[name].role != "robot" or any(h.driven or h.heard for h in every)
            found = self._moved[name] = found and not any(hearing.once for hearing in every)
        return found

    def all_moved(self) -> bool:
        """Whether all are, as of `moved`: of whom each is driven, and not heard only once, none is asked."""
        every = self._hearings
        return all(h.driven and not h.once for h in every.values()) or all(map(self.moved, every))

    # -- what says nothing of whether it may be relied on is closed while a criterion is asked ----

    def asking(self) -> _Asking:
        """While a criterion is asked: what would not raise `Undecided` is closed, and `asked` is noted."""
        return self._asking

    def _open(self, what: str, instead: str) -> None:
        if self._closed:
            raise NotAsked(
                f"State.{what} does not say whether it may be relied on, so no criterion may read it; "
                f"ask State.{instead}, which raises Undecided where it may not"
            )

    @property
    def hearings(self) -> dict[str, Hearing]:
        """What is known of where robots and people really are."""
        self._open("hearings", "hearing(name)")
        return self._hearings

    @property
    def signals(self) -> Signals:
        """What machines say."""
        self._open("signals", "signal(name)")
        return self._signals

    # -- of robots, people, machines and variables ------------------------------------------

    def require(self, *names: str) -> None:
        """Raise `Undecided` unless each robot or human is where the twin shows it."""
        self.asked.update(names)
        if (self._sound or self._find_sound()).issuperset(names) or names in self._relied_on:
            return
        for name in names:
            if reason := self.invalid_reason(name):
                raise Undecided(reason)
        self._relied_on.add(names)

    def _once(self, question: str, name: str, find: Callable[[str], str]) -> str:
        key = question, name
        reason = self._reasons.get(key)
        if reason is None:
            reason = self._reasons[key] = find(name)
        return reason

    def invalid_reason(self, name: str) -> str:
        """Why a twin may not be where the real one is, all of it; empty when it may be relied on.

        After `VARIABLE`, the name of a variable: why it may not be relied on.
        """
        return self._once("where", name, self._invalid_reason)

    def _invalid_reason(self, name: str) -> str:
        if reason := self.input_reason(name):
            return reason
        if name.startswith(VARIABLE):
            return ""
        hearing = self._hearings[name]
        if not hearing.bones_heard:
            return ""
        if reason := unobserved_reason(name, hearing.unobserved(self.t)):
            return reason
        reason = hearing.unplaced_reason(self.t)
        return f"{name}: {reason}" if reason else ""

    def input_reason(self, name: str) -> str:
        """Why what was known a moment ago may not hold now, but for what no device ever saw; else empty."""
        return self._once("interrupted", name, self._input_reason)

    def _input_reason(self, name: str) -> str:
        if name.startswith(VARIABLE):
            return self._signals.at(name.removeprefix(VARIABLE), self.t).invalid_reason
        if reason := self.invalid_place_reason(name):
            return reason
        hearing = self._hearings[name]
        if not hearing.bones_heard:
            return ""
        parts = hearing.invalid_parts(self.t)
        reason = parts[0][0] if parts else hearing.displaced(self.t)
        return f"{name}: {reason}" if reason else ""

    def invalid_place_reason(self, name: str) -> str:
        """Why nothing of a robot or person may be relied on; doubt about single bones does not count."""
        return self._once("whole", name, self._invalid_place)

    def _invalid_place(self, name: str) -> str:
        hearing = self._hearings[name]
        if reason := self.invalid_source_reason(name):
            return reason
        if not self._off(name, hearing):
            return ""
        if hearing.reset_at > self.t - 2 * self._period:
            return f"{name}: the twin had to be put back to what was heard"
        why = " (a torque limit is reached)" if hearing.saturated else ""
        limit = self._tracking_limits[name]
        return f"{name}: the twin is off by {hearing.error:.3g} rad or m, more than {limit:g}{why}"

    def _off(self, name: str, hearing: Hearing) -> bool:
        """Whether the twin is not where it was heard to be, or was put back there just now."""
        return (
            hearing.reset_at > self.t - 2 * self._period or not hearing.error <= self._tracking_limits[name]
        )

    def invalid_source_reason(self, name: str) -> str:
        """Why what was heard may not be relied on, whether or not the twin follows it; empty when it may."""
        return self._once("heard", name, self._invalid_source)

    def _invalid_source(self, name: str) -> str:
        reason = self._hearings[name].invalid_reason(self.t)
        if reason:
            return f"{name}: {reason}"
        above = self._model.mechanisms[name].on
        if above:
            return self.invalid_place_reason(above)
        return next(filter(None, map(self._invalid_hand, self.held.get(name, ()))), "")

    def _invalid_hand(self, hand: str) -> str:
        """Why a hand may not be where the twin shows it, nor what it holds; empty when it may."""
        person, _, bone = hand.partition("/")
        lost = self.invalid_place_reason(person)
        return lost or (self.invalid_reason(person) if bone in self._invalid_bones(person) else "")

    def hearing(self, name: str, *, strayed: bool = False) -> Hearing:
        """What is known of where a robot or human really is, bone by bone of a person.

        Args:
            name: Of the robot or human.
            strayed: As in `require_bodies`.

        Raises:
            Undecided: Nothing of it may be relied on.
        """
        self.asked.add(name)
        sound = name in (self._sound or self._find_sound())
        reason = "" if sound else self.invalid_place_reason(name)
        if reason and not (strayed and reason == self.stray(name)):
            raise Undecided(reason)
        hearing = self._hearings[name]
        return hearing.copied() if self._author else hearing

    def late_reason(self, names: Collection[str]) -> str:
        """Why nobody knows how late one of some inputs is heard, a variable; empty where somebody does."""
        untimed = self._signals.untimed
        return next((why for name, why in untimed.items() if VARIABLE + name in names), "") if untimed else ""

    def signal(self, name: str) -> Value:
        """The value of a variable of the dictionary now, in SI.

        Raises:
            Undecided: It was not heard lately, its source calls it bad, or it cannot be.
        """
        self.asked.add(VARIABLE + name)
        return self._signals.value(name, self.t)

    # -- of people, bone by bone --------------------------------------------------------------

    def stray(self, name: str) -> str:
        """Why the twin of a person is elsewhere than the person was captured, when it is known by how much.

        Empty when it is not, or when where the person was captured is in doubt itself.
        """
        return "" if name in (self._sound or self._find_sound()) else self._once("stray", name, self._stray)

    def _stray(self, name: str) -> str:
        hearing = self._hearings[name]
        if (
            hearing.captured is None
            or hearing.error <= self._tracking_limits[name]
            or self.invalid_source_reason(name)
        ):
            return ""
        reason = self.invalid_place_reason(name)
        return reason if hearing.reset_at <= self.t - 2 * self._period else ""

    def strays(self, bodies: tuple[int, ...]) -> str:
        """`stray` of any of the people to whom bodies belong."""
        owners = self._owners(bodies)
        return (
            ""
            if owners.everyone <= (self._sound or self._find_sound())
            else next(filter(None, map(self.stray, owners.people)), "")
        )

    def invalid_bones(self, name: str) -> tuple[str, ...]:
        """Bones of a person that may not be where the twin shows them, when the others are.

        What is turned in doubt, and what nobody says the place of.

        Raises:
            Undecided: Nothing of the person may be relied on.
        """
        if reason := self.invalid_place_reason(name):
            raise Undecided(reason)
        return self._invalid_bones(name)

    def _invalid_bones(self, name: str) -> tuple[str, ...]:
        turned, key = self.invalid_orientations(name), ("placed", name)
        if key not in self._bones:
            unplaced = self._hearings[name].unplaced(self.t)
            self._bones[key] = tuple(dict.fromkeys((*turned, *unplaced))) if unplaced else turned
        return self._bones[key]

    def invalid_orientations(self, name: str) -> tuple[str, ...]:
        """Bones of a person that may not be turned as the twin shows them, when the others are.

        What is in doubt, and what no device sees and its neighbours do not tell: enough for whoever asks
        for angles between bones, and not where they are.

        Raises:
            Undecided: Nothing of the person may be relied on.
        """
        self.asked.add(name)
        if reason := self.invalid_source_reason(name):
            raise Undecided(reason)
        key = "turned", name
        if key not in self._bones:
            hearing = self._hearings[name]
            invalid = (bone for _, bones in hearing.invalid_parts(self.t) for bone in bones)
            self._bones[key] = tuple(dict.fromkeys((*invalid, *hearing.unobserved(self.t))))
        return self._bones[key]

    # -- of bodies ----------------------------------------------------------------------------

    def require_bodies(
        self, bodies: tuple[int, ...], *, allow_estimated: bool = False, strayed: bool = False
    ) -> None:
        """Raise `Undecided` unless these bodies are where the twin shows them: of a person, these bones only.

        Args:
            bodies: By index.
            allow_estimated: Whether bones that nobody sees will do where the file accepts them
                (``unseen_uncertainty``): whoever asks adds
                `seerob.twin.accuracy.tracking_error.TrackingError`.
            strayed: Whether people will do of whom the twin is elsewhere than they were captured, as a table
                or a robot stops it (`stray`): likewise.
        """
        self._relied_on_bodies(bodies, allow_estimated, strayed)

    def _relied_on_bodies(
        self, bodies: tuple[int, ...], allow_estimated: bool = False, strayed: bool = False
    ) -> _Owners:
        """Whom these bodies belong to, when `require_bodies` lets them pass."""
        owners = self._owners(bodies)
        self.asked |= owners.everyone
        if owners.everyone <= (self._sound or self._find_sound()) and not self.attachments.unknown:
            return owners
        key = owners.key, allow_estimated, strayed
        if key in self._relied_on:
            return owners
        self.require(*owners.others)
        if lost := self.attachments.unknown.keys() & owners.bodies:
            raise Undecided(self.attachments.unknown[min(lost)])
        for name, bones in owners.people.items():
            if (reason := self.invalid_place_reason(name)) and not (strayed and reason == self.stray(name)):
                raise Undecided(reason)
            if bones.isdisjoint(self._invalid_bones(name)):
                continue
            if (
                not allow_estimated
                or self._model.estimate_uncertainty.get(name) is None
                or self.input_reason(name)
            ):
                raise Undecided(self.invalid_reason(name))
        self._relied_on.add(key)
        return owners

    def invalid_bodies(self, bodies: tuple[int, ...]) -> tuple[int, ...]:
        """Bodies that are bones in doubt, of people whose other bones may be relied on."""
        owners = self._owners(bodies)
        if owners.everyone <= (self._sound or self._find_sound()):
            self.asked.update(owners.people)
            return ()
        if owners.key not in self._lost:
            known = frozenset(name for name in owners.people if not self.invalid_place_reason(name))
            lost = {f"{name}/{bone}" for name in known for bone in self.invalid_bones(name)}
            which = tuple(i for i in bodies if self._model.bodies[i].name in lost) if lost else ()
            self._lost[owners.key] = known, which
        known, which = self._lost[owners.key]
        self.asked |= known
        return which

    def _find_sound(self) -> frozenset[str]:
        """Robots, people and machines of whom nothing is in doubt at this tick."""
        if self._sound is None:
            # Nobody asked for them yet.
            asked, self.asked = self.asked, set()
            self._sound = frozenset(filter(self._is_sound, self._hearings))
            self.asked = asked
        return self._sound

    def invalid_names(self) -> tuple[str, ...]:
        """Robots, people and machines of whom anything is in doubt at this tick."""
        sound = self._find_sound()
        if len(sound) == len(self._hearings):
            return ()
        return tuple(name for name in self._hearings if name not in sound)

    def _is_sound(self, name: str) -> bool:
        hearing = self._hearings[name]
        if self._off(name, hearing) or self.invalid_source_reason(name):
            return False
        # Of whom nothing is heard bone by bone there is no other reason.
        if not hearing.bones_heard:
            return True
        return not self.invalid_reason(name) and not self._invalid_bones(name)

    def _owners(self, bodies: tuple[int, ...]) -> _Owners:
        last = self._owners_last.get(id(bodies))
        if last is not None and last[0] is bodies:  # to look up a set of many takes its hash
            return last[1]
        found = self._owners_of.get(bodies)
        if found is None:
            if len(self._owners_of) == MOST:
                self._owners_of.clear()
                self._owners_last.clear()
                self.heard()
            others, people = bones_of(self._model, bodies)
            everyone = frozenset((*others, *people))
            found = _Owners(
                len(self._owners_of), others, people, everyone, frozenset(bodies), np.array(bodies, np.int64)
            )
            self._owners_of[bodies] = found
        if len(self._owners_last) == MOST:
            self._owners_last.clear()
        self._owners_last[id(bodies)] = bodies, found
        return found

    # -- what follows from it -------------------------------------------------------------------

    def once(self, key: tuple[Hashable, ...], make: Callable[[], T]) -> T:
        """What several criteria work out from this state: made by whoever asks first at this tick.

        Args:
            key: A tuple that begins with what it is, and names all that it depends on but the state.
            make: How to.
        """
        kept = self._cache.get(key)
        if kept is None:
            before, self.asked, self.speeds_asked = (self.asked, self.speeds_asked), set(), set()
            try:
                kept = self._cache[key] = make(), self.asked, self.speeds_asked
            finally:
                names, speeds = self.asked, self.speeds_asked
                self.asked, self.speeds_asked = before
                self.asked |= names
                self.speeds_asked |= speeds
        else:
            self.asked |= kept[1]
            self.speeds_asked |= kept[2]
        found: T = kept[0]
        return found

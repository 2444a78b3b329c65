"""Parts of people: criteria where a device sees only some of them, and how the nearest one is called.

An estimate never makes a verdict green. A bone that no device sees, and that the bones beside it do not tell,
may be elsewhere. What the bones that are seen exceed by themselves is exceeded; everything else is undecided,
unless the file accepts the estimate and says how far it may be off (``unseen_uncertainty``): then that is in
the interval.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec.structs import replace

from seerob.core.snapshot import Result, Verdict
from seerob.core.transforms import Array
from seerob.criteria.criterion import Evaluate
from seerob.description.humans.body_areas import AREAS, Borders, words
from seerob.description.humans.skeleton import BONES
from seerob.model.model import Gap, Model
from seerob.model.mounting.overrides import size
from seerob.twin.state import State

MOST = 16
"""Sets of bones for which a question is kept."""


def seen_first(
    bodies: tuple[int, ...],
    judge: Evaluate,
    without: Callable[[tuple[int, ...]], Evaluate | None],
) -> Evaluate:
    """Ask about what is known first: the worst that is known is enough for exceeded, never for within.

    Args:
        bodies: That the question is about, by index.
        judge: The whole question; undecided while bones are in doubt, unless the file accepts estimates.
        without: Makes the question about the rest of the bodies; None when nothing of it is left.
    """
    parts: dict[tuple[int, ...], Evaluate | None] = {}

    def evaluate(state: State) -> Result:
        lost = state.invalid_bodies(bodies)
        if not lost:
            return judge(state)
        if lost not in parts:
            if len(parts) == MOST:
                del parts[next(iter(parts))]
            parts[lost] = without(lost)
        part = parts[lost]
        if part is not None:
            result = part(state)
            if result.verdict is Verdict.EXCEEDED:
                names = [state.model.bodies[i].name for i in lost]
                shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
                return replace(result, reason=f"{result.reason}; without {shown}, which may be elsewhere")
        return judge(state)

    return evaluate


def partly_seen(model: Model, gap: Gap, bind: Callable[[Gap], Evaluate]) -> Evaluate:
    """Judge a gap of which bones may be elsewhere: the worst that is known is enough for exceeded.

    Args:
        model: The compiled workstation.
        gap: Between the two sets of bodies.
        bind: Makes the criterion for a part of the gap. It asks for distances with ``allow_estimated`` and
            widens them by `seerob.twin.accuracy.tracking_error.TrackingError`.
    """

    def without(lost: tuple[int, ...]) -> Evaluate | None:
        a, b = (tuple(i for i in side if i not in lost) for side in (gap.a, gap.b))
        return bind(model.gap(a, b)) if a and b else None

    return seen_first(gap.bodies, bind(gap), without)


class BodyPlaces:
    """The bones of all people of a workstation, bound once."""

    def __init__(self, model: Model) -> None:
        people = {human.name: human for human in model.workstation.humans}
        self._names = [each.name for each in model.bodies]
        self._bones: dict[int, tuple[Borders, bool]] = {}
        """Body that is a bone → its borders, and whether it is on the side of the dominant hand."""
        for index, each in enumerate(model.bodies):
            person, _, bone = each.name.rpartition("/")
            if each.role == "human" and person in people and bone in BONES:
                hand = people[person].hand
                borders = Borders(bone, body=size(people[person]), hand=hand)
                self._bones[index] = borders, bone.startswith(f"{hand}_")
        self._words: dict[tuple[int, str | None, bool, int], str] = {}

    def named(self, state: State, index: int, point: Array) -> str:
        """Name of a body, with the area that a point of it is in when it is a person's bone.

        Args:
            state: The twin.
            index: Of the body.
            point: On its surface, in the world [m], shape (3,).
        """
        bone = self._bones.get(index)
        if bone is None:
            return self._names[index]
        borders, dominant = bone
        x, y, z = state.in_body(index, point, allow_estimated=True, strayed=True)
        number, region, front = borders.area(x, y, z), borders.region(x, y, z), borders.in_front(x, y, z)
        key = index, region, front, number
        named = self._words.get(key)
        if named is None:
            area = AREAS[number - 1].name if number else None
            named = words(self._names[index], region, front=front, dominant=dominant, area=area)
            self._words[key] = named
        return named

"""Which body area of ISO/TS 15066 the nearest point of a person is in, for what a distance says of itself."""

from __future__ import annotations

from seerob.core.transforms import Array
from seerob.description.humans.body_areas import body_area, in_front, words
from seerob.description.humans.skeleton import BONES
from seerob.description.humans.skin import body_region
from seerob.model.model import Model
from seerob.model.mounting.overrides import size
from seerob.twin.state import State


class BodyPlaces:
    """The bones of all people of a workstation, bound once."""

    def __init__(self, model: Model) -> None:
        people = {human.name: human for human in model.workstation.humans}
        self._names = [each.name for each in model.bodies]
        self._bones: dict[int, tuple[str, str]] = {}
        """Body → person, bone."""
        for index, each in enumerate(model.bodies):
            person, _, bone = each.name.rpartition("/")
            if each.role == "human" and person in people and bone in BONES:
                self._bones[index] = person, bone
        self._words: dict[tuple[int, str | None, bool, str | None], str] = {}
        self._sizes = {name: size(human) for name, human in people.items()}
        self._hands = {name: human.hand for name, human in people.items()}

    def named(self, state: State, index: int, point: Array) -> str:
        """Name of a body, with the area that a point of it is in when it is a person's bone.

        Args:
            state: The twin.
            index: Of the body.
            point: On its surface, in the world [m], shape (3,).
        """
        if index not in self._bones:
            return self._names[index]
        named: str = state.once(("place", index, point.tobytes()), lambda: self._named(state, index, point))
        return named

    def _named(self, state: State, index: int, point: Array) -> str:
        person, bone = self._bones[index]
        body, hand = self._sizes[person], self._hands[person]
        local = state.in_body(index, point, allow_estimated=True, strayed=True)
        area = body_area(bone, local, body=body, hand=hand)
        region, front = body_region(bone, local, body=body), in_front(bone, local, body)
        key = index, region, front, None if area is None else area.name
        if key not in self._words:
            dominant = bone.startswith(f"{hand}_")
            self._words[key] = words(self._names[index], region, front=front, dominant=dominant, area=key[3])
        return self._words[key]

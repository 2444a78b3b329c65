"""What ergonomics rules ask of the twin: the anatomical angles of a person at this tick."""

from __future__ import annotations

from collections.abc import Callable, Collection

from seerob.core.errors import UnknownName
from seerob.description.humans.angles import Angles, angles
from seerob.description.humans.skeleton import BONES
from seerob.model.model import Mechanism, Model
from seerob.twin.state import State


def posture(state: State, human: Mechanism) -> Angles:
    """Angles of a person of the workstation, without batch dimensions.

    Raises:
        Undecided: The person was not heard lately, or does not follow what was heard.
    """
    state.require(human.name)
    rows = bone_rows(state.model, human)
    R, x = state.placed(tuple(rows))
    return angles(R[rows], x[rows])


def bone_rows(model: Model, human: Mechanism) -> list[int]:
    """Slots of the person's bones in `State.rotations`, in the order of `BONES`."""
    slots = {model.bodies[i].name: i for i in human.bodies}
    return [slots[f"{human.name}/{bone}"] for bone in BONES]


def bind_posture(model: Model, name: str, unmeasured: Collection[str] = ()) -> Callable[[State], Angles]:
    """`posture` of one person with the names resolved, without what nobody measures.

    Args:
        model: The compiled workstation.
        name: Of the human.
        unmeasured: Bones whose orientation the source does not measure but fills in.

    Raises:
        UnknownName: No such human or bone.
    """
    human = model.human(name)
    for bone in unmeasured:
        if bone not in BONES:
            raise UnknownName("bone", bone, BONES)
    bones = tuple(bone_rows(model, human))

    def read(state: State) -> Angles:
        doubted = state.bones_turned_in_doubt(human.name)
        hearing = state.hearing(human.name, strayed=True)
        # How a hand is turned of which only the wrist is seen is a guess, too.
        doubted = (*doubted, *hearing.unaimed(state.t))
        # What was captured, not where a table or a robot stops the twin.
        found = angles(*state.captured(human.name, bones))
        # What devices see changes with time: of a leg that nobody sees no score is made.
        lost = (*unmeasured, *doubted) if doubted else unmeasured
        found = found.without(lost) if lost else found
        untold = hearing.untold_angles(state.t)
        return found.untold(untold) if untold else found

    return read

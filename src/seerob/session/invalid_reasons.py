"""Who may be elsewhere than the twin shows, and why: for the picture, as criteria have their own answers."""

from __future__ import annotations

from seerob.twin.state import State
from seerob.twin.validity.hearing import nobody_says


def invalid_reasons(state: State) -> dict[str, str]:
    """Robots, people, machines and single bodies that may not be where the twin shows them, with the reason.

    A robot, a person or a machine stands for all that it moves (`Node.mover`). Of a person of whom only
    some bones are in doubt those are named, and what the person holds.
    """
    found: dict[str, str] = {}
    for name in state.model.mechanisms:
        if reason := state.invalid_place_reason(name):
            found[name] = reason
        elif reason := state.invalid_reason(name):
            hearing = state.hearings[name]
            found |= {f"{name}/{bone}": "no device sees it" for bone in hearing.unobserved(state.t)}
            unplaced = hearing.unplaced(state.t)
            found |= {f"{name}/{bone}": nobody_says(unplaced) for bone in unplaced}
            found |= {
                f"{name}/{bone}": why for why, bones in hearing.invalid_parts(state.t) for bone in bones
            }
            held = (body.name for body in state.model.bodies if body.mover == name and body.owner != name)
            found |= dict.fromkeys(held, reason)
    return found | {state.model.bodies[i].name: why for i, why in state.attachments.unknown.items()}

"""``seerob explain``: whether the model explains the torques of a log; which payload and friction would."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from seerob.app.console.loading import compiled
from seerob.app.console.terminal import OUT, Exit, add_workstation, allowed, line
from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.session.explanation import Explanation, Figure, JointExplained

HELP = "compare measured joint torques of a log with the model: residuals, payload and friction that fit"
EXAMPLE = "seerob explain my_cell"
WORDS = {True: "explained", False: "NOT EXPLAINED", None: "undecided"}
STYLES = {True: "cyan", False: "bold red", None: "yellow"}


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_workstation(sub)
    sub.add_argument("--robot", help="whose log; all whose sources measure torques when not given")
    sub.add_argument("--json", action="store_true", help="figures as JSON on standard output")


def run(options: argparse.Namespace) -> int:
    """Open the sources, compare, fit, and tell."""
    station = compiled(options.workstation, allowed(options))
    found = []
    if options.robot is not None:
        found.append(station.explain(options.robot))
    else:
        refused: list[InputError] = []
        for robot in station.workstation.robots:
            try:
                found.append(station.explain(robot.name))
            except InputError as error:
                refused.append(error)
        if not found:
            raise InputError(problem for error in refused for problem in error.problems)
    if options.json:
        OUT.print_json(data=[figures(one) for one in found])
    else:
        for one in found:
            tell(one)
    codes = {True: Exit.WITHIN, False: Exit.EXCEEDED, None: Exit.UNDECIDED}
    order = (Exit.EXCEEDED, Exit.UNDECIDED, Exit.WITHIN)
    said = {codes[one.explains] for one in found}
    return next(code for code in order if code in said)


def tell(found: Explanation) -> None:
    """What was found, one line each."""
    text = f"{found.source}, {found.samples} samples, joints move in {found.moving}"
    line("log", f"{found.robot}: {text}; condition {found.condition:.3g}")
    for joint in found.joints:
        line("joint", f"{joint.name}: {_joint(joint)}")
    line("payload", _payload(found))
    line("delay", _delay(found))
    line(WORDS[found.explains], sentence(found), STYLES[found.explains])


def _joint(joint: JointExplained) -> str:
    unit = joint.unit
    text = f"residual mean {joint.mean:.3g}, RMS {joint.rms:.3g}, largest {joint.largest:.3g} {unit}"
    if not joint.moves:
        return f"{text}; it does not move: friction is not told; leaves {joint.left:.3g} {unit}"
    per = f"{unit}·s/{'rad' if unit == 'N·m' else 'm'}"
    return (
        f"{text}; Coulomb {joint.coulomb} {unit}, viscous {joint.viscous} {per}, offset {joint.offset} {unit}"
        f": leaves {joint.left:.3g} {unit}, {joint.asked:.3g} {unit} may be left"
    )


def _payload(found: Explanation) -> str:
    text = f"{found.payload} kg beside the {found.carried:.4g} kg that the file has on the flange"
    if all(figure.determined for figure in found.com):
        place = ", ".join(f"{1e3 * f.value:.0f} ± {1e3 * f.half:.1g}" for f in found.com)
        text += f", its centre at [{place}] mm of the flange"
    return text


def _delay(found: Explanation) -> str:
    if not found.delay.determined:
        return "this motion does not tell whether torques come when the motion does that needs them"
    ms = f"{1e3 * found.delay.value:.3g} ± {1e3 * found.delay.half:.2g} ms"
    return f"torques come {ms} after the motion that needs them, which is taken out"


def sentence(found: Explanation) -> str:
    """The verdict in words."""
    slack = f"{found.slack:.2g} kg"
    if found.unexplained:
        return f"with friction and a payload fitted, too much is left at {', '.join(found.unexplained)}"
    if found.driven:
        return f"what friction would have to be is none, at {'; '.join(found.driven)}: check signs and zeros"
    low = abs(found.payload.value) - found.payload.half
    if found.misplaced and not low > found.slack:
        return (
            f"what is on the flange pulls at {', '.join(found.misplaced)} as the file does not have it: give "
            "the tools and workpieces their centres of mass"
        )
    if found.explains is False:
        return (
            f"the payload differs by {found.payload} kg, more than {slack}: give the tools and workpieces "
            "their masses, or mend the masses of the links"
        )
    if found.held:
        return f"{', '.join(found.held)} stood, and friction or something else held it: move it"
    if found.explains is None:
        return f"this motion does not tell the payload to {slack}: turn the wrist, and move more joints"
    return f"the model of the file and friction explain the log, the payload to {slack}"


def figures(found: Explanation) -> dict[str, object]:
    """For JSON; null where the motion does not tell a figure."""
    return {
        "robot": found.robot,
        "source": found.source,
        "samples": found.samples,
        "moving": found.moving,
        "condition": found.condition,
        "explains": found.explains,
        "sentence": sentence(found),
        "payload [kg]": _figure(found.payload),
        "delay [s]": _figure(found.delay),
        "carried [kg]": found.carried,
        "centre [m]": [_figure(figure) for figure in found.com],
        "joints": [
            {
                "name": joint.name,
                "unit": joint.unit,
                "residual": {"mean": joint.mean, "rms": joint.rms, "largest": joint.largest},
                "coulomb": _figure(joint.coulomb),
                "viscous": _figure(joint.viscous),
                "offset": _figure(joint.offset),
                "moves": joint.moves,
                "left": joint.left,
                "may be left": joint.asked,
            }
            for joint in found.joints
        ],
    }


def _figure(figure: Figure) -> dict[str, float] | None:
    return {"value": figure.value, "half": figure.half} if figure.determined else None

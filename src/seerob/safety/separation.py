r"""Protective separation distance, [Weistroffer2022]_ Eq. 2; ISO/TS 15066:2016 5.5.4.2.3."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec import Meta, Struct

from seerob import provenance
from seerob.criterion import Criterion, Evaluate, judge
from seerob.errors import InputError
from seerob.model import Model
from seerob.snapshot import Basis, Input, Origin, Result, Segment, Verdict
from seerob.state import State
from seerob.transforms import Array

WALKING = 1.6
"""Speed of a person whose speed is not monitored [m/s], ISO/TS 15066:2016 5.5.4.2.3 (ISO 13855)."""


def separation_bound(v_r: Array, v_h: float, T_r: float, T_s: float, xi: float) -> Array:
    r"""Upper bound of the protective separation distance, Eq. 2.

    :math:`S_p \le v_r (T_r + T_s) + v_h (T_r + T_s) + \xi`.

    Args:
        v_r: Speed of the hazardous part [m/s], shape (...); not below 0.
        v_h: Speed of the person [m/s].
        T_r: Reaction time [s].
        T_s: Stopping time [s].
        xi: Intrusion distance and position uncertainties, C + Z_d + Z_r [m].

    Returns:
        S_p [m], shape (...).
    """
    return (np.maximum(v_r, 0.0) + v_h) * (T_r + T_s) + xi


class Stop(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the robot stops."""

    reaction: Annotated[float, Meta(gt=0, extra={"unit": "s"})]
    """T_r: from the event to the onset of braking, detection and processing included [s]."""
    stopping: Annotated[float, Meta(gt=0, extra={"unit": "s"})]
    """T_s: from the onset of braking to standstill [s]."""
    model: Literal["bound"] = "bound"
    """``bound``: full speed during the whole stop, Eq. 2."""


class Separation(Criterion, frozen=True, kw_only=True):
    """Speed and separation monitoring: every moving part of the robot against every part of the person."""

    unit: ClassVar[str] = "m"
    at_most: ClassVar[bool] = False

    between: tuple[str, str]
    """A robot and a human."""
    stop: Stop
    human_speed: Annotated[float, Meta(gt=0, extra={"unit": "m/s"})] = WALKING
    """v_h [m/s]; 1.6 m/s is the norm's value for a person whose speed is not monitored."""
    intrusion: Annotated[float, Meta(ge=0, extra={"unit": "m"})] | None = None
    """C: how far a person may reach in before being detected [m], ISO 13855."""
    human_uncertainty: Annotated[float, Meta(ge=0, extra={"unit": "m"})] | None = None
    """Z_d: uncertainty of the person's position [m]."""
    robot_uncertainty: Annotated[float, Meta(ge=0, extra={"unit": "m"})] | None = None
    """Z_r: uncertainty of the robot's position [m]."""

    def subjects(self) -> tuple[str, ...]:
        """The robot and the human."""
        return self.between

    def _missing(self) -> list[str]:
        named = {
            "intrusion (C)": self.intrusion,
            "human_uncertainty (Z_d)": self.human_uncertainty,
            "robot_uncertainty (Z_r)": self.robot_uncertainty,
        }
        return [name for name, value in named.items() if value is None]

    def _sides(self, model: Model) -> tuple[str, str]:
        """Robot and human, in that order."""
        roles = {name: model.mechanism(name).role for name in self.between}
        if sorted(roles.values()) != ["human", "robot"]:
            raise InputError.at(
                self.name, "between", f"{list(self.between)} are not a robot and a human", "name one of each"
            )
        first, second = self.between
        return (first, second) if roles[first] == "robot" else (second, first)

    def bind(self, model: Model) -> Evaluate:
        """See `Criterion.bind`."""
        robot_name, human_name = self._sides(model)
        robot = model.robot(robot_name)
        gap = model.gap(model.select(human_name), robot.moving)
        known = [x for x in (self.intrusion, self.human_uncertainty, self.robot_uncertainty) if x is not None]
        xi = sum(known) + gap.deviation
        missing = self._missing()
        unknown = "" if not missing else f"not given: {', '.join(missing)}; S_p is at least the figure shown"
        T_r, T_s = self.stop.reaction, self.stop.stopping

        def evaluate(state: State) -> Result:
            found = state.closest_per_body(gap)
            v_r = np.array([state.fastest_point(i)[0] for i in gap.b])
            S_p = separation_bound(v_r, self.human_speed, T_r, T_s, xi)
            margins = found.distance - S_p
            parts = []
            for i, body in enumerate(gap.b):
                verdict = self._verdict(float(found.distance[i]), float(S_p[i]), bool(missing))
                parts.append(
                    Result(
                        name=model.bodies[body].name,
                        value=float(found.distance[i]),
                        unit="m",
                        limit=float(S_p[i]),
                        at_most=False,
                        verdict=verdict,
                        reason=model.bodies[int(found.body_a[i])].name,
                    )
                )
            k = int(margins.argmin())
            verdict = parts[k].verdict
            segment = Segment(
                start=tuple(found.point_b[k].tolist()),
                end=tuple(found.point_a[k].tolist()),
                label=f"{found.distance[k]:.2f} m, S_p {S_p[k]:.2f} m",
                verdict=verdict,
            )
            where = f"{parts[k].name} ↔ {parts[k].reason}"
            return Result(
                name=self.name,
                value=float(found.distance[k]),
                unit=self.unit,
                limit=float(S_p[k]),
                at_most=False,
                verdict=verdict,
                reason=f"{where}: {unknown}" if verdict is Verdict.UNDECIDED else where,
                parts=tuple(parts),
                markers=(segment,),
            )

        return evaluate

    @staticmethod
    def _verdict(distance: float, S_p: float, incomplete: bool) -> Verdict | None:
        """Below an incomplete S_p is EXCEEDED all the same; above it nothing follows."""
        verdict = judge(distance, S_p, at_most=False)
        return Verdict.UNDECIDED if incomplete and verdict is Verdict.WITHIN else verdict

    def basis(self, model: Model) -> Basis:
        """See `Criterion.basis`."""
        robot, human = self._sides(model)
        gap = model.gap(model.select(human), model.robot(robot).moving)
        walking = self.human_speed == WALKING
        inputs = [
            *provenance.motion(model, robot, human),
            *provenance.shapes(gap),
            provenance.given("T_r", self.stop.reaction, "s"),
            provenance.given("T_s", self.stop.stopping, "s"),
            Input(
                name="v_h",
                value=self.human_speed,
                unit="m/s",
                origin=Origin.STATED if walking else Origin.GIVEN,
                source="ISO/TS 15066:2016 5.5.4.2.3, from public sources that agree (2S)"
                if walking
                else "workstation file",
            ),
        ]
        for name, value in (
            ("C", self.intrusion),
            ("Z_d", self.human_uncertainty),
            ("Z_r", self.robot_uncertainty),
        ):
            inputs.append(
                Input(name=name, unit="m", origin=Origin.MISSING)
                if value is None
                else provenance.given(name, value, "m")
            )
        return Basis(
            formula="S_p = (v_r + v_h)(T_r + T_s) + C + Z_d + Z_r; the distance must not fall below it",
            source="Weistroffer et al. 2022, Eq. 2 (upper bound of ISO/TS 15066:2016 5.5.4.2.3; "
            "structure from public sources that agree, no licensed text was opened)",
            inputs=tuple(inputs),
            not_modelled=(
                "deceleration during the stop: full speed is assumed until standstill",
                "direction: the speed counts in full, also of parts that move away",
                "a person whose own speed exceeds v_h",
            ),
        )

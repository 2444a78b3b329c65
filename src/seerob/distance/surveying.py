"""What is asked of the distances at every tick, in one compiled call.

Criteria ask for distances one by one and share pairs of bodies without knowing of each other. What was
asked at two ticks in a row is asked together from then on. The answers are functions of the poses
alone, so this saves time and changes nothing.
"""

from __future__ import annotations

from seerob.core.transforms import Array
from seerob.distance.least import Closest, Closests, Per, Query, Survey
from seerob.kernels.shapes import Shapes

Question = tuple[Query, Per]

PATIENCE = 256
"""Ticks after which what nobody asks any more is left out."""


class Surveyor:
    """Answers of one tick.

    Args:
        shapes: Of the model.
    """

    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes
        self._together: dict[Question, int] = {}
        """Questions that are asked together, and the tick when each was last asked for."""
        self._survey: Survey | None = None
        self._asked: dict[Question, None] = {}
        self._before: dict[Question, None] = {}
        self._tick = 0
        self._answers: dict[Question, Closests] = {}
        self._found: Closests | None = None
        """All answers of this tick that were asked together."""

    def forget(self) -> None:
        """The poses are others now."""
        self._answers.clear()
        self._found = None
        self._tick += 1
        new = [question for question in self._asked if question in self._before]
        idle = self._tick % PATIENCE == 0 and any(
            self._tick - last > PATIENCE for last in self._together.values()
        )
        if new or idle:
            self._together = {
                question: last for question, last in self._together.items() if self._tick - last <= PATIENCE
            }
            self._together |= dict.fromkeys(new, self._tick)
            questions = list(self._together)
            self._survey = Survey(self._shapes, questions) if len(questions) > 1 else None
        self._before, self._asked = self._asked, {}

    def closest(self, query: Query, rotations: Array, positions: Array) -> Closest:
        """Where two sets are nearest at this tick; see `Query`."""
        question = query, Per.SETS
        if self._survey is None or question not in self._together:
            return self.ask(query, Per.SETS, rotations, positions).at(0)
        self._together[question] = self._tick
        if self._found is None:
            self._found = self._survey.together(rotations, positions)
        return self._found.at(self._survey.columns[question].start)

    def ask(self, query: Query, per: Per, rotations: Array, positions: Array) -> Closests:
        """The answer to a question at this tick; see `Query`."""
        question = query, per
        found = self._answers.get(question)
        if question in self._together:
            self._together[question] = self._tick
            if found is None and self._survey is not None:
                if self._found is None:
                    self._found = self._survey.together(rotations, positions)
                found = self._found.of(self._survey.columns[question])
                self._answers[question] = found
                return found
        else:
            self._asked[question] = None
        if found is None:
            found = self._answers[question] = query.ask(rotations, positions, per)
        return found

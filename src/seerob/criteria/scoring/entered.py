"""A method of which everything is entered in the workstation file: the same at every instant of a run."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, cast

from seerob.criteria.criterion import Criterion
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.model.model import Model
from seerob.workstation.tables.task_phase import TaskPhase


class EnteredMethod(Criterion, frozen=True, kw_only=True):
    """Says of a person what follows from what is entered, whoever is seen."""

    instants: ClassVar[str] = "accepted: what is entered does not change during a run"
    adults: ClassVar[bool] = True
    whole: ClassVar[bool] = False

    human: str
    """Who is judged."""

    @abstractmethod
    def figure(self, model: Model) -> Figure:
        """What follows from what is entered; beside it what is said and drawn (`Shown`).

        Raises:
            InputError: The method does not apply to it.
            UnknownName: It names what does not exist.
        """

    def subjects(self) -> tuple[str, ...]:
        """The person."""
        return (self.human,)

    def depends(self, model: Model) -> tuple[str, ...]:
        """Nobody: all of it is entered."""
        return ()

    def compute(self, model: Model) -> Compute:
        """Work the figure out once and return the function that tells it.

        Raises:
            InputError: As of `figure`.
            UnknownName: Likewise, or there is no such person.
        """
        model.human(self.human)
        figure = self.figure(model)

        def compute(twin: Twin) -> Figure:
            return figure

        return compute

    def one_by_one(self, model: Model) -> str:
        """Nothing: it is the same at every instant."""
        return ""

    def present(self, model: Model) -> Present:
        """Return the function that says what stands beside the figure."""
        return lambda state, figure, verdict: cast("Shown", figure.beside)

    def titled_phases(self, model: Model) -> dict[str, TaskPhase]:
        """Phases of the person by title; of several of one title the first."""
        return {
            phase.title: phase
            for phase in reversed(model.workstation.phases)
            if phase.title and phase.human in ("", self.human)
        }

"""What a criterion or a rule is: options in, a function of `State` out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import wraps
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Protocol

from msgspec import Meta, Struct

from seerob.core.errors import UnknownName
from seerob.core.quantities import Seconds
from seerob.core.snapshot import Basis, Finding, Result
from seerob.criteria.figure import Compute, Present, Shown, answers_of, result_of, verdict_of

if TYPE_CHECKING:
    from seerob.core.transforms import Array
    from seerob.criteria.plan import Together, Whole
    from seerob.model.model import Model
    from seerob.recording.answers import Answers
    from seerob.twin.spans import Falls, Margin, Points, Span
    from seerob.twin.state import State
    from seerob.twin.states import Motion, States

Evaluate = Callable[["State"], Result]
"""Called at each tick (or each ``every``); may raise `Undecided`."""
Lowest = Callable[["State", "Span"], float]
"""Below its margin at every instant of a span, negative where that is not known, given the twin at one end of
the span; may raise `Undecided`."""


class Moment(NamedTuple):
    """What a limit follows from at an instant, one per part."""

    figure: Array
    """That a margin falls by as much as it rises, in the unit of the margin, shape (n,)."""
    beside: tuple[Array, ...] = ()
    """What else bounds its rise from then."""


class Follows(NamedTuple):
    """A limit that changes with the twin, apart from what is compared with it.

    What `Criterion.falls` says is then how far margins fall while the limit stays.
    """

    now: Callable[[State], Moment]
    """May raise `Undecided`."""
    most: Callable[[Span, Moment], Array]
    """The largest figure at any instant of a span, given that at its begin; infinity where nobody knows."""
    close: float
    """A rise that is no reason to look at more instants, in the unit of the margin."""
    keeps: bool
    """Whether the largest since a run began counts."""
    again: Callable[[], Evaluate]
    """Makes what judges an instant by the figure of that instant."""


class Claim(Protocol):
    """A figure that the file states: where a motion contradicts it, nothing that rests on it is WITHIN."""

    holds: tuple[str, ...]
    """Names of what rests on it."""

    def of_motion(self, motion: Motion, what: str = "") -> Finding | None:
        """What a motion that is known in advance contradicts; ``what``: where that is from."""

    def __call__(self, state: State) -> Finding | None:
        """What is seen to contradict it, asked at every tick; None for nothing."""


GIVEN_A_MODEL = {
    "compute", "present", "one_by_one", "bind", "batch", "remembers", "falls", "lowest", "bounded_once",
    "follows", "basis", "looks_ahead", "claims", "depends", "hits", "judged", "planned", "unshaped",
}  # fmt: skip
"""Methods of a criterion whose first argument is the model."""

EvaluateMany = Callable[["States"], "Answers"]
"""Called with many instants; may raise `Undecided`, of all of them."""
NOTHING_SHOWN = Shown()


class Criterion(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every safety criterion and ergonomics rule: one file, one class, one ``kind``.

    The fields are the table of the workstation file. The first line of the class's docstring is
    what `seerob kinds` and the report print.
    """

    unit: ClassVar[str] = ""
    """Unit of its results."""
    at_most: ClassVar[bool] = True
    """Whether its limit bounds from above."""
    by_torque: ClassVar[bool] = False
    """Whether it rests on torques that a source measured."""
    by_speed: ClassVar[bool] = False
    """Whether its interval holds how far speeds may be off that were derived from noisy positions
    (`State.speed_error`). Of any other that asks for such speeds the judge finds out what their errors change
    (`seerob.criteria.noisy_speeds`)."""
    by_shape: ClassVar[bool] = True
    """Whether it is about the shapes of its subjects, so that what no shape shows of a robot could make it
    worse; False only where no distance, area, volume or point of a surface is in it."""
    adults: ClassVar[bool] = False
    """Whether its limits and tables are of adults, so that nothing of a child or adolescent is within."""
    heavier_is_worse: ClassVar[bool] = False
    """Whether more mass of a robot is never better, so that what the known masses exceed is exceeded."""
    whole: ClassVar[bool] = True
    """Whether all that it depends on must be where the twin shows it before it is asked. One that judges
    people bone by bone, or for which what is known may suffice, says False: what it asks of must be still."""

    instants: ClassVar[str] = ""
    """``accepted: why`` of a method that speaks of instants by its nature: nothing need bound it between."""

    name: str = ""
    """What results are called; made from the kind and the subject when not given."""
    every: Seconds | None = None
    """Period [s]; each tick when not given."""
    between_samples: (
        Annotated[str, Meta(pattern="^accepted: .*[^ ]", description="`accepted: ` and why")] | None
    ) = None
    """``accepted: why``: that nobody knows what happens between the instants at which it is asked, where
    nothing bounds it, is accepted for the verdict of a run; it stays undecided there when not given."""
    active: str | None = None
    """Variable of the dictionary, a bool: while it is false, it is not asked (muted, another mode of
    operation); while nobody knows, it is undecided."""

    def __init_subclass__(cls) -> None:
        """Give methods of one's own kinds a model of their own: what they write into it is nobody else's."""
        super().__init_subclass__()
        if not cls.__module__.startswith("seerob."):
            for name in GIVEN_A_MODEL & vars(cls).keys():
                setattr(cls, name, _own_model(vars(cls)[name]))

    @classmethod
    def undefined(cls) -> str:
        """What a class leaves out for which no default may stand, and what to define; empty when nothing."""
        if next(base for base in cls.__mro__ if "unit" in vars(base)) is Criterion:
            return 'has no unit: define unit: ClassVar[str] = "m" or whatever its figures are in, "" for none'
        return ""

    def compute(self, model: Model) -> Compute:
        """Resolve every name once and return the function that computes the figure of an instant.

        What it says against the limit is decided by `seerob.criteria.figure`, for a run and for arrays.

        Raises:
            UnknownName: A robot, body or human that the workstation does not have.
            InputError: An option that cannot be, such as a negative limit.
        """
        raise NotImplementedError

    def present(self, model: Model) -> Present:
        """Return the function that says and draws what was computed of one instant."""
        return lambda state, figure, verdict: NOTHING_SHOWN

    def one_by_one(self, model: Model) -> str:
        """Why instants are computed one by one; empty where `compute` takes many at once, as arrays."""
        return "with these options it is not made for batches"

    def bind(self, model: Model) -> Evaluate:
        """Return the function that judges a state: by what `compute` says, unless it is given instead.

        Raises:
            UnknownName: As of `compute`.
            InputError: Likewise.
        """
        return self.judging(self.compute(model), self.present(model))

    def judging(self, compute: Compute, present: Present) -> Evaluate:
        """Return the function that judges what one function computes and another one shows."""
        same, at_most = Result(name=self.name, unit=self.unit, at_most=self.at_most), self.at_most

        def evaluate(state: State) -> Result:
            figure = compute(state)
            verdict = verdict_of(figure, at_most=at_most)
            return result_of(figure, verdict, present(state, figure, verdict), same)

        return evaluate

    def batch(self, model: Model) -> EvaluateMany | None:
        """Return the function that judges many states at once, where there is one.

        It depends on no instant but the one it speaks of, and says of it what that of `bind` says.
        """
        order = type(self).__mro__
        bound, computed = (
            next(i for i, kind in enumerate(order) if name in vars(kind)) for name in ("bind", "compute")
        )
        # A `bind` on top of somebody else's figures says more than these.
        if bound < computed or self.one_by_one(model):
            return None
        compute = self.compute(model)
        return lambda states: answers_of(compute(states), len(states), at_most=self.at_most)

    def hits(self, model: Model) -> tuple[tuple[int, ...], float, float] | None:
        """Bodies whose contacts it limits, from how near people [m] and how fast [m/s] on; None of none."""
        return None

    def planned(self, model: Model) -> Callable[[Sequence[Any], Model], Together | Whole] | None:
        """Return what computes it together with others where nothing of anybody is in doubt; mostly a class.

        It is called with all criteria of which this is given. None where each is asked alone.
        """
        return None

    def remembers(self, model: Model) -> bool:
        """Whether what it says depends on earlier instants: then it is asked in the order of time only."""
        return False

    def falls(self, model: Model, points: Points) -> Falls | None:
        """What bounds its margin between two instants at which it is asked; None where nothing does.

        Then the verdict of a run stays undecided, unless the file accepts that (`between_samples`).

        Args:
            model: The compiled workstation.
            points: Of which the motion is bounded: those of the bodies, and what it adds.
        """
        return None

    def lowest(self, model: Model, points: Points) -> Lowest | None:
        """Instead of `falls`: what bounds its margin within a span of which the twin at one end is given."""
        return None

    def bounded_once(self, model: Model) -> bool:
        """Whether what bounds it gets no sharper within parts of a span, so that none is looked at."""
        return False

    def follows(self, model: Model, points: Points) -> Follows | None:
        """What its limit follows from between instants, when that is bounded apart; see `Follows`."""
        return None

    def margin(self, result: Result) -> Margin:
        """How far a result that is within is from its limit, and how much of that its tolerances take.

        In its unit; in the order of what `falls` says, when that speaks of several figures.
        """
        assert result.value is not None
        assert result.limit is not None
        far = result.limit - result.value if result.at_most else result.value - result.limit
        if result.interval is None:
            return far, 0.0
        low, high = result.interval
        return far, (high - result.value if result.at_most else result.value - low)

    def basis(self, model: Model) -> Basis:
        """Formula, source and inputs of what `bind` computes."""
        raise NotImplementedError

    def looks_ahead(self, model: Model) -> Mapping[str, float]:
        """Name of a robot or person → how far ahead its recorded motion is asked [s], `State.foresee`."""
        return {}

    def claims(self, model: Model) -> Sequence[Claim]:
        """Figures of its own that the motion of its subjects can contradict."""
        return ()

    def variables(self) -> dict[str, str]:
        """Variables of the dictionary that it asks, and the SI unit that each must have, or ``bool``."""
        return {} if self.active is None else {self.active: "bool"}

    def subjects(self) -> tuple[str, ...]:
        """Names from the workstation file that this criterion speaks of."""
        return ()

    def depends(self, model: Model) -> tuple[str, ...]:
        """Names of all whose place or motion its results depend on; its subjects when not said."""
        return self.subjects()

    def judged(self, model: Model) -> set[int]:
        """Bodies whose motion or place it judges: who moves and is judged by nobody is a finding."""
        found: set[int] = set()
        for name in self.subjects():
            mechanism = model.mechanisms.get(name)
            if mechanism is not None and not self.by_shape:
                # Of what carries it only criteria speak that are about shapes.
                found |= {*mechanism.bodies, *mechanism.carried}
                continue
            with suppress(UnknownName):
                found |= set(model.select(name))
        return found

    def unshaped(self, model: Model) -> str:
        """Why nothing is within: what no shape shows of the robots that it speaks of; empty for nothing."""
        return model.unshaped(self.depends(model)) if self.by_shape else ""


def not_adult(model: Model, name: str) -> str:
    """Why tables of adults say nothing of a person; empty where they do."""
    if all(human.adult for human in model.workstation.humans if human.name == name):
        return ""
    return f"{name} is no adult: outside the tables of the method"


def _own_model(method: Callable[..., Any]) -> Callable[..., Any]:
    """A method of a criterion, given the copy of the model that is its own."""

    @wraps(method)
    def of_its_own(self: Criterion, model: Model, *more: Any) -> Any:
        return method(self, model.own_of(self.name), *more)

    return of_its_own

"""Results as DataFrames and Arrow tables: one criterion a column, or one instant of one criterion a row.

Nothing is filled in: an instant at which a criterion was not asked has no verdict in a wide table and no row
in a long one, and a figure that there was not is missing. What all instants together come to is no column of
instants; it is ``form="criteria"``, and in the attributes of every table.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, UnknownName
from seerob.core.extras import need
from seerob.core.printable import printable
from seerob.core.snapshot import Snapshot, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import worst
from seerob.recording.series import CODES, NO_VERDICT, Series, Times

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

Form = Literal["wide", "long", "criteria", "parts", "rows", "aspects"]
"""Of a table of results:

``wide``: one row per instant; figure, limit and verdict of each criterion.
``long``: one row per instant and criterion, with its unit and reason.
``criteria``: one row per criterion: its verdict, its worst instant, how the time is divided.
``parts``: one row per instant, criterion and part of it (a link, a body area).
``rows``: one row per instant, criterion and place of a person's body, of a recording alone.
``aspects``: one row per figure behind such a row, such as an angle, of a recording alone.
"""

VERDICTS = ("no verdict", "within", "undecided", "exceeded")
"""Categories of verdicts, the worst last: the largest of some is what they come to together."""

_PLACE = np.full(256, -1, np.int8)
_PLACE[[NO_VERDICT, *(CODES[v] for v in (Verdict.WITHIN, Verdict.UNDECIDED, Verdict.EXCEEDED))]] = range(4)


class CriterionSeries(NamedTuple):
    """What one criterion, or a part of one, said of N instants."""

    name: str
    unit: str
    at_most: bool
    verdict: Verdict | None
    """Of all of them, and of the time between."""
    t: Array
    """[s], shape (N,)."""
    values: Array
    """In ``unit``, shape (N,); NaN where there was none."""
    limits: Array
    """In ``unit``, shape (N,); NaN where there was none."""
    codes: NDArray[np.uint8]
    """Verdicts as in `seerob.recording.series.CODES`, shape (N,)."""
    reasons: Sequence[str]
    """Why undecided, or what governs, N of them."""
    times: Times | None = None
    """How a run is divided; None where instants are no run."""
    why: str = ""
    """Why what was within at every instant is not within; empty where it is."""


def criterion_series(series: Series) -> CriterionSeries:
    """What a series holds by now, all of it of one moment."""
    rows, texts = series.instants()
    return CriterionSeries(
        name=series.name,
        unit=series.unit,
        at_most=series.at_most,
        verdict=series.verdict,
        t=rows["t"],
        values=rows["value"],
        limits=rows["limit"],
        codes=rows["verdict"],
        reasons=[texts[code] for code in rows["reason"].tolist()],
        times=series.times(),
        why=series.gap(),
    )


class _Words(NamedTuple):
    """A column of words that repeat: number of each in ``categories``, -1 where there is none."""

    codes: NDArray[np.integer[Any]]
    categories: Sequence[str]
    ordered: bool = False


def _words(texts: Sequence[str]) -> _Words:
    number: dict[str, int] = {}
    codes = np.array([number.setdefault(text, len(number)) for text in texts], np.int32)
    return _Words(codes, tuple(number))


def _repeated(texts: Sequence[str], times: Sequence[int]) -> _Words:
    """Each text as often as asked."""
    once = _words(texts)
    return _Words(np.repeat(once.codes, times), once.categories)


def verdicts(codes: NDArray[np.uint8]) -> _Words:
    """A column of verdicts."""
    return _Words(_PLACE[codes], VERDICTS, ordered=True)


def _verdict_words(found: Iterable[Verdict | None]) -> _Words:
    return verdicts(np.array([CODES[verdict] for verdict in found], np.uint8))


_Column = Array | _Words | NDArray[np.bool_] | NDArray[np.int64]


@dataclass(frozen=True)
class Table:
    """Columns by name, each of N, before it is one of pandas or of Arrow."""

    columns: Mapping[str, _Column]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    groups: Mapping[str, Mapping[str, _Column]] = field(default_factory=dict)
    """Of a wide table: per criterion its columns."""
    index: str = ""
    """The column that names a row; empty where rows have none."""

    def to_pandas(self) -> pd.DataFrame:
        """Make a DataFrame, in which verdicts are ordered categories (`VERDICTS`)."""
        need("pandas")
        import pandas as pd

        found: dict[Any, Any] = {
            name: _pandas(column) for name, column in self.columns.items() if name != self.index
        }
        if self.groups:
            fields = dict.fromkeys(key for group in self.groups.values() for key in group)
            found = {
                (key, name): _pandas(group[key]) for key in fields for name, group in self.groups.items()
            }
        index = None
        if self.index:
            index = pd.Index(_pandas(self.columns[self.index]), name=self.index)
        frame = pd.DataFrame(found, index=index)
        if self.groups:
            frame.columns = pd.MultiIndex.from_tuples(list(found), names=["field", "criterion"])
        frame.attrs.update(self.attributes)
        return frame

    def to_arrow(self) -> pa.Table:
        """Make an Arrow table: what is missing is null, attributes are JSON in its metadata."""
        need("pyarrow")
        import pyarrow as pa

        arrays = {name: _arrow(column) for name, column in self.columns.items()}
        fields = [pa.field(name, array.type) for name, array in arrays.items()]
        about = self.attributes.get("criteria", {})
        for name, group in self.groups.items():
            if name in arrays:
                what = f"is the name of a criterion and of the column of {'times' if name == 't' else name}"
                raise InputError.at("results", name, what, 'rename the criterion, or ask form="long"')
            inner = {key: _arrow(column) for key, column in group.items()}
            arrays[name] = pa.StructArray.from_arrays(list(inner.values()), names=list(inner))
            said = {key: json.dumps(value) for key, value in about.get(name, {}).items()}
            fields.append(pa.field(name, arrays[name].type, metadata=said))
        metadata = {"seerob": json.dumps(self.attributes, ensure_ascii=False)}
        return pa.Table.from_arrays(list(arrays.values()), schema=pa.schema(fields, metadata=metadata))


def html(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table below its title for a notebook, every text escaped."""

    def cells(kind: str, texts: Iterable[str]) -> str:
        return "<tr>" + "".join(f"<{kind}>{escape(printable(text))}</{kind}>" for text in texts) + "</tr>"

    body = "".join(cells("td", row) for row in rows)
    top = f"<p>{escape(printable(title))}</p><table><thead>{cells('th', head)}</thead>"
    return f"<div>{top}<tbody>{body}</tbody></table></div>"


def _pandas(column: _Column) -> Any:
    import pandas as pd

    if isinstance(column, _Words):
        return pd.Categorical.from_codes(column.codes, list(column.categories), ordered=column.ordered)
    return column


def _arrow(column: _Column) -> Any:
    import pyarrow as pa

    if isinstance(column, _Words):
        return pa.DictionaryArray.from_arrays(
            pa.array(column.codes, mask=column.codes < 0),
            pa.array(list(column.categories), pa.string()),
            ordered=column.ordered,
        )
    return pa.array(column, from_pandas=column.dtype.kind == "f")


def _known(values: Iterable[float | None]) -> Array:
    return np.array([math.nan if value is None else value for value in values], float)


def table(
    form: Form,
    every: Sequence[CriterionSeries],
    *,
    parts: Mapping[str, Sequence[CriterionSeries]] | None = None,
    snapshots: Iterable[Snapshot] | None = None,
    criteria: Mapping[str, _Column] | None = None,
    attributes: Mapping[str, Any] | None = None,
) -> Table:
    """What was said, in one of its forms.

    Args:
        form: See `Form`.
        every: One per criterion, in their order.
        parts: Of each criterion that has some; None where none were kept.
        snapshots: What rows and aspects are in; None where none were kept.
        criteria: More columns of the form ``criteria``, one figure per criterion.
        attributes: More of the whole, which JSON can say.

    Raises:
        UnknownName: There is no such form, or none of these results.
    """
    have = ["wide", "long", "criteria"]
    have += ["parts"] * (parts is not None) + ["rows", "aspects"] * (snapshots is not None)
    if form not in have:
        raise UnknownName("form", form, have)
    said: dict[str, Any] = {
        "verdict": _name(worst([one.verdict for one in every])),
        "criteria": {one.name: _attributes(one) for one in every},
        "units": {"t": "s"},
        **(attributes or {}),
    }
    if form == "wide":
        return _wide(every, said)
    if form == "long":
        return Table(_long(every, [one.name for one in every]), said)
    if form == "criteria":
        return Table({**_criteria(every), **(criteria or {})}, said, index="criterion")
    if form == "parts":
        pairs = [(name, part) for name, own in (parts or {}).items() for part in own]
        named = _long([part for _, part in pairs], [name for name, _ in pairs])
        sizes = [len(part.t) for _, part in pairs]
        columns = dict(named)
        head = {key: columns.pop(key) for key in ("t", "criterion")}
        return Table({**head, "part": _repeated([p.name for _, p in pairs], sizes), **columns}, said)
    return Table((_rows if form == "rows" else _aspects)(snapshots or ()), said)


def _name(verdict: Verdict | None) -> str:
    return VERDICTS[0] if verdict is None else verdict.value


def _attributes(one: CriterionSeries) -> dict[str, Any]:
    limits = np.unique(one.limits[~np.isnan(one.limits)])
    return {
        "unit": one.unit,
        # One that moves is a column.
        "limit": float(limits[0]) if len(limits) == 1 else None,
        "at_most": one.at_most,
        "verdict": _name(one.verdict),
        "why": one.why,
    }


def _wide(columns: Sequence[CriterionSeries], attributes: Mapping[str, Any]) -> Table:
    index = np.unique(np.concatenate([np.zeros(0), *(one.t for one in columns)]))
    groups: dict[str, dict[str, _Column]] = {}
    for one in columns:
        places = _PLACE[one.codes]
        # Of two that speak of one instant, the worse is written last.
        order = np.argsort(places, kind="stable")
        where = np.searchsorted(index, one.t[order])
        value, limit = np.full(len(index), math.nan), np.full(len(index), math.nan)
        verdict = np.full(len(index), -1, np.int8)
        value[where], limit[where], verdict[where] = one.values[order], one.limits[order], places[order]
        groups[one.name] = {"value": value, "limit": limit, "verdict": _Words(verdict, VERDICTS, True)}
    return Table({"t": index}, attributes, groups, index="t")


def _long(columns: Sequence[CriterionSeries], criteria: Sequence[str]) -> dict[str, _Column]:
    sizes = [len(one.t) for one in columns]
    none = np.zeros(0)
    return {
        "t": np.concatenate([none, *(one.t for one in columns)]),
        "criterion": _repeated(criteria, sizes),
        "value": np.concatenate([none, *(one.values for one in columns)]),
        "limit": np.concatenate([none, *(one.limits for one in columns)]),
        "unit": _repeated([one.unit for one in columns], sizes),
        "verdict": verdicts(np.concatenate([none.astype(np.uint8), *(one.codes for one in columns)])),
        "reason": _words([reason for one in columns for reason in one.reasons]),
    }


def _criteria(columns: Sequence[CriterionSeries]) -> dict[str, _Column]:
    found: dict[str, _Column] = {
        "criterion": _words([one.name for one in columns]),
        "verdict": _verdict_words([one.verdict for one in columns]),
        "unit": _words([one.unit for one in columns]),
        "at_most": np.array([one.at_most for one in columns], bool),
        "instants": np.array([len(one.t) for one in columns], np.int64),
        "why": _words([one.why for one in columns]),
    }
    for share in Times._fields if all(one.times is not None for one in columns) else ():
        found[f"share_{share}"] = _known(one.times and getattr(one.times, share) for one in columns)
    return found


def worst_columns(series: Sequence[Series]) -> dict[str, _Column]:
    """The worst instant of each, for the form ``criteria``; nothing where a series was never heard."""
    worsts = [one.worst() if one.known else None for one in series]
    ends = [(w and w.interval) or (None, None) for w in worsts]
    return {
        "worst_t": _known(w and w.t for w in worsts),
        "worst_value": _known(w and w.value for w in worsts),
        "worst_limit": _known(w and w.limit for w in worsts),
        "worst_low": _known(low for low, _ in ends),
        "worst_high": _known(high for _, high in ends),
        "worst_part": _words(["" if w is None else w.part for w in worsts]),
        "worst_reason": _words(["never gave a result" if w is None else w.reason for w in worsts]),
    }


def _places(snapshots: Iterable[Snapshot]) -> Iterator[tuple[float, str, Any]]:
    """Instant, criterion and row of each place; what a criterion with a period repeats is there once."""
    last: dict[str, tuple[float, Any]] = {}
    for snapshot in snapshots:
        for result in snapshot.results:
            if result.t is not None and last.get(result.name) == (result.t, result.rows):
                continue
            if result.t is not None:
                last[result.name] = result.t, result.rows
            for row in result.rows:
                yield snapshot.t, result.name, row


def _rows(snapshots: Iterable[Snapshot]) -> dict[str, _Column]:
    found = list(_places(snapshots))
    rows = [row for _, _, row in found]
    return {
        "t": np.array([t for t, _, _ in found], float),
        "criterion": _words([name for _, name, _ in found]),
        "place": _words([row.name for row in rows]),
        "group": _words([row.group for row in rows]),
        "side": _words([row.side for row in rows]),
        "state": _words([row.state.value for row in rows]),
        "value": _known(row.value for row in rows),
        "limit": _known(row.limit for row in rows),
        "unit": _words([row.unit for row in rows]),
        "best": _known(row.scale and row.scale[0] for row in rows),
        "worst": _known(row.scale and row.scale[1] for row in rows),
        "low": _known(row.interval and row.interval[0] for row in rows),
        "high": _known(row.interval and row.interval[1] for row in rows),
        "verdict": _verdict_words(row.verdict for row in rows),
        "reason": _words([row.reason for row in rows]),
    }


def _aspects(snapshots: Iterable[Snapshot]) -> dict[str, _Column]:
    found = [(t, name, row, aspect) for t, name, row in _places(snapshots) for aspect in row.aspects]
    aspects = [aspect for *_, aspect in found]
    return {
        "t": np.array([t for t, *_ in found], float),
        "criterion": _words([name for _, name, _, _ in found]),
        "place": _words([row.name for _, _, row, _ in found]),
        "side": _words([row.side for _, _, row, _ in found]),
        "aspect": _words([aspect.name for aspect in aspects]),
        "value": _known(aspect.value for aspect in aspects),
        "limit": _known(aspect.limit for aspect in aspects),
        "unit": _words([aspect.unit for aspect in aspects]),
        "band": _words([aspect.band for aspect in aspects]),
    }

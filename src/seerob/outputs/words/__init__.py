"""Words of page and report in five languages: English in the source, the others in one catalogue each.

The engine speaks English: what it says is compared, recorded and replayed. Page and report translate that
where it is shown (`told`), by the sentence of the source it was made from. Names of the file, formulas and
sources stay as they are. `web/src/words.ts` reads the same catalogues and does the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, lru_cache
from importlib.resources import files

import msgspec

LANGUAGES = ("en", "de", "fr", "es", "it")

_language: ContextVar[str] = ContextVar("language", default="en")


@contextmanager
def speaking(language: str) -> Iterator[None]:
    """Let `said` answer in a language of `LANGUAGES` meanwhile."""
    before = _language.set(language)
    try:
        yield
    finally:
        _language.reset(before)


def spoken() -> str:
    """The language that `said` answers in."""
    return _language.get()


@cache
def catalogue(language: str) -> dict[str, str]:
    """Translations by English text; none of English itself."""
    if language == "en":
        return {}
    raw = files(__package__).joinpath(f"{language}.json").read_bytes()
    return msgspec.json.decode(raw, type=dict[str, str])


def said(text: str, **values: object) -> str:
    """A text in the language that is spoken, with values in place of ``{name}``."""
    found = catalogue(_language.get()).get(text, text)
    return found.format(**values) if values else found


def word(text: str) -> str:
    """Mark a text that `said` is given later, so that catalogues are known to need it."""
    return text


_PLACE = re.compile(r"\{(\d+)\}")


@cache
def _sentences(language: str) -> tuple[tuple[int, str, re.Pattern[str], str], ...]:
    """What the engine says with values in it, most of its own first: own letters, longest, pattern, other."""
    found = []
    for text, translation in catalogue(language).items():
        words = _PLACE.split(text)[::2]
        if len(words) > 1:
            pattern = re.compile("([^;]+?)".join(map(re.escape, words)))
            found.append((len("".join(words)), max(words, key=len), pattern, translation))
    return tuple(sorted(found, key=lambda each: -each[0]))


def told(text: str) -> str:
    """What the engine says, in the language that is spoken; as it is where no catalogue has it.

    Sentences that are joined, in place of a value, in parentheses or about a name (``ur10: …``) are looked up
    each by itself, and so is what stands before a figure. A single word is a name unless it is of `alone`.
    """
    language = _language.get()
    return text if language == "en" else _told(text, language)


@cache
def alone() -> frozenset[str]:
    """Single words that the engine says. Any other, such as a button's label, may be a name and stays."""
    return frozenset(files(__package__).joinpath("alone.txt").read_text("utf-8").split())


_OWN = 9
"""A sentence that begins with a value and has fewer letters of its own has to know its values too."""
_STANDARD = re.compile(r"(?:ISO|IEC|EN|DIN)\b")
_IN_PARENTHESES = re.compile(r"(.+) \(([^()]+)\)")
_OF_A_FIGURE = re.compile(r"([^\d]*[^\d\s−-]) ([−-]?\d\S*)")


@lru_cache(maxsize=4096)
def _told(text: str, language: str) -> str:
    found = catalogue(language).get(text)
    if found is not None and (" " in text or text in alone()):
        return found
    for own, words, pattern, translation in _sentences(language):
        if words in text and (match := pattern.fullmatch(text)):
            values = [_value(value, language) for value in match.groups()]
            if own >= _OWN or pattern.pattern[0] != "(" or all(map(_known, match.groups(), values)):
                return _filled(translation, values)
    if "; " in text:
        return "; ".join(_told(each, language) for each in text.split("; "))
    if ", " in text:
        parts = text.split(", ")
        parts_told = [_told(each, language) for each in parts]
        # A list of words or names; of a sentence that no catalogue has no half is translated.
        if all(map(_known, parts, parts_told)):
            return ", ".join(parts_told)
    about, colon, rest = text.partition(": ")
    if colon and "(" not in about:
        return f"{_told(about, language)}: {_told(rest, language)}"
    if match := _IN_PARENTHESES.fullmatch(text):
        return f"{_told(match[1], language)} ({_told(match[2], language)})"
    if match := _OF_A_FIGURE.fullmatch(text):
        return f"{_told(match[1], language)} {match[2]}"
    return text


def _known(text: str, translation: str) -> bool:
    """Whether a part is translated, or is a name or the place in a standard, which stays."""
    return text != translation or " " not in text or _STANDARD.match(text) is not None


def _filled(translation: str, values: Sequence[str]) -> str:
    return _PLACE.sub(lambda place: values[int(place[1])], translation)


def _value(text: str, language: str) -> str:
    """A value in a sentence: a sentence itself, or a name or a figure, which stays."""
    return _told(text, language) if " " in text else text

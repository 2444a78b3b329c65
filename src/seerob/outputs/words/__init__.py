"""Words of page and report in five languages: English in the source, the others in one catalogue each.

What criteria, findings and refusals say comes from the engine, in English, and so do names of the file,
formulas and sources. `web/src/words.ts` reads the same catalogues.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
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

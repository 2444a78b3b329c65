"""Catalogues of page and report: each has every text, no other, with the same values in it."""

import re
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

from seerob.core.snapshot import Verdict
from seerob.outputs.palette import WORD
from seerob.outputs.words import LANGUAGES, catalogue, said, speaking, spoken, told

ROOT = Path(__file__).parents[1]
LOADER = SourceFileLoader("missing_words", str(ROOT / "scripts/missing-words"))
missing = module_from_spec(spec_from_loader("missing_words", LOADER))
LOADER.exec_module(missing)
OTHERS = LANGUAGES[1:]


@pytest.mark.parametrize("language", OTHERS)
def test_a_catalogue_has_every_text_and_no_other(language):
    assert missing.mistakes(language) == []
    assert len(missing.needed()) > 300


@pytest.mark.parametrize("language", OTHERS)
def test_three_verdicts_have_three_words_the_same_in_page_and_report(language):
    with speaking(language):
        report = [said(WORD[verdict]).lower() for verdict in Verdict]
        page = [said(verdict.value) for verdict in Verdict]
    assert report == page
    assert len(set(report)) == 3
    assert not set(report) & {verdict.value for verdict in Verdict}


def test_what_is_spoken_ends_with_it_and_what_is_not_known_stays_english():
    with speaking("de"):
        assert spoken() == "de"
        assert said("no such text, {n}", n=3) == "no such text, 3"
    assert spoken() == "en"
    assert said("{low} and {high}", low=1, high=2) == "1 and 2"


@pytest.mark.parametrize("language", OTHERS)
def test_each_sentence_of_the_engine_is_told_with_its_values_and_its_reason(language):
    sentences = [(text, out) for text, out in catalogue(language).items() if re.search(r"\{\d\}", text)]
    assert len(sentences) > 120
    values = [f"N{k}" for k in range(10)]
    with speaking(language):
        wrong = [text for text, out in sentences if told(text.format(*values)) != out.format(*values)]
        assert wrong == []
        late = "not heard for {0} s (time-out {1} s)"
        joined = f"ur10: {late.format('0.31', '0.2')}; no part moves; what a plug-in says"
        late = catalogue(language)[late].format("0.31", "0.2")
        assert told(joined) == f"ur10: {late}; {catalogue(language)['no part moves']}; what a plug-in says"
        inside = told("the map is undecided here: nothing heard yet")
        assert inside.endswith(catalogue(language)["nothing heard yet"])
    assert told(joined) == joined


def test_what_the_engine_says_as_it_stands_is_asked_of_every_catalogue():
    assert len(missing.engine()[1]) > 40
    assert "{0} may be elsewhere: {1}" in missing.engine()[1]
    assert not missing.in_source("{0} may be elsewhere, {1}")


def test_a_text_that_lacks_a_value_is_found(monkeypatch):
    wrong = {**catalogue("de"), "at {time}": "um"}
    del wrong["Time"]
    monkeypatch.setattr(missing, "catalogue", lambda language: {**wrong, "Tmie": "Zeit"})
    assert missing.mistakes("de") == ["missing: Time", "said nowhere: Tmie", "other values: at {time} → um"]


def test_panels_say_nothing_past_the_catalogues():
    """Text between tags, and titles and labels, of which a catalogue cannot know."""
    found = []
    for file in sorted((ROOT / "web/src/panels").glob("*.tsx")):
        text = file.read_text()
        for pattern in (
            r'\s(?:title|aria-label|placeholder)="([^"]*[a-z]{3}[^"]*)"',
            r">([A-Z][a-z]+[^<>{}=;()\n]*)</",
            r"(?m)^ {6,}([A-Z][a-z]+(?: [a-z,;.]+)*)$",  # a line of text between tags
            r"(?m)>\n {6,}([a-z]{3,}(?: [a-z,;.]+)*)\n",
            r"<(?!code)\w+[^>]*>([a-z]{3,}(?: [a-z,;.]+)+)</",
            r"(?:title|label)=\{`([A-Za-z][^`]*)`\}",
        ):
            found += [f"{file.name}: {each}" for each in re.findall(pattern, text)]
    assert [each for each in found if "Ctrl+" not in each] == []

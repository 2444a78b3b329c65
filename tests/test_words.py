"""Catalogues of page and report: each has every text, no other, with the same values in it."""

import re
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

from seerob.core.snapshot import Input, Origin, Verdict
from seerob.outputs.palette import WORD
from seerob.outputs.report.report import grouped_inputs
from seerob.outputs.words import LANGUAGES, alone, catalogue, said, speaking, spoken, told

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


def filled(text):
    """A sentence with names in place of its values; braces of what the file is to say stay."""
    return re.sub(r"\{(\d)\}", r"N\1", text)


@pytest.mark.parametrize("language", OTHERS)
def test_each_sentence_of_the_engine_is_told_with_its_values_and_its_reason(language):
    sentences = [(text, out) for text, out in catalogue(language).items() if re.search(r"\{\d\}", text)]
    assert len(sentences) > 120
    with speaking(language):
        wrong = [text for text, out in sentences if told(filled(text)) != filled(out)]
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


SAID = (
    "ISO/TS 15066:2016 Table A.4, recollection of the standard (M)",
    "ISO/TS 15066:2016 A.3, open ROS 2 speed controller for Universal Robots; blog, thigh energy (2S)",
    "note of a reader of the licensed text on child safety (2S)",
    "its surface is not the real one (envelope made by seerob, not the maker's mesh)",
    "motion comes from a generic simulator (cycle.csv): preliminary until it is confirmed on the controller",
    "torque limits of knee: elite gymnast, upper bound, whole-body model of RBDL; not scaled to this person",
    "ISO/TS 15066:2016 5.5.4.2.3 and ISO 13855, from public sources that agree (2S); "
    "that S_p with 1.6 m/s is not below 0.5 m is from memory (M)",
    "decided by tracking of the person ± 12.36 mm",
)
ENGLISH = re.compile(r"\b(the|of|by|with|from|not|is|are|its|where|who|that|this|and|which)\b")


@pytest.mark.parametrize("language", OTHERS)
def test_what_is_our_own_of_a_source_is_told_whole_and_what_is_not_is_left_whole(language):
    cited = "McAtamney and Corlett 1993, Applied Ergonomics 24(2)"
    book = "single book of the old masters (2+)"
    with speaking(language):
        assert [text for text in map(told, SAID) if ENGLISH.search(text)] == []
        assert (told(cited), told(book)) == (cited, book)


@pytest.mark.parametrize("language", OTHERS)
def test_names_stay_though_a_button_has_the_same_word(language):
    single = {text for text in catalogue(language) if " " not in text and "{" not in text}
    late = "not heard for 0.4 s (time-out 0.2 s)"
    with speaking(language):
        assert {text for text in single if told(text) != text} <= alone()
        for name in sorted(missing.needed() & single - alone()):
            assert told(name) == name
            assert told(f"{name}: {late}") == f"{name}: {told(late)}" != f"{name}: {late}"
            assert told(f"{name}, {name}_2") == f"{name}, {name}_2"
        assert said("stop") != "stop"
    # What the engine says as one word has to be among those that are told, but for what inputs are called.
    assert single - missing.needed() - missing.engine()[1] <= alone() <= single


@pytest.mark.parametrize("language", OTHERS)
def test_an_input_is_told_with_its_name_and_names_of_the_file_stay(language):
    def row(name, value, source=""):
        item = Input(name=name, value=value, origin=Origin.GIVEN, source=source)
        [[text, _, _, cited]] = grouped_inputs([("c", item)])
        return text, cited

    with speaking(language):
        words = catalogue(language)
        assert row("entered hand", "left")[0] == words["entered hand: left"]
        assert row("entered hand", "both")[0] == f"{words['entered hand']}: {words['both']}"
        assert row("shape", "load")[0] == f"{words['shape']}: load"  # what is called so is a name
        assert row("variable load", 2.0)[0] == words["variable {0}"].format("load") + ": 2"
        assert row("threshold knee bent", 150.0, "the machine itself") == (
            f"{words['threshold knee bent']}: 150", words["the machine itself"])  # fmt: skip
        assert row("mass of left", "") == (words["mass of {0}"].format("left"), "–")


@pytest.mark.parametrize("language", OTHERS)
def test_pause_and_stop_differ_and_no_distance_is_no_more_of_it(language):
    with speaking(language):
        assert len({said(text).lower() for text in ("hold", "stop", "run")}) == 3
        assert said("hold").lower() != said("Stop").lower()
        assert said("no distance left") != "plus de distance"
        accepted = next(text for text in catalogue(language) if text.startswith("accepted: "))
        assert said("assumed").lower() not in said(accepted).lower()

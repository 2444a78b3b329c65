"""The page is one file, says everything, and lets nothing from a file become markup."""

import hashlib
import re
import sys
from html.parser import HTMLParser

import made_run
import pytest
from msgspec.structs import replace

from seerob.app.console.progress import announced
from seerob.core.errors import InputError
from seerob.core.snapshot import Result, Verdict
from seerob.outputs.sinks.dossier import Dossier
from seerob.outputs.words import LANGUAGES, speaking
from seerob.outputs.words import said as spoken
from seerob.recording.result_log import ResultLog

VOID = {"meta", "img", "br", "col", "link", "input", "hr", "base"}


class Page(HTMLParser):
    """Tags with attributes, text outside of styles, and whether elements nest."""

    def __init__(self, source):
        super().__init__(convert_charrefs=True)
        self.tags, self.text, self._open = [], "", []
        self.feed(source)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if self._open and self._open[-1] != "style":
            self.text += data


def write(folder, n=120, **options):
    with Dossier(**options).open(made_run.scene(), made_run.MESHES, made_run.FILES, folder) as writer:
        for k in range(n):
            writer.write(made_run.snapshot(k), made_run.samples(k))
    return (folder / "report.html").read_text()


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return write(tmp_path_factory.mktemp("dossier"))


@pytest.fixture(scope="module")
def page(source):
    return Page(source)


def test_nothing_refers_outside_and_nothing_runs(source, page):
    for tag, attributes in page.tags:
        assert tag not in {"script", "link", "iframe", "object", "embed", "base", "form", "foreignobject"}
        for key, value in attributes.items():
            assert not key.startswith("on")
            if key in {"src", "href", "xlink:href", "action", "data", "poster", "srcset"}:
                assert value.startswith(("#", "data:image/png;base64,")), (tag, key, value[:80])
    assert not re.search(r"url\((?!#)", source)
    assert "@import" not in source
    assert "://" not in page.text
    policy = next(a["content"] for t, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")


def test_links_and_ids_inside_the_page_fit(page):
    ids = [a["id"] for _, a in page.tags if "id" in a]
    targets = {v[1:] for _, a in page.tags for k, v in a.items() if k.endswith("href") and v.startswith("#")}
    assert targets <= set(ids)
    criteria = [i for i in ids if i.startswith("criterion-")]
    assert len(criteria) == len(set(criteria)) == len(made_run.scene().criteria)


def test_every_criterion_finding_basis_file_and_body_is_there(page):
    scene = made_run.scene()
    for criterion in scene.criteria:
        assert criterion.name in page.text
    for finding in scene.findings:
        assert finding.subject in page.text
        assert finding.text in page.text
    for item in made_run.SEPARATION.inputs:
        assert item.name in page.text
        assert item.source in page.text
    for text in (*made_run.SEPARATION.not_modelled, made_run.SEPARATION.formula, made_run.SEPARATION.source):
        assert text in page.text
    for name in made_run.FILES:
        assert name in page.text
    for node in scene.nodes:
        assert node.name in page.text
    assert scene.workstation_hash in page.text
    assert scene.edition in page.text


def test_hostile_names_stay_text(source, page):
    assert "<script" not in source
    assert page.text.count(made_run.HOSTILE) >= 6


def test_the_worst_instant_is_named_with_value_limit_and_what_governs(page):
    assert "Worst at 0.50 s: 0.3 m, 0.2504 m beyond the limit of 0.5504 m." in page.text
    assert (
        "Given the tolerances of the inputs, the true value there is between 0.29 m and 0.31 m." in page.text
    )
    assert "ur10/forearm_link ↔ operator/head" in page.text
    assert "One limit was exceeded: separation." in page.text


def test_undecided_never_looks_like_a_pass(page):
    badges = [a["class"] for t, a in page.tags if t == "span" and a.get("class", "").startswith("badge")]
    assert badges.count("badge undecided") == 4  # twice in the table, twice above the sections
    assert "Undecided is not a pass" in page.text
    assert "It is not a pass: find out why it was silent." in page.text
    assert (
        "In 25 % of the evaluated ticks nothing can be said, in one stretch; the longest lasted 0.29 s."
        in (page.text)
    )


@pytest.mark.parametrize("word", [r"certif\w*", r"\bsafe\b", r"complian\w*", r"\bcompl(y|ies)\b"])
def test_it_is_an_evaluation_and_claims_nothing_more(page, word):
    assert not re.search(word, page.text, re.IGNORECASE)
    assert "evaluation" in page.text


def test_pictures_are_drawn_for_the_worst_criteria_first(tmp_path, page):
    alts = [a["alt"] for t, a in page.tags if t == "img"]
    assert [alt.split(": ")[0] for alt in alts] == ["separation", "tool speed"]
    only = [a["alt"] for t, a in Page(write(tmp_path, 60, pictures=1)).tags if t == "img"]
    assert only == alts[:1]


def test_the_file_is_replaced_whole_or_left(tmp_path, monkeypatch):
    before = write(tmp_path, 2, pictures=0)
    monkeypatch.setattr("seerob.outputs.report.page.page", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write(tmp_path, 3, pictures=0)
    assert (tmp_path / "report.html").read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_run_without_ticks_and_without_criteria_still_gives_a_page(tmp_path):
    text = Page(write(tmp_path, 0)).text
    assert "Nothing was evaluated: the run has no tick." in text
    with Dossier(pictures=0).open(made_run.scene(criteria=()), {}, {}, tmp_path):
        pass
    assert "there is no verdict" in Page((tmp_path / "report.html").read_text()).text


def test_progress_is_told(tmp_path):
    told = []
    with Dossier().open(made_run.scene(), made_run.MESHES, {}, tmp_path) as writer:
        writer.progress = lambda done, total: told.append((done, total))
        writer.write(made_run.snapshot(50), ())
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_pictures_that_were_begun_before_the_end_are_those_that_it_draws(tmp_path, source):
    with Dossier().open(made_run.scene(), made_run.MESHES, made_run.FILES, tmp_path) as writer:
        for k in range(120):
            writer.write(made_run.snapshot(k), made_run.samples(k))
        writer.begin()
        begun = dict(writer._being_drawn)
        writer.begin()
        assert writer._being_drawn == begun
    pictures = [a["src"] for t, a in Page((tmp_path / "report.html").read_text()).tags if t == "img"]
    assert pictures == [a["src"] for t, a in Page(source).tags if t == "img"]
    assert len(pictures) == len(begun) == 2
    assert all(picture.done() for picture in begun.values())


def test_whoever_does_not_want_to_wait_waits_for_no_picture_that_is_not_begun(tmp_path):
    writer = Dossier().open(made_run.scene(), made_run.MESHES, {}, tmp_path)
    writer.write(made_run.snapshot(50), ())
    writer.begin()
    writer.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert not list(tmp_path.iterdir())
    assert all(picture.done() for picture in writer._being_drawn.values())


def test_what_fails_before_the_end_is_said_at_the_end_and_ends_no_run(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("seerob.outputs.picture.picture.Stage", full)
    report = Dossier().open(made_run.scene(), made_run.MESHES, {}, tmp_path)
    (writer,) = announced([report], ["report.html"], lambda _: None, outlived=True)
    with writer:
        writer.write(made_run.snapshot(50), ())
        writer.begin()
    assert "No space left" in str(writer.failure)
    assert not list(tmp_path.iterdir())


def test_a_mesh_that_cannot_be_read_is_a_finding_not_a_failure(tmp_path):
    meshes = made_run.MESHES | {"b" * 64: b"not a mesh"}
    with Dossier().open(made_run.scene(), meshes, {}, tmp_path) as writer:
        writer.write(made_run.snapshot(50), ())
    assert "its mesh cannot be shown in pictures" in Page((tmp_path / "report.html").read_text()).text


def test_options_are_checked(tmp_path):
    for options in ({"file": "a/b.html"}, {"file": "x.pdf"}, {"pictures": -1}):
        with pytest.raises(InputError, match="dossier"):
            Dossier(**options).open(made_run.scene(), {}, {}, tmp_path)
    with pytest.raises(InputError, match="cannot be written"):
        write(tmp_path / "none", 0)


CELL = b"""
title = "Cell"
[engine]
timestep = 0.001
bandwidth = 25.0
[[robots]]
name = "arm"
model = "library:ur10"
[[sources]]
kind = "csv"
robot = "arm"
file = "motion/cycle.csv"
origin = "controller"
timeout = 0.35
loop = true
[[sources]]
kind = "this"
robot = "<b>arm</b>"
"""


def test_rates_controllers_and_sources_are_named_from_the_file_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["/some/where/seerob", "assess", "my cell"])
    files = {"workstation.toml": CELL}
    with Dossier().open(made_run.scene(), {}, files, tmp_path):
        pass
    text = Page((tmp_path / "report.html").read_text()).text
    for said in (
        "steps of 0.001 s (1000 Hz)",
        "every 0.01 s (100 Hz)",
        "bandwidth 25 Hz for robots, 10 Hz for people",
        "csv motion/cycle.csv",
        "measured: the real robot's controller",
        "0.35 s",
        "starts again after 1 s",
        "<b>arm</b>",
        "seerob assess 'my cell'",
        hashlib.sha256(CELL).hexdigest(),
    ):
        assert said in text


def test_a_report_imports_nothing_that_a_file_names_and_says_what_it_cannot_read(tmp_path):
    # `this` prints when it is imported; it is a module of the standard library that nobody needs.
    assert "this" not in sys.modules
    files = {"workstation.toml": b'[[sources]]\nkind = "this"\nrobot = "a"\n'}
    for k, content in enumerate((files, {}, {"workstation.toml": b"\xff[["})):
        with Dossier(file=f"{k}.html").open(made_run.scene(), {}, content, tmp_path):
            pass
    assert "this" not in sys.modules
    assert "unknown" in Page((tmp_path / "0.html").read_text()).text
    for k in (1, 2):
        assert "the workstation file is not at hand" in Page((tmp_path / f"{k}.html").read_text()).text


def test_a_part_without_the_verdict_governs_nothing(tmp_path):
    informs = Result(name="sigma_1", value=9.0, unit="m")
    result = Result(name="separation", value=1.0, unit="m", limit=0.5, at_most=False, verdict=Verdict.WITHIN)
    others = replace(result, name="elbow"), replace(result, name="wrist", value=0.7)
    result = replace(result, parts=(informs, *others))
    log = ResultLog()
    log.add(replace(made_run.snapshot(0), results=(result,)))
    assert log["separation"].worst().part == "wrist"
    log.add(replace(made_run.snapshot(1), results=(replace(result, value=0.6, parts=(informs,)),)))
    assert log["separation"].worst().part == ""


def test_parts_that_inform_show_the_extremum_in_their_own_sense_and_unit(tmp_path):
    with Dossier().open(made_run.scene(), made_run.MESHES, made_run.FILES, tmp_path) as writer:
        for k, (share, speed) in enumerate([(2.0, 0.9), (434474.0, 0.3), (1.0, 0.7)]):
            parts = (
                Result(name="share of speed", value=share),
                Result(name="permissible speed", value=speed, unit="m/s", at_most=False),
                Result(name="unknown", unit="m"),
            )
            made = made_run.snapshot(k)
            first = replace(made.results[0], parts=parts)
            writer.write(replace(made, results=(first, *made.results[1:])), ())
    page = Page((tmp_path / "report.html").read_text())
    assert re.search(r"largest 434 ?474(\.0+)?(?! ?m)", page.text)
    assert "smallest 0.3" in page.text


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_report_speaks_the_language_that_its_file_asks_for(language, tmp_path):
    name, *others = made_run.FILES
    asked = made_run.FILES[name] + f'\n[report]\nlanguage = "{language}"\n'.encode()
    files = {name: asked, **{other: made_run.FILES[other] for other in others}}
    with Dossier().open(made_run.scene(), made_run.MESHES, files, tmp_path) as writer:
        for k in range(120):
            writer.write(made_run.snapshot(k), made_run.samples(k))
    written = (tmp_path / "report.html").read_text()
    text = Page(written).text
    assert f'<html lang="{language}">' in written
    with speaking(language):
        told = [spoken("Verdicts"), spoken("What to do"), spoken("EXCEEDED"), spoken("What was evaluated")]
    for each in told:
        assert each in text
    # Nothing is left to be filled in.
    assert not re.search(r"\{[a-z]+\}", text)
    assert ("What to do" in text) == (language == "en")

"""The report on paper, and its first page: printed by a browser that nobody here wrote."""

import base64
import re
import shutil
import sys
from pathlib import Path

import made_run
import pytest
from test_dossier import Page

import seerob as sr
from seerob.app.console.progress import announced
from seerob.app.console.sinks import tell_files
from seerob.core.errors import InputError
from seerob.outputs.report import printing
from seerob.outputs.report.page import STYLE
from seerob.outputs.report.report import ReportSection
from seerob.outputs.sinks.dossier import Dossier
from seerob.outputs.words import LANGUAGES

DEMO = Path(__file__).parents[2] / "workstations" / "ur10_assembly"
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
COVER = b"""[report]
customer = "Works <b>4</b>"
author = "A. Author"
revision = "C"
logo = "logo.png"
"""


def written(folder, files):
    with Dossier().open(made_run.scene(), made_run.MESHES, files, folder) as writer:
        for k in range(60):
            writer.write(made_run.snapshot(k), made_run.samples(k))
    return Page((folder / "report.html").read_text())


def test_the_demo_is_a_dozen_pages_and_begins_with_its_verdict(tmp_path):
    summary = sr.load(DEMO).run(folder=tmp_path, sinks=[Dossier(pdf=True)])
    data = (tmp_path / "report.pdf").read_bytes()
    assert 5 <= len(re.findall(rb"/Type\s*/Page\b", data)) <= 12
    page = Page((tmp_path / "report.html").read_text())
    assert page.text.index("At least one limit is exceeded.") < page.text.index("Contents")
    for name, series in summary.results.items():
        if series.verdict is sr.Verdict.EXCEEDED:
            assert f"Change the cell, its motion or its task: {name} is " in page.text


ENGLISH = re.compile(r"\b(the|of|by|with|from|not|is|are|its|where|who|that|this|which|than|nobody|and)\b")
# Signs of a formula, a document that is cited, and what a motion of the demo is called in its own file.
STAYS = re.compile(r"\b[JSvm]_\w|tables A, B and C|\b(19|20)\d\d\b|^motion operator secures the plate: ")


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_the_demo_is_a_dozen_pages_in_every_language_and_says_nothing_of_its_own_in_english(
    tmp_path, language
):
    shutil.copytree(DEMO, tmp_path / "cell", ignore=shutil.ignore_patterns("runs"))
    with (tmp_path / "cell/workstation.toml").open("a") as file:
        file.write(f'\n[report]\nlanguage = "{language}"\n')
    sr.load(tmp_path / "cell").run(folder=tmp_path, sinks=[Dossier(pdf=True)])
    assert len(re.findall(rb"/Type\s*/Page\b", (tmp_path / "report.pdf").read_bytes())) <= 12
    text = (tmp_path / "report.html").read_text().partition("<body")[2]
    said = re.split(r"<[^>]+>|; ", re.sub(r"<code>.*?</code>", "", text))
    assert [part for part in said if ENGLISH.search(part) and not STAYS.search(part)] == []


def test_the_first_page_says_for_whom_by_whom_and_which_revision(tmp_path):
    page = written(tmp_path, {"workstation.toml": COVER, "logo.png": PIXEL})
    text = page.text[: page.text.index("Contents")]
    for word in ("Works <b>4</b>", "A. Author", "revision", made_run.scene().workstation_hash):
        assert word in text
    logo = next(a for t, a in page.tags if t == "img")
    assert logo["src"] == f"data:image/png;base64,{base64.b64encode(PIXEL).decode()}"


@pytest.mark.parametrize("logo", [None, b"<svg onload='alert(1)'/>", PIXEL + bytes(1 << 20)])
def test_what_is_no_small_picture_is_no_logo(tmp_path, logo):
    files = {"workstation.toml": COVER} | ({} if logo is None else {"logo.png": logo})
    page = written(tmp_path, files)
    assert "logo.png is no PNG or JPEG file of at most 1 MB: no logo." in page.text


def test_sections_of_one_title_are_all_there(tmp_path):
    with Dossier().open(made_run.scene(), made_run.MESHES, {}, tmp_path) as writer:
        writer.write(made_run.snapshot(0), made_run.samples(0))
        writer.sections += [
            ReportSection("Permissible speed", (text,)) for text in ("of the left", "of the right")
        ]
    page = Page((tmp_path / "report.html").read_text())
    assert all(text in page.text for text in ("of the left", "of the right"))


def test_no_rule_of_the_style_stands_twice(tmp_path):
    rules = re.findall(r"^[^\s@}].*{.*}$", STYLE, re.MULTILINE)
    assert len(rules) == len(set(rules)) > 20


@pytest.fixture
def without_browser(monkeypatch):
    monkeypatch.setattr(printing, "BROWSERS", ())
    monkeypatch.delenv("CHROMIUM", raising=False)


@pytest.mark.usefixtures("without_browser")
def test_without_a_browser_weasyprint_prints_and_reads_nothing_beside_the_page(tmp_path, caplog):
    (tmp_path / "secret.png").write_bytes(PIXEL)
    beside = f'<img src="{(tmp_path / "secret.png").as_uri()}"></body>'
    with Dossier(pdf=True, pictures=0).open(made_run.scene(), made_run.MESHES, {}, tmp_path) as writer:
        writer.write(made_run.snapshot(0), made_run.samples(0))
    page = (tmp_path / "report.html").read_text()
    data = (tmp_path / "report.pdf").read_bytes()
    assert data.startswith(b"%PDF")
    assert b"%%EOF" in data[-99:]
    assert "</body>" in page
    assert not caplog.records
    printing.printed(page.replace("</body>", beside).encode())
    assert "Failed to load image" in caplog.text


@pytest.mark.usefixtures("without_browser")
def test_without_a_browser_and_weasyprint_nothing_begins(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    with pytest.raises(InputError, match="no Chromium, Chrome or Edge is installed; install one"):
        Dossier(pdf=True).open(made_run.scene(), {}, {}, tmp_path)


def test_a_browser_that_prints_nothing_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("CHROMIUM", "/bin/false")
    with pytest.raises(InputError, match="ended with 1 and no whole PDF"):
        printing.printed(b"<p>")


@pytest.mark.parametrize("page", ["", "%PDF-1.4 and half of a page"])
def test_half_of_a_pdf_is_none_and_the_report_is_there_all_the_same(tmp_path, monkeypatch, capsys, page):
    """A browser that is killed while it prints leaves a beginning, which was taken for the report."""
    killed = tmp_path / "browser"
    killed.write_text(
        f'#!/bin/sh\nfor a in "$@"; do case $a in --print-to-pdf=*) printf "%s" "{page}" '
        '> "${a#--print-to-pdf=}";; esac; done\nexit 0\n'
    )
    killed.chmod(0o755)
    monkeypatch.setenv("CHROMIUM", str(killed))
    out = tmp_path / "out"
    out.mkdir()
    sink = Dossier(pdf=True, pictures=0)
    (writer,) = announced(
        [sink.open(made_run.scene(), {}, {}, out)], [sink.file], lambda text: None, outlived=True
    )
    with writer:
        writer.write(made_run.snapshot(0), made_run.samples(0))
    assert not tell_files([sink], out, [writer])
    assert [path.name for path in out.iterdir()] == ["report.html"]
    said = capsys.readouterr().out
    assert f"wrote        {out / 'report.html'}\n" in said
    assert f"not written  {out / 'report.pdf'}: report: pdf: " in said

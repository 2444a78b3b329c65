"""The documentation says what the code does: generated pages, links, command lines, tables, named tests."""

import re
import shlex
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from seerob.app import cli
from seerob.core import plugin
from seerob.description.humans import keyframes, manikin
from seerob.session.reading import convert_workstation
from seerob.workstation.allowed import Allowed

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
ONLY_NAMES = re.compile(r"(no [a-z ]+|nothing) named ")
"""Mistakes of a table that stands alone: what it names is in another block."""


def pages() -> list[object]:
    return [pytest.param(path, id=path.relative_to(ROOT).as_posix()) for path in PAGES]


def blocks(path: Path, language: str) -> list[str]:
    return [text for kind, text in FENCE.findall(path.read_text(encoding="utf-8")) if kind == language]


def inline(path: Path) -> list[str]:
    return re.findall(r"`([^`\n]+)`", FENCE.sub("", path.read_text(encoding="utf-8")))


def anchors(path: Path) -> set[str]:
    """Anchors of the headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", path.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_generated_pages_are_current() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "scripts/write-docs", "--check"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_arms_of_the_library_are_those_that_are_told() -> None:
    files = (ROOT / "src/seerob/description/robots").glob("*.toml")
    makers = Counter(tomllib.loads(path.read_text(encoding="utf-8"))["maker"] for path in files)
    count = re.search(r"\((\d+) arms\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert count is not None
    assert int(count[1]) == makers.total()
    text = (ROOT / "docs/import.md").read_text(encoding="utf-8")
    table = text.partition("| maker | in the library |")[2].partition("\n\n")[0]
    told = {}
    for maker, arms, *_ in re.findall(r"^\| (\w[^|]*) \| ([^|]+) \|", table, re.MULTILINE):
        named = re.split(r";|, without", arms)[0]
        told[re.split(r"[, ]", maker)[0]] = len(re.split(r", | and ", named))
    assert told == {maker.split()[0]: count for maker, count in makers.items()}


@pytest.mark.parametrize("path", pages())
def test_links_lead_somewhere(path: Path) -> None:
    text = FENCE.sub("", path.read_text(encoding="utf-8"))
    lost = []
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = path.parent / name if name else path
        if not target.exists() or (anchor and anchor not in anchors(target)):
            lost.append(link)
    assert not lost


def command_lines(path: Path) -> Iterator[list[str]]:
    for text in blocks(path, ""):
        for line in text.splitlines():
            words = line.removeprefix("$ ")
            if words.startswith("seerob "):
                yield shlex.split(words, comments=True)[1:]
    yield from (shlex.split(code)[1:] for code in inline(path) if code.startswith("seerob "))


TO_BE_WRITTEN = {"brake_distance.py", "ocra.py", "fanuc.py", "influx.py"}
"""Of CONTRIBUTING.md: what somebody will add."""


@pytest.mark.parametrize("path", pages())
def test_files_that_are_named_exist(path: Path) -> None:
    named = {code for code in inline(path) if re.fullmatch(r"[\w./-]+/[\w.-]+\.(py|ts|tsx|mjs)", code)}
    places = (ROOT, ROOT / "src/seerob", path.parent)
    lost = {n for n in named if not any((place / n).is_file() for place in places)}
    assert {n for n in lost if Path(n).name not in TO_BE_WRITTEN} == set()


def test_there_is_something_to_check() -> None:
    """What the tests below look at, a page may lack, but not all of them."""
    assert len(PAGES) > 8
    for language in ("toml", "python", ""):
        assert any(blocks(path, language) for path in PAGES), language
    assert any(True for path in PAGES for _ in command_lines(path))
    assert any(text.startswith("[") for path in PAGES for text in blocks(path, "toml"))


@pytest.mark.parametrize("path", pages())
def test_command_lines_are_understood(path: Path) -> None:
    known = {name.rstrip("_").replace("_", "-") for name in cli.COMMANDS}
    for words in command_lines(path):
        if len(words) == 1 and words[0] in known:
            continue  # only speaks of the command
        cli.parser().parse_args(words)


@pytest.mark.parametrize("path", pages())
def test_tables_of_the_workstation_file_are_understood(
    path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "examples"))  # where the kinds of docs/extending.md are
    monkeypatch.chdir(tmp_path)  # no kind is taken from below the file's folder
    for text in blocks(path, "toml"):
        if text.startswith("["):
            _, problems = convert_workstation(
                tomllib.loads(text), f"of docs/{path.name}", Allowed(plugins=True)
            )
            assert not [str(p) for p in problems if not ONLY_NAMES.match(p.what)], text


def test_the_keyframes_of_the_documentation_can_be_played() -> None:
    (text,) = (t for t in blocks(ROOT / "docs/person/postures.md", "toml") if "[[keyframes]]" in t)
    person = manikin.build(name="operator", stature=1.75, mass=75, sex="male")
    motion = keyframes.parse(text.encode(), person, file="operator.toml")
    assert motion.duration == pytest.approx(2.4)


@pytest.mark.parametrize("path", pages())
def test_targets_of_make_exist(path: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    lines = [line for text in blocks(path, "") for line in text.splitlines()]
    named = {m[1] for code in (*inline(path), *lines) if (m := re.match(r"make ([a-z-]+)", code))}
    assert named <= targets


@pytest.mark.parametrize("path", pages())
def test_python_blocks_compile(path: Path) -> None:
    for text in blocks(path, "python"):
        compile(text, path.name, "exec")


def test_tests_named_as_evidence_exist() -> None:
    text = (ROOT / "docs/validation.md").read_text(encoding="utf-8")
    named = re.findall(r"(tests/[\w/.]+\.py)::(\w+)", text)
    assert named
    missing = [
        f"{file}::{test}"
        for file, test in named
        if not (ROOT / file).is_file() or f"def {test}(" not in (ROOT / file).read_text(encoding="utf-8")
    ]
    assert not missing


@pytest.mark.parametrize("group", ["sources", "safety", "ergonomics", "sinks"])
def test_every_kind_is_explained_with_its_options(group: str) -> None:
    text = "".join(FENCE.sub("", page.read_text(encoding="utf-8")) for page in PAGES)
    alike = {("sources", "csv"): "excel"}  # the same options, printed once
    named = {k: f"{group}/{alike.get((group, k), k)}" for k in plugin.kinds(group)}
    assert not [k for k, name in named.items() if f"<!-- write-docs: {name} -->" not in text]


def test_every_source_is_in_the_list_and_its_page_begins_with_an_example() -> None:
    text = (ROOT / "docs/sources.md").read_text(encoding="utf-8")
    listed = re.findall(r"<!-- write-docs: list/sources ([\w ]+) -->", text)
    assert sorted(" ".join(listed).split()) == sorted(plugin.kinds("sources"))
    for page in (*(ROOT / "docs/sources").glob("*.md"), *(ROOT / "docs/workstation").glob("*.md")):
        if page.stem not in {"checks", "live", "capture"}:
            assert "```toml" in "\n".join(page.read_text(encoding="utf-8").splitlines()[:8]), page.name


@pytest.mark.parametrize("group", ["safety", "ergonomics"])
def test_every_criterion_is_in_the_list_and_its_page_begins_with_an_example(group: str) -> None:
    text = (ROOT / f"docs/{group}.md").read_text(encoding="utf-8")
    listed = re.findall(rf"<!-- write-docs: list/{group} ([\w ]+) -->", text)
    assert sorted(" ".join(listed).split()) == sorted(plugin.kinds(group))
    for kind in plugin.kinds(group):
        page = (ROOT / f"docs/{group}/{kind}.md").read_text(encoding="utf-8")
        assert page.startswith(f'# {kind}\n\n```toml\n[[{group}]]\nkind = "{kind}"\n'), kind


def test_every_cited_key_is_in_the_references() -> None:
    references = (ROOT / "docs/references.md").read_text(encoding="utf-8")
    sources = [*(ROOT / "src").rglob("*.py"), *PAGES]
    cited = {
        key
        for file in sources
        for key in re.findall(r"\[([A-Z]\w+\d{4}[a-z]?)\](?!\()", file.read_text(encoding="utf-8"))
    }
    assert {key for key in cited if f"**[{key}]**" not in references} == set()


@pytest.mark.parametrize("path", pages())
def test_nothing_is_claimed_that_an_evaluation_cannot_claim(path: Path) -> None:
    assert not re.search(
        r"\b(certified|guaranteed|compliant)\b", path.read_text(encoding="utf-8"), re.IGNORECASE
    )

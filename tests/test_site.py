"""The documentation site: every link and anchor in it leads somewhere, and it asks nobody else."""

import json
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def build(folder):
    """Build the site in a folder, strictly; what it complained of."""
    config = (
        (ROOT / "mkdocs.yml")
        .read_text()
        .replace(".site/", f"{folder}/")
        .replace("[src]", f"[{ROOT / 'src'}]")
    )
    (folder / "mkdocs.yml").write_text(config)
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(folder / "mkdocs.yml")]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, str(ROOT / "scripts/site_versions"), str(folder)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    (folder / "html").symlink_to(folder / version("seerob"))
    return folder


def test_each_page_offers_the_versions_that_are_listed_beside_it(site):
    listed = json.loads((site / "versions.json").read_text())
    assert listed[0]["version"] == version("seerob")
    assert all((site / one["version"] / "index.html").exists() for one in listed)
    assert f"url={version('seerob')}/index.html" in (site / "index.html").read_text()
    page = (site / "html/docs/install.html").read_text()
    config = json.loads(re.search(r'<script id="__config"[^>]*>(.*?)</script>', page, re.S)[1])
    assert config["version"] == {"provider": "mike"}
    # Where the theme looks: beside the folder of the page's own version.
    beside = (site / "html/docs/install.html").parent / config["base"] / ".." / "versions.json"
    assert beside.exists()


def test_it_has_every_page_and_finds_words_in_them(site):
    pages = {
        file.relative_to(site / "html").with_suffix(".md").as_posix()
        for file in (site / "html/.").rglob("*.html")
    }
    own = {file.relative_to(ROOT).as_posix() for file in (ROOT / "docs").rglob("*.md")}
    assert own <= pages
    found = (site / "html/search/search_index.json").read_text()
    for words in ("protective separation distance", "permissible_speed", "laser_scanner"):
        assert words in found


def test_the_reference_has_signatures_and_docstrings(site):
    text = re.sub(r"<[^>]+>", "", (site / "html/api.html").read_text())
    for words in ("Station", "Run from the first to the last sample of the sources.", "allow_plugins"):
        assert words in text


def test_pages_load_nothing_from_elsewhere(site):
    for file in (site / "html").rglob("*.html"):
        loaded = re.findall(
            r'<(?:script|img|iframe)[^>]+src="([^"]+)"|<link[^>]+href="([^"]+)"', file.read_text()
        )
        assert [each for each in map("".join, loaded) if re.match(r"(https?:)?//", each)] == [], file


def test_a_link_or_an_anchor_that_leads_nowhere_is_refused(site, tmp_path):
    shutil.copytree(ROOT / "docs/sources", tmp_path / "pages/docs/sources")
    (tmp_path / "pages/README.md").write_text(
        "[gone](docs/gone.md), [gone](docs/sources/csv.md#no-such-heading)\n"
    )
    done = build(tmp_path)
    assert done.returncode != 0
    assert "docs/gone.md" in done.stdout + done.stderr
    assert "no-such-heading" in done.stdout + done.stderr

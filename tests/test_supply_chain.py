"""What is installed is listed whole, and floors admit no release with a flaw that is known."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).parents[1]
FLAWED_BELOW = {
    "starlette": "1.0.1",  # CVE-2025-62727 (0.49.1), CVE-2026-48710: a Host header that poisons the path
    "pillow": "12.3",  # CVE-2026-25990 (12.1.1), CVE-2026-40192 (12.2), thirteen more in 12.3
    "protobuf": "6.33.5",  # CVE-2026-0994
    "cbor2": "5.9",  # CVE-2025-68131 (5.8), CVE-2026-26209
    # CVE-2026-26007 (46.0.5), CVE-2026-34073 (46.0.6), CVE-2026-39892 (46.0.7), CVE-2026-69247 and 69248
    "cryptography": "50.0",
    "h11": "0.16",  # CVE-2025-43859
    "lxml": "6.1",  # CVE-2026-41066; of tests only
}


def version(text):
    return tuple(map(int, text.split(".")))


def test_floors_are_above_releases_with_known_flaws():
    project = tomllib.loads((HERE / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *(d for e in project["optional-dependencies"].values() for d in e)]
    floors = dict(m.groups() for d in wanted if (m := re.match(r"([\w.-]+)>=([\d.]+)", d)))
    for name, least in FLAWED_BELOW.items():
        assert version(floors[name]) >= version(least), name


def test_an_audit_that_can_ask_nobody_fails():
    said = subprocess.run(
        ["make", "-n", "audit"], cwd=HERE, capture_output=True, text=True, check=True
    ).stdout
    lines = [line for line in said.splitlines() if line.startswith("pip-audit")]
    assert lines
    assert all("--strict" in line for line in lines)


def test_the_bill_of_materials_lists_what_is_locked_and_asks_nobody(tmp_path):
    out = tmp_path / "bill.json"
    no_network = "import socket\nsocket.socket.connect = None\n"
    code = no_network + f"import runpy, sys\nsys.argv = ['sbom', {str(out)!r}]\n"
    code += f"runpy.run_path({str(HERE / 'scripts' / 'sbom')!r}, run_name='__main__')"
    subprocess.run([sys.executable, "-c", code], check=True)
    bill = json.loads(out.read_text())
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    text = (HERE / "requirements" / "run.txt").read_text()
    locked = re.findall(r"^([\w.-]+)==([^\s;\\]+)", text, re.M)
    assert [(c["name"], c["version"]) for c in bill["components"]] == locked
    assert sum(len(c["properties"]) for c in bill["components"]) >= text.count("--hash=sha256:")
    assert len({c["bom-ref"] for c in bill["components"]}) == len(locked)
    licences = (HERE / "docs" / "licences.md").read_text()
    assert all(f"| {name} | {number} |" in licences for name, number in locked)

"""What is installed is listed whole, and floors admit no release with a flaw that is known."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).parents[1]
FLAWED_BELOW = {
    "starlette": "0.49.1",  # CVE-2025-62727
    "pillow": "12.1.1",  # CVE-2026-25990
    "protobuf": "6.33.5",  # CVE-2026-0994
    "cbor2": "5.9",  # CVE-2026-26209
    "cryptography": "46.0.5",  # CVE-2026-26007
    "h11": "0.16",  # CVE-2025-43859
}


def version(text):
    return tuple(map(int, text.split(".")))


def test_floors_are_above_releases_with_known_flaws():
    project = tomllib.loads((HERE / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *(d for e in project["optional-dependencies"].values() for d in e)]
    floors = dict(m.groups() for d in wanted if (m := re.match(r"([\w.-]+)>=([\d.]+)", d)))
    for name, least in FLAWED_BELOW.items():
        assert version(floors[name]) >= version(least), name


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

"""Scripts with which shells complete what is typed, asked as a shell asks them."""

import argparse
import subprocess
import sys

import pytest
from made_cells import seerob
from shtab import SUPPORTED_SHELLS

from seerob.app import cli


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    file = tmp_path_factory.mktemp("completion") / "seerob.sh"
    with file.open("w") as out:
        subprocess.run([sys.executable, "-m", "seerob", "completion", "bash"], stdout=out, check=True)
    return file


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("comp", ["compare", "completion"]),
        ("compare --ht", ["--html"]),
        ("completion z", ["zsh"]),
        ("run cel", ["cell"]),
        ("compare cell/work", ["cell/workstation.toml"]),
    ],
)
def test_bash_completes(script, tmp_path, typed, found):
    (tmp_path / "cell").mkdir()
    (tmp_path / "cell/workstation.toml").touch()
    words = f"seerob {typed}".split(" ")
    asked = f"COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}"
    text = f'source {script}; {asked}; _shtab_seerob; printf "%s\\n" "${{COMPREPLY[@]}}"'
    done = subprocess.run(["bash", "-c", text], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.split() == found


def test_every_shell_is_told_every_command(capsys):
    top = cli.parser()
    (commands,) = (a for a in top._actions if isinstance(a, argparse._SubParsersAction))
    for shell in SUPPORTED_SHELLS:
        code, out, _ = seerob(capsys, "completion", shell)
        assert code == 0
        assert all(name in out for name in commands.choices), shell

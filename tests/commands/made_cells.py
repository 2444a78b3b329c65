"""Small workstation folders for the command line, and ways to call it."""

from __future__ import annotations

import re
from pathlib import Path

from seerob.app.cli import main
from seerob.app.console.progress import COMPILING

ROBOT = '[[robots]]\nname = "ur5e"\nmodel = "library:ur5e"\n'
SOURCE = '[[sources]]\nkind = "csv"\nrobot = "ur5e"\nfile = "motion.csv"\n'
HUMAN = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [3, 0, 0] }\n'
SPEED = '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "ur5e"\nlimit = {limit}\n'
SEPARATION = (
    '[[safety]]\nkind = "separation"\nname = "gap"\nbetween = ["ur5e", "op"]\n'
    "stop = { acceleration = 0, reaction = 0.1, stopping = 0.2 }\n"
)


def make_cell(folder: Path, *, limit: float = 9.0, more: str = "") -> Path:
    """A robot that swings its arm for 0.3 s, at less than 1 m/s."""
    folder.mkdir(parents=True)
    rows = [f"{k / 100:.2f},{-30 + 0.4 * k * k / 30:.4f},-90,90,-90,-90,0" for k in range(31)]
    header = "time [s]," + ",".join(f"J{i} [deg]" for i in range(1, 7))
    (folder / "motion.csv").write_text("\n".join([header, *rows]) + "\n")
    text = 'title = "arm"\n' + ROBOT + SOURCE + SPEED.format(limit=limit) + more
    (folder / "workstation.toml").write_text(text)
    return folder


def seerob(capsys, *arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    capsys.readouterr()
    try:
        code = main([str(a) for a in arguments])
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else 0
    out, err = capsys.readouterr()
    # Said by whichever test is the first on a machine.
    err = re.sub(rf"^{COMPILING}: \d+ of \d+\n", "", err, flags=re.MULTILINE)
    # Nothing that is not a terminal gets colours.
    assert not re.search(r"\x1b", out + err)
    assert "Traceback" not in err
    return code, out, err

"""What a run writes at its end: report and workbook, against the motion and against openpyxl.

    python benchmarks/exports.py            # the captured operator, all of its motion
    python benchmarks/exports.py --smoke    # its first instants without the report, correctness only

The goal is that closing every sink takes at most 30 % of the time of the motion. The peer, in the same run,
is openpyxl in its write-only mode with the same cells, plain: no formats, no colours, no widths. Times are
the processor's, so that what else the machine does is nearly left out.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

from openpyxl import Workbook, load_workbook

import seerob as sr
from seerob.app.console.terminal import cache_folder
from seerob.outputs.sink import Sink
from seerob.outputs.sinks.csv import CsvFiles
from seerob.outputs.sinks.dossier import Dossier
from seerob.outputs.sinks.excel import Excel
from seerob.session import run as road

FOLDER = Path(__file__).parents[1] / "workstations" / "captured_operator"
GOAL = 0.3


def written(seconds: float | None, folder: Path) -> tuple[float, dict[str, float]]:
    """Length of the motion, and the processor's time to close each sink [s]."""
    station = sr.load(FOLDER, cache=cache_folder())
    scene, period = station.scene(), station.workstation.engine.tick
    sinks: list[Sink] = [CsvFiles(), Excel(), *([Dossier()] if seconds is None else [])]
    writers = station.open_sinks(sinks, folder, scene)
    feed = road.pump(station.sources, period)
    if seconds is not None:
        feed = islice(feed, round(seconds / period))
    ticks = road.ticks(road.engine_of(station.model), road.Judge(station.bound), feed)
    end = 0.0
    for snapshot, samples in ticks:
        for writer in writers:
            writer.write(snapshot, samples)
        end = snapshot.t
    spent = {}
    for writer in writers:
        begun = time.process_time()
        writer.close()
        spent[type(writer).__name__.removesuffix("Writer").lower()] = time.process_time() - begun
    return end, spent


def peer(path: Path) -> tuple[float, int]:
    """The processor's time of openpyxl for the same cells [s], and their number."""
    book = load_workbook(path, read_only=True)
    sheets = {sheet.title: [list(row) for row in sheet.iter_rows(values_only=True)] for sheet in book}
    book.close()
    begun = time.process_time()
    again = Workbook(write_only=True)
    for name, rows in sheets.items():
        sheet = again.create_sheet(name)
        for row in rows:
            sheet.append(row)
    again.save(path.with_name("peer.xlsx"))
    spent = time.process_time() - begun
    same = load_workbook(path.with_name("peer.xlsx"), read_only=True)
    if [sheet.title for sheet in same] != list(sheets):
        raise SystemExit("the peer wrote other sheets")
    same.close()
    return spent, sum(len(row) for rows in sheets.values() for row in rows)


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--smoke", action="store_true")
    smoke = options.parse_args().smoke
    with TemporaryDirectory() as name:
        folder = Path(name)
        motion, spent = written(0.3 if smoke else None, folder)
        plain, cells = peer(folder / "results.xlsx")
    whole = sum(spent.values())
    told = ", ".join(f"{sink} {1e3 * used:.0f} ms" for sink, used in spent.items())
    sys.stdout.write(
        f"{motion:.1f} s of motion: written in {whole:.2f} s ({told}), {100 * whole / motion:.0f} % of it "
        f"(goal {100 * GOAL:.0f} %)\n"
        f"workbook of {cells} cells: {spent['excel'] / plain:.2f} x openpyxl ({1e3 * plain:.0f} ms)\n"
    )
    return int(not smoke and whole > GOAL * motion)


if __name__ == "__main__":
    sys.exit(main())

"""How a report looks: on a screen, on paper, and without colour."""

from __future__ import annotations

from seerob.core.snapshot import Verdict
from seerob.outputs.palette import DARK_HEX, HEX

STYLE = f"""
:root {{ --ink: #1a2430; --soft: #5a6672; --rule: #d8dee4; --wash: #f5f7f9; }}
* {{ box-sizing: border-box; }}
body {{ margin: 0 auto; max-width: 64rem; padding: 2.5rem 1.5rem 4rem; color: var(--ink); background: #fff;
  font: 16px/1.55 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
  overflow-wrap: anywhere; }}
h1 {{ font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }}
h2 {{ font-size: 1.3rem; margin: 2.8rem 0 .8rem; padding-bottom: .3rem;
  border-bottom: 2px solid var(--ink); }}
h3 {{ font-size: 1.1rem; margin: 2.2rem 0 .5rem; }}
h4 {{ font-size: .95rem; margin: 1.2rem 0 .3rem; color: var(--soft); }}
p, ul {{ margin: .5rem 0; }}
.lead {{ color: var(--soft); margin: 0 0 1.4rem; }}
.notice {{ border-left: 4px solid var(--soft); background: var(--wash); padding: .6rem 1rem; }}
table {{ border-collapse: collapse; width: 100%; margin: .6rem 0; font-size: .88rem; line-height: 1.4; }}
th, td {{ text-align: left; vertical-align: top; padding: .32rem .6rem; border-bottom: 1px solid var(--rule);
  font-variant-numeric: tabular-nums; font-weight: normal; }}
thead th {{ font-weight: 600; color: var(--soft); border-bottom: 1.5px solid var(--ink);
  white-space: nowrap; }}
tbody th {{ font-weight: 600; min-width: 7rem; }}
.instants tbody th {{ min-width: 0; }}
td {{ min-width: 4.6rem; }}
.overview tbody th {{ min-width: 9.5rem; }}
.overview td:last-child {{ min-width: 9rem; }}
.overview a {{ color: var(--ink); text-decoration-color: var(--rule); text-underline-offset: .2em; }}
code {{ font-family: ui-monospace, Consolas, "DejaVu Sans Mono", monospace; font-size: .85em; }}
.whole {{ white-space: nowrap; }}
.formula {{ background: var(--wash); padding: .5rem .8rem; font-family: ui-monospace, Consolas, monospace;
  font-size: .88rem; white-space: pre-wrap; }}
.badge {{ display: inline-block; padding: .08rem .55rem; border-radius: .8rem; font-size: .82rem;
  font-weight: 650; border: 1.5px solid; white-space: nowrap; }}
.within {{ background: {HEX[Verdict.WITHIN]}22; border-color: {DARK_HEX[Verdict.WITHIN]};
  color: {DARK_HEX[Verdict.WITHIN]}; }}
.undecided {{ background: {HEX[Verdict.UNDECIDED]}; border-color: {DARK_HEX[Verdict.UNDECIDED]};
  color: #3b3000; border-style: dashed; }}
.exceeded {{ background: {HEX[Verdict.EXCEEDED]}; border-color: {HEX[Verdict.EXCEEDED]}; color: #fff; }}
.none {{ background: #fff; border-color: {HEX[None]}; color: {DARK_HEX[None]}; }}
.verdict {{ padding: .9rem 1.1rem; border: 2px solid; border-radius: .5rem; margin: 1.2rem 0; }}
.verdict p {{ color: var(--ink); }}
.verdict.exceeded, .verdict.within, .verdict.none {{ background: #fff; color: inherit; }}
.verdict strong {{ font-size: 1.15rem; }}
.doubt {{ font-weight: 600; color: {DARK_HEX[Verdict.UNDECIDED]}; }}
figure {{ margin: .8rem 0; }}
figure img, figure svg {{ width: 100%; height: auto; display: block; }}
figure img {{ border: 1px solid var(--rule); border-radius: .3rem; }}
figcaption {{ font-size: .84rem; color: var(--soft); margin-top: .3rem; }}
section.criterion {{ border-top: 1px solid var(--rule); padding-top: .2rem; margin-top: 1.6rem; }}
h2 + section.criterion {{ border-top: none; margin-top: 0; }}
@media screen and (max-width: 56rem) {{
  table {{ display: block; overflow-x: auto; }}
}}
@page {{ size: A4; margin: 16mm 14mm; }}
@media print {{
  body {{ max-width: none; padding: 0; font-size: 10.5pt; }}
  h2, h3, h4 {{ break-after: avoid; }}
  table {{ font-size: 8.5pt; }}
  th, td {{ padding: .2rem .4rem; }}
  .badge {{ font-size: 7.5pt; padding: .05rem .4rem; }}
  thead th {{ white-space: normal; overflow-wrap: normal; }}
  td {{ min-width: 3.4rem; }}
  .overview {{ font-size: 7.5pt; }}
  .overview th, .overview td {{ padding: .15rem .25rem; }}
  .overview .badge {{ font-size: 6.5pt; padding: .02rem .3rem; }}
  .overview tbody th {{ min-width: 6rem; }}
  .overview td {{ min-width: 0; }}
  .overview td:last-child {{ min-width: 6.5rem; }}
  figure, tr, .verdict {{ break-inside: avoid; }}
  thead {{ display: table-header-group; }}
  * {{ print-color-adjust: exact; -webkit-print-color-adjust: exact; }}
}}
"""

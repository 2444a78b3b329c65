// What whoever reads a result must know about the model it was made with.

import { Fragment } from "preact";
import { formatNumber } from "../format";
import { frame, link, scene, select, stale } from "../page_state";
import { unseen } from "../scene/viewer";
import { spoken } from "../units";
import type { Finding, SourceLine } from "../wire";
import { said, word } from "../words";

const LOOKS: Record<string, { icon: string; word: string; rank: number }> = {
  warning: { icon: "!", word: word("warning"), rank: 0 },
  assumed: { icon: "≈", word: word("assumed"), rank: 1 },
  note: { icon: "i", word: word("note"), rank: 2 },
};

export function allFindings(): Finding[] {
  const missing = unseen.value.map((subject) => ({
    level: "warning",
    subject,
    text: "its mesh could not be fetched: it is evaluated but not drawn",
    holds: [],
  }));
  const found = [...(scene.value?.findings ?? []), ...missing];
  return found.sort((a, b) => rank(a) - rank(b));
}

export function Findings() {
  const findings = allFindings();
  return (
    <section class="findings scroll" aria-label={said("Findings")}>
      <p class="lead">
        {said(
          "What was noticed, repaired or assumed while the model was built. Each of these bears on the results.",
        )}
      </p>
      {findings.length === 0 ? (
        <p class="empty">{said("Nothing was found.")}</p>
      ) : (
        <FindingList findings={findings} />
      )}
      <Sources />
      {scene.value && (
        <dl class="fingerprint">
          <dt>{said("Workstation")}</dt>
          <dd title={scene.value.workstation_hash}>{scene.value.workstation_hash.slice(0, 16)}</dd>
          <dt>seerob</dt>
          <dd>{scene.value.version}</dd>
          <dt>{said("Connection")}</dt>
          <dd>{link.value.reason ? spoken(link.value.reason) : said(link.value.state)}</dd>
        </dl>
      )}
    </section>
  );
}

/** A line for each live source, and for each topic that targets are sent to. */
export function Sources() {
  const told = Object.entries(frame.value?.sources ?? {});
  if (told.length === 0) return null;
  return (
    <section class="sources" aria-label={said("Live sources")}>
      <h2>{said("Live sources")}</h2>
      <dl class="fingerprint">
        {told.map(([name, line]) => (
          <Fragment key={name}>
            <dt>{name}</dt>
            <dd class={stale.value ? "stale" : line.heard ? "" : "unknown"}>{sourceLine(line)}</dd>
          </Fragment>
        ))}
      </dl>
    </section>
  );
}

export function sourceLine(line: SourceLine): string {
  const ms = (seconds: number) => `${formatNumber(1e3 * seconds)} ms`;
  const words = [said(line.heard ? word("heard") : word("not heard"))];
  if (line.rate !== null && line.jitter !== null) {
    words.push(said("{rate}/s, jitter {jitter}", { rate: formatNumber(line.rate), jitter: ms(line.jitter) }));
  }
  if (line.latency !== null && line.bound !== null) {
    words.push(said("latency {late} ({bound} may be)", { late: ms(line.latency), bound: ms(line.bound) }));
  }
  const { received, lost, losses } = line;
  words.push(said("{received} received, {lost} lost, lost {losses} times", { received, lost, losses }));
  if (line.sent > 0) words.push(said("{sent} sent", { sent: line.sent }));
  if (line.word !== "") words.push(said("last word: {word}", { word: spoken(line.word) }));
  return words.join("; ");
}

export function FindingList({ findings }: { findings: readonly Finding[] }) {
  return (
    <ul class="finding-list">
      {findings.map((finding, i) => {
        const look = LOOKS[finding.level] ?? LOOKS.note!;
        return (
          <li key={i} class={`finding finding-${look.word}`}>
            <span class="finding-level">
              <span aria-hidden="true">{look.icon}</span> {said(look.word)}
            </span>
            <button type="button" class="link" onClick={() => choose(finding.subject)}>
              {finding.subject}
            </button>
            <span>{spoken(finding.text)}</span>
          </li>
        );
      })}
    </ul>
  );
}

function rank(finding: Finding): number {
  return (LOOKS[finding.level] ?? LOOKS.note!).rank;
}

function choose(subject: string): void {
  const run = scene.value;
  if (run?.nodes.some((node) => node.name === subject && node.owner !== subject)) {
    select({ kind: "node", name: subject });
  } else if (run?.nodes.some((node) => node.owner === subject)) {
    select({ kind: "owner", name: subject });
  } else if (run?.criteria.some((criterion) => criterion.name === subject)) {
    select({ kind: "criterion", name: subject });
  }
}

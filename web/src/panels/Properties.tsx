// What is known about the selection, where it is known from, and what is not known.

import { doubtAmong, doubts } from "../doubts";
import { entries } from "../editing/draft";
import { formatJoint, formatNumber, formatQuantity } from "../format";
import { frame, scene, selectedNodes, selection, stale } from "../page_state";
import type { JointInfo, MechanismInfo, Node, Scene } from "../wire";
import { said, told } from "../words";
import { FindingList } from "./Findings";

export function Properties() {
  const run = scene.value;
  const chosen = selection.value;
  if (!run || !chosen)
    return <p class="empty">{said("Select something in the scene, the tree or the table.")}</p>;
  if (chosen.kind === "criterion") return <CriterionProperties run={run} name={chosen.name} />;
  const nodes = run.nodes.filter((node) => selectedNodes.value.has(node.name));
  const first = nodes[0];
  if (!first) {
    const edits = entries.value.some(({ name }) => name === chosen.name);
    return (
      <p class="empty">{edits ? chosen.name : said("{name} is not in this scene.", { name: chosen.name })}</p>
    );
  }
  const mechanism = chosen.kind === "owner" ? run.mechanisms.find((m) => m.name === chosen.name) : undefined;
  const doubt = doubtAmong(nodes, doubts.value);
  const findings = run.findings.filter(
    (f) => nodes.some((n) => isAbout(f.subject, n)) || f.subject === chosen.name,
  );
  return (
    <div class="properties">
      <h2>{chosen.name}</h2>
      <dl>
        <dt>{said("Role")}</dt>
        <dd>{first.role}</dd>
        {doubt !== undefined && (
          <>
            <dt>{said("May be elsewhere")}</dt>
            <dd class="unknown">{doubt}</dd>
          </>
        )}
        {nodes.every((node) => node.real) && (
          <>
            <dt>{said("Real")}</dt>
            <dd>{said("not drawn over the real cell")}</dd>
          </>
        )}
        {chosen.kind === "node" && first.owner !== first.name && (
          <>
            <dt>{said("Belongs to")}</dt>
            <dd>{first.owner}</dd>
          </>
        )}
        {chosen.kind === "owner" && (
          <>
            <dt>{said("Bodies")}</dt>
            <dd>{nodes.length}</dd>
          </>
        )}
        {first.role !== "area" && <Mass nodes={nodes} />}
        <dt>{said("Mesh")}</dt>
        <dd>{triangles(nodes)}</dd>
        {notes(nodes).map((note) => (
          <NoteRow key={note} note={note} />
        ))}
        {mechanism && <Tracking mechanism={mechanism} />}
        {mechanism && <Lateness mechanism={mechanism} />}
      </dl>
      {mechanism && <Joints mechanism={mechanism} />}
      {mechanism && <Masses mechanism={mechanism} />}
      {findings.length > 0 && <FindingList findings={findings} />}
    </div>
  );
}

function isAbout(subject: string, node: Node): boolean {
  return subject === node.name || subject === node.owner;
}

function NoteRow({ note }: { note: string }) {
  return (
    <>
      <dt>{said("Geometry")}</dt>
      <dd class="note">{note}</dd>
    </>
  );
}

function notes(nodes: readonly Node[]): string[] {
  return [...new Set(nodes.map((n) => n.note).filter((note) => note !== ""))].slice(0, 4);
}

function triangles(nodes: readonly Node[]): string {
  const count = nodes.reduce((sum, node) => sum + node.triangles, 0);
  return nodes.some((n) => n.mesh) ? `${count.toLocaleString("en").replaceAll(",", " ")} triangles` : "none";
}

function Mass({ nodes }: { nodes: readonly Node[] }) {
  const known = nodes.filter((node) => node.mass !== null);
  const origins = [...new Set(known.map((node) => node.mass_origin))].join(", ");
  const unknown = nodes.length - known.length;
  const sum = known.reduce((total, node) => total + (node.mass ?? 0), 0);
  return (
    <>
      <dt>{said("Mass")}</dt>
      <dd>
        {known.length > 0 && (
          <>
            {formatQuantity(sum, "kg")} <span class="origin">{origins}</span>
          </>
        )}
        {unknown > 0 && (
          <span class="unknown">
            {nodes.length === 1
              ? said("not given")
              : ` ${said("{unknown} of {all} not given", { unknown, all: nodes.length })}`}
          </span>
        )}
      </dd>
    </>
  );
}

function Tracking({ mechanism }: { mechanism: MechanismInfo }) {
  const error = frame.value?.tracking[mechanism.name];
  if (error === undefined) return null;
  const angular = mechanism.joints.every((joint) => joint.unit === "rad");
  const shown = angular ? formatQuantity((error * 180) / Math.PI, "°") : formatNumber(error);
  return (
    <>
      <dt title={said("Largest joint error between the twin and what was heard")}>
        {said("Tracking error")}
      </dt>
      <dd class={stale.value ? "stale" : ""}>{shown}</dd>
    </>
  );
}

function Lateness({ mechanism }: { mechanism: MechanismInfo }) {
  const late = frame.value?.late[mechanism.name];
  if (late === undefined) return null;
  const [by, bound] = late;
  return (
    <>
      <dt
        title={said("How much later than the fastest sample the newest one arrived, and how late it may be")}
      >
        {said("Late")}
      </dt>
      <dd class={stale.value ? "stale" : by > bound ? "unknown" : ""}>
        {said("{late} ms, counts up to {most} ms", {
          late: formatNumber(1e3 * by),
          most: formatNumber(1e3 * bound),
        })}
      </dd>
    </>
  );
}

function Joints({ mechanism }: { mechanism: MechanismInfo }) {
  const q = frame.value?.joints[mechanism.name];
  if (mechanism.joints.length === 0) return null;
  return (
    <table class={`joints ${stale.value ? "stale" : ""}`}>
      <caption>{said("Joints")}</caption>
      <tbody>
        {mechanism.joints.map((joint, i) => (
          <tr key={joint.name}>
            <th scope="row">{joint.name}</th>
            <td>{q?.[i] === undefined ? "–" : formatJoint(q[i], joint.unit)}</td>
            <td>
              <JointBar joint={joint} q={q?.[i]} />
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Masses({ mechanism }: { mechanism: MechanismInfo }) {
  const rows = mechanism.masses.filter((row) => row.mass !== 0);
  if (rows.length === 0) return null;
  const sum = rows.reduce((total, row) => total + (row.mass ?? 0), 0);
  const unknown = rows.some((row) => row.mass === null);
  return (
    <table class="joints masses">
      <caption>
        Masses: {unknown ? "at least " : ""}
        {formatQuantity(sum, "kg")}
      </caption>
      <tbody>
        {rows.map((row) => (
          <tr key={row.name} title={[row.note, row.source].filter(Boolean).join("; ")}>
            <th scope="row">{row.name}</th>
            <td>
              {row.mass === null ? (
                <span class="unknown">{said("unknown")}</span>
              ) : (
                formatQuantity(row.mass, "kg")
              )}
            </td>
            <td>
              <span class="origin">
                {row.origin}
                {row.merged && `, with ${row.merged}`}
                {!row.moves && ", stands still"}
              </span>
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function JointBar({ joint, q }: { joint: JointInfo; q: number | undefined }) {
  if (joint.lower === null || joint.upper === null) return <span class="unknown">{said("no limits")}</span>;
  const share = q === undefined ? null : (q - joint.lower) / (joint.upper - joint.lower);
  const title = `${formatJoint(joint.lower, joint.unit)} to ${formatJoint(joint.upper, joint.unit)}`;
  return (
    <span class="joint-bar" title={title}>
      {share !== null && <i style={{ left: `${Math.min(1, Math.max(0, share)) * 100}%` }} />}
    </span>
  );
}

function CriterionProperties({ run, name }: { run: Scene; name: string }) {
  const info = run.criteria.find((c) => c.name === name);
  if (!info) return null;
  return (
    <div class="properties">
      <h2>{info.name}</h2>
      <p>{told(info.title)}</p>
      <dl>
        <dt>{said("Kind")}</dt>
        <dd>{info.kind}</dd>
        <dt>{said("Speaks of")}</dt>
        <dd>{info.subjects.join(", ") || "the whole workstation"}</dd>
        <dt>{said("Limit")}</dt>
        <dd>
          {info.limit === null
            ? said("none in the file")
            : `${info.at_most ? "at most" : "at least"} ${formatQuantity(info.limit, info.unit)}`}
        </dd>
      </dl>
    </div>
  );
}

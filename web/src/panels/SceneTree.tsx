// What is there: robots and their links, humans, tools, workpieces, parts.

import { useComputed, useSignal } from "@preact/signals";
import { doubtAmong, doubts } from "../doubts";
import { shortName } from "../format";
import { hidden, scene, select, selectedNodes, selection, toggleHidden } from "../page_state";
import { spoken } from "../units";
import type { Node } from "../wire";
import { said, word } from "../words";
import { Icon } from "./Icon";

const ROLES: readonly [role: string, title: string][] = [
  ["robot", word("Robots")],
  ["human", word("Humans")],
  ["tool", word("Tools")],
  ["workpiece", word("Workpieces")],
  ["part", word("Parts")],
  ["machine", word("Machines")],
  ["area", word("Areas")],
];

interface Owner {
  name: string;
  role: string;
  nodes: Node[];
}

export function SceneTree() {
  const search = useSignal("");
  const owners = useComputed(() => ownersOf(scene.value?.nodes ?? [], search.value.trim().toLowerCase()));
  const roles = ROLES.map(([role, title]) => ({
    title,
    owners: owners.value.filter((o) => o.role === role),
  }));
  const known = new Set(ROLES.map(([role]) => role));
  roles.push({ title: word("Other"), owners: owners.value.filter((o) => !known.has(o.role)) });
  return (
    <section class="tree" aria-label={said("Scene")}>
      <label class="search">
        <Icon name="search" />
        <input
          type="search"
          placeholder={said("Filter by name")}
          aria-label={said("Filter the scene by name")}
          value={search.value}
          onInput={(event) => {
            search.value = event.currentTarget.value;
          }}
        />
      </label>
      <div class="scroll">
        {roles
          .filter((role) => role.owners.length > 0)
          .map((role) => (
            <div key={role.title} class="role">
              <h2>{said(role.title)}</h2>
              <ul>
                {role.owners.map((owner) => (
                  <OwnerItem key={owner.name} owner={owner} open={search.value !== ""} />
                ))}
              </ul>
            </div>
          ))}
        {owners.value.length === 0 && <p class="empty">{said("Nothing of that name.")}</p>}
      </div>
    </section>
  );
}

function OwnerItem({ owner, open }: { owner: Owner; open: boolean }) {
  const expanded = useSignal(false);
  const alone = owner.nodes.length === 1 && owner.nodes[0]!.name === owner.name;
  const shown = !alone && (expanded.value || open);
  const chosen = selection.value;
  const active = chosen?.name === owner.name && chosen.kind !== "criterion";
  const names = owner.nodes.map((node) => node.name);
  const touched = names.some((name) => selectedNodes.value.has(name));
  return (
    <li>
      <div class={`item ${active ? "selected" : touched ? "touched" : ""}`}>
        {alone ? (
          <span class="twist" />
        ) : (
          <button
            type="button"
            class={`twist ${shown ? "open" : ""}`}
            aria-expanded={shown}
            aria-label={said(shown ? word("Fold {name}") : word("Unfold {name}"), { name: owner.name })}
            onClick={() => {
              expanded.value = !expanded.value;
            }}
          >
            <Icon name="chevron" />
          </button>
        )}
        <button
          type="button"
          class="name"
          title={owner.name}
          aria-pressed={active}
          onClick={() => select({ kind: alone ? "node" : "owner", name: alone ? names[0]! : owner.name })}
        >
          {owner.name}
        </button>
        <DoubtSign nodes={owner.nodes} />
        <EyeButton names={names} label={owner.name} />
      </div>
      {shown && (
        <ul>
          {owner.nodes.map((node) => (
            <NodeItem key={node.name} node={node} />
          ))}
        </ul>
      )}
    </li>
  );
}

function NodeItem({ node }: { node: Node }) {
  const active = selection.value?.kind === "node" && selection.value.name === node.name;
  const touched = selectedNodes.value.has(node.name);
  return (
    <li>
      <div class={`item leaf ${active ? "selected" : touched ? "touched" : ""}`}>
        <button
          type="button"
          class="name"
          title={node.name}
          aria-pressed={active}
          onClick={() => select({ kind: "node", name: node.name })}
        >
          {shortName(node.name, node.owner)}
        </button>
        <DoubtSign nodes={[node]} />
        <EyeButton names={[node.name]} label={node.name} />
      </div>
    </li>
  );
}

function DoubtSign({ nodes }: { nodes: readonly Node[] }) {
  const reason = doubtAmong(nodes, doubts.value);
  if (reason === undefined) return null;
  return (
    <span
      class="doubt"
      role="img"
      aria-label={said("may be elsewhere: {reason}", { reason: spoken(reason) })}
      title={said("may be elsewhere: {reason}", { reason: spoken(reason) })}
    >
      ?
    </span>
  );
}

function EyeButton({ names, label }: { names: string[]; label: string }) {
  const off = names.every((name) => hidden.value.has(name));
  return (
    <button
      type="button"
      class={`eye ${off ? "off" : ""}`}
      aria-label={said(off ? word("Show {name}") : word("Hide {name}"), { name: label })}
      onClick={() => toggleHidden(names)}
    >
      <Icon name={off ? "eye-off" : "eye"} />
    </button>
  );
}

function ownersOf(nodes: readonly Node[], search: string): Owner[] {
  const owners = new Map<string, Owner>();
  for (const node of nodes) {
    if (search !== "" && !node.name.toLowerCase().includes(search)) continue;
    const owner = owners.get(node.owner) ?? { name: node.owner, role: node.role, nodes: [] };
    owner.nodes.push(node);
    owners.set(node.owner, owner);
  }
  return [...owners.values()];
}

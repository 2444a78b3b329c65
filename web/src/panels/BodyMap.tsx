// Power and force limiting on a body: each of the 29 areas by how near a contact now would be to its limit.

import { signal } from "@preact/signals";
import {
  type Aspect,
  LOOK_WORDS,
  type Look,
  lookAt,
  shareOf,
  type Told,
  toldOf,
  toldOfRegion,
} from "../body_map/exposure";
import type { Spot } from "../body_map/figure";
import { aspect, contacts, only } from "../body_map/shown";
import { percent } from "../figures";
import { scene, stale } from "../page_state";
import { said, told, word } from "../words";
import { BodyFigure, type DrawnSpot } from "./BodyFigure";
import { ContactDetails, ContactHead } from "./ContactCard";

const ASPECTS: readonly [Aspect, string][] = [
  ["worst", word("Worst")],
  ["force", word("Force")],
  ["pressure", word("Pressure")],
  ["energy", word("Energy")],
];
const LEGEND: readonly Look[] = [
  "clear",
  "low",
  "middle",
  "high",
  "exceeded",
  "forbidden",
  "undecided",
  "none",
];

const pointed = signal<string | null>(null);
const pinned = signal<string | null>(null);

export function BodyMap() {
  const run = scene.value;
  const { judged, sources, from, all, open, governing, spots } = contacts.value;
  if (!run || !judged) {
    return (
      <section class="body-map scroll" aria-label={said("Body map")}>
        <p class="empty">
          {said(
            "No criterion of this run judges contacts with the body: the kind {kind} of the workstation file does.",
            { kind: "power_and_force" },
          )}
        </p>
      </section>
    );
  }
  const drawn = spots.map((spot) => drawnSpot(spot, all, open !== null));
  const keyOf = (told: Told | undefined): string | null =>
    drawn.find((spot) => told && toldOf(spot, all, aspect.value) === told)?.key ?? null;
  const shownKey = pointed.value ?? pinned.value ?? keyOf(governing);
  const shown = drawn.find((spot) => spot.key === shownKey);
  const told = shown ? toldOf(shown, all, aspect.value) : governing;
  return (
    <section class={`body-map scroll ${stale.value ? "stale" : ""}`} aria-label={said("Body map")}>
      <div class="panel-tools">
        <fieldset class="choice">
          <legend class="visually-hidden">{said("Limit")}</legend>
          {ASPECTS.map(([key, title]) => (
            <button
              key={key}
              type="button"
              aria-pressed={aspect.value === key}
              onClick={() => {
                aspect.value = key;
              }}
            >
              {said(title)}
            </button>
          ))}
        </fieldset>
        {sources.length > 1 && (
          <select
            aria-label={said("Criterion")}
            value={from ?? ""}
            onChange={(event) => {
              only.value = event.currentTarget.value || null;
            }}
          >
            <option value="">{said("worst of all")}</option>
            {sources.map((name) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        )}
      </div>
      <ContactHead spot={shown} told={told} aspect={aspect.value} open={open} />
      <fieldset class="figures" aria-label={said("Body areas")} onKeyDown={(event) => move(event, drawn)}>
        {(["front", "back"] as const).map((view) => (
          <BodyFigure
            key={view}
            view={view}
            spots={drawn.filter((spot) => spot.view === view)}
            regionLook={({ region, side }) =>
              lookAt(toldOfRegion(region, side, all, aspect.value), aspect.value, open !== null)
            }
            chosen={pinned.value}
            reachable={shownKey ?? drawn[0]?.key ?? null}
            onPoint={(key) => {
              pointed.value = key;
            }}
            onChoose={(key) => {
              pinned.value = pinned.value === key ? null : key;
            }}
          />
        ))}
      </fieldset>
      <ul class="look-legend" aria-label={said("Colours: present speed as a share of the permissible one")}>
        {LEGEND.map((look) => (
          <li key={look}>
            <i class={`swatch look-${look}`} aria-hidden="true" />
            {said(LOOK_WORDS[look])}
          </li>
        ))}
      </ul>
      {told && <ContactDetails run={run} told={told} />}
    </section>
  );
}

function drawnSpot(spot: Spot, all: readonly Told[], open: boolean): DrawnSpot {
  const here = toldOf(spot, all, aspect.value);
  const look = lookAt(here, aspect.value, open);
  const share = here ? shareOf(here.row, aspect.value) : null;
  const name = here ? told(here.row.name) : said("area {n}", { n: spot.area });
  const side = spot.side === "" ? "" : `${said(spot.side)} `;
  const amount =
    share === null ? "" : `, ${said("{share} of the permissible speed", { share: percent(share, "up") })}`;
  return {
    ...spot,
    key: `${spot.area} ${spot.side}`,
    look,
    title: `${side}${name}: ${said(LOOK_WORDS[look])}${amount}`,
  };
}

const ARROWS: Record<string, 1 | -1> = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

// Arrows go from spot to spot, worst places and all; time has them everywhere else on the page.
function move(event: KeyboardEvent, drawn: readonly DrawnSpot[]): void {
  const target = event.target as Element;
  const at = drawn.findIndex((spot) => spot.key === target.getAttribute("data-spot"));
  if (at < 0) return;
  if (event.key === "Enter" || event.key === " ") {
    pinned.value = pinned.value === drawn[at]!.key ? null : drawn[at]!.key;
  } else {
    const step = ARROWS[event.key];
    if (step === undefined) return;
    const next = drawn[(at + step + drawn.length) % drawn.length]!;
    const figures = event.currentTarget as HTMLElement;
    figures.querySelector<SVGGElement>(`[data-spot="${next.key}"]`)?.focus();
  }
  event.preventDefault();
  event.stopPropagation();
}

// A CAD file on its way into the draft: dropped or chosen, how far it is, what was found, axes to be accepted.

import { signal, useSignal } from "@preact/signals";
import { bring, bringing, marked, pointedAt, readAgain } from "../editing/bringing";
import { mayEdit } from "../editing/draft";
import { said, word } from "../words";
import { MistakeList } from "./MistakeList";

/** Endings of files that do not say their unit, or which axis is up. */
const SILENT = /\.(stl|obj|ply|off)$/;
/** Whether files are over the page. */
const over = signal(false);
/** Names of files that were dropped where no file is edited. */
const strayed = signal("");

const carries = (event: DragEvent): boolean => event.dataTransfer?.types.includes("Files") ?? false;

/**
 * Take files that are dropped anywhere on the page, which a browser would open instead of it; `open` shows the panel
 * that tells of them.
 */
export function listenToDrops(open: () => void): () => void {
  const drag = (event: DragEvent): void => {
    if (!carries(event)) return;
    event.preventDefault();
    over.value = event.type === "dragover";
  };
  const drop = (event: DragEvent): void => {
    drag(event);
    const files = [...(event.dataTransfer?.files ?? [])];
    if (files.length === 0) return;
    if (!mayEdit.peek()) {
      strayed.value = files.map(({ name }) => name).join(", ");
      return;
    }
    open();
    void bring(files);
  };
  const listen = { dragover: drag, dragleave: drag, drop };
  for (const [name, act] of Object.entries(listen)) document.addEventListener(name, act as EventListener);
  return () => {
    for (const [name, act] of Object.entries(listen))
      document.removeEventListener(name, act as EventListener);
  };
}

/** What becomes of a file that is dropped on a page that edits none. */
export function Strayed() {
  if (strayed.value === "") return null;
  return (
    <div class="strayed" role="alert">
      <p>
        {said(
          "{names} stays where it is: this page shows a run and edits no file. Drop it on the page of one of these, with the folder of the workstation:",
          { names: strayed.value },
        )}
      </p>
      <p>
        <code>seerob edit</code> · <code>seerob run --edit</code>
      </p>
      <button
        type="button"
        onClick={() => {
          strayed.value = "";
        }}
      >
        {said("Close")}
      </button>
    </div>
  );
}

export function Bringing() {
  const now = bringing.value;
  return (
    <section class={`bringing ${over.value ? "over" : ""}`} aria-label={said("Bring a CAD file")}>
      <label class="bring">
        {said("Bring a CAD file")} <span class="unit">{said("or drop it anywhere on the page")}</span>
        <input
          type="file"
          multiple
          disabled={now !== null && now.saying !== ""}
          onChange={(event) => {
            const files = [...(event.currentTarget.files ?? [])];
            event.currentTarget.value = "";
            void bring(files);
          }}
        />
      </label>
      {now && (
        <>
          <p role="status">
            {now.name}
            {now.saying !== "" && `: ${now.saying}`}
            {now.added && now.found && `: ${summary(now.found)}`}
          </p>
          <MistakeList mistakes={now.mistakes} keys />
          {now.mistakes.length > 0 && SILENT.test(now.name) && <Silent />}
          {now.found && <Found />}
          {now.name !== "" && now.saying === "" && <Options key={now.name} />}
        </>
      )}
    </section>
  );
}

const summary = ({ parts, robots }: { parts: number; robots: number }): string =>
  robots > 0
    ? said("{parts} parts and {robots} mechanisms, in the draft", { parts, robots })
    : said("{parts} parts, in the draft", { parts });

/** What the file does not say. */
function Silent() {
  const units = useSignal("mm");
  const up = useSignal("z");
  const choices = [
    [word("Unit of the file"), units, ["mm", "m", "inch"]],
    [word("Axis that points up"), up, ["z", "y", "x"]],
  ] as const;
  return (
    <div class="edit-bar">
      {choices.map(([title, chosen, values]) => (
        <label key={title}>
          {said(title)}{" "}
          <select
            value={chosen.value}
            onChange={(event) => {
              chosen.value = event.currentTarget.value;
            }}
          >
            {values.map((value) => (
              <option key={value}>{value}</option>
            ))}
          </select>
        </label>
      ))}
      <button type="button" onClick={() => void readAgain({ units: units.value, up: up.value })}>
        {said("Read it so")}
      </button>
    </div>
  );
}

const OPTIONS = [
  ["density", word("Densities [kg/m³]"), "2700, S235JR=7850"],
  ["tolerance", word("Tolerance [mm]"), "0.1"],
  ["without", word("Without parts"), "*/screw_*"],
  ["smaller", word("Without parts smaller than [mm]"), ""],
  ["unreachable", word("Without parts that nothing thicker can touch [mm]"), ""],
  ["triangles", word("Most triangles of a part"), "20000"],
  ["ground", word("Part that stands"), ""],
] as const;

/** What may be said of the file, as it was said last. */
function Options() {
  const given = bringing.value!.found?.options ?? {};
  const texts = useSignal<Record<string, string>>({});
  return (
    <details class="options">
      <summary>{said("Densities, and what is left out")}</summary>
      {OPTIONS.map(([name, title, example]) => (
        <label key={name}>
          {said(title)}{" "}
          <input
            value={texts.value[name] ?? String(given[name] ?? "").replaceAll(",", ", ")}
            placeholder={example}
            onInput={(event) => {
              texts.value = { ...texts.value, [name]: event.currentTarget.value };
            }}
          />
        </label>
      ))}
      <button type="button" onClick={() => void readAgain(texts.value)}>
        {said("Read it so")}
      </button>
    </details>
  );
}

function Found() {
  const found = bringing.value!.found!;
  const told = [
    ...found.accepted.map((text) => ["joint", text]),
    ...found.told.filter(([what]) => what !== "added"),
    ...found.left_out.map(({ name, why }) => ["left out", `${name}: ${why}`]),
    ...found.findings.map(({ level, subject, text }) => [level, `${subject}: ${text}`]),
  ];
  return (
    <>
      {told.length > 0 && (
        <ul class="told">
          {told.map(([what, text]) => (
            <li key={`${what} ${text}`}>
              <b>{what}</b> {text}
            </li>
          ))}
        </ul>
      )}
      {found.axes.length > 0 && found.accepted.length === 0 && <Axes />}
    </>
  );
}

function Axes() {
  const { axes } = bringing.value!.found!;
  const toggle = (number: number): void => {
    const now = new Set(marked.value);
    if (!now.delete(number)) now.add(number);
    marked.value = now;
  };
  return (
    <fieldset class="axes">
      <legend>{said("Axes that shapes speak for, the likeliest first")}</legend>
      {axes.map((axis, k) => (
        <label
          key={`${axis.between.join(" ")} ${axis.reason}`}
          title={axis.reason}
          onMouseEnter={() => {
            pointedAt.value = axis;
          }}
          onMouseLeave={() => {
            pointedAt.value = null;
          }}
        >
          <input
            type="checkbox"
            checked={marked.value.has(k + 1)}
            onFocus={() => {
              pointedAt.value = axis;
            }}
            onBlur={() => {
              pointedAt.value = null;
            }}
            onChange={() => toggle(k + 1)}
          />{" "}
          {axis.kind === "revolute" ? "⟳" : "⇄"} {axis.between[1]} → {axis.between[0]}
          <span class="unit"> {axis.reason}</span>
        </label>
      ))}
      <button
        type="button"
        disabled={marked.value.size === 0}
        onClick={() =>
          void readAgain(
            {},
            [...marked.value].sort((a, b) => a - b),
          )
        }
      >
        {said("Accept what is marked")}
      </button>
    </fieldset>
  );
}

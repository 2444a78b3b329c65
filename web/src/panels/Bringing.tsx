// A CAD file on its way into the draft: dropped or chosen, how far it is, what was found, axes to be accepted.

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { bring, bringing, marked, pointedAt, readAgain } from "../editing/bringing";
import { said, word } from "../words";
import { MistakeList } from "./MistakeList";

/** Endings of files that do not say their unit, or which axis is up. */
const SILENT = /\.(stl|obj|ply|off)$/;
const ACCEPTS =
  ".step,.stp,.p21,.igs,.iges,.3dxml,.glb,.gltf,.obj,.stl,.ply,.off,.3mf,.dae,.zae,.usd,.usda,.usdc,.usdz,.sdf,.urdf";

export function Bringing() {
  const over = useSignal(false);
  useEffect(() => {
    const files = (event: DragEvent): boolean => event.dataTransfer?.types.includes("Files") ?? false;
    const drag = (event: DragEvent): void => {
      if (!files(event)) return;
      event.preventDefault();
      over.value = event.type === "dragover";
    };
    const drop = (event: DragEvent): void => {
      drag(event);
      const file = event.dataTransfer?.files[0];
      if (file) void bring(file);
    };
    const listen = { dragover: drag, dragleave: drag, drop };
    for (const [name, act] of Object.entries(listen)) document.addEventListener(name, act as EventListener);
    return () => {
      for (const [name, act] of Object.entries(listen))
        document.removeEventListener(name, act as EventListener);
    };
  }, []);
  const now = bringing.value;
  return (
    <section class={`bringing ${over.value ? "over" : ""}`} aria-label={said("Bring a CAD file")}>
      <label class="bring">
        {said("Bring a CAD file")} <span class="unit">{said("or drop it anywhere on the page")}</span>
        <input
          type="file"
          accept={ACCEPTS}
          disabled={now !== null && now.saying !== ""}
          onChange={(event) => {
            const file = event.currentTarget.files?.[0];
            event.currentTarget.value = "";
            if (file) void bring(file);
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

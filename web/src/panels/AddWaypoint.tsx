// A waypoint more: of joints, where the robot stands, or a place of its tool point; the first one brings its source.

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { asking, change, draft, entries, mistakesAt, named, type Path, type Table } from "../editing/draft";
import { tidy } from "../editing/pose";
import { entrySchema, schema } from "../editing/schema";
import { frame, scene, select, selectedNodes } from "../page_state";
import type { Mistake, Taught } from "../wire";
import { said, word } from "../words";
import { useActions } from "./app_context";
import { Choice } from "./Choice";
import { MistakeList } from "./MistakeList";
import { type Put, putInto, SchemaForm } from "./SchemaForm";

/** How far a place begins above where the tool point is, along the z of its frame [m]. */
const ABOVE = 0.05;
/** How long the robot stands in its first waypoint, so that one alone is a motion [s]. */
const STANDS = 1;
const MOVES = { place: word("place of the tool point"), joints: word("joint positions") } as const;
type Given = keyof typeof MOVES;
/** What nobody assumes, and joint moves need. */
const FIGURES = ["joint_speed", "joint_acceleration", "joint_jerk"];

export function AddWaypoint({ close }: { close: () => void }) {
  const robots = entries.value.filter(({ group }) => group === "robots").map(({ name }) => name);
  const chosen = [...selectedNodes.value].map((name) => name.split("/")[0]!);
  const robot = useSignal(robots.find((name) => chosen.includes(name)) ?? robots[0] ?? "");
  const of = scene.value?.taught.find((each) => each.robot === robot.value);
  return (
    <div class="entry adding">
      <h2>{said("Add: {what}", { what: said("waypoint") })}</h2>
      <label>
        {said("Robot")}{" "}
        <select
          value={robot.value}
          onChange={(event) => {
            robot.value = event.currentTarget.value;
          }}
        >
          {robots.map((name) => (
            <option key={name} value={name}>
              {name}
            </option>
          ))}
        </select>
      </label>
      {of ? (
        <WaypointForm key={robot.value} of={of} close={close} />
      ) : (
        <>
          <p class="empty">{robot.value === "" ? said("Add a robot first.") : driven(robot.value)}</p>
          <div class="edit-bar">
            <button type="button" onClick={close}>
              {said("Cancel")}
            </button>
          </div>
        </>
      )}
    </div>
  );
}

const sources = (): Table[] => (draft.value?.tables.sources ?? []) as Table[];

function driven(robot: string): string {
  const source = sources().find((table) => table.robot === robot);
  const what = [source?.kind, source?.file].filter(Boolean).join(" ");
  return said("{robot} moves as {source} says: take that away in the file first.", {
    robot,
    source: what || "?",
  });
}

function WaypointForm({ of, close }: { of: Taught; close: () => void }) {
  const { toolPoint } = useActions();
  const given = useSignal<Given>(of.source === null ? "joints" : "place");
  const point = useSignal<Table>({});
  const figures = useSignal<Table>({});
  const begin = (): Table => {
    const name = `point_${of.points + 1}`;
    if (given.value === "joints")
      return { name, ...joints(of.robot), ...(of.source === null && { pause: STANDS }) };
    const tool = toolPoint(of);
    if (!tool) return { name, move: "joint" };
    tool.position[2] = tidy(tool.position[2]! + ABOVE, 4);
    return { name, move: "joint", at: tool };
  };
  useEffect(() => {
    point.value = begin();
  }, [given.value]);
  const path: Path = ["sources", of.source ?? sources().length];
  const ofPoint: Path = [...path, "points", of.source === null ? 0 : of.points];
  const elsewhere = ({ key }: Mistake): boolean =>
    key === named(ofPoint) || (of.source !== null && !key.startsWith(named(ofPoint)));
  const forms = schema.value && {
    point: entrySchema("waypoints", {}),
    source: entrySchema("sources", { kind: "waypoints" }),
  };
  const put = (table: typeof point) => (puts: readonly Put[]) => {
    table.value = putInto(table.value, puts);
  };
  const add = async (): Promise<void> => {
    const source = { kind: "waypoints", robot: of.robot, ...figures.value, points: [point.value] };
    const done =
      of.source === null
        ? await change({ kind: "add", path: ["sources"], value: source })
        : await change({ kind: "add", path: [...path, "points"], value: point.value });
    if (!done) return;
    close();
    const added = entries.value.filter((e) => named(e.path) === named(ofPoint)).at(-1);
    if (added) select({ kind: "owner", name: added.name });
  };
  return (
    <div data-entry={named(ofPoint)}>
      {of.source !== null && (
        <Choice
          name={said("Given as")}
          choices={["place", "joints"] as const}
          chosen={given}
          title={(one) => said(MOVES[one])}
        />
      )}
      {of.source === null && (
        <p class="kind">
          {said(
            "The first waypoint of {robot}, where it stands now. Nobody assumes how fast it goes to others.",
            { robot: of.robot },
          )}
        </p>
      )}
      <MistakeList mistakes={mistakesAt(path).filter(elsewhere)} keys />
      {forms?.source && of.source === null && (
        <SchemaForm
          schema={forms.source}
          table={figures.value}
          path={path}
          always={FIGURES}
          without={["name", "robot", "file", "points", "values", "tolerance"]}
          onChange={put(figures)}
        />
      )}
      {forms?.point && (
        <SchemaForm schema={forms.point} table={point.value} path={ofPoint} onChange={put(point)} />
      )}
      <div class="edit-bar">
        <button type="button" class="primary" disabled={!forms || asking.value} onClick={() => void add()}>
          {said("Add")}
        </button>
        <button type="button" onClick={close}>
          {said("Cancel")}
        </button>
      </div>
    </div>
  );
}

/** Where the robot stands now, in the unit that a person reads where all joints turn. */
function joints(robot: string): Table {
  const q = frame.peek()?.joints[robot];
  const turning = scene.peek()?.mechanisms.find(({ name }) => name === robot)?.joints ?? [];
  if (!q) return {};
  return turning.every(({ unit }) => unit === "rad")
    ? { q_deg: q.map((angle) => tidy((angle * 180) / Math.PI, 2)) }
    : { q: q.map((value) => tidy(value, 5)) };
}

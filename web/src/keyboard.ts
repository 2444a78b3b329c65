// The keys of the page; they do nothing while one writes or uses a control that needs them itself.

import { ask, mayEdit } from "./editing/draft";
import { gizmoMode } from "./editing/handles";
import { elsewhere, rows, select, selection, toggleMuted } from "./page_state";
import type { Actions } from "./panels/app_context";
import { keysShown } from "./panels/Keys";
import { worstOf } from "./posture/instants";
import { orderedRows } from "./row_order";
import type { TimeControl } from "./time_control";
import { mayMeasure, measuring, toggleMeasure } from "./view/measure";

const BACK = -1;
const AHEAD = 1;

/** Whether the focus was brought where it is by keys; a button that was clicked does not own the space bar. */
let byKeys = false;

export function listenToKeys(actions: Actions): void {
  window.addEventListener("pointerdown", () => {
    byKeys = false;
  });
  window.addEventListener("keydown", (event) => {
    if (event.key === "Tab") byKeys = true;
    const redo = event.shiftKey || event.key === "y";
    if ((event.ctrlKey || event.metaKey) && /^[zy]$/i.test(event.key) && mayEdit.peek()) {
      if (needsKeys(event.target, event.key)) return;
      event.preventDefault();
      void ask(redo ? "redo" : "undo");
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey || needsKeys(event.target, event.key)) return;
    // An open dialog takes its own keys, and time stands still behind it.
    if (keysShown.peek() && event.key !== "?") return;
    const act = actionOf(event.key, event.shiftKey, actions);
    if (!act) return;
    event.preventDefault();
    // A button that was clicked keeps the focus, and some browsers would press it again on release.
    if (event.target instanceof HTMLButtonElement && event.key === " ") event.target.blur();
    act();
  });
}

function actionOf(key: string, shift: boolean, actions: Actions): (() => void) | null {
  const { time } = actions;
  switch (key) {
    case " ":
      return () => time.toggle();
    case "ArrowLeft":
      return () => (shift ? time.seekBy(BACK) : time.step(BACK));
    case "ArrowRight":
      return () => (shift ? time.seekBy(AHEAD) : time.step(AHEAD));
    case "Home":
      return () => time.begin();
    case "End":
      return () => time.end();
    case "[":
      return () => time.violation(false);
    case "]":
      return () => time.violation(true);
    case "w":
    case "W":
      return () => visitWorst(time);
    case "f":
    case "F":
      return () => actions.frameSelection();
    case "l":
    case "L":
      return () => time.follow();
    case "m":
    case "M":
    case "r":
    case "R":
      if (!mayEdit.peek()) return null;
      return () => {
        gizmoMode.value = key.toLowerCase() === "m" ? "move" : "turn";
      };
    case "d":
    case "D":
      return mayMeasure.peek() ? toggleMeasure : null;
    case "?":
      return () => {
        keysShown.value = !keysShown.peek();
      };
    case "Escape":
      return () => {
        if (measuring.peek()) toggleMeasure();
        else select(null);
      };
    default:
      return overlay(key);
  }
}

// To the worst instant of the selected criterion, or of the run: what is worse at another time than here comes first.
function visitWorst(time: TimeControl): void {
  const chosen =
    selection.value?.kind === "criterion" ? selection.value.name : (elsewhere.value?.criteria[0] ?? null);
  const row = orderedRows.value.find(({ info }) => chosen === null || info.name === chosen);
  const instant = row && worstOf(row.info)[0];
  if (instant) time.visit(instant.t);
}

// 1 to 9: the markers of a criterion, in the order of the workstation file.
function overlay(key: string): (() => void) | null {
  const row = /^[1-9]$/.test(key) ? rows.value[Number(key) - 1] : undefined;
  return row ? () => toggleMuted(row.info.name) : null;
}

function needsKeys(target: EventTarget | null, key: string): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target.matches("input:not([type=checkbox]), select, textarea")) return true;
  if (key === " ") return target.matches("input") || (byKeys && target.matches("button"));
  return false;
}

// What can be done in the room with a mouse, and what happened there: controls, and the list of events.

import { controls, mayPull, press, pull, refused, release, standsAt } from "../doing";
import { soFar } from "../page_state";
import type { ControlInfo } from "../wire";
import { said, told } from "../words";
import { eventFigures, eventLine } from "./event_line";

export function Room() {
  const events = soFar.value?.events ?? [];
  return (
    <div class="room-tab">
      {controls.value.length > 0 && (
        <section aria-label={said("Controls")}>
          <h2>{said("Controls")}</h2>
          {controls.value.map((control) => (
            <ControlRow key={control.name} control={control} />
          ))}
          {!mayPull.value && <p>{said("Only a page of a live run that may track or control pulls them.")}</p>}
        </section>
      )}
      {refused.value && <p role="alert">{told(refused.value.reason)}</p>}
      <section aria-label={said("Events")}>
        <h2>{said("Events")}</h2>
        {events.length === 0 && <p>{said("Nothing has happened yet.")}</p>}
        {eventFigures(events).map((text) => (
          <p key={text}>{text}</p>
        ))}
        <ol class="events">
          {events.map((event, k) => (
            <li key={k}>{eventLine(event)}</li>
          ))}
        </ol>
      </section>
    </div>
  );
}

function ControlRow({ control }: { control: ControlInfo }) {
  const value = standsAt(control);
  const off = !mayPull.value;
  if (control.kind === "lever")
    return (
      <label>
        {control.name}
        <input
          type="range"
          min={control.lower}
          max={control.upper}
          step={(control.upper - control.lower) / 200}
          value={value}
          disabled={off}
          onInput={(event) => pull(control, Number(event.currentTarget.value))}
        />
      </label>
    );
  if (control.kind === "switch")
    return (
      <label>
        <input type="checkbox" checked={value > 0} disabled={off} onClick={() => press(control)} />
        {control.name}
      </label>
    );
  const let_go = (): void => release(control);
  return (
    <button
      type="button"
      aria-pressed={value > 0}
      disabled={off}
      onPointerDown={() => press(control)}
      onPointerUp={let_go}
      onPointerLeave={let_go}
      onBlur={let_go}
      onKeyDown={(event) => {
        if (event.key === " " && !event.repeat) press(control);
      }}
      onKeyUp={let_go}
    >
      {control.name}
    </button>
  );
}

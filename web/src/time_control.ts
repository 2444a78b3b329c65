// One set of controls for two kinds of time: a recording's player on the server, and a live run of which
// the worker keeps the last minutes.

import type { Action, ToWorker } from "./messages";
import { isLive, lookingAt, mayControl, now, reach, scene, traces, transport } from "./page_state";
import { stopAxis } from "./plots/axis";
import { neighbourViolation } from "./traces";

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4] as const;

export class TimeControl {
  private send: (message: ToWorker) => void = () => {};

  /** From now on, who is told. */
  connect(send: (message: ToWorker) => void): void {
    this.send = send;
  }

  /** Show the instant nearest to `t` [s]; in a live run, look back at it. */
  seek(t: number): void {
    const { start, end } = reach.value;
    // What is shown may be a little newer than what the reach was last told.
    const newest = isLive.value && now.value > end ? now.value : end;
    const to = Math.min(Math.max(t, start), newest);
    if (isLive.value) {
      stopAxis(to);
      lookingAt.value = to;
      this.send({ kind: "look", t: to });
    } else {
      this.command("seek", to);
    }
  }

  /** To the first instant that can be shown. */
  begin(): void {
    if (Number.isFinite(reach.value.start)) this.seek(reach.value.start);
  }

  /** To the last instant of a recording, or to the newest of a live run. */
  end(): void {
    if (isLive.value) this.follow();
    else this.seek(reach.value.end);
  }

  seekBy(seconds: number): void {
    if (Number.isFinite(now.value)) this.seek(now.value + seconds);
  }

  /** Play or pause a recording; hold or follow a live run. */
  toggle(): void {
    if (!isLive.value) this.command(transport.value.playing ? "pause" : "play");
    else if (lookingAt.value === null) this.seek(now.value);
    else this.follow();
  }

  /** Back to the newest of a live run. */
  follow(): void {
    if (!isLive.value) return;
    lookingAt.value = null;
    this.send({ kind: "look", t: null });
  }

  /** One recorded snapshot (or, while live, one tick) forward or back. */
  step(direction: 1 | -1): void {
    if (isLive.value) this.seekBy(direction * Math.max(scene.value?.period ?? 0, 0.04));
    else this.command("step", direction);
  }

  speed(factor: number): void {
    if (!isLive.value) this.command("speed", factor);
  }

  loop(on: boolean): void {
    if (!isLive.value) this.command("loop", on ? 1 : 0);
  }

  /** Show another run beside the one that is replayed, by its number among those that are offered; -1 for none. */
  beside(number: number): void {
    this.command("beside", number);
  }

  /** To where a limit begins to be exceeded, before or after the cursor. */
  violation(forward: boolean): void {
    const t = neighbourViolation(traces.values(), now.value, forward);
    if (t === null) return;
    if (!isLive.value && transport.value.playing) this.command("pause");
    this.seek(t);
  }

  /** To an instant that was looked up: whether it can be shown here. A live run keeps the last minutes. */
  visit(t: number): boolean {
    const { start } = reach.value;
    if (!mayControl.value) return false;
    if (isLive.value && t < start - 0.1) return false;
    if (!isLive.value && transport.value.playing) this.command("pause");
    this.seek(t);
    return true;
  }

  private command(action: Action, value: number | null = null): void {
    if (mayControl.value) this.send({ kind: "command", action, value });
  }
}

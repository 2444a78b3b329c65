// The page's scene in a notebook: what `Station.show` and `Summary.show` hand over, with a slider; nothing is fetched.

import { Decoder } from "@msgpack/msgpack";
import { completed } from "./completed";
import { Form } from "./form";
import { formatTime } from "./format";
import type { Frame } from "./messages";
import { beginScene, frame, stale } from "./page_state";
import { give } from "./scene/bodies";
import { Viewer } from "./scene/viewer";
import { STATE_ICONS, STATE_WORDS, stateOf, worstState } from "./verdicts";
import type { Scene, Snapshot } from "./wire";
import { said } from "./words";

interface Model {
  get(name: string): unknown;
}

const decoder = new Decoder();
const bytesOf = (view: DataView): Uint8Array => new Uint8Array(view.buffer, view.byteOffset, view.byteLength);

const STYLE = `
.seerob-run { color: #e6ecf4; background: #10151c; font: 13px/1.4 system-ui, sans-serif; position: relative; }
.seerob-run .room { position: relative; overflow: hidden; }
.seerob-run .room canvas { display: block; }
.seerob-run .bar { display: flex; gap: 8px; align-items: center; padding: 6px 8px; background: #151b24; }
.seerob-run input { flex: 1; min-width: 60px; }
.seerob-run button { font: inherit; color: inherit; background: #253040; border: 0; border-radius: 4px; padding: 2px 10px; }
.seerob-run output { font-variant-numeric: tabular-nums; }
`;

function render({ model, el }: { model: Model; el: HTMLElement }): () => void {
  const scene = decoder.decode(bytesOf(model.get("scene") as DataView)) as Scene;
  const meshes = model.get("meshes") as Record<string, DataView>;
  const frames = (model.get("frames") as DataView[]).map(bytesOf);
  for (const [hash, mesh] of Object.entries(meshes)) give(hash, bytesOf(mesh));

  const root = document.createElement("div");
  root.className = "seerob-run";
  const style = document.createElement("style");
  style.textContent = STYLE;
  const room = document.createElement("div");
  room.className = "room";
  room.style.height = `${model.get("height")}px`;
  const bar = document.createElement("div");
  bar.className = "bar";
  const play = document.createElement("button");
  const slider = document.createElement("input");
  Object.assign(slider, { type: "range", min: "0", max: String(frames.length - 1), value: "0", step: "1" });
  slider.setAttribute("aria-label", said("Time cursor"));
  const time = document.createElement("output");
  const verdict = document.createElement("output");
  const whole = document.createElement("span");
  whole.textContent = String(model.get("verdict"));
  bar.append(...(frames.length > 1 ? [play, slider] : []), time, verdict, whole);
  root.append(style, room, bar);
  el.append(root);

  const viewer = new Viewer(room);
  let block: Float32Array | null = null;
  const feed = {
    t: 0,
    read: () => {
      const next = block;
      block = null;
      return next;
    },
  };
  let shown = 0;
  let playing = false;
  let last = Number.NEGATIVE_INFINITY;
  beginScene(scene);
  stale.value = false;

  const show = (k: number): void => {
    shown = k;
    const snapshot = completed(decoder.decode(frames[k]!) as Snapshot);
    block = new Float32Array(snapshot.poses.slice().buffer);
    feed.t = snapshot.t;
    const { seq, t, joints, tracking, late, results, looks, doubts, sources } = snapshot;
    const next: Frame = { seq, t, joints, tracking, late, results, looks, doubts, sources };
    frame.value = next;
    viewer.show(new Form(structuredClone({ t, looks, doubts, results })));
    slider.value = String(k);
    time.value = formatTime(t);
    const state = worstState(results.map(stateOf));
    verdict.value = `${STATE_ICONS[state]} ${said(STATE_WORDS[state])}`;
  };
  const label = (): void => {
    play.textContent = playing ? "❚❚" : "▶";
    play.setAttribute("aria-label", said(playing ? "Pause (space)" : "Play (space)"));
  };
  play.onclick = () => {
    playing = !playing;
    if (playing && shown === frames.length - 1) show(0);
    label();
  };
  slider.oninput = () => {
    playing = false;
    label();
    show(Number(slider.value));
  };
  label();
  void viewer.begin(scene, feed).then(() => show(0));
  viewer.stage.run((now) => {
    if (playing && shown < frames.length - 1 && now - last >= SPACING_MS) {
      last = now;
      show(shown + 1);
    } else if (playing && shown === frames.length - 1) {
      playing = false;
      label();
    }
    viewer.tick(now);
  });
  return () => {
    viewer.stage.renderer.setAnimationLoop(null);
    viewer.stage.renderer.dispose();
    root.remove();
  };
}

/** Frames follow one another as they were taken, a 25th of a second apart in a run that is not long. */
const SPACING_MS = 40;

export default { render };

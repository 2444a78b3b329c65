// Where the page begins: connection, room, panels, keys.

import "uplot/dist/uPlot.min.css";
import "./look/index.css";
import { h, render } from "preact";
import { Connection } from "./connection";
import { connectDraft } from "./editing/draft";
import { connectMeasure } from "./editing/measure";
import { listenToKeys } from "./keyboard";
import { now, selectedNodes } from "./page_state";
import { App } from "./panels/App";
import { type Actions, ActionsContext } from "./panels/app_context";
import { Viewer } from "./scene/viewer";
import { TimeControl } from "./time_control";

declare global {
  interface Window {
    /** For tests and for the curious: where things are drawn, and when. */
    seerob?: {
      /** Run time of what is shown [s]. */
      readonly t: number;
      /** Position and quaternion (x, y, z, w) of a body as three.js has it, y up; null for an unknown name. */
      pose(name: string): { position: number[]; quaternion: number[] } | null;
      /** Colour of a score that a body is shown in, 0xrrggbb; null for its own or a verdict's. */
      tint(name: string): number | null;
      /** Whether a body is shown as one that may be elsewhere. */
      doubted(name: string): boolean;
      /** Where a point of the world (z up) [m] is on the screen [px]. */
      project(point: [number, number, number]): [number, number];
      /** Whether the pointer is on a handle of what is edited, or drags one. */
      readonly held: boolean;
    };
  }
}

const page = document.getElementById("page")!;

function begin(element: HTMLElement): void {
  const viewer = new Viewer(element);
  const connection = new Connection({
    scene: (scene, poses) => void viewer.begin(scene, poses),
    frame: (frame) => viewer.show(frame),
  });
  actions.time.connect((message) => connection.send(message));
  actions.offer = (tracking) => connection.send({ kind: "tracking", tracking });
  connectDraft((edit) => connection.send({ kind: "edit", edit }));
  connectMeasure((measure) => connection.send({ kind: "measure", measure }));
  actions.look = (preset) => viewer.viewpoint.go(preset);
  actions.frameSelection = () => {
    const names = selectedNodes.value;
    viewer.viewpoint.frame(names.size > 0 ? names : null);
  };
  viewer.stage.run((time) => {
    connection.tick(time);
    viewer.tick(time);
  });
  window.seerob = {
    get t() {
      return now.value;
    },
    pose: (name) => viewer.poseOf(name),
    tint: (name) => viewer.bodies.byName.get(name)?.tint ?? null,
    doubted: (name) => viewer.bodies.byName.get(name)?.doubted ?? false,
    project: (point) => viewer.project(point),
    get held() {
      return viewer.gizmo.held;
    },
  };
}

const actions: Actions = {
  time: new TimeControl(),
  look: () => {},
  offer: () => {},
  frameSelection: () => {},
};
listenToKeys(actions);
render(h(ActionsContext.Provider, { value: actions, children: h(App, { room: begin }) }), page);

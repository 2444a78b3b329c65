// Where the page begins: connection, room, panels, keys.

import "uplot/dist/uPlot.min.css";
import "./look/index.css";
import { effect } from "@preact/signals";
import { h, render } from "preact";
import { Matrix4 } from "three";
import { connectCompany, others, ownDevice, ownHuman } from "./company";
import { Connection } from "./connection";
import { connectDoing } from "./doing";
import { connectDraft } from "./editing/draft";
import { listenToKeys } from "./keyboard";
import type { ToWorker } from "./messages";
import { selectedNodes, shownAt } from "./page_state";
import { App } from "./panels/App";
import { type Actions, ActionsContext } from "./panels/app_context";
import { placeIn, whereIs } from "./scene/carried";
import { OwnPresence } from "./scene/own_presence";
import { LOOKS, roomLook } from "./scene/room_look";
import { Viewer } from "./scene/viewer";
import { theme } from "./theme";
import { TimeControl } from "./time_control";
import { cameraShown } from "./view/camera";
import { film } from "./view/film";
import { saveView } from "./view/kept";
import { connectMeasure } from "./view/measure";
import { connectReach } from "./view/reach";
import type { Register, Tracking, Verdict, VisitorInfo } from "./wire";
import { Visit } from "./xr/visit";

declare global {
  interface Window {
    /** For tests and for the curious: where things are drawn, and when. */
    seerob?: {
      /** Run time of what is shown [s]. */
      readonly t: number;
      /** Run time of the poses that bodies have [s]. */
      readonly posed: number;
      /** Position and quaternion (x, y, z, w) of a body as three.js has it, y up; null for an unknown name. */
      pose(name: string): { position: number[]; quaternion: number[] } | null;
      /** Colour of a score that a body is shown in, 0xrrggbb; null for its own or a verdict's. */
      tint(name: string): number | null;
      /** Bytes of a PNG file of the room as it is drawn, or with nothing kept. */
      picture(anew: boolean): Promise<number[]>;
      readonly keeps: boolean;
      /** Whether a body is shown as one that may be elsewhere. */
      doubted(name: string): boolean;
      /** Whether a body is not drawn, as it is real, and hides what is behind it. */
      occludes(name: string): boolean;
      /** Where a point of the world (z up) [m] is on the screen [px]. */
      project(point: [number, number, number]): [number, number];
      /** What is written in the room. */
      readonly written: string[];
      /** Verdict of each result whose markers are drawn there. */
      readonly drawn: Record<string, Verdict | null>;
      /** Whether the pointer is on a handle of what is edited, or drags one. */
      readonly held: boolean;
      /** Where a point of a visitor's room [m] is in three.js's own world, y up; null without a visit. */
      visited(point: [number, number, number]): [number, number, number] | null;
      /** The other visitors, with head and hands as they are drawn, in the world (z up) [m]. */
      readonly others: (VisitorInfo & Record<"head" | "left" | "right", number[] | null>)[];
      /** Where a button of the menu at a visitor's wrist is in that world [m]; null without one. */
      button(label: string): [number, number, number] | null;
      /** Where a point of that world is in the visitor's room [m]; null without a visit. */
      inRoom(point: [number, number, number]): [number, number, number] | null;
      /** What the visitor is asked to do so that it is known where the room lies; empty where nothing is asked. */
      readonly asked: string[];
      /** What the panels in the visitor's room say; empty without a visit. */
      readonly panels: string[];
    };
  }
}

const page = document.getElementById("page")!;

function begin(element: HTMLElement): void {
  effect(() => {
    roomLook.value = LOOKS[theme.value];
  });
  const viewer = new Viewer(element);
  const connection = new Connection({
    scene: (scene, poses) => void viewer.begin(scene, poses),
    drawn: (form, numbers) => viewer.show(form, numbers),
  });
  actions.time.connect((message) => connection.send(message));
  connectDraft((edit) => connection.send({ kind: "edit", edit }));
  connectDoing((doing) => connection.send({ kind: "doing", doing }));
  connectReach((measure) => connection.send({ kind: "measure", measure }));
  connectMeasure(
    (measure) => connection.send({ kind: "measure", measure }),
    (name, face) => viewer.turned(name, face),
  );
  connectCompany((said) => connection.send({ kind: "company", said }));
  const presence = new OwnPresence(viewer.stage, (message) => connection.send(message));
  let visit: Visit | null = null;
  actions.enter = async (mode, human) => {
    // Told with each picture: made once, as what is told is.
    let tracking: Extract<ToWorker, { kind: "tracking" }> | null = null;
    const offer = (message: Tracking | Register) => {
      if (message.type !== "tracking") return connection.send({ kind: "register", asked: message });
      tracking ??= { kind: "tracking", tracking: message };
      tracking.tracking = message;
      connection.send(tracking);
    };
    cameraShown.value = null;
    visit = await Visit.begin(viewer, mode, human, offer, actions.time);
    ownDevice.value = mode === "immersive-ar" ? "ar" : "vr";
    ownHuman.value = human ?? "";
    visit.session.addEventListener("end", () => {
      visit = null;
      ownDevice.value = "desk";
      ownHuman.value = "";
    });
    return visit.session;
  };
  actions.look = (preset) => viewer.viewpoint.go(preset);
  actions.frameSelection = () => {
    const names = selectedNodes.value;
    viewer.viewpoint.frame(names.size > 0 ? names : null);
  };
  actions.keepView = () => saveView(viewer.viewpoint.where());
  actions.goTo = (view) => viewer.viewpoint.stand(view);
  actions.picture = () => viewer.stage.picture();
  actions.film = () => film(viewer.stage);
  actions.toolPoint = ({ base, tip }) => {
    const point = new Matrix4();
    return whereIs(tip, viewer.bodies, point) ? placeIn(base, viewer.bodies, point) : null;
  };
  viewer.stage.run((time, frame) => {
    connection.tick(time);
    viewer.tick(time);
    visit?.tick(time, frame);
    presence.tick(time, visit);
  });
  window.seerob = {
    get t() {
      return ownDevice.peek() === "desk" ? shownAt[0]! : connection.shownT;
    },
    get posed() {
      return viewer.posedT;
    },
    pose: (name) => viewer.poseOf(name),
    tint: (name) => viewer.bodies.byName.get(name)?.tint ?? null,
    doubted: (name) => viewer.bodies.byName.get(name)?.doubted ?? false,
    occludes: (name) => viewer.bodies.byName.get(name)?.occludes ?? false,
    project: (point) => viewer.project(point),
    get written() {
      return viewer.markers.texts;
    },
    get drawn() {
      return Object.fromEntries(viewer.markers.drawn.map(({ name, verdict }) => [name, verdict]));
    },
    get held() {
      return viewer.gizmo.held;
    },
    picture: async (anew) => [...new Uint8Array(await (await viewer.stage.picture(anew)).arrayBuffer())],
    get keeps() {
      return viewer.stage.keeps;
    },
    visited: (point) => visit?.inWorld(point) ?? null,
    get others() {
      return others.value.map((info) => {
        const limbs = viewer.companions.limbsOf(info.id) ?? [];
        const seen = limbs.map(({ visible, position }) => (visible ? position.toArray() : null));
        return { ...info, head: seen[0] ?? null, left: seen[1] ?? null, right: seen[2] ?? null };
      });
    },
    button: (label) => visit?.button(label) ?? null,
    inRoom: (point) => visit?.inRoom(point) ?? null,
    get panels() {
      return visit?.panels ?? [];
    },
    get asked() {
      if (visit?.registering?.active) return visit.registering.lines;
      return visit?.fitting?.mesh.visible ? visit.fitting.lines : [];
    },
  };
}

const actions: Actions = {
  time: new TimeControl(),
  look: () => {},
  enter: () => Promise.reject(new Error("there is no room yet")),
  keepView: () => {},
  goTo: () => {},
  picture: () => Promise.reject(new Error("there is no room yet")),
  film: () => Promise.resolve(null),
  toolPoint: () => null,
  frameSelection: () => {},
};
listenToKeys(actions);
render(h(ActionsContext.Provider, { value: actions, children: h(App, { room: begin }) }), page);

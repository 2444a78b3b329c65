// What the page allocates for a picture, and whose it is: by V8's sampling heap profiler, which counts what is collected
// again, too.

/** V8 compiles what is called 300 times, which a headset reaches in seconds; by itself it waits for thousands of calls. */
export const COMPILED = "--js-flags=--invocation-count-for-maglev=50 --invocation-count-for-turbofan=300";
/** Pictures after which V8 has compiled all that each of them calls. */
export const WARM = 700;
/** Bytes between two samples: of small objects one in six is seen. */
const EVERY = 64;

/**
 * What runs in the page before its own code: each picture is done by a function `timed`, which notes when poses were taken
 * and done with. Told in arrays that are made once: measuring allocates nothing. V8 merges no proxy with its caller, so
 * that what the browser or an emulator allocates is not told as the page's. While `cost.held`, panels hear of no figures:
 * what is written four times a second is not each picture's.
 */
export const WRAPPED = `
(() => {
  const most = 1 << 16;
  const cost = { n: 0, begun: 0, held: false, taken: new Float64Array(most), done: new Float64Array(most), said: new Float64Array(most) };
  window.cost = cost;
  const apart = (act) => new Proxy(act, {});
  const made = (act) => {
    const own = apart(act);
    return function timed(time, frame) {
      const begun = performance.now();
      own(time, frame);
      const now = performance.now();
      const { seerob } = window;
      if (!seerob || !(seerob.posed >= 0) || cost.n >= most || seerob.posed === cost.last) return;
      cost.last = seerob.posed;
      const zero = cost.begun - performance.timeOrigin;
      cost.taken[cost.n] = begun - zero - 1000 * seerob.posed;
      cost.done[cost.n] = now - zero - 1000 * seerob.posed;
      cost.said[cost.n] = now - zero - 1000 * seerob.t;
      cost.n += 1;
    };
  };
  const wrapped = (own) => {
    const kept = new WeakMap();
    return apart(function (act) {
      if (!kept.has(act)) kept.set(act, made(act));
      return own.call(this, kept.get(act));
    });
  };
  window.requestAnimationFrame = wrapped(window.requestAnimationFrame);
  const session = window.XRSession?.prototype;
  if (session?.requestAnimationFrame) session.requestAnimationFrame = wrapped(session.requestAnimationFrame);
  const sources = session && Object.getOwnPropertyDescriptor(session, "inputSources");
  if (sources?.get) Object.defineProperty(session, "inputSources", { ...sources, get: apart(sources.get) });
  // Numbers of a point, which the browser makes anew each time.
  const point = DOMPointReadOnly.prototype;
  for (const key of ["x", "y", "z", "w"]) {
    const { get, ...rest } = Object.getOwnPropertyDescriptor(point, key);
    Object.defineProperty(point, key, { ...rest, get: apart(function toldByWebXR() { return get.call(this); }) });
  }
  const frame = window.XRFrame?.prototype;
  if (frame) for (const key of ["getPose", "getViewerPose"]) frame[key] = apart(frame[key]);
  const heard = Object.getOwnPropertyDescriptor(Worker.prototype, "onmessage");
  const set = function (act) {
    heard.set.call(this, (event) => {
      if (!cost.held || event.data.kind !== "frame") act(event);
    });
  };
  Object.defineProperty(Worker.prototype, "onmessage", { ...heard, set });
})();`;

/** Who hands on numbers of WebXR's poses: the browser makes each of them anew, as an object. */
const TOLD = "toldByWebXR";
/** What this measurement asks the page. */
const ASKED = ["get t", "get posed"];
/** Functions that write figures, or draw what is something else now: a few times a second, not once per picture. */
const FIGURES = ["publish", "paint", "renew"];

/**
 * Bytes by function, of what is done for a picture, of poses that WebXR tells for it, of three.js's own drawing in it, of
 * figures that are written in it, of what comes by message, and of the rest: panels and plots, at their own pace. What the
 * browser makes of a call is the caller's, of an emulator's or this measurement's nobody's. V8 tells what it has merged
 * into a function as that one's.
 */
function parted(head) {
  const into = {
    picture: new Map(),
    poses: new Map(),
    drawing: new Map(),
    figures: new Map(),
    heard: new Map(),
    panels: new Map(),
    theirs: new Map(),
  };
  const walk = ({ callFrame, selfSize, children }, part, ours) => {
    const { url, functionName, lineNumber, columnNumber } = callFrame;
    let within = functionName === "timed" ? "picture" : functionName.endsWith("onmessage") ? "heard" : part;
    if (within === "picture" && functionName.endsWith(".render")) within = "drawing";
    if (within === "picture" && FIGURES.includes(functionName)) within = "figures";
    // Functions of the browser's own have no line.
    const own = url.includes("/assets/") || (url === "" && lineNumber < 0 && (ours || within === "heard"));
    const asked = within === "picture" && ASKED.includes(functionName);
    const told = within === "picture" && functionName === TOLD;
    const to = into[told ? "poses" : own && !asked ? within : "theirs"];
    const key = `${functionName || "(anonymous)"}:${lineNumber}:${columnNumber}${url === "" && ours ? ` of ${ours}` : ""}`;
    to.set(key, (to.get(key) ?? 0) + selfSize);
    // Nor has a script that a test puts before the page an address, and its functions have lines.
    const mine = url.includes("/assets/")
      ? functionName || "(anonymous)"
      : url === "" && lineNumber < 0
        ? ours
        : "";
    for (const child of children) walk(child, within, mine);
  };
  walk(head, "panels", "");
  return into;
}

/** Pictures with other poses than the one before, since `WRAPPED` counts them. */
export const drawn = (page) => page.evaluate(() => window.cost.n);

/** Wait for so many more of them. */
export async function pass(page, pictures) {
  const until = (await drawn(page)) + pictures;
  await page.waitForFunction((n) => window.cost.n >= n, until, { polling: 200 });
}

/**
 * Bytes that are allocated per picture.
 *
 * @param cdp Session with the page's DevTools.
 * @param wait What is waited for meanwhile.
 * @returns `sum` [B per picture] by part, and `by` function in each: `picture` is the page's own.
 */
export async function allocated(page, cdp, wait) {
  await cdp.send("HeapProfiler.startSampling", {
    samplingInterval: EVERY,
    includeObjectsCollectedByMajorGC: true,
    includeObjectsCollectedByMinorGC: true,
  });
  const from = await drawn(page);
  await wait();
  const pictures = (await drawn(page)) - from;
  const { profile } = await cdp.send("HeapProfiler.stopSampling");
  const by = parted(profile.head);
  const sum = {};
  for (const [part, functions] of Object.entries(by)) {
    for (const [key, bytes] of functions) functions.set(key, bytes / pictures);
    sum[part] = [...functions.values()].reduce((a, b) => a + b, 0);
  }
  return { sum, by, pictures };
}

/** The functions of a part that allocate most, as text. */
export const most = (functions, count = 8) =>
  [...functions]
    .sort((a, b) => b[1] - a[1])
    .slice(0, count)
    .map(([key, bytes]) => `${bytes.toFixed(0).padStart(8)} ${key}`);

/** Have panels hear of no figures, or of all. */
export const hold = (page, held) =>
  page.evaluate((on) => {
    window.cost.held = on;
  }, held);

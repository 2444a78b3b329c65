// A real browser for the tests. Wait for states, never for milliseconds: frame rates mean nothing here.

import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { chromium } from "playwright-core";

// Both draw the room about as fast; Mesa's software renderer draws the page, too.
const MESA = fs.existsSync("/usr/share/glvnd/egl_vendor.d/50_mesa.json");
const SOFTWARE_GL =
  MESA && process.env.SOFTWARE_GL !== "swiftshader"
    ? ["--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist"]
    : // As a browser without a graphics card does by itself: the room by SwiftShader, the page by no renderer at all.
      ["--use-angle=swiftshader-webgl", "--enable-unsafe-swiftshader"];

const FLAGS = [
  "--headless=new",
  "--no-sandbox",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--force-prefers-reduced-motion",
  // A response that a test rewrote has no address, and its page could not reach this machine.
  "--disable-features=LocalNetworkAccessChecks",
  ...SOFTWARE_GL,
];

/** Path of the browser, or an error that says how to get one. */
export function browserPath() {
  const asked = process.env.CHROMIUM;
  const candidates = asked
    ? [asked]
    : ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
  const found = candidates.find((file) => fs.existsSync(file));
  if (found) return found;
  throw new Error(
    `no browser at ${candidates.join(", ")}: install one (apt-get install chromium) or set CHROMIUM to its path`,
  );
}

/**
 * Open a browser with an empty profile.
 *
 * @param view Size of the window, and `flags` of the command line.
 * @returns The page, everything it complained about, and `close`.
 */
export async function openBrowser({ width = 960, height = 640, flags = [] } = {}) {
  const executablePath = browserPath();
  const profile = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-web-"));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath,
    args: [...FLAGS, ...flags],
    env: MESA ? { ...process.env, EGL_PLATFORM: "surfaceless" } : process.env,
    ignoreDefaultArgs: ["--headless"],
    viewport: { width, height },
    colorScheme: "dark",
  });
  // For whatever is waited for: a loaded machine takes long, and a test that fails may.
  context.setDefaultTimeout(240_000);
  const page = context.pages()[0] ?? (await context.newPage());
  const complaints = [];
  const outside = [];
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") complaints.push(message.text());
  });
  page.on("request", (request) => {
    const { protocol, hostname } = new URL(request.url());
    if (!["data:", "blob:"].includes(protocol) && hostname !== "127.0.0.1") outside.push(request.url());
  });
  const close = async () => {
    await context.close();
    fs.rmSync(profile, { recursive: true, force: true, maxRetries: 5 });
  };
  return { page, context, complaints, outside, close };
}

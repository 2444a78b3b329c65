// The real `seerob edit`, as a process, and the page that it opens.

import { createInterface } from "node:readline";
import { python } from "./python.mjs";

/** An edit is checked as the whole file is; a loaded machine takes its time. */
const PATIENCE_MS = 240_000;

/**
 * Edit the workstation of a folder.
 *
 * @returns The address, and `close`, which returns when the command has ended.
 */
export async function edited(folder) {
  const child = python("-m", "seerob", "edit", folder, "--port", "0");
  const over = new Promise((resolve) => child.once("exit", resolve));
  let url;
  for await (const line of createInterface({ input: child.stdout })) {
    url = line.match(/http:\/\/\S+/)?.[0];
    if (url) break;
  }
  if (!url) throw new Error("seerob edit ended; its complaint is above");
  child.stdout.resume();
  const close = () => {
    child.kill("SIGINT");
    return over;
  };
  return { url, close };
}

/** Open the page and wait until it shows the file and where everybody begins. */
export async function showEdited(page, url) {
  page.setDefaultTimeout(PATIENCE_MS);
  await page.goto(url);
  await page.waitForSelector(".editor");
  await page.waitForFunction(() => Number.isFinite(window.seerob?.t));
}

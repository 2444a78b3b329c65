// The real `seerob replay`, as a process.

import { createInterface } from "node:readline";
import { python } from "./python.mjs";

/** Replay a recording: the address of its page, and `close`, which returns when the command has ended. */
export async function replayed(file) {
  const child = python("-m", "seerob", "replay", file, "--port", "0");
  const over = new Promise((resolve) => child.once("exit", resolve));
  for await (const line of createInterface({ input: child.stdout })) {
    const url = line.match(/http:\/\/\S+/)?.[0];
    if (!url) continue;
    child.stdout.resume();
    return {
      url,
      close: () => {
        child.kill("SIGINT");
        return over;
      },
    };
  }
  throw new Error("seerob replay ended; its complaint is above");
}

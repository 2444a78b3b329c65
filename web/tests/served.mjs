// The real server over a made-up workstation (serve.py), as a process that tests talk to.

import path from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { python } from "./python.mjs";

const HERE = path.dirname(fileURLToPath(import.meta.url));

/**
 * Start serving.
 *
 * @param {...string} options Options of serve.py, such as "--mode", "replay".
 * @returns The address, with `--tls` those of each role and `pin` of the certificate, `begun` (run time zero [s since 1970]), `tell` (a line in, its answer out), `signal` and `close`.
 */
export async function serve(...options) {
  const child = python(path.join(HERE, "serve.py"), ...options);
  const lines = createInterface({ input: child.stdout })[Symbol.asyncIterator]();
  const answer = async () => {
    const { value, done } = await lines.next();
    if (done) throw new Error(`serve.py ended with code ${child.exitCode}; its complaint is above`);
    return JSON.parse(value);
  };
  const { url, urls, pin, begun } = await answer();
  const tell = async (line) => {
    child.stdin.write(`${line}\n`);
    return answer();
  };
  const close = () =>
    new Promise((resolve) => {
      child.once("exit", resolve);
      child.stdin.end();
    });
  return { url, urls, pin, begun, tell, signal: (name) => child.kill(name), close };
}

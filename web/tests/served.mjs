// The real server over a made-up workstation (serve.py), as a process that tests talk to.

import { spawn } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";

const HERE = path.dirname(fileURLToPath(import.meta.url));
const ROOT = path.resolve(HERE, "../..");

function python() {
  if (process.env.PYTHON) return process.env.PYTHON;
  const local = path.join(ROOT, ".venv/bin/python");
  return fs.existsSync(local) ? local : "python3";
}

/**
 * Start serving.
 *
 * @param {...string} options Options of serve.py, such as "--mode", "replay".
 * @returns The address, `tell` (a line in, its answer out) and `close`.
 */
export async function serve(...options) {
  const source = path.join(ROOT, "src");
  const child = spawn(python(), [path.join(HERE, "serve.py"), ...options], {
    env: {
      ...process.env,
      PYTHONPATH: [source, process.env.PYTHONPATH].filter(Boolean).join(path.delimiter),
    },
    stdio: ["pipe", "pipe", "inherit"],
  });
  const lines = createInterface({ input: child.stdout })[Symbol.asyncIterator]();
  const answer = async () => {
    const { value, done } = await lines.next();
    if (done) throw new Error(`serve.py ended with code ${child.exitCode}; its complaint is above`);
    return JSON.parse(value);
  };
  const { url } = await answer();
  const tell = async (line) => {
    child.stdin.write(`${line}\n`);
    return answer();
  };
  const close = () =>
    new Promise((resolve) => {
      child.once("exit", resolve);
      child.stdin.end();
    });
  return { url, tell, close };
}

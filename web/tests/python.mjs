// The Python that has seerob, for tests that talk to the real thing.

import { spawn } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";

const ROOT = path.resolve(path.dirname(fileURLToPath(import.meta.url)), "../..");

function interpreter() {
  if (process.env.PYTHON) return process.env.PYTHON;
  const local = path.join(ROOT, ".venv/bin/python");
  return fs.existsSync(local) ? local : "python3";
}

/** Start Python on this checkout. */
export function python(...parameters) {
  const source = path.join(ROOT, "src");
  return spawn(interpreter(), parameters, {
    env: {
      ...process.env,
      PYTHONPATH: [source, process.env.PYTHONPATH].filter(Boolean).join(path.delimiter),
    },
    stdio: ["pipe", "pipe", "inherit"],
  });
}

/** What a short program prints as JSON. */
export async function askPython(program, input) {
  const child = python("-c", program);
  child.stdin.end(input);
  let told = "";
  for await (const piece of child.stdout) told += piece;
  return JSON.parse(told);
}

import { defineConfig } from "vite";

// The page with an emulated headset before it, beside a run that listens at port 8090: for a desktop browser, by
// `make demo-xr` only. What the wheel ships is built by ../vite.config.ts and has none of it.
const run = "http://127.0.0.1:8090";
const to = { target: run, changeOrigin: true, ws: true, rewriteWsOrigin: true, headers: { origin: run } };

export default defineConfig({
  root: new URL("..", import.meta.url).pathname,
  server: {
    host: "127.0.0.1",
    open: false,
    headers: {
      "Cross-Origin-Opener-Policy": "same-origin",
      "Cross-Origin-Embedder-Policy": "require-corp",
    },
    proxy: { "/ws": to, "/mesh": to, "/icon.svg": to },
  },
  worker: { format: "es" },
});

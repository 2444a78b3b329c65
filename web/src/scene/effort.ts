// How much may be drawn: without a graphics card every pixel is paid for by the processor that also
// runs the page, so shadows and smooth edges are left out there. What is said stays the same.

const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|microsoft basic render/i;

/** Whether pictures are drawn by the processor; `?draw=full` and `?draw=light` overrule it. */
export function drawnBySoftware(): boolean {
  const asked = new URLSearchParams(location.search).get("draw");
  if (asked === "full" || asked === "light") return asked === "light";
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) return false;
  const told = probe.getExtension("WEBGL_debug_renderer_info");
  const name = String(probe.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : probe.RENDERER));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

// The hatch of what is undecided, for canvases.

import { colorOf } from "../theme";

const TILE = 8;
const tiles = new Map<string, HTMLCanvasElement>();

export function hatchPattern(brush: CanvasRenderingContext2D): CanvasPattern {
  const color = colorOf("--undecided");
  let tile = tiles.get(color);
  if (!tile) {
    tile = paintTile(color);
    tiles.set(color, tile);
  }
  return brush.createPattern(tile, "repeat")!;
}

function paintTile(color: string): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = TILE;
  canvas.height = TILE;
  const brush = canvas.getContext("2d")!;
  brush.fillStyle = color;
  brush.globalAlpha = 0.28;
  brush.fillRect(0, 0, TILE, TILE);
  brush.globalAlpha = 1;
  brush.strokeStyle = color;
  brush.lineWidth = 2;
  for (const shift of [-TILE, 0, TILE]) {
    brush.beginPath();
    brush.moveTo(shift, TILE);
    brush.lineTo(shift + TILE, 0);
    brush.stroke();
  }
  return canvas;
}

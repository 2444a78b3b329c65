// The hatch of what is undecided, for canvases.

const TILE = 8;
let tile: HTMLCanvasElement | null = null;

export function hatchPattern(brush: CanvasRenderingContext2D): CanvasPattern {
  tile ??= paintTile();
  return brush.createPattern(tile, "repeat")!;
}

function paintTile(): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = TILE;
  canvas.height = TILE;
  const brush = canvas.getContext("2d")!;
  brush.fillStyle = "rgba(252, 234, 146, 0.28)";
  brush.fillRect(0, 0, TILE, TILE);
  brush.strokeStyle = "#fcea92";
  brush.lineWidth = 2;
  for (const shift of [-TILE, 0, TILE]) {
    brush.beginPath();
    brush.moveTo(shift, TILE);
    brush.lineTo(shift + TILE, 0);
    brush.stroke();
  }
  return canvas;
}

// A canvas in CSS pixels, sharp on any screen.

/** Fit a canvas to its element; its pen, width and height. */
export function sharp(canvas) {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  const wide = Math.round(width * ratio), high = Math.round(height * ratio);
  if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, {width: wide, height: high});
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return {pen, width, height};
}

export const FONT = "12px system-ui, sans-serif";
export const BOLD = "600 12px system-ui, sans-serif";

/** Text with an edge in the colour of its background, so that it can be read on anything. */
export function haloed(pen, text, x, y, colour, edge) {
  pen.lineWidth = 3;
  pen.lineJoin = "round";
  pen.strokeStyle = edge;
  pen.strokeText(text, x, y);
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
}

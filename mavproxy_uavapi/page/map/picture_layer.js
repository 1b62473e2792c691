// A picture of the owner's below the view, where three of its points say that it lies.

/**
 * Draw it; `corners` are [lat, lon] of its top left, top right and bottom left.
 * @param {CanvasRenderingContext2D} pen
 * @param {import("./camera.js").Camera} camera
 * @param {import("./projection.js").Projection} plane
 * @param {{image: ImageBitmap, corners: number[][]}} picture
 */
export function drawPicture(pen, camera, plane, {image, corners}) {
  const [[x, y], right, down] = corners.map(([lat, lon]) => camera.pixels(plane.metres(lat, lon)));
  const {width, height} = image;
  pen.save();
  pen.transform((right[0] - x) / width, (right[1] - y) / width, (down[0] - x) / height, (down[1] - y) / height, x, y);
  pen.drawImage(image, 0, 0);
  pen.restore();
}

// SPDX-License-Identifier: BSD-3-Clause
// Canvases that are drawn over the picture, sharp on any screen. A saved picture has them with more pixels:
// data-pixels.

export function sized(canvas) {
  const { width, height } = canvas.getBoundingClientRect();
  const pixels = Number(canvas.dataset.pixels) || Math.min(window.devicePixelRatio || 1, 3);
  const [w, h] = [Math.round(width * pixels), Math.round(height * pixels)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const context = canvas.getContext('2d');
  context.setTransform(pixels, 0, 0, pixels, 0, 0);
  context.clearRect(0, 0, width, height);
  const { color, fontFamily } = getComputedStyle(canvas);
  return { context, width, height, color, fontFamily };
}

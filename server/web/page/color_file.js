// SPDX-License-Identifier: BSD-3-Clause
// Colour maps that people have as files: ParaView's presets (JSON and XML), and lines of numbers.

const most = 33; // colours of a map that is written into links

// [[x, r, g, b]] with colours of 0..1
function pointsOf(text) {
  if (/^\s*[[{]/.test(text)) {
    const { RGBPoints: flat = [] } = [JSON.parse(text)].flat()[0] ?? {};
    return Array.from({ length: Math.floor(flat.length / 4) }, (_, i) => flat.slice(4 * i, 4 * i + 4));
  }
  if (/^\s*</.test(text)) {
    const points = [...new DOMParser().parseFromString(text, 'text/xml').querySelectorAll('Point')];
    return points.map((point) => ['x', 'r', 'g', 'b'].map((name) => Number(point.getAttribute(name))));
  }
  return pointsOfLines(text);
}

// 'r g b' or 'x r g b', of 0..1 or 0..255; other lines are words
function pointsOfLines(text) {
  const rows = text.split('\n')
                 .map((line) => line.trim().split(/[\s,;]+/).map(Number))
                 .filter((row) => [3, 4].includes(row.length) && row.every(Number.isFinite));
  const points = rows.map((row, i) => (row.length === 3 ? [i, ...row] : row));
  const scale = points.some(([, ...color]) => color.some((c) => c > 1)) ? 255 : 1;
  return points.map(([x, ...color]) => [x, ...color.map((c) => c / scale)]);
}

/** The name of the map in a file: its colours at equal distances, as colors.js has it. */
export function mapOfFile(text) {
  const points = pointsOf(text).sort((a, b) => a[0] - b[0]);
  if (points.length < 2 || !(points.at(-1)[0] > points[0][0]) || !points.flat().every(Number.isFinite))
    throw new Error(
      'the file has no colours: ParaView’s presets (JSON, XML) and lines of red, green and blue are read');
  const [first, last] = [points[0][0], points.at(-1)[0]];
  const even = points.length <= most
    && points.every(([x], i) => Math.abs((x - first) / (last - first) - i / (points.length - 1)) < 1e-3);
  const size = even ? points.length : most;
  const colorAt = (x) => {
    const next = Math.max(1, points.findIndex(([at]) => at >= x));
    const [[a, ...from], [b, ...to]] = [points[next - 1], points[next]];
    const t = b > a ? (x - a) / (b - a) : 1;
    return from.map((c, i) => Math.round(255 * Math.min(1, Math.max(0, c + t * (to[i] - c)))));
  };
  const hex = (color) => color.map((c) => c.toString(16).padStart(2, '0')).join('');
  return Array
    .from({ length: size }, (_, i) => hex(colorAt(i === size - 1 ? last : first + (i / (size - 1)) * (last - first))))
    .join('-');
}

// SPDX-License-Identifier: BSD-3-Clause
// Colour maps. The sequential ones are perceptually uniform, the diverging ones have a light middle; all of them are
// distinct with the common forms of colour blindness.

import { interpolateCividis, interpolateGreys, interpolateInferno, interpolateMagma, interpolatePlasma, interpolatePuOr, interpolateRdBu,
  interpolateTurbo, interpolateViridis } from 'd3-scale-chromatic';

// Straight from the first colour to the middle one, then to the last.
const between = (low, centre, high) => (t) => {
  const [from, to, x] = t < 0.5 ? [low, centre, 2 * t] : [centre, high, 2 * t - 1];
  return `rgb(${from.map((c, i) => Math.round(c + x * (to[i] - c)))})`;
};

const maps = {
  viridis: ['Viridis', interpolateViridis],
  cividis: ['Cividis', interpolateCividis],
  inferno: ['Inferno', interpolateInferno],
  magma: ['Magma', interpolateMagma],
  plasma: ['Plasma', interpolatePlasma],
  turbo: ['Turbo', interpolateTurbo],
  coolWarm: ['Cool to warm, diverging', between([59, 76, 192], [221, 221, 221], [180, 4, 38])],
  blueRed: ['Blue to red, diverging', (t) => interpolateRdBu(1 - t)],
  orangePurple: ['Orange to purple, diverging', interpolatePuOr],
  grey: ['Grey', (t) => interpolateGreys(1 - t)],
};

export const mapNames = Object.entries(maps).map(([key, [name]]) => [key, name]);

function channels(css) {
  const hex = /^#(..)(..)(..)$/.exec(css);
  return hex ? hex.slice(1).map((h) => parseInt(h, 16)) : css.match(/\d+/g).slice(0, 3).map(Number);
}

// A map's name may be its colours themselves, at equal distances: '3b4cc0-dddddd-b40426'.
const stops = /^[0-9a-f]{6}(-[0-9a-f]{6})+$/;

export const isMap = (name) => Object.hasOwn(maps, name) || stops.test(name);

function through(name) {
  const colors = name.split('-').map((hex) => channels(`#${hex}`));
  return (t) => {
    const i = Math.min(Math.floor(t * (colors.length - 1)), colors.length - 2);
    const part = t * (colors.length - 1) - i;
    return `rgb(${colors[i].map((c, k) => Math.round(c + part * (colors[i + 1][k] - c)))})`;
  };
}

// `size` colours from the lowest to the highest value, each [r, g, b] of 0..255.
export function colorTable(map, reversed, size) {
  const at = maps[map]?.[1] ?? (stops.test(map) ? through(map) : interpolateViridis);
  return Array.from({ length: size }, (_, i) => channels(at((reversed ? size - 1 - i : i) / (size - 1))));
}

export const cssGradient = (map, reversed, direction) =>
  `linear-gradient(${direction}, ${colorTable(map, reversed, 17).map((c) => `rgb(${c})`).join(', ')})`;

// The colour of lines over a colour: lighter on dark ones, darker on light ones.
export function lineColor(color) {
  const light = 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2];
  return color.map((c) => Math.round(light < 84 ? 0.61 * c + 0.39 * 255 : 0.45 * c));
}

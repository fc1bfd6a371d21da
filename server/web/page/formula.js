// SPDX-License-Identifier: BSD-3-Clause
// Functions of components of fields that colour pictures: what somebody types, von Mises, principal values. Of each
// there is
// a program for the decoder, one for the graphics processor, its value, and a bound of its error. Loaded when one is
// shown.

import { boundOf } from '../client/choose.js';
import { componentNames } from './levels.js';
import { mostFloat } from './numbers.js';

// As view_function.c numbers them.
const operations = [
  'number',
  'input',
  '+',
  '-',
  '*',
  '/',
  'sqrt',
  'abs',
  'negate',
  'min',
  'max',
  'norm',
  'mises',
  'principal',
];
const signs = { '−': '-', '×': '*', '·': '*', '÷': '/' };

// ---- from text

// `names`: of fields; those of several words are taken as they are, too, the longest first.
function wordsOf(text, names) {
  const words = [];
  const several = names.filter((name) => /^[\p{L}_][\p{L}\p{N}_:]*( [\p{L}\p{N}_:]+)+$/u.test(name));
  const word = [...several.sort((a, b) => b.length - a.length), '[\\p{L}_][\\p{L}\\p{N}_:]*'].join('|');
  const number = '\\d+\\.?\\d*(?:[eE][+-]?\\d+)?|\\.\\d+';
  const signsOf = '[-+*/^(),.−×·÷]';
  const pattern = new RegExp(`\\s*(?:(${number})|"([^"]*)"|((?:${word})(?![\\p{L}\\p{N}_:]))|(${signsOf}))`, 'uy');
  for (pattern.lastIndex = 0; pattern.lastIndex < text.trimEnd().length;) {
    const at = pattern.lastIndex;
    const found = pattern.exec(text);
    if (!found) throw new Error(`'${text.slice(at).trim()}' is not understood`);
    const [, digits, quoted, name, sign] = found;
    words.push(digits ? { number: Number(digits) } : sign ? { sign: signs[sign] ?? sign } : { name: quoted ?? name });
  }
  return words;
}

class Parser {
  #words;
  #fields;
  #at = 0;

  constructor(text, fields) {
    this.#words = wordsOf(text, fields.map(({ name }) => name));
    this.#fields = fields;
  }

  whole() {
    const node = this.#sum();
    if (this.#at < this.#words.length) throw new Error(`'${this.#told(this.#words[this.#at])}' is not expected there`);
    return node;
  }

  #told(word) {
    return word ? (word.sign ?? word.name ?? word.number) : 'the end';
  }

  #takes(...wanted) {
    return wanted.includes(this.#words[this.#at]?.sign) ? this.#words[this.#at++].sign : null;
  }

  #needs(sign) {
    if (!this.#takes(sign)) throw new Error(`'${sign}' is missing before ${this.#told(this.#words[this.#at])}`);
  }

  #sum() {
    let node = this.#product();
    for (let op; (op = this.#takes('+', '-'));) node = { op, args: [node, this.#product()] };
    return node;
  }

  #product() {
    let node = this.#signed();
    for (let op; (op = this.#takes('*', '/'));) node = { op, args: [node, this.#signed()] };
    return node;
  }

  #signed() {
    if (this.#takes('-')) return { op: 'negate', args: [this.#signed()] };
    return this.#power();
  }

  #power() {
    const base = this.#one();
    if (!this.#takes('^')) return base;
    const { number: times } = this.#words[this.#at++] ?? {};
    if (!(Number.isInteger(times) && times >= 1 && times <= 8))
      throw new Error('a power is a whole number from 1 to 8');
    return Array.from({ length: times - 1 }).reduce((node) => ({ op: '*', args: [node, base] }), base);
  }

  #one() {
    const word = this.#words[this.#at++];
    if (word?.number === Infinity) throw new Error('that number is too large');
    if (word?.number !== undefined) return { op: 'number', value: word.number };
    if (word?.sign === '(') {
      const node = this.#sum();
      this.#needs(')');
      return node;
    }
    if (word?.name === undefined) throw new Error(`a number or a field is missing before '${this.#told(word)}'`);
    return this.#takes('(') ? this.#call(word.name) : this.#component(word.name);
  }

  #component(name) {
    const field = this.#fields.find((f) => f.name === name);
    if (!field)
      throw new Error(`there is no field '${name}'; there are: ${this.#fields.map((f) => f.name).join(', ')}`);
    const names = componentNames(field.components);
    if (!this.#takes('.')) {
      if (field.components > 1)
        throw new Error(`'${name}' has components: ${names.map((c) => `${name}.${c}`).join(', ')}`);
      return { op: 'input', field: name, component: 0 };
    }
    const word = this.#words[this.#at++];
    const component = names.indexOf(String(word?.name ?? word?.number));
    if (component < 0) throw new Error(`'${name}' has the components ${names.join(', ')}, not '${this.#told(word)}'`);
    return { op: 'input', field: name, component };
  }

  // All components of a field by its name alone, or numbers one by one.
  #arguments() {
    const field = this.#fields.find((f) => f.name === this.#words[this.#at]?.name);
    if (field && this.#words[this.#at + 1]?.sign === ')') {
      this.#at += 2;
      return Array.from({ length: field.components }, (_, component) => ({
        op: 'input',
        field: field.name,
        component,
      }));
    }
    const args = [this.#sum()];
    while (this.#takes(',')) args.push(this.#sum());
    this.#needs(')');
    return args;
  }

  #call(name) {
    const args = this.#arguments();
    const has = (count) => {
      if (args.length !== count)
        throw new Error(`${name} takes ${count} number${count > 1 ? 's' : ''}, not ${args.length}`);
    };
    if (name === 'norm') return { op: 'norm', args };
    if (name === 'mises') return { op: 'mises', args: tensorOf(args, name) };
    if (/^principal[123]$/.test(name))
      return { op: 'principal', index: Number(name[9]) - 1, args: tensorOf(args, name) };
    if (name === 'sqrt' || name === 'abs') has(1);
    else if (name === 'min' || name === 'max') has(2);
    else
      throw new Error(
        `there is no function '${name}'; there are: sqrt, abs, min, max, norm, mises, principal1 to principal3`,
      );
    return { op: name, args };
  }
}

// xx yy zz xy yz xz; of nine components the symmetric part.
function tensorOf(args, name) {
  if (args.length === 6) return args;
  if (args.length !== 9) throw new Error(`${name} takes a tensor of 6 or 9 components, not ${args.length}`);
  const mean = (a, b) => ({
    op: '*',
    args: [
      { op: 'number', value: 0.5 },
      { op: '+', args: [args[a], args[b]] },
    ],
  });
  return [args[0], args[4], args[8], mean(1, 3), mean(5, 7), mean(2, 6)];
}

// ---- values

function principal([xx, yy, zz, xy, yz, xz]) {
  const p1 = xy * xy + yz * yz + xz * xz;
  const mean = (xx + yy + zz) / 3;
  const p = Math.sqrt(((xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * p1) / 6);
  if (!(p > 0)) return [mean, mean, mean];
  const [a, b, c, d, e, f] = [xx - mean, yy - mean, zz - mean, xy, yz, xz].map((x) => x / p);
  const half = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / 2;
  const angle = Math.acos(Math.min(1, Math.max(-1, half))) / 3;
  const high = mean + 2 * p * Math.cos(angle);
  const low = mean + 2 * p * Math.cos(angle + (2 * Math.PI) / 3);
  return [high, 3 * mean - high - low, low];
}

const mises = ([xx, yy, zz, xy, yz, xz]) =>
  Math.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (xy * xy + yz * yz + xz * xz));

const results = {
  '+': ([a, b]) => a + b,
  '-': ([a, b]) => a - b,
  '*': ([a, b]) => a * b,
  '/': ([a, b]) => a / b,
  sqrt: ([a]) => Math.sqrt(Math.max(a, 0)),
  abs: ([a]) => Math.abs(a),
  negate: ([a]) => -a,
  min: (args) => Math.min(...args),
  max: (args) => Math.max(...args),
  norm: (args) => Math.hypot(...args),
  mises,
  principal: (args, { index }) => principal(args)[index],
};

function valueOf(node, inputOf) {
  if (node.op === 'number') return node.value;
  if (node.op === 'input') return inputOf(node.field, node.component);
  return results[node.op](
    node.args.map((arg) => valueOf(arg, inputOf)),
    node,
  );
}

// ---- how far off: of each node between which values the original's and the level's are, and how far these are apart

const most = ({ low, high }) => Math.max(Math.abs(low), Math.abs(high));
const within = (centre, radius) => ({ low: centre - radius, high: centre + radius });

function product(a, b) {
  const all = [a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high];
  return { low: Math.min(...all), high: Math.max(...all), error: most(a) * b.error + most(b) * a.error };
}

function quotient(a, b) {
  if (b.low <= 0 && b.high >= 0) return { low: -Infinity, high: Infinity, error: Infinity };
  const least = Math.min(Math.abs(b.low), Math.abs(b.high));
  const inverse = { low: 1 / b.high, high: 1 / b.low, error: b.error / (least * least) };
  return product(a, inverse);
}

function root(a) {
  const low = Math.max(a.low, 0);
  const steep = low > 0 ? a.error / (2 * Math.sqrt(low)) : Infinity;
  return { low: Math.sqrt(low), high: Math.sqrt(Math.max(a.high, 0)), error: Math.min(Math.sqrt(a.error), steep) };
}

function magnitude(a) {
  const low = a.low > 0 ? a.low : a.high < 0 ? -a.high : 0;
  return { low, high: most(a), error: a.error };
}

// The distance of two tensors is at most that, as von Mises and principal values take it.
const frobenius = ([a, b, c, d, e, f]) => Math.sqrt(a * a + b * b + c * c + 2 * (d * d + e * e + f * f));
const signed = [
  [1, 1, 1],
  [-1, 1, 1],
  [1, -1, 1],
  [1, 1, -1],
];
const misesWithin = ([a, b, c, ...shear]) =>
  Math.max(...signed.map(([p, q, r]) => mises([p * a, q * b, r * c, ...shear])));

function ofTensor(args, node) {
  const centre = args.map(({ low, high }) => (low + high) / 2);
  const radius = args.map(({ low, high }) => (high - low) / 2);
  const errors = args.map(({ error }) => error);
  const value = results[node.op](centre, node);
  if (node.op === 'principal') return { ...within(value, frobenius(radius)), error: frobenius(errors) };
  const { low, high } = within(value, misesWithin(radius));
  return { low: Math.max(0, low), high, error: misesWithin(errors) };
}

const spans = {
  '+': ([a, b]) => ({ low: a.low + b.low, high: a.high + b.high, error: a.error + b.error }),
  '-': ([a, b]) => ({ low: a.low - b.high, high: a.high - b.low, error: a.error + b.error }),
  '*': ([a, b]) => product(a, b),
  '/': ([a, b]) => quotient(a, b),
  sqrt: ([a]) => root(a),
  abs: ([a]) => magnitude(a),
  negate: ([a]) => ({ low: -a.high, high: -a.low, error: a.error }),
  min: ([a, b]) => ({ low: Math.min(a.low, b.low), high: Math.min(a.high, b.high), error: Math.max(a.error, b.error) }),
  max: ([a, b]) => ({ low: Math.max(a.low, b.low), high: Math.max(a.high, b.high), error: Math.max(a.error, b.error) }),
  norm: (args) => {
    const all = args.map(magnitude);
    const length = (key) => Math.hypot(...all.map((a) => a[key]));
    return { low: length('low'), high: length('high'), error: length('error') };
  },
  mises: ofTensor,
  principal: ofTensor,
};

function spanOf(node, inputOf) {
  if (node.op === 'number') return { low: node.value, high: node.value, error: 0 };
  if (node.op === 'input') return inputOf(node.field, node.component);
  return spans[node.op](
    node.args.map((arg) => spanOf(arg, inputOf)),
    node,
  );
}

// ---- for the graphics processor

const literal = (x) => {
  const text = String(Math.fround(Math.min(x, mostFloat)));
  return /[.e]/.test(text) ? text : `${text}.0`;
};

const glslOf = {
  '+': (a, b) => `(${a} + ${b})`,
  '-': (a, b) => `(${a} - ${b})`,
  '*': (a, b) => `(${a} * ${b})`,
  '/': (a, b) => `(${a} / ${b})`,
  sqrt: (a) => `sqrt(max(${a}, 0.0))`,
  abs: (a) => `abs(${a})`,
  negate: (a) => `(-${a})`,
  min: (a, b) => `min(${a}, ${b})`,
  max: (a, b) => `max(${a}, ${b})`,
  norm: (...all) => `sqrt(${all.map((a) => `${a} * ${a}`).join(' + ')})`,
  mises: (...all) => `misesOf(vec3(${all.slice(0, 3)}), vec3(${all.slice(3)}))`,
};

const shaderFunctions = `
float misesOf(vec3 d, vec3 s) { vec3 e = d - d.yzx; return sqrt(0.5 * dot(e, e) + 3.0 * dot(s, s)); }
float principalOf(vec3 d, vec3 s, int index) {
  float mean = (d.x + d.y + d.z) / 3.0;
  vec3 e = d - mean;
  float p = sqrt((dot(e, e) + 2.0 * dot(s, s)) / 6.0);
  if (!(p > 0.0)) return mean;
  e /= p; s /= p;
  float h = 0.5 * (e.x * (e.y * e.z - s.y * s.y) - s.x * (s.x * e.z - s.y * s.z) + s.z * (s.x * s.y - e.y * s.z));
  float angle = acos(clamp(h, -1.0, 1.0)) / 3.0;
  float high = mean + 2.0 * p * cos(angle), low = mean + 2.0 * p * cos(angle + 2.0943951);
  return index == 0 ? high : index == 2 ? low : 3.0 * mean - high - low;
}`;

// ---- a function

export class Formula {
  #node;
  inputs = []; // [field, component], as the decoder gives them
  program = []; // [operation, number]

  constructor(text, fields) {
    this.text = text;
    this.#node = new Parser(text, fields).whole();
    this.#compile(this.#node);
    if (this.inputs.length > 32 || this.program.length > 256) throw new Error('that is too long');
  }

  #input({ field, component }) {
    const found = this.inputs.findIndex(([name, c]) => name === field && c === component);
    return found < 0 ? this.inputs.push([field, component]) - 1 : found;
  }

  #compile(node) {
    for (const arg of node.args ?? []) this.#compile(arg);
    const number = { number: node.value, norm: node.args?.length, principal: node.index }[node.op];
    this.program.push([operations.indexOf(node.op), node.op === 'input' ? this.#input(node) : (number ?? 0)]);
  }

  /** Names of the fields that it takes. */
  get fields() {
    return [...new Set(this.inputs.map(([field]) => field))];
  }

  /** Of a row of its inputs. */
  value(row) {
    return valueOf(this.#node, (field, component) => row[this.#input({ field, component })]);
  }

  /** Of what a probe found: {field: [components]}. */
  valueAt(values) {
    return valueOf(this.#node, (field, component) => values[field][component]);
  }

  /**
   * {low, high, bound, certified}: between which values it is, and how far that of a level is from the original's at
   * most; with `values` of a probe at that place.
   */
  at(info, level, values = null) {
    let certified = true;
    const { low, high, error } = spanOf(this.#node, (field, component) => {
      const own = boundOf(info, level, field, component);
      const { range } = info.fields.find(({ name }) => name === field);
      certified &&= own.certified;
      const known = values
        ? within(values[field][component], own.bound)
        : { low: range[0] - own.bound, high: range[1] + own.bound };
      return { ...known, error: own.bound };
    });
    return { low, high, bound: error, certified: certified && Number.isFinite(error) };
  }

  functions = shaderFunctions; // that shader() calls

  /** In GLSL, of its inputs' names there. */
  shader(names) {
    const of = (node) => {
      if (node.op === 'number') return literal(node.value);
      if (node.op === 'input') return names[this.#input(node)];
      const args = node.args.map(of);
      return node.op === 'principal'
        ? `principalOf(vec3(${args.slice(0, 3)}), vec3(${args.slice(3)}), ${node.index})`
        : glslOf[node.op](...args);
    };
    return of(this.#node);
  }
}

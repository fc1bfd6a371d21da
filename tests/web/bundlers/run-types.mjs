// SPDX-License-Identifier: BSD-3-Clause
// node run-types.mjs FOLDER FLOW CELLS SERIES PAGED: FOLDER has stream.d.ts. Holds uses.ts against these types under
// --strict, runs it on the package, and holds each value that comes against its type: a member of another type, one
// that is not there, and one that the types do not know are complaints. So is a member of the class that uses.ts leaves
// out.
import { readFileSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import ts from 'typescript';

const [, , folder, ...paths] = process.argv;
const types = resolve(folder, 'stream.d.ts');
const program = ts.createProgram(['uses.ts'], {
  strict: true,
  noEmit: true,
  exactOptionalPropertyTypes: true,
  noUncheckedIndexedAccess: true,
  target: ts.ScriptTarget.ES2022,
  module: ts.ModuleKind.NodeNext,
  moduleResolution: ts.ModuleResolutionKind.NodeNext,
  lib: ['lib.es2022.d.ts', 'lib.dom.d.ts', 'lib.dom.iterable.d.ts'],
  paths: { tetlod: [types] },
  types: [],
});
const checker = program.getTypeChecker();
const complaints = new Set();
for (const { file, start, messageText } of ts.getPreEmitDiagnostics(program)) {
  const { line } = file ? file.getLineAndCharacterOfPosition(start) : {};
  complaints.add(`${file?.fileName}:${line + 1}: ${ts.flattenDiagnosticMessageText(messageText, '\n')}`);
}

// ---- types by their names: 'Mesh', 'Events.level', 'TetlodStream.probe()', of which what it resolves to

const source = program.getSourceFile(types);
const declared = new Map(checker.getExportsOfModule(checker.getSymbolAtLocation(source)).map((s) => [s.name, s]));

function typeOf(name) {
  const [first, member] = name.split('.');
  const own = checker.getDeclaredTypeOfSymbol(declared.get(first));
  if (!member) return own;
  const symbol = own.getProperty(member.replace('()', ''));
  const type = checker.getTypeOfSymbol(symbol);
  if (!member.endsWith('()')) return type;
  return checker.getAwaitedType(type.getCallSignatures()[0].getReturnType());
}

// ---- values against types

const has = (type, flag) => (type.flags & flag) !== 0;
const primitives = [
  [ts.TypeFlags.String, 'string'],
  [ts.TypeFlags.Number, 'number'],
  [ts.TypeFlags.Boolean, 'boolean'],
];
const said = (value) => (ArrayBuffer.isView(value) ? value.constructor.name : JSON.stringify(value)?.slice(0, 60));

// What is wrong, or '' of a value that is of the type.
function wrong(value, type, at) {
  if (type.flags & (ts.TypeFlags.Any | ts.TypeFlags.Unknown)) return '';
  if (type.isUnion()) {
    const found = type.types.map((one) => wrong(value, one, at));
    const depth = (problem) => problem.split(' ')[0].length; // the one that fits best
    return found.every(Boolean) ? found.sort((a, b) => depth(b) - depth(a))[0] : '';
  }
  if (has(type, ts.TypeFlags.Null)) return value === null ? '' : `${at} is ${said(value)}, not null`;
  if (has(type, ts.TypeFlags.Undefined)) return value === undefined ? '' : `${at} is ${said(value)}, not undefined`;
  if (type.isLiteral()) return value === type.value ? '' : `${at} is ${said(value)}, not ${said(type.value)}`;
  if (has(type, ts.TypeFlags.BooleanLiteral))
    return `${value}` === checker.typeToString(type) ? '' : `${at} is ${value}`;
  for (const [flag, name] of primitives)
    if (has(type, flag)) return typeof value === name ? '' : `${at} is ${said(value)}, not a ${name}`;
  return value === null || typeof value !== 'object' ? `${at} is ${said(value)}` : wrongObject(value, type, at);
}

function wrongObject(value, type, at) {
  const name = type.symbol?.name;
  if (ArrayBuffer.isView(value) || /Array$/.test(name ?? ''))
    if (name !== 'Array')
      return value.constructor.name === name ? '' : `${at} is a ${value.constructor.name}, not a ${name}`;
  if (checker.isTupleType(type)) return wrongItems(value, checker.getTypeArguments(type), at);
  if (checker.isArrayType(type)) {
    const [item] = checker.getTypeArguments(type);
    return Array.isArray(value) ? wrongItems(value, Array(value.length).fill(item), at) : `${at} is no array`;
  }
  const index = type.getStringIndexType();
  for (const key of Object.keys(value)) {
    const symbol = checker.getPropertyOfType(type, key);
    if (!symbol && !index) return `${at}.${key} has no type`;
    const problem = wrong(value[key], symbol ? checker.getTypeOfSymbol(symbol) : index, `${at}.${key}`);
    if (problem && !(symbol && value[key] === undefined && symbol.flags & ts.SymbolFlags.Optional)) return problem;
  }
  const missing = checker
    .getPropertiesOfType(type)
    .find((symbol) => !(symbol.name in value) && !(symbol.flags & ts.SymbolFlags.Optional));
  return missing ? `${at}.${missing.name} is not there` : '';
}

function wrongItems(value, items, at) {
  if (!Array.isArray(value) || value.length !== items.length)
    return `${at} is ${said(value)}, not ${items.length} items`;
  return items.map((item, i) => wrong(value[i], item, `${at}[${i}]`)).find(Boolean) ?? '';
}

// ---- what uses.ts does

const told = new Set();
function tell(name, value) {
  told.add(name);
  const problem = wrong(value, typeOf(name), name);
  if (problem) complaints.add(problem);
  return value;
}

if (!complaints.size) {
  const { outputText } = ts.transpileModule(readFileSync('uses.ts', 'utf8'), {
    compilerOptions: { target: ts.ScriptTarget.ES2022, module: ts.ModuleKind.ESNext },
  });
  writeFileSync('uses.mjs', outputText);
  const { use } = await import(pathToFileURL(resolve('uses.mjs')));
  const [flow, cells, series, paged] = paths.map((path) => new Uint8Array(readFileSync(path)));
  await use({ flow, cells, series, paged }, tell);
  const text = readFileSync('uses.ts', 'utf8');
  for (const { name } of typeOf('TetlodStream').getProperties())
    if (!(name in EventTarget.prototype) && !new RegExp(`\\.${name}\\b|'${name}'`).test(text))
      complaints.add(`TetlodStream.${name} is used nowhere`);
  for (const name of ['Events.level', 'Events.step', 'Events.refined', 'Events.cells', 'Pictures'])
    if (!told.has(name)) complaints.add(`${name} did not come`);
}
console.log([...complaints].join('\n') || `${told.size} types hold`);
process.exit(complaints.size ? 1 : 0);

// SPDX-License-Identifier: BSD-3-Clause
// The licences of what is bundled: of every package from which a module came, and of the C library in the WebAssembly.
import { existsSync, readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';

const wasiNotice = '/usr/share/doc/wasi-libc/copyright'; // of Debian's package, from which the module is linked

const colours = 'node_modules/d3-scale-chromatic'; // whose colours page/colors.js has

const packageOf = (path) => /.*node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(path);

// A package has it in a file of its own, or at the end of its description.
function licenceOf(path) {
  const names = readdirSync(path);
  const file = names.find((name) => /^licen[cs]e(\.(md|txt))?$/i.test(name));
  if (file) return readFileSync(join(path, file), 'utf8').trim();
  const readme = names.find((name) => /^readme\.md$/i.test(name));
  const [section] = (readme && /^#*\s*licen[cs]e\b[^]*/im.exec(readFileSync(join(path, readme), 'utf8'))) || [];
  if (!section) throw new Error(`${path} has no licence to pass on`);
  return section.trim();
}

/** The text. `folder`: what paths are relative to; `metafiles` of esbuild. */
export function noticesOf(folder, metafiles) {
  const outputs = metafiles.flatMap((metafile) => Object.values(metafile.outputs));
  const used = outputs.flatMap(
    ({ inputs }) => Object.entries(inputs).filter(([, { bytesInOutput }]) => bytesInOutput > 0).map(([path]) => path));
  const found =
    new Map([...used, colours].map(packageOf).filter(Boolean).map(([path, name]) => [name, join(folder, path)]));
  const parts = [...found].sort(([a], [b]) => (a < b ? -1 : 1)).map(([name, path]) => {
    const { version, license } = JSON.parse(readFileSync(join(path, 'package.json'), 'utf8'));
    return `${name} ${version} (${license})\n\n${licenceOf(path)}`;
  });
  if (existsSync(wasiNotice)) parts.push(`wasi-libc\n\n${readFileSync(wasiNotice, 'utf8').trim()}`);
  return ['The page and the package of the web client contain code of others, under these licences.', ...parts]
    .join(`\n\n${'-'.repeat(78)}\n\n`)
    .concat('\n');
}

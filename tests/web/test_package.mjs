// SPDX-License-Identifier: BSD-3-Clause
// The package: by its name in node, and in a browser its worker, its module under a strict policy, its example.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { execFile } from 'node:child_process';
import { cpSync, existsSync, mkdirSync, readFileSync, readdirSync, symlinkSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { promisify } from 'node:util';
import { launch, openPage } from './browser.mjs';
import { ROOT, SCRATCH, fileHost, folderHost, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const { path } = sampleStream();
const folder = join(SCRATCH, 'package');
cpSync(join(ROOT, 'build/client'), folder, { recursive: true });
const { build } = createRequire(resolve(ROOT, 'server/web/package.json'))('esbuild');
const execute = promisify(execFile);
const browser = await launch();

// Each example as its first lines say; it ends at the level that its target asks for, and has drawn something.
async function shows(file, target, unit, server) {
  const host = await folderHost(folder);
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/${file}?url=${server.url}v1/meshes/fin`);
  const stream = await TetlodStream.open(`${server.url}v1/meshes/fin`);
  const { level } = await stream.refineTo(target);
  stream.close();
  await page.waitForFunction((text) => document.querySelector('output').value.startsWith(text), `level ${level}: `);
  assert.match(await page.locator('output').innerText(), new RegExp(`: [1-9]\\d* ${unit}$`));
  const shot = await page.screenshot();
  writeFileSync(join(SCRATCH, `${file.replace('.html', '')}.png`), shot);
  assert.ok(shot.length > 10000, `an empty picture of ${shot.length} bytes`);
  assert.deepEqual(page.complaints, []);
  page.context().once('close', () => host.close());
  return page;
}

async function theExamples() {
  await build({
    entryPoints: [join(folder, 'example-vtk.js')],
    bundle: true,
    format: 'esm',
    outfile: join(folder, 'example.bundle.js'),
    logLevel: 'error',
    nodePaths: [resolve(ROOT, 'server/web/node_modules')],
    alias: { tetlod: resolve(folder, 'stream.js'), 'tetlod/adapters.js': resolve(folder, 'adapters.js') },
  });
  const server = await program([path]);
  await (await shows('example.html', { error: 0.001, tets: 500000 }, 'tetrahedra', server)).context().close();
  await (await shows('example-canvas.html', { error: 0.01 }, 'triangles', server)).context().close();
  const { stdout } = await execute('node', [join(folder, 'example-node.mjs'), `${server.url}v1/meshes/fin`], {
    cwd: folder,
  });
  assert.match(stdout, /\nat 1 %: level \d+, \d+ tetrahedra, Pressure from \d[\d.]* to \d/);
  await server.stop();
}

// <tetlod-view>: what its attributes say is shown, and follows them; another source, and none.
async function anElement() {
  const server = await program([path]);
  const page = await shows('example-element.html', { error: 0.01 }, 'tetrahedra', server);
  const view = page.locator('tetlod-view');
  assert.deepEqual(await view.evaluate((v) => [v.stream.fields, new URLSearchParams(v.state).get('slices')]), [
    ['Pressure'],
    'y@0.5',
  ]);
  const settledAt = (error) =>
    page.waitForFunction(
      (e) =>
        document.querySelector('tetlod-view').seen?.settled && document.querySelector('tetlod-view').seen.error <= e,
      error,
    );
  await view.evaluate((v) => {
    v.addEventListener('level', ({ detail }) => {
      v.seen = detail;
    });
    v.addEventListener('error', ({ detail }) => {
      v.failure = detail.message;
    });
    v.setAttribute('error', '0.2%');
  });
  await settledAt(0.002);
  await view.evaluate((v) => v.setAttribute('field', 'Density'));
  await page.waitForFunction(() => document.querySelector('tetlod-view').stream.fields.includes('Density'));
  await view.evaluate((v) => v.setAttribute('field', 'Speed'));
  assert.match(await view.evaluate((v) => v.failure), /no field 'Speed'; there are: /);
  const bytes = readFileSync(path).toString('base64');
  await view.evaluate((v, text) => {
    v.seen = null;
    v.removeAttribute('field');
    v.source = new Blob([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))]);
  }, bytes);
  await settledAt(0.002);
  await view.evaluate((v) => v.remove());
  assert.deepEqual(page.complaints, []);
  await page.context().close();
  await server.stop();
}

async function worksUnderAStrictPolicy() {
  const server = await program([path]);
  const host = await folderHost(folder);
  host.headers = {
    'Content-Security-Policy':
      `default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; connect-src 'self' ${
        new URL(server.url).origin}`,
  };
  writeFileSync(join(folder, 'strict.html'), '<!doctype html><script type="module" src="./strict.js"></script>');
  writeFileSync(
    join(folder, 'strict.js'),
    `import { TetlodStream } from './stream.js';
    const stream = await TetlodStream.open('${server.url}v1/meshes/fin');
    const done = await stream.refineTo({ error: 0.01 });
    const { tets, positions } = await stream.mesh();
    window.result = { ...done, tets: tets.length / 4, vertices: positions.length / 3,
      expected: stream.info.levels[done.level] };`,
  );
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/strict.html`);
  const result = await (await page.waitForFunction(() => window.result, null)).jsonValue();
  assert.ok(result.reached);
  assert.equal(result.tets, result.expected.tets);
  assert.equal(result.vertices, result.expected.vertices);
  assert.deepEqual(page.complaints, []);
  await page.context().close();
  host.close();
  await server.stop();
}

// Chromium keeps ranges of one URL in its cache in ways that have given wrong bytes: what arrives is compared.
async function rangesOfOneUrl() {
  const files = await fileHost(readFileSync(path));
  files.pace = 20;
  const host = await folderHost(folder);
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/empty.html`);
  for (let round = 0; round < 2; round++) {
    const result = await page.evaluate(async (url) => {
      const { TetlodStream } = await import('./stream.js');
      const stream = await TetlodStream.open(url);
      const finest = stream.info.levels.length - 1;
      const controller = new AbortController();
      stream.addEventListener('progress', () => controller.abort(), { once: true });
      await stream.refineTo({}, { signal: controller.signal }).catch(() => {}); // or all came first
      for (const level of [finest >> 2, finest >> 1, 2, finest]) await stream.refineTo({ level });
      const { level, positions, tets } = await stream.mesh();
      stream.close();
      const digest = async (array) => [...new Uint8Array(await crypto.subtle.digest('SHA-256', array))].join();
      return { level, finest, positions: await digest(positions), tets: await digest(tets) };
    }, files.url);
    const stream = await TetlodStream.open(files.url);
    await stream.refineTo();
    const { positions, tets } = await stream.mesh();
    stream.close();
    const digest = (array) => [...createHash('sha256').update(array).digest()].join();
    assert.equal(result.level, result.finest);
    assert.deepEqual([result.positions, result.tets], [digest(positions), digest(tets)]);
  }
  assert.deepEqual(page.complaints, []);
  await page.context().close();
  files.close();
  host.close();
}

// As `npm install` of the folder leaves it.
async function resolvesByItsName() {
  const project = join(SCRATCH, 'project');
  mkdirSync(join(project, 'node_modules'), { recursive: true });
  symlinkSync(resolve(ROOT, 'build/client'), join(project, 'node_modules/tetlod'));
  const files = await fileHost(readFileSync(path));
  writeFileSync(
    join(project, 'main.mjs'),
    `import { TetlodStream } from 'tetlod';
    import { View } from 'tetlod/codec';
    const stream = await TetlodStream.open('${files.url}');
    await stream.refineTo({ tets: 5000 });
    const { tets } = await stream.mesh();
    console.log(JSON.stringify([typeof View.create, tets.length / 4, stream.info.levels[stream.level].tets]));
    stream.close();`,
  );
  // a stream that is closed keeps nothing alive: the program ends
  const { stdout } = await promisify(execFile)('node', ['main.mjs'], { cwd: project, timeout: 60000 });
  const [made, tets, expected] = JSON.parse(stdout);
  assert.equal(made, 'function');
  assert.ok(tets === expected && tets <= 5000);
  files.close();
  const { version, exports } = JSON.parse(readFileSync(resolve(ROOT, 'build/client/package.json')));
  assert.match(
    readFileSync(resolve(ROOT, 'format/tetlod.h'), 'utf8'),
    new RegExp(`TETLOD_VERSION_STRING "${version}"`),
  );
  for (const target of Object.values(exports).flatMap((value) =>
    typeof value === 'string' ? value : Object.values(value),
  ))
    assert.ok(existsSync(resolve(ROOT, 'build/client', target)), target);
  const types = readFileSync(resolve(ROOT, 'build/client/stream.d.ts'), 'utf8');
  const members = Object.getOwnPropertyNames(TetlodStream.prototype).filter((name) => name !== 'constructor');
  for (const name of members) assert.match(types, new RegExp(`\\b${name}\\(`), `stream.d.ts has ${name}`);
  const typed = /export interface Events \{([^]*?)\n\}/.exec(types)[1];
  const sources = ['client/engine.js', 'client/worker.js', 'client/stream.js']
    .map((file) => readFileSync(resolve(ROOT, 'server/web', file), 'utf8'))
    .join('\n');
  const events = new Set([...sources.matchAll(/(?:#emit|#dispatch|event:)\(? ?'(\w+)'/g)].map(([, name]) => name));
  for (const inner of ['read', 'broken']) assert.ok(events.delete(inner), inner);
  for (const name of events) assert.match(typed, new RegExp(`\\b${name}: `), `Events has ${name}`);
  assert.ok(events.has('started') && events.has('topology') && events.size >= 11, [...events].join());
}

// Licences of what is bundled go with it: in the package, and on the server beside the page.
async function itsNotices() {
  const server = await program([path]);
  const text = readFileSync(join(folder, 'notices.txt'), 'utf8');
  for (const [name, license] of [
    ['@kitware/vtk.js', 'Redistribution and use in source and binary forms'],
    ['gl-matrix', 'Permission is hereby granted'],
    ['d3-scale-chromatic', 'Permission to use, copy'],
  ])
    assert.match(text, new RegExp(`\\n${name} [\\d.]+ \\(.*\\)\\n[^]*?${license}`));
  assert.equal(await (await fetch(`${server.url}notices.txt`)).text(), text);
  const { devDependencies } = JSON.parse(readFileSync(resolve(ROOT, 'server/web/package.json'), 'utf8'));
  for (const file of readdirSync(resolve(ROOT, 'server/web/page')).filter((name) => name.endsWith('.js')))
    for (const [, name] of readFileSync(resolve(ROOT, 'server/web/page', file), 'utf8').matchAll(
      /(?:from|import) '((?:@[^/']+\/)?[^./'][^/']*)/g,
    ))
      assert.ok(devDependencies[name], `${file} imports ${name}, which package.json does not name`);
  await server.stop();
}

// What would be published: nothing is missing that the package names, nothing is there that nobody needs, and it works
// where it is installed from that file.
async function the_file_that_is_published() {
  const place = join(SCRATCH, 'packed');
  mkdirSync(place);
  const { stdout } = await execute('npm', ['pack', '--json', '--pack-destination', place], { cwd: folder });
  const [{ filename, files }] = JSON.parse(stdout);
  const names = files.map(({ path: name }) => name);
  const { exports, types } = JSON.parse(readFileSync(join(folder, 'package.json')));
  const named = Object.values(exports).flatMap((to) => (typeof to === 'string' ? [to] : Object.values(to)));
  for (const name of [...named, types]
    .map((name) => name.slice(2))
    .concat('README.md', 'LICENSE', 'notices.txt', 'inline.js'))
    assert.ok(names.includes(name), `${name} is missing`);
  assert.deepEqual(
    names.filter((name) => !/\.(js|mjs|d\.ts|wasm|html|json)$|^(README\.md|LICENSE|notices\.txt)$/.test(name)),
    [],
  );
  assert.match(readFileSync(join(folder, 'notices.txt'), 'utf8'), /vtk\.js[^]*Kitware/i);
  const modules = join(place, 'node_modules/tetlod');
  mkdirSync(modules, { recursive: true });
  await execute('tar', ['-xzf', join(place, filename), '-C', modules, '--strip-components', '1']);
  const code = `import { TetlodStream } from 'tetlod'; import { TetlodView } from 'tetlod/element.js';
    const stream = await TetlodStream.open(new Blob([(await import('node:fs')).readFileSync(process.argv[2])]));
    const { level } = await stream.refineTo({ error: 0.1 });
    console.log(typeof TetlodView, level, (await stream.mesh()).tets.length > 0); stream.close();`;
  writeFileSync(join(place, 'use.mjs'), code);
  const said = await execute('node', ['use.mjs', resolve(path)], { cwd: place });
  assert.match(said.stdout, /^function \d+ true\n$/);
}

await run([
  the_file_that_is_published,
  resolvesByItsName,
  itsNotices,
  rangesOfOneUrl,
  theExamples,
  anElement,
  worksUnderAStrictPolicy,
]);

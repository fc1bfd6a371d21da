// SPDX-License-Identifier: BSD-3-Clause
// The package as other people's projects meet it: Vite (built, and served for development), webpack, types under tsc
// --strict, modules from another origin, and streams that no URL brings.
import assert from 'node:assert/strict';
import { execFile, execFileSync } from 'node:child_process';
import { cpSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { promisify } from 'node:util';
import { launch, openPage } from './browser.mjs';
import { ROOT, SCRATCH, TETLOD, cellStream, folderHost, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const execute = promisify(execFile);
const project = resolve(SCRATCH, 'project');
const [major, minor] = process.versions.node.split('.').map(Number);
const old = major < 20 || (major === 20 && minor < 19) ? `Vite needs node 20.19, this is ${process.versions.node}` : '';

mkdirSync(join(project, 'src'), { recursive: true });
cpSync(join(ROOT, 'tests/web/bundlers'), project, { recursive: true });
if (!old)
  await execute(
    'npm',
    ['install', '--no-package-lock', '--ignore-scripts', '--no-audit', '--no-fund', '--loglevel=error'],
    { cwd: project },
  );
cpSync(join(ROOT, 'build/client'), join(project, 'node_modules/tetlod'), { recursive: true });
const tool = (name, file) => join(project, 'node_modules', name, file); // npx takes half a second to find it
const main = `import { TetlodStream } from 'tetlod';
const stream = await TetlodStream.open(new URLSearchParams(location.search).get('url'), { target: { error: 0.01 } });
const { level, reached } = await stream.refineTo({ error: 0.01 });
const { tets } = await stream.mesh();
window.result = { reached, tets: tets.length / 4, expected: stream.info.levels[level].tets };
`;
writeFileSync(join(project, 'src/main.js'), main);
writeFileSync(
  join(project, 'index.html'),
  '<!doctype html><title>t</title><link rel="icon" href="data:,"><script type="module" src="/src/main.js"></script>',
);

const { path } = sampleStream();
const server = await program([path]);
const browser = await launch();

async function opens(origin, file = '') {
  const page = await openPage(browser, origin);
  await page.goto(`${origin}/${file}?url=${server.url}v1/meshes/fin`);
  const result = await (await page.waitForFunction(() => window.result)).jsonValue();
  assert.ok(result.reached && result.tets === result.expected && result.tets > 100, JSON.stringify(result));
  await page.context().close();
}

async function a_fresh_vite_project() {
  if (old) return old;
  const vite = await import(pathToFileURL(createRequire(join(project, 'package.json')).resolve('vite')));
  await vite.build({ root: project, logLevel: 'error', build: { target: 'es2022' } });
  const host = await folderHost(join(project, 'dist'));
  await opens(host.origin, 'index.html');
  host.close();
  const development = await vite.createServer({
    root: project,
    logLevel: 'error',
    server: { port: 0, host: '127.0.0.1' },
  });
  await development.listen();
  await opens(`http://127.0.0.1:${development.httpServer.address().port}`);
  await development.close();
}

async function a_fresh_webpack_project() {
  if (old) return old;
  writeFileSync(
    join(project, 'webpack.config.mjs'),
    `export default { mode: 'production', entry: './src/main.js', output: { path: '${
      join(project, 'packed')}' }, experiments: { topLevelAwait: true } };`,
  );
  await execute('node', [tool('webpack', 'bin/webpack.js'), '--config', 'webpack.config.mjs'], { cwd: project });
  writeFileSync(
    join(project, 'packed/index.html'),
    '<!doctype html><title>t</title><link rel="icon" href="data:,"><script defer src="main.js"></script>',
  );
  const host = await folderHost(join(project, 'packed'));
  await opens(host.origin, 'index.html');
  host.close();
}

async function the_example_with_three() {
  if (old) return old;
  const { build } = createRequire(resolve(ROOT, 'server/web/package.json'))('esbuild');
  const folder = join(project, 'three');
  cpSync(join(ROOT, 'build/client'), folder, { recursive: true });
  await build({
    entryPoints: [join(folder, 'example-three.js')],
    bundle: true,
    format: 'esm',
    outfile: join(folder, 'example.bundle.js'),
    logLevel: 'error',
    alias: { tetlod: join(folder, 'stream.js'), 'tetlod/adapters.js': join(folder, 'adapters.js') },
  });
  const host = await folderHost(folder);
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/example.html?url=${server.url}v1/meshes/fin`);
  await page.waitForFunction(() => /^level \d+: \d{4,} tetrahedra$/.test(document.querySelector('output').value));
  const shot = await page.screenshot();
  writeFileSync(join(SCRATCH, 'example-three.png'), shot);
  assert.ok(shot.length > 10000, `an empty picture of ${shot.length} bytes`);
  assert.deepEqual(page.complaints, []);
  await page.context().close();
  host.close();
}

// The types are written by hand: each public member is held against the code, and one that is not there is found.
async function every_public_member_has_its_type() {
  if (old) return old;
  const types = join(project, 'types');
  mkdirSync(join(types, 'code'), { recursive: true });
  for (const file of ['stream.d.ts', 'element.d.ts'])
    cpSync(join(ROOT, 'client-examples/web', file), join(types, file));
  cpSync(join(ROOT, 'server/web/client/stream.js'), join(types, 'code/stream.js'));
  cpSync(join(ROOT, 'server/web/page/element.js'), join(types, 'code/element.js'));
  const compare = () => execute('node', ['compare-types.mjs', types], { cwd: project });
  await compare().catch((error) => assert.fail(error.stdout || error.message));
  const written = readFileSync(join(types, 'stream.d.ts'), 'utf8');
  writeFileSync(join(types, 'stream.d.ts'), written.replace('  compact(): Promise<void>;', '  compacted(): void;'));
  const wrong = await compare().catch(({ stdout }) => stdout);
  assert.match(
    String(wrong),
    /TetlodStream\.compacted: has a type, and is not there\nTetlodStream\.compact: has no type/,
  );
}

// Every member is used on streams of all kinds, as the types allow it, and what comes is what the types say; of a type
// that is wrong, of an argument or of a result, the same tells.
async function members_do_what_their_types_say() {
  if (old) return old;
  const steps = join(SCRATCH, 'steps/wake.pvd');
  mkdirSync(join(SCRATCH, 'steps'), { recursive: true });
  const made = (name, sample, ...options) => {
    const [mesh, stream] = [name === 'wake' ? steps : join(SCRATCH, `${name}.vtu`), join(SCRATCH, `${name}.tetlod`)];
    execFileSync(TETLOD, ['sample', ...sample, '-o', mesh], { stdio: 'ignore' });
    execFileSync(TETLOD, ['build', mesh, ...options, '-o', stream, '--quiet'], { stdio: 'ignore' });
    return resolve(stream);
  };
  const streams = [
    made('flow', ['fin', '--size', '12'], '--field', 'Density', '--field', 'Velocity', '--domain-error', '0'),
    resolve(cellStream().path),
    made('wake', ['wake', '--steps', '4', '--size', '6']),
    made('pages', ['cube', '--size', '16'], '--paged=1000'),
  ];
  const types = join(project, 'used');
  mkdirSync(types, { recursive: true });
  const check = () => execute('node', ['run-types.mjs', types, ...streams], { cwd: project });
  const written = readFileSync(join(ROOT, 'client-examples/web/stream.d.ts'), 'utf8');
  const write = (from, to) => writeFileSync(join(types, 'stream.d.ts'), written.replace(from, to));
  write('', '');
  await check().catch((error) => assert.fail(error.stdout || error.message));
  for (const [from, to, complaint] of [
    ['  numbers: Uint32Array;', '  numbers: Float64Array;', /DrawnMesh\.numbers is a Uint32Array, not a Float64Array/],
    ['{ within?: number', '{ within?: string', /uses\.ts:\d+: Type 'number' is not assignable to type 'string'/],
  ]) {
    assert.ok(written.includes(from), from);
    write(from, to);
    assert.match(String(await check().catch(({ stdout }) => stdout)), complaint);
  }
}

// <tetlod-view> in JSX, with a namespace of all modules and with React 19's.
async function the_element_in_jsx() {
  if (old) return old;
  const view =
    '<tetlod-view src="a" error={0.01} controls="bar player" ref={(view: TetlodView | null) => void view?.play()} />';
  const files = {
    'global.tsx':
      `import type {} from 'tetlod/jsx';\nimport type { TetlodView } from 'tetlod/element.js';\nexport const shown = ${
        view};\n`,
    'react.tsx':
      `import type {} from 'tetlod/react';\nimport type { TetlodView } from 'tetlod/element.js';\nexport const shown = ${
        view};\n`,
  };
  for (const [name, text] of Object.entries(files)) writeFileSync(join(project, 'src', name), text);
  const options = [
    '--noEmit',
    '--strict',
    '--skipLibCheck',
    '--target',
    'es2022',
    '--module',
    'nodenext',
    '--lib',
    'es2022,dom',
  ];
  writeFileSync(join(project, 'src/wrong.tsx'), files['react.tsx'].replace('src="a"', 'source="a"'));
  const check = (names, jsx, ...more) =>
    execute('node', [tool('typescript', 'bin/tsc'), ...options, ...more, '--jsx', jsx, ...names], {
      cwd: join(project, 'src'),
    }).then(
      () => '',
      ({ stdout, message }) => stdout || message,
    );
  assert.equal(await check(['global.tsx'], 'preserve', '--typeRoots', 'none'), '');
  const complaints = (await check(['react.tsx', 'wrong.tsx'], 'react-jsx')).trim().split('\n');
  assert.ok(complaints.every((line) => /^( |wrong\.tsx)/.test(line)), complaints.join('\n'));
  assert.match(complaints.join('\n'), /Property 'source' does not exist/);
}

// As from a CDN: a worker of another origin is not allowed.
async function modules_of_another_origin() {
  const library = await folderHost(join(project, 'node_modules/tetlod'));
  const site = join(SCRATCH, 'site');
  mkdirSync(site, { recursive: true });
  writeFileSync(
    join(site, 'index.html'),
    `<!doctype html><title>t</title><link rel="icon" href="data:,"><script type="module">${
      main.replace("'tetlod'", `'${library.origin}/stream.js'`)}</script>`,
  );
  const host = await folderHost(site);
  await opens(host.origin, 'index.html');
  host.close();
  library.close();
}

async function files_and_functions() {
  const host = await folderHost(join(project, 'node_modules/tetlod'));
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/empty.html`);
  const results = await page.evaluate(async (bytes) => {
    const { TetlodStream } = await import('./stream.js');
    const all = Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0));
    const asked = [];
    const sources = [
      new File([all], 'fin.tetlod'),
      {
        read: async (from, to) => {
          asked.push(to);
          return all.slice(from, to);
        },
      },
    ];
    const found = [];
    for (const source of sources) {
      const stream = await TetlodStream.open(source);
      await stream.refineTo({ error: 0.05 });
      const { level } = stream;
      const most = Math.max(...asked, 0);
      await stream.refineTo();
      const { tets } = await stream.mesh();
      found.push({ tets: tets.length / 4, expected: stream.info.tets, level, most, size: all.length });
      stream.close();
    }
    const refused = await TetlodStream.open({
      read: async () => {
        throw new Error('no such place');
      },
    }).catch((error) => error.message);
    const cut = await TetlodStream.open(new Blob([all.slice(0, 5000)])).catch((error) => error.message);
    return { found, refused, cut };
  }, readFileSync(path).toString('base64'));
  for (const { tets, expected } of results.found) assert.equal(tets, expected);
  assert.match(results.refused, /no such place/);
  assert.match(results.cut, /ends too early/);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
  await page.context().close();
  host.close();
}

await run([
  a_fresh_vite_project,
  a_fresh_webpack_project,
  the_example_with_three,
  every_public_member_has_its_type,
  members_do_what_their_types_say,
  the_element_in_jsx,
  modules_of_another_origin,
  files_and_functions,
]);

// SPDX-License-Identifier: BSD-3-Clause
// The page behind nginx at /some/prefix/, which the proxy takes off: nothing outside that path is asked for.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { existsSync, mkdirSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { join } from 'node:path';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { SCRATCH, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const nginx = ['/usr/sbin/nginx', '/usr/bin/nginx', '/usr/local/sbin/nginx'].find(existsSync);

async function freePort() {
  const probe = createServer();
  await new Promise((resolve) => probe.listen(0, '127.0.0.1', resolve));
  const { port } = probe.address();
  await new Promise((resolve) => probe.close(resolve));
  return port;
}

// nginx that gives what lies under /some/prefix/ to a server, without the prefix.
async function strippingProxy(server) {
  const port = await freePort();
  const place = join(SCRATCH, 'nginx');
  mkdirSync(place, { recursive: true });
  const temporary =
    ['client_body', 'proxy', 'fastcgi', 'uwsgi', 'scgi'].map((kind) => `${kind}_temp_path ${place}/${kind};`).join(' ');
  writeFileSync(join(place, 'nginx.conf'),
    `${process.getuid() ? '' : 'user root;'} daemon off; pid ${place}/pid; events { }
    http { ${temporary} access_log off; server { listen 127.0.0.1:${port}; location /some/prefix/ { proxy_pass ${
      server.url}; } } }\n`);
  const child =
    spawn(nginx, ['-p', place, '-e', join(place, 'error.log'), '-c', join(place, 'nginx.conf')], { stdio: 'ignore' });
  process.once('exit', () => child.kill());
  const origin = `http://127.0.0.1:${port}/some/prefix/`;
  for (;;) {
    const answer = await fetch(origin).catch(() => null);
    if (answer) return { origin, stop: () => child.kill() };
    assert.equal(child.exitCode, null, 'nginx ended');
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

async function page_and_viewer_stay_under_the_prefix() {
  const server = await program([sampleStream().path]);
  const proxy = await strippingProxy(server);
  const browser = await launch();
  const page = await openPage(browser, proxy.origin);
  await page.goto(proxy.origin);
  await page.getByText('Levels and files').click();
  const file = await page.getByRole('link', { name: 'VTU' }).first().getAttribute('href');
  const answer = await fetch(new URL(file, proxy.origin));
  assert.equal(answer.status, 200, await answer.text());
  await page.getByRole('link', { name: 'View' }).click();
  await firstPicture(page);
  await settled(page);
  assert.equal(page.url().split('#')[0], `${proxy.origin}view/fin`);
  const download = await page.locator('#download').getAttribute('href');
  assert.equal((await fetch(new URL(download, page.url()))).status, 200);
  await page.getByRole('link', { name: 'All streams' }).first().click();
  await page.getByRole('link', { name: 'View' }).waitFor();
  assert.equal(page.url(), proxy.origin);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
  await browser.close();
  proxy.stop();
  await server.stop();
}

if (!nginx) console.log('ok 1 - page_and_viewer_stay_under_the_prefix # SKIP no nginx\n1..1');
else await run([page_and_viewer_stay_under_the_prefix]);

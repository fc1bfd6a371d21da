// SPDX-License-Identifier: BSD-3-Clause
// Firefox for tests, on a screen of its own (without one it has no WebGL), driven by Marionette: messages of JSON after
// their length.
import { spawn } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { connect } from 'node:net';
import { join } from 'node:path';
import { SCRATCH } from './hosts.mjs';

const program = (...names) => names.find(existsSync);
const firefox = program('/usr/bin/firefox-esr', '/usr/bin/firefox');
const screen = program('/usr/bin/Xvfb');

/** Why there is none; empty: there is. */
export const missing =
  [[firefox, 'firefox-esr'], [screen, 'Xvfb']].filter(([there]) => !there).map(([, name]) => `no ${name}`).join(', ');

const pause = () => new Promise((resolve) => { setTimeout(resolve, 50); });

async function openScreen() {
  const child = spawn(screen, ['-displayfd', '3', '-screen', '0', '1200x900x24', '-nolisten', 'tcp'],
    { stdio: ['ignore', 'ignore', 'ignore', 'pipe'] });
  process.once('exit', () => child.kill());
  const display = await new Promise((resolve, reject) => {
    child.once('exit', () => reject(new Error('Xvfb ended')));
    child.stdio[3].once('data', (text) => resolve(`:${String(text).trim()}`));
  });
  return { display, close: () => child.kill() };
}

// What a script of Marionette's answers with.
class Remote {
  #socket; #waiting = new Map(); #last = 0; #received = Buffer.alloc(0);

  constructor(port) {
    this.#socket = connect(port, '127.0.0.1');
    this.#socket.on('data', (bytes) => this.#take(bytes));
  }

  #take(bytes) {
    this.#received = Buffer.concat([this.#received, bytes]);
    for (let colon; (colon = this.#received.indexOf(':')) >= 0;) {
      const end = colon + 1 + Number(this.#received.subarray(0, colon));
      if (this.#received.length < end) return;
      this.#hear(JSON.parse(this.#received.subarray(colon + 1, end)));
      this.#received = this.#received.subarray(end);
    }
  }

  #hear(message) {
    if (!Array.isArray(message)) return; // its greeting
    const [, id, error, value] = message;
    const { resolve, reject } = this.#waiting.get(id);
    this.#waiting.delete(id);
    if (error) reject(new Error(`${error.error}: ${error.message}`));
    else resolve(value);
  }

  call(name, parameters = {}) {
    const text = JSON.stringify([0, ++this.#last, name, parameters]);
    this.#socket.write(`${Buffer.byteLength(text)}:${text}`);
    return new Promise((resolve, reject) => this.#waiting.set(this.#last, { resolve, reject }));
  }

  close() {
    this.#socket.destroy();
  }
}

/** {goto(url), run(act, argument), close()}: `act`, an async function, runs in the page. */
export async function launchFirefox() {
  const profile = join(SCRATCH, 'firefox');
  mkdirSync(profile, { recursive: true });
  writeFileSync(
    join(profile, 'user.js'), 'user_pref("marionette.port", 0);\nuser_pref("webgl.force-enabled", true);\n');
  const { display, close } = await openScreen();
  const child = spawn(firefox, ['--no-remote', '--profile', profile, '--marionette'],
    { stdio: 'ignore', env: { ...process.env, HOME: profile, DISPLAY: display, LIBGL_ALWAYS_SOFTWARE: '1' } });
  process.once('exit', () => child.kill());
  const portFile = join(profile, 'MarionetteActivePort');
  while (!existsSync(portFile) || !readFileSync(portFile, 'utf8')) {
    if (child.exitCode !== null) throw new Error(`Firefox ended with ${child.exitCode}`);
    await pause();
  }
  const remote = new Remote(Number(readFileSync(portFile, 'utf8')));
  await remote.call('WebDriver:NewSession');
  await remote.call('WebDriver:SetTimeouts', { script: 120000, pageLoad: 120000 });
  return {
    goto: (url) => remote.call('WebDriver:Navigate', { url }),
    run: async (act, argument) => {
      const script = `const [argument, done] = arguments; (${
        act})(argument).then((value) => done({ value }), (error) => done({ error: String(error.stack ?? error) }));`;
      const { value: { value, error } } =
        await remote.call('WebDriver:ExecuteAsyncScript', { script, args: [argument ?? null], sandbox: null });
      if (error) throw new Error(error);
      return value;
    },
    close: () => {
      remote.close();
      child.kill();
      close();
    },
  };
}

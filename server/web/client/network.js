// SPDX-License-Identifier: BSD-3-Clause
// The bytes of a stream in order, from the server's routes or from any host of files; one request at a time.

const FIRST = 16384;    // header and index of most streams
const OPENING = 32768;  // of the first levels, if more is not needed yet
const LEAST = 1 << 17;  // that one request may ask for, if so much is needed; later ones as much as all before them, up to
const MOST = 1 << 20;
const longest = 30_000; // milliseconds without a byte, and between two attempts at most a third of it

/** A failure that trying again does not mend. */
export class FetchError extends Error {
  constructor(message) {
    super(message);
    this.name = 'FetchError';
  }
}

class Retry extends Error {
  constructor(message, after = 0) {
    super(message);
    this.after = after;
  }
}

export const sleep = (milliseconds, signal) => new Promise((resolve, reject) => {
  const stop = () => { clearTimeout(timer); reject(signal.reason); };
  const timer = setTimeout(() => { signal?.removeEventListener('abort', stop); resolve(); }, milliseconds);
  if (signal?.aborted) stop();
  signal?.addEventListener('abort', stop, { once: true });
});

// Seconds or a date (RFC 9110, 10.2.3), in milliseconds from now.
function retryAfter(headers) {
  const text = headers.get('Retry-After');
  if (!text) return 0;
  const wait = /^\d+$/.test(text.trim()) ? 1000 * Number(text) : Date.parse(text) - Date.now();
  return wait > 0 ? wait : 0;
}

async function failureOf(answer) {
  let detail = '';
  if (/json/.test(answer.headers.get('Content-Type') ?? '')) detail = (await answer.json().catch(() => ({}))).detail ?? '';
  else await answer.body?.cancel();
  if (answer.status === 416) return new FetchError(`the stream ends too early: ${answer.url} has no bytes there`);
  const message = `${answer.url}: ${detail || `${answer.status} ${answer.statusText}`}`;
  const passes = [408, 425, 429].includes(answer.status) || answer.status >= 500;
  return passes ? new Retry(message, retryAfter(answer.headers)) : new FetchError(message);
}

/** Is it a stream of a server, which has a description and immutable URLs? Everything else is a file. */
export const isServed = (url) => /\/v1\/meshes\/[^/]+\/?$/.test(new URL(url).pathname);

// An answer that is fine, or why it is not. A browser does not say that a host forbids other origins: the message has to.
async function ask(url, options) {
  let answer;
  try {
    answer = await fetch(url, options);
  } catch (error) {
    const foreign = globalThis.location && new URL(url).origin !== location.origin;
    const hint = foreign ? ' (is the host there, and does it allow other origins?)' : '';
    throw new Retry(`${url}: ${error.cause?.message || error.message}${hint}`);
  }
  if (answer.ok) return answer;
  throw await failureOf(answer);
}

/** Asks a server once for the description of a stream: {url, described}, or {failure}; Source.start takes it from there. */
export async function describe(url, signal) {
  try {
    const answer = await ask(url, { headers: { Accept: 'application/json' }, signal });
    const described = await answer.json().catch((error) => { throw new Retry(`${url}: ${error.message}`); });
    return { url: answer.url, described };
  } catch ({ message, after }) {
    return { failure: { message, after } };
  }
}

export class Source {
  #url; #signal; #retries; #onRetry;
  #routes = null;  // of the server: {level, records}, URL templates
  #levels = null;  // that the server has described
  #reader = null;  // of the answer that is being read
  #at = 0;         // of the stream: the next byte that it gives
  #end = 0;        // of what was asked for; Infinity: unknown
  #whole = false;  // Range is ignored: the answer is all of the file
  #validator = ''; // of the file that ranges are of

  /** `onRetry({attempt, delay, message})` is told of every failure that is tried again. */
  constructor(url, { signal, retries = 8, onRetry = () => {} } = {}) {
    this.#url = url;
    this.#signal = signal;
    this.#retries = retries;
    this.#onRetry = onRetry;
  }

  /** Takes up the first attempt to get the description of a stream that a server has; null for a file. */
  async start(first) {
    if (!isServed(this.#url)) return null;
    const { url, described } = await this.#persist(async () => {
      const found = first ?? await describe(this.#url, this.#signal);
      first = null;
      if (!found.failure) return found;
      const { message, after } = found.failure;
      throw after === undefined ? new FetchError(message) : new Retry(message, after);
    });
    const { levels, links } = described;
    if (!levels || !links) throw new FetchError(`${this.#url} does not describe a stream`);
    const absolute = (link) => new URL(link.replace(/\{\?.*?\}/, ''), url).href.replaceAll('%7B', '{').replaceAll('%7D', '}');
    this.#levels = levels;
    this.#routes = { level: absolute(links.level), records: absolute(links.records), stream: absolute(links.stream) };
    return described;
  }

  /** The next bytes from `position` on, at least one, of which those before `until` are needed. */
  read(position, until) {
    return this.#persist(() => this.#next(position, until));
  }

  /** Ends the request under way, unless the bytes after it would have to be asked for from the start. */
  pause() {
    if (!this.#whole) this.#drop();
  }

  close() {
    this.#drop();
  }

  #drop() {
    this.#reader?.cancel().catch(() => {});
    this.#reader = null;
    this.#whole = false;
  }

  async #persist(attemptOnce) {
    for (let attempt = 1; ; attempt++) {
      try {
        return await attemptOnce();
      } catch (error) {
        this.#drop();
        if (this.#signal?.aborted) throw this.#signal.reason;
        if (!(error instanceof Retry)) throw error;
        if (attempt > this.#retries) throw new FetchError(`${error.message} (${attempt} attempts)`);
        const delay = Math.max(error.after, Math.min(longest / 3, 250 * 2 ** attempt) * (0.75 + Math.random() / 2));
        this.#onRetry({ attempt, delay: delay / 1000, message: error.message });
        await sleep(delay, this.#signal);
      }
    }
  }

  async #next(position, until) {
    if (this.#reader && (this.#at > position || position >= this.#end)) this.#drop();
    if (!this.#reader) await (this.#routes ? this.#askRoutes(position, until) : this.#askRange(position, until));
    for (;;) {
      const chunk = await this.#chunk();
      const from = this.#at;
      this.#at += chunk.length;
      if (this.#at > position) return from < position ? chunk.subarray(position - from) : chunk;
    }
  }

  // What the answer gives next. An answer that is over too early, or silent for long, has failed.
  async #chunk() {
    let timer;
    const silence = new Promise((_, reject) => {
      timer = setTimeout(() => reject(new Retry(`${this.#url}: no byte came for ${longest / 1000} s`)), longest);
    });
    try {
      const reading = this.#reader.read().catch((error) => { throw new Retry(`${this.#url}: ${error.message}`); });
      const { done, value } = await Promise.race([reading, silence]);
      if (!done) return value;
    } finally {
      clearTimeout(timer);
    }
    if (this.#end === Infinity) throw new FetchError(`the stream ends too early: ${this.#url} has only ${this.#at} bytes`);
    throw new Retry(`${this.#url}: the answer ended ${this.#end - this.#at} bytes too early`);
  }

  #fetch(url, options = {}) {
    return ask(url, { ...options, signal: this.#signal });
  }

  #take(answer, at, end) {
    this.#reader = answer.body.getReader();
    this.#at = at;
    this.#end = end;
  }

  // Prefixes and records are immutable and each has its URL: browsers and proxies keep them whole.
  async #askRoutes(position, until) {
    const levels = this.#levels;
    const most = position + Math.min(Math.max(position, LEAST), MOST);
    const needed = position ? until : Math.max(until, OPENING);
    const first = levels.findIndex((level) => position < level.bytes);
    if (first < 0) throw new FetchError(`the stream ends at byte ${position}`);
    let last = first;
    while (last + 1 < levels.length && levels[last].bytes < needed && levels[last + 1].bytes <= most) last++;
    const { level, records, stream } = this.#routes;
    const path = first ? records.replace('{from}', first - 1).replace('{to}', last)
      : level.replace('{level}', last).replace('{format}', 'tetlod');
    try {
      this.#take(await this.#fetch(path), first ? levels[first].offset : 0, levels[last].bytes);
    } catch (error) {
      if (last === first || !(error instanceof FetchError)) throw error;
      // on a host of files there are the whole stream and single levels, nothing between
      this.#routes = null;
      this.#url = stream;
      await this.#askRange(position, until);
    }
  }

  // Any host of files. no-store: browsers' caches of ranges of one URL are a source of errors.
  async #askRange(position, until) {
    const end = Math.max(until, position ? 0 : FIRST);
    const answer = await this.#fetch(this.#url, { headers: { Range: `bytes=${position}-${end - 1}` }, cache: 'no-store' });
    const validator = answer.headers.get('ETag') ?? answer.headers.get('Last-Modified') ?? '';
    if (this.#validator && validator !== this.#validator) throw new FetchError(`${this.#url} has changed; open it again`);
    this.#validator = validator;
    if (answer.status !== 206) {
      this.#whole = true;
      this.#take(answer, 0, Infinity);
      return;
    }
    const [, start, stop] = /^bytes (\d+)-(\d+)\//.exec(answer.headers.get('Content-Range') ?? '') ?? [];
    this.#take(answer, start === undefined ? position : Number(start), stop === undefined ? end : Number(stop) + 1);
    if (this.#at > position) throw new FetchError(`${this.#url}: the server sent bytes from ${this.#at} on, not from ${position}`);
  }
}

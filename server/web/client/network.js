// SPDX-License-Identifier: BSD-3-Clause
// The bytes of a stream in order, from the server's routes or from any host of files; one request at a time.

import { chooseLevel, firstField } from './choose.js';

const OPENING = 32768;  // header, index and first levels of most streams, if more is not needed yet
const FIRST =
  65536; // of a file whose index is not known, if there is a target: as long on its way as its first answer is awaited
const LEAST =
  1 << 17; // that one request may ask for, if so much is needed; later ones as much as all before them, up to
const MOST = 1 << 20;
const longest = 30_000; // milliseconds without an answer or a byte, and between two attempts at most a third of it

/** A failure that stays when it is tried again. */
export class FetchError extends Error {
  constructor(message) {
    super(message);
    this.name = 'FetchError';
  }
}

/** Where the stream is in a file that begins with these bytes: the file itself, or one of HDF5 (SPEC 3.10). */
export function placeOf(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  const at = (place) => Number(view.getBigUint64(place, true));
  const points = bytes.length >= 24 && view.getUint32(0) === 0x89544c48;
  return points ? { base: at(8), size: at(16) } : { base: 0, size: Infinity };
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

const MAX_DELAY = 60_000; // milliseconds that a host may ask for between two attempts: somebody waits

// Seconds or a date (RFC 9110, 10.2.3), in milliseconds from now.
function retryAfter(headers) {
  const text = headers.get('Retry-After');
  if (!text) return 0;
  const wait = /^\d+$/.test(text.trim()) ? 1000 * Number(text) : Date.parse(text) - Date.now();
  return wait > 0 ? Math.min(wait, MAX_DELAY) : 0;
}

async function failureOf(answer) {
  let detail = '';
  if (/json/.test(answer.headers.get('Content-Type') ?? ''))
    detail = (await answer.json().catch(() => ({}))).detail ?? '';
  else await answer.body?.cancel();
  if (answer.status === 416) return new FetchError(`the stream ends too early: ${answer.url} has no bytes there`);
  const message = `${answer.url}: ${detail || `${answer.status} ${answer.statusText}`}`;
  const passes = [408, 425, 429].includes(answer.status) || answer.status >= 500;
  return passes ? new Retry(message, retryAfter(answer.headers)) : new FetchError(message);
}

function parsed(bytes, url) {
  try {
    return JSON.parse(new TextDecoder().decode(bytes));
  } catch (error) {
    throw new Retry(`${url}: ${error.message}`);
  }
}

// Is it a stream of a server, which has a description and immutable URLs? Everything else is a file.
const isServed = (url) => /\/v1\/meshes\/[^/]+\/?$/.test(new URL(url).pathname);

// An answer that is fine, or why it is not. A browser does not say that a host forbids other origins: the message has
// to.
// `signals`, of which some may be undefined, end the request, and so does a host that does not answer. Where signals
// cannot be
// joined, in older browsers, a request that nobody waits for ends with the worker.
async function ask(url, { signals, ...options }) {
  const stop = new AbortController();
  const silent = setTimeout(() => stop.abort(new Error(`no answer came for ${longest / 1000} s`)), longest);
  const signal = AbortSignal.any?.([stop.signal, ...signals.filter(Boolean)]) ?? stop.signal;
  let answer;
  try {
    answer = await fetch(url, { ...options, signal });
  } catch (error) {
    const foreign = globalThis.location && new URL(url).origin !== location.origin;
    const hint = foreign ? ' (is the host there, and does it allow other origins?)' : '';
    throw new Retry(`${url}: ${error.cause?.message || error.message}${hint}`);
  } finally {
    clearTimeout(silent);
  }
  if (answer.ok) return answer;
  throw await failureOf(answer);
}

const budgets = { error: 'error', absError: 'abs_error', level: 'level', tets: 'tets', bytes: 'bytes' };

// '+' stands for itself in the server's queries: no URLSearchParams.
export const query = (values) =>
  Object.entries(values).map(([key, value]) => `${key}=${encodeURIComponent(value)}`).join('&');

// A list in a query has commas between the names.
export const canList = (names) => !names.some((name) => name.includes(','));

// The query of a server's prefix for a target. It takes one budget; of several, the first levels are a beginning.
function prefixQuery({ field, measure, ...target } = {}, fields) {
  const given = Object.keys(budgets).filter((key) => target[key] !== undefined);
  return query({
    ...(given.length === 1 ? { [budgets[given[0]]]: target[given[0]] } : { bytes: OPENING }),
    ...(field !== undefined && { field }),
    ...(measure !== undefined && { measure }),
    ...(fields !== undefined && { fields }),
  });
}

export class Source {
  #url; #request; #signal; #retries; #onRetry; #onBytes;
  #target;           // what the first request asks for
  #least;            // of a file: bytes that its first request asks for
  #served;           // by a server's routes; else ranges of a file
  // A server's description: the first attempt to get it, which is on its way together with the first bytes.
  #early = null;
  #routes = null;    // of the server: {level, records, stream}, URL templates
  #answer = null;    // {reader, at, end} that is being read: at its next byte of the stream; end Infinity: unknown
  #ahead = null;     // {at, answer}: the one after it, asked for already
  #paused = false;   // the read that waits is to end without bytes
  #whole = null;     // the file, of a host that knows no ranges, if more than the beginning was needed
  #validator = '';   // of the file that ranges are of
  fields;            // names of those that are wanted; undefined: all; 'first': not known yet which that is
  partial = false;   // the server leaves out other fields: offsets and lengths are of what it sends
  cid = '';          // of the stream, once it is known: all bytes must be of the same one
  levels = null;     // {offset, bytes}: of the server's, or set to what comes without some fields
  base = 0;          // where the stream begins in a file of HDF5
  #size = Infinity;  // then: its bytes
  #placed = false;   // it is known whether it is in one

  /** `headers` and `credentials` are fetch's. `onRetry({attempt, delay, message})` is called for every failure that is
   * tried again, `onBytes(count)` for all
   *  bytes of answers, also of those that are asked for once more or given up. */
  constructor({ url, headers, credentials },
    { target, fields, signal, retries = 8, onRetry = () => {}, onBytes = () => {} } = {}) {
    this.#url = url;
    this.#request = { headers, credentials };
    this.#served = isServed(url);
    if (fields === 'first' ? this.#served : fields && canList(fields)) this.fields = fields;
    this.#target = target;
    this.#least = target ? FIRST : OPENING;
    this.#signal = signal;
    this.#retries = retries;
    this.#onRetry = onRetry;
    this.#onBytes = onBytes;
    if (!this.#served) return;
    this.#early = this.#askDescription();
    this.#early.catch(() => {}); // whoever needs it hears of it
  }

  /**
   * The next bytes from `position` on, of which those before `until` are needed: at least one, or none after pause().
   */
  read(position, until) {
    this.#paused = false;
    return this.#persist(async () => {
      try {
        if (!this.#paused) return await this.#next(position, until);
      } catch (error) {
        this.#drop();
        if (!this.#paused) throw error;
      }
      return new Uint8Array();
    });
  }

  /**
   * Bytes from elsewhere in the stream: by an address that a server has for just these, a function of its routes, else
   * as a range.
   */
  apart(offset, size, { addressOf = () => null, signal } = {}) {
    return this.#persist(async () => {
      const first = offset + this.base;
      if (this.#whole) return this.#whole.subarray(first, first + size);
      if (this.#served && !this.#routes) await this.#findRoutes();
      const address = this.#routes && addressOf(this.#routes);
      if (!address) return this.#askApart(first, size, signal);
      const answer = await this.#fetch(address, { signal }).catch((error) => {
        if (error instanceof FetchError) return null; // a host of files has the stream only
        throw error;
      });
      return answer ? this.#all(answer, size) : this.#askApart(first, size, signal);
    }, signal);
  }

  async #askApart(offset, size, signal) {
    const range = { Range: `bytes=${offset}-${offset + size - 1}` };
    const answer = await this.#fetch(this.#routes?.stream ?? this.#url, { headers: range, cache: 'no-store', signal });
    if (answer.status === 206) return this.#all(answer, size);
    this.#whole = new Uint8Array(await answer.arrayBuffer()); // a host without ranges: once
    this.#onBytes(this.#whole.length);
    return this.#whole.subarray(offset, offset + size);
  }

  async #all({ body }, size) {
    const bytes = new Uint8Array(size);
    const answer = { reader: body.getReader(), at: 0, end: size };
    while (answer.at < size) {
      const chunk = await this.#chunk(answer);
      bytes.set(chunk.subarray(0, size - answer.at), answer.at);
      answer.at += chunk.length;
    }
    return bytes;
  }

  /**
   * Ends the requests under way, unless little is left of them or their bytes would have to be asked for from the
   * start.
   */
  pause() {
    const { at, end } = this.#answer ?? {};
    if (end !== Infinity && !(end - at <= OPENING)) {
      this.#paused = true;
      this.#drop();
    }
    this.#dropAhead();
  }

  close() {
    this.#drop();
  }

  #drop() {
    if (this.#answer?.at < this.#answer?.end)
      this.#answer.reader.cancel().catch(() => {}); // else its connection may be used again
    this.#answer = null;
    this.#dropAhead();
  }

  #dropAhead() {
    this.#ahead?.answer.then(({ reader }) => reader.cancel()).catch(() => {});
    this.#ahead = null;
  }

  async #persist(attemptOnce, signal = this.#signal) {
    for (let attempt = 1; ; attempt++) {
      try {
        return await attemptOnce();
      } catch (error) {
        for (const stop of [this.#signal, signal]) stop?.throwIfAborted();
        if (!(error instanceof Retry)) throw error;
        if (attempt > this.#retries) throw new FetchError(`${error.message} (${attempt} attempts)`);
        const delay = Math.max(error.after, Math.min(longest / 3, 250 * 2 ** attempt) * (0.75 + Math.random() / 2));
        this.#onRetry({ attempt, delay: delay / 1000, message: error.message });
        await sleep(delay, signal);
      }
    }
  }

  async #next(position, until) {
    if (this.#answer && position >= this.#answer.end) {
      if (this.base) this.#answer.reader.cancel().catch(() => {}); // bytes of HDF5 follow
      this.#answer = null;
    }
    if (this.#answer?.at > position || (this.#ahead && this.#ahead.at < position)) this.#drop();
    this.#answer ??= await this.#take(position, until);
    const answer = this.#answer;
    if (!position && !this.#placed && !this.#served) return this.#locate(answer, until);
    if (until > answer.end && !this.#ahead) this.#askAhead(answer.end, until);
    for (;;) {
      const chunk = (await this.#chunk(answer)).subarray(0, answer.end - answer.at);
      const from = answer.at;
      answer.at += chunk.length;
      if (answer.at > position) return from < position ? chunk.subarray(position - from) : chunk;
    }
  }

  // The stream's first bytes in the file's: from then on an answer's places are those in the stream.
  async #locate(answer, until) {
    const head = [];
    while (answer.at < 24) {
      head.push(await this.#chunk(answer));
      answer.at += head.at(-1).length;
    }
    const bytes = new Uint8Array(await new Blob(head).arrayBuffer());
    const { base, size } = placeOf(bytes);
    this.base = base;
    this.#size = size;
    this.#placed = true;
    answer.at -= base;
    answer.end = Math.min(answer.end - base, size);
    if (answer.at > 0) return bytes.subarray(base, base + size);
    if (answer.end <= 0) this.#drop();
    return this.#next(0, until);
  }

  #take(position, until) {
    const ahead = this.#ahead;
    this.#ahead = null;
    return ahead?.answer ?? this.#ask(position, until);
  }

  // The link would be idle for a round trip if the next request waited for the end of this answer.
  #askAhead(at, until) {
    const answer = this.#ask(at, until);
    answer.catch(() => {}); // it is heard of when its bytes are needed
    this.#ahead = { at, answer };
  }

  // What the answer gives next. An answer that is over too early, or silent for long, has failed.
  async #chunk({ reader, at, end }) {
    let timer;
    const silence = new Promise((_, reject) => {
      timer = setTimeout(() => reject(new Retry(`${this.#url}: no byte came for ${longest / 1000} s`)), longest);
    });
    try {
      const reading = reader.read().catch((error) => { throw new Retry(`${this.#url}: ${error.message}`); });
      const { done, value } = await Promise.race([reading, silence]);
      if (!done) this.#onBytes(value.length);
      if (!done) return value;
    } finally {
      clearTimeout(timer);
    }
    if (end === Infinity) throw new FetchError(`the stream ends too early: ${this.#url} has only ${at} bytes`);
    throw new Retry(`${this.#url}: the answer ended ${end - at} bytes too early`);
  }

  // The caller's headers and credentials go to the stream's host only.
  #fetch(url, { headers, signal, ...options } = {}) {
    const own = new URL(url).origin === new URL(this.#url).origin ? this.#request : {};
    return ask(url, { ...options, ...own, headers: { ...own.headers, ...headers }, signals: [this.#signal, signal] });
  }

  async #ask(position, until) {
    if (!this.#served) return this.#askRange(position, until);
    const begins = !position || (this.partial && !this.levels); // without the index nobody knows where its records are
    const answer = begins && await this.#askPrefix();
    if (!answer && position && begins) throw new FetchError(`${this.#url} has changed; open it again`);
    return answer || this.#askRoutes(position, until);
  }

  // All that the target needs in one answer; null where the server does not know that, or no such level.
  async #askPrefix() {
    const url = new URL(this.#url);
    url.pathname = url.pathname.replace(/\/?$/, '/prefix');
    const target = this.fields === 'first' ? await this.#chooseFirst() : this.#target;
    url.search = prefixQuery(target, this.fields?.join());
    try {
      const answer = await this.#fetch(url);
      const end = Number(answer.headers.get('Content-Length'));
      if (end > 0 && !/^text\//.test(answer.headers.get('Content-Type') ?? '')) {
        this.partial =
          this.fields !== undefined && answer.headers.has('Tetlod-Level'); // hosts of files know no queries
        return { reader: answer.body.getReader(), at: 0, end };
      }
      await answer.body?.cancel();
    } catch (error) {
      if (!(error instanceof FetchError)) throw error;
    }
    return null;
  }

  async #askDescription() {
    const answer = await this.#fetch(this.#url, { headers: { Accept: 'application/json' } });
    const described = new Uint8Array(await answer.arrayBuffer().catch((error) => {
      throw new Retry(`${this.#url}: ${error.message}`);
    }));
    this.#onBytes(described.length);
    const { cid, levels, links, fields = [] } = parsed(described, this.#url);
    if (!levels || !links) throw new FetchError(`${this.#url} does not describe a stream`);
    const base = answer.url.replace(/\/(index\.json)?$/, ''); // hosts of files may add it
    const absolute = (link) =>
      new URL(link.replace(/\{\?.*?\}/, ''), base).href.replaceAll('%7B', '{').replaceAll('%7D', '}');
    return {
      cid,
      levels,
      fields,
      routes: {
        level: absolute(links.level),
        records: absolute(links.records),
        stream: absolute(links.stream),
        group: links.group && absolute(links.group)
      }
    };
  }

  // The field by the description, which also knows the level of a target: the answer then has all that it takes. Where
  // the
  // description cannot be had, or does not say which fields there are, all of them are wanted.
  async #chooseFirst() {
    const early = this.#early ??= this.#askDescription();
    const { fields, levels } = await early.catch((error) => {
      this.#early = null;
      if (error instanceof FetchError) return { fields: [] };
      throw error;
    });
    const { name } = firstField(fields) ?? {};
    this.fields = fields.length > 1 && canList([name]) ? [name] : undefined;
    try {
      return fields.length && this.#target ? { level: chooseLevel({ fields, levels }, this.#target) } : this.#target;
    } catch (error) {
      if (error instanceof RangeError) return this.#target; // the server says what is wrong with it
      throw error;
    }
  }

  async #findRoutes() {
    const { cid, levels, routes } = await this.#persist(() => {
      const early = this.#early;
      this.#early = null;
      return early ?? this.#askDescription();
    });
    if (this.cid && this.cid !== cid) throw new FetchError(`${this.#url} has changed; open it again`);
    this.cid = cid;
    this.levels ??= levels;
    this.#routes = routes;
  }

  // Prefixes and records are immutable and each has its URL: browsers and proxies keep them whole.
  async #askRoutes(position, until) {
    if (!this.#routes) await this.#findRoutes();
    const { levels } = this;
    const most = position + Math.min(Math.max(position, LEAST), MOST);
    const needed = position ? until : Math.max(until, OPENING);
    const first = levels.findIndex((level) => position < level.bytes);
    if (first < 0) throw new FetchError(`the stream ends at byte ${position}`);
    let last = first;
    while (last + 1 < levels.length && levels[last].bytes < needed && levels[last + 1].bytes <= most) last++;
    const { level, records, stream } = this.#routes;
    const some = this.partial ? `?${query({ fields: this.fields.join() })}` : '';
    const path = first ? records.replace('{from}', first - 1).replace('{to}', last) + some
      : level.replace('{level}', last).replace('{format}', 'tetlod');
    try {
      const answer = await this.#fetch(path);
      return { reader: answer.body.getReader(), at: first ? levels[first].offset : 0, end: levels[last].bytes };
    } catch (error) {
      if (last === first || this.partial || !(error instanceof FetchError)) throw error;
      // on a host of files there are the whole stream and single levels, nothing between
      this.#served = false;
      this.#url = stream;
      return this.#askRange(position, until);
    }
  }

  // Any host of files. no-store: browsers' caches of ranges of one URL are a source of errors.
  async #askRange(position, until) {
    const end = Math.min(Math.max(until, position ? 0 : this.#least), this.#size);
    const from = position + this.base, last = end - 1 + this.base;
    const range = { Range: `bytes=${from}-${last}` };
    const { status, headers, body } = await this.#fetch(this.#url, { headers: range, cache: 'no-store' });
    const validator = headers.get('ETag') ?? headers.get('Last-Modified') ?? '';
    if (this.#validator && validator !== this.#validator)
      throw new FetchError(`${this.#url} has changed; open it again`);
    this.#validator = validator;
    if (status !== 206) return { reader: body.getReader(), at: -this.base, end: this.#size };
    const [, start = from, stop = last] = /^bytes (\d+)-(\d+)\//.exec(headers.get('Content-Range') ?? '') ?? [];
    if (start > from) throw new FetchError(`${this.#url}: the server sent bytes from ${start} on, not from ${from}`);
    return { reader: body.getReader(), at: start - this.base, end: Math.min(Number(stop) + 1 - this.base, this.#size) };
  }
}

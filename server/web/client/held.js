// SPDX-License-Identifier: BSD-3-Clause
// The bytes of a stream that no request brings: of a Blob or File, or as a function of the page's own reads them.
import { FetchError, placeOf } from './network.js';

const PIECE = 1 << 18; // that is read at once, if so much is needed

export class Held {
  #read; #stop = new AbortController();
  #place = null; // of the stream, once it is known
  partial = false; // everything is read
  cid = '';
  levels = null;

  /**
   * `read(from, to, signal)`: bytes from `from` on, at least one and none from `to` on, or none at the stream's end.
   */
  constructor(read, { onBytes = () => {} } = {}) {
    this.#read = async (from, to, signal) => {
      this.#place ??= placeOf(await read(0, 64, signal));
      const { base, size } = this.#place;
      const bytes = from < size ? await read(base + from, base + Math.min(to, size), signal) : new Uint8Array();
      onBytes(bytes.length);
      return bytes;
    };
  }

  get base() { return this.#place?.base ?? 0; }

  async read(position, until) {
    const bytes = await this.#read(position, Math.max(until, position + PIECE), this.#stop.signal);
    if (!bytes.length) throw new FetchError(`the stream ends too early: there are only ${position} bytes`);
    return bytes;
  }

  /** Bytes from elsewhere in the stream. */
  async apart(offset, size) {
    const bytes = new Uint8Array(size);
    for (let at = 0; at < size;) {
      const some = await this.#read(offset + at, offset + size, this.#stop.signal);
      if (!some.length) throw new FetchError(`the stream ends too early: there are only ${offset + at} bytes`);
      bytes.set(some.subarray(0, size - at), at);
      at += some.length;
    }
    return bytes;
  }

  pause() {} // nothing is under way that costs anything

  close() {
    this.#stop.abort();
  }
}

/** Reads a stream that lies inside the bytes that `read` gives. */
export const readerOfPart = (read, { offset, size }) => async (from, to, signal) =>
  (from < size ? read(offset + from, offset + Math.min(to, size), signal) : new Uint8Array());

/** Reads a Blob or File. */
export const readerOf = (blob) => async (from, to) => new Uint8Array(await blob.slice(from, to).arrayBuffer());

// SPDX-License-Identifier: BSD-3-Clause
// A widget of notebooks (anywidget's interface): <tetlod-view>, whose bytes come through the kernel's own connection.
import './element.js';

const piece = 1 << 18;  // of one message: hosts of notebooks limit what a kernel sends at once
const patience = 10e3;  // milliseconds, after which a message is taken to be lost

// Asks the kernel, one message after the other. Every view has names for its questions: all hear all answers.
class Kernel {
  #model; #view = Math.random().toString(36).slice(2); #asked = 0; #waiting = new Map(); #last = Promise.resolve();

  constructor(model) {
    this.#model = model;
    model.on('msg:custom', this.#hear);
  }

  close() {
    this.#model.off('msg:custom', this.#hear);
  }

  read = (from, to, signal) => {
    const next = this.#last.then(() => this.#pieces(from, to, signal));
    this.#last = next.catch(() => {});
    return next;
  };

  async #pieces(from, to, signal) {
    const parts = [];
    for (let at = from; at < to; at += parts.at(-1).length) {
      parts.push(await this.#ask(at, Math.min(piece, to - at), signal));
      if (!parts.at(-1).length) break; // the end of the stream
    }
    const all = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
    parts.reduce((at, part) => (all.set(part, at), at + part.length), 0);
    return all;
  }

  #ask(offset, size, signal) {
    const question = `${this.#view}-${this.#asked++}`;
    const send = () => this.#model.send({ question, offset, size });
    return new Promise((resolve, reject) => {
      const again = setInterval(send, patience);
      const stop = () => reject(signal.reason);
      this.#waiting.set(question, { resolve, reject });
      signal?.addEventListener('abort', stop);
      this.#waiting.get(question).done = () => {
        clearInterval(again);
        signal?.removeEventListener('abort', stop);
        this.#waiting.delete(question);
      };
      if (signal?.aborted) stop();
      else send();
    }).finally(() => this.#waiting.get(question)?.done());
  }

  #hear = ({ answer, error }, [bytes] = []) => {
    const asked = this.#waiting.get(answer);
    if (!asked) return; // of another view, or once more
    if (error) asked.reject(new Error(error));
    else asked.resolve(new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength).slice());
  };
}

function render({ model, el }) {
  const kernel = new Kernel(model);
  const view = document.createElement('tetlod-view');
  const names = ['error', 'field', 'state'];
  const follow = names.map((name) => () => {
    if (model.get(name)) view.setAttribute(name, model.get(name));
    else view.removeAttribute(name);
  });
  const size = () => { view.style.height = `${model.get('height')}px`; };
  names.forEach((name, i) => model.on(`change:${name}`, follow[i]));
  model.on('change:height', size);
  for (const set of [...follow, size]) set();
  view.source = kernel;
  el.append(view);
  return () => {
    names.forEach((name, i) => model.off(`change:${name}`, follow[i]));
    model.off('change:height', size);
    view.remove();
    kernel.close();
  };
}

export default { render };

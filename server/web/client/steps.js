// SPDX-License-Identifier: BSD-3-Clause
// Steps in time: which band an error asks for, what the bands promise, and the bytes of their groups of steps.

const most = 64 << 20; // bytes of groups that are kept

/** The coarsest band within an error, of a level that is not finer than `finest`; the coarsest one if there is none. */
export function chooseBand({ bands }, error, finest = Infinity) {
  const within = bands.findIndex((band) => band.error <= error);
  let band = within < 0 ? bands.length - 1 : within;
  while (band > 0 && bands[band].level > finest) band--;
  return band;
}

/**
 * The coarsest band in which a step's own errors are within `error`: `errors(band)` gives them. Where the metadata say
 * that errors are fractions of each step's own range (SPEC 3.7), those of the bands hold.
 */
export function chooseBandAt(series, error, errors, metadata) {
  if (metadata?.options?.series_range === 'step') return chooseBand(series, error);
  const within = series.bands.findIndex((_, band) => errors(band).every((own) => own <= error));
  return within < 0 ? series.bands.length - 1 : within;
}

/**
 * The index as it is for the steps of a band: ranges over all steps, and as the errors of levels what the bands
 * promise. `own`: errors of fields at a step that is shown, in place of its band's.
 */
export function infoOfSteps(info, series, band, own = {}) {
  const rangesOf = (fields) => new Map(fields.map(({ name, range }) => [name, range]));
  const ranges = rangesOf(series.fields), cells = rangesOf(series.cellFields);
  const promised = (k) => (series.bands[band].level === k ? series.bands[band].error
    : series.bands.reduce((least, { error, level }) => (level <= k ? Math.min(least, error) : least), 1));
  const errorAt = (k, name) => (series.bands[band].level === k ? own[name] : undefined) ?? promised(k);
  const errorsAt = (k) => Object.fromEntries([...ranges.keys()].map((name) => [name, { max: errorAt(k, name) }]));
  return {
    ...info,
    fields: info.fields.map(
      (field) => ({ ...field, range: ranges.get(field.name) ?? field.range, controlled: ranges.has(field.name) })),
    cellFields: info.cellFields.map((field) => ({ ...field, range: cells.get(field.name) ?? field.range })),
    levels: info.levels.map((level, k) => ({ ...level, errors: { ...level.errors, ...errorsAt(k) } })),
  };
}

/**
 * The bytes of groups of steps: of a band one after the other, in the order in which they are needed, kept while there
 * is room. A group that does not come holds up its own band only.
 */
export class Groups {
  #read; #heard; #kept = new Map(); #bytes = 0; #wanted = []; #reading = new Map(); // of bands: {group, stop}
  received = 0; // bytes, of groups that were dropped, too

  /**
   * `read(band, group, signal)` resolves to pieces [{offset, bytes}]; `heard(band, error)` is called when they are
   * there, or why they are not.
   */
  constructor(read, heard) {
    this.#read = read;
    this.#heard = heard;
  }

  /**
   * The pieces of the first of some groups, or null; what is missing of all of them is read from now on, and nothing
   * else of their band.
   */
  take(band, groups) {
    const reading = this.#reading.get(band)?.group;
    if (reading !== undefined && !groups.includes(reading)) this.#drop(band);
    this.#wanted =
      groups.filter((group) => group !== reading && !this.#kept.has(`${band}/${group}`)).map((group) => [band, group]);
    this.#next();
    const key = `${band}/${groups[0]}`;
    const pieces = this.#kept.get(key) ?? null;
    if (pieces) { // it was used last
      this.#kept.delete(key);
      this.#kept.set(key, pieces);
    }
    return pieces;
  }

  /** Numbers of the groups of a band that are here. */
  of(band) {
    return [...this.#kept.keys()].map((key) => key.split('/').map(Number)).filter(([b]) => b === band).map(([,
      group]) => group);
  }

  /** What is under way is not waited for any more; who wants it asks again. */
  drop() {
    for (const band of [...this.#reading.keys()]) this.#drop(band);
  }

  #drop(band) {
    this.#reading.get(band).stop.abort();
    this.#reading.delete(band);
  }

  async #next() {
    if (!this.#wanted.length || this.#reading.has(this.#wanted[0][0])) return;
    const [band, group] = this.#wanted.shift();
    const stop = new AbortController();
    this.#reading.set(band, { group, stop });
    const [pieces, error] =
      await this.#read(band, group, stop.signal).then((read) => [read], (problem) => [null, problem]);
    if (stop.signal.aborted) return;
    this.#reading.delete(band);
    if (pieces) this.#keep(`${band}/${group}`, pieces);
    else this.#wanted = this.#wanted.filter(([b]) => b !== band);
    this.#heard(band, error);
    this.#next();
  }

  #keep(key, pieces) {
    const size = (list) => list.reduce((sum, { bytes }) => sum + bytes.length, 0);
    this.#kept.set(key, pieces);
    this.#bytes += size(pieces);
    this.received += size(pieces);
    for (const [old, list] of this.#kept) {
      if (this.#bytes <= most || old === key) break;
      this.#kept.delete(old);
      this.#bytes -= size(list);
    }
  }
}

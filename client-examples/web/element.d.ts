// SPDX-License-Identifier: BSD-3-Clause
import type { Source, TetlodStream } from './stream.js';

/** What the element's attributes say. */
export interface TetlodViewAttributes {
  src?: string;
  /** A fraction or a percentage. */
  error?: string | number;
  /** Of streams in pages: how exact what is seen is to be. */
  pixels?: string | number;
  field?: string;
  /** What the viewer's page has after the '#' of its link. */
  state?: string;
  /** Which of `bar`, `readout` and `player` are shown; 'bar' where it is not given. */
  controls?: string;
}

export interface TetlodViewEvents {
  ready: Event;
  /** Of pages `level` and `error` are those of the worst place that is seen. */
  level: CustomEvent<{ level: number; tets: number; error: number; pages?: number; settled: boolean }>;
  /** Of a series in time. `error`: what holds at this step. */
  step: CustomEvent<{ step: number; time: number; error: number }>;
  error: CustomEvent<{ message: string }>;
}

/**
 * <tetlod-view src error pixels field state controls>: a stream in any page. Slots `bar`, `readout` and `player`: what
 * stands there in place of the element's own; parts `picture`, `bar`, `readout`, `player`, `player-play`,
 * `player-step`, `player-back`, `player-on`, `player-loop`, for ::part().
 */
export class TetlodView extends HTMLElement {
  static observedAttributes: string[];
  /** What is shown, if not `src`. */
  source: Source | null;
  readonly stream: TetlodStream | null;
  readonly state: string;
  /** Which parts are shown. */
  get controls(): string[];
  set controls(names: string | string[]);
  /** Of a series in time: the step that is shown. */
  step: number | null;
  readonly playing: boolean;
  /** From the step that is shown on; nothing where there are no steps. */
  play(): Promise<void>;
  pause(): void;
  connectedCallback(): void;
  disconnectedCallback(): void;
  attributeChangedCallback(name: string, before: string | null, value: string | null): void;
  addEventListener<Name extends keyof TetlodViewEvents>(
    name: Name,
    listener: (event: TetlodViewEvents[Name]) => void,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener<Name extends keyof HTMLElementEventMap>(
    name: Name,
    listener: (event: HTMLElementEventMap[Name]) => void,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(
    name: string,
    listener: EventListenerOrEventListenerObject,
    options?: boolean | AddEventListenerOptions,
  ): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'tetlod-view': TetlodView;
  }
}

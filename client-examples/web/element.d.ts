// SPDX-License-Identifier: BSD-3-Clause
import type { Source, TetlodStream } from './stream.js';

/**
 * <tetlod-view src error field state>: a stream in any page. `error`: a fraction or a percentage; `state`: what the viewer's page
 * has after the '#' of its link. Events: 'ready'; 'level' {level, tets, error, settled}; 'error' {message}.
 */
export class TetlodView extends HTMLElement {
  /** What is shown, if not `src`. */
  source: Source | null;
  readonly stream: TetlodStream | null;
  readonly state: string;
}

declare global {
  interface HTMLElementTagNameMap {
    'tetlod-view': TetlodView;
  }
}

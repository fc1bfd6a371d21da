// SPDX-License-Identifier: BSD-3-Clause
// import type {} from 'tetlod/jsx': <tetlod-view> in JSX whose namespace is global, as React's types have it to version
// 18, and Preact's and Solid's where they are set so. For React 19: tetlod/react.
import type { TetlodView, TetlodViewAttributes } from './element.js';

/** With what every element has, as far as types of no framework know it. */
export interface TetlodViewProps extends TetlodViewAttributes {
  ref?: ((view: TetlodView | null) => void) | { current: TetlodView | null };
  children?: unknown;
  class?: string;
  className?: string;
  id?: string;
  key?: string | number;
  slot?: string;
  style?: unknown;
  hidden?: boolean;
}

declare global {
  namespace JSX {
    interface IntrinsicElements {
      'tetlod-view': TetlodViewProps;
    }
  }
}

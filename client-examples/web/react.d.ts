// SPDX-License-Identifier: BSD-3-Clause
// import type {} from 'tetlod/react': <tetlod-view> in JSX of React 19, whose types are a module's.
import 'react';
import type { TetlodViewProps } from './jsx.js';

declare module 'react' {
  namespace JSX {
    interface IntrinsicElements {
      'tetlod-view': TetlodViewProps;
    }
  }
}

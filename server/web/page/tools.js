// SPDX-License-Identifier: BSD-3-Clause
// What the page loads after the picture and the panel: probes that stay, the plot over a line, files, a second view.

import { bindCalculator } from './calculator.js';
import { Drafts } from './drafts.js';
import { bindExports, pictureSize } from './exports.js';
import { LinePlot } from './line_plot.js';
import { Pins } from './pins.js';
import { bindRegions } from './regions.js';
import { bindUnits } from './units.js';
import { bindWarp } from './warp.js';
import { bindSecondView } from './second_view.js';

export class Tools {
  pictureSize = pictureSize;

  /**
   * `layer`: the element over the picture; `save(ending, blob)`; `pointer()`: where the pointer is in the picture, or
   * null.
   */
  constructor(viewer, { layer, save, pointer, canOpenAnother }) {
    this.line = new LinePlot(viewer, layer, save);
    this.pins = new Pins(viewer, layer, pointer);
    bindCalculator(viewer);
    bindUnits(viewer);
    bindRegions(viewer);
    bindWarp(viewer);
    this.drafts = new Drafts(viewer);
    bindExports(viewer, save);
    bindSecondView(viewer, canOpenAnother);
  }

  /** What a saved picture has over it. */
  get layers() {
    return [this.line, this.pins];
  }

  /** After every frame. */
  update() {
    for (const layer of this.layers) layer.update();
  }

  addPin() {
    this.pins.add();
  }
}

// SPDX-License-Identifier: BSD-3-Clause
// What the page loads after the picture and the panel: probes that stay, the plot over a line, files, a second view.

import { bindCalculator } from './calculator.js';
import { Certain } from './certain.js';
import { Drafts } from './drafts.js';
import { bindExports, pictureSize } from './exports.js';
import { bindLate } from './late_controls.js';
import { bindFilm } from './film.js';
import { LookControls } from './look_controls.js';
import { LookHere } from './look_here.js';
import { LinePlot } from './line_plot.js';
import { Pins } from './pins.js';
import { RefineHere } from './refine_here.js';
import { bindRegions } from './regions.js';
import { bindUnits } from './units.js';
import { bindWarp } from './warp.js';
import { bindCompare } from './compare.js';
import { bindSecondView } from './second_view.js';
import { bindSpoken } from './spoken.js';

export { Compass } from './compass.js';
export { Handles } from './handles.js';

export class Tools {
  pictureSize = pictureSize;

  /**
   * `layer`: the element over the picture; `save(ending, blob)`; `pointer()`: where the pointer is in the picture, or
   * null.
   */
  constructor(viewer, { layer, save, picture, pointer, canOpenAnother, controls }) {
    viewer.saveAs = save; // what is loaded later still
    bindLate(controls);
    this.line = new LinePlot(viewer, layer, save);
    this.pins = new Pins(viewer, layer, pointer);
    this.boxes = new RefineHere(viewer, layer, pointer);
    this.look = new LookHere(viewer);
    this.lookControls = new LookControls(viewer);
    this.certain = new Certain(viewer, layer);
    bindCalculator(viewer);
    bindUnits(viewer);
    bindRegions(viewer);
    bindWarp(viewer);
    this.drafts = new Drafts(viewer);
    bindExports(viewer, save);
    bindFilm(viewer, { picture, save });
    bindSecondView(viewer, canOpenAnother);
    bindCompare(viewer);
    bindSpoken(viewer);
  }

  /** What a saved picture has over it. */
  get layers() {
    return [this.line, this.pins, this.certain];
  }

  /** After every frame. */
  update() {
    for (const layer of [...this.layers, this.boxes]) layer.update();
  }

  /** `at`: a place of the picture; without one: under the pointer, or in the middle. */
  refine(at) {
    this.boxes.add(at);
  }

  addPin() {
    this.pins.add();
  }
}

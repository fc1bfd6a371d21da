// SPDX-License-Identifier: BSD-3-Clause
// Value and position under the pointer: the picture answers at once, the mesh in the worker adds the other fields.

import { byId, coalesced, element } from './dom.js';
import { add } from './geometry.js';
import { significant } from './numbers.js';

export class Probe {
  // `title()`: what the picture is coloured by; `stream.probe` may take its time
  constructor(picture, scene, stream, title) {
    Object.assign(this, { picture, scene, stream, title });
    this.box = byId('probe');
    this.look = coalesced(() => this.update());
    picture.addEventListener('pointermove', (event) => {
      this.at = event.buttons ? null : { x: event.offsetX, y: event.offsetY };
      this.look();
    });
    picture.addEventListener('pointerleave', (event) => event.pointerType === 'mouse' && this.hide());
    // a touch that does not move probes
    picture.addEventListener('pointerdown', (event) => (this.pressed = [event.offsetX, event.offsetY]));
    picture.addEventListener('pointerup', (event) => {
      if (event.pointerType === 'mouse'
        || Math.hypot(event.offsetX - this.pressed?.[0], event.offsetY - this.pressed?.[1]) > 6)
        return;
      this.at = { x: event.offsetX, y: event.offsetY };
      this.look();
    });
  }

  world({ point }) {
    return add(point, this.scene.centre);
  }

  hide() {
    this.at = null;
    this.look();
  }

  update() {
    const hit = this.at && this.scene.pick(this.at.x, this.at.y);
    this.box.hidden = !hit;
    this.hit = hit;
    if (!hit) return;
    const position = this.world(hit).map((c) => significant(c, 4)).join(', ');
    const value = Number.isFinite(hit.value) ? significant(hit.value, 5) : 'beyond 3.4e38';
    this.box.replaceChildren(element('b', {}, `${this.title()} ${value}`), element('br'),
      element('span', {}, `at ${position}`), element('span', { className: 'others' }, this.others ?? ''));
    const { width, height } = this.box.getBoundingClientRect();
    const room = this.picture.getBoundingClientRect();
    const x = this.at.x + 18 + width > room.width ? this.at.x - width - 14 : this.at.x + 18;
    const y = Math.min(this.at.y + 14, room.height - height - 6);
    this.box.style.transform = `translate(${Math.max(4, x)}px, ${Math.max(4, y)}px)`;
    this.ask();
  }

  // One question at a time, the last place next.
  async ask() {
    if (this.asking) return;
    this.asking = true;
    const { hit } = this;
    let others = '';
    try {
      const answer = await this.stream.probe(this.world(hit));
      const isTold = (name) => name === this.title() && Number.isFinite(hit.value);
      const fields = Object.entries({ ...answer?.values, ...answer?.cells }).filter(([name]) => !isTold(name));
      others =
        fields
          .map(([name, v]) =>
                 `${name} ${v.length > 1 ? `(${v.map((c) => significant(c, 3)).join(', ')})` : significant(v[0], 4)}`)
          .join('\n');
    } catch {
      others = ''; // a closed stream has no values
    }
    this.asking = false;
    this.others = others;
    const line = this.box.querySelector('.others');
    if (line) line.textContent = others;
    if (this.hit && this.hit !== hit) this.ask();
  }
}

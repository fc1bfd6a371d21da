// SPDX-License-Identifier: BSD-3-Clause
// The panel's files: pictures of any size, and what is drawn as CSV and VTP.

import { byId, element } from './dom.js';
import { add } from './geometry.js';
import { titleOf } from './levels.js';
import { boundShown } from './promises.js';
import { notice } from './notices.js';
import { row } from './rows.js';

const mostPixels = 8192; // on a side

/** The size that pictures are saved with; null: as on the screen. */
export function pictureSize() {
  const size = ['png-width', 'png-height'].map((id) => Math.round(Number(byId(id).value)));
  if (size.every((side) => side >= 16 && side <= mostPixels)) return size;
  if (size.some(Boolean))
    notice('share', `A picture has from 16 to ${mostPixels} pixels on each side: it is saved as on the screen.`, {
      failed: true,
    });
  return null;
}

// What is drawn now, by names.
function partsOf({ surface, slices, isosurfaces, vectors }) {
  const named = (name, layers) => layers.map((layer, i) => [`${name} ${i + 1}`, layer.part]);
  return [
    ...named('slice', slices),
    ...named('isosurface', isosurfaces),
    ...named('vectors', vectors),
    ['boundary', surface.visible && surface.part],
  ].filter(([, part]) => part?.triangles?.length);
}

/** `save(ending, blob)` */
export function bindExports(viewer, save) {
  const { scene } = viewer;
  const choice = byId('export-part');
  const list = () => {
    const names = partsOf(scene).map(([name]) => name);
    if (names.join() === [...choice.options].map(({ value }) => value).join()) return;
    const chosen = choice.value;
    choice.replaceChildren(...names.map((name) => element('option', { value: name }, name)));
    if (names.includes(chosen)) choice.value = chosen;
    for (const id of ['export-csv', 'export-vtp', 'export-glb']) byId(id).disabled = !names.length;
  };
  viewer.addEventListener('pictures', list);
  viewer.store.watch(['surface'], list);

  const whole = element('button', { type: 'button', id: 'export-vtu', className: 'small' }, 'VTU');
  whole.title = 'The tetrahedra that are drawn, cut as they are, with all fields that are loaded';
  whole.addEventListener('click', async () => {
    const { vtuOf } = await import('./surface_files.js');
    const mesh = await viewer.stream.drawn();
    save('mesh.vtu', vtuOf(mesh, viewer.info, [['level', mesh.level]]));
  });
  choice.closest('.row').after(row('Mesh that is drawn', whole));

  const write = async (kind) => {
    const [name, part] = partsOf(scene).find(([found]) => found === choice.value);
    const { csvOfPart, glbOfPart, vtpOfPart } = await import('./surface_files.js');
    const { told: info, level, coloredState: state } = viewer;
    const { bound, certified } = boundShown(info, level, state);
    const origin = add(scene.centre, scene.offset);
    const title = titleOf(info, state);
    const blob =
      kind === 'glb'
        ? glbOfPart(part, origin, title, (value) => scene.colorOf(value, viewer.store.state.log))
        : kind === 'csv'
          ? new Blob([csvOfPart(part, origin, titleOf(info, state))], { type: 'text/csv' })
          : vtpOfPart(part, origin, titleOf(info, state), [
              ['level', level],
              ...(bound === null ? [] : [[certified ? 'certified bound' : 'measured bound', bound]]),
            ]);
    save(`${name.replace(' ', '-')}.${kind}`, blob);
  };
  for (const kind of ['csv', 'vtp', 'glb']) byId(`export-${kind}`).addEventListener('click', () => write(kind));
}

// SPDX-License-Identifier: BSD-3-Clause
// Parts of the picture as files for other programs: points with their values as CSV, surfaces and lines as VTP.

const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
const escaped = (text) => text.replace(/[<>&"]/g, (c) => `&#${c.charCodeAt(0)};`);

/** Rows of text for spreadsheets. `columns`: names; `rows`: numbers. */
export const csvOf = (columns, rows) =>
  `${[columns.map(quoted).join(), ...rows.map((row) => row.join())].join('\n')}\n`;

/** The place of each point and its value. `origin`: what points are relative to. */
export function csvOfPart({ points, values }, origin, title) {
  const rows = Array.from(values, (value, i) => [...origin.map((o, k) => o + points[3 * i + k]), value]);
  return csvOf(['x', 'y', 'z', title], rows);
}

const types = new Map([
  [Float32Array, 'Float32'],
  [Float64Array, 'Float64'],
  [Int32Array, 'Int32'],
  [Uint8Array, 'UInt8'],
]);

// The file's text, and behind it the arrays as they are, each after its length: no base64, no loss.
class Appended {
  #blocks = [];
  #size = 0;

  array(name, values, components = 1) {
    const text = `<DataArray type="${types.get(values.constructor)}" Name="${escaped(name)}" NumberOfComponents="${
      components}" format="appended" offset="${this.#size}"/>`;
    this.#blocks.push(Uint32Array.of(values.byteLength), values);
    this.#size += 4 + values.byteLength;
    return text;
  }

  blob(text, type = 'PolyData') {
    return new Blob(
      [
        `<?xml version="1.0"?>\n<VTKFile type="${
          type}" version="1.0" byte_order="LittleEndian" header_type="UInt32">\n`,
        `${text}\n<AppendedData encoding="raw">_`,
        ...this.#blocks,
        '</AppendedData>\n</VTKFile>\n',
      ],
      { type: 'application/xml' },
    );
  }
}

// Cells that all have as many corners.
function cells(file, corners, each) {
  const offsets = Int32Array.from({ length: corners.length / each }, (_, i) => each * (i + 1));
  return file.array('connectivity', Int32Array.from(corners)) + file.array('offsets', offsets);
}

/**
 * VTK's XML PolyData. `positions`: three numbers a point; `arrays`: [name, values of points, components (1)];
 * `triangles` or `lines`: corners; `notes`: [name, number] of the whole.
 */
export function vtpOf({ positions, arrays, triangles = [], lines = [], notes = [] }) {
  const file = new Appended();
  const parts = [
    `<FieldData>${
      notes
        .map(([name, value]) => file.array(name, Float64Array.of(value))
                                  .replace('NumberOfComponents', 'NumberOfTuples="1" NumberOfComponents'))
        .join('')}</FieldData>`,
    `<Piece NumberOfPoints="${positions.length / 3}" NumberOfVerts="0" NumberOfLines="${
      lines.length / 2}" NumberOfStrips="0" NumberOfPolys="${triangles.length / 3}">`,
    `<PointData Scalars="${escaped(arrays[0][0])}">${
      arrays.map(([name, values, components]) => file.array(name, values, components)).join('')}</PointData>`,
    `<Points>${file.array('Points', positions, 3)}</Points>`,
    `<Lines>${cells(file, lines, 2)}</Lines>`,
    `<Polys>${cells(file, triangles, 3)}</Polys>`,
    '</Piece>',
  ];
  return file.blob(`<PolyData>\n${parts.join('\n')}\n</PolyData>`);
}

/** VTK's XML UnstructuredGrid of what is drawn, as the stream gives it. `info`: its own; `notes`: [name, number]. */
export function vtuOf({ positions, tets, numbers, fields, cells: values }, info, notes) {
  const file = new Appended();
  const arrays = info.fields.filter(({ name }) => fields[name]);
  const note = ([name, value]) =>
    file.array(name, Float64Array.of(value)).replace('NumberOfComponents', 'NumberOfTuples="1" NumberOfComponents');
  const valuesOf = ({ name, components }) => file.array(name, fields[name], components);
  const cellValues = info.cellFields
    .filter(({ name }) => values[name])
    .map(({ name, components }) => file.array(name, values[name], components));
  const types = new Uint8Array(tets.length / 4).fill(10);
  const parts = [
    `<FieldData>${notes.map(note).join('')}</FieldData>`,
    `<Piece NumberOfPoints="${positions.length / 3}" NumberOfCells="${types.length}">`,
    `<PointData>${arrays.map(valuesOf).join('')}</PointData>`,
    `<CellData>${file.array('original tetrahedron', Int32Array.from(numbers))}${cellValues.join('')}</CellData>`,
    `<Points>${file.array('Points', positions, 3)}</Points>`,
    `<Cells>${cells(file, tets, 4)}${file.array('types', types)}</Cells>`,
    '</Piece>',
  ];
  return file.blob(`<UnstructuredGrid>\n${parts.join('\n')}\n</UnstructuredGrid>`, 'UnstructuredGrid');
}

/** A part of the picture; where the length of vectors colours, also these: what is between points is the length of
 * their mean. */
export function vtpOfPart({ points, values, vectors, triangles }, origin, title, notes) {
  const positions = Float64Array.from(points, (x, i) => origin[i % 3] + x);
  const arrays = vectors ? [[`${title} vectors`, vectors, vectors.length / values.length]] : [];
  return vtpOf({ positions, arrays: [[title, values], ...arrays], triangles, notes });
}

// Colours of screens as glTF wants them: in proportion to light.
const linear = (c) => (c <= 10.31475 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);

function boundsOf(points) {
  const [min, max] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  points.forEach((x, i) => {
    min[i % 3] = Math.min(min[i % 3], x);
    max[i % 3] = Math.max(max[i % 3], x);
  });
  return { min, max };
}

/** glTF's binary form: a part with the colours that it has in the picture, and its values. `colorOf(value)`: [r, g, b]
 * of 0..255. */
export function glbOfPart({ points, values, triangles, normals }, origin, title, colorOf) {
  const colors = Uint16Array.from({ length: 4 * values.length }, () => 65535);
  values.forEach((value, v) =>
    colors.set(
      colorOf(value).map((c) => Math.round(65535 * linear(c))),
      4 * v,
    ),
  );
  const arrays = { POSITION: [points, 3, 5126], COLOR_0: [colors, 4, 5123], _VALUE: [values, 1, 5126] };
  if (normals) arrays.NORMAL = [normals, 3, 5126];
  const all = [...Object.entries(arrays), ['', [triangles, 1, 5125]]];
  let end = 0;
  const bufferViews = all.map(([, [array]]) => ({
    buffer: 0,
    byteLength: array.byteLength,
    byteOffset: (end += array.byteLength) - array.byteLength,
  }));
  const accessors = all.map(([name, [array, components, componentType]], bufferView) => ({
    bufferView,
    componentType,
    count: array.length / components,
    type: ['SCALAR', '', 'VEC3', 'VEC4'][components - 1],
    ...(name === 'COLOR_0' && { normalized: true }),
    ...(name === 'POSITION' && boundsOf(points)),
  }));
  const attributes = Object.fromEntries(Object.keys(arrays).map((name, i) => [name, i]));
  const text = JSON.stringify({
    asset: { version: '2.0', generator: 'tetlod' },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, translation: origin }],
    meshes: [
      { primitives: [{ attributes, indices: all.length - 1, material: 0 }], extras: { fields: { _VALUE: title } } },
    ],
    materials: [{ doubleSided: true, pbrMetallicRoughness: { metallicFactor: 0, roughnessFactor: 1 } }],
    buffers: [{ byteLength: end }],
    bufferViews,
    accessors,
  });
  const json = new TextEncoder().encode(text);
  const padded = new Uint8Array(4 * Math.ceil(json.length / 4)).fill(0x20);
  padded.set(json);
  const head = Uint32Array.of(0x46546c67, 2, 28 + padded.length + end, padded.length, 0x4e4f534a);
  return new Blob([head, padded, Uint32Array.of(end, 0x004e4942), ...all.map(([, [array]]) => array)], {
    type: 'model/gltf-binary',
  });
}

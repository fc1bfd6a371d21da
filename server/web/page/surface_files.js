// SPDX-License-Identifier: BSD-3-Clause
// Parts of the picture as files for other programs: points with their values as CSV, surfaces and lines as VTP.

const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
const escaped = (text) => text.replace(/[<>&"]/g, (c) => `&#${c.charCodeAt(0)};`);

/** Rows of text for spreadsheets. `columns`: names; `rows`: numbers. */
export const csvOf = (columns, rows) => `${[columns.map(quoted).join(), ...rows.map((row) => row.join())].join('\n')}\n`;

/** The place of each point and its value. `origin`: what points are relative to. */
export function csvOfPart({ points, values }, origin, title) {
  const rows = Array.from(values, (value, i) => [...origin.map((o, k) => o + points[3 * i + k]), value]);
  return csvOf(['x', 'y', 'z', title], rows);
}

const types = new Map([[Float32Array, 'Float32'], [Float64Array, 'Float64'], [Int32Array, 'Int32']]);

// The file's text, and behind it the arrays as they are, each after its length: no base64, no loss.
class Appended {
  #blocks = []; #size = 0;

  array(name, values, components = 1) {
    const text = `<DataArray type="${types.get(values.constructor)}" Name="${escaped(name)}" NumberOfComponents="${components}" format="appended" offset="${this.#size}"/>`;
    this.#blocks.push(Uint32Array.of(values.byteLength), values);
    this.#size += 4 + values.byteLength;
    return text;
  }

  blob(text) {
    return new Blob([`<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt32">\n${text}\n<AppendedData encoding="raw">_`,
      ...this.#blocks, '</AppendedData>\n</VTKFile>\n'], { type: 'application/xml' });
  }
}

// Cells that all have as many corners.
function cells(file, corners, each) {
  const offsets = Int32Array.from({ length: corners.length / each }, (_, i) => each * (i + 1));
  return file.array('connectivity', Int32Array.from(corners)) + file.array('offsets', offsets);
}

/**
 * VTK's XML PolyData. `positions`: three numbers a point; `arrays`: [name, values of points, components (1)]; `triangles` or
 * `lines`: corners; `notes`: [name, number] of the whole.
 */
export function vtpOf({ positions, arrays, triangles = [], lines = [], notes = [] }) {
  const file = new Appended();
  const parts = [
    `<FieldData>${notes.map(([name, value]) => file.array(name, Float64Array.of(value)).replace('NumberOfComponents', 'NumberOfTuples="1" NumberOfComponents')).join('')}</FieldData>`,
    `<Piece NumberOfPoints="${positions.length / 3}" NumberOfVerts="0" NumberOfLines="${lines.length / 2}" NumberOfStrips="0" NumberOfPolys="${triangles.length / 3}">`,
    `<PointData Scalars="${escaped(arrays[0][0])}">${arrays.map(([name, values, components]) => file.array(name, values, components)).join('')}</PointData>`,
    `<Points>${file.array('Points', positions, 3)}</Points>`,
    `<Lines>${cells(file, lines, 2)}</Lines>`,
    `<Polys>${cells(file, triangles, 3)}</Polys>`,
    '</Piece>',
  ];
  return file.blob(`<PolyData>\n${parts.join('\n')}\n</PolyData>`);
}

/** A part of the picture; where the length of vectors colours, also these: what is between points is the length of their mean. */
export function vtpOfPart({ points, values, vectors, triangles }, origin, title, notes) {
  const positions = Float64Array.from(points, (x, i) => origin[i % 3] + x);
  const arrays = vectors ? [[`${title} vectors`, vectors, vectors.length / values.length]] : [];
  return vtpOf({ positions, arrays: [[title, values], ...arrays], triangles, notes });
}

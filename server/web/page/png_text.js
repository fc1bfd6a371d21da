// SPDX-License-Identifier: BSD-3-Clause
// Words in a PNG file: iTXt chunks before its picture (PNG specification, section 11.3.3).

const crcTable = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let bit = 0; bit < 8; bit++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});
const crcOf = (bytes) => ~bytes.reduce((c, byte) => crcTable[(c ^ byte) & 255] ^ (c >>> 8), ~0) >>> 0;

// Length, type and data, checksum of type and data. A keyword is Latin-1, the text UTF-8, not compressed, of no
// language.
function chunkOf(keyword, text) {
  const data = new TextEncoder().encode(`iTXt${keyword}\0\0\0\0\0${text}`);
  const chunk = new Uint8Array(8 + data.length);
  const view = new DataView(chunk.buffer);
  view.setUint32(0, data.length - 4);
  chunk.set(data, 4);
  view.setUint32(4 + data.length, crcOf(data));
  return chunk;
}

const header = 33; // signature and IHDR, which come first

/** A PNG with these texts by keyword. */
export const withTexts = (png, texts) =>
  new Blob([png.slice(0, header), ...Object.entries(texts).map(([key, text]) => chunkOf(key, text)), png.slice(header)],
    { type: 'image/png' });

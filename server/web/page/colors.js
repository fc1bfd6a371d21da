// SPDX-License-Identifier: BSD-3-Clause
// Colour maps. The sequential ones are perceptually uniform, the diverging ones have a light middle; all of them are
// distinct with the common forms of colour blindness.

// Each map's name in words and its colours at equal distances: those of d3-scale-chromatic, which a test holds them against.
const maps = {
  viridis: ['Viridis',
    '440154-46075a-470d60-471365-48186a-481d6f-482374-482878-472d7b-46327e-453781-443b84-424086-404588-3e4989-3d4e8a-' +
    '3b528b-39568c-375b8d-355f8d-33638d-31678e-2f6b8e-2e6f8e-2c728e-2a768e-297a8e-277e8e-26828e-25858e-23898e-228d8d-' +
    '21918c-1f948c-1f988b-1e9c89-1fa088-20a386-22a785-25ab82-28ae80-2db27d-32b67a-38b977-3fbc73-46c06f-4ec36b-56c667-' +
    '5ec962-67cc5c-70cf57-7ad151-84d44b-8ed645-98d83e-a2da37-addc30-b8de29-c2df23-cde11d-d8e219-e2e418-ece51b-f6e620-' +
    'fde725'],
  cividis: ['Cividis',
    '002051-00265d-012b65-083169-11366c-1c3c6e-26426e-31476e-3c4d6e-47536d-51586e-5a5e6e-62646f-6a6a70-727071-797673-' +
    '7f7c75-868276-8c8877-938e78-9a9478-a19b78-a9a177-b2a874-bbaf71-c5b66d-cebd68-d8c462-e2cb5c-ebd355-f3da4f-fae249-' +
    'fdea45'],
  inferno: ['Inferno',
    '000004-02010a-040312-07051b-0b0724-10092d-150b37-1b0c41-210c4a-280b53-2f0a5b-360961-3d0965-440a68-4a0c6b-510e6c-' +
    '57106e-5d126e-64156e-6a176e-71196e-771c6d-7d1e6d-84206b-8a226a-902568-972766-9d2964-a32c61-a92e5e-b0315b-b63458-' +
    'bc3754-c13a50-c73e4c-cc4248-d24644-d74b3f-db503b-e05536-e45a31-e8602d-eb6628-ef6c23-f1731d-f47918-f68013-f8870e-' +
    'f98e09-fb9606-fb9d07-fca50a-fcac11-fcb418-fbbc21-fac42a-f9cb35-f7d340-f5db4c-f3e35a-f2ea69-f1f179-f3f68a-f8fb9a-' +
    'fcffa4'],
  magma: ['Magma',
    '000004-020109-030312-06051a-0a0822-0e0b2b-130d34-180f3d-1d1147-221150-29115a-2f1163-36106b-3d0f71-440f76-4a1079-' +
    '51127c-57157e-5d177f-641a80-6a1c81-701f81-762181-7c2382-832681-892881-902a81-962c80-9c2e7f-a3307e-aa337d-b0357b-' +
    'b73779-bd3977-c43c75-ca3e72-d0416f-d6456c-dc4869-e24d66-e75263-eb5760-ef5d5e-f2645c-f56b5c-f7725c-f9795d-fa815f-' +
    'fc8961-fc9065-fd9869-fe9f6d-fea772-feae77-feb67c-febd82-fec488-fecc8f-fed395-fdda9c-fde2a3-fde9aa-fcf0b2-fcf7b9-' +
    'fcfdbf'],
  plasma: ['Plasma',
    '0d0887-19068c-220690-2a0593-310597-38049a-3f049c-46039f-4c02a1-5302a3-5901a5-6001a6-6600a7-6c00a8-7201a8-7801a8-' +
    '7e03a8-8405a7-8a09a5-8f0da4-9511a1-9a169f-a01a9c-a51f99-aa2395-ae2892-b32c8e-b7318a-bc3587-c03a83-c43e7f-c8437b-' +
    'cc4778-cf4c74-d35171-d6556d-da5a6a-dd5e66-e06363-e3685f-e66c5c-e97158-eb7655-ee7b51-f0804e-f3854b-f58b47-f79044-' +
    'f89540-fa9b3d-fba139-fca636-fdac33-fdb22f-feb82c-febe2a-fdc527-fdcb26-fcd225-fad824-f8df25-f6e626-f4ed27-f1f426-' +
    'f0f921'],
  turbo: ['Turbo',
    '23171b-32204a-3e2a71-453493-493eae-4b49c5-4a53d7-485ee4-4569ee-4074f5-3c7ff8-378af9-3295f7-2e9ff4-2ba9ef-28b3e9-' +
    '26bce1-25c5d9-25cdcf-27d5c6-29dcbc-2de3b2-32e9a7-38ee9d-3ff393-47f689-50f980-5afc77-65fd6e-70fe66-7cfd5e-88fc57-' +
    '95fb51-a1f84b-adf545-b9f140-c5ec3c-d0e637-dae034-e4d931-ecd12e-f4c92b-fac029-ffb626-ffad24-ffa223-ff9821-ff8d1f-' +
    'ff821d-ff771c-fd6c1a-f76118-f05616-e84b14-df4111-d5380f-cb2f0d-c0260a-b61f07-ac1805-a31302-9b0f00-950c00-910b00-' +
    '900c00'],
  coolWarm: ['Cool to warm, diverging', '3b4cc0-dddddd-b40426'],
  blueRed: ['Blue to red, diverging',
    '053061-0e4178-17518e-2061a0-2a71ae-367fb8-448ec1-569dc8-6bacd0-82bad8-98c7df-add2e5-bfdceb-d0e4ef-deebf2-e9eff2-' +
    'f2efee-f7ece5-fae4d8-fbd9c7-faccb4-f7bca0-f3aa8c-ec977a-e48268-db6d59-d1574b-c6413f-b82d35-a81d2d-941127-7e0823-' +
    '67001f'],
  orangePurple: ['Orange to purple, diverging',
    '2d004b-390c5e-461a70-522a81-5f3d8f-6d529c-7b67a8-8a7cb3-998ebf-a8a0ca-b5b0d4-c2bfdc-cecde4-d9d9ea-e3e4ee-ecebef-' +
    'f3eeea-f8edde-fbe7cd-fcdfb8-fdd5a0-fcc987-fabb6e-f5ad55-ee9d3d-e48d29-d97e1a-cc7010-be630b-af5808-9f4e07-8f4407-' +
    '7f3b08'],
  grey: ['Grey',
    '000000-131313-262626-3b3b3b-505050-626262-737373-858585-979797-a9a9a9-bbbbbb-cbcbcb-d8d8d8-e4e4e4-efefef-f7f7f7-' +
    'ffffff'],
};

const named = Object.entries(maps).map(([key, [name]]) => [key, name]);
export const mapNames = [...named, ['categories', 'Categories, of whole numbers']];

// A map's name may be its colours themselves: '3b4cc0-dddddd-b40426'.
const stops = /^[0-9a-f]{6}(-[0-9a-f]{6})+$/;

export const isMap = (name) => mapNames.some(([key]) => key === name) || stops.test(name);

const channels = (hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16));

function through(text) {
  const colors = text.split('-').map(channels);
  return (t) => {
    const i = Math.min(Math.floor(t * (colors.length - 1)), colors.length - 2);
    const part = t * (colors.length - 1) - i;
    return colors[i].map((c, k) => Math.round(c + part * (colors[i + 1][k] - c)));
  };
}

// `size` colours from the lowest to the highest value, each [r, g, b] of 0..255.
export function colorTable(map, reversed, size) {
  const at = through(maps[map]?.[1] ?? (stops.test(map) ? map : maps.viridis[1]));
  return Array.from({ length: size }, (_, i) => at((reversed ? size - 1 - i : i) / (size - 1)));
}

export const cssGradient = (map, reversed, direction) =>
  `linear-gradient(${direction}, ${colorTable(map, reversed, 17).map((c) => `rgb(${c})`).join(', ')})`;

// The colour of lines over a colour: lighter on dark ones, darker on light ones.
export function lineColor(color) {
  const light = 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2];
  return color.map((c) => Math.round(light < 84 ? 0.61 * c + 0.39 * 255 : 0.45 * c));
}

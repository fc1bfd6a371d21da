// SPDX-License-Identifier: BSD-3-Clause
// Lengths of vectors, and other functions of components, in the picture: linear on a triangle are the components, from
// which each pixel takes the value and the colour. Loaded when a length colours.

const mostComponents = 32; // that graphics processors have room for beside the rest, four to an attribute
const lengthOf = (names) => `sqrt(${names.map((name) => `dot(${name}VS, ${name}VS)`).join(' + ')})`;
const replacementsFor = (names, formula) => {
  const declare = (kind, suffix) => names.map((name) => `${kind} vec4 ${name}${suffix};`).join('\n');
  const inputs = formula?.inputs.map((_, i) => `${names[i >> 2]}VS.${'xyzw'[i & 3]}`);
  const value = formula ? formula.shader(inputs) : lengthOf(names);
  const at = (shaderType, originalValue, replacementValue, replaceFirst = true) => ({
    shaderType,
    originalValue,
    replacementValue,
    replaceFirst,
    replaceAll: false,
  });
  return [
    at('Vertex', '//VTK::Color::Dec', `${declare('attribute', 'MC')}\n${declare('varying', 'VS')}\n//VTK::Color::Dec`),
    at(
      'Vertex',
      '//VTK::Color::Impl',
      `${names.map((name) => `${name}VS = ${name}MC;`).join('\n')}\n//VTK::Color::Impl`,
      ),
    at(
      'Fragment',
      '//VTK::Color::Dec',
      `${declare('varying', 'VS')}\nuniform vec2 lengthTexels;\nuniform int lengthIsLogarithmic;${
        formula?.functions ?? ''}
float lengthPlace() {
  float value = ${value};
  if (lengthIsLogarithmic != 0) value = value > 0.0 ? 0.30102999566 * log2(value) : -38.0;
  return clamp(lengthTexels.x + lengthTexels.y * value, -1000.0, 1000.0);
}\n//VTK::Color::Dec`,
      ),
    at('Fragment', 'tcoordVCVSOutput.st', 'vec2(lengthPlace(), 0.49)', false),
  ];
};

// Where vtk.js has the colours of values in its texture (ScalarColoringHelper): beside the map's there is one at each
// end.
function texelsOf(lookup) {
  const [low, high] = lookup.getMappingRange();
  const texel = (high - low) / (lookup.getNumberOfAvailableColors() - 1);
  const scale = 1 / (high - low + 3 * texel);
  return [(1.5 * texel - low) * scale, scale];
}

// The vectors of a part as attributes of four components each; what there is no room for, or is none, leaves colours to
// the values.
export function attributesOf({ vectors, values }, vtkDataArray) {
  const components = vectors && values.length ? vectors.length / values.length : 0;
  if (!components || components > mostComponents) return [];
  return Array.from({ length: Math.ceil(components / 4) }, (_, k) => {
    const four = new Float32Array(4 * values.length);
    for (let v = 0; v < values.length; v++)
      for (let c = 4 * k; c < Math.min(components, 4 * k + 4); c++)
        four[4 * v + c - 4 * k] = vectors[components * v + c];
    return vtkDataArray.newInstance({ name: `vector${k}`, values: four, numberOfComponents: 4 });
  });
}

function tellLengths(program, lookup, logarithmic) {
  if (!program.isUniformUsed('lengthTexels')) return; // what is drawn for depth only
  program.setUniform2f('lengthTexels', ...texelsOf(lookup));
  program.setUniformi('lengthIsLogarithmic', Number(logarithmic));
}

/** What a mapper takes to draw attributes with these names. */
export const shadersOf = (names, mapper, isLogarithmic, formula) => ({
  OpenGL: { ShaderReplacements: replacementsFor(names, formula) },
  ShadersCallbacks: [
    { callback: (_, drawn) => tellLengths(drawn.getProgram(), mapper.getLookupTable(), isLogarithmic()) },
  ],
});

// SPDX-License-Identifier: BSD-3-Clause
// vtk.js's mapper for the tetrahedra themselves: the data in textures, one triangle over the whole picture, and rays
// through the mesh (ray_shader.js) that end at what is opaque.

import '@kitware/vtk.js/Rendering/OpenGL/Volume.js';
import macro from '@kitware/vtk.js/macros.js';
import vtkAbstractMapper3D from '@kitware/vtk.js/Rendering/Core/AbstractMapper3D.js';
import { registerOverride } from '@kitware/vtk.js/Rendering/OpenGL/ViewNodeFactory.js';
import vtkViewNode from '@kitware/vtk.js/Rendering/SceneGraph/ViewNode.js';
import { mat4 } from 'gl-matrix';
import { fragmentShader, vertexShader, width } from './ray_shader.js';

const name = 'tetlodRayMapper';

// ---- what is drawn: { textures: { name: Float32Array or Uint32Array, four numbers a texel }, uniforms }

const newMapper = macro.newInstance((publicAPI, model, initial = {}) => {
  vtkAbstractMapper3D.extend(publicAPI, model, { textures: {}, uniforms: {}, ...initial });
  model.classHierarchy.push(name);
  publicAPI.fail = () => model.failed();
  publicAPI.computeBounds = () => {};
  publicAPI.textures = () => model.textures;
  publicAPI.uniforms = () => model.uniforms;
  publicAPI.put = ({ textures = {}, uniforms = {} }) => {
    Object.assign(model.textures, textures);
    Object.assign(model.uniforms, uniforms);
    publicAPI.modified();
  };
}, name);

// ---- how

function compile(gl) {
  const program = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertexShader], [gl.FRAGMENT_SHADER, fragmentShader]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (gl.getProgramParameter(program, gl.LINK_STATUS) || gl.isContextLost()) return program;
  throw new Error(`the graphics cannot follow rays: ${gl.getAttachedShaders(program).map((s) => gl.getShaderInfoLog(s)).join(' ')}`);
}

// Whole rows, then what is left of the last one.
function upload(gl, texture, data) {
  const texels = data.length / 4;
  const rows = Math.max(1, Math.ceil(texels / width));
  const [inner, format, type] = data instanceof Float32Array ? [gl.RGBA32F, gl.RGBA, gl.FLOAT] : [gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT];
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, rows, 0, format, type, null);
  const whole = Math.floor(texels / width);
  if (whole) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, whole, format, type, data, 0);
  if (texels % width) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, whole, texels % width, 1, format, type, data, 4 * whole * width);
  for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
    gl.texParameteri(gl.TEXTURE_2D, key, value);
}

class Drawing {
  held = new Map(); // texture and what is in it, by name

  constructor(gl) {
    this.gl = gl;
    this.program = compile(gl);
    this.shape = gl.createVertexArray(); // without attributes
  }

  at(uniform) {
    return this.gl.getUniformLocation(this.program, uniform);
  }

  bind(unit, uniform, data) {
    const { gl } = this;
    if (!this.held.has(uniform)) this.held.set(uniform, { texture: gl.createTexture(), data: null });
    const held = this.held.get(uniform);
    gl.activeTexture(gl.TEXTURE0 + unit);
    if (held.data !== data) upload(gl, held.texture, data);
    held.data = data;
    gl.bindTexture(gl.TEXTURE_2D, held.texture);
    gl.uniform1i(this.at(uniform), unit);
  }

  // `units`: allocates the textures' units; `opaque`: the texture with the depth of what is opaque, or null
  draw({ textures, uniforms }, toWorld, units, opaque) {
    const { gl } = this;
    gl.useProgram(this.program);
    const entries = Object.entries(textures);
    const taken = Array.from({ length: entries.length + 1 }, () => units.allocate());
    entries.forEach(([key, data], i) => this.bind(taken[i], key, data));
    gl.activeTexture(gl.TEXTURE0 + taken.at(-1));
    gl.bindTexture(gl.TEXTURE_2D, opaque ?? this.held.get('table').texture);
    gl.uniform1i(this.at('opaque'), taken.at(-1));
    gl.uniform1i(this.at('hasOpaque'), Number(Boolean(opaque)));
    gl.uniform1ui(this.at('nodeCount'), textures.nodes.length / 8);
    gl.uniform1ui(this.at('tetCount'), textures.corners.length / 4);
    gl.uniform2f(this.at('range'), ...uniforms.range);
    gl.uniform1i(this.at('logarithmic'), Number(uniforms.logarithmic));
    gl.uniform4f(this.at('clip'), ...uniforms.clip);
    gl.uniformMatrix4fv(this.at('toWorld'), false, toWorld);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.ONE, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindVertexArray(this.shape);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA); // as vtk.js has it
    gl.enable(gl.DEPTH_TEST);
    for (const unit of taken) units.free(unit);
  }

  close() {
    const { gl } = this;
    for (const { texture } of this.held.values()) gl.deleteTexture(texture);
    gl.deleteVertexArray(this.shape);
    gl.deleteProgram(this.program);
  }
}

const newNode = macro.newInstance((publicAPI, model, initial = {}) => {
  vtkViewNode.extend(publicAPI, model, initial);
  model.classHierarchy.push('tetlodOpenGLRayMapper');
  let drawing = null;
  let opaque = null;
  let broken = false;
  publicAPI.buildPass = () => { opaque = null; };
  publicAPI.zBufferPass = (prepass, pass) => { if (prepass) opaque = pass.getZBufferTexture(); };
  publicAPI.opaqueZBufferPass = publicAPI.zBufferPass;
  publicAPI.volumePass = (prepass) => {
    const textures = model.renderable.textures();
    if (!prepass || !textures.corners || !textures.table) return;
    const window = publicAPI.getLastAncestorOfType('vtkOpenGLRenderWindow');
    const renderer = publicAPI.getFirstAncestorOfType('vtkOpenGLRenderer');
    const camera = renderer.getViewNodeFor(renderer.getRenderable().getActiveCamera());
    const volume = publicAPI.getFirstAncestorOfType('vtkOpenGLVolume').getRenderable();
    const { wcpc } = camera.getKeyMatrices(renderer.getRenderable());
    const toPicture = mat4.translate(new Float64Array(16), wcpc, volume.getPosition());
    if (broken) return;
    try {
      drawing ??= new Drawing(window.getContext());
    } catch (error) {
      broken = true;
      console.warn(error.message);
      model.renderable.fail();
      return;
    }
    window.getShaderCache().setLastShaderProgramBound(null);
    drawing.draw({ textures, uniforms: model.renderable.uniforms() }, mat4.invert(new Float64Array(16), toPicture), window.getTextureUnitManager(), opaque?.getHandle());
  };
  publicAPI.delete = macro.chain(() => drawing?.close(), publicAPI.delete);
}, 'tetlodOpenGLRayMapper');

registerOverride(name, newNode);

export { newMapper };

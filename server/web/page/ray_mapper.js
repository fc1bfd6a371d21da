// SPDX-License-Identifier: BSD-3-Clause
// vtk.js's mapper for the tetrahedra themselves: the data in textures, one triangle over the whole picture, and rays
// through the mesh (ray_shader.js) that end at what is opaque.

import '@kitware/vtk.js/Rendering/OpenGL/Volume.js';
import macro from '@kitware/vtk.js/macros.js';
import vtkAbstractMapper3D from '@kitware/vtk.js/Rendering/Core/AbstractMapper3D.js';
import { registerOverride } from '@kitware/vtk.js/Rendering/OpenGL/ViewNodeFactory.js';
import vtkViewNode from '@kitware/vtk.js/Rendering/SceneGraph/ViewNode.js';
import { mat4 } from 'gl-matrix';
import { copyShader, fragmentShader, vertexShader, width } from './ray_shader.js';

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

function compile(gl, picture) {
  const program = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertexShader], [gl.FRAGMENT_SHADER, picture]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (gl.getProgramParameter(program, gl.LINK_STATUS) || gl.isContextLost()) return program;
  throw new Error(
    `the graphics cannot follow rays: ${gl.getAttachedShaders(program).map((s) => gl.getShaderInfoLog(s)).join(' ')}`);
}

function sample(gl, filter) {
  for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, filter], [gl.TEXTURE_MAG_FILTER, filter],
         [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
    gl.texParameteri(gl.TEXTURE_2D, key, value);
}

// Whole rows, then what is left of the last one.
function upload(gl, texture, data) {
  const texels = data.length / 4;
  const rows = Math.max(1, Math.ceil(texels / width));
  const [inner, format, type] =
    data instanceof Float32Array ? [gl.RGBA32F, gl.RGBA, gl.FLOAT] : [gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT];
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, rows, 0, format, type, null);
  const whole = Math.floor(texels / width);
  if (whole) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, whole, format, type, data, 0);
  if (texels % width)
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, whole, texels % width, 1, format, type, data, 4 * whole * width);
  sample(gl, gl.NEAREST);
}

// Fewer pixels, so that what moves keeps moving: a picture of its own size, over which another program draws it.
class Smaller {
  size = '';

  constructor(gl) {
    this.gl = gl;
    this.program = compile(gl, copyShader);
    this.framebuffer = gl.createFramebuffer();
    this.texture = gl.createTexture();
  }

  draw(unit, by, render) {
    const { gl } = this;
    const before = gl.getParameter(gl.FRAMEBUFFER_BINDING);
    const [x, y, wide, high] = gl.getParameter(gl.VIEWPORT);
    const [w, h] = [wide, high].map((length) => Math.ceil(length / by));
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    if (this.size !== `${w} ${h}`) {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, w, h, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
      sample(gl, gl.LINEAR);
    }
    this.size = `${w} ${h}`;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    gl.viewport(0, 0, w, h);
    gl.disable(gl.BLEND);
    render();
    gl.bindFramebuffer(gl.FRAMEBUFFER, before);
    gl.viewport(x, y, wide, high);
    gl.enable(gl.BLEND);
    gl.useProgram(this.program);
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.uniform1i(gl.getUniformLocation(this.program, 'image'), unit);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  close() {
    const { gl } = this;
    gl.deleteFramebuffer(this.framebuffer);
    gl.deleteTexture(this.texture);
    gl.deleteProgram(this.program);
  }
}

const slow = 100;  // milliseconds from one frame to the next while something moves: fewer pixels
const quick = 30;  // more
const pause = 700; // not of one movement

class Drawing {
  held = new Map(); // texture and what is in it, by name
  by = 1;           // how many times less pixels in each direction while something moves
  last = 0;

  constructor(gl) {
    this.gl = gl;
    this.program = compile(gl, fragmentShader);
    this.shape = gl.createVertexArray(); // without attributes
    this.smaller = new Smaller(gl);
  }

  // How many times less pixels the next frame has.
  pace(moves) {
    const now = performance.now();
    const passed = now - this.last;
    this.last = moves ? now : 0;
    if (!moves || passed > pause * this.by) return moves ? this.by : 1;
    this.by = passed > slow ? Math.min(8, this.by * Math.min(3, Math.sqrt((1.5 * passed) / slow)))
      : passed < quick      ? Math.max(1, this.by / 1.1)
                            : this.by;
    return this.by;
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
  prepare({ textures, uniforms }, toWorld, units, opaque) {
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
    gl.uniform1i(this.at('byCells'), Number(uniforms.byCells));
    gl.uniform1i(this.at('byLengths'), Number(uniforms.byLengths));
    gl.uniform4f(this.at('clip'), ...uniforms.clip);
    gl.uniformMatrix4fv(this.at('toWorld'), false, toWorld);
    return taken;
  }

  // `moves`: more frames will follow
  draw(data, toWorld, units, opaque, moves) {
    const { gl } = this;
    const taken = this.prepare(data, toWorld, units, opaque);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.ONE, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindVertexArray(this.shape);
    const render = () => gl.drawArrays(gl.TRIANGLES, 0, 3);
    const by = this.pace(moves);
    const unit = units.allocate();
    if (by > 1) this.smaller.draw(unit, by, render);
    else render();
    units.free(unit);
    gl.bindVertexArray(null);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA); // as vtk.js has it
    gl.enable(gl.DEPTH_TEST);
    for (const unit of taken) units.free(unit);
  }

  close() {
    const { gl } = this;
    for (const { texture } of this.held.values()) gl.deleteTexture(texture);
    this.smaller.close();
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
    const uniforms = model.renderable.uniforms();
    const moves = uniforms.moves || renderer.getRenderable().getVTKWindow().getInteractor().isAnimating();
    drawing.draw({ textures, uniforms }, mat4.invert(new Float64Array(16), toPicture), window.getTextureUnitManager(),
      opaque?.getHandle(), moves);
  };
  publicAPI.delete = macro.chain(() => drawing?.close(), publicAPI.delete);
}, 'tetlodOpenGLRayMapper');

registerOverride(name, newNode);

export { newMapper };

// SPDX-License-Identifier: BSD-3-Clause
// The picture: vtk.js's window, camera and the layers that the worker's pictures fill.

// what a picture of triangles and lines takes: vtk.js's own profile brings axes, scalar bars and skyboxes along
import '@kitware/vtk.js/Rendering/OpenGL/Actor.js';
import '@kitware/vtk.js/Rendering/OpenGL/Camera.js';
import '@kitware/vtk.js/Rendering/OpenGL/PolyDataMapper.js';
import '@kitware/vtk.js/Rendering/OpenGL/Renderer.js';
import vtkInteractorStyle from '@kitware/vtk.js/Interaction/Style/InteractorStyleTrackballCamera.js';
import vtkLookupTable from '@kitware/vtk.js/Common/Core/LookupTable.js';
import vtkPolyData from '@kitware/vtk.js/Common/DataModel/PolyData.js';
import vtkRenderer from '@kitware/vtk.js/Rendering/Core/Renderer.js';
import vtkRenderWindow from '@kitware/vtk.js/Rendering/Core/RenderWindow.js';
import vtkInteractor from '@kitware/vtk.js/Rendering/Core/RenderWindowInteractor.js';
import vtkOpenGLRenderWindow from '@kitware/vtk.js/Rendering/OpenGL/RenderWindow.js';
import { cells } from '../client/adapters.js';
import { colorTable, lineColor } from './colors.js';
import { coalesced } from './dom.js';
import { add, corners, cross, middle, pickPart, planeOf, scale, unit } from './geometry.js';
import { Layer, makeActor } from './layer.js';
import { clamp } from './numbers.js';

const surfaceStyles = {
  solid: { opacity: 1, frontfaceCulling: false },
  inside: { opacity: 1, frontfaceCulling: true },
  glass: { opacity: 0.22, frontfaceCulling: false },
};

// Each direction the camera may look from, with what is up then.
export const views = {
  '+x': [[1, 0, 0], [0, 0, 1]],
  '-x': [[-1, 0, 0], [0, 0, 1]],
  '+y': [[0, 1, 0], [0, 0, 1]],
  '-y': [[0, -1, 0], [0, 0, 1]],
  '+z': [[0, 0, 1], [0, 1, 0]],
  '-z': [[0, 0, -1], [0, 1, 0]],
  oblique: [[0.62, -0.66, 0.42], [0, 0, 1]],
};

const mapColors = 257; // of a map as it is drawn: between two of them the graphics processor goes straight

function fillLookup(lookup, table, low, high) {
  lookup.setTable(table);
  lookup.setMappingRange(low, high);
}

const zoneOpacity = 0.3;

const borders = { side: 56, top: 48 }; // pixels that the volume leaves to what lies over the picture

const boundsOf = ([low, high]) => [low[0], high[0], low[1], high[1], low[2], high[2]]; // vtk's order

// The twelve edges of the bounds: where the volume lies when its boundary is not drawn.
function boxLines(renderer, bounds) {
  const edges = [];
  for (let i = 0; i < 8; i++) for (const bit of [1, 2, 4]) if (!(i & bit)) edges.push(i, i | bit);
  const data = vtkPolyData.newInstance();
  data.getPoints().setData(Float32Array.from(corners(bounds).flat()), 3);
  data.getLines().setData(cells(edges, 2), 1);
  const { mapper, actor } = makeActor(renderer, null);
  mapper.setInputData(data);
  actor.getProperty().setLighting(false);
  return actor;
}

export class Scene extends EventTarget {
  // Events: 'render' after every frame, 'camera' when the camera came to rest, 'capture' before a picture is saved.
  constructor(container) {
    super();
    this.container = container;
    this.bounds = [[-1, -1, -1], [1, 1, 1]];
    this.centre = [0, 0, 0];
    this.room = 0;
    this.offset = [0, 0, 0];
    this.renderer = vtkRenderer.newInstance();
    this.window = vtkRenderWindow.newInstance();
    this.window.addRenderer(this.renderer);
    this.openView();
    this.lookup = vtkLookupTable.newInstance();
    this.lineLookup = vtkLookupTable.newInstance();
    this.closed = false;
    this.box = null;
    this.surface = new Layer(this.renderer, this.lookup, this.lineLookup);
    this.slices = [];
    this.isosurfaces = [];
    this.zones = []; // two for each isosurface that has one
    this.rough = {
      surface: new Layer(this.renderer, this.lookup, this.lineLookup),
      slices: [],
      isosurfaces: [],
      zones: []
    };
    this.fine = null; // what those are drawn in place of, while they are
    this.vectors = []; // arrows or streamlines, if there are any
    this.edges = {}; // beside the layers, by name
    this.volume = null; // a grid's
    this.grid = null;
    this.rays = null;   // the tetrahedra's
    this.cells = null;
    this.colors = {};
    this.table = []; // the map's colours
    this.state = null;
    this.range = [0, 1];
    this.bottom = 80; // as the other borders
    this.share = 1; // of the screen's pixels in each direction, that are drawn
    this.looked = null; // one of `views`, until the camera is moved otherwise
    this.boxColor = [0, 0, 0];
    this.render = coalesced(() => this.closed || this.interactor.render());
    this.startInteraction();
    this.resized = new ResizeObserver(() => this.resize());
    this.resized.observe(container);
    this.resize();
  }

  // A canvas with a graphics context of its own.
  openView() {
    this.view = vtkOpenGLRenderWindow.newInstance();
    this.view.setContainer(this.container);
    this.window.addView(this.view);
    this.view.getCanvas().addEventListener('webglcontextlost', () => this.reopenView(), { once: true });
  }

  // The browser took the graphics context away. Points, triangles, and textures' data are still here, so that a new
  // canvas draws the same picture; a browser that has no context to give now is asked again.
  async reopenView() {
    this.dispatchEvent(new Event('lost'));
    const lost = this.view;
    for (let wait = 100; ; wait = Math.min(2 * wait, 5000)) {
      await new Promise((resolve) => setTimeout(resolve, wait));
      if (this.closed) return;
      if (document.createElement('canvas').getContext('webgl2')) break;
    }
    this.window.removeView(lost);
    lost.delete();
    this.openView();
    this.interactor.setView(this.view);
    this.resize();
    this.interactor.render();
    this.dispatchEvent(new Event('restored'));
  }

  close() {
    this.closed = true;
    this.resized.disconnect();
    this.interactor.unbindEvents();
    const context = this.view.get3DContext();
    this.window.removeView(this.view);
    this.view.delete();
    context?.getExtension('WEBGL_lose_context')?.loseContext(); // browsers have few, and collect garbage late
  }

  // The middle of the bounds is the scene's origin: 32 bits are enough for what is near it. `below`: pixels of what
  // lies over the picture at the bottom, beside the scalar bar.
  setBounds(bounds, parallel, below = 0) {
    this.bottom += below;
    this.resize();
    this.centre = middle(bounds);
    this.bounds = bounds.map((corner) => add(corner, this.centre, -1));
    this.box = boxLines(this.renderer, this.bounds);
    this.renderer.getActiveCamera().setParallelProjection(parallel);
    this.look('oblique');
  }

  /** As another picture has it, so that the same place is at the same height. */
  setBottom(bottom) {
    this.bottom = bottom;
    this.resize();
  }

  startInteraction() {
    this.interactor = vtkInteractor.newInstance();
    this.interactor.setView(this.view);
    this.interactor.initialize();
    this.interactor.bindEvents(this.container);
    const style = vtkInteractorStyle.newInstance();
    this.interactor.setInteractorStyle(style);
    this.interactor.onRenderEvent(() => {
      if (this.surface.showBehind(this.eye())) this.render();
      this.dispatchEvent(new Event('render'));
    });
    for (const event of ['onEndInteractionEvent', 'onEndMouseWheelEvent', 'onEndAnimation'])
      (style[event] ?? this.interactor[event])?.(() => this.cameraRests());
  }

  cameraRests() {
    this.looked = null;
    this.dispatchEvent(new Event('camera'));
  }

  // Where the boundary is seen from, if only its far walls are shown.
  eye() {
    const camera = this.renderer.getActiveCamera();
    const parallel = camera.getParallelProjection();
    return this.state?.surface === 'inside'
      ? [parallel ? camera.getDirectionOfProjection() : camera.getPosition(), parallel]
      : null;
  }

  aspect() {
    const { width, height } = this.container.getBoundingClientRect();
    return height ? width / height : 1;
  }

  resize() {
    const { width, height } = this.container.getBoundingClientRect();
    // what fits, fits the shorter side
    const camera = this.renderer.getActiveCamera();
    camera.setUseHorizontalViewAngle(width < height);
    camera.setWindowCenter(0, (borders.top - this.bottom) / Math.max(height, 1));
    this.pixels = this.share * Math.min(window.devicePixelRatio || 1, 2);
    this.view.setSize(Math.max(1, Math.round(width * this.pixels)), Math.max(1, Math.round(height * this.pixels)));
    if (this.looked) this.fit(this.looked);
    this.render();
  }

  // ---- what is shown

  // The worker's message. What it leaves out (undefined) stays, null is nothing. Its points are relative to its
  // `origin`, the scene's to the middle of the bounds.
  update(pictures, state, lengths) {
    this.draft(null);
    this.lengths = lengths;
    this.offset = add(pictures.origin ?? [0, 0, 0], this.centre, -1);
    if (pictures.surface !== undefined) this.surface.update(pictures.surface, state.log, lengths);
    this.updateList('slices', pictures.slices, state.log);
    this.updateList('isosurfaces', pictures.isosurfaces, state.log);
    this.updateList('zones', pictures.zones?.flatMap((zone) => zone?.sides ?? []), state.log);
    if (pictures.vectors !== undefined)
      this.updateList('vectors', pictures.vectors ? [pictures.vectors] : [], state.log);
    if (pictures.volume !== undefined) {
      this.grid = pictures.volume;
      this.volume?.update(this.grid);
    }
    if (pictures.rays !== undefined) {
      this.cells =
        pictures.rays && { ...this.cells, ...pictures.rays, range: pictures.shade.range, moves: pictures.t < 1 };
      this.rays?.update(this.cells);
    }
    this.restyle(state);
  }

  // Layers of a coarser level in place of those that update() made, until null.
  draft(pictures) {
    const names = Object.keys(this.rough);
    if (Boolean(this.fine) === Boolean(pictures)) return;
    const before = Object.fromEntries(names.map((name) => [name, this[name]]));
    for (const layer of names.flatMap((name) => this[name])) layer.hide();
    Object.assign(this, pictures ? this.rough : this.fine);
    if (pictures) this.fine = before;
    else [this.rough, this.fine] = [before, null];
    if (pictures && this.drafted !== pictures) {
      this.surface.update(pictures.surface, this.state.log, this.lengths);
      for (const name of ['slices', 'isosurfaces']) this.updateList(name, pictures[name], this.state.log);
      this.updateList('zones', pictures.zones.flatMap((zone) => zone?.sides ?? []), this.state.log);
      this.drafted = pictures;
    }
    this.restyle(this.state);
  }

  updateList(name, parts, logarithmic) {
    if (!parts) return;
    while (this[name].length > parts.length) this[name].pop().remove();
    while (this[name].length < parts.length) this[name].push(new Layer(this.renderer, this.lookup, this.lineLookup));
    this[name].forEach((layer, i) => layer.update(parts[i], logarithmic, this.lengths));
  }

  // Volume rendering is loaded when it is first asked for; that of grids is a third of vtk.js.
  async loadVolume() {
    const { VolumeLayer } = await import('./volume.js');
    if (this.volume) return;
    this.volume = new VolumeLayer(this.renderer);
    this.volume.color(this.table, this.range);
    this.volume.update(this.grid);
    this.restyle(this.state);
  }

  async loadRays() {
    const { RayLayer } = await import('./ray_layer.js');
    if (this.rays) return;
    this.rays = new RayLayer(this.renderer, () => this.dispatchEvent(new Event('norays')));
    this.rays.update(this.cells);
    this.restyle(this.state);
  }

  styleVolumes() {
    const { state } = this;
    this.volume?.place(scale(this.centre, -1));
    this.volume?.shade(state.opacity, this.range);
    if (!this.rays) return;
    const clip = state.clip && planeOf(this.bounds, state.clip);
    const sides = add(this.bounds[1], this.bounds[0], -1);
    this.rays.place(this.offset);
    this.rays.style(
      { ...state, ...this.colors }, this.range, sides, clip && { ...clip, origin: add(clip.origin, this.offset, -1) });
  }

  restyle(state) {
    this.state = state;
    const style = surfaceStyles[state.surface];
    this.surface.visible = Boolean(style);
    this.surface.showLines = state.edges;
    const cut = state.clip || state.box || state.threshold || state.hidden.length;
    this.box.setVisibility(state.axes || state.surface !== 'solid' || Boolean(cut)); // numbers are along its edges
    this.box.getProperty().setColor(...this.boxColor);
    if (style) this.surface.triangles.actor.getProperty().set(style);
    for (const slice of this.slices) slice.showLines = state.sliceEdges;
    for (const isosurface of this.isosurfaces)
      isosurface.triangles.actor.getProperty().setOpacity(state.isosurfaceOpacity);
    for (const part of [this.surface, ...this.slices]) part.shaded = state.shading === 'all';
    for (const isosurface of [...this.isosurfaces, ...this.zones, ...this.vectors])
      isosurface.shaded = state.shading !== 'off';
    for (const zone of this.zones) zone.triangles.actor.getProperty().setOpacity(zoneOpacity);
    for (const layer of this.layers()) {
      layer.place(this.offset);
      layer.refresh();
    }
    this.setParallel(state.parallel);
    if (state.volume && state.volumeSize && !this.volume) this.loadVolume();
    if (state.volume && !state.volumeSize && !this.rays) this.loadRays();
    this.styleVolumes();
    this.render();
  }

  layers() {
    return [this.surface, ...this.slices, ...this.isosurfaces, ...this.zones, ...this.vectors];
  }

  // Colours from `low` to `high`, which are logarithms if the state says so.
  recolor(state, low, high) {
    this.table = colorTable(state.map, state.reversed, mapColors);
    fillLookup(this.lookup, this.table, low, high);
    fillLookup(this.lineLookup, this.table.map(lineColor), low, high);
    this.range = [low, high];
    this.volume?.color(this.table, this.range);
    this.colors = { map: state.map, reversed: state.reversed };
    if (this.state) this.styleVolumes();
    this.render();
  }

  // The map's colour of a value.
  colorOf(value, logarithmic) {
    const [low, high] = this.range;
    const at = ((logarithmic ? Math.log10(value) : value) - low) / (high - low || 1);
    return this.table[Math.round(clamp(at, 0, 1) * (this.table.length - 1)) || 0];
  }

  setLogarithmic(logarithmic) {
    this.drafted = null;
    for (const layer of this.layers()) layer.color(logarithmic);
    this.render();
  }

  setBackground(color) {
    this.renderer.setBackground(...color);
    const light = 0.3 * color[0] + 0.59 * color[1] + 0.11 * color[2] > 0.5;
    const ink = light ? [0.1, 0.13, 0.18] : [0.86, 0.89, 0.93];
    this.lineInk = ink;
    this.boxColor =
      color.map((c, i) => 0.7 * c + 0.3 * ink[i]); // opaque: what is translucent is drawn in passes of its own
    this.render();
  }

  // The least and greatest value of what is in the picture, or null.
  visibleRange() {
    let low = Infinity;
    let high = -Infinity;
    for (const { part, visible } of this.layers())
      if (part && visible)
        for (const value of part.values) {
          if (value < low) low = value;
          if (value > high) high = value;
        }
    if (this.grid && this.state.volume) {
      const [least, most] = this.grid.logarithmic ? this.grid.range.map((x) => 10 ** x) : this.grid.range;
      low = Math.min(low, least);
      high = Math.max(high, most);
    }
    if (this.cells) {
      low = Math.min(low, this.cells.range[0]);
      high = Math.max(high, this.cells.range[1]);
    }
    return low <= high ? [low, high] : null;
  }

  // ---- the camera

  camera() {
    const camera = this.renderer.getActiveCamera();
    const place = [...camera.getPosition(), ...camera.getFocalPoint(), ...camera.getViewUp()];
    return camera.getParallelProjection() ? [...place, camera.getParallelScale()] : place;
  }

  // As camera() gave it.
  setCamera(place) {
    const camera = this.renderer.getActiveCamera();
    camera.set({ position: place.slice(0, 3), focalPoint: place.slice(3, 6), viewUp: place.slice(6, 9) });
    if (place[9]) camera.setParallelScale(place[9]);
    this.looked = null;
    this.afterCamera();
  }

  // Everything in the picture, seen from one of `views`, whatever its size becomes.
  look(view) {
    this.fit(view);
    this.cameraRests();
    this.looked = view;
  }

  // In a frame that is not shown the picture has no size yet.
  fit(view) {
    const { width, height } = this.container.getBoundingClientRect();
    if (!width || !height) return;
    const [direction, up] = views[view];
    const extent = this.extent();
    const centre = middle(extent);
    const camera = this.renderer.getActiveCamera();
    camera.set({ focalPoint: centre, position: add(centre, unit(direction)), viewUp: up });
    this.renderer.resetCamera(boundsOf(extent));
    for (let i = 0; i < 6; i++) this.enlarge(1 / this.overflow(extent));
    this.afterCamera();
  }

  // How far the bounds reach, as a fraction of the room that the title and the scalar bar leave.
  overflow(extent) {
    const { width, height } = this.container.getBoundingClientRect();
    const { bottom } = this;
    const { side, top } = borders;
    const [roomX, roomY] = [width / 2 - side, (height - top - bottom) / 2];
    const far = corners(extent).map((corner) => {
      const { x, y } = this.toScreen(corner);
      return Math.max(Math.abs(x - width / 2) / roomX, Math.abs(y - top - roomY) / roomY);
    });
    return clamp(Math.max(...far), 0.2, 5);
  }

  enlarge(factor) {
    const camera = this.renderer.getActiveCamera();
    if (camera.getParallelProjection()) camera.setParallelScale(camera.getParallelScale() / factor);
    else camera.dolly(factor);
  }

  // What was as large as now stays so.
  setParallel(parallel) {
    const camera = this.renderer.getActiveCamera();
    if (camera.getParallelProjection() === parallel) return;
    const half =
      Math.tan((camera.getViewAngle() * Math.PI) / 360) / (camera.getUseHorizontalViewAngle() ? this.aspect() : 1);
    if (parallel) camera.setParallelScale(camera.getDistance() * half);
    else camera.dolly((camera.getDistance() * half) / camera.getParallelScale());
    camera.setParallelProjection(parallel);
    this.afterCamera();
  }

  turn(azimuth, elevation) {
    const camera = this.renderer.getActiveCamera();
    camera.azimuth(azimuth);
    camera.elevation(elevation);
    camera.orthogonalizeViewUp();
    this.afterCamera();
    this.cameraRests();
  }

  zoom(factor) {
    this.enlarge(factor);
    this.afterCamera();
    this.cameraRests();
  }

  // Turns about another point from now on.
  centreOn(point) {
    const camera = this.renderer.getActiveCamera();
    const shift = add(point, camera.getFocalPoint(), -1);
    camera.set({ focalPoint: point, position: add(camera.getPosition(), shift) });
    this.afterCamera();
    this.cameraRests();
  }

  // `room`: how far points may be outside of the bounds.
  setRoom(room) {
    if (room === this.room) return;
    this.room = room;
    this.afterCamera();
    if (this.looked) this.fit(this.looked);
  }

  // What is to be in the picture: the bounds, and what is moved out of them.
  extent() {
    if (!this.room) return this.bounds;
    const drawn = this.renderer.computeVisiblePropBounds();
    const [low, high] = this.bounds;
    return [low.map((x, i) => Math.min(x, drawn[2 * i])), high.map((x, i) => Math.max(x, drawn[2 * i + 1]))];
  }

  // What has moved out of the picture since it was made to fit is in it again.
  refit() {
    if (this.looked && this.room && this.overflow(this.extent()) > 1.01) this.fit(this.looked);
  }

  // Edges beside the layers, by a name: pairs of points, relative to the worker's origin; null: none.
  setEdges(name, points, edges, color = this.boxColor) {
    const { data, actor, mapper } = (this.edges[name] ??= makeActor(this.renderer, null));
    mapper.setRelativeCoincidentTopologyLineOffsetParameters(-1, -1);
    actor.setVisibility(Boolean(edges));
    if (edges) {
      data.getPoints().setData(points, 3);
      data.getLines().setData(cells(edges, 2), 1);
      data.modified();
      actor.setPosition(...this.offset);
      actor.getProperty().set({ lighting: false, color });
    }
    this.render();
  }

  afterCamera() {
    const [low, high] = this.bounds;
    this.renderer.resetCameraClippingRange(boundsOf([low.map((x) => x - this.room), high.map((x) => x + this.room)]));
    this.renderer.updateLightsGeometryToFollowCamera();
    this.render();
  }

  // Right, up and towards the viewer, as unit vectors.
  axes() {
    const camera = this.renderer.getActiveCamera();
    const towards = scale(unit(camera.getDirectionOfProjection()), -1);
    const right = unit(cross(camera.getViewUp(), towards));
    return { right, up: cross(towards, right), towards };
  }

  // ---- between the picture's pixels and the world

  // CSS pixels from the container's upper left corner
  toScreen(point) {
    const [x, y, depth] = this.view.worldToDisplay(...point, this.renderer);
    return { x: x / this.pixels, y: this.container.clientHeight - y / this.pixels, depth };
  }

  // Pixels of a picture that capture() makes, [width, height]
  toPicture(point, [width, height]) {
    const camera = this.renderer.getActiveCamera();
    const room = this.container.getBoundingClientRect();
    const fitted = (wide, high) => (camera.getParallelProjection() ? high : Math.min(wide, high));
    const factor = fitted(width, height) / fitted(room.width, room.height);
    const [centre, { x, y, depth }] = [camera.getFocalPoint(), point].map((p) => this.toScreen(p));
    return {
      x: (width / room.width) * centre.x + factor * (x - centre.x),
      y: (height / room.height) * centre.y + factor * (y - centre.y),
      depth
    };
  }

  toWorld(x, y, depth) {
    return this.view.displayToWorld(
      x * this.pixels, (this.container.clientHeight - y) * this.pixels, depth, this.renderer);
  }

  ray(x, y) {
    const from = this.toWorld(x, y, 0);
    return { from, direction: unit(add(this.toWorld(x, y, 1), from, -1)) };
  }

  // What is seen at a place of the picture: { point, value } or null; the point is the scene's.
  pick(x, y) {
    const ray = this.ray(x, y);
    const from = add(ray.from, this.offset, -1);
    const hits = this.layers()
                   .filter((layer) => layer.part?.triangles?.length && layer.visible && !this.zones.includes(layer)
                       && !(layer === this.surface && this.state.surface === 'glass'))
                   .map((layer) => pickPart(layer.part, from, ray.direction,
                          layer === this.surface && this.state.surface === 'inside' ? -1 : 0))
                   .filter(Boolean);
    const nearest = hits.reduce((best, hit) => (!best || hit.distance < best.distance ? hit : best), null);
    return nearest && { value: nearest.value, point: add(nearest.point, this.offset) };
  }

  // A PNG's pixels of the next frame, without what is drawn over it. `size`: [width, height], if not as on the screen.
  async capture(size = null) {
    this.dispatchEvent(new Event('capture'));
    const image = new Image();
    const camera = this.renderer.getActiveCamera();
    const across = camera.getUseHorizontalViewAngle();
    if (size) camera.setUseHorizontalViewAngle(size[0] < size[1]);
    const [shot] = await Promise.all(this.window.captureImages('image/png', { size }));
    camera.setUseHorizontalViewAngle(across);
    image.src = shot;
    await image.decode();
    return image;
  }
}

// SPDX-License-Identifier: BSD-3-Clause
// The surface of a stream with three.js, refining. Bundle it, then open
// example.html?url=http://127.0.0.1:8080/v1/meshes/fin
import * as three from 'three';
import { toGeometry } from 'tetlod/adapters.js';
import { TetlodStream } from 'tetlod';

const stream =
  await TetlodStream.open(new URLSearchParams(location.search).get('url'), { target: { error: 0.001, tets: 500_000 } });
const { fields: [{ name, range: [low, high] }], bounds } = stream.info;
const [renderer, scene, camera] = [
  new three.WebGLRenderer({ antialias: true }), new three.Scene(),
  new three.PerspectiveCamera(40, innerWidth / innerHeight)
];
document.body.append(renderer.domElement);
renderer.setSize(innerWidth, innerHeight);
const box = new three.Box3(...bounds.map((corner) => new three.Vector3(...corner)));
const [centre, size] = [box.getCenter(new three.Vector3()), box.getSize(new three.Vector3()).length()];
camera.up.set(0, 0, 1);
camera.position.set(0.62, -0.66, 0.42).multiplyScalar(1.6 * size).add(centre);
camera.lookAt(centre);
const material = new three.ShaderMaterial({
  side: three.DoubleSide,
  uniforms: { range: { value: [low, high] } },
  vertexShader:
    'attribute float value; varying float v; '
    + 'void main() { v = value; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.); }',
  fragmentShader:
    'uniform vec2 range; varying float v; '
    + 'void main() { float t = (v - range.x) / (range.y - range.x); gl_FragColor = vec4(t, .2 + .6 * t, 1. - t, 1.); }'
});
const mesh = new three.Mesh(new three.BufferGeometry(), material);
scene.add(mesh);
for await (const frame of stream.frames({ field: name, surface: true })) {
  toGeometry(frame.surface, mesh.geometry, three);
  mesh.position.set(...frame.origin);
  renderer.render(scene, camera);
  document.querySelector('output').value = `level ${frame.level}: ${stream.info.levels[frame.level].tets} tetrahedra`;
}

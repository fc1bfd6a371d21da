#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draws levels of a stream side by side: a cut through each, coloured by the field, with the cells' edges.

    level_sequence.py TETLOD STREAM OUT.png --field NAME [--errors 0 0.001 0.01 0.05] [--origin X Y Z] [--normal X Y Z]

Cuts are VTK's; the picture is drawn here, so that no display is needed.
"""
import argparse
import os
import struct
import subprocess
import tempfile
import zlib

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

# Points of the viridis map, which is perceptually uniform and safe for the colour-blind.
MAP = np.array([[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137],
                [53, 183, 121], [109, 205, 89], [180, 222, 44], [253, 231, 37]], float)
GAP = 12


def cut(path, origin, normal, field):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    plane = vtk.vtkPlane()
    plane.SetOrigin(origin)
    plane.SetNormal(normal)
    cutter = vtk.vtkCutter()
    cutter.SetInputConnection(reader.GetOutputPort())
    cutter.SetCutFunction(plane)
    cutter.GenerateTrianglesOff()
    cutter.Update()
    data = cutter.GetOutput()
    polygons = []
    cells = data.GetPolys()
    cells.InitTraversal()
    ids = vtk.vtkIdList()
    while cells.GetNextCell(ids):
        polygons.append([ids.GetId(i) for i in range(ids.GetNumberOfIds())])
    return (vtk_to_numpy(data.GetPoints().GetData()).astype(float), polygons,
            vtk_to_numpy(data.GetPointData().GetArray(field)).astype(float), reader.GetOutput().GetNumberOfCells())


def fill(image, depth, p, values):
    """One triangle, its values interpolated."""
    low, high = np.floor(p.min(0)).astype(int), np.ceil(p.max(0)).astype(int) + 1
    low, high = np.maximum(low, 0), np.minimum(high, image.shape[1::-1])
    if (high <= low).any():
        return
    x, y = np.meshgrid(np.arange(low[0], high[0]) + .5, np.arange(low[1], high[1]) + .5)
    (ax, ay), (bx, by), (cx, cy) = p
    whole = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if abs(whole) < 1e-12:
        return
    v = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / whole
    w = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / whole
    inside = (v >= -1e-6) & (w >= -1e-6) & (v + w <= 1 + 1e-6)
    t = np.clip((values[0] + v * (values[1] - values[0]) + w * (values[2] - values[0])) * (len(MAP) - 1), 0,
                len(MAP) - 1)
    k = np.minimum(t.astype(int), len(MAP) - 2)
    colour = MAP[k] + (t - k)[..., None] * (MAP[k + 1] - MAP[k])
    part = image[low[1]:high[1], low[0]:high[0]]
    part[inside] = colour[inside]


def line(image, a, b):
    steps = int(np.ceil(np.abs(b - a).max())) + 1
    for t in np.linspace(0, 1, steps + 1):
        x, y = np.round(a + t * (b - a) - .5).astype(int)
        if 0 <= x < image.shape[1] and 0 <= y < image.shape[0]:
            image[y, x] = .45 * image[y, x] + .55 * np.array([20, 20, 30])


def panel(points, polygons, values, axes, box, width):
    scale = (width - 1) / (box[1][0] - box[0][0])
    height = int((box[1][1] - box[0][1]) * scale) + 2
    image = np.full((height * 2, width * 2, 3), 255.)
    q = (points[:, axes] - box[0]) * scale * 2
    q[:, 1] = 2 * height - 1 - q[:, 1]
    for polygon in polygons:
        for i in range(1, len(polygon) - 1):
            t = [polygon[0], polygon[i], polygon[i + 1]]
            fill(image, None, q[t], values[t])
    for polygon in polygons:
        for i, j in zip(polygon, polygon[1:] + polygon[:1]):
            line(image, q[i], q[j])
    return image.reshape(height, 2, width, 2, 3).mean((1, 3))


def write_png(path, image):
    rows = np.clip(image, 0, 255).astype(np.uint8)
    raw = b''.join(b'\0' + row.tobytes() for row in rows)

    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))
    with open(path, 'wb') as out:
        out.write(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR',
                                               struct.pack('>IIBBBBB', rows.shape[1], rows.shape[0], 8, 2, 0, 0, 0)) +
                  chunk(b'IDAT', zlib.compress(raw, 9)) + chunk(b'IEND', b''))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('tetlod')
    parser.add_argument('stream')
    parser.add_argument('out')
    parser.add_argument('--field', required=True)
    parser.add_argument('--errors', type=float, nargs='+', default=[0, 0.001, 0.01, 0.05])
    parser.add_argument('--origin', type=float, nargs=3, default=[0, 0, 0.4])
    parser.add_argument('--normal', type=float, nargs=3, default=[0, 0, 1])
    parser.add_argument('--width', type=int, default=420)
    o = parser.parse_args()
    axes = [i for i in range(3) if i != int(np.argmax(np.abs(o.normal)))]
    cuts = []
    with tempfile.TemporaryDirectory() as folder:
        for error in o.errors:
            path = os.path.join(folder, 'level.vtu')
            subprocess.run([o.tetlod, 'extract', o.stream, '--error', repr(error), '-o', path, '--quiet'], check=True)
            cuts.append(cut(path, o.origin, o.normal, o.field))
            print('error %g: %d tetrahedra' % (error, cuts[-1][3]))
    box = cuts[0][0][:, axes].min(0), cuts[0][0][:, axes].max(0)
    low, high = cuts[0][2].min(), cuts[0][2].max()
    panels = [panel(p, polygons, (s - low) / (high - low), axes, box, o.width) for p, polygons, s, _ in cuts]
    gap = np.full((panels[0].shape[0], GAP, 3), 255.)
    write_png(o.out, np.concatenate([x for p in panels for x in (p, gap)][:-1], 1))


if __name__ == '__main__':
    main()

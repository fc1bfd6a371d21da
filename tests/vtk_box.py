# SPDX-License-Identifier: BSD-3-Clause
"""What VTK reads of a VTU, and what it leaves of a mesh in a box."""
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy


def read(path):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def in_box(mesh, low, high):
    """Tetrahedra."""
    for axis in range(3):
        for end, sign in (low, 1), (high, -1):
            plane = vtk.vtkPlane()
            plane.SetOrigin(*end)
            plane.SetNormal(*(sign * np.eye(3)[axis]))
            clip = vtk.vtkClipDataSet()
            clip.SetInputData(mesh)
            clip.SetClipFunction(plane)
            clip.Update()
            mesh = clip.GetOutput()
    tets = vtk.vtkDataSetTriangleFilter()
    tets.SetInputData(mesh)
    tets.Update()
    return tets.GetOutput()


def corners_of(mesh):
    return vtk_to_numpy(mesh.GetCells().GetConnectivityArray()).reshape(-1, 4)


def volumes(mesh):
    """Of tetrahedra."""
    places = vtk_to_numpy(mesh.GetPoints().GetData()).astype(float)[corners_of(mesh)]
    return np.abs(np.linalg.det(places[:, 1:] - places[:, :1])) / 6

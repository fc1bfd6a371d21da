#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""mpirun -n 4 python3 insitu_dolfinx.py SERIES LAST: a program of FEniCSx (dolfinx 0.5) whose ranks hand over their
pieces.

Heat spreads through a cube. Every few steps a step is added and the series so far is written, which `tetlod serve`
shows while the program goes on; at the end all ranks build the last step as a stream of its own. Points have their
numbers in the input mesh, so it does not show how dolfinx has partitioned it; but where sums are rounded otherwise, so
are values.

The library, for ctypes (`make install-mpi` installs the archive, `pkg-config --variable=libdir tetlod-mpi` says where):

    mpicc -shared -o libtetlod-mpi.so -Wl,--whole-archive libtetlod-mpi.a -Wl,--no-whole-archive libtetlod.a -lm
    export TETLOD_MPI_LIBRARY=$PWD/libtetlod-mpi.so
"""
import ctypes
import os
import sys

import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import LinearProblem
from mpi4py import MPI
from petsc4py.PETSc import ScalarType

# ---- the interface of tetlod_mpi.h

WRITE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
FLOAT64, IO_FAILED = 1, 1


class Array(ctypes.Structure):
    _fields_ = [('name', ctypes.c_char_p), ('components', ctypes.c_uint32), ('type', ctypes.c_int),
                ('values', ctypes.c_void_p)]


class Mesh(ctypes.Structure):
    _fields_ = [('struct_size', ctypes.c_size_t), ('vertices', ctypes.c_uint32), ('tets', ctypes.c_uint32),
                ('position_type', ctypes.c_int), ('positions', ctypes.c_void_p), ('corners', ctypes.c_void_p),
                ('field_count', ctypes.c_uint32), ('cell_field_count', ctypes.c_uint32),
                ('fields', ctypes.POINTER(Array)), ('cell_fields', ctypes.POINTER(Array))]


class Piece(ctypes.Structure):
    _fields_ = [('struct_size', ctypes.c_size_t), ('mesh', ctypes.POINTER(Mesh)), ('point_ids', ctypes.c_void_p),
                ('ghosts', ctypes.c_void_p)]


class Error(ctypes.Structure):
    _fields_ = [('status', ctypes.c_int), ('offset', ctypes.c_uint64), ('message', ctypes.c_char * 1024)]


library = ctypes.CDLL(os.environ.get('TETLOD_MPI_LIBRARY', 'libtetlod-mpi.so'), mode=ctypes.RTLD_GLOBAL)
Handle = ctypes.c_void_p if MPI._sizeof(MPI.Comm) == ctypes.sizeof(ctypes.c_void_p) else ctypes.c_int


def call(function, *arguments):
    """All ranks raise what one of them has failed with."""
    error = Error()
    if function(*arguments, ctypes.byref(error)):
        raise RuntimeError(error.message.decode())


class Pieces:
    """The mesh of this rank as a piece: cells of other ranks, which dolfinx keeps copies of, are marked. The points are
    those of dolfinx's geometry, the values those of a function of first order."""

    def __init__(self, domain, space, name):
        cells, geometry = domain.topology.index_map(3), domain.geometry
        count = cells.size_local + cells.num_ghosts
        self.corners = np.ascontiguousarray(geometry.dofmap.array.reshape(-1, 4)[:count], np.uint32)
        self.positions = np.ascontiguousarray(geometry.x, np.float64)
        self.ids = np.ascontiguousarray(geometry.input_global_indices, np.uint64)
        self.ghosts = np.arange(count, dtype=np.int64) >= cells.size_local
        self.dofs = space.dofmap.list.array.reshape(-1, 4)[:count]
        self.values = np.zeros(len(self.positions))
        self.field = Array(name.encode(), 1, FLOAT64, self.values.ctypes.data)
        self.mesh = Mesh(ctypes.sizeof(Mesh), len(self.positions), count, FLOAT64, self.positions.ctypes.data,
                         self.corners.ctypes.data, 1, 0, ctypes.pointer(self.field), None)
        self.piece = Piece(ctypes.sizeof(Piece), ctypes.pointer(self.mesh), self.ids.ctypes.data,
                           self.ghosts.ctypes.data)

    def take(self, function):
        function.x.scatter_forward()  # copies of points, too
        self.values[self.corners] = function.x.array[self.dofs]
        return ctypes.byref(self.piece)


def write_stream(comm, name, build):
    """The stream appears under its name when it is whole. build(write) calls the library; rank 0 writes."""
    part = open(name + '.part', 'wb') if comm.rank == 0 else None

    def write(_, data, size):
        return 0 if part.write(ctypes.string_at(data, size)) == size else IO_FAILED
    build(WRITE(write))
    if part:
        part.close()
        os.rename(name + '.part', name)


# ---- the program

SIZE, STEPS, EVERY, STEP = 8, 6, 2, 0.002


def main(series_name, last_name):
    comm, none, series = MPI.COMM_WORLD, ctypes.c_void_p(), ctypes.c_void_p()
    handle = Handle(MPI._handleof(comm))
    domain = mesh.create_unit_cube(comm, SIZE, SIZE, SIZE)
    space = fem.FunctionSpace(domain, ('CG', 1))
    heat, test, now = ufl.TrialFunction(space), ufl.TestFunction(space), fem.Function(space)
    now.interpolate(lambda x: 20 + 80 * np.exp(-20 * ((x[0] - 0.3) ** 2 + (x[1] - 0.4) ** 2 + x[2] ** 2)))
    spread = fem.Constant(domain, ScalarType(STEP)) * ufl.dot(ufl.grad(heat), ufl.grad(test)) * ufl.dx
    problem = LinearProblem(heat * test * ufl.dx + spread, now * test * ufl.dx, u=fem.Function(space),
                            petsc_options={'ksp_type': 'cg', 'pc_type': 'jacobi', 'ksp_rtol': 1e-10})
    pieces = Pieces(domain, space, 'heat')
    call(library.tetlod_build_comm_series_new, ctypes.byref(series), handle, none)
    for step in range(STEPS + 1):
        if step % EVERY == 0:
            call(library.tetlod_build_comm_series_add, series, pieces.take(now), ctypes.c_double(step * STEP))
            write_stream(comm, series_name,
                         lambda write: call(library.tetlod_build_comm_series_write, series, write, none))
        now.x.array[:] = problem.solve().x.array
    library.tetlod_build_comm_series_free(series)
    last = pieces.take(now)
    write_stream(comm, last_name, lambda write: call(library.tetlod_build_comm, handle, last, none, write, none))


if __name__ == '__main__':
    main(*sys.argv[1:3])
